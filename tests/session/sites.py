"""Two sites in one process, on one fake clock, over the sockets of this machine."""

from __future__ import annotations

import json
import secrets
import socket
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.clock import FakeClock
from tautwave.config import Rig, load_rig
from tautwave.rig import build_rig
from tautwave.runtime.operate.commands import Order
from tautwave.runtime.operate.states import STATES
from tautwave.runtime.sensing import Sensing, bus_commands, first_axes
from tautwave.session.operating import with_operation
from tautwave.session.sites.control import SiteControl
from tautwave.session.sites.desk_line import Leaving
from tautwave.session.sites.joining import Joined, with_site
from tautwave.sites.control import Session
from tautwave.sites.datagrams import open_socket

ROOT = Path(__file__).parents[2]
RIG = ROOT / "configs" / "network-loopback.yaml"
FAR = {"master": "slave", "slave": "master"}
CALM = ("simulation.axes.master.lever.position_noise=0", "link.lost_s=1", "link.depth_s=0")


class Inbox(deque[Mapping[str, Any]]):
    """What a desk has for its loop; a message waits for its `late` slot, as do those after it."""

    def __init__(self) -> None:
        super().__init__()
        self.due: deque[int] = deque()
        self.late = 0

    def append(self, message: Mapping[str, Any]) -> None:
        super().append(json.loads(json.dumps(message)))
        self.due.append(self.late)

    def popleft(self) -> Mapping[str, Any]:
        self.due.popleft()
        return super().popleft()

    def clear(self) -> None:
        super().clear()
        self.due.clear()


class Line(Leaving):
    """A desk's line without a desk: what one site says, the other hears in its next slot."""

    def __init__(self, pair: Pair, side: str) -> None:
        self.pair, self.side = pair, side
        self.inbox = Inbox()

    def poll(self) -> Mapping[str, Any] | None:
        inbox = self.inbox
        return inbox.popleft() if inbox and inbox.due[0] <= self.pair.slot else None

    def send(self, **message: Any) -> None:
        if "send" in message:
            far = self.pair.sites[FAR[self.side]].line.inbox
            far.late = self.pair.slot + self.pair.lag()
            far.append({"peer": message["send"]})
        if "renew" in message and message["of"] == self.pair.used[-1].hex():
            self.pair.renew(str(message["renew"]))


class Half:
    """One site: its loop is `cycle`."""

    def __init__(self, pair: Pair, side: str, changes: tuple[str, ...], sock: socket.socket,
                 where: tuple[str, int] | None) -> None:  # fmt: skip
        self.rig: Rig = load_rig(RIG, (*CALM, *changes, f"sites.here={side}"))
        self.side, self.line = side, Line(pair, side)
        built = build_rig(self.rig, clock="fake")
        clock: Any = built.clock
        clock.now_ns = pair.clock.now_ns
        joined = Joined(self.line, sock, pair.session(FAR[side]), where)  # type: ignore[arg-type]
        self.asked: list[Order] = []
        self.built = with_operation(self.rig, built, [self], [], joined) if self.rig.operate else (
            with_site(self.rig, built, joined)
        )  # fmt: skip
        control = self.built.control
        assert isinstance(control, SiteControl)
        self.control = control
        self.rows: list[list[float]] = []
        self.slot = 0
        self._sensing = Sensing(self.built.buses, control)
        for bus in self.built.buses:
            bus.driver.open()
            bus.driver.enable_step()

    def take(self, now_ns: int) -> list[Order]:
        """Return what `ask` was asked, as a source of commands."""
        due, self.asked = self.asked, []
        return due

    def ask(self, word: str, argument: str = "") -> None:
        """Have a person here give a command in the next slot."""
        self.asked.append(Order(word, argument, "key"))

    @property
    def state(self) -> str:
        """The state of an operated site."""
        return STATES[int(self.rows[-1][self.control.columns.index("operation.state")])]

    def cycle(self, skipped: int = 0) -> bool:
        """Run one cycle after `skipped` slots that went by; False where the run is over."""
        self.slot += skipped
        if self.slot >= self.control.end:
            return False
        self._sensing.sense(self.slot, 0)
        self.control.step(self.slot, skipped)
        for bus, first in zip(self.built.buses, first_axes(self.built.buses), strict=True):
            bus.driver.write(bus_commands(self.control, bus, first))
        row = [0.0] * len(self.control.columns)
        self.control.fill(row, 0)
        self.rows.append(row)
        self.slot += 1
        return True

    def __getitem__(self, name: str) -> Any:
        at = self.control.columns.index(name)
        return np.array([row[at] for row in self.rows])

    @property
    def held(self) -> bool:
        """Whether it holds."""
        return bool(self.rows[-1][self.control.columns.index("link.holding")])

    def residual(self) -> float:
        """Return the greatest energy that its books do not account for [J]."""
        total = self[f"{self.side}.lever.port_energy"].copy()
        for name in self.control.columns:
            if name.endswith((".stored", ".dissipated")):
                total -= self[name]
        return float(np.max(np.abs(total - total[0])))


class Pair:
    """Both sites, and what is between them."""

    def __init__(self, *changes: str) -> None:
        self.clock = FakeClock(10**12)
        self._next = secrets.token_bytes(8), secrets.token_bytes(32)
        self.slot = 0
        self.lag: Callable[[], int] = int
        """Slots that a message takes; none overtakes another."""
        self.used: list[bytes] = [self._next[0]]
        serving, dialling = open_socket("127.0.0.1", 0), open_socket("127.0.0.1", 0)
        self.sockets = serving, dialling
        self.sites: dict[str, Half] = {}
        self.sites["slave"] = Half(self, "slave", changes, serving, None)
        self.sites["master"] = Half(self, "master", changes, dialling, serving.getsockname())
        self.master, self.slave = self.sites["master"], self.sites["slave"]

    def session(self, peer: str) -> Session:
        """Return the present session as one site sees it."""
        return Session(*self._next, peer, {})

    def renew(self, why: str) -> None:
        """Begin another session, as both desks do."""
        self._next = secrets.token_bytes(8), secrets.token_bytes(32)
        self.used.append(self._next[0])
        for side, half in self.sites.items():
            half.line.inbox.late = self.slot + self.lag()
            session = self.session(FAR[side])
            half.line.inbox.append({"lost": why})
            half.line.inbox.append({"joined": {
                "session": session.id.hex(), "secret": session.secret.hex(),
                "peer": session.peer, "facts": {},
            }})  # fmt: skip

    def run(self, slots: int, *sites: Half, cut: bool = False) -> None:
        """Run some cycles of both sites, or of those given; `cut`: no datagram arrives."""
        for _ in range(slots):
            for half in sites or (self.master, self.slave):
                half.cycle(self.slot - half.slot)
                if cut:
                    self.lose()
            self.slot += 1
            self.clock.sleep_until(self.clock.now_ns() + self.master.rig.period_ns)

    def lose(self) -> None:
        """Lose what is under way."""
        for sock in self.sockets:
            with suppress(BlockingIOError):
                while sock.recv(2048):
                    pass

    def until(self, done: Callable[[], bool], slots: int = 2000) -> None:
        """Run both until something is so."""
        for _ in range(slots):
            if done():
                return
            self.run(1)
        raise AssertionError("it never was")

    def close(self) -> None:
        """Close the sockets."""
        for sock in self.sockets:
            sock.close()


Make = Callable[..., Pair]
"""Makes a pair with changes of the rig."""
