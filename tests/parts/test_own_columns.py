"""A column of a driver or law from outside is declared once: rows, units, docs, export, report."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoints
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave import registry
from tautwave.columns import Column
from tautwave.config import load_rig
from tautwave.contracts import BusSpec, Clock
from tautwave.errors import ConfigError
from tautwave.recordings.recording import read_recording
from tautwave.report.columns import described, described_text
from tautwave.report.export.tables import export_tables
from tautwave.report.run.loading import load_run
from tautwave.report.run.tables import reported_table
from tautwave.rig import build_rig, coupling_law
from tautwave_sim.loopback import LoopbackDriver, plugin, simulator
from tests.commands import keep_in_one_process, tautwave

ROOT = Path(__file__).parents[2]
LAW = ROOT / "docs/examples/tautwave-example-parts/tautwave_example_parts/pd_injection.py"
WARMTH = Column("warmth", "degC, K", "of a motor that nobody built", lambda axis: axis.physics.x)
SLOW = pytest.mark.slow  # one whole run; by default `test_a_built_rig_knows_what_it_is`
PAIRS = "{lever: {stiffness: 2, damping: 0.02, injection: 0.2}}"
KEYS = ("buses.arm.driver=warm", f"coupling={{law: stretched, delay_s: 0.002, pairs: {PAIRS}}}")
RIG = ROOT / "configs/bench-1dof-loopback.yaml"


class WarmDriver(LoopbackDriver):
    """A loopback's driver that records one thing more."""

    def __init__(self, options: Any, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(options, bus, clock, transport)
        for axis in self._world.axes:
            self.record(axis.name, axis, [WARMTH])


@pytest.fixture(scope="module")
def patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as context:
        yield context


@pytest.fixture(scope="module", autouse=True)
def _installed(patch: pytest.MonkeyPatch) -> None:
    """The driver `warm` and the law `stretched` are installed packages."""
    patch.syspath_prepend(str(LAW.parents[1]))
    drivers = {registry.DRIVERS: plugin._replace(make=WarmDriver, columns=[WARMTH])}
    drivers[registry.SIMULATORS] = simulator
    found = registry.entry_points()

    def select(group: str) -> list[Any]:
        own = {"warm": drivers[group]} if group in drivers else {}
        if group == registry.COUPLINGS:
            from tautwave_example_parts.pd_injection import plugin as stretched

            own = {"stretched": stretched}
        named = [SimpleNamespace(name=name, load=lambda it=it: it) for name, it in own.items()]
        return [*found.select(group=group), *named]

    patch.setattr(registry, "entry_points", lambda: SimpleNamespace(select=select))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, patch: pytest.MonkeyPatch) -> Path:
    """A run's directory, whose rig has both."""
    keep_in_one_process(patch)
    here = tmp_path_factory.mktemp("own")
    told = [word for key in KEYS for word in ("--set", key)]
    done = tautwave(
        "run", RIG, *told, "--allow-uncertified",
        "--clock", "fake", "--duration", 1, "--out", "out", cwd=here,
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    return here / "out"


def test_a_built_rig_knows_what_it_is() -> None:
    rig = load_rig(RIG, list(KEYS))
    assembly = build_rig(rig, clock="fake", duration_s=0.01)
    told = json.loads(described_text(rig, assembly.columns))
    assert set(told) == set(assembly.columns)
    assert told["slave.lever.warmth"] == ["degC", WARMTH.meaning]
    assert "master.lever.warmth" not in told
    assert told["master.lever.stretch"][0] == told["master.lever.position"][0] == "rad"
    assert told["lever.coupler.absorbed"] == ["J", "spring and damper between the devices"]


def test_signals_as_before_0_3_are_refused_in_a_sentence() -> None:
    from tautwave_example_parts.pd_injection import law, plugin

    rig = load_rig(RIG)
    old = plugin._replace(law=law._replace(signals=("stretch",)))
    with pytest.MonkeyPatch.context() as context:
        context.setattr(registry, "load_coupling", lambda name: old)
        with pytest.raises(ConfigError, match="law pd_injection: its `signals` have to be"):
            coupling_law(rig)


@SLOW
def test_rows_have_it_and_say_what_it_is(run: Path) -> None:
    rows = read_recording(run / "recording.mcap")
    assert rows["slave.lever.warmth"].tolist() == rows["true.slave.lever.position"].tolist()
    assert "master.lever.warmth" not in rows
    assert rows.units["slave.lever.warmth"] == "degC"
    assert rows.meanings["slave.lever.warmth"] == WARMTH.meaning
    assert rows["master.lever.stretch"].any()
    assert rows.units["master.lever.stretch"] == rows.units["master.lever.position"] == "rad"
    assert set(rows.meanings) == set(rows.columns)


@SLOW
def test_who_reads_the_rows_needs_neither(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "entry_points", lambda: EntryPoints(()))
    rows = read_recording(run / "recording.mcap")
    found = described(rows.columns, rows.metadata, {})
    assert found["slave.lever.warmth"] == ("degC", WARMTH.meaning)


@SLOW
def test_tables_have_its_unit(run: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    (table, _) = export_tables(run, "parquet", tmp_path / "tables")
    schema = parquet.read_schema(table)
    assert schema.field("slave.lever.warmth").metadata == {b"unit": b"degC"}
    assert schema.field("slave.lever.stretch").metadata == {b"unit": b"rad"}


@SLOW
def test_the_report_shows_its_range(run: Path) -> None:
    loaded = load_run(run)
    warmth = read_recording(run / "recording.mcap", ["slave.lever.warmth"])["slave.lever.warmth"]
    rows = {row[0]: row[1:] for row in reported_table(loaded).rows}
    assert set(rows) == {"warmth", "stretch"}
    meaning, low, high = rows["warmth"]
    assert meaning == WARMTH.meaning
    assert str(low).endswith(" degC")
    assert str(high).endswith(" degC")
    assert float(str(high).split()[0]) == pytest.approx(warmth.max(), rel=1e-2)
    assert "lever" in rows["stretch"][1]  # of which axis, where several have it


@SLOW
def test_the_page_of_columns_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from _tools.columns import columns_page

    page = columns_page()
    assert f"`SIDE.AXIS.warmth` | {WARMTH.unit} | {WARMTH.meaning}" in page
    assert "`SIDE.AXIS.stretch` | rad, m | of the spring, as this side sees it" in page
    sys.modules.pop("tautwave_example_parts.pd_injection", None)
