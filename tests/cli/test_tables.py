"""One table, printed on a terminal and put on a page."""

from __future__ import annotations

import re
from html import unescape

from hypothesis import given
from hypothesis import strategies as st

from tautwave.cli.terminal.show import STYLES, plain_lines
from tautwave.report.html import STYLE, table
from tautwave.tables import Cell, Level, Table, of_numbers, text_of, titled

WORDS = st.text("abc<&> \"'é", min_size=1, max_size=8).map(lambda text: f"x{text.strip()}y")
LEVELS: st.SearchStrategy[Level] = st.sampled_from(("", "ok", "note", "bad", "faint"))
CELLS = WORDS | st.builds(Cell, WORDS, LEVELS)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    width = draw(st.integers(1, 4))
    columns = [draw(st.sampled_from(("", ">"))) + draw(WORDS) for _ in range(width)]
    rows = draw(st.lists(st.tuples(*[CELLS] * width), min_size=1, max_size=4))
    return Table(draw(WORDS), columns, rows, draw(st.just("") | WORDS), draw(LEVELS))


@given(tables())
def test_both_renderers_say_the_same_in_the_same_order(drawn: Table) -> None:
    said = [drawn.title, *titled(drawn.columns)]
    said += [text_of(cell) for row in drawn.rows for cell in row]
    said += [drawn.note] if drawn.note else []
    page = unescape(re.sub(r"<[^>]*>", "\n", table(drawn)))
    assert [line for line in page.split("\n") if line.strip()] == said
    printed = "\n".join(plain_lines(drawn))
    for word in said:
        assert word in printed
        printed = printed.partition(word)[2]


@given(tables())
def test_the_page_has_no_markup_of_a_cell_and_aligns_as_the_terminal(drawn: Table) -> None:
    made = table(drawn)
    names = set(re.findall(r"</?([a-z]+)", made))
    assert names <= {"div", "table", "caption", "thead", "tbody", "tr", "th", "td", "p"}
    for row in re.findall(r"<tr>(.*?)</tr>", made, re.DOTALL):
        classes = re.findall(r"<t[hd](?: class=\"([^\"]*)\")?>", row)
        assert ["text" in one.split() for one in classes] == [
            not name.startswith(">") for name in drawn.columns
        ]


def test_every_level_has_a_style_on_both() -> None:
    for level in filter(None, STYLES):
        assert f"td.{level} {{" in STYLE


def test_numbers_are_right_aligned_beside_a_name() -> None:
    assert of_numbers("axis", "p50", "max") == ("axis", ">p50", ">max")
    lines = list(plain_lines(Table("", of_numbers("axis", "max"), [("a", "1"), ("long", "100")])))
    assert lines == ["  axis  max", "  a       1", "  long  100"]
