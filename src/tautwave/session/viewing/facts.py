"""What `live.json` says of a run to its viewers, and the mailbox they write to."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from tautwave.config import Rig
from tautwave.controller.stops import position_unit
from tautwave.rig import Assembly
from tautwave.runtime.loop import LoopResult
from tautwave.runtime.operate.journal import Entry, Journalled
from tautwave.runtime.operate.mailbox import Mailbox
from tautwave.runtime.recorder import Recorder
from tautwave.runtime.unwatched import may_be_enabled

MAX_TEXT = 300


@contextmanager
def mailbox_of(rig: Rig, clock: str) -> Iterator[Mailbox | None]:
    """Give an operated rig on the real clock a mailbox; nobody can follow a fake one."""
    if rig.operate is None or clock != "real":
        yield None
        return
    with Mailbox() as mailbox:
        yield mailbox


def facts_of(
    rig: Rig, certificate: Mapping[str, Any], mailbox: Mailbox | None = None
) -> dict[str, Any]:
    """Return what viewers need beside the rows: whose run it is, and its certificate."""
    kept = ("passed", "state", "require", "sentences")
    return {
        "rig": rig.name,
        "pid": os.getpid(),
        "units": {name: position_unit(rig.master.axes[name].kind) for name in rig.coupling.pairs},
        "certificate": {key: certificate[key] for key in kept},
        "mailbox": None if mailbox is None else mailbox.address,
    }


def tell_end(assembly: Assembly, recorder: Recorder, result: LoopResult) -> None:
    """Let viewers read why a run ended, if not as it was meant to."""
    enabled = may_be_enabled(bus.driver for bus in assembly.buses)[:MAX_TEXT]
    cause = str(result.error or "")[: max(0, MAX_TEXT - len(enabled) - 2)]
    ended = "; ".join(filter(None, (cause, enabled)))
    if not ended:
        return
    at_s = (result.cycles + result.missed_cycles) * assembly.control.run.period_ns * 1e-9
    entry = Entry(round(at_s, 9), "fault", "run", "ended", ended)
    if isinstance(assembly.control, Journalled):
        assembly.control.journal.note(entry)
    else:
        recorder.tell(json.dumps([(1, entry._asdict())]))


def tell_viewers(assembly: Assembly, recorder: Recorder) -> None:
    """Let viewers read the newest entries of an operated rig's journal."""
    if isinstance(assembly.control, Journalled):
        assembly.control.journal.tell = recorder.tell
