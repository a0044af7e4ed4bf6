"""Messages are on the wire what rosbags makes of the same fields, for every type and distro."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rosbags.typesys import Stores, get_typestore

from tautwave.view.ros import messages as m

STORES = {
    store: get_typestore(store)
    for store in Stores
    if store.name in ("ROS2_IRON", "ROS2_JAZZY", "ROS2_KILTED", "ROS2_LYRICAL")  # as far as known
}
JAZZY = STORES[Stores.ROS2_JAZZY]
ALL = [one for one in vars(m).values() if isinstance(one, type) and hasattr(one, "serialize")]
ALL.remove(m.IdlStruct)

number = st.floats(width=64)
text = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
numbers = st.lists(number, max_size=4)
times = st.builds(m.Time, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
headers = st.builds(m.Header, times, text)
vectors = st.builds(m.Vector3, number, number, number)
wrenches = st.builds(m.Wrench, vectors, vectors)
values = st.builds(m.KeyValue, text, text)
# Levels are 0 to 3, and a byte is signed for rosbags.
statuses = st.builds(
    m.DiagnosticStatus, st.integers(0, 127), text, text, text, st.lists(values, max_size=3)
)
gids = st.builds(m.Gid, st.lists(st.integers(0, 255), min_size=16, max_size=16))
nodes = st.builds(m.NodeEntitiesInfo, text, text, *2 * [st.lists(gids, max_size=3)])
ANY = st.one_of(
    st.builds(m.Bool, st.booleans()),
    st.builds(m.JointState, headers, st.lists(text, max_size=4), numbers, numbers, numbers),
    st.builds(m.WrenchStamped, headers, wrenches),
    st.builds(m.DiagnosticArray, headers, st.lists(statuses, max_size=3)),
    st.builds(m.ParticipantEntitiesInfo, gids, st.lists(nodes, max_size=2)),
)


def as_ros(store: Any, name: str, message: Any) -> Any:
    """Return what rosbags calls a message with the same fields."""

    def of(value: Any) -> Any:
        if dataclasses.is_dataclass(value):
            return as_ros(store, m.ros_name(type(value)), value)
        if isinstance(value, Sequence) and not isinstance(value, str):
            parts = [of(one) for one in value]
            if name.endswith("/Gid"):
                return np.array(parts, np.uint8)
            plain = all(isinstance(one, float) for one in parts)
            return np.array(parts, np.float64) if plain else parts
        return value

    return store.types[name](*(of(getattr(message, f.name)) for f in dataclasses.fields(message)))


@pytest.mark.sparse(4)  # rosbags writes itself a serializer for each of them: a second
@pytest.mark.parametrize("store", sorted(STORES, key=lambda store: store != Stores.ROS2_JAZZY))
@given(message=ANY)
def test_bytes_are_those_of_rosbags(store: Stores, message: Any) -> None:
    name = m.ros_name(type(message))
    ours = message.serialize(use_version_2=False)
    theirs = bytes(STORES[store].serialize_cdr(as_ros(STORES[store], name, message), name))
    assert ours.ljust(-(-len(ours) // 4) * 4, b"\0") == theirs.ljust(
        -(-len(theirs) // 4) * 4, b"\0"
    )


def test_names_and_fields_are_those_of_ros() -> None:
    for one in ALL:
        name = m.ros_name(one)
        package, _, last = name.split("/")
        assert one.__idl_typename__ == f"{package}::msg::dds_::{last}_"
        theirs = JAZZY.types[name].__annotations__
        fields = [field.name for field in dataclasses.fields(one)]
        assert fields == [key for key, kind in theirs.items() if "ClassVar" not in str(kind)]


def test_hashes_are_alike_in_all_distributions() -> None:
    for one in ALL:
        assert len({store.hash_rihs01(m.ros_name(one)) for store in STORES.values()}) == 1
