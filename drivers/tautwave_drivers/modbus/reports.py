"""What a drive reports of efforts beside its state: a sensor's register, its motor's torque."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError
from tautwave_drivers.modbus.profile import Keys, Profile


class SensorRegister(Keys):
    """A register with what an effort sensor shows, such as an analogue input."""

    register_name: Annotated[str, Field(alias="register", description="Its name in the profile.")]
    effort: float
    """[N m | N] of one count, as the effort from outside on the axis; may be negative."""
    zero: int = 0
    """Counts without an effort."""


def check_reports(
    axis: AxisSpec, unit: int, sensor: SensorRegister | None, torque: bool, profile: Profile
) -> None:
    """Refuse sensors and reports that an axis, its unit and its profile do not agree on.

    Raises
    ------
    ConfigError
        It says what to add or remove.
    """
    if axis.effort_sensor and sensor is None:
        raise ConfigError(
            f"it has an effort_sensor, but unit {unit} does not define it; add effort_sensor: "
            f"{{register: NAME, effort: N m of one count}} to the device"
        )
    if sensor is not None:
        if not axis.effort_sensor:
            raise ConfigError(
                f"unit {unit} reads an effort_sensor, but the axis has none; add effort_sensor: "
                f"{{}} to it"
            )
        if sensor.register_name not in profile.registers:
            raise ConfigError(
                f"profile {profile.family} has no register {sensor.register_name!r} for "
                "effort_sensor; add it there"
            )
        if sensor.effort == 0.0:
            raise ConfigError("effort_sensor.effort (per count) must not be 0")
    if torque:
        if axis.causality == "admittance":
            raise ConfigError(
                "it is velocity-controlled and already reports its torque; remove report_torque"
            )
        if profile.register_of("effort") is None:
            raise ConfigError(
                f"profile {profile.family} has no register with role effort for report_torque"
            )
