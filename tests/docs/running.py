"""A page that is run: its commands, its Python and the devices served for it."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.commands import keep_in_one_process, tautwave
from tests.docs.blocks import Block, agrees, commands

BIN = Path(sys.executable).parent
ELSEWHERE = {
    "python3 -m venv": "the wheel step of .ci/run installs into an empty environment",
    ".venv/bin/pip install": "the same",
    ".venv/bin/tautwave": "the same",
    ".venv/bin/pytest": "it is this",
    "pip install": "the wheel step of .ci/run",
    "sudo ip link": "needs a kernel with CAN; .ci/vcan makes one",
    "sudo modprobe": "the same",
}
"""Commands that no test runs again, and why."""
TOO_SLOW = "the host is too slow or was stopped"
"""What ends a run where others keep the processor: its page is not wrong then."""
TRIES = 4


class Page:
    """What the blocks of one page share: folder, namespace, served devices."""

    timeout_s = 100.0

    def __init__(self, path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.path = path
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "page"}
        self.printed = ""
        self.swapped: dict[str, str] = {}
        self.servers: list[subprocess.Popen[str]] = []
        self._monkeypatch = monkeypatch

    def run(self, block: Block) -> None:
        """Run one block; AssertionError says where its page is wrong."""
        note = block.note.removeprefix("slow").strip("; ")
        if note.startswith("served by: "):
            self._serve(*note.removeprefix("served by: ").rsplit(" as ", 1))
        if block.kind == "console":
            self._console(block, int(note[5:]) if note.startswith("exit ") else 0)
        elif block.kind == "python":
            self._python(block)
        elif block.kind == "text":
            assert not any(
                line.startswith(("$ ", "tautwave ")) for line in block.text.splitlines()
            ), self._at(block, "a command in a block that is not run")
            if note == "output":
                assert agrees(block.text, self.printed), self._at(block, self.printed)
        else:
            self._save(block)

    def close(self) -> None:
        """Stop what serves devices."""
        for server in self.servers:
            server.terminate()
            server.wait(60)
            assert server.stdout is not None
            server.stdout.close()

    def _at(self, block: Block, what: str) -> str:
        return f"{self.path}:{block.line}: {what}"

    def _python(self, block: Block) -> None:
        code = compile("\n" * block.line + block.text, str(self.path), "exec")
        out = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(out):
            exec(code, self.names)
        self.printed = out.getvalue()

    def _save(self, block: Block) -> None:
        first = block.text.partition("\n")[0]
        assert first.startswith("# "), self._at(block, "its first line has to be `# NAME`")
        target = self.folder / first[2:].strip()
        assert target.resolve().is_relative_to(self.folder), self._at(block, "no such name")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(block.text + "\n", encoding="utf-8")

    def _console(self, block: Block, code: int) -> None:
        found = commands(block)
        assert found, self._at(block, "no line begins with `$ `")
        for at, command in enumerate(found):
            if command.words.startswith(tuple(ELSEWHERE)):
                continue
            ended, printed = self._command(self._swap(command.words))
            wanted = code if at == len(found) - 1 else 0
            reported = f"$ {command.words}\nexit {ended}\n{printed}"
            assert ended == wanted, self._at(block, reported)
            if command.shown.strip():
                assert agrees(self._swap(command.shown), printed), self._at(block, reported)

    def _swap(self, text: str) -> str:
        for named, served in self.swapped.items():
            text = text.replace(named, served)
        return text

    def _command(self, words: str) -> tuple[int, str]:
        alone = words.partition(" # ")[0].strip()
        alone, _, target = alone.partition(" > ")
        real_run = alone.startswith("tautwave run") and "--clock fake" not in alone
        if alone.startswith("tautwave ") and not real_run and not set(alone) & set("|<>&;"):
            with self._monkeypatch.context() as here:
                keep_in_one_process(here)
                done = tautwave(*shlex.split(alone)[1:], cwd=self.folder)
            if target:
                (self.folder / target).write_text(done.stdout, encoding="utf-8")
            return done.exit_code, "" if target else done.output
        return self._shell(words)

    def _shell(self, words: str) -> tuple[int, str]:
        there = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}", "COLUMNS": "160"}
        for _ in range(TRIES):
            shell = subprocess.run(
                ["bash", "-c", words], cwd=self.folder, env=there, check=False, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=self.timeout_s,
            )  # fmt: skip
            if TOO_SLOW not in shell.stdout:
                break
        return shell.returncode, shell.stdout

    def _serve(self, command: str, named: str) -> None:
        words = shlex.split(command)
        assert words[:2] == ["tautwave", "sim"]
        server = subprocess.Popen(
            [str(BIN / "tautwave"), *words[1:]],
            cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self.servers.append(server)
        assert server.stdout is not None
        line = server.stdout.readline()
        assert line, f"{self.path}: `{command}` serves nothing"
        reported = json.loads(line)
        endpoint = reported["endpoint"]
        if reported["driver"] in ("canopen", "mit"):
            interface, _, channel = endpoint.partition(":")
            endpoint = f"--interface {interface} --channel {channel}"
        self.swapped[named] = endpoint
