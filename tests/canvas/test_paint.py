"""Layout and bytes: what a page, a picture and a paper get."""

import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.text import Text
from PIL import Image

from tautwave.canvas import (
    DARK,
    EDGE,
    GRID,
    INK,
    MASTER,
    PAPER,
    SLAVE,
    SOFT,
    WALL_SHADE,
    Style,
    alone,
    find_font,
    heading,
    key,
    legend,
    panels,
    paper,
    png,
    sheet,
    styled,
    svg,
    text_panel,
)
from tautwave.errors import ConfigError

LONG = "a heading that says rather more than fits into one line of a narrow panel, as they do"


def drawn(columns=1):
    figure, axes = panels([1.5, 1.5], "A title with $ and <", True, columns=columns)
    x = np.linspace(0.0, 1.0, 400)
    for panel in axes:
        panel.plot(x, np.sin(20.0 * x), color=MASTER, label="master")
        panel.plot(x, np.cos(20.0 * x), color=SLAVE, linestyle="--", label="slave")
        panel.axhspan(0.0, 0.5, color=WALL_SHADE, alpha=0.4, label="some ground")
        panel.set_ylabel("position [mm]")
        heading(panel, LONG)
        legend(panel, "reported\nbefore")
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def boxes(figure, axes):
    """Of each panel with all that belongs to it, in pixels."""
    renderer = figure.canvas.get_renderer()
    return [panel.get_tightbbox(renderer) for panel in axes]


@pytest.mark.parametrize(
    "said",
    [
        "Virtual walls: what is passive, what is stable with this hand. " * 2,
        "it is still, little; " * 5 + "MORE WORDS WHOSE LETTERS ARE WIDE. " * 3,
    ],
)
def test_a_long_title_stays_in_the_figure(said):
    figure, axes = panels([1.0], said, True)
    axes[0].plot([0.0, 1.0], [0.0, 1.0])
    png(figure, 600)
    (title,) = figure.texts
    assert "\n" in title.get_text()
    assert title.get_window_extent().x1 < figure.bbox.width


def test_every_colour_is_an_attribute_of_the_palette():
    text = svg(drawn()[0], "first", "what it shows")
    ET.fromstring(text)
    found = set(re.findall(r"#[0-9a-fA-F]{6}", re.sub(r'(?:href|id)="[^"]*"', "", text)))
    assert {MASTER, SLAVE, WALL_SHADE} <= found
    assert found <= set(DARK)
    styles = set(re.findall(r'style="([^"]*)"', text))
    assert styles
    assert not any(word in style for style in styles for word in ("fill", "stroke"))
    assert "<title>what it shows</title>" in text
    assert ">master</text>" in text  # text stays text
    assert "<style" not in text
    assert "prefers-color-scheme: dark" in alone(text)


@pytest.mark.slow
def test_figures_of_one_page_share_no_identifier():
    one, two = svg(drawn()[0], "one"), svg(drawn()[0], "two")
    first, second = (set(re.findall(r' id="([^"]*)"', text)) for text in (one, two))
    assert first
    assert not first & second
    assert one == svg(drawn()[0], "one")


@pytest.mark.sparse(2)
@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("style", [Style(), Style(84.0 / 25.4, 8.0)])
def test_nothing_overlaps_and_nothing_is_cut_off(columns, style):
    with styled(style):
        figure, axes = drawn(columns)
    png(figure, 600)
    found = boxes(figure, axes)
    for at, one in enumerate(found):
        for two in found[at + 1 :]:
            shared = (
                min(one.x1, two.x1) - max(one.x0, two.x0),
                min(one.y1, two.y1) - max(one.y0, two.y0),
            )
            assert min(shared) < 3.0
        assert one.x0 > -1.0
        assert one.y0 > -1.0
        assert one.y1 < figure.bbox.height + 1.0
        assert one.x1 < figure.bbox.width + 4.0


def test_letters_can_be_read_at_half_the_width_of_a_page():
    figure, axes = drawn()
    svg(figure, "a")
    least = min(text.get_fontsize() for text in axes[0].get_legend().get_texts())
    points = 72.0 * figure.get_figwidth()
    assert least / points * 476 > 8.0  # px, on a page of 500


def test_a_picture_is_a_thousand_pixels_wide():
    with Image.open(io.BytesIO(png(drawn()[0]))) as picture:
        assert picture.width == 1000


def test_one_legend_for_all_and_words_below():
    figure, (above, below) = panels([1.0, 0.1], "title", False)
    above.plot([0, 1], [0, 1], color=MASTER, label="master")
    key(figure)
    text_panel(below, [(SOFT, "said " * 60)])
    svg(figure, "a")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["master"]
    reported = [text for text in figure.texts if text.get_text().startswith("said")]
    assert len(reported) > 2  # wrapped
    assert all(0.0 < text.get_position()[1] < above.get_position().y0 for text in reported)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_a_paper_gets_its_width_its_letters_and_no_title(kind):
    with styled(Style(84.0 / 25.4, 7.0, find_font("dejavu serif"), titled=False)):
        figure, axes = drawn()
    data = paper(figure, kind)
    assert data.startswith(b"%PDF" if kind == "pdf" else b"<?xml")
    assert figure.get_figwidth() == pytest.approx(84.0 / 25.4)
    assert not figure.texts
    assert axes[0].get_legend().get_texts()[0].get_fontsize() == pytest.approx(6.3)
    written = [text for text in figure.findobj(Text) if text.get_text()]
    assert {text.get_fontfamily()[0] for text in written} == {"DejaVu Serif"}
    if kind == "pdf":
        assert b"DejaVuSerif" in data
    else:
        assert b"<text" not in data  # outlines


@pytest.mark.parametrize("size", [9.5, 7.0])
def test_every_word_has_its_share_of_the_letters_asked_for(size):
    """Labels of axes 95 %, numbers at ticks 93 %."""
    with styled(Style(size=size)):
        figure, (_, panel) = drawn()
    svg(figure, "a")
    assert panel.yaxis.label.get_fontsize() == pytest.approx(0.95 * size)
    assert panel.xaxis.label.get_fontsize() == pytest.approx(0.95 * size)
    for axis in (panel.xaxis, panel.yaxis):
        (number,) = {text.get_fontsize() for text in axis.get_ticklabels()}
        assert number == pytest.approx(0.93 * size)


def test_a_panel_has_two_spines_a_grid_behind_and_plain_numbers():
    figure, (panel,) = panels([1.5], "title", False)
    panel.plot([0.0, 1.0], [-1000.0, -1000.01])
    svg(figure, "a")
    shown = {name for name, spine in panel.spines.items() if spine.get_visible()}
    assert shown == {"left", "bottom"}
    assert {to_hex(panel.spines[name].get_edgecolor()) for name in shown} == {EDGE}
    assert all(line.get_visible() for line in panel.get_xgridlines() + panel.get_ygridlines())
    assert {to_hex(line.get_color()) for line in panel.get_ygridlines()} == {GRID}
    assert panel.get_axisbelow() is True
    assert panel.yaxis.get_major_formatter().get_offset() == ""
    assert "\N{MINUS SIGN}1000.0100" in [text.get_text() for text in panel.get_yticklabels()]
    assert panel.patch.get_facecolor()[3] == 0.0
    for axis in (panel.xaxis, panel.yaxis):
        assert {to_hex(text.get_color()) for text in axis.get_ticklabels()} == {INK}
        assert {to_hex(tick.tick1line.get_color()) for tick in axis.get_major_ticks()} == {EDGE}
        (size,) = {tick.tick1line.get_markersize() for tick in axis.get_major_ticks()}
        assert size == 3.5


def test_a_wider_figure_is_higher_within_bounds():
    assert [Style(width=w).height for w in (1.0, 4.08, 6.8, 8.84, 20.0)] == pytest.approx(
        [0.6, 0.6, 1.0, 1.3, 1.3]
    )
    assert Style(size=19.0).stroke == 2.0


@pytest.mark.slow
def test_lines_are_as_thick_as_the_letters_ask_for():
    def thickness(style):
        with styled(style):
            figure, axes = drawn()
        axes[0].scatter([0.5], [0.0], linewidths=2.0)
        paper(figure, "pdf")
        panel = axes[0]
        tick = panel.xaxis.get_major_ticks()[0].tick1line
        legend_line = panel.get_legend().get_lines()[1]  # behind the words ahead
        return np.array(
            [line.get_linewidth() for line in (*panel.lines, legend_line, panel.spines["left"])]
            + [panel.patches[0].get_linewidth(), panel.collections[0].get_linewidth()[0]]
            + [panel.get_xgridlines()[0].get_linewidth(), tick.get_markersize()]
            + [tick.get_markeredgewidth(), panel.lines[0].get_markersize()]
        )

    page, small = thickness(Style()), thickness(Style(84.0 / 25.4, 7.0, titled=False))
    assert (page > 0.0).all()
    assert small == pytest.approx(page * 7.0 / Style().size)


def test_an_svg_of_its_own_has_dark_ground_around_it_too():
    assert f":root {{ background: {DARK[PAPER]}; }}" in alone(svg(drawn()[0], "first"))


def test_a_font_that_is_not_there_is_one_sentence():
    with pytest.raises(
        ConfigError, match="Sarif: no such font is installed here; there are DejaVu"
    ):
        find_font("DejaVu Sarif")


def test_a_legend_begins_where_its_panel_does():
    figure, (panel,) = panels([1.5], "title", False)
    panel.plot([0, 1], [0, 1], color=MASTER, label="master")
    legend(panel)
    svg(figure, "a")
    frame = panel.get_legend().get_window_extent(figure.canvas.get_renderer())
    assert frame.x0 == pytest.approx(panel.bbox.x0, abs=1.0)


def test_a_legend_that_just_fits_stays_in_one_line():
    figure, (panel,) = panels([1.5], "title", False)
    for label in ("a", "b", "c", "d"):
        panel.plot([0, 1], [0, 1], label=label)
    legend(panel)
    svg(figure, "a")
    shown = panel.get_legend().get_window_extent(figure.canvas.get_renderer())
    style = sheet.style_of(figure)
    room = 1.12 * shown.width / figure.dpi
    assert sheet._columns(figure, ["a", "b", "c", "d"], room, style) == 4
