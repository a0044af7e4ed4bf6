"""Figures as bytes and files: PNG to look at; SVG for pages, light and dark in one; PDF."""

from __future__ import annotations

import io
import re
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.canvas.palette import DARK, PAPER, dark_rules
from tautwave.canvas.sheet import arrange, style_of
from tautwave.canvas.style import settings
from tautwave.files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_WIDTH = 1000
"""[px]"""

DARK_QUERY = "screen and (prefers-color-scheme: dark)"
_STYLE = re.compile(r' style="([^"]*)"')
_NUMBER = re.compile(r"-?\d+\.\d+")
_PATH = re.compile(r' d="([^"]*)"')
_GROUP = re.compile(r'<g id="[^"]*"')
_LETTERS = ("font", "font-family", "font-size", "font-weight", "font-style")


def png(figure: Figure, width: int = PNG_WIDTH) -> bytes:
    """The figure as PNG with a palette: a third of the bytes of a full-colour one.

    Parameters
    ----------
    width : picture width [px]
    """
    import matplotlib
    from PIL import Image

    arrange(figure)
    style = style_of(figure)
    figure.set_dpi(width / style.width)
    with matplotlib.rc_context(settings(style)):
        canvas: Any = figure.canvas
        canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
    # The only method of Pillow that keeps white white and a pale green patch green.
    cut = Image.Quantize.MEDIANCUT
    small = picture.quantize(colors=256, method=cut, dither=Image.Dither.NONE)
    out = io.BytesIO()
    small.save(out, format="PNG", compress_level=7)
    return out.getvalue()


def svg(figure: Figure, name: str, title: str = "") -> str:
    """The figure as SVG for a page and for a browser, light and dark.

    Colours are attributes of the palette; an embedded style switches them in dark mode, and a page
    does the same for all of its figures.

    Parameters
    ----------
    name : unique among the figures of the page
    title : description for screen readers
    """
    raw = paper(figure, "svg", salt=name, outlines=False).decode("utf-8")
    raw = raw[raw.index("<svg") :]
    raw = re.sub(r"<metadata>.*?</metadata>", "", raw, flags=re.DOTALL)
    raw = re.sub(r"<!--.*?-->", "", raw, flags=re.DOTALL)
    raw = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", raw, flags=re.DOTALL)
    raw = _GROUP.sub("<g", raw)
    raw = _STYLE.sub(_attributes, raw)
    raw = _PATH.sub(_shorter, raw)
    raw = re.sub(r">\s+<", "><", raw)
    head = raw.index(">") + 1
    box = re.search(r'viewBox="([^"]*)"', raw[:head])
    label = escape(title or name)
    # The namespaces are only names; nothing is fetched from them.
    start = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="{box[1] if box else ""}" role="img" stroke-linejoin="round">'
        f"<title>{label}</title>"
    )
    return start + raw[head:].strip()


def alone(drawn: str) -> str:
    """An SVG of `svg` as a separate file, which switches to dark by itself, background included."""
    head = drawn.index("<title>")
    ground = f":root {{ background: {DARK[PAPER]}; }}"
    rules = f"<style>@media {DARK_QUERY} {{\n{ground}\n{dark_rules()}\n}}</style>"
    return '<?xml version="1.0" encoding="utf-8"?>\n' + drawn[:head] + rules + drawn[head:] + "\n"


def paper(figure: Figure, kind: str, *, salt: str = "", outlines: bool = True) -> bytes:
    """The figure as PDF or SVG for a paper: light, fonts embedded or as outlines.

    Parameters
    ----------
    kind : `pdf` or `svg`
    salt : makes this figure's identifiers unique
    outlines : draw an SVG's text as outlines, which look the same everywhere
    """
    import matplotlib

    arrange(figure)
    out = io.BytesIO()
    keys = settings(style_of(figure)) | {
        "svg.fonttype": "path" if outlines else "none",
        "svg.hashsalt": salt or "tautwave",
    }
    dated = {"CreationDate": None} if kind == "pdf" else {"Date": None}
    with matplotlib.rc_context(keys):
        figure.savefig(out, format=kind, metadata=dated)
    return out.getvalue()


def _attributes(found: re.Match[str]) -> str:
    """A style as attributes, which a page's rules override; fonts stay in the style."""
    made, kept = [], []
    for part in found[1].split(";"):
        name, _, value = (piece.strip() for piece in part.partition(":"))
        if name in _LETTERS:
            kept.append(f"{name}: {value}")
        elif name:
            made.append(f'{name}="{value}"')
    style = f' style="{"; ".join(kept)}"' if kept else ""
    return "".join(f" {one}" for one in made) + style


def _shorter(found: re.Match[str]) -> str:
    digits = 1 if len(found[1]) > 300 else 3

    def rounded(number: re.Match[str]) -> str:
        return f"{float(number[0]):.{digits}f}".rstrip("0").rstrip(".")

    path = _NUMBER.sub(rounded, " ".join(found[1].split()))
    return (
        f' d="{path.replace(" L ", " ")}"'
        if "C" not in path and "Q" not in path
        else f' d="{path}"'
    )


if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: Path, title: str = "") -> Path:
    """Write a figure as PNG, and as SVG (light and dark) and PDF of the same name; return `path`.

    `title`: description of the SVG for screen readers; default: the name of the file.

    Raises
    ------
    WritingError
        A file cannot be written.
    """
    write_bytes(path, png(figure))
    drawn = alone(svg(figure, path.stem, title or path.stem.replace("-", " ")))
    write_bytes(path.with_suffix(".svg"), drawn.encode())
    write_bytes(path.with_suffix(".pdf"), paper(figure, "pdf"))
    return path
