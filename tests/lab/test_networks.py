"""The networks suite: what it measures is there; speed itself is printed, never asserted."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from tautwave_scenes.networks.pruning import prune
from tests.lab.networks import chain_network, networks


@pytest.mark.nightly
@pytest.mark.slow  # numba compiles for ten seconds
def test_the_suite_has_its_tables_and_goals():
    pytest.importorskip("numba")
    suite = networks(rounds=1, sizes=(1, 10, 100, 200)).as_dict()
    assert [len(table["rows"]) for table in suite["tables"]] == [4, 5]
    assert all(row["step_ns"] > 0.0 for table in suite["tables"] for row in table["rows"])
    names = [goal["name"] for goal in suite["goals"]]
    assert names[:2] == [
        "granular scene, symplectic, compiled",
        "granular scene, discrete_gradient, compiled",
    ]
    assert all(goal["measured"] > 0.0 for goal in suite["goals"])
    json.dumps(suite)


def test_what_is_measured_is_right():
    assert len(prune(chain_network(10, 1000)).network.masses) == 10


def test_the_command_is_there():
    from tests.lab.command import lab

    reported = CliRunner().invoke(lab, ["--help"])
    assert "networks" in reported.output
