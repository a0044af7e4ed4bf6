"""Emergency frames, error codes (EMCY and 603Fh) and the error register, as text.

Source: CiA 301 v4.2, table of emergency error code classes and object 1001h; CiA 402-2 v3.0
(IEC 61800-7-201), error codes of object 603Fh.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

ERROR_CODES = {
    0x0000: "no error",
    0x1000: "generic error",
    0x2000: "current",
    0x2100: "current on the input side",
    0x2110: "short circuit or earth leakage on the input side",
    0x2120: "earth leakage on the input side",
    0x2130: "short circuit on the input side",
    0x2200: "current inside the drive",
    0x2211: "current inside the drive, no. 1",
    0x2212: "current inside the drive, no. 2",
    0x2213: "overcurrent during a ramp",
    0x2214: "overcurrent in a sequence",
    0x2220: "continuous overcurrent inside the drive",
    0x2230: "short circuit or earth leakage inside the drive",
    0x2240: "earth leakage inside the drive",
    0x2250: "short circuit inside the drive",
    0x2300: "current on the motor side",
    0x2310: "continuous overcurrent on the motor side",
    0x2320: "short circuit or earth leakage on the motor side",
    0x2330: "earth leakage on the motor side",
    0x2331: "earth leakage of phase U",
    0x2332: "earth leakage of phase V",
    0x2333: "earth leakage of phase W",
    0x2340: "short circuit on the motor side",
    0x2341: "short circuit between phases U and V",
    0x2342: "short circuit between phases V and W",
    0x2343: "short circuit between phases W and U",
    0x2350: "overload (I2t, thermal state)",
    0x2351: "overload warning (I2t, thermal state)",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3110: "mains overvoltage",
    0x3120: "mains undervoltage",
    0x3130: "mains phase missing",
    0x3134: "mains phase sequence",
    0x3140: "mains frequency",
    0x3200: "DC link voltage",
    0x3210: "DC link overvoltage",
    0x3220: "DC link undervoltage",
    0x3230: "load error",
    0x3300: "output voltage",
    0x3310: "output overvoltage",
    0x3320: "armature circuit",
    0x3330: "field circuit",
    0x4000: "temperature",
    0x4100: "ambient temperature",
    0x4110: "ambient temperature too high",
    0x4120: "ambient temperature too low",
    0x4200: "device temperature",
    0x4210: "device too hot",
    0x4220: "device too cold",
    0x4300: "drive temperature",
    0x4310: "drive too hot",
    0x4320: "drive too cold",
    0x4400: "supply temperature",
    0x4410: "supply too hot",
    0x4420: "supply too cold",
    0x5000: "device hardware",
    0x5100: "supply of the electronics",
    0x5110: "low supply voltage of the electronics",
    0x5111: "supply of 15 V",
    0x5112: "supply of 24 V",
    0x5113: "supply of 5 V",
    0x5120: "supply of the intermediate circuit",
    0x5200: "control hardware",
    0x5210: "measuring circuit",
    0x5220: "computing circuit",
    0x5300: "operating unit",
    0x5400: "power section",
    0x5410: "output stages",
    0x5420: "brake chopper",
    0x5430: "input stages",
    0x5440: "contacts",
    0x5450: "fuses",
    0x5500: "memory",
    0x5510: "working memory",
    0x5520: "program memory",
    0x5530: "non-volatile memory",
    0x6000: "device software",
    0x6010: "software reset by the watchdog",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "parameter set",
    0x6310: "parameters lost",
    0x6320: "wrong parameter",
    0x7000: "additional modules",
    0x7100: "power module",
    0x7110: "brake chopper",
    0x7111: "brake chopper failed",
    0x7112: "overcurrent of the brake chopper",
    0x7113: "protective circuit of the brake chopper",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7122: "motor error or wrong commutation",
    0x7123: "motor tilted",
    0x7200: "measuring module",
    0x7300: "sensor",
    0x7301: "tacho failed",
    0x7302: "tacho has the wrong sign",
    0x7303: "resolver 1",
    0x7304: "resolver 2",
    0x7305: "incremental encoder 1",
    0x7306: "incremental encoder 2",
    0x7307: "incremental encoder 3",
    0x7310: "speed sensor or overspeed",
    0x7320: "position sensor",
    0x7400: "computing module",
    0x7500: "communication module",
    0x7510: "serial interface 1",
    0x7520: "serial interface 2",
    0x7600: "external memory",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun: frames lost",
    0x8120: "CAN error passive",
    0x8130: "heartbeat or life guarding lost",
    0x8140: "recovered from bus-off",
    0x8150: "CAN id collision",
    0x8200: "protocol",
    0x8210: "PDO not processed: too short",
    0x8220: "PDO longer than mapped",
    0x8230: "multiplexed PDO not processed",
    0x8240: "SYNC of unexpected length",
    0x8250: "RPDO timeout: the master stopped sending",
    0x8300: "torque control",
    0x8311: "excess torque",
    0x8312: "difficult start-up",
    0x8313: "standstill torque",
    0x8321: "insufficient torque",
    0x8331: "torque fault",
    0x8400: "velocity control",
    0x8500: "position control",
    0x8600: "positioning",
    0x8611: "following error",
    0x8612: "reference limit",
    0x8700: "synchronisation: set-points or SYNC out of step",
    0x8800: "winding control",
    0x8900: "process data monitoring",
    0x8A00: "control monitoring",
    0x9000: "external error",
    0xF000: "additional functions",
    0xF001: "deceleration",
    0xF002: "sub-synchronous run",
    0xF003: "stroke operation",
    0xF004: "control function",
    0xFF00: "the manufacturer's own",
}
"""Error codes of CiA 301 and CiA 402; codes in between belong to the rounder one below."""

_MASKS = (0xFFFF, 0xFFF0, 0xFF00, 0xF000)


def error_text(code: int) -> str:
    """Return an error code (EMCY, 603Fh, 1003h) as text, by its class if it has none of its own."""
    code &= 0xFFFF
    if code & 0xFF00 == 0:
        return f"0x{code:04X}: no error, or errors reset"
    for mask in _MASKS:
        words = ERROR_CODES.get(code & mask)
        if words is not None:
            exact = mask == 0xFFFF
            return f"0x{code:04X}: {words}" if exact else f"0x{code:04X}: of the class '{words}'"
    return f"0x{code:04X}: not a code of CiA 301 or CiA 402; see the drive's manual"


REGISTER_BITS = (
    "generic",
    "current",
    "voltage",
    "temperature",
    "communication",
    "device profile",
    "reserved",
    "manufacturer",
)
"""Bits 0 to 7 of the error register 1001h."""


def register_text(register: int) -> str:
    """Return the error register 1001h as text."""
    words = [name for bit, name in enumerate(REGISTER_BITS) if register >> bit & 1]
    return ", ".join(words) or "no error"


class Emergency(NamedTuple):
    """One EMCY frame: error code, error register, five bytes of the manufacturer."""

    code: int
    register: int
    vendor: bytes

    @property
    def cleared(self) -> bool:
        """True for "errors reset": the drive has no error left."""
        return self.code & 0xFF00 == 0

    @property
    def text(self) -> str:
        """The frame as text."""
        vendor = f", vendor bytes {self.vendor.hex(' ')}" if any(self.vendor) else ""
        return f"{error_text(self.code)} (register: {register_text(self.register)}{vendor})"


_FRAME = struct.Struct("<HB5s")


def decode_emergency(data: bytes) -> Emergency | None:
    """Return the emergency in the eight bytes of an EMCY frame; None if there are fewer."""
    if len(data) < _FRAME.size:
        return None
    return Emergency(*_FRAME.unpack_from(data))
