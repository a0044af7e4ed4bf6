"""Simulated devices in separate processes, on endpoints that other software can open.

`python -m tautwave.session.serving BUS $$ < RIG.yaml` serves one bus of a rig; a run on the real
clock starts one for each bus with a served simulator, and so does `tautwave sim RIG`.
"""

from __future__ import annotations

import ctypes
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from tautwave.config import Rig, bus_spec, parse_rig, resolved_yaml
from tautwave.contracts import Bench
from tautwave.errors import ConfigError, DriverError, TautwaveError
from tautwave.registry import load_simulator, require_modules
from tautwave.rig import axis_model
from tautwave.runtime.machine import quiet_collector, realtime

START_TIMEOUT_S = 20.0
PR_SET_PDEATHSIG = 1

Announce = Callable[[Mapping[str, Any]], None]


def bus_bench(rig: Rig, bus_name: str) -> Bench:
    """Return the devices of one bus of a rig, ready to be simulated.

    Raises
    ------
    ConfigError
        The rig has no such bus, or no simulation.
    """
    if bus_name not in rig.buses:
        raise ConfigError(
            f"{rig.name}: there is no bus {bus_name!r}; the rig has {', '.join(rig.buses)}"
        )
    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: there is nothing to simulate; add a simulation block to the rig file"
        )
    bus = rig.buses[bus_name]
    require_modules(bus.driver)
    simulator = load_simulator(bus.driver)
    spec = bus_spec(rig, bus_name)
    models = [axis_model(rig, axis.name, rig.cycles) for axis in spec.axes]
    return Bench(simulator.options.model_validate(bus.options), spec, models)


def serve(
    driver: str,
    bench: Bench,
    announce: Announce,
    loop_priority: int,
    look: Callable[[], None] | None = None,
) -> None:
    """Serve devices until SIGINT or SIGTERM; `look` is called now and then.

    A device responds in its own time, whatever else this machine is doing; the loop has priority.

    Raises
    ------
    ConfigError
        The simulator of this driver has no endpoint.
    DriverError
        The endpoint cannot be opened.
    """
    simulator = load_simulator(driver)
    if simulator.serve is None:
        raise ConfigError(f"{driver}: its simulated devices run inside the run's process only")
    stops: list[int] = []

    def stopped() -> bool:
        if look is not None:
            look()
        return bool(stops)

    before = {
        number: signal.signal(number, lambda given, _: stops.append(given))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        with (
            quiet_collector(off=False),
            realtime(max(0, loop_priority - 1), None, lock_memory=False),
        ):
            simulator.serve(*bench, announce, stopped)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def served(rig: Rig, buses: Sequence[str]) -> Iterator[dict[str, dict[str, Any]]]:
    """Serve the devices of these buses inside the block; yield their announcements.

    Raises
    ------
    DriverError
        One did not start.
    """
    text = resolved_yaml(rig).encode()
    children: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for bus in buses:
            command = [sys.executable, "-m", "tautwave.session.serving", bus, str(os.getpid())]
            # A separate session: Ctrl-C ends the run first, and the run ends its devices.
            child = children[bus] = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
            assert child.stdin is not None
            child.stdin.write(text)
            child.stdin.close()
            child.stdin = None
        yield {bus: _announced(bus, child) for bus, child in children.items()}
    finally:
        for child in children.values():
            child.terminate()
        for child in children.values():
            _end(child)


def _announced(bus: str, child: subprocess.Popen[bytes]) -> dict[str, Any]:
    assert child.stdout is not None
    ready, _, _ = select.select([child.stdout], [], [], START_TIMEOUT_S)
    line = child.stdout.readline() if ready else b""
    if line:
        announced: dict[str, Any] = json.loads(line)
        return announced
    child.terminate()
    _, errors = child.communicate()
    reason = errors.decode(errors="replace").strip().splitlines()[-1:] or ["it gave no reason"]
    raise DriverError(f"bus {bus}: its simulated devices did not start: {reason[0]}")


def _end(child: subprocess.Popen[bytes]) -> None:
    try:
        child.communicate(timeout=5.0)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()


@contextmanager
def interrupted() -> Iterator[Callable[[], None]]:
    """Yield a function that returns on the first SIGINT or SIGTERM since the block was entered."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    # Through a pipe: the kernel may deliver the signal to any thread, and wake only that one.
    before_fd = signal.set_wakeup_fd(writer)
    before = {
        number: signal.signal(number, lambda *_: None) for number in (signal.SIGINT, signal.SIGTERM)
    }

    def wait() -> None:
        os.read(reader, 1)

    try:
        yield wait
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(before_fd)
        os.close(reader)
        os.close(writer)


def end_with_parent(parent: int) -> bool:
    """Request a SIGTERM from Linux when the parent process dies, however it dies.

    Returns False if `parent` had already died.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGTERM))
    return os.getppid() == parent


def print_line(message: Mapping[str, Any]) -> None:
    """Write one line of JSON to stdout and flush it, for the parent process."""
    sys.stdout.write(json.dumps(dict(message)) + "\n")
    sys.stdout.flush()


def main() -> int:
    """Serve the bus in argv[1] of the rig on stdin, for as long as process argv[2] lives."""
    if not end_with_parent(int(sys.argv[2])):
        return 0
    try:
        rig = parse_rig(sys.stdin.read(), choose=False)
        bus = sys.argv[1]
        bench = bus_bench(rig, bus)
        driver, priority = rig.buses[bus].driver, rig.loop.fifo_priority
        serve(driver, bench, lambda found: print_line({"bus": bus, **found}), priority)
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
