"""A rig held against an older run of it: what is said now, and which keys keep what was."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tautwave import session
from tautwave.config import load_rig
from tautwave.config.text.resolved import resolved_yaml
from tautwave.errors import ConfigError
from tautwave.session.certified import summary_block
from tautwave.session.upgrading import Against, compare_with_run
from tautwave.summary import summary_of, write_summary
from tests.cli.conftest import SUMMARY

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
STIFF = "coupling.pairs.lever.wall_slave.stiffness"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of a run of the bench, as far as its rig and its certificate go."""
    directory = tmp_path_factory.mktemp("older")
    rig = load_rig(BENCH)
    certificate = summary_block(session.check(rig, brief=True).certificate, allowed=False)
    summary = summary_of({**SUMMARY, "certificate": certificate.model_dump(), "version": "0.1.0"})
    write_summary(directory, summary[0])
    (directory / "rig.yaml").write_text(resolved_yaml(rig))
    return directory


def against(run: Path, *overrides: str) -> Against:
    rig = load_rig(BENCH, overrides)
    return compare_with_run(run, rig, session.check(rig, brief=True).certificate)


def test_the_same_rig_differs_in_nothing(run: Path) -> None:
    found = against(run, "duration_s=3", "name=other")
    assert (found.version, found.verdicts, found.keys) == ("0.1.0", (), ())
    assert found.alike >= 8


def test_what_is_said_now_and_the_keys_that_keep_what_was(run: Path) -> None:
    found = against(run, f"{STIFF}=30", "rate_hz=900")
    assert ("required: passive", "passed", "failed") in found.verdicts
    assert ("slave wall", "passed", "failed") in found.verdicts
    assert {(one.key, one.then, one.now) for one in found.keys} == {
        (STIFF, "3.0", "30.0"),
        ("rate_hz", "1000.0", "900.0"),
    }


@pytest.mark.slow
def test_the_options_that_are_named_keep_what_was(run: Path) -> None:
    found = against(run, f"{STIFF}=30", "rate_hz=900")
    kept = [shlex.split(one.keeps)[1] for one in found.keys]
    assert against(run, f"{STIFF}=30", "rate_hz=900", *kept).verdicts == ()


def test_keys_that_came_and_went_are_named(run: Path, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text((run / "summary.json").read_text())
    text = (run / "rig.yaml").read_text().replace("  delay_s: ", "  lag_s: ")
    (tmp_path / "rig.yaml").write_text(text)
    found = against(tmp_path)
    by_key = {one.key: one for one in found.keys}
    assert by_key["coupling.lag_s"] == ("coupling.lag_s", "0.02", "", "")
    assert by_key["coupling.delay_s"] == ("coupling.delay_s", "", "0.02", "")


def test_a_directory_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        against(tmp_path)
