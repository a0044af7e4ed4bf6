"""Everything about this machine that a rig, or any rig, depends on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.keys.coupling import Loop
from tautwave.session.doctor import machine, wires
from tautwave.session.doctor.finding import Finding

ROOT = Path("/")


def examine(
    rig: Rig | None, root: Path = ROOT, links: wires.Links = wires.link_details
) -> list[Finding]:
    """Return every finding; with a rig, about its own ports and interfaces only."""
    loop = Loop() if rig is None else rig.loop
    findings = list(machine.examine(root, loop.fifo_priority, loop.lock_memory))
    if rig is not None:
        return [*findings, *_of_rig(rig, root, links)]
    for port in wires.serial_ports(root):
        findings += wires.serial_port(port, root)
    for channel in wires.can_interfaces(root):
        findings += wires.can_interface(channel, root, None, links)
    return findings


def _of_rig(rig: Rig, root: Path, links: wires.Links) -> Iterator[Finding]:
    for bus in rig.buses.values():
        plugin = registry.load_driver(bus.driver)
        if plugin.endpoint is None:
            continue
        endpoint = plugin.endpoint(plugin.options.model_validate(bus.options))
        scheme, _, channel = endpoint.name.partition(":")
        if endpoint.name.startswith("/dev/"):
            yield from wires.serial_port(endpoint.name, root)
        elif channel.startswith("/dev/"):  # a CAN adapter on a serial port
            yield from wires.serial_port(channel.partition("@")[0], root)
        elif scheme == "socketcan":
            yield from wires.can_interface(channel, root, bus.options.get("bitrate"), links)
