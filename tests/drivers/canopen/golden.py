"""Frames of a bring-up and of a cycle, as candump writes them, from public documents.

Where a frame stands in a published example, that is named; node ids are the example's plus ours.
The others are written down by hand by the same rules: expedited SDO download 2F (1 byte), 2B (2),
23 (4), index and data low byte first, padded to 8 bytes (CiA 301 v4.2, 7.2.4.3.3); NMT command and
node (7.2.8.3.1); COB-IDs of the pre-defined connection set (7.3.3).

[EAO]  EAO series 09 CAN keypad manual, p. 51, boot sequence after the CiA "CAN poster":
       70B#00, 70B#7F, 000#010B (start node 0B), 70B#05.
[ZA]   Ziehl-Abegg AM-CAN-OPEN, L-BAL-E199-GB 1846, p. 16: 601#2F001A0004000000 (count of mapped
       objects), 601#2300180181010000 (TPDO1 gets COB-ID 181), 601#2310100173617665 (save).
[ICP]  ICP DAS CAN-8x23 user's manual 3.20, p. 136: 601#2305140102020000 (RPDO gets COB-ID 202),
       answer 581#6005140100000000; p. 137: mapping entry 62000108h as 08 01 00 62.
[FH]   Faulhaber MC 5004 CANopen manual 7000.05050, 4th edition, p. 19: a PDO of controlword and
       target torque, and one of statusword and position, 2 + 2 and 2 + 4 bytes, low byte first.
"""

from __future__ import annotations

START = "000#0101"  # [EAO] with node 01
PRE_OPERATIONAL = "000#8001"

MAP_TPDO1 = (
    "601#23001801810100C0",  # 1800:01 invalid (bit 31), no RTR (bit 30), COB-ID 181
    "601#2F00180201000000",  # 1800:02 on every SYNC
    "601#2F001A0000000000",  # 1A00:00 no objects, as [ZA] before its mapping
    "601#23001A0110004160",  # 1A00:01 statusword, 16 bit: entry coded as in [ICP]
    "601#23001A0220006460",  # 1A00:02 position, 32 bit
    "601#2F001A0002000000",  # 1A00:00 two objects, as [ZA] with four
    "601#2300180181010040",  # 1800:01 valid again: [ZA], and RTR not allowed
)
MAP_RPDO1 = (
    "601#2300140101020080",  # 1400:01 invalid, COB-ID 201
    "601#2F00140201000000",
    "601#2F00160000000000",
    "601#2300160110004060",  # 1600:01 controlword, 16 bit
    "601#2300160210007160",  # 1600:02 target torque, 16 bit
    "601#2F00160002000000",
    "601#2300140101020000",  # 1400:01 valid: [ICP] with RPDO 1 of node 1
)


def set_up(timeout_ms: int = 60, period_ms: int | None = None) -> tuple[str, ...]:
    """Return the writes of a set-up; `period_ms` where 60C2h does not hold the period yet."""
    time = timeout_ms.to_bytes(2, "little").hex().upper()
    period = () if period_ms is None else (f"601#2FC26001{period_ms:02X}000000",)
    return (
        "601#2B40600000000000",  # 6040:00 disable voltage
        *period,  # 60C2:01 interpolation time in units of 60C2:02, ms
        "601#2B726000D0070000",  # 6072:00 2000 per mille
        "601#2B17100014000000",  # 1017:00 heartbeat every 20 ms
        f"601#23161001{time}7F00",  # 1016:01 node 127 within the time
        f"601#2B001405{time}0000",  # 1400:05 the same time
        "601#2B07600002000000",  # 6007:00 disable voltage when the bus is lost
        *MAP_TPDO1,
        *MAP_RPDO1,
        "601#2F6060000A000000",  # 6060:00 cyclic synchronous torque
    )


SET_UP = set_up()
SAVE = "601#2310100173617665"  # [ZA]
READ_IDENTITY = "601#4018100100000000"

SYNC = "080#"
BEAT = "77F#05"
ENABLING = (  # [FH]: controlword, target torque
    "201#00000000",  # disable voltage, until the statusword is known
    "201#06000000",  # shutdown
    "201#07000000",  # switch on
    "201#0F000000",  # enable operation
)
CYCLE = (SYNC, "201#0F006400")  # 100 per mille
CYCLE_BACK = (SYNC, "201#0F009CFF")  # -100 per mille


def line(can_id: int, data: bytes) -> str:
    """Return a frame as candump -L writes it."""
    return f"{can_id:03X}#{data.hex().upper()}"
