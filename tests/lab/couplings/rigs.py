"""The laws to compare, and rigs drawn at random for them; SI."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.config.load import parse_rig

LAWS: Mapping[str, str] = {
    "position": "law: position, pairs: {lever: {stiffness: 20, damping: 0.1",
    "position_force": "law: position_force, pairs: {lever: {stiffness: 20, damping: 0.1",
    "four_channel": "law: four_channel, pairs: {lever: {stiffness: 20, damping: 0.1",
    "four_channel_measured": "law: four_channel, pairs: {lever: {stiffness: 20, damping: 0.1, "
    "effort: measured",
    "pd_damping": "law: pd_damping, pairs: {lever: {stiffness: 2, damping: 0.02",
    "wave": "law: wave, pairs: {lever: {wave_impedance: 0.1, wave_filter_hz: 200, "
    "pole_master: 0.5, pole_slave: 0.5",
    "wave_augmented": "law: wave, pairs: {lever: {wave_impedance: 0.1, wave_filter_hz: 200, "
    "pole_master: 0.5, pole_slave: 0.5, force_gain: 0.5",
}
"""Blocks of the table, up to more keys of the pair: gains on the bench, injection left to it."""

RIG = """
name: {name}
rate_hz: {rate!r}
duration_s: {seconds!r}
seed: {seed}
loop: {{missing_limit: 4, overrun_limit: 4}}
buses: {{bench: {{driver: loopback, options: {{command_delay_s: {late!r}}}}}}}
master: {{axes: {{lever: {{bus: bench, id: 1, {master}}}}}}}
slave: {{axes: {{lever: {{bus: bench, id: 2, {slave}}}}}}}
coupling: {{delay_s: {delay!r}, account: {account}, {law}}}}}}}
simulation:
  axes: {{master.lever: {true_master}, slave.lever: {true_slave}}}
  hand: {{lever: {{lever_arm: 0.075, reference: {reference}}}}}
  environment: {{lever: {contact}}}
  faults: {{missing_probability: {missing!r}, overrun_probability: {overrun!r}}}
"""
AXIS = (
    "kind: rotary, inertia: {{value: {inertia!r}, lower: {lower!r}, source: drawn}}, "
    "damping: {{value: {damping!r}, lower: {damping!r}, source: drawn}}, effort_limit: {effort!r}, "
    "effort_rate_limit: {rate!r}, velocity_limit: {velocity!r}, encoder_quantum: {quantum!r}, "
    "position_noise: {noise!r}"
)
TRUTH = "{{inertia: {inertia!r}, damping: {damping!r}, coulomb: {coulomb!r}}}"


class Device(NamedTuple):
    """One axis: beliefs, limits and truth."""

    inertia: float
    lower: float
    damping: float
    coulomb: float
    effort: float
    rate: float
    velocity: float
    quantum: float
    noise: float

    @property
    def axis(self) -> str:
        """Its axis in a rig file."""
        return AXIS.format(**self._asdict())

    @property
    def truth(self) -> str:
        """Its simulation."""
        return TRUTH.format(**self._asdict())


BENCH = Device(1.584e-3, 1.1e-3, 2e-3, 1e-3, 1.125, 1000.0, 15.0, 2.094e-5, 9e-5)
"""The laboratory's lever, as `configs/bench-1dof-2khz.yaml` has it."""

SENSOR = ", effort_sensor: {quantum: 1.0e-4, noise: 1.0e-3, bandwidth_hz: 300, delay_s: 5.0e-4}"
"""On both levers, for laws that read one."""

HAND = (
    "{type: multisine, ramp_s: 0.5, components: [[0.4, 0.12, 0.0], [1.1, 0.04, 1.0], "
    "[2.3, 0.02, 2.0]]}"
)
CONTACTS = {"free": "{type: free}", "rigid": "{type: wall, position: 0.08, stiffness: 200.0}"}


def bench_rig(
    law: str, delay: float, *, account: bool, contact: str, reference: str = HAND, seconds: float
) -> Rig:
    """Return the laboratory's bench with a law of `LAWS`, in an account or bare."""
    axis = BENCH.axis + (SENSOR if "measured" in LAWS[law] else "")
    text = RIG.format(
        name=f"couplings-{law}",
        rate=2000.0,
        seconds=seconds,
        seed=2,
        late=0.0,
        master=axis,
        slave=axis,
        true_master=BENCH.truth,
        true_slave=BENCH._replace(inertia=1.7e-3, damping=3e-3).truth,
        delay=delay,
        account="{}" if account else "null",
        law=LAWS[law],
        reference=reference,
        contact=CONTACTS[contact],
        missing=0.0,
        overrun=0.0,
    )
    return parse_rig(text, Path("couplings.yaml"))


def drawn_law(draw: np.random.Generator) -> str:
    """Return a law with gains drawn at random."""
    name = draw.choice(("position", "position_force", "four_channel", "pd_damping"))
    stiffness, damping = _between(draw, 0.5, 100.0), _between(draw, 0.005, 0.5)
    keys = f"stiffness: {stiffness!r}, damping: {damping!r}"
    if name in ("position_force", "four_channel"):
        keys += f", force_gain: {_between(draw, 0.1, 3.0)!r}"
        keys += f", observer_hz: {_between(draw, 5.0, 200.0)!r}"
    if name == "four_channel":
        keys += f", rejection: {float(draw.choice((0.0, 1.0, draw.uniform())))!r}"
    if name == "position_force" and draw.random() < 0.5:
        keys += ", effort: commanded"
    if name == "pd_damping" and draw.random() < 0.5:
        keys += f", injection: {_between(draw, 0.001, 0.2)!r}"
    if draw.random() < 0.3:
        keys += f", position_scale: {_between(draw, 0.3, 3.0)!r}, sign: {draw.choice((1, -1))}"
    return f"law: {name}, pairs: {{lever: {{{keys}"


def drawn_device(draw: np.random.Generator, noise: float) -> Device:
    """Return a lever; what is believed of it is true."""
    inertia = _between(draw, 3e-4, 1e-2)
    damping = draw.choice((0.0, 1.0)) * _between(draw, 1e-4, 2e-2)
    return Device(
        inertia=inertia,
        lower=inertia * draw.uniform(0.5, 1.0),
        damping=float(damping),
        coulomb=float(draw.choice((0.0, 1.0)) * _between(draw, 1e-4, 3e-2)),
        effort=_between(draw, 0.3, 2.0),
        rate=_between(draw, 300.0, 1e5),
        velocity=_between(draw, 8.0, 20.0),
        quantum=float(draw.choice((0.0, 2.094e-5))),
        noise=noise,
    )


def drawn_rig(
    seed: int,
    *,
    account: bool,
    seconds: float = 0.5,
    law: Callable[[np.random.Generator], str] = drawn_law,
) -> Rig:
    """Return a rig, delays and a pattern of missing samples drawn from a seed.

    Devices, gains, delays to 100 ms each way and two periods to the motor, hand and contact; with
    and without noise, lost samples and slots that a loop slept through.
    """
    draw = np.random.default_rng(seed)
    rate = float(draw.choice((500.0, 1000.0, 2000.0)))
    noise = float(draw.choice((0.0, 1.5e-5, 9e-5))) * 1000.0 / rate
    contact = (
        "{type: free}",
        f"{{type: wall, position: {draw.uniform(0.0, 0.1)!r}, stiffness: "
        f"{_between(draw, 1.0, 300.0)!r}}}",
        f"{{type: spring, position: 0.0, stiffness: {_between(draw, 0.1, 30.0)!r}}}",
    )[draw.integers(3)]
    parts = [
        f"[{_between(draw, 0.5, 20.0)!r}, {_between(draw, 0.005, 0.15)!r}, {draw.uniform(0, 6)!r}]"
        for _ in range(3)
    ]
    master, slave = drawn_device(draw, noise), drawn_device(draw, noise)
    text = RIG.format(
        name=f"drawn-{seed}",
        rate=rate,
        seconds=seconds,
        seed=seed,
        late=int(draw.choice((0, 0, 1, 2))) / rate,
        master=master.axis,
        slave=slave.axis,
        true_master=master.truth,
        true_slave=slave.truth,
        delay=int(draw.choice((0, 1, 5, round(0.02 * rate), round(0.1 * rate)))) / rate,
        account="{}" if account else "null",
        law=law(draw),
        reference=f"{{type: multisine, ramp_s: 0.05, components: [{', '.join(parts)}]}}",
        contact=contact,
        missing=float(draw.choice((0.0, 0.0, 0.02, 0.1))),
        overrun=float(draw.choice((0.0, 0.0, 0.01))),
    )
    return parse_rig(text, Path("drawn.yaml"))


def without_account(rig: Rig) -> Rig:
    """Return the same rig with its law bare."""
    return rig.model_copy(update={"coupling": rig.coupling.model_copy(update={"account": None})})


def _between(draw: np.random.Generator, low: float, high: float) -> float:
    """Return a number, its logarithm evenly spread."""
    return float(f"{math.exp(draw.uniform(math.log(low), math.log(high))):.5g}")
