"""`tautwave identify RIG --load`: what weighs on an arm's joints, or on one axis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tautwave.cli.options import echo_json


def run_load(source: Path, options: Mapping[str, Any]) -> None:
    """Identify and show the loads of a rig's side or axis."""
    from tautwave.cli.terminal.moving import moved
    from tautwave.cli.terminal.show import show
    from tautwave.config import load_rig
    from tautwave.session.identification.weighing import identify_load

    loaded = load_rig(source, options["overrides"])
    with moved(loaded, options, "moving slowly") as (_, given):
        result = identify_load(loaded, axis=options["axis"], reach=options["reach"], **given)
    if options["as_json"]:
        echo_json(result.as_dict())
    else:
        show(load_sections(result))


def load_sections(result: Any) -> list[Any]:
    """What was found, what it leaves of the efforts, lines for the rig file, files."""
    from tautwave.tables import Table

    rows = []
    for weight in result.weights:
        estimate = weight.estimate
        ends = (f"{estimate.value:.5g}", f"{estimate.lower:.5g} to {estimate.upper:.5g}")
        rows.append((weight.joint, weight.name, *ends, f"{weight.believed:.5g}"))
    left = [
        (name, f"{after:.3g}", f"{before:.3g}", f"{coulomb.value:.3g}", f"{damping.value:.3g}")
        for name, after, before, coulomb, damping in zip(
            result.axes,
            result.fit.after,
            result.fit.before,
            result.fit.coulomb,
            result.fit.damping,
            strict=True,
        )
    ]
    heads = ("joint", ">effort left, rms", ">versus the rig file", ">Coulomb", ">viscous")
    lines = [(line,) for line in result.snippet.splitlines()]
    return [
        Table(f"Moved slowly for {result.duration_s:g} s", (), ()),
        Table("Load", ("joint", "", ">value", ">95 % interval", ">believed"), rows),
        Table("Joints", heads, left),
        Table("For the rig file", ("",), lines),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(result.directory / "identification.json"),)]),
    ]
