"""Facts that many joints share, as one line: numbers from the least to the greatest."""

from __future__ import annotations

import re
from collections.abc import Sequence

Fact = tuple[str, str]

FEW = 2
"""Up to this many facts of a kind are shown one by one."""

_LABELS = (
    re.compile(r"(?P<kind>offset|load) of (?P<name>\S+)"),
    re.compile(r"(?P<kind>hint) on (?P<name>\S+\.\S+)"),
    re.compile(r"(?P<name>\S+)\.(?P<kind>\w+ auto)"),
)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def folded_alike(facts: Sequence[Fact]) -> list[Fact]:
    """Return facts with those of one kind and wording as one, where there are more than `FEW`.

    Where the first of them was, the label says the kind and of how many, or of which side.
    """
    groups: dict[tuple[str, str, str], list[Fact]] = {}
    placed: list[tuple[str, str, str] | Fact] = []
    loads = [label for label, _ in facts if label.startswith("load of ")]
    for label, text in facts:
        if label in loads and len(loads) > FEW:  # each by name, once what that means
            placed.append((label, text.partition("; ")[0]))
            label, text = f"offset of {label.removeprefix('load of ')}", text.partition("; ")[2]
            if not text:
                continue
        match = _matched(label)
        if match is None:
            placed.append((label, text))
            continue
        kind, name = match["kind"], match["name"]
        side = name.partition(".")[0] if "." in name else ""
        plain = _nameless(text, label)
        key = (kind, side, _NUMBER.sub("#", plain))
        if key not in groups:
            placed.append(key)
        groups.setdefault(key, []).append((label, text))
    found: list[Fact] = []
    originals = {label: text for members in groups.values() for label, text in members}
    for one in placed:
        if len(one) == 2:
            found.append(one)
            continue
        members = groups[one]
        if len(members) <= FEW:
            found += [(label, originals[label]) for label, _ in members]
            continue
        kind, side, _ = one
        word = {"hint": "hints on", "offset": "loads of" if side else "offsets"}.get(kind, kind)
        text = _spanned([_nameless(text, label) for label, text in members])
        found.append((f"{word} {side}".strip(), f"{text} ({len(members)} alike)"))
    return found


def _matched(label: str) -> re.Match[str] | None:
    return next((found for one in _LABELS if (found := one.fullmatch(label))), None)


def _nameless(text: str, label: str) -> str:
    """Return the text of a fact without the name of its axis or pair."""
    match = _matched(label)
    leaf = "" if match is None else match["name"].rpartition(".")[2]
    text = re.sub(rf"\b(master|slave)\.{re.escape(leaf)}(?![\w-])", r"\1", text)
    return text


def _spanned(texts: Sequence[str]) -> str:
    """Return texts that differ in numbers only as one, with `least to most` where they do."""
    columns = list(zip(*(_NUMBER.findall(text) for text in texts), strict=True))
    pieces = _NUMBER.split(texts[0])
    found = pieces[0]
    for values, after in zip(columns, pieces[1:], strict=True):
        least, most = min(values, key=float), max(values, key=float)
        found += (least if float(least) == float(most) else f"{least} to {most}") + after
    return found
