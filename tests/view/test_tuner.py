"""What a viewer may ask for, and which rigs are certified before it is handed over."""

from __future__ import annotations

import asyncio
import json
import sys
import threading
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.errors import ConfigError, NotCertifiedError
from tautwave.rig import build_rig
from tautwave.rig.tuning import knobs_of
from tautwave.runtime.tuning.desk import ParameterPage, last_left, leave
from tautwave.view import tuner
from tautwave.view.tuner import asked_of, tune, with_values
from tests.view.served import BENCH

K, B = (f"coupling.pairs.lever.wall_slave.{key}" for key in ("stiffness", "damping"))
LIMIT = "slave.axes.lever.effort_limit"
FILTER = "coupling.pairs.lever.wave_filter_hz"
ROW = (3.0, 4e-4, 1.1, 100.0)


def run_with(desk: ParameterPage) -> Any:
    knobs = [
        {"path": path, "column": path, "low": 0.0, "high": 30.0 * value, "unit": "x",
         "ramped": path != FILTER}
        for path, value in zip((K, B, LIMIT, FILTER), ROW, strict=True)
    ]  # fmt: skip
    fixed = [{"path": "coupling.pairs.lever.wave_impedance", "when": "between runs", "value": 0.02}]
    facts = {"desk": desk.address, "knobs": knobs, "fixed": fixed, "hardware": []}
    live = SimpleNamespace(columns=[K, B, LIMIT, FILTER])
    return SimpleNamespace(facts={"tuning": facts}, live=live)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({K: 91.0}, r"0 to 90 x \(got 91.0\)"),
        ({K: "1"}, r"0 to 90 x \(got '1'\)"),
        ({K: True}, "got True"),
        ({K: float("nan")}, "got nan"),
        ({K: 10**400}, "got 1000"),
        ({K: None}, "got None"),
        ({"coupling.pairs.lever.wave_impedance": 0.1}, "only between runs"),
        ({"master.axes.lever.inertia.value": 1.0}, "is never tuned"),
        ({"__class__": 1.0}, "is never tuned"),
    ],
)
def test_what_may_not_be_asked_for(values: Mapping[str, Any], why: str) -> None:
    desk = ParameterPage(4)
    with pytest.raises(ConfigError, match=why):
        asked_of(run_with(desk), ROW, values)
    desk.close()


def test_a_run_that_allows_no_tuning_says_how() -> None:
    run: Any = SimpleNamespace(facts={"tuning": None})
    with pytest.raises(ConfigError, match="--allow-tuning"):
        asked_of(run, ROW, {K: 1.0})


def test_the_set_and_the_corner_of_the_way_are_certified(monkeypatch: pytest.MonkeyPatch) -> None:
    certified: list[tuple[str, float, float]] = []

    async def certify(rig: Rig, changed: Rig, hardware: Any) -> None:
        wall = changed.coupling.pairs["lever"].wall_slave
        assert wall is not None
        certified.append((changed.name, wall.stiffness, wall.damping))
        if wall.stiffness * wall.damping > 2e-3:
            raise NotCertifiedError("too much")

    monkeypatch.setattr(tuner, "certify_change", certify)
    rig, desk = load_rig(BENCH, ["operate.scales=[0.5]"]), ParameterPage(4)
    run = run_with(desk)
    leave(desk.address, [2.0, 4e-4, 1.1, 100.0])  # on its way to 2.0 already
    asked = asked_of(run, ROW, {B: 5e-4, FILTER: 50.0})
    assert "damping 0.0005" in asyncio.run(tune(run, rig, asked))
    names = ("bench-1dof", "bench-1dof at scale 0.5")
    assert certified == [(name, k, 5e-4) for k in (2.0, 3.0) for name in names]
    assert last_left(desk.address, 4) == (2.0, 5e-4, 1.1, 50.0)
    with pytest.raises(NotCertifiedError, match=r"not in between: first lower.*too much"):
        asyncio.run(tune(run, rig, asked_of(run, ROW, {B: 8e-4})))
    with pytest.raises(NotCertifiedError, match=r"^too much"):
        asyncio.run(tune(run, rig, asked_of(run, ROW, {K: 20.0})))
    assert last_left(desk.address, 4) == (2.0, 5e-4, 1.1, 50.0)
    certified.clear()
    asyncio.run(tune(run, rig, asked_of(run, ROW, {LIMIT: 0.5})))
    assert not certified  # below the rig's own limit its certificate holds
    assert last_left(desk.address, 4) == (2.0, 5e-4, 0.5, 50.0)
    desk.close()


LEVERS = BENCH.parent / "bench-position-coupling.yaml"


@pytest.mark.parametrize("law", ["position", "pd_damping"])
def test_a_limit_of_a_law_that_clips_both_ends_alike_is_certified_anew(
    law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[float] = []

    async def certify(rig: Rig, changed: Rig, hardware: Any) -> None:
        seen.append(changed.slave.axes["lever"].effort_limit)

    monkeypatch.setattr(tuner, "certify_change", certify)
    keys = f"coupling={{law: {law}, pairs: {{lever: {{stiffness: 1.0, damping: 0.0}}}}}}"
    rig, desk = load_rig(LEVERS, ["require=passive", keys]), ParameterPage(1)
    asked = tuner.Asked({LIMIT: 1.1}, {LIMIT: 1.1}, {LIMIT: 0.5}, {LIMIT})
    facts = {"hardware": [], "knobs": [{"path": LIMIT}], "desk": desk.address}
    run: Any = SimpleNamespace(facts={"tuning": facts})
    assert "effort_limit 0.5" in asyncio.run(tune(run, rig, asked))
    assert seen == [0.5, 1.1]
    desk.close()


def test_a_tuned_limit_leaves_the_load_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The knob is the ceiling of wall and coupling; the rig's limit is of the load too."""
    seen: list[float] = []

    async def certify(rig: Rig, changed: Rig, hardware: Any) -> None:
        seen.append(changed.slave.axes["lever"].effort_limit)

    monkeypatch.setattr(tuner, "certify_change", certify)
    changes = {"slave.axes.lever.load": {"constant": 0.5}, "simulation.axes": {}}
    rig = load_rig(LEVERS, [f"{path}={value!r}" for path, value in changes.items()])
    control = build_rig(rig, clock="fake").control
    knob = next(one for one in knobs_of(rig, control) if one.path == LIMIT)
    assert knob.high == knob.value == pytest.approx(1.1 - 0.55)
    desk = ParameterPage(1)
    facts = {"hardware": [], "knobs": [{"path": LIMIT}], "desk": desk.address}
    run: Any = SimpleNamespace(facts={"tuning": facts})
    asked = tuner.Asked({LIMIT: knob.value}, {LIMIT: knob.value}, {LIMIT: 0.05}, {LIMIT})
    assert "effort_limit 0.05" in asyncio.run(tune(run, rig, asked))
    assert seen == [pytest.approx(0.6), 1.1]
    assert last_left(desk.address, 1) == (0.05,)
    desk.close()


def test_a_changed_rig_is_checked_as_a_rig_file_is() -> None:
    rig = load_rig(BENCH)
    changed = with_values(rig, {K: 1.5, FILTER: 60.0})
    assert changed.coupling.pairs["lever"].wall_slave is not None
    assert changed.coupling.pairs["lever"].wall_slave.stiffness == 1.5
    with pytest.raises(ConfigError, match="stiffness"):
        with_values(rig, {K: -1.0})


def test_a_claim_that_would_grow_is_refused() -> None:
    rig = load_rig(BENCH)
    tuner._keep_claims(rig, rig)
    tuner._keep_claims(rig, with_values(rig, {FILTER: 50.0}))
    tuner._keep_claims(rig, with_values(rig, {K: 3.1}))  # its wall owes no more for that
    with pytest.raises(NotCertifiedError, match="stated before the run"):
        tuner._keep_claims(rig, with_values(rig, {"coupling.pairs.lever.wave_impedance": 0.05}))


@pytest.mark.parametrize("side", ["master", "slave"])
def test_a_claim_may_differ_by_its_rounding_and_no_more(
    side: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = load_rig(BENCH)
    changed = rig.model_copy(update={"name": "changed"})
    claims = {"bench-1dof": {"master": 2.0, "slave": 3.0}, "changed": {"master": 1.0, "slave": 1.0}}
    monkeypatch.setattr(tuner, "port_claims", lambda rig, *_: {"claim_j": claims[rig.name]})
    before = claims["bench-1dof"][side]
    for share in (0.0, 1.0, 1.0 + 0.9e-9):
        claims["changed"][side] = before * share
        tuner._keep_claims(rig, changed)
    for share in (1.0 + 1.2e-9, 1.5):
        claims["changed"][side] = before * share
        with pytest.raises(NotCertifiedError) as refused:
            tuner._keep_claims(rig, changed)
        assert str(refused.value) == (
            f"{side}.lever: its port would claim {before * share:.4g} J, more than the "
            f"{before:.4g} J stated before the run"
        )


class Child:
    """A certificate's process: what it says, and how it ends."""

    def __init__(self, found: Mapping[str, Any] | None, said: str = "", code: int = 0) -> None:
        self.out = b"" if found is None else json.dumps(found).encode()
        self.said, self.returncode = said.encode(), code
        self.read, self.killed = b"", False

    async def communicate(self, given: bytes) -> tuple[bytes, bytes]:
        self.read = given
        return self.out, self.said

    def kill(self) -> None:
        self.killed = True


def certified_by(
    child: Child, monkeypatch: pytest.MonkeyPatch, path: str, value: float
) -> list[str]:
    """Certify a change with a process of ours; return the words that it was begun with."""
    words: list[str] = []

    async def begin(*command: str, **_: Any) -> Child:
        words.extend(command)
        return child

    monkeypatch.setattr(asyncio, "create_subprocess_exec", begin)
    rig = load_rig(BENCH)
    asyncio.run(tuner.certify_change(rig, with_values(rig, {path: value}), ["slave.lever"]))
    return words


WALLED = {"walls": {"lever": {"rendered_stiffness": 2.0, "asked_stiffness": 2.0}}, "passed": True}
CUT = {"walls": {"lever": {"rendered_stiffness": 1.98765, "asked_stiffness": 2.0}}, "passed": True}


def test_another_process_reads_the_changed_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child(WALLED)
    words = certified_by(child, monkeypatch, K, 2.0)
    assert words == [sys.executable, "-m", "tautwave.certificate", "slave.lever"]
    assert child.read.decode() == resolved_yaml(with_values(load_rig(BENCH), {K: 2.0}))


def test_a_claim_that_would_grow_is_refused_before_anything_is_certified(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    child = Child(WALLED)
    with pytest.raises(NotCertifiedError, match=r"^master\.lever: its port would claim"):
        certified_by(child, monkeypatch, "coupling.pairs.lever.wave_impedance", 0.05)
    assert child.read == b""


@pytest.mark.parametrize(
    ("child", "why"),
    [
        (Child({"passed": False, "sentences": ["One.", "Two."]}), "One. Two."),
        (Child(None, "no module\n", 1), "no module"),
        (Child(None, " \n", -9), "no certificate"),
        (Child(CUT), "wall of lever: certified up to a stiffness of 1.988"),
    ],
)
def test_a_change_that_is_not_certified_is_refused_in_the_certificates_words(
    child: Child, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(NotCertifiedError) as refused:
        certified_by(child, monkeypatch, K, 2.0)
    assert str(refused.value) == why
    assert not child.killed


def test_a_certificate_that_does_not_come_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Slow(Child):
        async def communicate(self, given: bytes) -> tuple[bytes, bytes]:
            await asyncio.Event().wait()
            raise AssertionError

    monkeypatch.setattr(tuner, "TIMEOUT_S", 0.001)
    child = Slow(None)
    with pytest.raises(NotCertifiedError, match=r"^no certificate within 0\.001 s$"):
        certified_by(child, monkeypatch, K, 2.0)
    assert child.killed


@pytest.mark.slow
def test_the_certificate_of_another_process_decides() -> None:
    rig, desk = load_rig(BENCH), ParameterPage(4)
    run = run_with(desk)
    assert "stiffness 3.1" in asyncio.run(tune(run, rig, asked_of(run, ROW, {K: 3.1})))
    with pytest.raises(NotCertifiedError, match="K = 20 N m/rad is"):
        asyncio.run(tune(run, rig, asked_of(run, ROW, {K: 20.0})))
    assert last_left(desk.address, 4) == (3.1, 4e-4, 1.1, 100.0)
    desk.close()
    for thread in threading.enumerate():
        if thread.name.startswith("asyncio-waitpid"):  # they end by themselves, soon
            thread.join(10.0)
