"""`tautwave check`: check a rig file without touching a device."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    PATH,
    at_site,
    echo_json,
    json_option,
    out_option,
    rig_argument,
    set_option,
    simulate_option,
    site_option,
)
from tautwave.cli.terminal.checked import short_sections
from tautwave.cli.terminal.show import plain_text, show, verdict
from tautwave.files import make_directory, write_text, writing
from tautwave.tables import BAD, FAINT, GOOD, NOTE, Cell, Table


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
    help="Print the JSON Schema of rig files, for editors, and exit.",
)
@out_option(
    "Write check.json, all of it as text (check.txt), certificate.png, and the haptic performance "
    "of the rig (z-width.png, transparency.png, limit-cycle.png) into DIR as well; each figure "
    "also as SVG and PDF."
)
@set_option
@site_option
@simulate_option
@click.option(
    "--against",
    type=PATH,
    metavar="RUN",
    help="Print what was said of the rig in this older run, what is said now, and the keys whose "
    "former value keeps the former behaviour.",
)
@click.option(
    "--verbose",
    "-v",
    is_flag=True,
    help="Print everything: facts, allowances, claims, bus time, the full certificate.",
)
@click.pass_context
def check(
    ctx: click.Context,
    rig: Path,
    as_json: bool,
    out: Path | None,
    overrides: tuple[str, ...],
    site: str | None,
    simulate: bool | tuple[str, ...],
    against: Path | None,
    verbose: bool,
) -> None:
    """Check RIG. One screen: what its axes may supply, verdicts, what to decide, what would help.

    The last line says whether it may run. Facts, allowances, bus time and every sentence of the
    certificate are behind --verbose, in --json and in the files of --out.

    \b
    Examples:
        tautwave check configs/bench-1dof-loopback.yaml
        tautwave check rig.yaml --set coupling.delay_s=0.1 --json
        tautwave check rig.yaml --out checked
        tautwave check rig.yaml --against runs/last-year
        tautwave check --schema > rig.schema.json
    """
    from tautwave.config import load_rig

    loaded = load_rig(rig, at_site(overrides, site))
    from tautwave import session

    brief = not (verbose or as_json or out is not None)
    result = session.check(loaded, simulate=simulate, brief=brief)
    if out is not None:
        _keep(out, loaded, result)
    halves = {}
    if loaded.sites is not None and loaded.site is None:
        for side in ("master", "slave"):
            half = load_rig(rig, at_site(overrides, side))
            halves[side] = session.check(half, simulate=own_buses(half, simulate), brief=brief)
    compared = None if against is None else _against(against, loaded, result)
    if as_json:
        sites = {side: half.as_dict() for side, half in halves.items()}
        more: dict[str, Any] = {"sites": sites} if sites else {}
        if compared is not None:
            more["against"] = {**compared._asdict(), "keys": [k._asdict() for k in compared.keys]}
        echo_json(result.as_dict() | more)
    else:
        by_site = [Table("", ("by --site", ""), list(_halves(halves)))] if halves else []
        if compared is not None:
            by_site += _against_sections(str(against), compared, verbose)
        typed = f"tautwave check {shlex.quote(str(rig))}"
        show(check_sections(loaded.name, result, verbose, command=typed, more=by_site))
    ctx.exit(max((result.exit_code, *(half.exit_code for half in halves.values()))))


def _against(directory: Path, loaded: Any, result: Any) -> Any:
    from tautwave.session.upgrading import compare_with_run

    return compare_with_run(directory, loaded, result.certificate)


MAX_KEYS = 6
"""Keys that a screen has of those that differ from an older run."""


def _against_sections(name: str, found: Any, verbose: bool) -> list[Table]:
    """Return what an older run said, what is said now, and the keys that differ."""
    verdicts: list[tuple[str | Cell, ...]] = [(*one,) for one in found.verdicts]
    verdicts.append((f"{found.alike} others", "the same", "the same"))
    lines = list(_changed_keys(found, verbose))
    if not lines:
        lines = ["none" if not found.verdicts else "none: what is computed from them has changed"]
    return [
        Table(f"Against {name}", ("said of", f"then ({found.version})", "now"), verdicts),
        Table("Keys that differ", ("",), [(line,) for line in lines]),
    ]


def _changed_keys(found: Any, verbose: bool) -> Iterator[str]:
    """Yield a line on each key that differs and one that keeps it, then those gone and new."""
    from tautwave.cli.terminal.screen import COLUMNS, folded

    changed = [one for one in found.keys if one.keeps]
    for one in changed if verbose else changed[:MAX_KEYS]:
        said, keeps = f"{one.key}: {one.then} then, {one.now} now", f"  {one.keeps}"
        if not verbose and len(keeps) > COLUMNS - 2:
            said, keeps = f"{one.key}: another value", "  --verbose has it, and the option"
        yield said if verbose else folded("", said, 0)
        yield keeps
    if not verbose and len(changed) > MAX_KEYS:
        yield f"{len(changed) - MAX_KEYS} more: --verbose"
    gone = [one.key for one in found.keys if not one.now]
    new = [one.key for one in found.keys if not one.then]
    for keys, words in ((gone, "no key any more"), (new, f"new since ({len(new)})")):
        if keys:
            said = f"{words}: {', '.join(keys)}"
            yield said if verbose else folded("", said, 0)
        if keys is gone and gone:
            yield "  tautwave new NEW.yaml --from RUN writes them as they are called now"


def own_buses(half: Any, simulate: bool | tuple[str, ...]) -> bool | tuple[str, ...]:
    """Return those of the buses to simulate that one site has."""
    if isinstance(simulate, bool):
        return simulate
    return tuple(name for name in simulate if name in half.own_buses)


def _halves(halves: Mapping[str, Any]) -> Iterator[tuple[str | Cell, ...]]:
    """Yield whether each site's half may run."""
    for side, half in halves.items():
        good = half.exit_code == 0
        why = "; ".join(half.failures) or "its own half is certified as required"
        yield side, Cell(f"{'may' if good else 'may not'} run: {why}", GOOD if good else BAD)


def check_sections(
    name: str,
    result: Any,
    verbose: bool = False,
    *,
    command: str = "tautwave check RIG",
    more: Sequence[Table] = (),
) -> list[Table]:
    """Show a `session.CheckResult` on a screen; `verbose`: all of it. The verdict is last.

    `command` is what a user has typed, `more` what stands before the verdict.
    """
    from tautwave.session.facts import ALLOWANCE_HEADS, AXIS_HEADS, PAIR_HEADS

    facts = [(label, str(value)) for label, value in result.facts]
    if verbose:
        return [
            Table(name, (), ()),
            Table("Facts", ("", ""), facts),
            Table("Pairs", PAIR_HEADS, result.pairs),
            Table("Axes", AXIS_HEADS, result.axes),
            Table("Plan", ("element", "", "because"), list(_plan(result.plan))),
            Table("Allowance", ALLOWANCE_HEADS, result.allowance),
            Table("Claims", CLAIM_HEADS, list(_claims(result.claims))),
            Table("Bus time", BUS_HEADS, list(_buses(result.budget, arithmetic=True))),
            *certificate_sections(result.certificate),
            *more,
            _last(name, result, verbose),
        ]
    return short_sections(name, result, [*more, _last(name, result, verbose)], command)


CLAIM_HEADS = ("port", ">prompt", ">gap", ">gives", ">let go", ">dead", ">kinetic", "claim")
BUS_HEADS = ("bus", ">time needed", ">greatest rate", "")


def _claims(claims: Sequence[Any]) -> Iterator[tuple[str | Cell, ...]]:
    """Yield the joules of each port beside the kinetic energy that its device may have anyway.

    While the host is prompt; in the longest gap between two samples, whatever moves the device, and
    where it is let go; of a dead host until the drive acts by itself.
    """
    from tautwave.report.units import quantity

    def energy(value: float | None) -> str:
        if value is None:
            return "-"
        return "no bound" if value == math.inf else quantity(value, "J", 3)

    for claim in claims:
        one, kinetic = claim.stated, energy(claim.kinetic_j)
        if one is None:
            yield claim.axis, energy(claim.claim_j), "-", "-", "-", "-", kinetic, "-"
            continue
        says = {
            "passed": Cell("passed", GOOD),
            "conditional": Cell("depends", NOTE),
            "refused": Cell("refused", BAD),
        }
        yield (
            claim.axis,
            energy(one.prompt_j),
            quantity(one.gap_s, "s", 3),
            energy(one.stall_j),
            energy(one.let_go_j),
            energy(one.dead_j),
            kinetic,
            says.get(claim.judged, "-") if claim.kinetic_j else "-",
        )


def _last(name: str, result: Any, verbose: bool) -> Table:
    """Return a line for each failure, and whether the rig may run."""
    more = "--verbose shows all: facts, allowances, claims, bus time, every sentence."
    rows: list[tuple[str | Cell, ...]] = [] if verbose else [(Cell(more, FAINT),)]
    rows += [(Cell(why, BAD),) for why in result.failures]
    if result.exit_code == 0:
        rows.append((Cell(f"{name}: may run.", GOOD),))
    else:
        why = {3: "not certified as required", 4: "rate too high for a bus"}.get(
            result.exit_code, ""
        )
        reason = f": {why}" if why else ""
        rows.append((Cell(f"{name}: may not run{reason} (exit code {result.exit_code}).", BAD),))
    return Table("", ("",), rows)


def certificate_sections(certificate: Mapping[str, Any]) -> list[Table]:
    """The three verdicts with their conditions, then the results element by element."""
    verdicts = certificate.get("verdicts")
    if not isinstance(verdicts, Mapping) or not verdicts:
        return [Table("Certificate", ("", ""), [("passive", verdict(certificate.get("passed")))])]
    rows: list[tuple[str | Cell, ...]] = []
    for name, judged in verdicts.items():
        required = " (required)" if name == certificate.get("require") else ""
        label = f"{str(name).replace('_', ' ')}{required}"
        rows.append((label, verdict(judged["passed"], judged["state"]), judged["reason"]))
        rows.extend(("", "", Cell(f"if {condition}", NOTE)) for condition in judged["conditions"])
    elements = [
        (sentence,) for element in certificate["elements"] for sentence in element["sentences"]
    ]
    loops = [(loop["verdict"]["reason"],) for loop in certificate["loops"]]
    return [
        Table("Certificate", ("", "", ""), rows),
        Table("Element by element", ("",), elements),
        Table("In the loop", ("",), loops),
    ]


def _plan(plan: Sequence[tuple[str, str, str]]) -> Iterator[tuple[str | Cell, ...]]:
    for element, state, reason in plan:
        if state == "in":
            yield element, state, reason
        else:
            yield Cell(element, FAINT), Cell(state, FAINT), Cell(reason, FAINT)


def _buses(budget: Mapping[str, Any], *, arithmetic: bool) -> Iterator[tuple[str | Cell, ...]]:
    from tautwave.report.units import quantity

    for bus, cost in budget.items():
        if cost is None:
            yield bus, Cell("not yet evaluated", NOTE), "", ""
        else:
            time_s, greatest_rate_hz, steps, remedy = cost
            note = "\n".join(filter(None, (steps, remedy))) if arithmetic else ""
            yield bus, quantity(time_s, "s", 3), quantity(greatest_rate_hz, "Hz", 3), note


def _keep(out: Path, rig: Any, result: Any) -> None:
    """Write all results into a directory: text, data and pictures.

    Raises
    ------
    WritingError
        Something cannot be written.
    """
    said = check_sections(rig.name, result, verbose=True)
    data = result.as_dict()
    certified = bool(result.certificate.get("verdicts"))
    if certified:
        from tautwave.certificate.haptics import haptics

        panels = haptics(rig)
        data["haptics"] = panels.as_dict()
        chapters = panels.sentences()
        more = [Table(head, ("",), [(line,) for line in lines]) for head, lines in chapters]
        said = [*said[:-1], *more, said[-1]]
    make_directory(out)
    write_text(out / "check.json", json.dumps(data, indent=2, ensure_ascii=False) + "\n")
    write_text(out / "check.txt", plain_text(said))
    if certified:
        from tautwave.certificate.haptics.pictures import draw_haptics
        from tautwave.certificate.picture import draw_certificate

        path = out / "certificate.png"
        with writing(path):
            try:
                draw_certificate(rig, path)
            except OSError:
                path.unlink(missing_ok=True)
                raise
        draw_haptics(rig.name, panels, out)
