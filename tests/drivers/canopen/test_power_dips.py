"""A drive that lost its power for a moment is noticed, also where its boot-up frame is lost."""

from __future__ import annotations

import pytest

from tautwave.errors import DriverError
from tautwave.testing.drivers import strike
from tests.drivers.canopen.foreign import EFFORT_LIMIT, Foreign, foreign
from tests.foreign.cia402 import ForeignDrive, Key

WATCHDOG: Key = (0x1016, 1)
MAX_TORQUE: Key = (0x6072, 0)
LOANS = (WATCHDOG, MAX_TORQUE)
"""What a run sets in a drive and gives back: no drive has it stored."""


def stored() -> dict[Key, int]:
    """Return what a drive holds that was set up for the rig and stored that, loans apart."""
    rig = foreign()
    rig.driver.open()
    held = {key: value for key, value in rig.drive.values.items() if key not in LOANS}
    rig.driver.close()
    return held | {(0x6040, 0): 0, (0x6071, 0): 0}


STORED = stored()


def dipped(at_ms: float, span_ms: int, *, keeps: bool, starts: bool) -> tuple[Foreign, list[str]]:
    """Have the power go at a time from `open` on; return what was told until 0.3 s after it."""
    rig = foreign()
    drive: ForeignDrive = rig.drive
    drive.boots_unheard, drive.starts_itself = True, starts
    drive.stored = dict(STORED) if keeps else {}
    at_ns = round(at_ms * 1e6)
    strike(rig.clock, at_ns, lambda: drive.reboot(rig.bus.now_ns * 1e-9, span_ms * 1e-3))
    told: list[str] = []
    try:
        rig.enable()
        while not told and rig.clock.now_ns() < at_ns + (span_ms + 300) * 1_000_000:
            rig.cycle(0.05)
            told += [fault.text for fault in rig.driver.faults() if fault.fatal]
    except DriverError as err:
        told.append(str(err))
    return rig, told


def bring_up_ms() -> float:
    rig = foreign()
    rig.driver.open()
    took = rig.clock.now_ns() * 1e-6
    rig.driver.close()
    return took


UP_MS = bring_up_ms()
STEP_MS = 2.11
EVERY = [STEP_MS * at for at in range(round((UP_MS + 60.0) / STEP_MS))]
"""Over bring-up, enabling and the first cycles of a run."""
DELICATE = [UP_MS + after for after in (-30.0, -2.0, -1.0, 0.0, 1.0, 4.0, 8.0, 12.0)]
"""Set up already: before it is read once more, then, while it is enabled, and in the run."""


def watched_or_told(at_ms: float, span_ms: int, *, keeps: bool, starts: bool) -> str:
    """Return what is wrong: nothing was told, and it runs without what the run had set in it."""
    rig, told = dipped(at_ms, span_ms, keeps=keeps, starts=starts)
    drive = rig.drive
    held = [drive.value(*key) for key in LOANS]
    enabled = drive.state == "enabled"
    rig.driver.close()
    if rig.drive.state == "enabled":
        return f"at {at_ms:g} ms: still enabled after close"
    wanted = [127 << 16 | 60, round(1e3 * EFFORT_LIMIT / 0.5)]
    sound = bool(told) or (enabled and held == wanted)
    return "" if sound else f"at {at_ms:g} ms: enabled {enabled} with {held} for {wanted}"


@pytest.mark.parametrize("span_ms", [2, 20])
def test_a_stored_drive_that_starts_itself_unheard_is_noticed(span_ms: int) -> None:
    """Its state, mapping and heartbeat are as they were; its watchdog and torque limit are gone."""
    wrong = [watched_or_told(at, span_ms, keeps=True, starts=True) for at in DELICATE]
    assert not any(wrong), wrong


@pytest.mark.slow
@pytest.mark.parametrize("starts", [False, True], ids=["waits for NMT", "starts itself"])
@pytest.mark.parametrize("keeps", [False, True], ids=["set up", "stored"])
@pytest.mark.parametrize("span_ms", [2, 20, 200])
def test_a_dip_with_a_lost_boot_up_frame_is_noticed_at_any_moment(
    span_ms: int, keeps: bool, starts: bool
) -> None:
    wrong = [watched_or_told(at, span_ms, keeps=keeps, starts=starts) for at in EVERY]
    assert not any(wrong), [one for one in wrong if one]


@pytest.mark.parametrize(
    ("keeps", "starts", "said"),
    [
        (False, False, "heartbeat lost: none for"),
        (True, False, "went from NMT operational to pre-operational"),
        (False, True, "heartbeat lost: none for"),
        (True, True, "left OPERATION ENABLED on its own"),
    ],
)
def test_what_is_said_of_a_dip_in_a_run(keeps: bool, starts: bool, said: str) -> None:
    _, told = dipped(UP_MS + 100.0, 20, keeps=keeps, starts=starts)
    assert said in told[0]


def test_a_frame_lost_while_it_is_enabled_is_no_dip() -> None:
    rig = foreign()
    rig.driver.open()
    drive = rig.drive
    drive.deaf_to_sync = True
    for cycle in range(500):
        if cycle == 2:
            drive.deaf_to_sync = False
        if rig.driver.enable_step():
            break
        rig.clock.sleep_until(rig.clock.now_ns() + 2_000_000)
    assert drive.state == "enabled"
    rig.driver.close()
