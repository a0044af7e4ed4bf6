"""The dictionary as data; errors, modes and reactions in words; set-point and homing handshakes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_drivers.cia402.aborts import ABORT_CODES, abort_text
from tautwave_drivers.cia402.communication import COMMUNICATION, CONSUMER_HEARTBEAT, rpdo, tpdo
from tautwave_drivers.cia402.emergency import (
    ERROR_CODES,
    decode_emergency,
    error_text,
    register_text,
)
from tautwave_drivers.cia402.entry import FORMATS, limits, pack, unpack
from tautwave_drivers.cia402.modes import (
    CONTROL_BITS,
    MODE_NAMES,
    Homing,
    Mode,
    control_mask,
    mode_name,
    supported_modes,
    supported_text,
)
from tautwave_drivers.cia402.objects import (
    CONTROLWORD,
    DRIVE,
    MODE_DISPLAY,
    POSITION,
    TORQUE,
    find,
    interpolation_period,
)
from tautwave_drivers.cia402.reactions import (
    REACTIONS,
    acts_on_loss,
    leaves_quick_stop,
    reaction_text,
    stays_in_quick_stop,
)

ASKED = """
6040 6041 6060 6061 6502 6064 606C 6077 607A 60FF 6071 6072 6073 6075 6076 6078 607B 607C 607D
607E 607F 6080 6089 608A 608B 608C 6081 6083 6084 6085 6087 6098 6099 609A 608F 6090 6091 6092
6093 6094 6095 6096 60A8 60A9 60B0 60B1 60B2 60C2 60E0 60E1 605A 605B 605C 605D 605E 6007 603F
1000 1001 1003 1005 1006 1007 1008 1009 100A 1010 1012 1014 1015 1016 1017 1018 1019 1029
"""


def test_the_dictionary_holds_what_a_drive_driver_needs() -> None:
    indices = {entry.index for entry in (*DRIVE, *COMMUNICATION)}
    assert indices == {int(text, 16) for text in ASKED.split()}
    assert [entry.index for entry in DRIVE] == sorted(entry.index for entry in DRIVE)
    assert len({entry.name for entry in (*DRIVE, *COMMUNICATION)}) == len(DRIVE) + len(
        COMMUNICATION
    )


def test_golden_mapping_entries() -> None:
    # CiA 301, 7.5.2.36: index, sub-index, length; as every drive's EDS has them for 6040h, 6064h.
    assert CONTROLWORD.mapping == 0x60400010
    assert POSITION.mapping == 0x60640020
    assert MODE_DISPLAY.mapping == 0x60610008
    assert TORQUE.on_axis(1).address == "6877:00"
    assert find(0x6877) == TORQUE.on_axis(1)
    assert find(0x1016, 1) == CONSUMER_HEARTBEAT
    assert find(0x6877, 9) is None


def test_pdo_objects_by_number() -> None:
    assert rpdo(1).cob_id.address == "1400:01"
    assert rpdo(4).mapped(2).address == "1603:02"
    assert rpdo(1).mapped(2).type == "U32"
    assert tpdo(2).timer.address == "1801:05"
    assert tpdo(2).mapped_count.address == "1A01:00"


@given(st.sampled_from([e for e in (*DRIVE, *COMMUNICATION) if e.type in FORMATS]), st.integers())
def test_values_round_trip_and_saturate(entry, value: int) -> None:  # type: ignore[no-untyped-def]
    least, greatest = limits(entry.type)
    data = pack(entry, value)
    assert len(data) * 8 == entry.bits
    assert unpack(entry, data) == min(max(value, least), greatest)


@given(st.sampled_from((*DRIVE, *COMMUNICATION)), st.binary(max_size=12))
def test_bytes_never_raise(entry, data: bytes) -> None:  # type: ignore[no-untyped-def]
    value = unpack(entry, data)
    assert (value is None) == (entry.type in FORMATS and len(data) * 8 < entry.bits)
    emergency = decode_emergency(data)
    assert (emergency is None) == (len(data) < 8)


@pytest.mark.parametrize(
    ("period_ns", "value", "index"),
    [(1_000_000, 1, -3), (2_000_000, 2, -3), (2_500_000, 25, -4), (125_000, 125, -6)],
)
def test_interpolation_period(period_ns: int, value: int, index: int) -> None:
    assert interpolation_period(period_ns) == (value, index)
    assert value * 10 ** (9 + index) == period_ns


def test_a_period_that_one_byte_cannot_hold() -> None:
    assert interpolation_period(1_001_000) is None
    assert interpolation_period(3_333_333) is None


def test_golden_emergency_frames() -> None:
    # Faulhaber MC 5010 communications manual, tab. 9: 3210h overvoltage, register bit 2.
    frame = decode_emergency(bytes.fromhex("10 32 04 04 00 00 00 00"))
    assert frame is not None
    assert frame.text.startswith("0x3210: DC link overvoltage (register: voltage, vendor")
    assert not frame.cleared
    reset = decode_emergency(bytes(8))
    assert reset is not None
    assert reset.cleared


def test_error_codes_in_words_by_themselves_or_by_class() -> None:
    assert error_text(0x8130) == "0x8130: heartbeat or life guarding lost"
    assert error_text(0x8250).startswith("0x8250: RPDO timeout")
    assert error_text(0x2315) == ("0x2315: of the class 'continuous overcurrent on the motor side'")
    assert error_text(0x73FF) == "0x73FF: of the class 'sensor'"
    assert error_text(0xFF07) == "0xFF07: of the class 'the manufacturer's own'"
    assert "not a code" in error_text(0xA123)
    assert register_text(0x11) == "generic, communication"
    assert all(error_text(code) for code in range(0x10000))
    assert len(ERROR_CODES) > 120


def test_abort_codes_agree_with_python_canopen_on_which_exist() -> None:
    exceptions = pytest.importorskip("canopen.sdo.exceptions")
    assert set(ABORT_CODES) == set(exceptions.SdoAbortedError.CODES)


def test_abort_words() -> None:
    assert abort_text(0x06090031) == "0x06090031: value too high; give a smaller value"
    assert "not an abort code" in abort_text(0x0F00FFC0)


def test_what_somebody_can_do_about_an_abort_is_said_with_it() -> None:
    remedies = {
        0x05040000: "powered", 0x06010002: "omit it from the rig", 0x06020000: "not have it",
        0x06040041: "map another", 0x06040042: "map fewer", 0x06070010: "compare the type",
        0x06070012: "compare the type", 0x06070013: "compare the type", 0x06090011: "fewer sub",
        0x06090030: "manual lists", 0x06090031: "smaller", 0x06090032: "greater",
        0x08000021: "out of local control", 0x08000022: "while the drive is disabled",
    }  # fmt: skip
    said = {code: abort_text(code).partition("; ")[2] for code in ABORT_CODES}
    assert {code for code, remedy in said.items() if remedy} == set(remedies)
    for code, words in remedies.items():
        assert words in said[code], said[code]


def test_reactions_in_words() -> None:
    assert "keeps following the last command" in reaction_text(0x6007, 0)
    assert "stays in QUICK STOP ACTIVE" in reaction_text(0x605A, 6)
    assert "manufacturer" in reaction_text(0x605E, -1)
    assert "not an option code" in reaction_text(0x6040, 1)
    assert [value for value in range(-3, 6) if acts_on_loss(value)] == [1, 2, 3]
    assert [value for value in range(-3, 12) if leaves_quick_stop(value)] == [1, 2, 3, 4]
    assert [value for value in range(-3, 12) if stays_in_quick_stop(value)] == [5, 6, 7, 8]
    assert not stays_in_quick_stop(None)
    assert not leaves_quick_stop(None)
    assert set(REACTIONS[0x605A][1]) == set(range(9))
    # CiA 402-2: 0 lets the axis coast, where there is a 0; 1 is its own ramp, whatever the occasion
    for index, least in ((0x605A, 0), (0x605B, 0), (0x605C, 0), (0x605D, 1), (0x605E, 0)):
        assert min(REACTIONS[index][1]) == least
        assert ("coast" in reaction_text(index, 0)) == (least == 0)
        assert REACTIONS[index][1][1].startswith(REACTIONS[0x605E][1][1])


def test_modes_are_numbered_and_named_alike() -> None:
    short = {value: name.partition(" ")[0] for value, name in MODE_NAMES.items()}
    assert short == {0: "no"} | {mode.value: mode.name for mode in Mode if mode}


def test_modes_in_words() -> None:
    # 6502h = 3EDh: PP PV PT HM IP CSP CSV CST, as drives without VL and DMC list it.
    assert supported_modes(0x3ED) == (1, 3, 4, 6, 7, 8, 9, 10)
    assert supported_text(0x200) == "CST cyclic synchronous torque"
    assert supported_text(0) == "no standard mode"
    assert mode_name(-3) == "mode -3 (the manufacturer's)"
    assert mode_name(None) == "nothing"
    assert control_mask(Mode.CST) == 0x100
    assert control_mask(Mode.PP) == 0x370
    assert all(mask & 0x8F == 0 for mask in map(control_mask, CONTROL_BITS))


def test_homing_waits_for_attained_and_tells_errors() -> None:
    homing = Homing(settle_cycles=20)
    assert homing.step(0x1400) == 0
    assert [homing.step(0x1400) for _ in range(3)] == [0x10] * 3
    assert not homing.done, "an older homing's bits were believed"
    homing.step(0x0000)
    assert homing.step(0x1400) == 0x10
    assert homing.done
    failing = Homing()
    failing.step(0)
    failing.step(0)
    assert failing.step(0x2000) == 0
    assert failing.failed
    assert not failing.done
    instant = Homing(settle_cycles=3)
    for _ in range(8):
        instant.step(0x1400)
    assert instant.done
