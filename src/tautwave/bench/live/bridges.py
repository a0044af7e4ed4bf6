"""Programs that look at a run from beside it: what they are, and all of them started for one run.

Each is a server of tautwave's, a client that takes what it sends, or both. A bridge that is not
installed is left out. A new one needs a line in `BRIDGES`.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from tautwave.session.viewing.cameras import PROGRAM

CLI = (sys.executable, "-c", "from tautwave.cli import main; main()")

PAGE = """
import sys
from urllib.parse import urlsplit
from websockets.sync.client import connect
page = urlsplit(sys.argv[1])
with connect(f"ws://{page.netloc}/live", origin=f"http://{page.netloc}", compression=None,
             max_size=None) as socket:
    print("open", flush=True)
    for _ in socket:
        pass
"""
FOXGLOVE = """
import json, sys
from urllib.parse import urlsplit
from websockets.sync.client import connect
page = urlsplit(sys.argv[1])
with connect(f"ws://{page.netloc}/foxglove", subprotocols=["foxglove.sdk.v1"], compression=None,
             ping_interval=None, max_size=None) as socket:
    for said in socket:
        if isinstance(said, bytes):
            print("open", flush=True)
            break
        if json.loads(said)["op"] == "advertise":
            found = json.loads(said)["channels"]
            asked = [{"id": one["id"], "channelId": one["id"]} for one in found]
            socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
    for _ in socket:
        pass
"""
ROWS = """
import json, sys, time
from pathlib import Path
from tautwave.runtime.tap import LIVE, Live, Tap
tap = Tap.of_run(Live(**json.loads((Path(sys.argv[1]) / LIVE).read_text())))
said = False
while True:
    if tap.take() and not said:
        said = not print("open", flush=True)
    time.sleep(1.0 / 60.0)
"""


class Bridge(NamedTuple):
    """A program beside a run.

    `needs` are modules; `server` the words of tautwave before the run's directory, none without a
    server; `client` a Python program, given the last word that the server said, else the directory.
    """

    name: str
    needs: Sequence[str]
    server: Sequence[str] = ()
    client: str = ""


BRIDGES = (
    Bridge("page", ("websockets",), ("view", "--page"), PAGE),
    Bridge("foxglove", ("websockets",), ("view", "--foxglove"), FOXGLOVE),
    Bridge("rows, as LeRobot's plugin takes them", (), (), ROWS),
    Bridge("ros", ("cyclonedds", "rosbags"), ("ros",)),
)


def installed(bridges: Sequence[Bridge] = BRIDGES) -> list[Bridge]:
    """Return those whose modules are here."""
    return [one for one in bridges if all(find_spec(name) for name in one.needs)]


@contextmanager
def beside(out: Path, bridges: Sequence[Bridge]) -> Iterator[Mapping[str, Sequence[int]]]:
    """Give the processes of bridges, the server first; each has opened, all are killed after it."""
    with ExitStack() as stack:
        yield {one.name: tuple(_start(one, out, stack)) for one in bridges}


def cameras_beside(run: int) -> list[int]:
    """Return the processes that write the pictures of a run's cameras; `run` is its process."""
    children = Path(f"/proc/{run}/task/{run}/children").read_text().split()
    words = {int(one): Path(f"/proc/{one}/cmdline").read_bytes() for one in children}
    return [number for number, line in words.items() if PROGRAM.encode() in line]


def _start(bridge: Bridge, out: Path, stack: ExitStack) -> Iterator[int]:
    output = str(out)
    for words, program in (([*CLI, *bridge.server, output], bridge.server), ([], bridge.client)):
        if not program:
            continue
        command = words or [sys.executable, "-c", bridge.client, output]
        child = subprocess.Popen(command, stdout=subprocess.PIPE)
        stack.callback(child.communicate)
        stack.callback(child.kill)
        assert child.stdout is not None
        heard = child.stdout.readline().decode().split()
        if not heard:
            raise RuntimeError(f"the bridge {bridge.name} did not begin")
        output = heard[-1]
        yield child.pid
