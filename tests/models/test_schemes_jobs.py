"""Jobs whose devices are moved another way: by a named scheme, or along recorded positions."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.bench.rigs import ONE_PAIR
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT, RK4
from tautwave.simulation.kernel.pack import Job, pack_rig
from tautwave.simulation.kernel.records import FOAM, HELD, PLANT
from tautwave.simulation.kernel.run import run_rig
from tautwave.simulation.kernel.schemes import contact_of, with_positions, with_scheme
from tautwave.simulation.kernel.tables import object_tables
from tautwave.simulation.run import engine_of, simulation_of_run


def job_of(seconds: float = 0.4) -> Job:
    return pack_rig(ONE_PAIR.load(), seconds)


def rows_of(job: Job, engine: str = "python") -> np.ndarray:
    kernel, tables_of = engine_of(engine, job.law)
    tables = tables_of(job)
    return simulation_of_run(job, tables, kernel(tables)).data


def test_a_wall_is_the_same_wall_as_a_contact() -> None:
    device = job_of().devices[1]
    contact = contact_of(device)
    assert device.kind == PLANT
    assert contact.stiffness == device.plant.wall_stiffness
    assert contact.damping == device.plant.wall_damping
    assert contact.position == device.plant.wall_position


def test_there_and_back_is_the_same_job() -> None:
    job = job_of()
    there = with_scheme(job, RK4, 3, 0.0)
    assert [device.kind for device in there.devices] == [FOAM, FOAM]
    assert there.devices[1].foam.substeps == 3
    assert np.array_equal(rows_of(with_scheme(job, EXACT, 1, 0.0)), rows_of(job), equal_nan=True)


def test_the_oracle_moves_as_the_exact_devices_do() -> None:
    job = job_of(1.2)
    at = job.columns.index("true.slave.lever.position")
    exact, oracle = rows_of(job)[:, at], rows_of(with_scheme(job, DORMAND_PRINCE, 1, 1e-12))[:, at]
    assert np.abs(exact - oracle).max() < 2.1e-5  # an encoder step: more is not rounding


def test_held_devices_are_where_they_were_put() -> None:
    job = job_of()
    slots = np.arange(402)
    given = {
        "master.lever": 0.1 * np.sin(0.01 * slots),
        "slave.lever": np.full(402, 0.02),
    }
    held = with_positions(job, given)
    assert [device.kind for device in held.devices] == [HELD, HELD]
    tables = object_tables(held)
    rows = simulation_of_run(held, tables, run_rig(tables, held.law.steps))
    for axis, positions in given.items():
        assert rows[f"{axis}.position"] == pytest.approx(positions[:400], abs=1e-15)
    assert np.abs(rows["slave.lever.commanded"]).max() > 0.0


@pytest.mark.slow
def test_held_devices_in_every_engine() -> None:
    pytest.importorskip("numba")
    given = {axis: 0.1 * np.sin(0.01 * np.arange(402)) for axis in job_of().axes}
    held = with_positions(job_of(), given)
    want = rows_of(held).tobytes()
    for engine in ("compiled",):
        assert rows_of(held, engine).tobytes() == want
