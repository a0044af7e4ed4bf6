import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tautwave.cli.terminal.summary import summary_sections
from tautwave.errors import RecordingError
from tautwave.report import write_report
from tautwave.report.html import image
from tautwave.report.run.loading import load_run
from tautwave.report.run.tables import loop_table
from tautwave.report.run.verdicts import verdicts as verdicts_of
from tautwave.report.units import MISSING, microseconds, quantity, ratio
from tautwave.summary import Summary
from tests.report.synthetic import make_columns, make_run, write_recording

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """Text, images and every attribute; fails on tags that do not nest."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.images: list[str] = []
        self.tags: set[str] = set()
        self.figures = 0
        self.sources: list[str] = []
        self.identifiers: list[str] = []
        self.links: list[str] = []
        self.raw = path.read_text(encoding="utf-8")
        self.feed(self.raw)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        shown = dict(attrs)
        self.tags.add(tag)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "img":
            assert shown["alt"]
            self.images.append(shown["src"])
        self.figures += tag == "svg"
        if tag in ("audio", "source"):
            self.sources.append(shown.get("src") or shown["srcset"])
        if "id" in shown:
            self.identifiers.append(shown["id"])
        if tag == "a":
            self.links.append(shown["href"])
        assert not any(name.startswith("on") for name in shown)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text += data + "\n"


def numbers_in(summary):
    """Every measured number of a summary, as the page has to show it."""
    for pair in summary["pairs"].values():
        for error, unit in (("position_error", "m"), ("effort_error", "N")):
            for key in ("rms", "max"):
                yield quantity(pair[error][key], unit)
        yield quantity(pair["expected_offset"], "m")
        for element in pair["elements"].values():
            for key in ("absorbed", "stored", "dissipated", "generated"):
                yield quantity(element[key], "J")
    for key, value in summary["energy_j"].items():
        yield quantity(value, "J", 3 if key == "residual" else 4)
    yield ratio(summary["energy_j"]["residual"] / summary["energy_j"]["gross_flow"])
    for name in ("period_us", "lateness_us", "compute_us"):
        for key in ("p50", "p99", "p999", "max"):
            yield microseconds(summary[name][key])
    for axis in summary["axes"].values():
        yield str(axis["lost"])
        yield str(axis["late"])
        yield from axis["faults"]


def test_one_file_with_every_image_inside(reported):
    page = Page(reported / "report.html")
    assert page.figures == 6
    assert not page.images
    assert not page.tags & {"script", "link", "iframe", "object"}
    fetched = page.raw.replace("http://www.w3.org/2000/svg", "")
    fetched = fetched.replace("http://www.w3.org/1999/xlink", "")
    assert not re.search(r"https?:|url\((?!#)|@import", fetched)
    assert (reported / "report.html").stat().st_size < 3_000_000
    assert all(link[1:] in page.identifiers for link in page.links)
    assert len(set(page.identifiers)) == len(page.identifiers)


def test_the_figures_stand_beside_the_page_too(reported):
    names = {path.name for path in reported.glob("*.svg")}
    parts = ("tracking", "effort", "contact", "waves", "energy")
    assert names == {f"wrist-{part}.svg" for part in parts} | {"timing.svg"}
    for name in names:
        assert "prefers-color-scheme: dark" in (reported / name).read_text()
    assert not list(reported.glob("*.part"))


def test_every_number_is_the_summarys(reported):
    page = Page(reported / "report.html")
    summary = json.loads((reported / "summary.json").read_text())
    for shown in numbers_in(summary):
        assert shown in page.text
    assert summary["command"] in page.text
    assert summary["outcome"]["sentence"] in page.text
    assert "2026-03-02 14:05:11 UTC" in page.text
    assert all(sentence in page.text for sentence in summary["realtime"])
    assert "wall_master of wrist" in page.text
    assert "wave_impedance: 6.0" in page.text  # the resolved rig


def test_a_certificate_that_is_not_evaluated_never_passes(reported):
    page = Page(reported / "report.html")
    assert "Not yet evaluated" in page.text
    assert "passed" not in page.text.lower()


def test_what_a_driver_found_and_set_is_reported(tmp_path, columns):
    make_summary(tmp_path, columns)
    path = tmp_path / "summary.json"
    summary = json.loads(path.read_text())
    summary["buses"] = {"can": {"notes": ["6072:00 = 900 <read back>"]}, "none": {"notes": []}}
    path.write_text(json.dumps(summary))
    page = Page(write_report(tmp_path))
    assert "Bus can: found and set before enabling" in page.text
    assert "6072:00 = 900 <read back>" in page.text
    assert "Bus none" not in page.text


@pytest.mark.slow
def test_text_of_users_is_escaped(tmp_path):
    evil = "<script>alert('x')</script>"
    make_run(
        tmp_path,
        pairs=("a$_{b",),
        rows=300,
        rig_top={"name": evil},
        rig=evil,
        command=f"tautwave run {evil}",
        left_out=[f"{evil}: {evil}"],
        outcome={"kind": "fault", "sentence": evil},
        realtime=[evil],
        certificate={"passed": False, "verdicts": [{"name": evil, "passed": None}]},
    )
    page = Page(write_report(tmp_path))
    assert "script" not in page.tags
    assert page.text.count(evil) >= 7


def make_summary(directory, columns, **top):
    """A run without its recording: a page without figures is made in no time."""
    shown = make_run(directory, columns={n: c[:100] for n, c in columns.items()}, **top)
    (directory / "recording.mcap").unlink()
    return shown


def test_a_safety_stop_is_a_banner(tmp_path, columns):
    sentence = "slave.wrist left its position range at 2.9 s."
    make_summary(tmp_path, columns, outcome={"kind": "safety_stop", "sentence": sentence})
    page = Page(write_report(tmp_path))
    assert 'class="banner bad"' in page.raw
    assert sentence in page.text


def test_a_fault_before_the_first_cycle_leaves_out_what_never_was(tmp_path, columns):
    sentence = "slave.wrist: EMCY 0x2310 while enabling."
    never = {"cycles": 0, "missed_cycles": 0}
    outcome = {"kind": "fault", "sentence": sentence}
    make_summary(tmp_path, columns, outcome=outcome, energy_j={}, **never)
    page = Page(write_report(tmp_path))
    assert sentence in page.text
    assert "ended before its first cycle, so nothing was recorded" in page.text
    assert "not recorded" not in page.text.split("Rig and reproduction")[0]
    for title in ("Pair wrist", "Energy books", "Tracking", "Precision", "Timing"):
        assert title not in page.text
    assert "Axes" in page.text
    lines = [section.title for section in summary_sections("a", Summary(cycles=0), tmp_path, 5)]
    assert lines[1:] == ["Devices", "Unused elements", "Files"]


def test_the_element_that_generated_most_is_named(tmp_path, columns):
    shown = make_summary(tmp_path, columns)
    amounts = {"port_master": 1e-4, "line": 3e-2, "port_slave": 2e-3, "wall_slave": 0.0}
    elements = shown["pairs"]["wrist"]["elements"]
    for name, amount in amounts.items():
        elements[name]["generated"] = amount
    (tmp_path / "summary.json").write_text(json.dumps(shown))
    text = " ".join(Page(write_report(tmp_path)).text.split())
    assert "most of it 30 mJ in line of wrist" in text


def test_open_books_are_called_open(tmp_path, columns):
    energy = {"gross_flow": 1.0, "residual": 2e-9, "generated": 0.0}
    make_summary(tmp_path, columns, energy_j=energy)
    assert "Not closed: residual 2" in Page(write_report(tmp_path)).text
    energy["residual"] = float("nan")
    make_summary(tmp_path, columns, energy_j=energy)
    assert "Not closed" in Page(write_report(tmp_path)).text


def test_a_simulated_clock_has_no_histograms(tmp_path, columns):
    make_summary(tmp_path, columns, clock="fake")
    clock = ("time_s", "lateness_us", "compute_us", "skipped_slots")
    write_recording(tmp_path / "recording.mcap", {name: columns[name][:100] for name in clock})
    page = Page(write_report(tmp_path))
    assert not (tmp_path / "timing.svg").exists()
    assert "on the simulated clock" in page.text
    assert "--clock fake" in page.text


@pytest.mark.slow
@pytest.mark.usefixtures("unpainted")
def test_several_pairs_are_folded_below_an_overview_and_flat_ones_named(tmp_path):
    pairs = ("wrist", "elbow", "knee", "hip")
    columns = make_columns(pairs, rows=300)
    for name, values in columns.items():
        if (".knee." in name or name.startswith(("knee.", "hip."))) and ".valid" not in name:
            values[:] = 0.0
        if ".hip." in name and ".valid" not in name:
            values[:] = 0.0
    make_run(tmp_path, pairs=pairs, columns=columns)
    page = Page(write_report(tmp_path))
    assert (tmp_path / "pairs.svg").exists()
    assert "nothing moved and nothing was transmitted: knee, hip" in page.text
    folded = page.raw[page.raw.index("Pairs</h2>") : page.raw.index("Energy books</h2>")]
    assert folded.count("<details>") == len(pairs)
    assert folded.index("nothing moved") < folded.index("<details>")
    assert not list(tmp_path.glob("knee-*.svg"))
    assert "stays constant: position and position error, effort transmitted" in page.text
    assert {path.name for path in tmp_path.glob("elbow-*.svg")} >= {"elbow-tracking.svg"}


def test_the_page_is_readable_in_the_dark(reported):
    page = Page(reported / "report.html")
    dark = page.raw.split("@media screen and (prefers-color-scheme: dark)", 1)[1]
    assert "--paper:" in dark
    assert "color-scheme: light dark" in page.raw
    drawn = page.raw[page.raw.index("<body>") :]
    for colour in set(re.findall(r'(?:fill|stroke)="(#[0-9a-f]{6})"', drawn)):
        assert f'figure [fill="{colour}"]' in dark, colour


def test_a_picture_without_a_dark_one_is_turned_by_the_browser(reported):
    assert 'class="drawn turned"' in image(b"GIF89a", "gif", "it")
    two = image(b"light", "png", "it", dark=b"dark")
    assert "turned" not in two
    assert "<source" in two
    dark = (reported / "report.html").read_text().split("@media screen and (prefers-color-", 1)[1]
    assert "img.turned { filter: invert(" in dark


def test_conditions_of_several_verdicts_are_read_once(tmp_path, columns):
    shown = {"state": "conditional", "reason": "it gives back what it took.", "conditions": ["x"]}
    same = {"passive": shown, "coupled_stable": shown, "other": {**shown, "conditions": []}}
    for verdicts, times in ((same, 1), ({**same, "last": {**shown, "conditions": ["x", "y"]}}, 3)):
        make_run(tmp_path, columns=columns, certificate={"passed": True, "verdicts": verdicts})
        (found,) = [v for v in verdicts_of(load_run(tmp_path)) if v.topic == "Certificate"]
        text = " ".join(found.sentences)
        assert text.count("if x") == times
        assert "passive: conditional; it gives back what it took" in text


@pytest.mark.parametrize(
    ("passed", "says"),
    [(True, "Passed."), (False, "Not passed."), (None, "Not yet evaluated; ")],
)
def test_the_verdict_on_the_certificate_begins_with_how_it_ended(tmp_path, columns, passed, says):
    make_run(tmp_path, columns=columns, certificate={"passed": passed})
    (found,) = [v for v in verdicts_of(load_run(tmp_path)) if v.topic == "Certificate"]
    assert found.sentences[0].startswith(says)


def without(columns, *parts):
    return {name: c for name, c in columns.items() if not any(part in name for part in parts)}


@pytest.mark.usefixtures("unpainted")
def test_hardware_without_truth_or_walls(tmp_path, columns):
    few = without(columns, "true.", "plant.", "wall_", "gross_flow", "port_energy")
    make_run(tmp_path, rows=3000, delay=20, columns={**few, **_accounts(columns)})
    (tmp_path / "rig.yaml").unlink()
    page = Page(write_report(tmp_path))
    assert "Contacts cannot be determined" in page.text
    assert "Plant, from the simulation" not in page.text
    assert not (tmp_path / "wrist-contact.svg").exists()


def _accounts(columns):
    return {name: c for name, c in columns.items() if name.startswith("wrist.wall_slave")}


def test_no_line_means_no_expected_offset(tmp_path, columns):
    shown = make_summary(tmp_path, columns, delay=0)
    for pair in shown["pairs"].values():
        pair.pop("expected_offset")
        pair.pop("coupling_delay_s")
    (tmp_path / "summary.json").write_text(json.dumps(shown))
    page = Page(write_report(tmp_path))
    assert "standing offset" not in page.text.split("Pair wrist")[0]
    assert "no delay line" in page.text


@pytest.mark.usefixtures("unpainted")
def test_without_summary_the_recording_speaks(tmp_path, columns):
    shown = make_run(tmp_path, columns=columns)
    (tmp_path / "summary.json").unlink()
    page = Page(write_report(tmp_path))
    assert "summary.json is missing" in page.text
    assert "outcome not recorded" in page.text
    pair = shown["pairs"]["wrist"]
    assert quantity(pair["position_error"]["rms"], "m") in page.text
    assert quantity(pair["elements"]["line"]["stored"], "J") in page.text
    assert microseconds(shown["compute_us"]["p99"]) in page.text
    assert "Closed: residual" in page.text


@pytest.mark.usefixtures("unpainted")
def test_a_recording_cut_off_is_shown_as_far_as_it_goes(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    write_recording(tmp_path / "recording.mcap", columns, finish=False)
    whole = (tmp_path / "recording.mcap").read_bytes()
    (tmp_path / "recording.mcap").write_bytes(whole[: int(0.6 * len(whole))])
    page = Page(write_report(tmp_path))
    assert "The recording is cut short" in page.text
    assert page.figures == 6


def test_a_summary_alone_makes_a_page_without_figures(tmp_path, columns):
    make_summary(tmp_path, columns)
    page = Page(write_report(tmp_path))
    assert "There are no figures" in page.text
    assert page.figures == 0


@pytest.mark.parametrize("content", [b"", b"not a recording", None])
def test_nothing_to_report_on_is_one_sentence(tmp_path, content):
    if content is not None:
        (tmp_path / "recording.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match="nothing to report"):
        write_report(tmp_path)


def test_an_empty_summary_is_not_taken_for_a_good_run(tmp_path, columns):
    make_summary(tmp_path, columns)
    (tmp_path / "summary.json").write_text('{"rig": "x"}')
    page = Page(write_report(tmp_path))
    assert not re.search(r"\bOK\b", page.text)
    assert "not recorded" in page.text


@pytest.mark.slow
def test_a_long_recording_read_by_columns_gives_the_same_page(
    tmp_path, reported, columns, monkeypatch
):
    make_run(tmp_path / reported.name, columns=columns)
    monkeypatch.setattr("tautwave.report.run.rundir.WHOLE_CELLS", 0)
    page = write_report(tmp_path / reported.name)
    texts = [
        one.read_text().replace(str(one.parent), "DIR") for one in (page, reported / page.name)
    ]
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_signals_that_are_not_numbers_do_not_stop_the_report(tmp_path, columns):
    broken = {name: c.copy() for name, c in columns.items()}
    for name in ("slave.wrist.position", "wrist.position_error", "slave.wrist.port_effort"):
        broken[name][1000:1100] = np.nan
    broken["compute_us"][:] = np.nan
    make_run(tmp_path, columns=broken)
    (tmp_path / "summary.json").unlink()
    assert Page(write_report(tmp_path)).figures == 6


@pytest.mark.slow
def test_a_run_of_two_cycles(tmp_path):
    make_run(tmp_path, columns={n: c[:2] for n, c in make_columns(rows=10).items()})
    (tmp_path / "summary.json").unlink()
    Page(write_report(tmp_path))


@pytest.mark.slow
def test_reading_numbers_costs_no_matplotlib():
    code = (
        "import sys, tautwave.report, tautwave.report.units, tautwave.report.run.tables\n"
        "import tautwave.report.run.page, tautwave.report.compare\n"
        "assert not {m.split('.')[0] for m in sys.modules} & {'matplotlib', 'PIL', 'mcap'}"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)


def test_what_a_run_counts_is_all_there(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    rows = dict(loop_table(load_run(tmp_path)).rows)
    assert rows["missed cycles"] != MISSING
    assert [name for name, shown in rows.items() if shown == MISSING] == []


@pytest.mark.parametrize(
    ("folder", "shown"), [("runs/first", "runs/first"), ("my run", "'my run'")]
)
def test_the_commands_of_the_page_work_where_the_run_was_started(
    tmp_path: Path, columns, monkeypatch: pytest.MonkeyPatch, folder: str, shown: str
) -> None:
    (tmp_path / folder).mkdir(parents=True)
    make_summary(tmp_path / folder, columns)
    monkeypatch.chdir(tmp_path)
    page = Page(write_report(tmp_path / folder))
    assert f"tautwave report {shown}" in page.text
    assert f"tautwave run {shown}/rig.yaml" in page.text
