"""`Session`: an operated rig controlled by a program that engages and clutches it."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from tautwave.clock import MonotonicClock
from tautwave.config import Rig, resolved_yaml
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, RecordingError
from tautwave.runtime.operate.journal import AGAIN, VERDICTS
from tautwave.runtime.operate.states import STATES
from tautwave.runtime.tap import LIVE, Live, Tap

RUN = (sys.executable, "-c", "from tautwave.cli import main; main()", "run")
LOOK_NS = 20_000_000
BEGIN_NS = 60_000_000_000
"""Certificate and devices may take that long before the first row."""


class Session:
    """A rig with an `operate` block, run in a process of its own on the real clock.

    The program may be arbitrarily slow: the loop does not wait for it. Leaving the `with` block
    stops the run and waits for its report.

    Parameters
    ----------
    rig : Rig
        With an `operate` block.
    out : Path
        Directory of the run, new or empty.
    options : sequence of str
        More options of `tautwave run`, such as `--configure`.

    Raises
    ------
    ConfigError
        The rig has no `operate` block.

    Examples
    --------
    >>> with Session(load_rig("arms.yaml"), out="runs/arms") as session:  # doctest: +SKIP
    ...     session.engage()
    ...     session.wait_for("engaged")
    ...     print(session.row()["j1.position_error"])
    """

    def __init__(self, rig: Rig, *, out: Path | str, options: Sequence[str] = ()) -> None:
        if rig.operate is None:
            raise ConfigError("Session: the rig has no `operate` block; write `operate: {}`")
        self.directory = Path(out)
        self.exit_code: int | None = None
        self._text = resolved_yaml(rig)
        self._options = (*options, *_site_options(rig))
        self._child: subprocess.Popen[bytes] | None = None
        self._live: Live | None = None
        self._tap: Tap | None = None
        self._newest: list[float] = []
        self._whole: list[float] = []
        self._valid: list[int] = []
        self._clock = MonotonicClock()
        self._said = ""

    def __enter__(self) -> Self:
        with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
            file.write(self._text)
            file.flush()
            order = (
                "--quiet",
                "--commands",
                "-",
                "--end-with-input",
                "--out",
                str(self.directory),
                *self._options,
            )
            self._child = subprocess.Popen(
                (*RUN, file.name, *order),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C here ends the block, which stops the run
            )
            self._wait_for_rows()
        return self

    def __exit__(self, *exc_info: object) -> None:
        with suppress(OSError, RecordingError):
            self.stop()
        self.wait()

    # -- commands ---------------------------------------------------------------------------

    def engage(self) -> None:
        """Align if needed, and engage once all axes are at rest."""
        self._send("engage")

    def clutch(self) -> None:
        """Disengage: the master is free, the slave is held by damping."""
        self._send("clutch")

    def hold(self) -> None:
        """Hold every axis with certified damping."""
        self._send("hold")

    def rest(self) -> None:
        """Go back to idle, and acknowledge a fault."""
        self._send("rest")

    def scale(self, factor: float) -> None:
        """Change the scale to a factor of the rig's `operate.scales`, or back to 1."""
        self._send(f"scale {factor:g}")

    def lead(self, positions: Mapping[str, float]) -> None:
        """Send an action to the hands driven by a policy: positions of master axes, by pair.

        The rig's `operate.policy`, or the reference `type: policy` of a simulated master's hand,
        defines how it is followed. While a person leads, it means nothing. After three
        consecutive frames without an action the rig holds until it is engaged again.

        Raises
        ------
        ConfigError
            A position is not a finite number; nothing is sent then.
        RecordingError
            The run has ended.
        """
        wrong = [name for name, x in positions.items() if not math.isfinite(x)]
        if wrong:
            raise ConfigError(
                f"{self.directory}: action {wrong[0]} is {positions[wrong[0]]}, not a position; "
                "nothing was sent, and the rig holds after three frames without an action"
            )
        self._send("lead " + " ".join(f"{name}={x!r}" for name, x in positions.items()))

    def take_over(self) -> None:
        """Let a person lead instead of the policy, in a rig with `operate.policy`."""
        self._send("take_over")

    def hand_back(self) -> None:
        """Let the policy lead again, from where the master is."""
        self._send("hand_back")

    def begin_episode(self, name: str, task: str = "") -> None:
        """Begin an episode.

        Raises
        ------
        ConfigError
            Its name is not a single word, or is one that ends an episode.
        """
        if len(name.split()) != 1 or name.strip() in (*VERDICTS, AGAIN):
            words = " and ".join((*VERDICTS, AGAIN))
            raise ConfigError(
                f"episode {name[:40]!r}: its name must be a single word other than {words}"
            )
        self._send(" ".join(("episode", name.strip(), *task.split())))

    def end_episode(self, success: bool | None = None) -> None:
        """End the current episode."""
        verdict = "" if success is None else " success" if success else " failed"
        self._send(f"episode{verdict}")

    def record_again(self) -> None:
        """Discard the current episode, or else the last one: it is to be recorded again."""
        self._send(f"episode {AGAIN}")

    def stop(self) -> None:
        """Ramp down and end the run."""
        self._send("stop")

    # -- what is seen -------------------------------------------------------------------------

    def row(self, *, whole: bool = False) -> dict[str, float]:
        """Return the newest row of the recording, by column; SI units.

        Parameters
        ----------
        whole : bool
            The newest one in which every axis had a sample; in others, the columns of an axis
            without a sample keep their last values.

        Raises
        ------
        RecordingError
            There is no such row yet.
        """
        if self._tap is not None and self._live is not None:
            rows = self._tap.take()
            self._newest = rows[-1] if rows else self._newest
            valid = self._valid
            self._whole = next((r for r in reversed(rows) if all(r[k] for k in valid)), self._whole)
            if values := self._whole if whole else self._newest:
                return dict(zip(self._live.columns, values, strict=True))
        raise RecordingError(f"{self.directory}: no row yet")

    def age_s(self, row: Mapping[str, float]) -> float:
        """Return how long ago the slot of a row was [s], by the loop's clock.

        The age of a stalled run's rows keeps increasing; it is infinite once the run has ended.
        With two sites a machine whose pace follows the other's is off by the difference of the
        clocks.
        """
        if self._tap is None:
            return math.inf
        if not self._tap.begun_ns:
            return 0.0  # the first slot is still to come
        return 1e-9 * (self._clock.now_ns() - self._tap.begun_ns) - row["time_s"]

    @property
    def state(self) -> str:
        """The rig's state, such as `engaged`."""
        return STATES[int(self.row()["operation.state"])]

    def wait_for(self, state: str, timeout_s: float = 30.0) -> bool:
        """Wait until the rig is in a state; return whether it is."""
        until = self._clock.now_ns() + round(1e9 * timeout_s)
        while self._clock.now_ns() < until and self._running():
            with suppress(RecordingError):
                if self.state == state:
                    return True
            self._clock.sleep_until(self._clock.now_ns() + LOOK_NS)
        return False

    def wait(self) -> dict[str, Any]:
        """Wait for the end of the run and its report; return its summary, {} without one."""
        if self._child is not None and self.exit_code is None:
            _, errors = self._child.communicate()
            self.exit_code = self._child.returncode
            if self._tap is not None:
                self._tap.close()
                self._tap = None
            self._said = errors.decode("utf-8", "replace").strip()
        try:
            summary = parse_json((self.directory / "summary.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return dict(summary)

    def _running(self) -> bool:
        return self._child is not None and self._child.poll() is None

    def _send(self, line: str) -> None:
        gone = RecordingError(f"{self.directory}: the run has ended")
        if self._child is None or self._child.stdin is None or not self._running():
            raise gone
        try:
            self._child.stdin.write(f"{line}\n".encode("utf-8", "replace"))
            self._child.stdin.flush()
        except BrokenPipeError as err:  # while it was written
            raise gone from err

    def _attach(self) -> None:
        """Open the rows of the run, once they are there."""
        if self._tap is None and (self.directory / LIVE).exists():
            fields = parse_json((self.directory / LIVE).read_text(encoding="utf-8"))
            self._live = Live(**fields)
            columns = enumerate(self._live.columns)
            self._valid = [k for k, name in columns if name.endswith(".valid")]
            with suppress(RecordingError):
                self._tap = Tap.of_run(self._live)

    def _wait_for_rows(self) -> None:
        """Wait until the loop runs.

        Raises
        ------
        ConfigError
            The rig was refused, in the words of `tautwave run`.
        """
        until = self._clock.now_ns() + BEGIN_NS
        while self._running() and self._clock.now_ns() < until:
            self._attach()
            with suppress(RecordingError):
                self.row()
                return
            self._clock.sleep_until(self._clock.now_ns() + LOOK_NS)
        if self._running():
            assert self._child is not None
            self._child.terminate()
        self.wait()
        raise ConfigError(self._said or f"{self.directory}: the run did not begin")


def _site_options(rig: Rig) -> tuple[str, ...]:
    """Return what one of two sites needs: its keys are beside the rig file, not the run's copy."""
    if rig.site is None:
        return ()
    folder = rig.source.parent if rig.source is not None else Path()
    keys = (folder / getattr(rig.sites, rig.site).keys).resolve()
    return ("--set", f"sites.{rig.site}.keys={keys}")
