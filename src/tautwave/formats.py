"""Format versions of the files that outlive a run.

A recording or a summary without a version is of version 1, a rig file of the newest.

Raise a version when the meaning of a file's content changes, or when the previous reader cannot
read it; a new key with a default does not need it. Keep reading older versions, or say here what to
do with them.
"""

from __future__ import annotations

from typing import Final

RIG = 2
"""Rig files, `rig.yaml` of a run among them: key `format`.

2: the ports of law wave filter and observe, so `coupling.wave_filter_hz` is a key of each pair,
`drift_time_s` is gone, and so is `velocity_filter_s` where nothing else reads it. A file of version
1 is read if it has none of them; else each is refused with its replacement.
"""

RECORDING = 1
"""`recording.mcap`: key `format` of the metadata `tautwave`."""


SUMMARY: Final = 2
"""`summary.json` of a run: key `format`, 1 where there is none.

2: what was a sentence to be parsed back is an object (unused elements, faults), and every key is
declared (`tautwave.summary`).
"""


def too_new(kind: str, given: object, known: int) -> str | None:
    """Return why a file of version `given` cannot be read, with the remedy; None if it can.

    A value that is not a version is not checked here.
    """
    text = str(given)
    if isinstance(given, bool) or not text.isdecimal():
        return None
    if len(text) < 10 and int(text) <= known:
        return None
    return (
        f"{given} is newer than the {kind} format {known} that this tautwave reads; "
        "pip install --upgrade tautwave"
    )
