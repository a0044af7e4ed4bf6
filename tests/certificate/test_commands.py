"""The certificate through the command line: exit codes, refusal, banner, derate, after the run."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tautwave.analysis.claim import joules
from tautwave.certificate.after import Measured, recheck
from tests.certificate.rigs import CONFIGS, PAIR, README_RIG, rig, wall
from tests.commands import keep_in_one_process, page_of, tautwave

QUICK = ("--clock", "fake", "--duration", "1.2", "--out", "out")
INTO_THE_WALL = (
    "--set",
    "simulation.hand.lever.reference.waypoints=[[0.1, 0.0], [0.7, -0.38], [3.0, -0.38]]",
)


def overruns(slots: int) -> tuple[str, str]:
    faults = f"{{overrun_probability: 0.02, overrun_slots: {slots}}}"
    return ("--set", f"simulation.faults={faults}")


@pytest.fixture
def one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    keep_in_one_process(monkeypatch)


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "out/summary.json").read_text())
    return found


# -- check ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_check_exits_3_when_the_required_verdict_fails(tmp_path: Path) -> None:
    done = tautwave("check", README_RIG, "--set", wall(9.0), "--out", "reported", cwd=tmp_path)
    assert done.exit_code == 3
    assert "slave wall: K = 9 N m/rad is 2.25 x the passive limit 4" in done.stdout
    assert "not passed" in done.stdout
    reported = json.loads((tmp_path / "reported/check.json").read_text())
    assert reported["certificate"]["passed"] is False
    assert reported["exit_code"] == 3
    assert (tmp_path / "reported/certificate.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_check_follows_require(tmp_path: Path) -> None:
    words = ("check", README_RIG, "--set", wall(4.5), "--json")
    assert tautwave(*words, cwd=tmp_path).exit_code == 3
    done = tautwave(*words, "--set", "require=coupled_stable", cwd=tmp_path)
    assert done.exit_code == 0
    verdicts = json.loads(done.stdout)["certificate"]["verdicts"]
    assert verdicts["passive"]["passed"] is False
    assert verdicts["coupled_stable"]["passed"] is True


def cpu_and_modules(code: str, *words: str) -> tuple[float, set[str]]:
    """CPU seconds of a Python process, and the top names of what it has imported."""
    reported = (
        "import sys, atexit, time\n"
        "atexit.register(lambda: print('\\n', time.process_time(), *sys.modules))\n"
    )
    command = [sys.executable, "-c", reported + code, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds, *modules = done.stdout.splitlines()[-1].split()
    return float(seconds), {name.partition(".")[0] for name in modules}


@pytest.mark.slow
def test_check_of_two_axes_is_light() -> None:
    """No SciPy (1.3 s of import alone), no matplotlib; a few starts of NumPy and pydantic."""
    code = "from tautwave.cli import main; main(['check', sys.argv[1]], prog_name='tautwave')"
    bench = str(CONFIGS / "bench-2axis-loopback.yaml")
    found = [cpu_and_modules(code, bench) for _ in range(2)]
    assert not found[0][1] & {"scipy", "numba", "matplotlib"}
    start = max(cpu_and_modules("import numpy, pydantic")[0] for _ in range(2))
    # about 14 times: four ports are proved, and how stiff a spring each bears
    assert min(seconds for seconds, _ in found) < 25.0 * start


@pytest.mark.sparse(8)
@pytest.mark.parametrize(
    ("name", "state"),
    [
        ("bench-1dof-loopback", ("passed", "passed")),
        ("bench-1dof-2khz", ("passed", "passed")),
        ("bench-1dof-2khz-noisy", ("passed", "passed")),
        ("bench-2axis-loopback", ("passed", "passed")),
        ("bench-room-loopback", ("passed", "passed")),
        ("arms-loopback", ("passed", "passed")),
        ("bench-admittance-loopback", ("failed", "passed")),
        ("bench-foam-loopback", ("passed", "passed")),
        ("bench-stiff-wall-loopback", ("passed", "passed")),
        ("bench-position-coupling", ("failed", "passed")),
        *(
            (f"feel-{what}", ("passed", "passed"))
            for what in ("wall", "spring", "foam", "delay", "loss")
        ),
        ("bench-multirate-loopback", ("passed", "passed")),
        ("bench-saturation-loopback", ("passed", "passed")),
        ("delay-stability", ("passed", "passed")),
        ("bench-canopen-virtual", ("passed", "passed")),
        ("bench-canopen-vcan", ("conditional", "passed")),
        ("bench-mit-virtual", ("passed", "passed")),
        ("dm4310-pair", ("passed", "passed")),
        ("bench-dynamixel-sim", ("passed", "passed")),
        ("bench-feetech-sim", ("passed", "passed")),
        ("bench-mixed-sim", ("passed", "passed")),
        ("so101-hls-sim", ("passed", "passed")),
        ("so101-pair-sim", ("conditional", "passed")),
        ("bench-modbus-rtu-sim", ("passed", "passed")),
        ("bench-modbus-tcp-sim", ("passed", "passed")),
        ("three-bus-sim", ("passed", "passed")),
        ("dsy-rs-pair", ("conditional", "conditional")),
        ("epos4-pair", ("conditional", "conditional")),
        ("xl330-pair", ("passed", "passed")),
        ("xm430-pair", ("passed", "passed")),
        ("network-loopback", ("passed", "passed")),
        ("scene-resonator", ("failed", "passed")),
        ("scene-granular", ("failed", "conditional")),
        ("scene-string", ("conditional", "conditional")),
        ("scene-drum", ("failed", "conditional")),
        ("scene-net", ("failed", "conditional")),
        ("bench-gripper-loopback", ("conditional", "passed")),
        ("scene-tissue", ("failed", "conditional")),
    ],
)
def test_shipped_rigs_certify_as_stated(name: str, state: tuple[str, str]) -> None:
    from tautwave.session import check

    found = check(rig(name=name))
    assert found.exit_code == 0
    verdicts = found.certificate["verdicts"]
    assert (verdicts["passive"]["state"], verdicts["coupled_stable"]["state"]) == state


def test_every_shipped_rig_is_named_here() -> None:
    marks = test_shipped_rigs_certify_as_stated.pytestmark  # type: ignore[attr-defined]
    [mark] = [mark for mark in marks if mark.name == "parametrize"]
    assert {path.stem for path in CONFIGS.glob("*.yaml")} == {name for name, _ in mark.args[1]}


# -- run ------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("one_process")
def test_run_refuses_with_the_sentences_and_leaves_nothing(tmp_path: Path) -> None:
    done = tautwave("run", README_RIG, *QUICK, "--set", wall(9.0), cwd=tmp_path)
    assert done.exit_code == 3
    assert "not certified as passive, which it requires" in done.stderr
    assert "Lower K to 4" in done.stderr
    assert "--allow-uncertified" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_run_may_be_allowed_and_carries_a_banner(tmp_path: Path) -> None:
    words = ("run", README_RIG, *QUICK, "--set", wall(9.0), "--allow-uncertified")
    done = tautwave(*words, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    assert "not certified; run anyway with --allow-uncertified" in done.stdout
    certificate = summary_of(tmp_path)["certificate"]
    assert certificate["passed"] is False
    assert certificate["allowed_uncertified"] is True
    assert certificate["after_run"]["invalidated"] is False  # there was nothing to break
    page = page_of(tmp_path / "out")
    assert '<div class="banner bad"><b>This rig ran without a certificate' in page
    assert "2.25 x the passive limit 4" in page


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_a_derated_wall_is_what_runs(tmp_path: Path) -> None:
    derated = wall(9.0, 0.0, "derate: true")
    done = tautwave("run", README_RIG, *QUICK, *INTO_THE_WALL, "--set", derated, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    assert "K = 9 requested, 3.8 rendered" in done.stdout
    reported = summary_of(tmp_path)["certificate"]
    assert reported["walls"]["slave.lever"] == {
        "asked_stiffness": 9.0,
        "rendered_stiffness": 3.8,
        "derate": True,
    }
    assert "K = 9 requested, 3.8 rendered" in page_of(tmp_path / "out")
    from tautwave.config import load_rig

    ran = load_rig(tmp_path / "out/rig.yaml").coupling.pairs["lever"].wall_slave
    assert ran is not None
    assert ran.stiffness == 3.8
    again = tautwave("check", tmp_path / "out/rig.yaml", "--json", cwd=tmp_path)
    assert again.exit_code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_overruns_in_a_wall_that_let_energy_out_break_the_certificate(tmp_path: Path) -> None:
    slow = [f"--set={side}.axes.lever.effort_rate_limit=500" for side in ("master", "slave")]
    done = tautwave("run", README_RIG, *QUICK, *INTO_THE_WALL, *overruns(8), *slow, cwd=tmp_path)
    assert done.exit_code == 3, done.stderr
    certificate = summary_of(tmp_path)["certificate"]
    after = certificate["after_run"]
    assert certificate["passed"] is True
    assert after["invalidated"] is True
    held = after["walls"]["slave.lever"]
    assert held["held_s"] == pytest.approx(9e-3)  # eight slots skipped: one effort for nine
    assert held["needed_damping"] == pytest.approx(3.0 * 9e-3 / 2.0 + 4e-4, rel=1e-6)
    assert held["balance_j"] < 0.0
    assert "held for 9 ms" in done.stderr
    assert re.search(r"A contact returned \S+ J more than it absorbed\.", done.stderr)
    assert "invalidates its certificate" in page_of(tmp_path / "out")


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_a_wall_that_pays_back_what_a_stall_let_out_keeps_its_claim(tmp_path: Path) -> None:
    done = tautwave("run", README_RIG, *QUICK, *INTO_THE_WALL, *overruns(8), cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    summary = summary_of(tmp_path)
    before = summary["certificate"]["elements"]
    held = summary["certificate"]["after_run"]["walls"]["slave.lever"]
    assert held["balance_j"] < 0.0
    stated = f"{joules(held['claim_j'])} that its wall may owe after earlier ones"
    assert any(stated in sentence for sentence in before["slave.lever port"]["sentences"])
    assert re.search(r"J more than it absorbed\. It claims \S+ J for that", held["sentence"])


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_overruns_in_a_wall_that_let_none_out_do_not(tmp_path: Path) -> None:
    done = tautwave("run", README_RIG, *QUICK, *INTO_THE_WALL, *overruns(3), cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    for held in summary_of(tmp_path)["certificate"]["after_run"]["walls"].values():
        assert held["held_s"] == pytest.approx(4e-3)
        assert held["needed_damping"] > held["damping"]
        assert held["balance_j"] >= 0.0
        assert "No contact of this run returned more energy than it absorbed" in held["sentence"]


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_overruns_out_of_contact_break_nothing(tmp_path: Path) -> None:
    still = "simulation.hand.lever.reference={type: hold, position: 0.0}"
    done = tautwave("run", README_RIG, *QUICK, *overruns(3), "--set", still, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    summary = summary_of(tmp_path)
    assert summary["missed_cycles"] > 10
    assert summary["certificate"]["after_run"]["passed"] is True
    assert summary["certificate"]["after_run"]["missed_cycles"] == summary["missed_cycles"]


# -- after a run, as a function -------------------------------------------------------------------


def measured(**changes: Any) -> Measured:
    calm = Measured(1e-3, 1e-3, True, {}, 0, {}, {})
    return calm._replace(**changes)


def test_a_calm_run_keeps_its_certificate() -> None:
    held = {"slave.lever": 1e-3, "master.lever": 1e-3}
    assert recheck(rig(), measured(held_s=held, period_s=1.001e-3))["passed"] is True


@pytest.mark.parametrize(
    ("changes", "passed"),
    [
        ({"held_s": {"slave.lever": 1.06e-3}}, True),  # 3 T / 2 + 4e-4 = 1.99e-3
        ({"held_s": {"slave.lever": 1.07e-3}}, False),
        ({"held_s": {"slave.lever": 1e-3}, "latched": False, "worst_period_s": 1.2e-3}, False),
        ({"held_s": {}, "latched": False, "worst_period_s": 1.2e-3}, True),
        ({"held_s": {"slave.lever": 1e-3}, "late": {"slave.lever": 3}}, False),
        # What the books say of held efforts counts where the devices' time is the loop's.
        ({"held_s": {"slave.lever": 9e-3}, "balance_j": {"slave.lever": 1e-9}}, True),
        ({"held_s": {"slave.lever": 9e-3}, "balance_j": {"slave.lever": -1e-9}}, False),
        ({"held_s": {"slave.lever": 9e-3}, "balance_j": {"master.lever": 1e-9}}, False),
        (
            {"held_s": {"slave.lever": 9e-3}, "balance_j": {"slave.lever": 1e-9}, "latched": False},
            False,
        ),
        (
            {
                "held_s": {"slave.lever": 9e-3},
                "balance_j": {"slave.lever": 1e-9},
                "late": {"slave.lever": 1},
            },
            False,
        ),
        ({"period_s": 1.5e-3}, False),
        ({"lost": {"slave.lever": 5}, "missed_cycles": 9}, True),
    ],
)
def test_only_what_touches_the_wall_breaks_it(changes: dict[str, Any], passed: bool) -> None:
    reported = recheck(rig(), measured(**changes))
    assert reported["passed"] is passed
    assert bool(reported["sentences"]) is not passed


def test_a_rig_that_requires_stability_is_not_broken_by_a_held_wall() -> None:
    bench = rig("require=coupled_stable", f"{PAIR}.wall_slave.stiffness=3.0")
    assert recheck(bench, measured(held_s={"slave.lever": 4e-3}))["passed"] is True
