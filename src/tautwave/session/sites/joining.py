"""Before the loop of one of two sites: agree with the other; after it: what became of it."""

from __future__ import annotations

import hashlib
import json
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.halves import OF_ONE_END
from tautwave.errors import LinkError
from tautwave.rig import Assembly, coupling_part
from tautwave.rig.operated.brakes import quantum_of
from tautwave.rig.operated.operation import rig_brakes, site_pulls
from tautwave.runtime.carrying.side import SideLoad
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.loop import LoopResult
from tautwave.runtime.operate.inbox import People
from tautwave.session.sites.agreed import SiteLimits
from tautwave.session.sites.control import SiteControl
from tautwave.session.sites.desk_line import DeskLine
from tautwave.session.sites.endpoint import Endpoint
from tautwave.session.sites.operated import OperatedSite
from tautwave.session.sites.rest import Approach
from tautwave.sites.control import Session
from tautwave.sites.datagrams import open_socket
from tautwave.sites.desk import Order
from tautwave.sites.path import parse_address

SIDES = ("master", "slave")
OWN_KEYS = ("engage_tolerance", *OF_ONE_END)
"""How keys of a pair end that concern one end, or only when to begin."""


class Joined(NamedTuple):
    """A site that has found the other one: its desk, its socket, the first session."""

    line: DeskLine
    sock: socket.socket
    session: Session
    peer: tuple[str, int] | None

    def leave(self, result: LoopResult) -> None:
        """Say how a run ended, where its loop did not: in slots that it skipped, or by an error."""
        self.line.leave(result.error)

    def summary(self, rig: Rig, assembly: Assembly) -> dict[str, Any]:
        """Return what is known of the link after a run."""
        assert isinstance(assembly.control, SiteControl)
        return {"site": rig.site, "shared": shared_hash(rig), **assembly.control.summary()}


def shared_keys(rig: Rig) -> dict[str, Any]:
    """Return what both sites must have alike, as JSON."""
    coupling = rig.coupling.model_dump(mode="json")
    coupling["pairs"] = {
        name: {key: value for key, value in pair.items() if not key.endswith(OWN_KEYS)}
        for name, pair in coupling["pairs"].items()
    }
    axes = {
        name: {"kind": axis.kind, "causality": axis.causality, "divisor": rig.axis_divisor(name)}
        for name, axis in rig.axes.items()
    }
    operated = {} if rig.operate is None else {"operate": True}
    return {
        "tautwave": version("tautwave"), "rig": rig.name, "rate_hz": rig.rate_hz,
        "coupling": coupling, "axes": axes, **operated,
    }  # fmt: skip


def shared_hash(rig: Rig) -> str:
    """Return the SHA-256 of `shared_keys`: equal on two sites that could agree."""
    return hashlib.sha256(json.dumps(shared_keys(rig), sort_keys=True).encode()).hexdigest()


def order_of(rig: Rig) -> Order:
    """Return what the desk of this site has to know.

    Raises
    ------
    ConfigError
        The other site's address is none.
    """
    sites, site = rig.sites, rig.site
    assert sites is not None
    assert site is not None
    peer = SIDES[1 - SIDES.index(site)]
    serves = sites.serves == site
    block = getattr(sites, site)
    host, port = block.bind, sites.port
    if not serves:
        host, port = parse_address(getattr(sites, sites.serves).address, sites.port)
    folder = rig.source.parent if rig.source is not None else Path()
    keys = str((folder / block.keys).resolve())
    return Order(site, peer, serves, host, port, keys, shared_keys(rig), {})


@contextmanager
def joined(rig: Rig, tell: Callable[[str], None]) -> Iterator[Joined]:
    """Find the other site and agree with it; inside the block the session is kept.

    Raises
    ------
    ConfigError
        Keys are missing, or the extra `network` is.
    LinkError
        The other site does not come, or refuses.
    """
    from tautwave.sites.certificates import identity_files
    from tautwave.sites.seal import load_cryptography

    assert rig.sites is not None
    order = order_of(rig)
    load_cryptography()
    identity_files(Path(order.keys), order.site)
    peer = None
    if order.serves:
        sock = open_socket(order.host, order.port)
        tell(f"{order.site} waits for {order.peer} at {order.host or 'every address'}:{order.port}")
    else:
        peer = resolved(order.host, order.port)
        sock = open_socket("::" if ":" in peer[0] else "", 0)
        tell(f"{order.site} is trying to reach {order.peer} at {order.host}:{order.port}")
    line = DeskLine(order)
    try:
        session = line.wait(order.peer, rig.sites.wait_s, tell)
        tell(f"{order.site} and {order.peer} are in session {session.id.hex()}")
        yield Joined(line, sock, session, peer)
    except BaseException as err:
        line.leave(err)  # nothing has moved yet
        raise
    finally:
        line.close()
        sock.close()


def resolved(host: str, port: int) -> tuple[str, int]:
    """Return a host's address, so that the loop never asks for it; raises `LinkError`."""
    try:
        address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0][4]
    except OSError as err:
        raise LinkError(f"{host}: {err.strerror or err}") from err
    return str(address[0]), int(address[1])


def with_site(rig: Rig, assembly: Assembly, link: Joined, people: People | None = None) -> Assembly:
    """Return the assembly with its controller as one of two sites, operated by `people` if any."""
    control = assembly.control
    assert isinstance(control, CoupledControl)
    assert rig.sites is not None
    assert rig.site is not None
    side = SIDES.index(rig.site)
    assert rig.link is not None
    keys = rig.link
    law = registry.load_named(coupling_part(rig).at_sites)[rig.site]
    endpoint = Endpoint(link.sock, side, len(control.pairs), assembly.clock.now_ns)
    limits = SiteLimits(
        round(keys.silence_s * 1e9), round(keys.lost_s * 1e9),
        round(max(rig.sites.wait_s, keys.lost_s) * 1e9), rig.sites.greatest_backlog,
        follows=rig.sites.serves != rig.site,
    )  # fmt: skip
    pulls, tolerances = site_pulls(rig, control)
    approach = Approach(
        pulls,
        [quantum_of(rig, name.name) for name in control.names],
        rig_brakes(rig, control, assembly.delays),
        {name for name, q in zip(control.pair_names, control.pairs, strict=True)
         if not q.at_engage},
        tolerances,
    )  # fmt: skip
    given = (
        control, law, side, limits, approach, endpoint, link.line, link.session, link.peer,
        assembly.clock.now_ns,
    )  # fmt: skip
    site = SiteControl(*given) if people is None else OperatedSite(people, *given)
    if isinstance(site, OperatedSite):
        site.loads = [one for one in assembly.sources if isinstance(one, SideLoad)]
    sources = [site, *assembly.sources[1:]]
    columns = [*assembly.columns[: -sum(len(s.columns) for s in assembly.sources)]]
    columns += [name for source in sources for name in source.columns]
    return assembly._replace(control=site, sources=sources, columns=columns)
