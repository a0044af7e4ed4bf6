"""What a file is by its keys: the fewest that tell it, and one of them less."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.kinds import (
    BAG,
    CALIBRATION,
    DATASET,
    PAGE,
    PICTURES,
    PROFILE,
    PROTOCOL,
    RECORDING,
    RIG,
    RUN,
    SCHEDULER,
    SUMMARY,
    SWEEP,
    SWEPT,
    TABLE,
    kind_of_bytes,
    kind_of_keys,
    kind_of_path,
)


@pytest.mark.parametrize(
    ("keys", "kind"),
    [
        *(("rig " + key, PROTOCOL) for key in ("conditions", "trial_s", "repetitions")),
        *(("rig " + key, SWEEP) for key in ("measures", "planes", "grid", "columns", "cases")),
        ("rig outcome clock", SUMMARY),
        ("rig outcome", ""),
        ("rig clock", ""),
        ("rig", ""),
        ("rig master grid", ""),  # a side makes it no sweep
        *((f"{side} {key}", RIG) for side in ("master", "slave")
          for key in ("buses", "coupling", "scene")),
        ("master", ""),
        ("buses coupling", ""),
        ("axes", CALIBRATION),
        ("axes rig format", CALIBRATION),
        ("axes more", ""),
        ("rig format", ""),
        ("family functions", PROFILE),
        ("family functions more", PROFILE),
        ("family", ""),
        ("type address", SCHEDULER),
        ("type address more", SCHEDULER),
        ("address", ""),
        ("", ""),
    ],
)  # fmt: skip
def test_the_fewest_keys_that_tell_a_file(keys: str, kind: str) -> None:
    assert kind_of_keys(dict.fromkeys(keys.split(), "text")) == kind


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *((name, RUN) for name in ("recording.mcap", "summary.json", "live.json")),
        ("meta/info.json", DATASET),
        ("metadata.yaml", BAG),
        ("points.csv", SWEPT),
        ("other.txt", ""),
    ],
)
def test_the_file_that_tells_a_directory(name: str, kind: str, tmp_path: Path) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("")
    assert kind_of_path(tmp_path) == kind


@pytest.mark.parametrize(
    ("name", "start", "kind"),
    [
        ("a", b"\x89MCAP", RECORDING),
        ("camera-1.mcap", b"\x89MCAP0\r\n", PICTURES),
        ("a", b"\x88MCAP", ""),
        ("a", b"<!DOCTYPE HTML>", PAGE),
        ("a.db3", b"", BAG),
        *(("a" + end, b"", TABLE) for end in (".csv", ".tsv", ".parquet", ".pq", ".npz", ".mat")),
        ("a.txt", b"", ""),
    ],
)
def test_the_beginning_or_name_that_tells_a_file(name: str, start: bytes, kind: str) -> None:
    assert kind_of_bytes(Path(name), start) == kind
