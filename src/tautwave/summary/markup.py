"""HTML that escapes what is put into it: only a literal of ours is markup."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape


class Markup(str):
    """Text that is HTML; `format` and `join` escape all that is not `Markup` itself."""

    __slots__ = ()

    def format(self, *args: object, **kwargs: object) -> Markup:
        """Return this with its fields filled."""
        named = {key: markup(value) for key, value in kwargs.items()}
        return Markup(str.format(self, *map(markup, args), **named))

    def join(self, parts: Iterable[object]) -> Markup:
        """Return parts, with this in between."""
        return Markup(str.join(self, map(markup, parts)))

    def __add__(self, other: str) -> Markup:
        """Return both, one after the other."""
        return Markup(str.__add__(self, markup(other)))

    def each(self, parts: Iterable[object]) -> Markup:
        """Return this, filled with one part after the other."""
        return Markup("").join(self.format(part) for part in parts)


def markup(value: object) -> Markup:
    """Return text as HTML: as it is if it is `Markup`, else escaped."""
    return value if isinstance(value, Markup) else Markup(escape(str(value)))
