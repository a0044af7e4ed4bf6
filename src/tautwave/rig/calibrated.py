"""A driver behind a calibration: positions from the axis' zero, positive its way, known devices."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from tautwave.config import Rig, calibration_of
from tautwave.config.keys.calibration import AxisCalibration
from tautwave.contracts import Driver
from tautwave.errors import DriverError
from tautwave.runtime.sensing import LoopBus
from tautwave.types import AxisCommand, JointState
from tautwave.wrapper import DriverWrapper


class CalibratedDriver(DriverWrapper):
    """A driver whose axes count from their zero and in their direction.

    Parameters
    ----------
    driver : Driver
        The driver.
    names : sequence of str
        Full names of its axes.
    calibrations : sequence of AxisCalibration
        What was found on each device.
    followers : bool
        Whether any of them takes positions.
    """

    def __init__(
        self,
        driver: Driver,
        names: Sequence[str],
        calibrations: Sequence[AxisCalibration],
        *,
        followers: bool = False,
    ) -> None:
        super().__init__(driver)
        self._names, self._calibrations = names, calibrations
        self._zeros = [(one.zero, float(one.direction)) for one in calibrations]
        self._turned = followers or any(one.direction < 0 for one in calibrations)

    def open(self) -> None:
        """Open the driver, and refuse a device that is not the one that was calibrated.

        Raises
        ------
        DriverError
            A device says something else of itself than when it was calibrated.
        """
        super().open()
        reported = identities(self._driver)
        changes = [
            f"{name}: {key} was {then}, now {reported.get(name, {}).get(key, 'not given')}"
            for name, one in zip(self._names, self._calibrations, strict=True)
            for key, then in one.device.items()
            if reported.get(name, {}).get(key) != then
        ]
        if changes:
            self._driver.close()
            raise DriverError(
                f"not as it was calibrated: {'; '.join(changes)}; put the device back, or run "
                "tautwave calibrate again"
            )

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the driver's samples, from the axes' zeros and in their direction."""
        return [
            JointState(
                way * (state.position - zero),
                way * state.velocity,
                way * state.effort,
                state.valid,
                state.age_ns,
            )
            for state, (zero, way) in zip(self._driver.read(deadline_ns), self._zeros, strict=True)
        ]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Send commands in the devices' directions."""
        if self._turned:
            commands = [
                AxisCommand(
                    way * command.effort,
                    way * command.velocity,
                    way * command.position + zero,
                    command.damping,
                )
                for command, (zero, way) in zip(commands, self._zeros, strict=True)
            ]
        self._driver.write(commands)

    def witness(self, name: str) -> tuple[float, float]:
        """Return velocity and motor effort a device reports, along the axis [SI]; NaN: none."""
        told: Callable[[str], tuple[float, float]] | None = getattr(self._driver, "witness", None)
        if told is None:
            return math.nan, math.nan
        velocity, effort = told(name)
        way = self._zeros[list(self._names).index(name)][1]
        return way * velocity, way * effort


def identities(driver: Driver) -> Mapping[str, Mapping[str, str]]:
    """Return what the devices of an open driver said of themselves, by axis."""
    reported: Mapping[str, Mapping[str, str]] = getattr(driver, "identities", {})
    return reported


def calibrated(rig: Rig, bus: LoopBus) -> LoopBus:
    """Return a bus with its rig's calibration, if it has one for an axis there."""
    if rig.calibration is None or not any(name in rig.calibration.axes for name in bus.axes):
        return bus
    calibrations = [calibration_of(rig, name) for name in bus.axes]
    followers = any(rig.axes[name].follower is not None for name in bus.axes)
    driver = CalibratedDriver(bus.driver, bus.axes, calibrations, followers=followers)
    return bus._replace(driver=driver)
