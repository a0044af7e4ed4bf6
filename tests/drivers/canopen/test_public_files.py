"""What comes of EDS and DCF files of real drives; skipped where they are not: `public_files.py`."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from tests.commands import keep_in_one_process, tautwave
from tests.drivers.canopen.public_files import FILES, FOLDER, URL, PublicFile, fetch


def test_the_table_has_ten_files_that_nobody_wrote_here() -> None:
    assert len({one.name for one in FILES}) == len(FILES) >= 10
    assert all(len(one.sha256) == 64 and len(one.source[1]) == 40 for one in FILES)
    assert all(bool(one.refused) != bool(one.said or one.options or one.stopped) for one in FILES
               if one.name != "Elmo.dcf")  # fmt: skip


def test_what_cannot_be_fetched_is_named_and_another_content_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, folder = tmp_path / "source", tmp_path / "folder"
    source.mkdir()
    (source / FILES[0].name).write_bytes(b"[FileInfo]\n")
    monkeypatch.setenv(URL, f"file://{source}/" + "{path}")
    monkeypatch.setattr(
        "tests.drivers.canopen.public_files.FILES",
        (FILES[0]._replace(path=FILES[0].name), FILES[1]._replace(path=FILES[1].name)),
    )
    changed, missing = fetch(folder)
    assert f"{FILES[0].name}: file://" in changed
    assert changed.endswith("has another content than its table says")
    assert missing.startswith(f"{FILES[1].name}: file://")
    assert list(folder.iterdir()) == []
    known = FILES[0]._replace(
        path=FILES[0].name, sha256=hashlib.sha256(b"[FileInfo]\n").hexdigest()
    )
    monkeypatch.setattr("tests.drivers.canopen.public_files.FILES", (known,))
    assert fetch(folder) == []
    assert (folder / known.name).read_bytes() == b"[FileInfo]\n"


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda one: one.name)
def test_a_public_file_makes_a_rig_that_runs_or_it_is_said_why_not(
    file: PublicFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(os.environ.get(FOLDER, "")) / file.name
    if FOLDER not in os.environ or not path.is_file():
        pytest.skip(f"{file.name} is not in the folder that {FOLDER} names")
    data = path.read_bytes()
    assert hashlib.sha256(data).hexdigest() == file.sha256
    (tmp_path / "drive.eds").write_bytes(data)
    if path.suffix == ".dcf":
        (tmp_path / "drive.eds").rename(tmp_path / "drive.dcf")
    monkeypatch.chdir(tmp_path)
    keep_in_one_process(monkeypatch)
    done = tautwave("new", "r.yaml", "--eds", f"drive{path.suffix}", cwd=tmp_path)
    assert "Traceback" not in done.output
    if file.refused:
        assert done.exit_code == 2, done.output
        assert all(sentence in done.output for sentence in file.refused), done.output
        assert not (tmp_path / "r.yaml").exists()
        return
    assert done.exit_code == 0, done.output
    done = tautwave("check", "r.yaml", cwd=tmp_path)
    assert done.exit_code == 0, done.output
    words = " ".join(done.output.split())
    assert all(sentence in words for sentence in file.said), words
    run = ["run", "r.yaml", "--simulate", "--set", "simulation={}", "--clock", "fake"]
    done = tautwave(*run, "--duration", "0.2", "--out", "out", *file.options, cwd=tmp_path)
    assert done.exit_code == (5 if file.stopped else 0), done.output
    assert file.stopped in done.output
