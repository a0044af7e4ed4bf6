import json
import math

from tautwave.report import compare_reports
from tautwave.report.units import quantity, significant
from tests.report.synthetic import make_run
from tests.report.test_page import Page


def test_two_runs_side_by_side(tmp_path, reported):
    second = make_run(tmp_path / "second", rows=2000, delay=50)
    target = compare_reports(reported, tmp_path / "second", tmp_path / "out")
    assert target == tmp_path / "out" / "compare.html"
    page = Page(target)
    assert len(page.images) == 3
    assert all(source.startswith("data:image/png;base64,") for source in page.images)
    first = json.loads((reported / "summary.json").read_text())
    a, b = (s["pairs"]["wrist"]["position_error"]["rms"] for s in (first, second))
    for shown in (quantity(a, "m"), quantity(b, "m"), quantity(b - a, "m"), significant(b / a, 3)):
        assert shown in page.text
    assert "coupling.delay_s" in page.text
    assert "master.axes" not in page.text.split("Every difference")[0]


def test_a_run_against_itself_differs_in_nothing(tmp_path, reported):
    page = Page(compare_reports(reported, reported, tmp_path / "same.html"))
    assert page.text.count("Nothing.") == 2


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
    assert page.images == []
    assert math.isclose(page.text.count("There are no figures"), 2)
