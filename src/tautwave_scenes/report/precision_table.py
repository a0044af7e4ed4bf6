"""The report's section on the precision of a scene, as sentences and tables of text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tautwave.report.run.rundir import block
from tautwave.report.units import number, quantity, share
from tautwave.tables import Table, of_numbers

_HEAD = of_numbers(
    *("", "position, rms", "of the travel", "effort, greatest", "effort, rms"),
    *("of the greatest", "level", "alike for"),
)
_ROWS = {
    "oracle": "error of this run",
    "doubt": "uncertainty of the oracle",
    "half": "at half the rate",
    "double": "at double the rate",
}


def scene_sentences(precision: dict[str, Any]) -> Iterator[str]:
    """Yield sentences on the replay: its span, its oracle and its engine."""
    oracle = block(precision, "oracle")
    scheme = str(precision.get("scheme")).replace("_", " ")
    span = quantity(precision["span_s"], "s", 3)
    begins = number(precision.get("begins_s")) or 0.0
    reach = f"the whole run, {span}"
    if not precision.get("whole"):
        reach = f"the first {span} of the run"
        if begins > 0.0:
            reach = f"{span} of the run, from {quantity(begins, 's', 3)} on, where it is felt first"
    yield (
        f"The network was simulated again along the recorded positions of its ports, over "
        f"{reach}: with {oracle.get('steps')} steps per period "
        f"({str(oracle.get('scheme')).replace('_', ' ')}, the ports moving within it), the oracle, "
        f"which shows the error of the scheme ({scheme}) and the hold; and at half and double the "
        "rate, which shows the effect of sampling. Hand and device are not part of it: the motion "
        "of the ports is given."
    )
    if not precision.get("whole"):
        why = ""
        if precision.get("engine") == "python":
            puts = "`tautwave bench workprecision RIG`"
            if precision.get("space"):
                puts = "A run with `scene.engine: compiled`"
            why = (
                f": the compiled steps are not in the cache. {puts} puts them there, and "
                "`tautwave report` then takes all"
            )
        yield f"Limited to keep the report quick{why}."
    equal = precision.get("replayed_equal")
    if equal is True:
        yield "At its own rate the replay reproduces the recorded efforts bit for bit."
    elif precision.get("replayed") is not None:
        gap = quantity(precision["replayed"], "N", 2)
        yield f"At its own rate the replay differs from the recorded efforts by {gap} at most."


def scene_tables(precision: dict[str, Any]) -> Iterator[Table]:
    """Yield the table of differences, and that of the strings' pitches."""
    travel, greatest = number(precision.get("travel")), number(precision.get("effort"))
    rows = []
    for key, name in _ROWS.items():
        part = block(precision, key)
        if not part:
            continue
        level = number(part.get("level_db"))
        apart = number(part.get("apart_s"))
        rows.append(
            (
                name,
                quantity(part.get("position_rms"), "m", 3),
                share(number(part.get("position_rms")), travel),
                quantity(part.get("effort"), "N", 3),
                quantity(part.get("effort_rms"), "N", 3),
                share(number(part.get("effort_rms")), greatest),
                "" if level is None else decibels(level),
                "all of it" if apart is None else quantity(apart, "s", 3),
            )
        )
    yield Table("Scene: differences of nodes and efforts", _HEAD, tuple(rows), _note(precision))
    strings = block(precision, "strings")
    if strings:
        head = of_numbers("string", "asked", "at this rate", "half the rate", "double the rate")
        pitches = tuple(
            (name, *(f"{pitch[key]:.5g} Hz" for key in ("asked_hz", "own", "half", "double")))
            for name, pitch in strings.items()
        )
        yield Table("Pitch of a string of whole samples", head, pitches)


def decibels(level: float) -> str:
    """Return a level with its sign; below a thousandth of a decibel it is zero."""
    if abs(level) < 5e-4:
        return "0 dB"
    return f"{level:+.3f} dB".replace("-", "\N{MINUS SIGN}")


def _note(precision: dict[str, Any]) -> str:
    notes = ["Efforts are means over each period of the run; level compares their rms"]
    if precision.get("scheme") == "rk4":
        notes.append(
            "those of rk4 are of its samples, the oracle's of the period before, so half a "
            "period's change of the effort counts as error and falls with the first power of the "
            "step"
        )
    if any(block(precision, key).get("apart_s") is not None for key in _ROWS):
        notes.append("errors are counted until the nodes are a tenth of their travel apart")
        if block(precision, "oracle").get("scheme") != "exact":
            notes.append(
                "contacts met again and again, and sticking and slipping, double any difference "
                "each time, so that two runs eventually diverge, however small the step; only "
                "their level stays comparable"
            )
    error = number(block(precision, "oracle").get("position_rms")) or 0.0
    if (number(block(precision, "doubt").get("position_rms")) or 0.0) > 0.5 * error > 0.0:
        notes.append(
            "the oracle's own uncertainty is as large as the run's error: sample by sample this "
            "scene does not converge with smaller steps"
        )
    if precision.get("strings"):
        notes.append(
            "the oracle's string has the pitch of the run's; other rates have their own pitch, "
            "and diverge"
        )
    return "; ".join(notes) + "."
