"""Chromium without a window, driven over its DevTools protocol by one websocket."""

from __future__ import annotations

import base64
import itertools
import json
import re
import shutil
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-default-apps", "--force-color-profile=srgb", "--hide-scrollbars",
    "--disable-dev-shm-usage", "--mute-audio",
)  # fmt: skip


class Browser:
    """One page; `requests` are the addresses that it asked for."""

    def __init__(self) -> None:
        assert CHROMIUM is not None
        self._home = Path(tempfile.mkdtemp(prefix="tautwave-chromium-"))
        self._child = subprocess.Popen(
            [CHROMIUM, *FLAGS, f"--user-data-dir={self._home}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._open = ExitStack()
        self._numbers = itertools.count(1)
        self.requests: list[str] = []
        self.problems: list[str] = []

    def __enter__(self) -> Self:
        assert self._child.stderr is not None
        where = ""
        for line in self._child.stderr:
            found = re.search(r"ws://\S+", line)
            if found:
                where = found[0]
                break
        self._socket = self._open.enter_context(
            connect(where, max_size=None, compression=None, ping_interval=None)
        )
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._open.close()
        self._child.kill()
        self._child.wait()
        assert self._child.stderr is not None
        self._child.stderr.close()
        shutil.rmtree(self._home, ignore_errors=True)

    _session: str | None = None

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._numbers)
        order: dict[str, Any] = {"id": number, "method": method, "params": params}
        if self._session is not None:
            order["sessionId"] = self._session
        self._socket.send(json.dumps(order))
        while True:
            said = json.loads(self._socket.recv(60))
            if said.get("id") == number:
                assert "error" not in said, said
                return dict(said["result"])
            self._hear(said)

    def _hear(self, said: dict[str, Any]) -> None:
        params = said.get("params", {})
        match said.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            case "Network.webSocketCreated":
                self.requests.append(params["url"])
            case "Runtime.exceptionThrown":
                self.problems.append(str(params["exceptionDetails"]))
            case "Log.entryAdded":
                self.problems.append(params["entry"]["text"])

    def run(self, script: str) -> Any:
        """Return what an expression of JavaScript comes to."""
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)

    def wait(self, script: str, timeout_s: float = 60.0) -> bool:
        """Wait until an expression is true; return whether it became so."""
        until = time.monotonic() + timeout_s
        while time.monotonic() < until:
            if self.run(script):
                return True
            time.sleep(0.05)
        return False

    def look(self, width: int, height: int, *, dark: bool) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def shot(self, path: Path, *, whole: bool = False) -> None:
        found = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(found["data"]))
