"""A node of ROS 2 on DDS: topics as its middlewares name them, type hashes, discovery.

Source: design.ros2.org, "Topic and Service name mapping to DDS"; REP-2011 (type hashes, RIHS01, in
the user data of readers and writers); rmw_dds_common (nodes, on `ros_discovery_info`). DDS has no
authentication here, so a node stays on the loopback interface unless it is given another one.
"""

from __future__ import annotations

import html
import ipaddress
import re
import socket
from collections.abc import Sequence
from typing import Any

from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_typestore

from tautwave.errors import ConfigError
from tautwave.view.ros.messages import (
    Gid,
    NodeEntitiesInfo,
    ParticipantEntitiesInfo,
    ros_name,
)

LOOPBACK = "lo"
KEPT = 10
"""Messages that wait for a slow reader; what ROS 2 has by default."""

MIN_INDEXED = 32
"""Participants of one machine that are found where there is no multicast."""

_CDR = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False)


def check_namespace(namespace: str) -> None:
    """Refuse what ROS does not take as a namespace.

    Raises
    ------
    ConfigError
        It is none.
    """
    if namespace != "/" and not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", namespace):
        raise ConfigError(
            "--namespace: must be names preceded by slashes, such as "
            f"/left (got {namespace[:80]!r})"
        )


def configuration(interface: str, peers: Sequence[str] = ()) -> str:
    """Return Cyclone's configuration: one interface, and whom to ask beside multicast.

    Raises
    ------
    ConfigError
        There is no such interface, or a peer is not an address.
    """
    known = [name for _, name in socket.if_nameindex()]
    if interface not in known:
        raise ConfigError(f"--interface {interface}: there are {', '.join(known)}")
    for peer in peers:
        try:
            ipaddress.ip_address(peer)
        except ValueError as error:
            raise ConfigError(f"--peer: give a numeric address (got {peer[:80]!r})") from error
    # Nodes that were started without a restriction hear no multicast on the loopback interface.
    asked = [*(["127.0.0.1"] if interface == LOOPBACK else []), *peers]
    listed = "".join(f'<Peer Address="{peer}"/>' for peer in asked)
    return (
        "<CycloneDDS><Domain><General><Interfaces>"
        f'<NetworkInterface name="{html.escape(interface)}" multicast="true"/>'
        "</Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        f"<MaxAutoParticipantIndex>{MIN_INDEXED}</MaxAutoParticipantIndex>"
        f"<Peers>{listed}</Peers></Discovery></Domain></CycloneDDS>"
    )


class Node:
    """One node, alone in its process.

    Parameters
    ----------
    name, namespace : str
        Of the node; relative topics are below the namespace, `/` or `/left`.
    domain : int
        `ROS_DOMAIN_ID`.
    interface : str
        The only one that is used.
    peers : sequence of str
        Addresses that are asked where multicast does not pass.

    Raises
    ------
    ConfigError
        The interface or a peer does not exist, or DDS does not start on it.
    """

    def __init__(
        self,
        name: str,
        namespace: str = "/",
        domain: int = 0,
        interface: str = LOOPBACK,
        peers: Sequence[str] = (),
    ) -> None:
        text = configuration(interface, peers)
        self.namespace = namespace
        self._types = get_typestore(Stores.ROS2_JAZZY)
        try:
            self._domain = Domain(domain, text)
            self._participant = DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
            self._about = self._writer(
                "ros_discovery_info",
                ParticipantEntitiesInfo,
                Policy.Durability.TransientLocal,
                Policy.History.KeepLast(1),
            )
        except DDSException as error:
            raise ConfigError(f"DDS does not start on {interface}: {error.msg}") from error
        self._node = NodeEntitiesInfo(namespace, name, [], [])

    def full(self, topic: str) -> str:
        """Return a topic below the namespace, unless it begins with a slash."""
        return topic if topic.startswith("/") else f"{self.namespace.rstrip('/')}/{topic}"

    def publisher(self, topic: str, message: Any) -> Any:
        """Return a writer of a topic, reliable and without a memory for who comes later."""
        writer = self._writer(
            f"rt{self.full(topic)}",
            message,
            Policy.Durability.Volatile,
            Policy.History.KeepLast(KEPT),
        )
        self._node.writer_gid_seq.append(_gid(writer))
        self._tell()
        return writer

    def subscription(self, topic: str, message: Any) -> Any:
        """Return a reader of a topic that takes what any writer offers."""
        qos = Qos(
            Policy.Reliability.BestEffort,
            Policy.Durability.Volatile,
            Policy.History.KeepLast(KEPT),
            Policy.Userdata(self._hash(message)),
        )
        place = Topic(self._participant, f"rt{self.full(topic)}", message)
        reader = DataReader(self._participant, place, qos)
        self._node.reader_gid_seq.append(_gid(reader))
        self._tell()
        return reader

    def _writer(self, name: str, message: Any, *policies: Any) -> Any:
        qos = Qos(
            Policy.Reliability.Reliable(max_blocking_time=100_000_000),
            *policies,
            _CDR,
            Policy.Userdata(self._hash(message)),
        )
        return DataWriter(self._participant, Topic(self._participant, name, message), qos)

    def _hash(self, message: Any) -> bytes:
        return f"typehash={self._types.hash_rihs01(ros_name(message))};".encode()

    def _tell(self) -> None:
        """Say which readers and writers the node has; the last time is kept for who comes later."""
        self._about.write(ParticipantEntitiesInfo(_gid(self._participant), [self._node]))


def taken(reader: Any) -> list[Any]:
    """Return the messages that have come; what a writer that left has to say is none."""
    return [one for one in reader.take(KEPT) if one.sample_info.valid_data]


def _gid(entity: Any) -> Gid:
    return Gid(list(entity.guid.bytes))
