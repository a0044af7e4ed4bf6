"""`tautwave check`: what a rig file says, without touching a device."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import echo_json, json_option, out_option, rig_argument, set_option
from tautwave.cli.show import BAD, FAINT, NOTE, Cell, Section, show
from tautwave.errors import ConfigError


def _print_schema(ctx: click.Context, param: click.Parameter, wanted: bool) -> None:
    if not wanted or ctx.resilient_parsing:
        return
    from tautwave.config import rig_schema

    echo_json(rig_schema())
    ctx.exit(0)


@click.command(short_help="Check a rig file; touches no device.")
@rig_argument
@json_option
@click.option(
    "--schema",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_schema,
    help="Print the JSON Schema of a rig file, for editors, and stop.",
)
@out_option("Write check.json and a picture, certificate.png, into DIR as well.")
@set_option
@click.pass_context
def check(
    ctx: click.Context,
    rig: Path,
    as_json: bool,
    out: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Check RIG: its keys, what is in and left out, bus time, certificate.

    \b
    Examples:
        tautwave check configs/bench-1dof-loopback.yaml
        tautwave check rig.yaml --set coupling.delay_s=0.1 --json
        tautwave check rig.yaml --out checked
        tautwave check --schema > rig.schema.json
    """
    from tautwave.config import load_rig

    loaded = load_rig(rig, overrides)
    from tautwave import session

    result = session.check(loaded)
    if out is not None:
        _write(out, result.as_dict())
        if result.certificate.get("verdicts"):
            _draw(out, loaded)
    if as_json:
        echo_json(result.as_dict())
    else:
        show(check_sections(loaded.name, result))
    ctx.exit(result.exit_code)


def check_sections(name: str, result: Any) -> list[Section]:
    """Facts, plan, bus time and certificate of a `session.CheckResult`."""
    headline = f"{name}: the rig file is right"
    if result.exit_code:
        headline = f"{name}: the rig file is right, but the rig may not run"
    return [
        Section(headline, (), (), "bold" if result.exit_code == 0 else BAD),
        Section("Facts", ("", ""), [(label, str(value)) for label, value in result.facts]),
        Section("Plan", ("element", "", "because"), list(_plan(result.plan))),
        Section("Bus time", ("bus", ">needed", ">greatest rate", ""), list(_buses(result.budget))),
        *certificate_sections(result.certificate),
    ]


def certificate_sections(certificate: Mapping[str, Any]) -> list[Section]:
    """The three verdicts with what they rest on, then what was found, element by element."""
    from tautwave.cli.summary import verdict

    told = certificate.get("verdicts")
    if not isinstance(told, Mapping) or not told:
        return [Section("Certificate", ("", ""), [("passive", verdict(certificate.get("passed")))])]
    rows: list[tuple[str | Cell, ...]] = []
    for name, found in told.items():
        required = " (required)" if name == certificate.get("require") else ""
        label = f"{str(name).replace('_', ' ')}{required}"
        rows.append((label, verdict(found["passed"], found["state"]), found["reason"]))
        rows.extend(("", "", Cell(f"if {condition}", NOTE)) for condition in found["conditions"])
    elements = [
        (sentence,) for element in certificate["elements"] for sentence in element["sentences"]
    ]
    loops = [(loop["verdict"]["reason"],) for loop in certificate["loops"]]
    return [
        Section("Certificate", ("", "", ""), rows),
        Section("Element by element", ("",), elements),
        Section("In the loop", ("",), loops),
    ]


def _plan(plan: Sequence[tuple[str, str, str]]) -> Iterator[tuple[str | Cell, ...]]:
    for element, state, reason in plan:
        if state == "in":
            yield element, state, reason
        else:
            yield Cell(element, FAINT), Cell(state, FAINT), Cell(reason, FAINT)


def _buses(budget: Mapping[str, Any]) -> Iterator[tuple[str | Cell, ...]]:
    from tautwave.report.units import quantity

    for bus, cost in budget.items():
        if cost is None:
            yield bus, Cell("not yet evaluated", NOTE), "", ""
        else:
            time_s, greatest_rate_hz, arithmetic, remedy = cost
            told = f"{arithmetic}\n{remedy}" if remedy else arithmetic
            yield bus, quantity(time_s, "s", 3), quantity(greatest_rate_hz, "Hz", 3), told


def _draw(out: Path, rig: Any) -> None:
    from tautwave.certificate.picture import draw_certificate

    try:
        draw_certificate(rig, out / "certificate.png")
    except OSError as err:
        raise ConfigError(f"{out}: certificate.png cannot be written: {err.strerror}") from err


def _write(out: Path, result: Any) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "check.json").write_text(json.dumps(result, indent=2, ensure_ascii=False) + "\n")
    except OSError as err:
        raise ConfigError(f"{out}: check.json cannot be written: {err.strerror}") from err
