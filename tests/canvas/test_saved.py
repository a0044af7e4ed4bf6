"""A figure as files: what a person looks at, and beside it what a page and a paper take."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.canvas import PAGE, Style, heading, legend, panels, save_figure, styled
from tautwave.canvas.sheet import arrange


def test_a_figure_is_saved_as_png_svg_and_pdf(tmp_path: Path) -> None:
    figure, (axes,) = panels([2.0], "limits", False)
    axes.plot([0.0, 1.0], [0.0, 2.0])
    path = save_figure(figure, tmp_path / "z-width.png", "the stiffest walls")
    assert path == tmp_path / "z-width.png"
    assert path.read_bytes().startswith(b"\x89PNG")
    drawn = path.with_suffix(".svg").read_text()
    assert "<title>the stiffest walls</title>" in drawn
    assert "prefers-color-scheme: dark" in drawn
    assert path.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert {one.name for one in tmp_path.iterdir()} == {"z-width.png", "z-width.svg", "z-width.pdf"}


@pytest.mark.parametrize(
    ("style", "columns"), [(PAGE, 2), (Style(174 / 25.4, 8.0), 2), (Style(84 / 25.4, 8.0), 1)]
)
def test_words_of_a_panel_stay_on_the_page_at_every_width(style: Style, columns: int) -> None:
    with styled(style):
        figure, axes = panels([2.1, 2.1], "certificate", False, columns=2)
        for panel in axes:
            heading(panel, "master wall: damping needed")
            panel.plot([0.0, 1.0], [0.0, 2.0], label="guaranteed device damping")
            panel.set(xlabel="damping B [10\u207b\u00b3 N m s/rad]")
            legend(panel)
        arrange(figure)
        width = figure.get_figwidth() * figure.dpi
        assert len({round(panel.get_position().x0, 3) for panel in axes}) == columns
        for panel in axes:
            box = panel.get_tightbbox()
            assert box is not None
            assert -1.0 <= box.x0 < box.x1 <= width + 1.0
