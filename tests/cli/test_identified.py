"""What `identify` prints of a fit, in the units of its axis, and leaves behind."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.cli.terminal.identified import device_sections, lever_sections, noise_sections
from tautwave.cli.terminal.moving import moved
from tautwave.config import load_rig
from tautwave.errors import ConfigError

UNITS = {"rad": ("N m", "kg m^2", "N m s/rad"), "m": ("N", "kg", "N s/m")}
BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
PICTURE = Path("found/identification.png")


def estimate(value: float) -> Any:
    return SimpleNamespace(value=value, lower=0.9 * value, upper=1.1 * value)


def fit(**more: Any) -> Any:
    return SimpleNamespace(
        inertia=estimate(1.5e-3), damping=estimate(0.015), coulomb=estimate(0.025),
        bias=estimate(0.002), residual_rms=0.00123, explained=0.998, peak_velocity=3.2, weight=None,
        **more,
    )  # fmt: skip


def rows_of(sections: list[Any]) -> dict[str, tuple[str, ...]]:
    return {row[0]: tuple(row[1:]) for section in sections for row in section.rows}


def assert_fit(rows: dict[str, tuple[str, ...]], place: str) -> None:
    effort, mass, damping = UNITS[place]
    assert rows["inertia"] == ("0.0015", "0.00135 to 0.00165", mass)
    assert rows["viscous damping"] == ("0.015", "0.0135 to 0.0165", damping)
    assert rows["Coulomb friction"] == ("0.025", "0.0225 to 0.0275", effort)
    assert rows["constant external effort"] == ("0.002", "0.0018 to 0.0022", effort)
    assert rows["residual, rms"] == ("0.00123", "0.20% of variance", effort)


@pytest.mark.parametrize("place", UNITS)
def test_a_recorded_lever(place: str) -> None:
    series = SimpleNamespace(
        position=[0.0] * 8000, source="bench.csv", position_name="x_s", effort_name="tau_s"
    )
    result = SimpleNamespace(
        fit=fit(outside=estimate(2.0)), series=series, quantum=2.094e-5, noise=estimate(1e-5),
        snippet="inertia: 1\ndamping: 2", notes=["slow"], outside_name="f_s",
        sensor_offset=estimate(0.05),
    )  # fmt: skip
    sections = lever_sections(result, (place, UNITS[place][0]), PICTURE)
    rows = rows_of(sections)
    assert_fit(rows, place)
    assert rows["effort per unit of f_s"] == ("2", "1.8 to 2.2", UNITS[place][0])
    assert rows["reading at zero effort"][0] == "0.05"
    assert rows["encoder step"] == ("2.094e-05", "", place)
    assert {"inertia: 1", "damping: 2", "slow", "found/identification.json"} <= rows.keys()
    assert sections[0].title == f"bench.csv: x_s, 8000 samples, up to 3.2 {place}/s"
    result.quantum, result.fit.outside = 0.0, None
    rows = rows_of(lever_sections(result, (place, UNITS[place][0]), PICTURE))
    assert rows["encoder step"][0] == "none"
    assert "effort per unit of f_s" not in rows


def test_noise_is_as_like_the_sample_before_as_its_first_lag_says() -> None:
    result = SimpleNamespace(
        fit=SimpleNamespace(
            quantum=2e-5, levels=7, deviation=estimate(1e-5), drift=0.0,
            autocorrelation=[0.75, 0.5, 0.25], lag_error=0.01, samples=8000,
        ),
        series=SimpleNamespace(period=1e-3, source="still.csv", position_name="x"),
        as_dict=lambda: {"snippet": "position_noise: 1e-5"}, notes=[],
    )  # fmt: skip
    rows = rows_of(noise_sections(result, "rad", PICTURE))
    assert rows["autocorrelation, lag 1"][:2] == ("0.750", "+- 0.01 at most")
    result.fit.autocorrelation = None  # too few steps of the encoder to tell
    assert "autocorrelation, lag 1" not in rows_of(noise_sections(result, "rad", PICTURE))


@pytest.mark.parametrize("place", UNITS)
def test_a_device_that_was_shaken(place: str) -> None:
    result = SimpleNamespace(
        fit=fit(), axis="slave.wrist", duration_s=8.0, notes=[], directory=Path("found"),
        as_dict=lambda: {"snippet": "inertia: 1\ndamping: 2"},
    )  # fmt: skip
    sections = device_sections(result, (place, UNITS[place][0]), PICTURE)
    assert_fit(rows_of(sections), place)
    assert sections[0].title == f"slave.wrist: shaken for 8 s, up to 3.2 {place}/s"
    assert sections[2].title == "For slave.axes.wrist in the rig file"


@pytest.mark.parametrize("writes", [False, True])
def test_a_rig_that_is_refused_leaves_no_directory_unless_something_is_in_it(
    tmp_path: Path, writes: bool
) -> None:
    out = tmp_path / "found"
    options = {
        "clock": "fake", "simulate": (), "attach": False, "as_json": True, "out": out,
        "duration": 1.0, "allow_uncertified": False,
    }  # fmt: skip

    def move() -> None:
        with moved(load_rig(BENCH), options, "identify") as (where, given):
            assert where == given["out"] == out
            assert out.is_dir()
            if writes:
                (out / "recording.mcap").touch()
            raise ConfigError("refused")

    with pytest.raises(ConfigError, match="refused"):
        move()
    assert out.exists() == writes
