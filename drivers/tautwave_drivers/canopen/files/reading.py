"""EDS and DCF files as vendors write them, with the line of everything that a drive may be given.

Source: CiA 306-1. Read here and not by the canopen library, whose reader (2.4) stops at what
vendors' tools take: comments by `//`, a section or key that comes twice, keys without a type or a
name, sub-objects before their object, upper-case `SUB`, values in `[1234Value]`; and it drops a
value that it cannot read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from tautwave.config.guard import read_guarded
from tautwave.errors import ConfigError
from tautwave_drivers.canopen.files.values import (
    SIGNED,
    TEXTS,
    TYPES,
    UNSIGNED,
    UnreadableError,
    bare,
    encode,
    integer,
    number,
)
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.objects import find

LARGEST = 4 * 1024 * 1024
"""Bytes; files of large servo families have some 1 MB."""
MAX_OBJECTS = 20_000
MAX_SUBS = 254

_INTEGERS = frozenset({*SIGNED, *UNSIGNED})
_SINGLE = (2, 7)
"""Object types DOMAIN and VAR."""
_LINE_END = re.compile(r"\r\n|\r|\n")
_SECTION = re.compile(r"\[\s*([^\]]*?)\s*\]")
_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_LIST = re.compile(r"([0-9a-f]{4})(name|value|denotation|objectlinks)")
_OTHERS = re.compile(
    "fileinfo|deviceinfo|comments|dummyusage|(mandatory|optional|manufacturer)objects|"
    "devicecomm?issioning|connecteddevices|standarddatatypes|dynamicchannels|supportedmodules|"
    r"m\d+(moduleinfo|comments|fixedobjects|subext\w*)|tools|tool\d+"
)
"""Sections that hold no objects, by CiA 306."""
_PLAIN = re.compile("info|issioning|comments|dummyusage")
"""Sections whose keys are words: a number there was an object's."""
_NO_NODE = (0, 0xFF)
"""Node ids of a device that has none yet."""
_COMMENTS = (";", "#", "//")
_KNOWN = {
    *("parametername", "objecttype", "datatype", "accesstype", "defaultvalue", "parametervalue"),
    *("pdomapping", "lowlimit", "highlimit", "subnumber", "objflags", "compactsubobj"),
    *("storagelocation", "denotation", "uploadfile", "downloadfile", "srdomapping"),
    *("factor", "unit", "description"),  # of the canopen library
}
"""Keys of an object's section."""


class Text(NamedTuple):
    """A value and its line."""

    text: str
    line: int


class _Section(NamedTuple):
    name: str
    line: int
    fields: dict[str, Text]

    def get(self, key: str) -> str | None:
        field = self.fields.get(key)
        return None if field is None else field.text


@dataclass(frozen=True, slots=True)
class FileObject:
    """One object of a file: address, name, data type, access, texts of values; None: not given."""

    index: int
    sub: int
    name: str
    kind: int | None
    access: str
    default: str | None
    value: Text | None
    mappable: bool | None
    default_line: int = 0

    @property
    def address(self) -> str:
        """Index and sub-index as text: `6040:00`."""
        return f"{self.index:04X}:{self.sub:02X}"

    @property
    def writable(self) -> bool:
        """Whether it can be written, as far as the file says: AccessType may be missing or odd."""
        return self.access not in ("ro", "const")

    def unreadable_default(self) -> str:
        """Return why the default is no integer, '' where it is one, or blank."""
        if self.default is None or not bare(self.default):
            return ""
        try:
            number(self.default, 1)  # of any node
        except UnreadableError as err:
            return f"{self.address} {self.name} has the default {self.default[:40]!r}: {err}"
        return ""


class Setting(NamedTuple):
    """A parameter value of a DCF: the object, and its value as bytes."""

    object: FileObject
    data: bytes
    line: int

    def equals(self, held: bytes) -> bool:
        """Return whether a drive's bytes are this value.

        A number may come with more bytes (an expedited response need not state its length), a text
        with zeros behind it.
        """
        if self.object.kind in TEXTS:
            return held.rstrip(b"\0") == self.data.rstrip(b"\0")
        return held[: len(self.data)] == self.data


class DeviceFile(NamedTuple):
    """What an EDS or DCF file says.

    `objects` by index and sub-index, in the order of the file; `info` are the fields of
    [DeviceInfo] by lower-case key; `node_id` is that of [DeviceCommissioning], None where it names
    none; `remarks` are sentences on what was odd.
    """

    path: str
    objects: dict[tuple[int, int], FileObject]
    info: dict[str, str]
    node_id: int | None
    remarks: tuple[str, ...]

    def number(self, entry: Entry, node_id: int | None = None) -> int | None:
        """Return the value of an object as the file has it, else its default, else None."""
        one = self.objects.get((entry.index, entry.sub))
        if one is None:
            return None
        value = integer(one.value.text if one.value else one.default, node_id)
        bits = SIGNED.get(TYPES[entry.type], 0)
        if value is not None and bits and 1 << (bits - 1) <= value < 1 << bits:
            value -= 1 << bits  # two's complement in hexadecimal
        return value

    def unreadable(self, entries: Iterable[Entry]) -> list[str]:
        """Return a sentence with its line for each of these objects whose default is no integer."""
        objects = [self.objects.get((entry.index, entry.sub)) for entry in entries]
        return [
            f"{self.path}:{one.default_line}: {reason}; correct it, or leave it blank if it is "
            "not known"
            for one in objects
            if one is not None and (reason := one.unreadable_default())
        ]

    def settings(self, node_id: int) -> Iterator[Setting | str]:
        """Yield the parameter values of objects that can be written; a sentence for a wrong one."""
        for one in self.objects.values():
            if one.value is None or not one.value.text or not one.writable:
                continue
            text, line = one.value
            try:
                yield Setting(one, encode(text, one.kind, node_id), line)
            except UnreadableError as err:
                yield (
                    f"{self.path}:{line}: {one.address} {one.name} has the value {text[:40]!r}, "
                    f"which is {err}; correct it, or remove the line"
                )


def read_device_file(path: str) -> DeviceFile:
    """Return what an EDS or DCF file says.

    Raises
    ------
    ConfigError
        It cannot be read or is not such a file.
    """
    where = Path(path)
    if where.suffix.lower() not in (".eds", ".dcf"):
        raise ConfigError(f"{path}: not an EDS or DCF file (.eds, .dcf)")
    try:
        state = where.stat()
    except OSError:
        return _read(path, 0, 0)  # says why
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=16)
def _read(path: str, mtime_ns: int, size: int) -> DeviceFile:
    raw = read_guarded(Path(path), "EDS or DCF file", LARGEST, ("latin-1",)).encode("latin-1")
    text = _decoded(raw)
    remarks: list[str] = []
    sections = _sections(path, text, remarks)
    # Lists of values ([1234Value]) are defaults in an EDS, settings in a DCF.
    dcf = Path(path).suffix.lower() == ".dcf" or any(
        section.get("parametervalue") for section in sections.values()
    )
    objects = _objects(path, sections, dcf=dcf)
    if not objects:
        raise ConfigError(
            f"{path}: not an EDS or DCF file: it defines no objects; use the one from the drive's "
            "vendor"
        )
    identity = _fields(sections, "deviceinfo")
    info = {key: one.text for key, one in identity.items()}
    for key in ("vendornumber", "productnumber", "revisionnumber"):
        one = identity.get(key)
        if one and one.text and integer(one.text) is None:
            remarks.append(
                f"{path}:{one.line}: {key} is {one.text[:40]!r}, not a number: it was not compared"
            )
    commissioning = {
        **_fields(sections, "devicecommissioning"),
        **_fields(sections, "devicecomissioning"),  # as CiA 306 spells it
    }
    stated = commissioning.get("nodeid")
    node_id = integer(stated.text) if stated else None
    node_id = node_id if node_id is not None and 1 <= node_id <= 127 else None
    if stated and stated.text and node_id is None and integer(stated.text) not in _NO_NODE:
        remarks.append(
            f"{path}:{stated.line}: NodeID is {stated.text[:40]!r}, no node id (1 to 127): whose "
            "file this is was not compared"
        )
    odd = [
        f"line {one.default_line}: {reason}"
        for one in objects.values()
        if one.kind in _INTEGERS and (reason := one.unreadable_default())
    ]
    if odd:
        more = f" and {len(odd) - 3} more" if len(odd) > 3 else ""
        remarks.append(f"{path}: {', '.join(odd[:3])}{more}: counts as not stated")
    return DeviceFile(path, objects, info, node_id, tuple(remarks))


def _decoded(raw: bytes) -> str:
    """Return the text: CiA 306 says ASCII, but vendors' editors write what their Windows has."""
    zeros = raw[:400].count(0), raw[:400:2].count(0)
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = raw.decode("utf-16", "replace")
    elif zeros[0] > len(raw[:400]) // 3:
        text = raw.decode("utf-16-be" if 2 * zeros[1] > zeros[0] else "utf-16-le", "replace")
    else:
        for encoding in ("utf-8-sig", "cp1252", "gbk", "latin-1"):
            try:
                text = raw.decode(encoding)
                break
            except UnicodeDecodeError:
                continue
    return text.replace("\0", "").replace("\x1a", "\n")  # padding, and the end of a file in DOS


def _fields(sections: dict[str, _Section], name: str) -> dict[str, Text]:
    return sections[name].fields if name in sections else {}


def _sections(path: str, text: str, remarks: list[str]) -> dict[str, _Section]:
    """Return the sections by lower-case name; what comes twice counts as it comes last."""
    by_name: dict[str, _Section] = {}
    section: _Section | None = None
    twice: list[str] = []
    odd: list[str] = []
    for at, raw in enumerate(_LINE_END.split(text), 1):
        line = raw.strip()
        if not line or line.startswith(_COMMENTS):
            continue
        head = _SECTION.match(line)
        if head:
            name = head[1].lower()
            if not (_OBJECT.fullmatch(name) or _LIST.fullmatch(name) or _OTHERS.fullmatch(name)):
                odd.append(f"[{head[1][:40]}] (line {at})")
            if name in by_name:
                twice.append(f"[{head[1]}] (line {at})")
            section = by_name.setdefault(name, _Section(head[1], at, {}))
            continue
        key, given, value = line.partition("=" if "=" in line else ":")
        key = "".join(key.split()).lower()
        if section is None:  # a title, or what a tool left there
            if "=" in line:
                odd.append(f"{line[:40]!r} (line {at})")
            continue
        own = _OBJECT.fullmatch(section.name.lower())
        if not given:
            if line[0] == "[" or line[-1] == "]" or (own and key.startswith("parametervalue")):
                raise ConfigError(
                    f"{path}:{at}: {line[:40]!r} is neither a section in brackets nor a key with "
                    "its value; correct it"
                )
            odd.append(f"{line[:40]!r} (line {at})")
            continue
        if key in section.fields:
            twice.append(f"{key} in [{section.name}] (line {at})")
        elif (own and key not in _KNOWN) or (key.isdigit() and _PLAIN.search(section.name.lower())):
            odd.append(f"{key[:40]!r} (line {at})")
        section.fields[key] = Text(re.split(r"\s;", value, maxsplit=1)[0].strip(), at)
    for kind, what in ((twice, "comes twice, and counts as it comes last"), (odd, "is not used")):
        if kind:
            more = f" and {len(kind) - 3} more" if len(kind) > 3 else ""
            remarks.append(f"{path}: {', '.join(kind[:3])}{more}: {what}")
    return by_name


def _objects(
    path: str, sections: dict[str, _Section], *, dcf: bool
) -> dict[tuple[int, int], FileObject]:
    """Return all objects, by the order in which their indices first come."""
    parents: dict[int, _Section] = {}
    subs: dict[int, dict[int, _Section]] = {}
    lists: dict[tuple[int, str], _Section] = {}
    for name, section in sections.items():
        own, listed = _OBJECT.fullmatch(name), _LIST.fullmatch(name)
        if own and own[2] is None:
            parents[int(own[1], 16)] = section
            subs.setdefault(int(own[1], 16), {})
        elif own:
            subs.setdefault(int(own[1], 16), {})[int(own[2], 16)] = section
        elif listed:
            lists[int(listed[1], 16), listed[2]] = section
            subs.setdefault(int(listed[1], 16), {})
        elif "parametervalue" in section.fields:
            raise ConfigError(
                f"{path}:{section.fields['parametervalue'].line}: a ParameterValue in "
                f"[{section.name[:40]}], which names no object; correct the name of the section"
            )
    objects: dict[tuple[int, int], FileObject] = {}
    for index, members in subs.items():
        parent = parents.get(index)
        names, values = (lists.get((index, kind)) for kind in ("name", "value"))
        for one in _members(path, sections, index, parent, members, names, values):
            objects[index, one.sub] = one if dcf or one.value is None else as_default(one)
        if len(objects) > MAX_OBJECTS:
            raise ConfigError(f"{path}: more than {MAX_OBJECTS} objects, so no drive's file")
    return objects


def as_default(one: FileObject) -> FileObject:
    """Return an object whose value is its default."""
    if one.value is None:
        return one
    return replace(one, default=one.value.text, default_line=one.value.line, value=None)


def _members(
    path: str,
    sections: dict[str, _Section],
    index: int,
    parent: _Section | None,
    members: dict[int, _Section],
    names: _Section | None,
    values: _Section | None,
) -> Iterator[FileObject]:
    """Yield one object, or its sub-objects: in sections of their own, or compact."""
    compact = integer(parent.get("compactsubobj")) if parent else None
    if compact is not None and not 0 <= compact <= MAX_SUBS:
        assert parent is not None
        line = parent.fields["compactsubobj"].line
        raise ConfigError(
            f"{path}:{line}: CompactSubObj is {compact}; an object has {MAX_SUBS} sub-indices at "
            "most"
        )
    listed = {sub: text for sub, text in _listed(path, values) if text.text}
    titles = dict(_listed(path, names))
    if parent is not None:
        alone = not (members or compact or listed)
        if alone or (0 not in members and integer(parent.get("objecttype")) in _SINGLE):
            yield _object(sections, index, 0, parent, listed.pop(0, None))
        elif parent.get("parametervalue") and not _is_count(parent, members.get(0)):
            raise ConfigError(
                f"{path}:{parent.fields['parametervalue'].line}: a ParameterValue in "
                f"[{parent.name}], whose values belong to its sub-objects; correct it"
            )
    own = _Section("", 0, {}) if parent is None else parent
    numbers = range(1, (compact or 0) + 1)
    for sub in sorted({*members, *numbers, *listed}):
        if sub in members:
            yield _object(sections, index, sub, members[sub], listed.get(sub))
        else:
            title = titles.get(sub)
            yield _object(sections, index, sub, own, listed.get(sub), title.text if title else "")


def _is_count(parent: _Section, members: _Section | None) -> bool:
    """Return whether an object's value is how many sub-objects it has, as sub-index 0 says too."""
    count = integer(parent.get("parametervalue"))
    value = (
        None if members is None else members.get("parametervalue") or members.get("defaultvalue")
    )
    return count is not None and count == integer(value)


def _listed(path: str, section: _Section | None) -> Iterator[tuple[int, Text]]:
    """Yield what a section lists by sub-index: names or values of compact sub-objects."""
    for key, value in (section.fields if section else {}).items():
        sub = integer(key)
        if key == "nrofentries":
            continue
        if sub is None or not 0 <= sub <= MAX_SUBS:
            assert section is not None
            raise ConfigError(
                f"{path}:{value.line}: {key[:20]!r} in [{section.name}] is no sub-index (0 to "
                f"{MAX_SUBS})"
            )
        yield sub, value


def _object(
    sections: dict[str, _Section],
    index: int,
    sub: int,
    section: _Section,
    listed: Text | None,
    title: str = "",
) -> FileObject:
    kind = integer(section.get("datatype"))
    known = find(index, sub)
    if kind is None and known is not None:
        kind = TYPES[known.type]
    if kind is not None and kind > 0x1B:  # a file's own type, defined by its index (CANFestival)
        own = sections.get(f"{kind:04x}sub1") or sections.get(f"{kind:x}sub1")
        kind = integer(own.get("defaultvalue")) if own else kind
    return FileObject(
        index,
        sub,
        title or section.get("parametername") or "(without a name)",
        kind,
        (section.get("accesstype") or "").lower(),
        section.get("defaultvalue"),
        listed or section.fields.get("parametervalue"),
        None if (mapped := integer(section.get("pdomapping"))) is None else bool(mapped),
        section.fields["defaultvalue"].line if "defaultvalue" in section.fields else 0,
    )
