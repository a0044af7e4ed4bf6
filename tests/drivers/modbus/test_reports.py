"""Registers that report an effort: what axis, unit and profile must agree on, by sentence."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.errors import ConfigError
from tautwave_drivers.modbus.options import SensorRegister, check_reports
from tautwave_drivers.modbus.profile import load_profile
from tests.drivers.modbus.parts import spec

PROFILE = load_profile("generic")
KNOWN = next(iter(PROFILE.registers))


def sensor(**keys: Any) -> SensorRegister:
    return SensorRegister.model_validate({"register": KNOWN, "effort": -0.01, **keys})


@pytest.mark.parametrize(
    ("axis", "keys", "torque", "message"),
    [
        ({"effort_sensor": True}, None, False, "unit 7 does not define it"),
        ({}, {}, False, "unit 7 reads an effort_sensor, but the axis has none"),
        ({"effort_sensor": True}, {"register": "none"}, False, "has no register 'none'"),
        ({"effort_sensor": True}, {"effort": 0.0}, False, r"\(per count\) must not be 0"),
        (
            {"causality": "admittance"},
            None,
            True,
            "it is velocity-controlled and already reports its torque",
        ),
    ],
)
def test_what_does_not_agree_is_refused(
    axis: dict[str, Any], keys: dict[str, Any] | None, torque: bool, message: str
) -> None:
    given = None if keys is None else sensor(**keys)
    with pytest.raises(ConfigError, match=message):
        check_reports(spec(7)._replace(**axis), 7, given, torque, PROFILE)


def test_what_agrees_is_taken() -> None:
    plain, sensed = spec(7), spec(7)._replace(effort_sensor=True)
    check_reports(plain, 7, None, False, PROFILE)
    check_reports(plain, 7, None, True, PROFILE)
    check_reports(sensed, 7, sensor(), True, PROFILE)
    check_reports(plain._replace(causality="admittance"), 7, None, False, PROFILE)


def test_a_profile_without_an_effort_cannot_report_one() -> None:
    roles = {role: name for role, name in PROFILE.roles.items() if role != "effort"}
    mute = PROFILE.model_copy(update={"roles": roles})
    with pytest.raises(ConfigError, match="no register with role effort"):
        check_reports(spec(7), 7, None, True, mute)
