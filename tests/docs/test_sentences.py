"""Pages that people work by have sentences of at most 30 words, and at most 900 words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page for part in ("start", "tutorials", "howto") for page in (ROOT / "docs" / part).glob("*.md")
)
MAX_SENTENCE, MAX_PAGE, MAX_EXPLANATION = 30, 900, 11_000
"""Words; of the pages that explain, together."""


def prose(text: str) -> str:
    """Return a page without fenced and indented blocks, tables, headings, pictures, comments."""
    text = re.sub(r"```.*?```", "\n\n", text, flags=re.S)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.S)
    kept = [
        "" if line.startswith(("|", "#", "    ", "!", "(")) else line for line in text.splitlines()
    ]
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", "\n".join(kept))


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page; what stands in backticks counts as one word."""
    for paragraph in re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.) ", prose(text)):
        words = re.sub(r"`[^`]*`", "`CODE`", " ".join(paragraph.split()))
        yield from re.split(r"(?<=[.!?])[\"”)]*\s+(?=[A-Z`(*])", words)


def long_sentences(text: str) -> list[str]:
    return [one for one in sentences(text) if len(one.split()) > MAX_SENTENCE]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_sentences_are_short(page: Path) -> None:
    assert not long_sentences(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_are_short(page: Path) -> None:
    assert len(prose(page.read_text(encoding="utf-8")).split()) <= MAX_PAGE


def test_explanations_are_short_together() -> None:
    pages = (ROOT / "docs/explanation").glob("*.md")
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in pages) <= MAX_EXPLANATION


def test_a_long_sentence_is_found() -> None:
    words = " ".join(["word"] * MAX_SENTENCE)
    assert not long_sentences(f"A {words[5:]}. A {words[5:]}.")
    assert long_sentences(f"Short one. A {words}.") == [f"A {words}."]
    assert not long_sentences(f"```text\nA {words}.\n```\n\n| A {words} |\n\n    A {words}\n")


@pytest.mark.parametrize("page", ["the-port", "couplings"])
def test_a_page_that_explains_begins_with_its_question_and_the_answer(page: str) -> None:
    _, first, *_ = (
        (ROOT / "docs/explanation" / f"{page}.md").read_text(encoding="utf-8").split("\n\n")
    )
    question, answer = re.fullmatch(r"\*\*([^*]+\?)\*\* (.+)", first, flags=re.S).groups()  # type: ignore[union-attr]
    assert len(question.split()) <= MAX_SENTENCE
    assert len(next(sentences(answer)).split()) <= MAX_SENTENCE
