"""What a recording says of itself beside its rows."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version

from tautwave.config import Rig
from tautwave.recordings.layout import DESCRIBED
from tautwave.report.columns import described_text


def metadata_of(rig: Rig, clock: str, columns: Iterable[str], **more: str) -> dict[str, str]:
    """Return version, rig, clock, and unit and meaning of each column.

    Parameters
    ----------
    rig, clock
        What runs, and on which clock.
    columns : iterable of str
        Names of what is recorded.
    more : str
        What else is said.
    """
    about = {"version": version("tautwave"), "rig": rig.name, "clock": clock}
    return {**about, DESCRIBED: described_text(rig, columns), **more}
