"""One run of a rig, looked at by the robot and the teleoperator of one LeRobot process."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from lerobot.utils.errors import DeviceNotConnectedError

from tautwave import ConfigError, Session, TautwaveError, load_rig
from tautwave.errors import RecordingError
from tautwave.report.export.signals import Signals, signals
from tautwave.rig import pair_scale
from tautwave.rig.led import led_by_policy

STALE_S = 0.05
"""[s] A newest row that is older, or older than three slots, is no measurement any more."""
ENGAGE_S = 60.0
"""[s] How long alignment may take."""
FLOAT32 = 1e-6
"""Actions pass through float32 in LeRobot."""


class Site:
    """A run. It starts when the first one joins and ends when the last one leaves.

    Parameters
    ----------
    path : Path
        Rig file.
    fps : float
        Actions a second of a policy that leads the rig; 0: a person does.
    """

    _sites: ClassVar[dict[Path, Site]] = {}

    def __init__(self, path: Path, fps: float) -> None:
        self.path, self.fps = path, fps
        rig = load_rig(path)
        self.rig = load_rig(path, ["operate={}"]) if rig.operate is None else rig
        if fps:
            self.rig = led_by_policy(self.rig, fps)
        self._users: set[str] = set()
        self._session: Session | None = None
        self._row: dict[str, float] = {}
        self._seen: set[str] = set()
        self._last: dict[str, float] = {}

    @classmethod
    def of(cls, path: str, fps: float = 0.0) -> Site:
        """Return the site of a rig file, the same one for both devices.

        Raises
        ------
        ConfigError
            One device of a rig is led by a hand, the other by a policy.
        """
        where = Path(path).resolve()
        if where not in cls._sites:
            cls._sites[where] = cls(where, fps)
        site = cls._sites[where]
        if site.fps != fps:
            raise ConfigError(
                f"{where}: a policy drives this rig, so there is no teleoperator; omit --teleop"
            )
        return site

    def signals(self) -> Signals:
        """Return what is action and what observation, and the names of both."""
        axes: dict[str, Mapping[str, Any]] = {
            f"{side}.{name}": axis.model_dump(include={"kind", "causality", "follower"})
            for side in ("master", "slave")
            for name, axis in getattr(self.rig, side).axes.items()
        }
        scales = {name: pair_scale(keys) for name, keys in self.rig.coupling.pairs.items()}
        ratios = {name: scale.sign * scale.scale for name, scale in scales.items()}
        return signals(self.rig.name, axes, ratios, velocities=False)

    def joined(self, who: str) -> bool:
        """Return whether a device has joined."""
        return who in self._users

    def join(self, who: str, out: str, engage: bool, unwatched: bool) -> None:
        """Begin the run, or look at the one that has begun."""
        if self._session is None:
            folder = Path(out) / time.strftime("%Y%m%d-%H%M%S")
            options = ["--allow-unwatched"] if unwatched else []
            session = Session(self.rig, out=folder, options=options)
            session.__enter__()
            self._session, self._row = session, {}
            if engage:
                session.engage()
                if not session.wait_for("engaged", ENGAGE_S):
                    state = session.state
                    self._end()
                    raise DeviceNotConnectedError(
                        f"{self.path}: not engaged after {ENGAGE_S:g} s (state: {state}); see "
                        f"{folder}/report.html"
                    )
        self._users.add(who)

    def leave(self, who: str) -> None:
        """Disconnect from the run; the last one makes it ramp down and waits for its report."""
        self._users.discard(who)
        if not self._users:
            self._end()

    def _end(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.__exit__(None, None, None)
        self._sites.pop(self.path, None)

    def row(self, who: str) -> dict[str, float]:
        """Return the row both devices look at: a new one once a device has seen this one.

        Raises
        ------
        DeviceNotConnectedError
            The device has not joined, or no row with a sample of every axis has come for too long.
        """
        session = self._session
        if session is None or not self.joined(who):
            raise DeviceNotConnectedError(f"{who} of {self.path} is not connected")
        if not self._row or who in self._seen:
            try:
                self._row, self._seen = session.row(whole=True), set()
            except TautwaveError as err:
                raise DeviceNotConnectedError(str(err)) from err
        self._seen.add(who)
        age = session.age_s(self._row)
        if age > max(STALE_S, 3.0 / self.rig.rate_hz):
            raise DeviceNotConnectedError(
                f"{self.path}: no new row for {age:.3f} s: the run has ended or its machine is "
                f"stalled; see {session.directory}"
            )
        return self._row

    def lead(self, action: dict[str, float]) -> dict[str, float]:
        """Remember an action that the master gave."""
        self._last = action
        return action

    def drive(self, action: Mapping[str, Any]) -> None:
        """Send an action of a policy, in the slave's coordinates, to the virtual hands.

        Raises
        ------
        DeviceNotConnectedError
            The rig is not engaged: it has stopped, or holds because actions came too late.
        ConfigError
            A signal is not the rig's, or a value is no finite number; the rig gets no action then.
        """
        session = self._session
        if session is None:
            raise DeviceNotConnectedError(
                f"{self.path}: no run is in progress, so an action has no effect"
            )
        known = {one.name: one for one in self.signals().action}
        unknown = [name for name in action if name not in known]
        if unknown:
            raise ConfigError(f"action {unknown[0]}: the rig has {', '.join(known)}")
        if (state := session.state) != "engaged":
            raise DeviceNotConnectedError(
                f"{self.path}: {state}, not engaged: three frames passed without an action, or a "
                f"guard or a user disengaged it; see the report in {session.directory}"
            )
        try:
            row = session.row(whole=True)
            session.lead(
                {
                    known[name].pair: known[name].master_of(float(value), row)
                    for name, value in action.items()
                }
            )
        except RecordingError as err:
            raise DeviceNotConnectedError(str(err)) from err

    def check(self, action: Mapping[str, Any]) -> None:
        """Refuse an action that the master did not give.

        Raises
        ------
        ConfigError
            It differs from the last one: a policy, or a replay, at a rig that a person leads.
        """
        for name, value in action.items():
            led = self._last.get(name)
            if led is None or not abs(float(value) - led) <= FLOAT32 * max(1.0, abs(led)):
                gave = "none" if led is None else format(led, ".6g")
                raise ConfigError(
                    f"action {name} = {float(value):.6g} did not come from the master of "
                    f"{self.path}, which sent {gave}: this rig is driven by hand and accepts no "
                    "actions from a policy or a replay"
                )
