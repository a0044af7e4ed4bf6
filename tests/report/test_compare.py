import json
import math

import pytest

from tautwave.report import compare_reports
from tautwave.report.units import quantity, significant
from tests.report.synthetic import make_run
from tests.report.test_page import Page


@pytest.mark.slow
def test_two_runs_side_by_side(tmp_path, reported):
    second = make_run(tmp_path / "second", rows=2000, delay=50)
    target = compare_reports(reported, tmp_path / "second", tmp_path / "out")
    assert target == tmp_path / "out" / "compare.html"
    page = Page(target)
    assert page.figures == 3
    assert len(list(tmp_path.rglob("compare-*.svg"))) == 3
    first = json.loads((reported / "summary.json").read_text())
    a, b = (s["pairs"]["wrist"]["position_error"]["rms"] for s in (first, second))
    for shown in (quantity(a, "m"), quantity(b, "m"), quantity(b - a, "m"), significant(b / a, 3)):
        assert shown in page.text
    assert "coupling.delay_s" in page.text
    assert "master.axes" not in page.text.split("All differences")[0]


@pytest.mark.slow
def test_a_run_against_itself_differs_in_nothing(tmp_path, reported):
    page = Page(compare_reports(reported, reported, tmp_path / "same.html"))
    assert page.text.count("Nothing.") == 2


def test_every_difference_of_the_summaries_is_that_of_two_runs(tmp_path):
    for name, more in (("a", {}), ("b", {"version": "0.2.0", "duration_s": 7.5})):
        make_run(tmp_path / name, rows=300, **more)
        (tmp_path / name / "recording.mcap").unlink()
    page = Page(compare_reports(tmp_path / "a", tmp_path / "b", tmp_path))
    shown = page.text.split("All differences between the summaries")[1]
    rows = ["version", "0.1.0", "0.2.0", "duration_s", "0.3", "7.5"]
    assert shown.split() == ["key", "a", "b", *rows]


def test_ratios_of_rounding_are_not_ratios(tmp_path):
    for name, residual, gap in (("a", -1.6e-22, 0.0), ("b", 2.8e-14, 2e-3)):
        energy = {"gross_flow": 4.0, "residual": residual, "sensing_gap": gap, "generated": 1e-3}
        make_run(tmp_path / name, rows=300, energy_j=energy)
        (tmp_path / name / "recording.mcap").unlink()
    text = Page(compare_reports(tmp_path / "a", tmp_path / "b", tmp_path)).text
    books = text.split("Books and timing")[1]
    residual = books.split("residual")[1].split("generated")[0].split()
    assert residual[-2:] == ["both", "zero"]
    assert books.count("both zero") == 1


@pytest.mark.slow
def test_pairs_that_only_one_run_has(tmp_path, reported):
    make_run(tmp_path / "other", pairs=("elbow",), rows=300)
    page = Page(compare_reports(reported, tmp_path / "other", tmp_path))
    assert "Only in first: wrist." in page.text
    assert "Only in other: elbow." in page.text


def test_without_recordings_the_summaries_are_compared(tmp_path, reported):
    for name in ("a", "b"):
        make_run(tmp_path / name, rows=300)
        (tmp_path / name / "recording.mcap").unlink()
    page = Page(compare_reports(tmp_path / "a", tmp_path / "b", tmp_path))
    assert page.figures == 0
    assert math.isclose(page.text.count("There are no figures"), 2)


@pytest.mark.slow
def test_what_the_operator_feels_stands_side_by_side(tmp_path):
    """Of real rigs: the figures are simulated from the rig that a run keeps."""
    from tautwave.certificate.haptics.feel import rig_feel
    from tautwave.config import load_rig, resolved_yaml
    from tests.rigs.row_hashes import ROOT

    felt = []
    for name, delay in (("a", 0.0), ("b", 0.02)):
        make_run(tmp_path / name, pairs=("lever",), rows=300)
        rig = load_rig(ROOT / "configs" / "bench-1dof-loopback.yaml", [f"coupling.delay_s={delay}"])
        (tmp_path / name / "rig.yaml").write_text(resolved_yaml(rig))
        (tmp_path / name / "recording.mcap").unlink()
        felt.append(rig_feel(rig)[0][0])
    text = Page(compare_reports(tmp_path / "a", tmp_path / "b", tmp_path)).text
    shown = text.split("What the operator feels of the rig")[1].split("Energy of each")[0]
    assert "felt stiffness of 250 N m/rad" in shown
    for one in felt:
        assert quantity(one.stiffness, "N m/rad") in shown
        assert quantity(one.drag, "N m") in shown
    assert felt[0].stiffness > 2.0 * felt[1].stiffness
