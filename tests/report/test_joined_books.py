"""Books of two sites whose encoders are noisy: what the motors did not give is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.report.joined import joined_page, joined_summary
from tautwave.report.run.rundir import Run
from tautwave.summary import summary_of

ROWS = 100
RISE = np.linspace(0.0, 1.0, ROWS)


def site(side: str, booked: float, true: float, ratio: float = 1.0, simulated: bool = True) -> Run:
    """Return a run of one site whose port booked that much entering, of which `true` did [J]."""
    columns: Any = {
        f"{side}.lever.port_energy": booked * RISE,
        f"{side}.lever.gross_flow": RISE,
        "lever.port.absorbed": booked * RISE,
        "lever.port.stored": 0.0 * RISE,
        "lever.port.dissipated": booked * RISE,
    }
    if simulated:
        columns[f"plant.{side}.lever.motor_work"] = -true * RISE * ratio
    rig: Any = {"name": "two", "sites": {"here": side}, "coupling": {"pairs": {"lever": {}}}}
    summary: Any = {"pairs": {"lever": {"power_ratio": ratio, "motors": {"worst": -booked}}}}
    return Run(Path(side), rig, "", summary_of(summary)[0], tuple(columns), ROWS, whole=columns)


def shown(master: Run, slave: Run, folder: Path) -> tuple[dict[str, Any], str]:
    found = joined_summary(master, slave)
    pair: dict[str, Any] = found["pairs"]["lever"]
    return pair, " ".join(joined_page(master, slave, found, folder).split())


def test_energy_that_only_noisy_encoders_saw_is_named_the_sensing_gap(tmp_path: Path) -> None:
    master, slave = site("master", -0.030, 0.001), site("slave", -0.027, 0.002, ratio=4.0)
    pair, page = shown(master, slave, tmp_path)
    assert pair["dissipated"] == pytest.approx(-0.057)
    assert pair["sensing_gap"] == pytest.approx(-0.060)
    assert pair["residual"] == pytest.approx(0.0, abs=1e-12)
    assert "lever: of −57 mJ dissipated, −60 mJ are the sensing gap" in page
    assert "no energy of the motors; without it 3 mJ." in page


@pytest.mark.parametrize(
    ("booked", "true", "simulated", "gap"),
    [
        (-0.03, -0.03, True, 0.0),  # a motor that did give it
        (-0.03, -0.02, True, -0.02),
        (0.03, 0.05, True, -0.04),
        (-0.03, 0.0, False, None),  # hardware: nobody knows
    ],
)
def test_what_motors_gave_is_not_excused(
    tmp_path: Path, booked: float, true: float, simulated: bool, gap: float | None
) -> None:
    master, slave = (site(one, booked, true, simulated=simulated) for one in ("master", "slave"))
    pair, page = shown(master, slave, tmp_path)
    assert pair["sensing_gap"] == (None if gap is None else pytest.approx(gap))
    assert "without it" not in page
    assert "lever: of" not in page


@pytest.mark.parametrize(("rig_of_slave", "same"), [("one", True), ("other", False)])
def test_halves_of_two_rigs_are_said_to_be_so(
    tmp_path: Path, rig_of_slave: str, same: bool
) -> None:
    runs = []
    for side, shared in (("master", "one"), ("slave", rig_of_slave)):
        run = site(side, 0.03, 0.03)
        stated: Any = {
            "pairs": {"lever": {"power_ratio": 1.0}},
            "link": {"site": side, "shared": shared},
        }
        run.result = summary_of(stated)[0]
        runs.append(run)
    books = joined_summary(runs[0], runs[1])
    assert books["same_rig"] is same
    page = " ".join(joined_page(runs[0], runs[1], books, tmp_path).split())
    assert ("Keys that must match on both sites differ in the summaries." in page) is not same
