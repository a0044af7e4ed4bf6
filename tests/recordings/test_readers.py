"""One table of readers: the same numbers from every kind of file, by command and by rig."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.config import parse_rig
from tautwave.errors import ConfigError
from tautwave.motion import reference_positions
from tautwave.recordings.columns import MADE, column_names, read_columns
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.recordings.times import time_columns

T = 0.002 * np.arange(400)
Q = 0.3 * np.sin(9.0 * T)
F = np.cos(7.0 * T)
RATE = 500.0


def text(separator: str, heading: str = "t,q,f", timed: bool = True) -> Callable[[Path], Any]:
    def make(folder: Path) -> Any:
        columns = [T, Q, F] if timed else [Q, F]
        names = heading.split(",") if heading else ["t", "q", "f"][0 if timed else 1 :]
        lines = [separator.join(names)] if heading else []
        lines += [
            separator.join(f"{x!r}" for x in map(float, row)) for row in zip(*columns, strict=True)
        ]
        path = folder / "log.txt"
        path.write_text("\n".join(lines) + "\n")
        rate = None if timed else RATE
        return path, Stated(None, rate, () if heading else tuple(names)), "q", "f"

    return make


def npz(folder: Path) -> Any:
    np.savez(folder / "log.npz", t=T, both=np.column_stack([Q, F]))
    return folder / "log.npz", UNSTATED, "both[0]", "both[1]"


def parquet(folder: Path) -> Any:
    lib: Any = pytest.importorskip("pyarrow")
    from pyarrow import parquet as write

    both = lib.array(np.column_stack([Q, F]).tolist())
    write.write_table(lib.table({"t": T, "both": both}), folder / "log.parquet")
    return folder / "log.parquet", UNSTATED, "both[0]", "both[1]"


def mat73(folder: Path) -> Any:
    h5py: Any = pytest.importorskip("h5py")
    path = folder / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = T[None, :]
        group = file.create_group("arm")
        group["q"], group["f"] = Q[:, None], F[None, :]
        file["note"] = np.frombuffer("hand".encode("utf-16-le"), dtype=np.uint16)[None, :]
    raw = bytearray(path.read_bytes())
    raw[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(bytes(raw))
    return path, UNSTATED, "arm.q", "arm.f"


def dataset(version: int, folder: Path) -> Any:
    """Write two episodes; the second is the one."""
    lib: Any = pytest.importorskip("pyarrow")
    from pyarrow import parquet as write

    root = folder / "set"
    (root / "meta").mkdir(parents=True)
    (root / "data" / "chunk-000").mkdir(parents=True)
    names = ["arm.pos", "arm.push"]
    feature: Any = {"dtype": "float32", "shape": [2], "names": names}
    if version == 2:
        feature = feature | {"names": {"motors": names}}
    info = {"codebase_version": f"v{version}", "total_episodes": 2, "fps": 500,
            "features": {"observation.state": feature}}  # fmt: skip
    (root / "meta" / "info.json").write_text(json.dumps(info))
    tables = []
    for number, sign in ((0, -1.0), (1, 1.0)):
        state = lib.array((sign * np.column_stack([Q, F])).tolist())
        whose = np.full(len(T), number)
        tables.append(
            lib.table({"timestamp": T, "observation.state": state, "episode_index": whose})
        )
    place = root / "data" / "chunk-000"
    if version == 3:
        write.write_table(lib.concat_tables(tables), place / "file-000.parquet")
    else:
        for number, table in enumerate(tables):
            write.write_table(table, place / f"episode_{number:06d}.parquet")
    state = "observation.state"
    return root, Stated(episode=1), f"{state}.arm.pos", f"{state}.arm.push"


def bag(storage: str, folder: Path) -> Any:
    """Write joint states, and a wrench whose messages lie between them."""
    rosbag2: Any = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types
    path = folder / "bag"

    def header(stamp: int) -> Any:
        time = kinds["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        return kinds["std_msgs/msg/Header"](stamp=time, frame_id="")

    plugin = rosbag2.StoragePlugin.MCAP if storage == "mcap" else rosbag2.StoragePlugin.SQLITE3
    joint, wrench = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as written:
        one = written.add_connection("/arm/joint_states", joint, typestore=store)
        other = written.add_connection("/tip", wrench, typestore=store)
        point = kinds["geometry_msgs/msg/Vector3"]
        empty = np.empty(0)
        for at, place in zip(T, Q, strict=True):
            stamp = 1_700_000_000 * 10**9 + round(1e9 * at)
            state = kinds[joint](
                header=header(stamp), name=["elbow"], position=np.array([place]), velocity=empty,
                effort=empty,
            )  # fmt: skip
            written.write(one, stamp + 5_000_000, store.serialize_cdr(state, joint))
        for late in np.arange(-0.001, T[-1] + 0.002, 0.001):
            stamp = 1_700_000_000 * 10**9 + round(1e9 * late)
            force = point(x=0.0, y=float(np.cos(7.0 * late)), z=0.0)
            felt = kinds["geometry_msgs/msg/Wrench"](force=force, torque=point(x=0.0, y=0.0, z=0.0))
            message = kinds[wrench](header=header(stamp), wrench=felt)
            written.write(other, stamp, store.serialize_cdr(message, wrench))
    return path, UNSTATED, "arm/joint_states.elbow.position", "tip.force.y"


KINDS: dict[str, Callable[[Path], Any]] = {
    "csv": text(","),
    "semicolons": text(";"),
    "blanks": text("  "),
    "headless": text(",", ""),
    "headless blanks": text(" ", ""),
    "timeless": text(",", "q,f", timed=False),
    "headless timeless": text("\t", "", timed=False),
    "npz": npz,
    "parquet": parquet,
    "mat 7.3": mat73,
    "lerobot 2.1": lambda folder: dataset(2, folder),
    "lerobot 3.0": lambda folder: dataset(3, folder),
    "bag mcap": lambda folder: bag("mcap", folder),
    "bag db3": lambda folder: bag("db3", folder),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_file_has_the_same_numbers(tmp_path: Path, kind: str) -> None:
    path, stated, position, effort = KINDS[kind](tmp_path)
    names = column_names(path, stated)
    assert {position, effort} <= set(names)
    clock = MADE if stated.rate_hz is not None else time_columns(names)[0]
    found = read_columns(path, [position, effort], clock, stated=stated)
    begin = found[clock] - found[clock][0]
    np.testing.assert_allclose(begin, T, atol=1e-9)
    np.testing.assert_allclose(found[position], Q, atol=1e-12)
    close = 2e-5 if kind.startswith("bag") else 1e-12  # a wrench between two of its messages
    np.testing.assert_allclose(found[effort], F, atol=close)


def test_what_holds_no_numbers_in_a_matlab_file_is_no_column(tmp_path: Path) -> None:
    """An empty matrix is stored as its size, a cell as references to what is in it."""
    h5py: Any = pytest.importorskip("h5py")
    path, *_ = mat73(tmp_path)
    names = column_names(path)
    with h5py.File(path, "r+") as file:
        file["empty"] = np.array([0, 3], dtype=np.uint64)
        file["empty"].attrs["MATLAB_empty"] = np.uint8(1)
        file["cell"] = np.array([[file["t"].ref, file["t"].ref]], dtype=h5py.ref_dtype)
    assert column_names(path) == names


@pytest.mark.parametrize("kind", ["headless timeless", "lerobot 3.0", "bag db3", "npz"])
def test_a_rig_plays_every_kind_of_file(tmp_path: Path, kind: str) -> None:
    path, stated, position, _ = KINDS[kind](tmp_path)
    clock = MADE if stated.rate_hz is not None else time_columns(column_names(path, stated))[0]
    keys: dict[str, Any] = {
        "type": "recording", "file": path.name, "column": position, "time_column": clock,
    }  # fmt: skip
    keys |= {k: v for k, v in stated._asdict().items() if v not in (None, ())}
    keys |= {"columns": list(stated.columns)} if stated.columns else {}
    played = reference_positions(keys | {"columns": stated.columns}, RATE, 399, tmp_path)
    np.testing.assert_allclose(played[: len(Q)], Q, atol=1e-9)
    bench = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
    override = f"simulation.hand.lever.reference={json.dumps(keys)}"
    rig = parse_rig(bench.read_text(), tmp_path / "rig.yaml", [override], choose=False)
    assert rig.simulation is not None


@pytest.mark.parametrize(
    ("kind", "stated", "said"),
    [
        ("headless", UNSTATED, "starts with numbers; name its 3 columns with --columns"),
        ("headless", Stated(columns=("a", "b")), "got 2; name its 3 columns"),
        ("csv", Stated(columns=("a", "b", "c")), "names its columns already: t, q, f"),
        ("lerobot 3.0", UNSTATED, "a dataset of 2 episodes; choose one with --episode N (0 to 1)"),
        ("lerobot 2.1", Stated(episode=2), "choose one with --episode N"),
    ],
)
def test_what_a_file_does_not_say_is_asked_for(
    tmp_path: Path, kind: str, stated: Stated, said: str
) -> None:
    path, *_ = KINDS[kind](tmp_path)
    with pytest.raises(ConfigError) as caught:
        column_names(path, stated)
    assert said in str(caught.value)


@pytest.mark.parametrize("name", ["a.npz", "a.parquet", "a.mat", "a.db3", "a.mcap"])
def test_what_is_no_such_file_is_a_sentence(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"\x89MCAP0\r\n" + b"no" * 400 if name.endswith("mcap") else b"no" * 400)
    with pytest.raises(ConfigError, match=r"a\.\w+: cannot be read as "):
        column_names(path)


def test_a_bag_without_joints_is_a_sentence_and_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.db3"
    with closing(sqlite3.connect(path)) as bag, bag:
        bag.execute("CREATE TABLE topics (id, name, type)")
        bag.execute("CREATE TABLE messages (topic_id, timestamp, data)")
    opened: list[sqlite3.Connection] = []

    def connect(*words: Any, **named: Any) -> sqlite3.Connection:
        opened.append(sqlite3.Connection(*words, **named))
        return opened[-1]

    monkeypatch.setattr(sqlite3, "connect", connect)
    with pytest.raises(ConfigError, match="has no message of sensor_msgs/msg/JointState or"):
        column_names(path)
    for one in opened:
        with pytest.raises(sqlite3.ProgrammingError, match="closed"):
            one.execute("SELECT 1")
    assert opened
