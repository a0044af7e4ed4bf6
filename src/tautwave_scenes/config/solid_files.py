"""Surfaces of solids: STL, in ASCII and binary, and Wavefront OBJ.

Sources: 3D Systems, StereoLithography Interface Specification, 1989; Wavefront, Advanced Visualizer
Manual, appendix B1, of which `v` and `f` are read.
"""

from __future__ import annotations

import struct
from itertools import pairwise
from pathlib import Path

from tautwave.reading import read_file
from tautwave_scenes.models.solid import Point, Solid, Triangle, check_count, solid_of

LARGEST = 64 * 1024 * 1024
"""[bytes] More than the greatest number of triangles takes in any of the formats."""

HEAD, RECORD = 84, struct.Struct("<12fH")
"""[bytes] Before the triangles of a binary STL file, and one of them: normal, corners, a number."""


def read_solid(path: Path) -> Solid:
    """Return the solid in a file, in its own unit of length.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        It is damaged, of another format, or encloses nothing.
    """
    data = read_file(path, LARGEST)
    kind = path.suffix.lower()
    if kind == ".obj":
        points, triangles = _obj(data, path.name)
    elif kind == ".stl":
        points, triangles = _stl(data, path.name)
    else:
        raise ValueError(f"{path.name}: solids are .stl or .obj files; export it as one of them")
    return solid_of(points, triangles, path.name)


def _stl(data: bytes, name: str) -> tuple[list[Point], list[Triangle]]:
    count = int.from_bytes(data[80:HEAD], "little") if len(data) >= HEAD else -1
    if len(data) == HEAD + RECORD.size * count:  # whatever its heading says
        return _binary(data, count, name)
    if data.lstrip()[:5] == b"solid" and b"facet" in data[:4096]:
        return _ascii(data.decode("ascii", "replace"), name)
    if count < 0:
        raise ValueError(f"{name} is cut short: {len(data)} bytes are no STL file")
    raise ValueError(
        f"{name} is cut short, or no STL file: {count} triangles take "
        f"{HEAD + RECORD.size * count} bytes, and it has {len(data)}; export it again"
    )


def _binary(data: bytes, count: int, name: str) -> tuple[list[Point], list[Triangle]]:
    check_count(count, name)
    points: list[Point] = []
    for values in RECORD.iter_unpack(data[HEAD:]):
        points += [values[3:6], values[6:9], values[9:12]]
    return points, _in_threes(points)


def _ascii(text: str, name: str) -> tuple[list[Point], list[Triangle]]:
    points: list[Point] = []
    ended = False
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words[:1] == ["vertex"]:
            points.append(_point(words[1:], f"{name}:{number}"))
        ended = ended or words[:1] == ["endsolid"]
    if len(points) % 3 or not ended:
        raise ValueError(f"{name} is cut short: it has no `endsolid`, or a facet of other corners")
    check_count(len(points) // 3, name)
    return points, _in_threes(points)


def _obj(data: bytes, name: str) -> tuple[list[Point], list[Triangle]]:
    points: list[Point] = []
    triangles: list[Triangle] = []
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
        words = line.partition("#")[0].split()
        place = f"{name}:{number}"
        if words[:1] == ["v"]:
            points.append(_point(words[1:4], place))
        elif words[:1] == ["f"]:
            corners = [_corner(word, len(points), place) for word in words[1:]]
            if len(corners) < 3:
                raise ValueError(f"{place}: a face needs three corners (got {line.strip()!r})")
            # Of a polygon a fan: one that is neither flat nor convex is better cut by its author.
            triangles += [(corners[0], one, two) for one, two in pairwise(corners[1:])]
    check_count(len(triangles), name)
    return points, triangles


def _point(words: list[str], place: str) -> Point:
    try:
        x, y, z = (float(word) for word in words)
    except ValueError:
        raise ValueError(f"{place}: three numbers are needed (got {' '.join(words)!r})") from None
    return x, y, z


def _corner(word: str, count: int, place: str) -> int:
    """Return the number of a corner from 0; in the file from 1, or from the last one backwards."""
    try:
        number = int(word.partition("/")[0])
    except ValueError:
        number = 0
    at = number - 1 if number > 0 else count + number
    if number == 0 or not 0 <= at < count:
        raise ValueError(f"{place}: there is no corner {word!r} above this line")
    return at


def _in_threes(points: list[Point]) -> list[Triangle]:
    return [(at, at + 1, at + 2) for at in range(0, len(points), 3)]
