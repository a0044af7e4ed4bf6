"""`tautwave identify RECORDING --chain`: the masses of a whole arm."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tautwave.cli.options import echo_json, stated_of

NAMES = ("chain", "tip", "position", "effort", "time", "filter_hz", "begin_s", "end_s")


def run_chain(source: Path, options: Mapping[str, Any]) -> None:
    """Identify and show the bodies of a chain."""
    from tautwave.cli.run import fresh_directory
    from tautwave.cli.terminal.show import show
    from tautwave.session.identification.chain import identify_chain
    from tautwave.session.identification.recorded import save_result

    result = identify_chain(
        source, stated=stated_of(options), **{name: options[name] for name in NAMES}
    )
    directory = fresh_directory(options["out"], f"identify-{source.resolve().stem}")
    path = save_result(result.as_dict(), directory)
    if options["as_json"]:
        echo_json(result.as_dict())
    else:
        show(chain_sections(result, path))


def chain_sections(result: Any, path: Path) -> list[Any]:
    """What the motion tells, bodies that say the same, friction, lines for the file, notes."""
    from tautwave.tables import Table

    fit = result.fit
    base = [
        (
            fit.base.name(number, result.joints),
            f"{estimate.value:.5g}",
            f"{estimate.lower:.5g} to {estimate.upper:.5g}",
            f"{believed:.5g}",
            "" if told else "as believed",
        )
        for number, (estimate, believed, told) in enumerate(
            zip(fit.found, fit.believed, fit.told, strict=True)
        )
    ]
    bodies = [
        (
            name,
            f"{body.mass.value:.4g}",
            f"{body.mass.lower:.3g} to {body.mass.upper:.3g}",
            " ".join(f"{value:.3g}" for value in one.centre),
        )
        for name, body, one in zip(result.joints, fit.bodies, result.inertials, strict=True)
    ]
    joints = [
        (
            name,
            f"{coulomb.value:.3g}",
            f"{viscous.value:.3g}",
            f"{offset.value:.3g}",
            f"{left:.3g}",
            f"{with_bodies:.3g}",
        )
        for name, (coulomb, viscous, offset), left, with_bodies in zip(
            result.joints, fit.friction, fit.residual, fit.bodies_residual, strict=True
        )
    ]
    heads = ("joint", ">Coulomb", ">viscous", ">offset", ">effort left, rms", ">by bodies")
    said = f"{result.source}: {len(result.joints)} joints, {result.samples} samples at "
    return [
        Table(f"{said}{result.rate_hz:.4g} Hz", (), ()),
        Table("Told by the motion", ("sum", ">value", ">95 % interval", ">believed", ""), base),
        Table("Bodies", ("joint", ">mass [kg]", ">95 % interval", ">centre [m]"), bodies),
        Table("Joints", heads, joints),
        Table("For the file", ("",), [(line,) for line in result.snippet.splitlines()]),
        Table("Notes", ("",), [(note,) for note in result.notes]),
        Table("Files", ("",), [(str(path),)]),
    ]
