"""The two devices that LeRobot knows: they read rows, and command nothing."""

from __future__ import annotations

from typing import Any

from lerobot.robots import Robot
from lerobot.teleoperators import Teleoperator

from lerobot_robot_tautwave.config_tautwave import TautwaveMasterConfig, TautwaveSlaveConfig
from lerobot_robot_tautwave.site import Site


class _InRun:
    """What both have to do with the run, which the first to connect begins."""

    name: str
    config: Any
    _site: Site

    @property
    def is_connected(self) -> bool:
        """Whether it looks at a run."""
        return self._site.joined(self.name)

    @property
    def is_calibrated(self) -> bool:
        """Zero is defined in the rig file."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Begin the run, unless the other has."""
        del calibrate
        config = self.config
        self._site.join(self.name, config.out, config.engage, config.allow_unwatched)

    def calibrate(self) -> None:
        """Nothing: see `tautwave check`."""

    def configure(self) -> None:
        """Nothing: drives are set up by the run."""

    def disconnect(self) -> None:
        """Disconnect from the run."""
        self._site.leave(self.name)


class TautwaveSlave(_InRun, Robot):
    """The slave: observations are position, velocity and effort of its axes, SI units.

    It moves as the operator leads it, by the rig's own controller. An action that did not come from
    the rig's master is refused, unless a policy drives the rig.
    """

    config_class = TautwaveSlaveConfig
    name = "tautwave_slave"

    def __init__(self, config: TautwaveSlaveConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = {}  # `lerobot-record` looks for it
        self._led = config.drive == "policy"
        self._site = Site.of(config.rig, config.fps if self._led else 0.0)
        self._state = self._site.signals().state

    @property
    def observation_features(self) -> dict[str, type]:
        """Names of the observation."""
        return dict.fromkeys([one.name for one in self._state], float)

    @property
    def action_features(self) -> dict[str, type]:
        """Names of an action: where the master asks the slave to be."""
        return dict.fromkeys([one.name for one in self._site.signals().action], float)

    def get_observation(self) -> dict[str, float]:
        """Return what the slave measured in one cycle, the same as the next action's."""
        row = self._site.row(self.name)
        return {one.name: one.of(row) for one in self._state}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Lead the virtual hands of a rig that a policy drives.

        Of a rig that a person leads, command nothing; refuse what the master did not give.
        """
        if self._led:
            self._site.drive(action)
        else:
            self._site.check(action)
        return action


class TautwaveMaster(_InRun, Teleoperator):
    """The master: an action is where it asks the slave to be, in the slave's coordinates, SI units.

    Force comes back by the rig's own controller. `feedback_features` is empty on purpose: LeRobot
    would take others for positions to which it may drive the master.
    """

    config_class = TautwaveMasterConfig
    name = "tautwave_master"

    def __init__(self, config: TautwaveMasterConfig) -> None:
        super().__init__(config)
        self.config = config
        self._site = Site.of(config.rig)
        self._action = self._site.signals().action

    @property
    def action_features(self) -> dict[str, type]:
        """Names of an action."""
        return dict.fromkeys([one.name for one in self._action], float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """Nothing."""
        return {}

    def get_action(self) -> dict[str, float]:
        """Return where the slave was asked to be, in the cycle of the last observation."""
        row = self._site.row(self.name)
        return self._site.lead({one.name: one.of(row) for one in self._action})

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Nothing: forces do not pass through LeRobot."""
