"""Write the generated pages of the reference, each only where its text changed."""

from __future__ import annotations

from pathlib import Path

from _tools.columns import columns_page
from _tools.commands import commands_page, exit_codes_page
from _tools.cycle import cycle_page
from _tools.floors import floors_svg
from _tools.keys import keys_pages
from _tools.stops import stops_page
from _tools.summary import summary_page
from _tools.sweeps import sweeps_page


def write_pages(folder: Path) -> None:
    """Write pages of keys, commands and so on, and the picture of the floors, into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "commands.md": commands_page,
        "columns.md": columns_page,
        "exit-codes.md": exit_codes_page,
        "cycle.md": cycle_page,
        "stops.md": stops_page,
        "summary.md": summary_page,
        "sweeps.md": sweeps_page,
        "floors.svg": floors_svg,
    }
    texts = {name: page() for name, page in pages.items()}
    texts |= {f"keys/{page}.md": tables for page, tables in keys_pages().items()}
    (folder / "keys").mkdir(exist_ok=True)
    for path in folder.rglob("*.*"):
        if path.relative_to(folder).as_posix() not in texts:
            path.unlink()  # of an earlier version
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
