"""What is named as a file and is none, or has no end: refused at once, in a sentence."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import Link
from tautwave.config.guard import read_guarded
from tautwave.errors import TautwaveError
from tautwave.kinds import kind_of_path
from tautwave.reading import NO_FILE
from tautwave.recordings import cameras, columns
from tautwave.recordings.readers import text
from tautwave.recordings.recording import read_recording
from tautwave.registry import hash_part
from tautwave.rig.network import trace_of
from tautwave.session.acceptance.document import verify
from tautwave_scenes.config.keys3d import Tissue3d, mesh_of
from tautwave_scenes.config.sounds import read_sound

HUGE = 12 << 30
"""[bytes] Of a file that takes no room on the disk."""


def mesh(path: Path) -> Any:
    return mesh_of(Tissue3d(mesh=str(path), young=1e3, poisson=0.3, density=1e3))


READERS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "rig file": (lambda path: read_guarded(path, "rig file", 1 << 20), ".yaml"),
    "network trace": (lambda path: trace_of(Link(trace=str(path))), ".csv"),
    "mesh": (mesh, ".msh"),
    "sound": (read_sound, ".wav"),
    "hand": (lambda path: columns.read_columns(path, ["x"], "t"), ".csv"),
    "npz": (lambda path: columns.column_names(path), ".npz"),
    "Parquet": (lambda path: columns.column_names(path), ".parquet"),
    "bag": (lambda path: columns.column_names(path), ".db3"),
    "MAT": (lambda path: columns.column_names(path), ".mat"),
    "recording": (read_recording, ".mcap"),
    "pictures": (lambda path: list(cameras._records(path)), ".mcap"),
    "part": (lambda path: hash_part(str(path)), ".py"),
    "acceptance": (lambda path: verify(path, None), ".json"),
}
"""What reads the files that a user names, by what they are."""


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("what", ["pipe", "device"])
def test_a_pipe_is_not_waited_for_and_a_device_is_not_read(
    name: str, what: str, tmp_path: Path
) -> None:
    read, suffix = READERS[name]
    path = tmp_path / f"x{suffix}"
    if what == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    assert not kind_of_path(path) or suffix in (".csv", ".mat", ".npz", ".parquet", ".db3")
    found: list[TautwaveError] = []

    def attempt() -> None:
        with pytest.raises(TautwaveError) as caught:
            read(path)
        found.append(caught.value)

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(60.0)
    if thread.is_alive():  # let it go, whatever it does
        with path.open("wb" if what == "pipe" else "rb"):
            pass
    assert NO_FILE.split(";", maxsplit=1)[0] in str(found[0])


@pytest.mark.parametrize(
    "name",
    ["rig file", "hand", "recording", "acceptance", "network trace",
     *(pytest.param(name, marks=pytest.mark.slow) for name in ("mesh", "sound", "MAT"))],
)  # fmt: skip
def test_a_file_of_twelve_gigabytes_is_not_read_whole(name: str, tmp_path: Path) -> None:
    read, suffix = READERS[name]
    path = tmp_path / f"x{suffix}"
    with path.open("wb") as file:
        file.truncate(HUGE)
    with pytest.raises(TautwaveError):
        read(path)


def test_text_without_lines_or_with_too_many_rows_is_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "hand.csv"
    with path.open("wb") as file:
        file.write(b"t,x\n0,0\n")
        file.truncate(HUGE)
    with pytest.raises(TautwaveError, match="a line of over 1048576 characters"):
        columns.read_columns(path, ["x"], "t")
    path.write_text("t,x\n" + "".join(f"{k},0\n" for k in range(11)))
    monkeypatch.setattr(text, "MAX_ROWS", 10)
    with pytest.raises(TautwaveError, match="more than 10 rows; shorten or decimate it"):
        columns.read_columns(path, ["x"], "t")
