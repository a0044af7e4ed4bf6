"""`identify RECORDING --chain`: the bodies of an arm whose efforts have a closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tests.identify.two_links import TwoLinks, recorded

ARM = TwoLinks()
COLUMNS = ("shoulder.position", "elbow.position", "shoulder.effort", "elbow.effort")


def written(
    folder: Path, arm: TwoLinks = ARM, believed: TwoLinks | str = ARM, **how: Any
) -> tuple[Path, Path]:
    """Write a recording, and the URDF that is believed."""
    sign = how.pop("sign", 1.0)
    t, q, efforts = recorded(arm, **how)
    table = np.column_stack([t, q, sign * efforts])
    file, urdf = folder / "arm.csv", folder / "arm.urdf"
    np.savetxt(file, table, delimiter=",", header=",".join(("time_s", *COLUMNS)), comments="")
    urdf.write_text(believed if isinstance(believed, str) else believed.urdf)
    return file, urdf


def identified(file: Path, urdf: Path, *words: str) -> dict[str, Any]:
    out = ("--out", str(file.parent / "found"))
    done = CliRunner().invoke(
        main, ["identify", str(file), "--chain", str(urdf), *out, "--json", *words]
    )
    assert done.exit_code == 0, done.output
    found: dict[str, Any] = json.loads(done.output)
    return found


def values_of(found: dict[str, Any]) -> dict[str, float]:
    return {one["name"].split("(")[0] + one["name"].split("(")[1][0]: one["found"]["value"]
            for one in found["base_parameters"]}  # fmt: skip


BELIEVED = {
    "right": ARM,
    "half as heavy": TwoLinks(m1=0.6, m2=0.35, i1=0.01, i2=0.005),
    "no masses": TwoLinks(m1=0.0, m2=0.0, i1=0.0, i2=0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("believed", BELIEVED)
def test_base_parameters_are_those_of_the_closed_form(tmp_path: Path, believed: str) -> None:
    """Whatever is believed, and within the intervals that are stated."""
    found = identified(*written(tmp_path, believed=BELIEVED[believed]))
    values = values_of(found)
    true = ARM.base
    assert values["mxs"] == pytest.approx(true["mx1"], rel=2e-3)
    assert abs(values["mxe"]) == pytest.approx(true["mx2"], rel=2e-3)
    assert values["izzs"] == pytest.approx(true["izz1"], rel=5e-3)
    assert values["izze"] == pytest.approx(true["izz2"], rel=1e-2)
    assert abs(values["mys"]) + abs(values["mye"]) < 2e-3
    for name in ("shoulder", "elbow"):
        assert found["friction"][name]["coulomb"]["value"] == pytest.approx(0.2, abs=0.01)
        assert found["friction"][name]["damping"]["value"] == pytest.approx(0.1, abs=0.01)
    assert found["explained"] > 0.99
    # Bodies say the same: they leave no more of the efforts.
    for name, left in found["residual_rms"].items():
        assert found["residual_rms_of_bodies"][name] < 1.05 * left + 1e-4
    assert len(found["snippet"].splitlines()) == 2


def test_bodies_exist_and_say_what_the_motion_says(tmp_path: Path) -> None:
    found = identified(*written(tmp_path, believed=BELIEVED["half as heavy"]))
    upper, lower = found["bodies"]
    assert upper["joint"] == "shoulder"
    for body in (upper, lower):
        principal = np.linalg.eigvalsh(np.array(body["inertia"]))
        assert body["mass"]["value"] > 0.0
        assert principal[0] > 0.0
        assert principal[2] <= principal[0] + principal[1] + 1e-12  # the triangle of inertias
    moment = upper["mass"]["value"] * upper["centre"][0] + ARM.l1 * lower["mass"]["value"]
    assert moment == pytest.approx(ARM.base["mx1"], rel=5e-3)
    assert lower["mass"]["value"] * lower["centre"][0] == pytest.approx(ARM.base["mx2"], rel=5e-3)
    # In the frame of the link, not of the joint: x is along the link in both.
    assert upper["centre"][0] > 0.0


@pytest.mark.slow
def test_what_the_motion_does_not_tell_is_said(tmp_path: Path) -> None:
    """Slow motion tells weights, and hardly an inertia."""
    file, urdf = written(tmp_path, noise=2e-4)
    t, *rest = np.loadtxt(file, delimiter=",", skiprows=1).T
    slow = np.column_stack([20.0 * t, *rest])
    # The same postures 20 times as slowly: accelerations are 400 times smaller.
    q = slow[:, 1:3]
    v, a = (np.gradient(q, slow[:, 0], axis=0), np.zeros_like(q))
    slow[:, 3:5] = ARM.efforts(q, 0.0 * v, a) + 0.2 * np.sign(v)
    slow[:, 3:5] += np.random.default_rng(1).normal(scale=0.05, size=q.shape)
    np.savetxt(file, slow, delimiter=",", header=",".join(("time_s", *COLUMNS)), comments="")
    found = identified(file, urdf)
    told = {one["name"]: one["told"] for one in found["base_parameters"]}
    assert told["mx(shoulder) + 0.4 m(elbow)"]
    assert not told["izz(elbow)"]
    assert any("base parameters are as believed" in note for note in found["notes"])


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_efforts_of_the_other_sign_are_turned_and_said(tmp_path: Path, sign: float) -> None:
    found = identified(*written(tmp_path, sign=sign))
    assert found["effort_turned"] == (sign < 0.0)
    assert abs(values_of(found)["mxs"]) == pytest.approx(ARM.base["mx1"], rel=2e-3)
    assert any("sign was inverted" in note for note in found["notes"]) == (sign < 0.0)


@pytest.mark.slow
def test_an_effort_in_another_unit_is_doubted_and_not_to_be_pasted(tmp_path: Path) -> None:
    """One joint in mN m, the other in N m: no bodies make both."""
    file, urdf = written(tmp_path)
    table = np.loadtxt(file, delimiter=",", skiprows=1)
    table[:, 4] *= 1000.0
    np.savetxt(file, table, delimiter=",", header=",".join(("time_s", *COLUMNS)), comments="")
    found = identified(file, urdf)
    assert "nothing here is credible" in found["snippet"]
    assert any(note.startswith("Doubtful") or "Doubtful" in note for note in found["notes"])


@pytest.mark.slow
def test_a_hand_in_the_way_is_doubted(tmp_path: Path) -> None:
    file, urdf = written(tmp_path)
    table = np.loadtxt(file, delimiter=",", skiprows=1)
    table[:, 4] += 2.0 * np.sin(3.0 * table[:, 0])
    np.savetxt(file, table, delimiter=",", header=",".join(("time_s", *COLUMNS)), comments="")
    found = identified(file, urdf)
    assert "nothing here is credible" in found["snippet"]
    assert any("something else" in note for note in found["notes"])


def test_columns_are_named_by_joints_or_from_base_to_tip(tmp_path: Path) -> None:
    file, urdf = written(tmp_path)
    text = file.read_text().replace("shoulder.", "a_").replace("elbow.", "b_")
    file.write_text(text)
    command = ["identify", str(file), "--chain", str(urdf), "--out", str(tmp_path / "x")]
    done = CliRunner().invoke(main, command)
    assert (done.exit_code, done.output.count("\n")) == (2, 1)
    assert "which column is the position of joint shoulder?" in done.output
    given = ("--position", "a_position,b_position", "--effort", "a_effort,b_effort")
    found = identified(file, urdf, *given)
    assert found["joints"]["elbow"] == ["b_position", "b_effort"]
    for words, part in (
        (("--position", "a_position"), "1 columns for 2 joints"),
        (("--position", "a_position,c"), "there is no column 'c'"),
        (("--lever",), "--lever cannot be combined with --chain"),
        (("--tip", "nowhere"), "nowhere"),
    ):
        done = CliRunner().invoke(main, [*command, *given[2:], *words])
        assert done.exit_code == 2, done.output
        assert part in done.output
    missing = ["identify", str(file), "--chain", "none.urdf"]
    assert "no such file" in CliRunner().invoke(main, missing).output
    assert "--tip requires --chain" in CliRunner().invoke(
        main, ["identify", str(file), "--tip", "x"]
    ).output  # fmt: skip


@pytest.mark.slow
def test_the_screen_has_sums_bodies_and_notes(tmp_path: Path) -> None:
    file, urdf = written(tmp_path)
    words = ["identify", str(file), "--chain", str(urdf), "--out", str(tmp_path / "x")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "mx(shoulder) + 0.4 m(elbow)" in done.output
    assert "No motion tells single masses apart" in " ".join(done.output.split())
