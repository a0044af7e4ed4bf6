"""What a path is that was given in place of something else: one sentence says so."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tautwave.reading import open_file

RIG, SWEEP, PROTOCOL = "a rig", "a sweep", "a protocol of trials"
PROFILE, CALIBRATION = "a profile of a drive", "a calibration"
SUMMARY, SCHEDULER = "the summary of a run", "a scheduler file of Dask"
RUN, RECORDING, PICTURES = "the directory of a run", "a recording", "the pictures of a camera"
PAGE, DATASET, TABLE = "the page of a report", "a LeRobot dataset", "a table"
BAG = "a ROS 2 bag"
SWEPT = "the results of a sweep"

WANTED = {"rig file": RIG, "sweep file": SWEEP, "protocol": PROTOCOL, "profile": PROFILE}
"""What a reader takes, by its word for such a file."""

_USE = {
    RIG: "`tautwave check {path}` reads it",
    SWEEP: "`tautwave sweep {path}` computes it",
    PROTOCOL: "`tautwave trials {path} --participant NAME` runs it",
    PROFILE: "a Modbus device of a rig names it",
    CALIBRATION: "a rig names it",
    SUMMARY: "the rig of that run is {folder}/rig.yaml",
    SCHEDULER: "`tautwave sweep FILE --scheduler {path}` takes it",
    RUN: "its rig is {path}/rig.yaml",
    RECORDING: "its run is in {folder}, the rig in {folder}/rig.yaml",
    PICTURES: "its run is in {folder}, the rig in {folder}/rig.yaml",
    PAGE: "a browser shows it; its run is in {folder}",
    DATASET: "`tautwave identify {path}` and `tautwave report DIR --against {path}` read it",
    BAG: "`tautwave identify {path}` and `tautwave report DIR --against {path}` read it",
    SWEPT: "points.csv in it is its table",
    TABLE: "`tautwave identify {path}` and `tautwave report DIR --against {path}` read it",
}
_USE_OF_A_RIG = {
    SWEEP: "a sweep names one: `rig: {path}`; `tautwave example sweeps/many-walls` has one",
    PROTOCOL: "a protocol names one: `rig: {path}`",
    RUN: "`tautwave run {path} --out DIR` makes one",
    RECORDING: "`tautwave run {path} --out DIR` makes one",
}
_MCAP = b"\x89MCAP"
_TABLES = (".csv", ".tsv", ".parquet", ".pq", ".npz", ".mat")


def kind_of_keys(value: Mapping[str, Any]) -> str:
    """Return what a file with these keys at its top is, '' if that cannot be determined."""
    keys = set(value)
    sides = keys & {"master", "slave"}
    if isinstance(value.get("rig"), str) and not sides:
        if keys & {"conditions", "trial_s", "repetitions"}:
            return PROTOCOL
        if keys & {"measures", "planes", "grid", "columns", "cases"}:
            return SWEEP
        if keys >= {"outcome", "clock"}:
            return SUMMARY
    if sides and keys & {"buses", "coupling", "scene"}:
        return RIG
    if "axes" in keys and keys <= {"rig", "axes", "format"}:
        return CALIBRATION
    if keys >= {"family", "functions"}:
        return PROFILE
    return SCHEDULER if keys >= {"type", "address"} else ""


def kind_of_path(path: Path) -> str:
    """Return what a directory, or a file that is no YAML, is; '' if that cannot be determined."""
    if path.is_dir():
        if any((path / name).exists() for name in ("recording.mcap", "summary.json", "live.json")):
            return RUN
        if (path / "meta" / "info.json").exists():
            return DATASET
        if (path / "metadata.yaml").exists():
            return BAG
        return SWEPT if (path / "points.csv").exists() else ""
    try:
        with open_file(path) as file:
            return kind_of_bytes(path, file.read(64))
    except (OSError, ValueError):
        return ""


def kind_of_bytes(path: Path, start: bytes) -> str:
    """Return what a file that begins so is, if that is no YAML; '' if that cannot be determined."""
    if start.startswith(_MCAP):
        return PICTURES if path.name.startswith("camera-") else RECORDING
    if start[:64].lower().startswith(b"<!doctype html"):
        return PAGE
    if path.suffix == ".db3":
        return BAG
    return TABLE if path.suffix in _TABLES else ""


def mistaken(path: str | Path, kind: str, *wanted: str) -> str:
    """Return the sentence for who gave a `kind` where something else is wanted; '' if it fits.

    Parameters
    ----------
    path : str or Path
        As it was given.
    kind : str
        What it is; '' is left to the reader.
    *wanted : str
        Kinds that the reader takes, its main one first.
    """
    if kind in ("", *wanted):
        return ""
    use = _USE_OF_A_RIG.get(wanted[0], _USE[RIG]) if kind == RIG else _USE[kind]
    use = use.format(path=path, folder=Path(path).parent)
    return f"{path}: {kind}, not {wanted[0]}; {use}"


def refused(path: Path, kind: str, raw: bytes | None = None) -> str:
    """Return the sentence for a path that a reader of `kind` files cannot read; '' for none.

    `raw`: how it begins, where it was read.
    """
    if kind not in WANTED:
        return ""
    kind_there = kind_of_path(path) if raw is None else kind_of_bytes(path, raw)
    return mistaken(path, kind_there, WANTED[kind])
