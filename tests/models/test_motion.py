from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave.motion import recorded_positions, reference_positions, resample


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def tone(rate: float, hz: float, seconds: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(round(seconds * rate) + 1) / rate
    return t, np.sin(2.0 * math.pi * hz * t + 0.4)


def middle(values: np.ndarray) -> np.ndarray:
    return values[len(values) // 4 : -len(values) // 4]


def test_equal_rates_change_no_bit() -> None:
    t, y = tone(1000.0, 37.0)
    assert np.array_equal(resample(t, y, t), y)
    assert np.array_equal(resample(t, y, t[100:900]), y[100:900])


@pytest.mark.parametrize("rate", [100.0, 700.0, 1000.0, 3000.0])
def test_linear_trends_are_kept(rate: float) -> None:
    t = np.arange(1001) / 1000.0
    new = np.arange(round(rate) + 1) / rate
    assert resample(t, 3.0 - 2.0 * t, new) == pytest.approx(3.0 - 2.0 * new, abs=1e-13)


def test_going_up_interpolates_band_limited() -> None:
    t, y = tone(1000.0, 400.0)
    new, want = tone(3300.0, 400.0)
    error = middle(resample(t, y, new) - want)
    assert np.max(np.abs(error)) < 1e-4
    # The samples themselves are passed through.
    assert np.array_equal(resample(t, y, np.arange(4001) / 2000.0)[::2], y)


def test_going_down_keeps_the_band_and_removes_what_would_alias() -> None:
    t, kept = tone(2000.0, 80.0)
    _, folded = tone(2000.0, 330.0)
    new, want = tone(500.0, 80.0)
    error = middle(resample(t, kept + folded, new) - want)
    assert np.max(np.abs(error)) < 1e-4


def test_ends_do_not_ring() -> None:
    t = np.arange(2001) / 2000.0
    y = 0.1 + np.exp(-3.0 * t) * t
    new = np.arange(301) / 300.0
    got = resample(t, y, new)
    want = 0.1 + np.exp(-3.0 * new) * new
    assert got[0] == pytest.approx(want[0], abs=1e-12)
    assert got[-1] == pytest.approx(want[-1], abs=1e-12)
    assert np.max(np.abs(got - want)) < 3e-3


def test_a_jittering_clock_is_straightened() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(2001) / 1000.0
    t[1:-1] += rng.uniform(-2e-4, 2e-4, 1999)
    y = np.sin(2.0 * math.pi * 5.0 * t)
    new = np.arange(2001) / 1000.0
    assert np.max(np.abs(resample(t, y, new) - np.sin(2.0 * math.pi * 5.0 * new))) < 1e-4


def test_a_cycle_has_no_seam() -> None:
    t = np.arange(2001) / 1000.0
    y = t + 0.2 * np.sin(9.0 * t)  # ends far from where it began
    new = np.arange(10_001) / 1000.0
    got = recorded_positions(t, y, new, True)
    assert np.array_equal(got[:1501], y[:1501])
    acceleration = np.diff(got, 2) * 1e6
    assert np.max(np.abs(acceleration)) < 100.0
    period = 1500
    assert got[period + 600 : 2 * period] == pytest.approx(got[600:period], abs=1e-9)


def test_without_repeat_the_end_is_held() -> None:
    t = np.arange(101) / 100.0
    got = recorded_positions(t, t**2, np.arange(301) / 100.0, False)
    assert np.all(got[100:] == 1.0)


def test_reference_blocks(tmp_path: Path) -> None:
    hold = reference_positions({"type": "hold", "position": 0.2}, 1000.0, 10, tmp_path)
    assert hold.shape == (11,)
    assert np.all(hold == 0.2)
    moves = reference_positions(
        {"type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.3, 1.0], [0.4, 1.0], [0.6, -1.0]]},
        1000.0,
        1000,
        tmp_path,
    )
    assert moves[[0, 100, 200, 300, 400, 500, 600, 1000]] == pytest.approx(
        [0.0, 0.0, 0.5, 1.0, 1.0, 0.0, -1.0, -1.0], abs=1e-12
    )
    one = reference_positions({"type": "minimum_jerk", "waypoints": [[0, 3]]}, 10.0, 4, tmp_path)
    assert np.all(one == 3.0)
    sines = reference_positions(
        {"type": "multisine", "offset": 0.1, "components": [[1, 2, 0], [3, 0.5, 1.0]]},
        100.0,
        200,
        tmp_path,
    )
    t = np.arange(201) / 100.0
    want = 0.1 + 2.0 * np.sin(2 * np.pi * t) + 0.5 * np.sin(6 * np.pi * t + 1.0)
    assert sines == pytest.approx(want, abs=1e-12)


def test_a_recording_is_read_scaled_and_played(tmp_path: Path) -> None:
    rows = "\n".join(f"{5 + k / 100:.2f},{k / 100:.2f},7" for k in range(101))
    write(tmp_path / "hand.csv", f"\ufefftime_s, angle ,other\n{rows}\n\n")
    got = reference_positions(
        {"type": "recording", "file": "hand.csv", "column": "angle", "scale": 2.0, "offset": 1.0},
        100.0,
        50,
        tmp_path,
    )
    assert got == pytest.approx(1.0 + 2.0 * np.arange(51) / 100.0, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,a\n0,1\n1,2\n", "no column 'angle'; available: time_s, a"),
        ("", "available: none, the file is empty"),
        ("time_s,angle\n0,1\n0.1,2\n0.1,3\n", "hand.csv:4: time must increase"),
        ("time_s,angle\n0,1\n0.1,nan\n", "hand.csv:3: column 'angle' holds 'nan'"),
        ("time_s,angle\n0,1\nx,2\n", "hand.csv:3: column 'time_s' holds 'x'"),
        ("time_s,angle\n0,1\n1\n", "hand.csv:3: column 'angle' holds ''"),
        ("time_s,angle\n0,1\n", "at least two rows, it has 1"),
    ],
)
def test_a_bad_recording_is_named(tmp_path: Path, text: str, said: str) -> None:
    write(tmp_path / "hand.csv", text)
    block = {"type": "recording", "file": "hand.csv", "column": "angle"}
    with pytest.raises(ConfigError) as caught:
        reference_positions(block, 100.0, 50, tmp_path)
    assert said in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_a_missing_file_and_wrong_blocks_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gone\.csv: the recording cannot be read"):
        reference_positions(
            {"type": "recording", "file": "gone.csv", "column": "a"}, 100.0, 5, tmp_path
        )
    with pytest.raises(ConfigError, match="reference type 'wobble' is unknown"):
        reference_positions({"type": "wobble"}, 100.0, 5, tmp_path)
    with pytest.raises(ConfigError, match="must increase: 1 s after 1 s"):
        reference_positions(
            {"type": "minimum_jerk", "waypoints": [[1, 0], [1, 2]]}, 100.0, 5, tmp_path
        )
