"""The page's scripts: checked in Node where there is one; the slow tests run them in Chromium."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

import tautwave.view

PAGE = Path(tautwave.view.__file__).parent / "page"
NODE = shutil.which("node")
PARSE = """
const { SourceTextModule } = require("vm");
const { readFileSync } = require("fs");
for (const path of process.argv.slice(1)) {
  new SourceTextModule(readFileSync(path, "utf8"), { identifier: path });
}"""


@pytest.mark.skipif(NODE is None, reason="no node")
def test_every_script_of_the_page_is_a_module() -> None:
    assert NODE is not None
    order = [NODE, "--experimental-vm-modules", "--no-warnings", "-e", PARSE]
    scripts = sorted(map(str, PAGE.glob("*.js")))
    done = subprocess.run([*order, *scripts], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
