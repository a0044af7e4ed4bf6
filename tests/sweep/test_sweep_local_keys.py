"""Points that share a reading and a packing have the rigs, tables and refusals of their own."""

from __future__ import annotations

import functools
import gc
import hashlib
import json
import math
import pickle
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from tautwave.config import has_plain_devices, load_rig
from tautwave.config.keys.coupling import Pair, Wall
from tautwave.config.keys.simulation import AxisSimulation, Environment, Hand
from tautwave.errors import ConfigError
from tautwave.simulation.kernel.pack import Job, RigFacts, pack_rig, rig_facts
from tautwave.simulation.kernel.tables import record_tables
from tautwave.sweep.family import Families, shape_of
from tautwave.sweep.file import load_sweep
from tautwave.sweep.grid import Choice, Recipe
from tautwave.sweep.local_keys import local_key, local_keys, read_value
from tautwave.sweep.points import Points
from tautwave.sweep.rows import Simulator
from tautwave.sweep.runs import run_sweep, simulate_point
from tautwave.sweep.template import Instance, Template
from tests.simulation.live import CONFIGS

DURATION_S = 0.05
SHIPPED = CONFIGS
BUSES = [CONFIGS[0].with_name(f"{name}.yaml") for name in ("three-bus-sim", "bench-mixed-sim")]
FIELDS = {
    "simulation.environment.{pair}": ("stiffness", "damping", "position", "exponent", "loss"),
    "simulation.hand.{pair}": ("mass", "damping", "stiffness"),
    "simulation.axes.master.{pair}": ("inertia", "damping", "coulomb", "encoder_quantum"),
    "simulation.axes.slave.{pair}": ("inertia", "damping", "coulomb", "effort_limit"),
    "coupling.pairs.{pair}": ("wave_impedance", "stiffness", "damping"),
    "coupling.pairs.{pair}.wall_master": ("stiffness", "damping"),
    "coupling.pairs.{pair}.wall_slave": ("stiffness", "damping"),
}


def points_of(path: Path, axes: Sequence[tuple[str, Sequence[Any]]]) -> Points:
    made = tuple(tuple((Choice(key, value, ()),) for value in values) for key, values in axes)
    return Points(path, [Recipe("", (), made)], None, DURATION_S)


@functools.cache
def local_keys_of(path: Path) -> list[str]:
    """Every local key that a rig takes; what it does not take is read as a whole and refused."""
    rig = load_rig(path)
    found = []
    for pair in rig.coupling.pairs:
        for place, fields in FIELDS.items():
            for field in fields:
                key = f"{place.format(pair=pair)}.{field}"
                local = local_key(key)
                assert local is not None, key
                points = points_of(path, [(key, [0.5, 0.625])])
                try:
                    points.read_rig(0)
                except ConfigError:
                    continue
                found.append(key)
    return found


def template_of(points: Points) -> tuple[Template, RigFacts]:
    found = points.family(0)
    assert found is not None
    family, _ = found
    facts = rig_facts(family.base)
    return Template(family, pack_rig(family.base, DURATION_S, facts), facts), facts


def instantiate(template: Template, points: Points, number: int) -> Instance:
    found = points.family(number)
    assert found is not None
    family, values = found
    instance = template.instantiate(values, points.seed_at(number, family.base.seed))
    assert instance is not None
    return instance


def same_tables(one: Job, other: Job) -> None:
    for name in Job._fields:
        if name in ("rig", "table", "flags"):
            continue
        assert repr(getattr(one, name)) == repr(getattr(other, name)), name
    assert one.table.tobytes() == other.table.tobytes()
    assert one.flags.tobytes() == other.flags.tobytes()


def assert_alike(path: Path, axes: Sequence[tuple[str, Sequence[Any]]]) -> int:
    """Hold every point against itself made alone; return how many were instantiated."""
    points = points_of(path, axes)
    alone = points_of(path, axes)
    template, facts = template_of(points)
    instances = 0
    for number in range(len(points)):
        rig = alone.read_rig(number)
        assert points.rig(number) == rig
        instance = instantiate(template, points, number)
        job = pack_rig(rig, DURATION_S, facts)
        same_tables(template.filled(instance), job)
        out = np.empty(0)
        for one, other in zip(template.tables(instance, out), record_tables(job, out), strict=True):
            assert np.array(one).tolist() == np.array(other).tolist()
        instances += 1
    return instances


@pytest.mark.sparse(16)
@pytest.mark.parametrize(
    "path",
    [path for path in (*SHIPPED, *BUSES) if not has_plain_devices(load_rig(path))],
    ids=lambda path: path.stem,
)
def test_every_near_key_reaches_what_it_says(path: Path) -> None:
    keys = local_keys_of(path)
    assert len(keys) >= 8
    instance = sum(assert_alike(path, [(key, [0.625, 1])]) for key in keys)
    assert instance == 2 * len(keys)
    assert_alike(path, [("seed", [1, 7, 7, -3, 2**40])])


@pytest.mark.slow
@given(data=st.data())
@settings(max_examples=30, suppress_health_check=list(HealthCheck), deadline=None)
def test_near_keys_together_reach_no_further(data: st.DataObject) -> None:
    compiled = [path for path in SHIPPED if not has_plain_devices(load_rig(path))]
    path = data.draw(st.sampled_from(compiled))
    keys = data.draw(
        st.lists(st.sampled_from(["seed", *local_keys_of(path)]), min_size=2, unique=True)
    )
    values = st.floats(0.01, 10.0) | st.integers(1, 10)
    axes = [
        (key, data.draw(st.lists(values.filter(lambda x: x >= 1), min_size=1, max_size=2)))
        if key.endswith(("exponent", "position"))
        else (key, [3, 4])
        if key == "seed"
        else (key, data.draw(st.lists(values, min_size=1, max_size=2)))
        for key in keys[:4]
    ]
    far = data.draw(st.sampled_from([("loop.cpu", [None]), ("coupling.engage_ramp_s", [0.1, 0])]))
    place = data.draw(st.integers(0, len(axes)))
    points = points_of(path, [*axes[:place], far, *axes[place:]])
    alone = points_of(path, [*axes[:place], far, *axes[place:]])
    for number in range(len(points)):
        rig = alone.read_rig(number)
        assert points.rig(number) == rig
        found = points.family(number)
        assert found is not None
        family, _ = found
        facts = rig_facts(family.base)
        template = Template(family, pack_rig(family.base, DURATION_S, facts), facts)
        instance = instantiate(template, points, number)
        same_tables(template.filled(instance), pack_rig(rig, DURATION_S, facts))


WRONG: list[Any] = [-1.0, 0.0, -0.0, 0, 1e308, 5e-324, 2**53, 10**400, True, None, "7", [1.0], {}]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bench-1dof-loopback", "bench-foam-loopback", "delay-stability"])
def test_what_is_refused_is_refused_alike(name: str) -> None:
    path = next(path for path in SHIPPED if path.stem == name)
    refused = 0
    for key in ("seed", *local_keys_of(path)):
        right = 3 if key == "seed" else 1.5
        points = points_of(path, [(key, [right, *WRONG])])
        alone = points_of(path, [(key, [right, *WRONG])])
        points.rig(0)  # the family is there
        simulate = Simulator("python", whole=False)
        for number in range(len(WRONG) + 1):
            reported: list[Any] = []
            for read in (points.rig, alone.read_rig):
                try:
                    reported.append(read(number))
                except ConfigError as err:
                    reported.append(str(err))
            assert reported[0] == reported[1]
            if isinstance(reported[1], str):
                refused += 1
                row = simulate_point(points, number, ("stable",), simulate)
                assert row["outcome"] == f"refused: {reported[1]}"
    assert refused > 30


def test_what_cannot_be_packed_is_refused_alike() -> None:
    path = next(path for path in SHIPPED if path.stem == "bench-1dof-loopback")
    axes = [("simulation.axes.slave.lever.inertia", [1e-3, 1e-31])]
    simulate = Simulator("python", whole=False)
    rows = [simulate_point(points_of(path, axes), at, ("stable",), simulate) for at in (0, 1)]
    again = points_of(path, [(axes[0][0], [1e-31, 1e-3])])  # the family's own is the wrong one
    rows += [simulate_point(again, at, ("stable",), simulate) for at in (0, 1)]
    assert [row["outcome"].partition(":")[0] for row in rows] == [
        *("finished", "refused"),
        *("refused", "finished"),
    ]
    assert "1e-31 with its hand is too small to simulate" in rows[1]["outcome"]
    assert rows[1]["outcome"] == rows[2]["outcome"]


def test_keys_that_reach_further_are_not_near() -> None:
    for key in (
        "rate_hz",
        "coupling.delay_s",
        "coupling.pairs.a.position_scale",
        "coupling.pairs.a.wall_master.position",
        "coupling.pairs.a.wall_master",
        "simulation.axes.master.a.start_position",
        "simulation.axes.master.a.position_noise",
        "simulation.axes.master.a.command_delay_s",
        "simulation.environment.a.type",
        "simulation.hand.a.reference.position",
        "master.axes.a.inertia.lower",
        'simulation.environment."a".stiffness',
    ):
        assert local_key(key) is None, key
    wall = "simulation.environment.a.stiffness"
    assert list(local_keys([wall, "coupling.delay_s"])) == [wall]
    for other in ("simulation.environment.a", "simulation", f"{wall}.x", '"seed"'):
        assert local_keys([wall, other]) == {}


def test_blocks_of_near_keys_judge_each_key_by_itself() -> None:
    kinds: list[type[BaseModel]] = [AxisSimulation, Hand, Wall, Pair]
    kinds += get_args(get_args(Environment)[0])
    for kind in kinds:
        assert not kind.__pydantic_decorators__.model_validators, kind
        assert not kind.__pydantic_decorators__.root_validators, kind


def test_a_value_is_read_as_the_file_would_read_it() -> None:
    path = next(path for path in SHIPPED if path.stem == "delay-stability")
    local = local_key("simulation.axes.master.cart.inertia")
    assert local is not None
    rig = load_rig(path)
    assert read_value(rig, local, 2) == 2.0
    assert isinstance(read_value(rig, local, 2), float)
    for value in (math.inf, math.nan, "2", True, None, -2.0):
        assert read_value(rig, local, value) is None


@pytest.fixture
def few_are_kept(monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr("tautwave.sweep.family.KEPT", 5)
    monkeypatch.setattr("tautwave.sweep.template.FAMILIES", 5)
    return 5


def far_points(count: int) -> Points:
    path = next(path for path in SHIPPED if path.stem == "delay-stability")
    axes: list[tuple[str, Sequence[Any]]] = [
        ("simulation.axes.master.cart.inertia", [0.5, 0.6]),
        ("coupling.engage_ramp_s", [0.001 * at for at in range(count)]),
    ]
    return points_of(path, axes)


def test_families_are_forgotten(few_are_kept: int) -> None:
    points = far_points(10)
    for number in range(len(points)):
        points.family(number)
    families: Families = points._families
    assert len(families._found) == few_are_kept
    assert shape_of(points._recipes[0]).is_local == (True, False)


@pytest.mark.slow
def test_what_is_kept_for_families_is_bounded(
    few_are_kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = far_points(10)
    simulate = Simulator("python", whole=False)
    made: list[weakref.ref[Template]] = []
    begin = Template.__init__

    def counted(template: Template, *arguments: Any) -> None:
        begin(template, *arguments)
        made.append(weakref.ref(template))

    def alive() -> int:
        gc.collect()
        return sum(template() is not None for template in made)

    monkeypatch.setattr(Template, "__init__", counted)
    for number in range(len(points)):
        simulate(points, number)
    assert len(made) == len(points)  # they come back too late to be there
    assert alive() == few_are_kept
    template = made[-1]()
    assert template is not None
    monkeypatch.setattr("tautwave.sweep.template.MEMORY", 3 * template.size)
    del template
    simulate(points, 0)
    assert alive() == 3
    monkeypatch.setattr("tautwave.sweep.template.MEMORY", 0)
    simulate(points, 1)
    assert alive() == 1


def walls(path: Path, rig: Path, *, noisy: bool = False) -> Path:
    noise = "simulation.axes.master.lever.position_noise: 1.0e-5, " if noisy else ""
    if noisy:
        noise += "simulation.faults: {missing_probability: 0.01, overrun_probability: 0.01}, "
    path.write_text(
        f"name: walls\nrig: {rig}\nduration_s: 0.7\nset: {{{noise}coupling.engage_ramp_s: 0}}\n"
        "grid:\n"
        "  coupling.delay_s: [0.01, 0.02]\n"
        "  simulation.environment.lever.stiffness: [5, 50, -1]\n"
        "columns:\n"
        "  coupling.pairs.lever.wave_impedance: [0.01, 0.02]\n"
        "  simulation.environment.lever.position: [0.001, 0.002]\n"
        "measures: [stable, growth_rate, peak_amplitude, late_amplitude, position_error_rms,"
        " position_error_max, effort_error_rms, effort_error_max, predicted_radius]\n"
    )
    return path


@pytest.mark.sparse(2)
@pytest.mark.parametrize("noisy", [False, True])
def test_rows_are_those_of_points_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, noisy: bool
) -> None:
    rig = next(path for path in SHIPPED if path.stem == "bench-1dof-loopback")
    path = walls(tmp_path / "walls.yaml", rig, noisy=noisy)
    monkeypatch.setattr("tautwave.sweep.file.CHECKED", 0)
    shared = run_sweep(load_sweep(path), tmp_path / "shared").table.read_text()
    monkeypatch.setattr(Points, "family", lambda *_: None)
    alone = run_sweep(load_sweep(path), tmp_path / "alone").table.read_text()
    assert shared == alone
    rows = alone.splitlines()[1:]
    assert len(rows) == 12
    assert sum("refused" in row for row in rows) == 4


def test_a_rig_that_never_engages_is_a_row(tmp_path: Path) -> None:
    rig = next(path for path in SHIPPED if path.stem == "delay-stability")
    path = tmp_path / "sweep.yaml"
    path.write_text(
        f"name: apart\nrig: {rig}\nduration_s: 0.05\n"
        "set: {coupling.pairs.cart.offset: 0, coupling.pairs.cart.engage_tolerance: 0.001}\n"
        "grid: {simulation.axes.slave.cart.start_position: [0, 0.5]}\n"
        "measures: [stable, growth_rate, peak_amplitude]\n"
    )
    result = run_sweep(load_sweep(path), tmp_path / "out")
    rows = list(result.rows)
    assert [row["outcome"] for row in rows] == ["finished", "safety_stop"]
    assert (rows[1]["cycles"], rows[1]["stable"], rows[1]["growth_rate"]) == ("0", "0.0", "nan")


def test_ids_are_what_they_were() -> None:
    """Tables of earlier versions are gone on with: an id is a hash of what is set, as `--set`."""
    path = next(path for path in SHIPPED if path.stem == "delay-stability")
    axes = [("coupling.delay_s", [0.001, 0.002]), ("name", ["a,b", 'c"d'])]
    points = points_of(path, axes)
    document = pickle.loads(points._document)
    kept = json.dumps([document.value, None, DURATION_S], default=str)
    salt = hashlib.sha256(f"\n[]\n{kept}".encode()).digest()
    for number, (delay, name) in enumerate(
        (delay, name) for delay in axes[0][1] for name in axes[1][1]
    ):
        words = [f"coupling.delay_s={json.dumps(delay)}", f"name={json.dumps(name)}"]
        digest = hashlib.sha256(salt + json.dumps(words).encode()).hexdigest()
        assert points.point_id(number).id == points.row(number)["id"] == digest[:16]
        assert points.ids()[number] == int(digest[:16], 16)
