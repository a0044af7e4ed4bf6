"""Phrases that read as translated English stay out of sources, docs and rig files.

Each pattern names a phrase that stood in the project before and what to write instead. Where one is
right (a quotation, another meaning), reword the line: the list is short enough for that.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PHRASES = {
    r"\bno number\b(?! (?:of|changes))": "NaN, or not a number",
    r"\bfor ever\b": "indefinitely, or permanently",
    r"\b(?:has|have|had) run away\b": "is unstable, or grows without bound",
    r"\bswings? up\b": "becomes unstable, or oscillates",
    r"\bas asked for\b": "as specified",
    r"\bnot asked for\b": "not requested",
    r"\b(?:goes|go|gone) on (?:from|with) (?:where|what|it)\b": "resumes, or continues",
    r"\bthere is to (?:say|show)\b": "name the content",
    r"\bknows everybody\b": "knows all others",
    r"\bmakes? no energy\b": "creates no energy",
    r"\bis told (?:that|what|which|why)\b": "is reported",
    r"\beverybody's\b|\bsomebody else's\b": "name the owner",
    r"\boutside forces?\b": "external force",
    r"\bwho is there\b": "find the devices",
    r"(?<!there) (?:is|are) no (?:address|frame|message|packet|profile|joint|trace)\b"
    r"(?! (?:of|changes|for|in|to|yet|as))": "is not a ...",
    r"(?:\. |\"\"\"|: )Who(?:ever)? (?:is|has|comes|falls|opens|reaches|gets|wants)\b(?! in)": (
        "name the subject"
    ),
    r"\bnobody(?: else)? (?:serves|speaks|knows|sees|asks|wanted|changes|uses)\b": (
        "the passive, or what does not"
    ),
    r"\bgo(?:es|ing)? on from there\b": "resumes",
    r"\bwhat people should know\b": "status messages",
    r"\b(?:are|were|be|was) told (?:of|apart|from|that|what|to)\b": "given, or distinguished",
    r"\bnobody (?:has )?(?:tried|accepted|listed|waits)\b": "untested, not accepted, not listed",
    r"\b[Ll]et everything happen\b": "process all events",
    r"\b(?:befalls|ails)\b": "the fault of a device",
    r"\bis to be believed\b": "credible, or plausible",
    r"\bso many a second\b": "at this rate",
    r"\bwhoever asked for\b": "whatever requested",
    r", for (?:it|nothing|there|that|the network) (?:is|has|would|are)\b": "because",
}
"""Pattern of a phrase, and what to write instead."""

TEXTS = sorted(
    {
        path
        for folder, suffixes in (
            ("src", (".py",)),
            ("drivers", (".py", ".yaml")),
            ("sim", (".py", ".yaml")),
            ("docs", (".md", ".py")),
            ("configs", (".md", ".yaml")),
        )
        for suffix in suffixes
        for path in (ROOT / folder).rglob(f"*{suffix}")
        if "_build" not in path.parts and "generated" not in path.parts
    }
    | {ROOT / "README.md", ROOT / "CONTRIBUTING.md"}
)


def translated(text: str) -> list[str]:
    """Return the phrases of the list that `text` holds, across line ends and comment marks."""
    flat = re.sub(r"\s+(?:#\s+)?", " ", text)
    return [
        f"{found.group(0)!r}: write {instead}"
        for pattern, instead in PHRASES.items()
        for found in re.finditer(pattern, flat)
    ]


@pytest.mark.slow
def test_no_text_has_a_translated_phrase() -> None:
    found = {str(path.relative_to(ROOT)): translated(path.read_text("utf-8")) for path in TEXTS}
    assert {path: phrases for path, phrases in found.items() if phrases} == {}


def test_planted_phrases_are_noticed() -> None:
    assert translated("The effort is no number.") == ["'no number': write NaN, or not a number"]
    assert translated("    # a scene that has\n    # run away")
    assert not translated("no number changes; a number of slots")
