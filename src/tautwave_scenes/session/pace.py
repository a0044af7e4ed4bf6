"""Whether a scene keeps its rate on this machine, measured before anything moves."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

from tautwave.config import Rig
from tautwave.errors import BusBudgetError, TautwaveError
from tautwave.rig import Assembly, BusWay, Way, build_rig, bus_ways, command_delays
from tautwave.runtime.loop import Loop
from tautwave.runtime.machine import quiet_collector
from tautwave.session.engine import scene_devices
from tautwave_scenes.config.keys3d import Scene3d
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.rig.network import hold_claim, hold_limit, keys_of
from tautwave_scenes.runtime.axes import SceneControl

if TYPE_CHECKING:
    from tautwave_scenes.networks3d.live import Model3d

CYCLES = 400
ROUNDS = 3
LONG_S = 0.1
"""CPU time limit of a round; a large network is measured with fewer cycles."""
PROGRESS_CYCLES = 64
"""Cycles of the loop between two messages of progress."""
EASY = 0.5
"""Share of a period up to which plain Python is used."""
TIGHT = 0.75
"""Share of a period above which a run warns that it may miss cycles."""
MAY_MISS = "may miss cycles"
INSTALL = "pip install 'tautwave[fast]'"


class ScenePace(NamedTuple):
    """Cost of a scene's cycle: CPU time [s], and by which steps."""

    cycle_s: float
    period_s: float
    engine: str

    @property
    def share(self) -> float:
        """Share of the period."""
        return self.cycle_s / self.period_s

    def describe(self) -> str:
        """Return the cost and its margin as text."""
        by = "compiled steps" if self.engine == "compiled" else "plain Python"
        micros = 1e6 * self.cycle_s
        time = f"{micros:.3g} us" if micros < 1e3 else f"{micros / 1e3:.3g} ms"
        cost = f"{time} a cycle by {by} on this machine, "
        if self.share > 1.0:
            return f"{cost}{self.share:.1f} periods of {1e6 * self.period_s:.4g} us"
        return f"{cost}{self.share:.0%} of the period of {1e6 * self.period_s:.4g} us"


class _NullRecorder:
    """A sink that discards rows."""

    def __init__(self, width: int) -> None:
        self.row = [0.0] * width

    def commit(self) -> None:
        pass


def scene_pace(
    rig: Rig, engine: str = "python", ways: Mapping[str, BusWay] | None = None
) -> ScenePace:
    """Return the cost of a cycle of a rig's scene: its first ones, run on the fake clock.

    Served and real devices cost nothing here: only the scene is stepped.
    """
    taken = bus_ways(rig) if ways is None else ways
    alone = any(one.way is not Way.MEMORY for one in taken.values())
    measure = _step_alone if alone else _run_whole
    with quiet_collector():  # everything that is alive is collected once, and not in every round
        first = measure(rig, engine, 3)  # compiles, where there is something to compile
        cycles = CYCLES if engine == "compiled" else max(min(CYCLES, int(LONG_S / first)), 3)
        least = min(measure(rig, engine, cycles) for _ in range(ROUNDS))
    return ScenePace(least, rig.period_s, engine)


def _run_whole(rig: Rig, engine: str, cycles: int) -> float:
    devices = scene_devices(rig, engine)
    built = build_rig(rig, clock="fake", duration_s=cycles * rig.period_s, devices=devices)
    built = use_engine(built, engine)
    sink = _NullRecorder(len(built.columns))
    began: list[int] = []

    def tell(share: float, word: str) -> None:
        began.append(time.thread_time_ns())

    loop = Loop(built.clock, built.buses, built.control, built.sources, sink, tell)
    with quiet_collector():
        began.append(time.thread_time_ns())
        result = loop.run()
        spent = time.thread_time_ns() - began[min(1, len(began) - 1)]
    for simulator in built.simulators:
        simulator.close()
    settled = PROGRESS_CYCLES if len(began) > 1 else 0  # engaging is expensive, and happens once
    return 1e-9 * spent / max(result.cycles - settled, 1)


def _step_alone(rig: Rig, engine: str, cycles: int) -> float:
    model, positions = _alone(rig)
    if engine == "compiled":
        model = _compiled(model)
    model.reset(positions)
    pushes = [0.0] * len(model.network.forced)
    began = time.thread_time_ns()
    for _ in range(cycles):
        model.advance(positions, pushes)
    return 1e-9 * (time.thread_time_ns() - began) / cycles


def _alone(rig: Rig) -> tuple[SceneModel | Model3d, list[float]]:
    """Return a rig's scene without its devices, and where its ports are when they read 0."""
    if isinstance(rig.scene, Scene3d):
        from tautwave_scenes.networks3d.live import Model3d
        from tautwave_scenes.rig.network3d import pruned_network3d, scene3d_of

        network = pruned_network3d(rig).network
        spatial = Model3d(network, scene3d_of(rig).scheme, rig.period_s, keep_books=True)
        return spatial, [0.0] * len(network.axes)
    from tautwave_scenes.rig.network import pruned_network, scene_of

    keys = scene_of(rig)
    model = SceneModel(pruned_network(rig).network, keys.scheme, rig.period_s, keep_books=True)
    return model, [port.offset for port in keys.ports.values()]


class Engine(NamedTuple):
    """The steps of a run's scene, and a message about them."""

    name: str
    sentences: tuple[str, ...]

    def warnings(self) -> list[str]:
        """Return the message before the run."""
        return [sentence for sentence in self.sentences if MAY_MISS in sentence]


def choose_engine(rig: Rig, clock: str, ways: Mapping[str, BusWay] | None = None) -> Engine:
    """Return the steps that keep a scene's rate.

    Raises
    ------
    BusBudgetError
        On the real clock, if not even those keep it.
    """
    asked = _asked(rig)
    if clock != "real":
        return Engine("compiled" if asked == "compiled" else "python", ())
    pace = None if asked == "compiled" else scene_pace(rig, ways=ways)
    if pace is None or (asked == "auto" and pace.share > EASY and _has_numba()):
        pace = scene_pace(rig, "compiled", ways)
    if pace.share > 1.0:
        raise BusBudgetError(
            f"scene: {pace.describe()}, so it cannot keep its rate; {_remedy(rig, pace)}"
        )
    sentence = f"scene: {pace.describe()}"
    if pace.share > TIGHT:
        sentence += f": it {MAY_MISS}; {_remedy(rig, pace)}"
    return Engine(pace.engine, (sentence,))


def use_engine(assembly: Assembly, engine: str) -> Assembly:
    """Return the assembly with its scene's steps compiled, if that is its engine.

    The controller of the axes goes with them, except that strings and three dimensions are stepped
    by themselves.
    """
    given = assembly.control
    if engine != "compiled" or not isinstance(given, SceneControl):
        return assembly
    scene = given.scene
    model = scene.model = _compiled(scene.model)
    if not isinstance(model, SceneModel) or model.strings:
        return assembly
    from tautwave_scenes.simulation.control import CompiledSceneControl

    control = CompiledSceneControl(given)
    return assembly._replace(control=control, sources=[control, *assembly.sources[1:]])


def pace_fact(rig: Rig) -> str:
    """Return the text for `check`: the cost in plain Python, and the engine on the real clock.

    Nothing is compiled for it.
    """
    try:
        pace = scene_pace(rig)
    except TautwaveError as err:
        return f"not measured: {err}"
    text = pace.describe()
    if pace.share <= EASY and _asked(rig) != "compiled":
        return text
    if _asked(rig) != "python" and _has_numba():
        return f"{text}; on the real clock its steps are compiled"
    if pace.share > TIGHT:
        word = "cannot" if pace.share > 1.0 else "may not"
        return f"{text}: on the real clock it {word} keep its rate; {_remedy(rig, pace)}"
    return text


def hold_fact(rig: Rig) -> str:
    """Return the text for `check`: the energy that held efforts may create."""
    delays = command_delays(rig)
    names = [name.partition(".")[2] for name in rig.axes]
    limit, claim = hold_limit(rig, names), hold_claim(rig, names, delays)
    text = f"the run stops once the effort hold has created {limit:.3g} J"
    if math.isfinite(claim):
        return f"{text}; until it has, at most {claim:.3g} J at the limits of its axes"
    return (
        f"{text}; without velocity_limit or mechanical_range, the energy a faster hand gets until "
        "then is unbounded"
    )


def _remedy(rig: Rig, pace: ScenePace) -> str:
    rate = TIGHT / pace.cycle_s
    remedy = f"--clock fake, fewer masses, or a rate_hz of at most {float(f'{rate:.2g}'):.0f}"
    if pace.engine == "python":
        remedy += ", or scene.engine auto" + ("" if _has_numba() else f" with numba: {INSTALL}")
    return remedy


def _asked(rig: Rig) -> str:
    """Return the engine a rig names."""
    return keys_of(rig).engine


def _has_numba() -> bool:
    return find_spec("numba") is not None


def _compiled(model: SceneModel | Model3d) -> SceneModel | Model3d:
    if isinstance(model, SceneModel):
        from tautwave_scenes.simulation.ticking import (
            CompiledScene,  # import numba only where needed
        )

        return CompiledScene(model.network, model.scheme, model.period)
    from tautwave_scenes.simulation.ticking3d import CompiledModel3d

    return CompiledModel3d(model.network, model.scheme, model.period)
