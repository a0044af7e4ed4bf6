"""Every error tautwave raises deliberately, and its exit code.

TautwaveError
├── ConfigError (ValueError)          2  the rig file or an argument is wrong
│   └── UnchosenKeyError              2  a law cannot choose a key that is left to it
├── NotCertifiedError                 3  the rig is not certified, or no longer
├── BusBudgetError                    4  the rig is faster than its bus, or than this machine
├── DriverError                       5  a bus or a device failed
│   ├── BusTimeout (TimeoutError)     5  nothing answered in time
│   ├── DeviceFault                   5  a device reported a fault
│   └── SettingsDifferError           5  lasting settings differ, and may not be written
├── LinkError                         5  the other site is lost
├── SafetyStop                        6  a limit or a guard ended the run
└── RecordingError (OSError)          2  a recording cannot be read
    └── WritingError                  7  a recording, or what is made of it, cannot be written
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class TautwaveError(Exception):
    """Root of all errors; `record` holds the rows of the last cycles, newest last, if any."""

    exit_code = 1

    def __init__(self, message: str, record: Sequence[Any] = ()) -> None:
        super().__init__(message)
        self.record = tuple(record)


class ConfigError(TautwaveError, ValueError):
    """A rig file or an argument is wrong; `problems` holds one sentence for each mistake."""

    exit_code = 2

    def __init__(self, problems: str | Sequence[str]) -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class UnchosenKeyError(ConfigError):
    """A key of a rig file that is left to its law, which cannot choose it; `path` names it."""

    def __init__(self, path: tuple[str, ...], text: str) -> None:
        self.path = path
        super().__init__(f"{'.'.join(path)}: {text}")


class NotCertifiedError(TautwaveError):
    """The rig does not have the certificate that it requires."""

    exit_code = 3


class BusBudgetError(TautwaveError):
    """The rig's rate does not fit on its bus, or this machine cannot step its scene that fast."""

    exit_code = 4


class DriverError(TautwaveError):
    """A bus or a device failed. The message states which, where, and what to do."""

    exit_code = 5


class BusTimeout(DriverError, TimeoutError):
    """No answer by the deadline."""


class DeviceFault(DriverError):
    """A device reported a fault of its own."""


class SettingsDifferError(DriverError):
    """Lasting settings differ; `differences` are sentences, of all devices of `buses`."""

    def __init__(self, buses: Sequence[str], differences: Sequence[str]) -> None:
        self.buses, self.differences = tuple(buses), tuple(differences)
        listed = "".join(f"\n  {one}" for one in differences)
        super().__init__(
            f"bus {', '.join(buses)}: lasting settings differ:{listed}\n"
            "run once with --configure to write them into the devices"
        )


class LinkError(TautwaveError):
    """The link to the other site failed."""

    exit_code = 5


class SafetyStop(TautwaveError):
    """A limit or a guard ended the run; the axes were brought to their safe command first."""

    exit_code = 6


class RecordingError(TautwaveError, OSError):
    """A recording cannot be read; or not be written, if it is a `WritingError`."""

    exit_code = 2


class WritingError(RecordingError):
    """A recording, or a summary, report or table, cannot be written, or not completely."""

    exit_code = 7
