"""One file of an acceptance that a person may hand on: numbers and verdicts, nobody's names.

`tautwave accept --share FILE` makes it of a kept acceptance alone, so that it can be made again.
Nothing is sent anywhere. Names of rig, buses, axes and pairs are numbered; host, user, addresses,
paths, serial numbers and free texts of `source` are left out, unless asked for.
"""

from __future__ import annotations

import getpass
import ipaddress
import json
import math
import re
import socket
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.config.guard import parse_json
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError, RecordingError
from tautwave.files import write_text
from tautwave.reading import read_file
from tautwave.recordings.recording import read_recording
from tautwave.session.acceptance.document import FILE, LARGEST, TRAFFIC, verify
from tautwave.traffic import RUNNING, around_gap

Format = Literal["tautwave shared acceptance 1"]
KEEP = ("names", "serial", "paths", "hosts")
"""What is left out unless it is asked for."""
SPAN_S, MAX_ROWS = 2.0, 100
"""Of each stage, the last seconds, and so many rows of them."""
MAX_LINES = 1000
"""Of the traffic of each bus in a stage, after its first cycle and before its end."""
ENDINGS = (".position", ".velocity", ".command", ".total", ".effort")
TIMES = ("lateness_us", "compute_us", ".answer_us")
SERIAL, PATH, HOST, SOURCE = "<serial>", "<path>", "<host>", "<source>"
SOURCES = frozenset({"given", "identified", "estimated", "data sheet", "weighed", "measured"})
"""Where a parameter is from, in words that name nobody; any other text may."""
HOSTS = ("endpoint", "host", "peer")
"""Keys whose values are hosts, with or without a dot or a port."""


class Shared(BaseModel):
    """The file: what was tried, on what, what was measured, and how it ended.

    `simulated` says that every bus was simulated; `unwatched` are axes that no watchdog stops;
    `checks` are those of the acceptance, with their measured numbers, `earlier` those of stages
    that were done again; `stages` have the times of the loop [us], the last rows, and lines of
    traffic; `rig` is the resolved rig file.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    format: Format = "tautwave shared acceptance 1"
    version: str
    day: str
    by: str = ""
    simulated: bool
    clock: str = ""
    machine: dict[str, Any] = Field(default_factory=dict)
    accepted: bool
    ended_at: str
    left_out: list[str]
    buses: dict[str, dict[str, Any]]
    devices: dict[str, dict[str, str]]
    unwatched: list[str] = Field(default_factory=list)
    checks: list[dict[str, Any]]
    earlier: list[dict[str, Any]] = Field(default_factory=list)
    notes: dict[str, list[str]]
    stages: dict[str, dict[str, Any]] = Field(default_factory=dict)
    rig: dict[str, Any]


class _Cleaner:
    """Takes names, addresses, paths and serial numbers out of text."""

    def __init__(self, rig: Mapping[str, Any], serials: set[str], keep: Sequence[str]) -> None:
        self._keep = keep
        self.words: dict[str, str] = {}
        self._buses: dict[str, str] = {}
        self._serials = sorted(serials, key=len, reverse=True)
        if "names" not in keep:
            self._number([str(rig.get("name", ""))], "rig", numbered=False)
            self._buses = {name: f"bus{k}" for k, name in enumerate(rig.get("buses", {}), 1)}
            sides = (rig.get(side, {}).get("axes", {}) for side in ("master", "slave"))
            self._number([name for axes in sides for name in axes], "axis")
            self._number(rig.get("coupling", {}).get("pairs", {}), "pair")
        private = [socket.gethostname(), _user(), Path.home().name] if "hosts" not in keep else []
        self._private = [word for word in private if len(word) > 2]

    def _number(self, names: Any, word: str, *, numbered: bool = True) -> None:
        for name in names:
            if name and name not in self.words:
                count = sum(one.startswith(word) for one in self.words.values())
                self.words[name] = f"{word}{count + 1}" if numbered else word

    def checks(self, checks: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return checks without what is left out."""
        return [
            {**one, "what": self.text(one["what"]), "expected": self.text(one["expected"]),
             "measured": self.tree(one["measured"])}
            for one in checks
        ]  # fmt: skip

    def text(self, text: str) -> str:
        """Return a text without what is left out."""
        if "serial" not in self._keep:
            for serial in self._serials:
                text = re.sub(rf"(?<![\w.]){re.escape(serial)}(?![\w.])", SERIAL, text)
            text = _SERIAL_SAID.sub(rf"\1{SERIAL}", text)
            text = _SERIAL_EXPECTED.sub(rf"\1{SERIAL}", text)
        if "hosts" not in self._keep:
            text = _URL.sub(rf"\1{HOST}", text)
            text = _IPV6.sub(_address, text)
            for pattern in (_MAIL, _MAC, _IPV4, _DOMAIN):
                text = pattern.sub(HOST, text)
            text = _PORT.sub(rf"{HOST}\1", text)
        if "paths" not in self._keep:
            for pattern in (_QUOTED, _PATH, _WINDOWS, _FILE):
                text = pattern.sub(PATH, text)
        if "serial" not in self._keep:
            text = _ADAPTER.sub(rf"\1{SERIAL}", text)
        for word in self._private:
            text = re.sub(rf"\b{re.escape(word)}\b", HOST, text)
        for name, word in self._buses.items():  # `can` and `arm` are words elsewhere
            text = re.sub(rf"\bbus (['\"]?){re.escape(name)}(?![\w-])", rf"bus \1{word}", text)
        for name in sorted(self.words, key=len, reverse=True):
            text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", self.words[name], text)
        return text

    def tree(self, value: Any, key: str = "") -> Any:
        """Return a tree with every key and text cleaned."""
        if isinstance(value, Mapping) and key == "buses":
            return {self._buses.get(k, k): self.tree(v, str(k)) for k, v in value.items()}
        if isinstance(value, Mapping):
            return {self.key(str(k)): self.tree(v, str(k)) for k, v in value.items()}
        if key == "bus" and isinstance(value, str):
            return self._buses.get(value, value)
        if isinstance(value, list | tuple):
            return [self.tree(one, key) for one in value]
        if "serial" in key and "serial" not in self._keep and not isinstance(value, bool | None):
            return SERIAL
        if isinstance(value, str):
            return self._value(value, key)
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return value

    def _value(self, text: str, key: str) -> str:
        """Return a text that is the value of a key, which says more than the text alone."""
        if key == "source" and "names" not in self._keep and text not in SOURCES:
            return SOURCE
        if "paths" not in self._keep and _NAMED.fullmatch(text):
            return PATH
        cleaned = self.text(text)
        bare = key in HOSTS and cleaned == text and text != "sim" and not text.startswith("/")
        return HOST if bare and "hosts" not in self._keep else cleaned

    def lines(self, lines: Sequence[str]) -> list[str]:
        """Return lines of traffic with their buses numbered and serial numbers zero."""
        cleaned, zeroed = [], _Zeroed()
        for line in lines:
            at, bus, *rest = line.split()
            if "serial" not in self._keep and len(rest) == 2:
                rest[1] = zeroed.frame(bus, *rest)
            cleaned.append(" ".join([at, self._buses.get(bus, bus), *rest]))
        return cleaned

    def key(self, key: str) -> str:
        """Return a key, or a column's name, with the names in it numbered."""
        return ".".join(self.words.get(part, part) for part in key.split("."))


class _Zeroed:
    """Traffic of CAN buses with the answers that hold a serial number set to zero.

    They are uploads of 1018:04 (CiA 301: expedited, or in segments) and, of MIT motors, answers to
    a reading of register 15.
    """

    def __init__(self) -> None:
        self._register: dict[str, str] = {}
        self._segments: set[tuple[str, str]] = set()

    def frame(self, bus: str, way: str, what: str) -> str:
        """Return a frame, or bytes, as the line of traffic has it."""
        head, mark, data = what.partition("#")
        if not mark or len(data) != 16:
            return what
        sdo = head[0] in "56" and len(head) == 3 and data[2:8] == "181004"
        if way == ">" and head == "7FF":
            self._register[bus] = data[:8]
        if (bus, head) in self._segments and way == "<" and int(data[:2], 16) >> 5 == 0:
            if int(data[:2], 16) & 1:  # the last one
                self._segments.discard((bus, head))
            return f"{head}#{data[:2]}{'0' * 14}"
        if sdo and way == "<" and data[:2] in ("40", "41"):
            self._segments.add((bus, head))
            return what
        if sdo or (data[4:8] == "330F" and self._register.get(bus) == data[:8]):
            return f"{head}#{data[:8]}{'0' * 8}"
        return what


def _address(found: re.Match[str]) -> str:
    """Return <host> for an address of IPv6; `607C:00` is not one."""
    try:
        ipaddress.IPv6Address(found[0].partition("%")[0])
    except ValueError:
        return found[0]
    return HOST


_URL = re.compile(r"(\w+://)(?:[^\s@'\"]*@)?(?:\[[^\]\s]*\]|[^/\s:'\",;)\]}]+)")
_IPV6 = re.compile(r"(?<![\w:.])(?=[0-9A-Fa-f:]*[0-9A-Fa-f])[0-9A-Fa-f]*:[0-9A-Fa-f:.]*"
                   r"[0-9A-Fa-f:](?:%\w+)?(?!\w)")  # fmt: skip
_IPV4 = re.compile(r"(?<![\d.])(?:\d{1,3}\.){3}\d{1,3}(?![\d.]*\d)")
_MAIL = re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)*")
_MAC = re.compile(r"(?<![\w:-])[0-9A-Fa-f]{2}(?:([:-])[0-9A-Fa-f]{2})(?:\1[0-9A-Fa-f]{2}){4}(?!\w)")
_DOMAIN = re.compile(
    r"(?i)(?<![\w./<-])(?:[\w-]+\.)+(?:local|localdomain|lan|home|internal|intranet|corp|com|org|net"
    r"|edu|gov|de|ch|at|fr|uk|eu|nl|se|dk|pl|cz|es|jp|cn|kr|ca|au)(?![\w-]|\.\w)"
)
_PORT = re.compile(
    r"(?<![\w.:/<-])(?![0-9A-F]{4}:\d\d\b)(?=[\w.-]*[A-Za-z])\w[\w-]*(?:\.[\w-]+)*"
    r"(:\d{2,5})(?![\w:])"
)
_START = r"(?:~\w*|\.{1,2})?/(?=[^\s/])"
_QUOTED = re.compile(rf"(?<=')(?:{_START}[^'\n]*)(?=')|(?<=\")(?:{_START}[^\"\n]*)(?=\")")
_SUFFIX = (
    r"\.(?:eds|dcf|xdd|xdc|ya?ml|json|csv|mcap|urdf|xacro|xml|stl|obj|dae|txt|log|np[yz]|toml|pem"
    r"|key|crt|ini|cfg|wav|gif|png|html|md|pdf|py|zip|msh|vt[ku]|bin|bag|xlsx?|docx?)(?![\w])"
)
_PATH = re.compile(
    rf"(?<![\w/>.]){_START}(?:[^:;\"\n]*{_SUFFIX}|(?:[^:;\"\n/]*/)*[^\s:;\"]+(?: [\w.@+-]+)*)",
    re.IGNORECASE,
)
"""To the suffix of a file, else to the end of the clause: any sign may be in it."""
_WINDOWS = re.compile(r"(?<!\w)(?:[A-Za-z]:[\\/]|\\\\)[^:;\"\n]+")
_FILE = re.compile(rf"(?<![\w<>])[\w@+.~-][\w./@+~()',#-]*{_SUFFIX}", re.IGNORECASE)
_NAMED = re.compile(rf"[^:;\"\n]+{_SUFFIX}", re.IGNORECASE)
"""A value that is the name of a file as a whole, blanks and all."""
_ADAPTER = re.compile(r"(\busb-[^\s/]*_)[^\s/_<]+?(?=-if\d|-port\d|$|\s)")
"""Of /dev/serial/by-id: usb-MAKER_PRODUCT_SERIAL-if00-port0."""
_SERIAL_SAID = re.compile(r"(?i)(\bserial(?: number)?(?: is|:|=)? *)(?:0x[0-9a-f]+|[\w-]*\d[\w-]*)")
_SERIAL_EXPECTED = re.compile(r"(?i)(\bserial number\b[^;\n]*? expects )[\w-]+")


def _serials(value: Any, key: str = "") -> Iterator[str]:
    """Yield the serial numbers in a tree, as text and, of numbers, in both ways to write them."""
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _serials(one, str(name))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _serials(one, key)
    elif "serial" in key and isinstance(value, str | int) and not isinstance(value, bool):
        yield str(value)
        try:
            number = int(str(value), 0)
        except ValueError:
            return
        yield from (str(number), f"0x{number:X}", f"0x{number:x}", f"0x{number:08X}")


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def shared(document: Path, keep: Sequence[str] = ()) -> Shared:
    """Return what may be handed on of an acceptance.

    Parameters
    ----------
    document : Path
        Its acceptance.json, or the directory with it.
    keep : sequence of str
        Of `KEEP`, what is not left out.

    Raises
    ------
    ConfigError
        It is no acceptance, or was changed since.
    """
    path = document / FILE if document.is_dir() else document
    wrong = verify(path).wrong
    if wrong:
        raise ConfigError("\n".join(wrong))
    content = parse_json(read_file(path, LARGEST).decode())
    if "devices" not in content:
        raise ConfigError(f"{path}: was written by tautwave 0.1, without what is shared; accept "
                          "the rig again")  # fmt: skip
    named = content.get("folders", {})
    folders = {stage: path.parent / named.get(stage, stage) for stage in content["stages"]}
    rig = next((_rig(one) for one in folders.values() if (one / "rig.yaml").is_file()), {})
    devices = content["devices"]
    known = [*_serials(devices), *_serials(rig), *_serials(content["checks"])]
    serials = {text for text in known if len(text) > 2}
    cleaner = _Cleaner(rig, serials, keep)
    recorded = {
        stage: {**_rows(one, cleaner), **_traffic(one, cleaner)} for stage, one in folders.items()
    }
    stages = {name: one for name, one in recorded.items() if one}
    return Shared(
        version=content["version"],
        day=content["sealed_utc"][:10],
        by=content["by"] if "names" in keep else "",
        simulated=all(bus["simulated"] for bus in content["buses"].values()),
        clock=content.get("clock", ""),
        machine=cleaner.tree(content.get("machine", {})),
        accepted=content["accepted"],
        ended_at=content["ended_at"],
        left_out=[one for one in KEEP if one not in keep],
        buses=cleaner.tree(content["buses"], "buses"),
        devices=cleaner.tree(devices),
        unwatched=[cleaner.text(name) for name in content.get("unwatched", [])],
        checks=cleaner.checks(content["checks"]),
        earlier=cleaner.checks(content.get("earlier", [])),
        notes={stage: [cleaner.text(note) for note in notes]
               for stage, notes in content["notes"].items()},
        stages=stages,
        rig=cleaner.tree(rig),
    )  # fmt: skip


def _rig(folder: Path) -> dict[str, Any]:
    tree = parse_yaml(read_file(folder / "rig.yaml", LARGEST).decode()).value
    return tree if isinstance(tree, dict) else {}


def _rows(folder: Path, cleaner: _Cleaner) -> dict[str, Any]:
    """Return the times of a stage's loop, and its last rows, thinned; {} of one without rows."""
    if not (folder / "recording.mcap").is_file():
        return {}
    try:
        recording = read_recording(folder / "recording.mcap")
    except RecordingError:  # its device was refused before the first row; verified before
        return {}
    times = {}
    for name in recording.columns:
        if name in TIMES or name.endswith(TIMES[-1]):
            values = sorted(value for value in recording[name].tolist() if math.isfinite(value))
            if values:
                at = [values[round(share * (len(values) - 1))] for share in (0.5, 0.99, 1.0)]
                spread = zip(("p50", "p99", "max"), map(_short, at), strict=True)
                times[cleaner.key(name)] = dict(spread)
    wanted = ["time_s", *(name for name in recording.columns if name.endswith(ENDINGS))]
    count = len(recording)
    seconds = recording["time_s"]
    first = next((k for k in range(count) if seconds[k] >= seconds[count - 1] - SPAN_S), 0)
    stride = max(1, math.ceil((count - first) / MAX_ROWS))
    rows = [
        [_short(float(recording[name][k])) for name in wanted] for k in range(first, count, stride)
    ]
    return {"rows": count, "times_us": times, "columns": [cleaner.key(one) for one in wanted],
            "last": rows}  # fmt: skip


def _traffic(folder: Path, cleaner: _Cleaner) -> dict[str, list[str]]:
    """Return the lines of a stage's traffic: the first, and the last."""
    if not (folder / TRAFFIC).is_file():
        return {}
    numbered = list(enumerate(read_file(folder / TRAFFIC, LARGEST).decode().splitlines()))
    begun = next((at for at, line in numbered if line.startswith(RUNNING)), 0)
    kept = []
    for bus in dict.fromkeys(line.split()[1] for _, line in numbered):
        own = [one for one in numbered if one[1].split()[1] == bus]
        most = MAX_LINES + sum(at < begun for at, _ in own)
        if len(own) > most + MAX_LINES:
            own = around_gap(own[:most], own[-MAX_LINES:], lambda one: " > " in one[1])
        kept += own
    return {"traffic": cleaner.lines([line for _, line in sorted(kept)])}


def _short(value: float) -> float | None:
    return float(f"{value:.5g}") if math.isfinite(value) else None


def text_of(found: Shared) -> str:
    """Return the file: JSON, one row of numbers a line."""
    text = json.dumps(found.model_dump(mode="json"), indent=1)
    return re.sub(r"\[\s+((?:(?:-?[\d.e+-]+|null),?\s*)+)\]", _one_line, text) + "\n"


def _one_line(found: re.Match[str]) -> str:
    return f"[{' '.join(found[1].split())}]"


def read_shared(path: Path) -> Shared:
    """Read a shared file.

    Raises
    ------
    ConfigError
        It is none.
    """
    try:
        return Shared.model_validate(parse_json(read_file(path, LARGEST).decode()))
    except (ValueError, KeyError, TypeError) as err:
        first = str(err).splitlines()[0]
        raise ConfigError(f"{path}: is no file of `tautwave accept --share`: {first}") from err


def write_shared(path: Path, found: Shared) -> None:
    """Write a shared file.

    Raises
    ------
    WritingError
        It cannot be written.
    """
    write_text(path, text_of(found))
