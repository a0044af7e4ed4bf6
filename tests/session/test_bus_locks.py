"""One master at a time on an endpoint of this machine."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tautwave.errors import DriverError
from tautwave.session.bus_locks import sole_master

HOLDING = """
import sys, time
from tautwave.session.bus_locks import sole_master
with sole_master({"arm": sys.argv[1]}):
    print("held", flush=True)
    time.sleep(600)
"""


@contextmanager
def master(endpoint: str, *around: str) -> Iterator[subprocess.Popen[bytes]]:
    """Be another process that is an endpoint's master."""
    with subprocess.Popen(
        [*around, sys.executable, "-c", HOLDING, endpoint], stdout=subprocess.PIPE
    ) as child:
        try:
            assert child.stdout is not None
            if child.stdout.readline() != b"held\n":
                pytest.skip(f"{around} is not allowed here")
            yield child
        finally:
            child.kill()


def test_a_second_master_is_refused_and_told_who_the_first_is(tmp_path: Path) -> None:
    port, link = tmp_path / "ttyUSB0", tmp_path / "by-id"
    port.touch()
    link.symlink_to(port)
    one = f"{link}, tcp://127.0.0.1:5020"  # a Modbus bus with two places
    with master(one) as first:
        for endpoint in (str(port), "tcp://localhost:5020", one):
            with (
                pytest.raises(DriverError, match=rf"has a master .* process {first.pid} \(.*-c"),
                sole_master({"arm": endpoint}),
            ):
                pass
        with sole_master({"arm": "tcp://127.0.0.1:5021", "hand": "socketcan:can1", "memory": ""}):
            pass
        first.kill()
        first.wait()
        with sole_master({"arm": one}):  # gone with its process
            pass


def test_one_process_may_be_its_own_master_twice() -> None:
    endpoint = "socketcan:tautwave-test"
    with sole_master({"hand": endpoint, "arm": endpoint}):  # two buses of one rig on one interface
        with sole_master({"arm": endpoint}):
            pass
        with pytest.raises(subprocess.CalledProcessError):
            subprocess.run(
                [sys.executable, "-c", HOLDING, endpoint], check=True, capture_output=True
            )


def test_what_reaches_no_other_process_is_not_locked() -> None:
    with master("virtual:0"), sole_master({"can": "virtual:0"}):
        pass


@pytest.mark.slow
def test_another_network_namespace_has_buses_of_its_own() -> None:
    if shutil.which("unshare") is None:
        pytest.skip("no unshare(1)")
    endpoint = "socketcan:tautwave-test"
    with master(endpoint, "unshare", "-rn"), sole_master({"can": endpoint}):
        pass
