"""ROS 2 messages as DDS types; the fields are those of the .msg files, in their order.

Source: common_interfaces, rcl_interfaces and rmw_dds_common of ROS 2 (the same since Iron). Names
on the wire are those of rosidl_generator_dds_idl: `sensor_msgs/msg/JointState` becomes
`sensor_msgs::msg::dds_::JointState_`.
"""

# Cyclone DDS reads the annotations, which therefore have to be types and not their names.
from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, byte, float64, int32, sequence, uint8, uint32


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Since 1970, UTC."""

    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """When it was measured, and in which frame."""

    stamp: Time
    frame_id: str


@dataclass
@final
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    """Yes or no."""

    data: bool


@dataclass
@final
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Joints by name [rad or m, rad/s or m/s, N m or N]; empty: nothing is known of that."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
@final
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """Along the axes of the header's frame."""

    x: float64
    y: float64
    z: float64


@dataclass
@final
class Wrench(IdlStruct, typename="geometry_msgs::msg::dds_::Wrench_"):
    """Force [N] and torque [N m]."""

    force: Vector3
    torque: Vector3


@dataclass
@final
class WrenchStamped(IdlStruct, typename="geometry_msgs::msg::dds_::WrenchStamped_"):
    """A wrench at the origin of the header's frame."""

    header: Header
    wrench: Wrench


@dataclass
@final
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    """One of the values behind a status."""

    key: str
    value: str


@dataclass
@final
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    """How one thing is; `level` 0 OK, 1 WARN, 2 ERROR, 3 STALE."""

    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue] = field(default_factory=list)


@dataclass
@final
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    """How everything is."""

    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
@final
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    """Of a participant, reader or writer."""

    data: array[uint8, 16]


@dataclass
@final
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    """A node's name, readers and writers."""

    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
@final
class ParticipantEntitiesInfo(
    IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"
):
    """The nodes of a participant; what `ros2 node list` shows."""

    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


def ros_name(message: type[IdlStruct]) -> str:
    """Return the name that ROS has for a type, `sensor_msgs/msg/JointState`."""
    package, _, _, name = message.__idl_typename__.split("::")
    return f"{package}/msg/{name.removesuffix('_')}"
