"""EDS files as ten families of drives have them: written here, each with its family's habits.

The objects are those of a torque drive by CiA 301 and CiA 402-2; what differs between families is
how a file says it, what it leaves out, and what drives come with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

Key = tuple[int, int]
Fields = dict[str, str]

_CODES = {"i1": 2, "i2": 3, "i4": 4, "u1": 5, "u2": 6, "u4": 7, "s": 9}


def one_of(kind: str, access: str, default: object, mapped: int = 0) -> Fields:
    return {
        "ParameterName": "",
        "ObjectType": "0x7",
        "DataType": f"0x{_CODES[kind]:04X}",
        "AccessType": access,
        "DefaultValue": str(default),
        "PDOMapping": str(mapped),
    }


def objects_of() -> dict[Key, Fields]:
    rw, ro = "rw", "ro"
    found = {
        (0x1000, 0): one_of("u4", ro, "0x00020192"), (0x1001, 0): one_of("u1", ro, 0),
        (0x1005, 0): one_of("u4", rw, "0x80"), (0x1008, 0): one_of("s", "const", "drive"),
        (0x1010, 0): one_of("u1", ro, 1), (0x1010, 1): one_of("u4", rw, 1),
        (0x1014, 0): one_of("u4", rw, "$NODEID+0x80"), (0x1016, 0): one_of("u1", ro, 1),
        (0x1016, 1): one_of("u4", rw, 0), (0x1017, 0): one_of("u2", rw, 0),
        (0x1018, 0): one_of("u1", ro, 4), (0x1018, 1): one_of("u4", ro, "0x999"),
        (0x1018, 2): one_of("u4", ro, "0x402"), (0x1018, 3): one_of("u4", ro, "0x10000"),
        (0x1018, 4): one_of("u4", ro, 0),
        (0x6007, 0): one_of("i2", rw, 1), (0x603F, 0): one_of("u2", ro, 0, 1),
        (0x6040, 0): one_of("u2", rw, 0, 1), (0x6041, 0): one_of("u2", ro, 0, 1),
        (0x605A, 0): one_of("i2", rw, 2), (0x6060, 0): one_of("i1", rw, 0, 1),
        (0x6061, 0): one_of("i1", ro, 0, 1), (0x6064, 0): one_of("i4", ro, 0, 1),
        (0x606C, 0): one_of("i4", ro, 0, 1), (0x6071, 0): one_of("i2", rw, 0, 1),
        (0x6072, 0): one_of("u2", rw, 3000), (0x6075, 0): one_of("u4", rw, 2000),
        (0x6076, 0): one_of("u4", rw, 640), (0x6077, 0): one_of("i2", ro, 0, 1),
        (0x608F, 0): one_of("u1", ro, 2), (0x608F, 1): one_of("u4", rw, 8192),
        (0x608F, 2): one_of("u4", rw, 1), (0x60C2, 0): one_of("u1", ro, 2),
        (0x60C2, 1): one_of("u1", rw, 1), (0x60C2, 2): one_of("i1", rw, -3),
        (0x60FF, 0): one_of("i4", rw, 0, 1), (0x6502, 0): one_of("u4", ro, "0x3A5"),
    }  # fmt: skip
    for number in range(4):
        for base, first in ((0x1400, 0x200), (0x1800, 0x180)):
            at, cob_id = base + number, first + 0x100 * number
            found |= {(at, 0): one_of("u1", ro, 5), (at, 2): one_of("u1", rw, 255)}
            off = "0x80000000+" if number else ""
            found[at, 1] = one_of("u4", rw, f"{off}$NODEID+0x{cob_id:X}")
            found |= {(at, 3): one_of("u2", rw, 0), (at, 5): one_of("u2", rw, 0)}
            found[at + 0x200, 0] = one_of("u1", rw, 1)
            word = "0x60400010" if base == 0x1400 else "0x60410010"
            found[at + 0x200, 1] = one_of("u4", rw, word)
            found |= {(at + 0x200, sub): one_of("u4", rw, 0) for sub in range(2, 9)}
    for (index, sub), fields in found.items():
        fields["ParameterName"] = f"Object {index:04X}" + (f" {sub}" if sub else "")
    return found


INFO = {"VendorName": "a vendor", "VendorNumber": "0x999", "ProductName": "drive",
        "ProductNumber": "0x402"}  # fmt: skip


def file_text(
    objects: Mapping[Key, Fields], info: Mapping[str, str] = INFO, *, sub: str = "sub"
) -> str:
    lines = ["[FileInfo]", "FileName=drive.eds", "EDSVersion=4.0", "[DeviceInfo]"]
    lines += [f"{key}={value}" for key, value in info.items()]
    indices = sorted({index for index, _ in objects})
    for index in indices:
        members = {s: fields for (i, s), fields in objects.items() if i == index}
        if list(members) == [0]:
            lines.append(f"[{index:04X}]")
            lines += [f"{key}={value}" for key, value in members[0].items()]
            continue
        lines += [f"[{index:04X}]", f"ParameterName=Group {index:04X}", "ObjectType=0x9"]
        lines.append(f"SubNumber={len(members)}")
        for number, fields in sorted(members.items()):
            lines.append(f"[{index:04X}{sub}{number:X}]")
            lines += [f"{key}={value}" for key, value in fields.items()]
    return "\n".join(lines) + "\n"


def plain() -> bytes:
    return file_text(objects_of(), INFO).encode()


def micronewtons() -> bytes:
    """The rated torque counts uN m; [DeviceInfo] has another product number than 1018h."""
    objects = objects_of()
    objects[0x1018, 1]["DefaultValue"] = "0x000000FB"
    objects[0x6076, 0]["DefaultValue"] = "640000"
    info = INFO | {"VendorNumber": "251", "ProductNumber": "402"}
    return file_text(objects, info).replace("\n", "\r\n").encode()


def tenths_of_degrees() -> bytes:
    """Positions come in 0.1 degree; encoder and gear are in the file all the same."""
    objects = objects_of()
    objects[0x60A8, 0] = one_of("u4", "rw", "0xFF410000")
    objects[0x608F, 1]["DefaultValue"] = "4000"
    for fields in objects.values():
        del fields["PDOMapping"]
    return file_text(objects, INFO, sub="Sub").encode()


def factors_of_edition_two() -> bytes:
    """Scales of the old edition, `//` comments, upper-case SUB, objects of its own by hundreds."""
    objects = objects_of() | {(0x6093, 0): one_of("u1", "ro", 2)}
    objects |= {(0x6093, 1): one_of("u4", "rw", 1), (0x6093, 2): one_of("u4", "rw", 1)}
    objects |= {(0x2100 + at, 0): one_of("u4", "rw", at) for at in range(200)}
    return ("// made by a setup tool\n" + file_text(objects, INFO, sub="SUB")).encode()


def quiet_on_loss() -> bytes:
    """Nothing says what it does when its master is lost; access rights and names are missing."""
    objects = objects_of()
    del objects[0x6007, 0]
    for fields in objects.values():
        fields.pop("ParameterName")
        if fields["AccessType"] == "rw":
            del fields["AccessType"]
    return file_text(objects, INFO).encode()


def no_motor_yet() -> bytes:
    """It comes without motor data: rated torque 0, one increment a turn; names in GBK."""
    objects = objects_of()
    objects[0x6076, 0]["DefaultValue"] = objects[0x6075, 0]["DefaultValue"] = "0"
    objects[0x608F, 1]["DefaultValue"] = "1"
    objects[0x6064, 0]["ParameterName"] = "位置"
    return file_text(objects, INFO).encode("gbk")


def wide_text() -> bytes:
    """UTF-16; sums around the node id written backwards; modes left blank."""
    objects = objects_of()
    objects[0x6502, 0]["DefaultValue"] = ""
    objects[0x1400, 1]["DefaultValue"] = "0x200 + $NodeID"
    return file_text(objects, INFO).encode("utf-16")


def two_axes() -> bytes:
    """A second axis from 6800h on, with PDOs 65 and more."""
    objects = objects_of()
    second = {(i + 0x800, s): dict(f) for (i, s), f in objects.items() if 0x6000 <= i < 0x6800}
    objects |= second
    for base in (0x1440, 0x1840):
        objects |= {(base, sub): dict(objects[base & 0xFF00, sub]) for sub in (0, 1, 2, 3, 5)}
    return file_text(objects, INFO).encode("cp1252")


def stepper() -> bytes:
    """Profiles only: no cyclic torque."""
    objects = objects_of()
    objects[0x6502, 0]["DefaultValue"] = "0x2F"
    del objects[0x6071, 0]
    return file_text(objects, INFO).encode()


def fixed_pdos() -> bytes:
    """PDOs as the firmware has them: position control, and nothing for torque."""
    objects = objects_of()
    for at, words in ((0x1600, (0x60400010, 0x607A0020)), (0x1A00, (0x60410010, 0x60640020))):
        objects = {key: f for key, f in objects.items() if key[0] != at}
        objects[at, 0] = one_of("u1", "const", len(words))
        objects |= {
            (at, n): one_of("u4", "const", f"0x{word:08X}") for n, word in enumerate(words, 1)
        }
    return file_text(objects, INFO).encode()


def fixed_for_torque() -> bytes:
    """PDOs as the firmware has them: controlword and torque, and one object more that it sends."""
    objects = objects_of()
    held = ((0x1600, (0x60400010, 0x60710010)), (0x1A00, (0x60410010, 0x60640020, 0x60770010)))
    for at, words in held:
        objects = {key: f for key, f in objects.items() if key[0] != at}
        objects[at, 0] = one_of("u1", "const", len(words))
        objects |= {
            (at, n): one_of("u4", "const", f"0x{word:08X}") for n, word in enumerate(words, 1)
        }
    return file_text(objects, INFO).encode()


def inputs_and_outputs() -> bytes:
    """No drive at all: an I/O module that came in the same download."""
    objects = {key: fields for key, fields in objects_of().items() if key[0] < 0x6000}
    objects[0x1000, 0]["DefaultValue"] = "0x000F0191"
    objects[0x6401, 1] = one_of("i2", "ro", 0, 1)
    return file_text(objects, INFO).encode()


class Family(NamedTuple):
    """A file, what `new --eds` or `check` say of it, and why no rig is made of it ('': one is).

    `needs` are options that its run needs.
    """

    make: Callable[[], bytes]
    said: tuple[str, ...] = ()
    refused: str = ""
    needs: tuple[str, ...] = ()


FAMILIES = {
    "plain": Family(plain),
    "micronewtons": Family(
        micronewtons, ("1018:02 product is 0x402 (1026), but [DeviceInfo] has 0x192 (402)",)
    ),
    "tenths of degrees": Family(tenths_of_degrees),
    "factors of edition two": Family(factors_of_edition_two),
    "quiet on loss": Family(
        quiet_on_loss,
        ("it does not say how it reacts to a lost master (no 6007:00)",),
        needs=("--allow-unwatched",),
    ),
    "no motor yet": Family(
        no_motor_yet,
        ("rated_torque [N m] is a guess: TODO", "counts_per_revolution is a guess: TODO"),
    ),
    "wide text": Family(wide_text),
    "two axes": Family(two_axes),
    "fixed for torque": Family(fixed_for_torque),
    "stepper": Family(
        stepper, refused="has no CST cyclic synchronous torque: 6502:00 (0x2F) lists"
    ),
    "fixed PDOs": Family(
        fixed_pdos,
        refused="has a fixed mapping of RPDO1 (60400010, 607A0020 in 1600h), not the wanted one",
    ),
    "inputs and outputs": Family(
        inputs_and_outputs, refused="describes an I/O module (CiA 401), not a CiA 402 drive"
    ),
}
