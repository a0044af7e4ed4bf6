"""Names of keys have the numbers that Linux gives them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tautwave.config.keys.key_codes import CODES

HEADER = Path("/usr/include/linux/input-event-codes.h")


@pytest.mark.skipif(not HEADER.exists(), reason="no kernel headers (linux-libc-dev) here")
def test_each_code_is_that_of_the_kernel_s_header() -> None:
    define = re.compile(r"^#define\s+((?:KEY|BTN)_\w+)\s+(0x[0-9a-f]+|\d+)", re.MULTILINE)
    kernel = {name: int(value, 0) for name, value in define.findall(HEADER.read_text())}
    assert len(CODES) > 100
    assert {name: kernel.get(name) for name in CODES} == dict(CODES)
