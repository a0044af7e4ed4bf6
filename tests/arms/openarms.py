"""What each pair of the ready rig of four OpenArms does: numbers of docs/start/two-openarms.md.

    python -m tests.arms.openarms RUN
    python -m tests.arms.openarms --host

RUN is the directory of `tautwave run configs/arms/openarm-bimanual.yaml --clock fake`. Printed for
the left and the right pair: errors of the joints that no wall holds once they are coupled, the
follower's wall where it is pushed most, and what the leader's motor gives there per angle beyond
it, what the arms carry at most, and what a joint may supply while the host is prompt. `--host`:
CPU of the host's part of a cycle, with one pair of arms and with both: all that is done but the
simulated devices, without a system's sockets; a median of interleaved runs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, Self
from unittest import mock

import numpy as np
import numpy.typing as npt

from tautwave import read_recording
from tautwave.config import Rig, load_rig
from tautwave.rig import command_delays
from tautwave.session.claims import claims_of
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.loaded import ArmPhysics
from tautwave_sim.wire.can_port import MasterPort
from tests.rigs.running import run_rig

CONFIGS = Path(__file__).parents[2] / "configs" / "arms"
ROUNDS = 7

ARMS = ("left", "right")
JOINTS = tuple(f"j{number}" for number in range(1, 8))
WALLED = "j4"
COUPLED_S = 1.2
"""[s] From then on the pairs are coupled: the engage ramp is over."""

Floats = npt.NDArray[np.float64]


class Pair(NamedTuple):
    """What one pair of arms did; SI units.

    `rms` and `most` are errors by joint [rad]; `push`, `depth` and `stiffness` the wall's at its
    deepest, `felt`, `beyond` and `felt_stiffness` the leader's there; `carried` by side [N m].
    """

    rms: dict[str, float]
    most: dict[str, float]
    push: float
    depth: float
    felt: float
    beyond: float
    carried: dict[str, float]

    @property
    def stiffness(self) -> float:
        """Of the wall [N m/rad]."""
        return self.push / self.depth

    @property
    def felt_stiffness(self) -> float:
        """Of the wall as the leader's motor renders it [N m/rad]."""
        return self.felt / self.beyond


def pair_of(series: Callable[[str], Floats], rig: Rig, arm: str) -> Pair:
    """Return what a pair of arms did in the rows of a run."""
    coupled = series("time_s") > COUPLED_S
    free = [joint for joint in JOINTS if joint != WALLED]
    errors = {joint: series(f"{arm}_{joint}.position_error")[coupled] for joint in free}
    elbow = f"{arm}_{WALLED}"
    wall: Any = rig.coupling.pairs[elbow].wall_slave
    pushes = np.abs(series(f"slave.{elbow}.wall_effort"))
    at = int(pushes.argmax())
    return Pair(
        {joint: float(np.sqrt(np.mean(error**2))) for joint, error in errors.items()},
        {joint: float(np.abs(error).max()) for joint, error in errors.items()},
        float(pushes[at]),
        float(series(f"slave.{elbow}.position")[at]) - wall.position,
        abs(float(series(f"master.{elbow}.port_effort")[at])),
        float(series(f"master.{elbow}.position")[at]) - wall.position,
        {
            side: max(
                float(np.abs(series(f"load.{side}.{arm}_{joint}.effort")).max()) for joint in JOINTS
            )
            for side in ("master", "slave")
        },
    )


SIMULATED: tuple[tuple[type, tuple[str, ...]], ...] = (
    (MasterPort, ("send", "receive", "readable", "advance", "next_event_ns")),
    (SimulatedAxis, ("fill",)),
    (ArmPhysics, ("fill",)),
)


class Apart:
    """While it is entered, notes the CPU of the calls that simulate devices [ns]."""

    def __init__(self) -> None:
        self.spent_ns = 0
        self._inside = False
        self._patches = [
            mock.patch.object(owner, name, self._noting(getattr(owner, name)))
            for owner, names in SIMULATED
            for name in names
        ]

    def _noting(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def noted(*args: Any) -> Any:
            if self._inside:
                return call(*args)
            self._inside = True
            began = time.thread_time_ns()
            try:
                return call(*args)
            finally:
                self.spent_ns += time.thread_time_ns() - began
                self._inside = False

        return noted

    def __enter__(self) -> Self:
        for patch in self._patches:
            patch.start()
        return self

    def __exit__(self, *_exc_info: object) -> None:
        for patch in self._patches:
            patch.stop()


def host_cpu_s(rig: Rig, cycles: int = 100) -> float:
    """Return the CPU of the host's part of a cycle [s]: a longer run less a shorter one."""
    spent = []
    for count in (cycles, 2 * cycles):
        with Apart() as apart:
            began = time.thread_time_ns()
            run_rig(rig, duration_s=count / rig.rate_hz)
            spent.append(time.thread_time_ns() - began - apart.spent_ns)
    return 1e-9 * (spent[1] - spent[0]) / cycles


def tell_host() -> None:
    """Print what a host's cycle takes with one pair of arms and with two."""
    rigs = [load_rig(CONFIGS / f"{name}.yaml") for name in ("openarm", "openarm-bimanual")]
    taken = [[host_cpu_s(rig) for rig in rigs] for _ in range(ROUNDS)]
    one, both = (median(times) for times in zip(*taken, strict=True))
    ratio = median(b / a for a, b in taken)
    print(f"host's CPU a cycle: {1e3 * one:.2f} ms with one pair, {1e3 * both:.2f} ms with both")
    print(f"both take {ratio:.2f} times as much as one")


def main() -> None:
    """Print the numbers of a run, or the host's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--host", action="store_true")
    asked = parser.parse_args()
    if asked.host:
        tell_host()
    if asked.run is not None:
        tell_run(asked.run)


def tell_run(run: Path) -> None:
    """Print what each pair did in a run."""
    rig = load_rig(run / "rig.yaml")
    recording = read_recording(run / "recording.mcap")
    for arm in ARMS:
        p = pair_of(recording.__getitem__, rig, arm)
        print(f"{arm}: {recording['time_s'][-1]:.3g} s")
        for joint, rms in p.rms.items():
            print(f"  {joint}: {1e3 * rms:.2g} mrad rms, {1e3 * p.most[joint]:.2g} at most")
        print(f"  wall: {p.push:.3g} N m at {p.depth:.3g} rad, {p.stiffness:.3g} N m/rad")
        print(f"  felt: {p.felt:.3g} N m at {p.beyond:.3g} rad, {p.felt_stiffness:.3g} N m/rad")
        print("  carried:", ", ".join(f"{side} {most:.3g} N m" for side, most in p.carried.items()))
    prompt = [one.stated.prompt_j for one in claims_of(rig, command_delays(rig)) if one.stated]
    print(f"a joint may supply, prompt: {min(prompt):.2g} to {max(prompt):.2g} J")


if __name__ == "__main__":
    main()
