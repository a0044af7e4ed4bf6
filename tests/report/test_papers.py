"""Figures for papers by the command line, and the certificate's limits where they bend."""

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.canvas.sheet import style_of
from tautwave.certificate.picture import MOST, bend
from tautwave.cli import main
from tests.report.synthetic import make_run


def test_every_figure_becomes_a_file_of_its_own(tmp_path, monkeypatch):
    styles = set()

    def paper(figure, *_, **__):
        styles.add(style_of(figure))
        return b"%PDF"

    monkeypatch.setattr("tautwave.report.run.page.paper", paper)
    make_run(tmp_path, rows=300)
    options = ["--figures", "pdf", "--width", "84", "--font-size", "7", "--font", "dejavu serif"]
    done = CliRunner().invoke(main, ["report", str(tmp_path), *options])
    assert done.exit_code == 0, done.output
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"wrist-tracking.pdf", "wrist-effort.pdf", "timing.pdf"} <= names
    assert all(str(tmp_path / "figures" / name) in done.output for name in names)
    assert not (tmp_path / "report.html").exists()
    (style,) = styles
    assert style.width == pytest.approx(84.0 / 25.4)
    assert style[1:] == (7.0, "DejaVu Serif", False)


@pytest.mark.parametrize(
    "options",
    [
        ["--width", "84"],
        ["--figures", "png"],
        ["--figures", "pdf", "--width", "nan"],
        ["--figures", "pdf", "--font-size", "400"],
        ["--figures", "pdf", "--font", "No Such Letters"],
    ],
)
def test_what_cannot_be_is_refused(tmp_path, options):
    assert CliRunner().invoke(main, ["report", str(tmp_path), *options]).exit_code == 2


def test_a_limit_is_sampled_where_it_bends():
    x, y = bend(lambda b: max(0.0, 1.0 - 3.0 * b), 0.0, 1.0)
    assert len(x) <= MOST
    at = np.linspace(0.0, 1.0, 1001)
    assert np.abs(np.interp(at, x, y) - np.maximum(0.0, 1.0 - 3.0 * at)).max() < 0.01
    assert len(bend(lambda b: 2.0 * b, 0.0, 1.0)[0]) < 12  # a line needs no more
