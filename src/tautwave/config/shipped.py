"""The rig files that come with tautwave: `configs/` of a checkout, the same files in a wheel."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config.text.document import nearest
from tautwave.config.text.yaml12 import parse_yaml
from tautwave.errors import ConfigError
from tautwave.files import make_directory, write_bytes

PACKAGE = Path(__file__).parents[1]
SHIPPED = PACKAGE / "examples"
"""Their folder in a wheel (pyproject.toml, force-include)."""
CHECKOUT = PACKAGE.parents[1] / "configs"
"""Their folder in an editable installation."""


class Example(NamedTuple):
    """A shipped rig or sweep: its name, its file, and a one-sentence summary."""

    name: str
    path: Path
    summary: str


class Copied(NamedTuple):
    """A file of an example: where it is, and whether it had to be written."""

    path: Path
    written: bool


@cache
def shipped_folder() -> Path:
    """Return the folder of the shipped rig files.

    Raises
    ------
    ConfigError
        This installation has none.
    """
    for folder in (SHIPPED, CHECKOUT):
        if (folder / "bench-1dof-loopback.yaml").is_file():
            return folder
    raise ConfigError(f"{SHIPPED}: the shipped rig files are missing; reinstall tautwave")


def example_named(path: Path) -> str:
    """Return the example that a path, which need not exist, is named after; empty if none."""
    try:
        names = [example.name for example in examples()]
    except ConfigError:
        return ""
    wanted = path.name.removesuffix(".yaml")
    return next((name for name in names if name.rpartition("/")[2] == wanted), "")


def offer_example(path: Path) -> None:
    """Refuse a file that is not there, but is named like an example, and say how to get it.

    Raises
    ------
    ConfigError
        It is so.
    """
    if not path.exists() and (name := example_named(path)):
        raise ConfigError(f"{path}: no such file; `tautwave example {name}` copies it here")


def examples() -> list[Example]:
    """Return every shipped rig and sweep, by name."""
    folder = shipped_folder()
    return [
        Example(path.relative_to(folder).with_suffix("").as_posix(), path, _summary(path))
        for path in sorted(folder.glob("**/*.yaml"))
    ]


def find_example(name: str) -> Example:
    """Return the shipped rig or sweep of that name, with or without `.yaml`.

    Raises
    ------
    ConfigError
        There is none.
    """
    known = {example.name: example for example in examples()}
    example = known.get(name.removesuffix(".yaml"))
    if example is None:
        hint = nearest(name, list(known))
        raise ConfigError(f"there is no example {name!r}{hint}; `tautwave example` lists all")
    return example


def copy_example(name: str, folder: Path) -> list[Copied]:
    """Copy an example, and the files it names, into `folder`, keeping their relative places.

    An existing identical file is kept; if a different one exists, nothing is copied.

    Parameters
    ----------
    name : str
        As `find_example` takes it.
    folder : Path
        Created if it does not exist.

    Returns
    -------
    list of Copied
        The example's own file first.

    Raises
    ------
    ConfigError
        No such example, or a different file has one of the names.
    WritingError
        Something cannot be written.
    """
    base = shipped_folder()
    plan = [(path, folder / path.relative_to(base)) for path in _with_named(find_example(name))]
    taken = [target for source, target in plan if not _free_for(source, target)]
    if taken:
        raise ConfigError(
            [f"{target}: already exists and differs from the shipped file" for target in taken]
            + ["nothing was copied; choose another directory with --out"]
        )
    return [Copied(target, _copy(source, target)) for source, target in plan]


def _with_named(example: Example) -> Sequence[Path]:
    """The example's file and the files it names: the rig of a sweep, the sounds of a scene."""
    files = [example.path]
    for path in files:  # grows meanwhile
        if path.suffix == ".yaml":
            for text in _texts(parse_yaml(path.read_text(encoding="utf-8")).value):
                named = (path.parent / text).resolve() if len(text) < 200 else path
                if named.is_file() and named not in files:
                    files.append(named)
    return files


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)


def _free_for(source: Path, target: Path) -> bool:
    if not target.exists():
        return True
    return target.is_file() and target.read_bytes() == source.read_bytes()


def _copy(source: Path, target: Path) -> bool:
    if target.exists():
        return False
    make_directory(target.parent)
    write_bytes(target, source.read_bytes())
    return True


def _summary(path: Path) -> str:
    """The first sentence of the comment on top."""
    lines: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        text = line.removeprefix("#").strip()
        if not line.startswith("#") or not text:
            break
        lines.append(text)
    return re.split(r"(?<=[.?!])\s", " ".join(lines), maxsplit=1)[0]
