"""From pydantic's error location to the key in the file, by walking the models' annotations."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel

from tautwave.config.keys.chosen import named_block
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath


class Place(NamedTuple):
    """The path in the file, the model in which its last key was looked up, what is expected."""

    path: KeyPath
    owner: type[BaseModel] | None
    kind: Any


def locate(
    document: Document, model: type[BaseModel], base: KeyPath, loc: Sequence[str | int]
) -> Place:
    """Return the place that `loc` means; its union tags and '[key]' are not keys of the file."""
    path, owner, kind = base, None, _plain(model)
    for part in loc:
        kind = named_block(kind, document.get(path))
        if hasattr(kind, "model_for"):
            kind = kind.model_for(document.get(path))
        if part == "[key]":
            owner, kind = None, None
        elif as_model(kind):
            path, owner, kind = (*path, part), kind, _field_kind(kind, part)
        elif get_origin(kind) in (dict, Mapping):
            path, owner, kind = (*path, part), None, _plain(get_args(kind)[1])
        elif get_origin(kind) in (tuple, list) and isinstance(part, int):
            path, owner, kind = (*path, part), None, _item_kind(kind, part)
        elif (member := _member(kind, part)) is not None:
            kind = member
        elif isinstance(part, int) or _holds(document.get(path), part):
            path, owner, kind = (*path, part), None, None
    return Place(path, owner, kind)


def as_model(kind: Any) -> bool:
    """Return whether an annotation is a model."""
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def tags(kind: Any) -> list[str]:
    """Return the values of `type` that discriminate a union of models."""
    values: list[str] = []
    for member in get_args(kind):
        if as_model(member) and "type" in member.model_fields:
            values += get_args(member.model_fields["type"].annotation)
    return values


def _plain(kind: Any) -> Any:
    """Return an annotation without `Annotated` and without `| None`."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) in (Union, types.UnionType):
        members = [member for member in get_args(kind) if member is not type(None)]
        if len(members) == 1:
            return _plain(members[0])
    return kind


def _field_kind(model: type[BaseModel], key: str | int) -> Any:
    for name, field in model.model_fields.items():
        if key in (name, field.alias):
            return _plain(field.annotation)
    return None


def _item_kind(kind: Any, index: int) -> Any:
    items = get_args(kind)
    if len(items) == 2 and items[1] is Ellipsis:
        return _plain(items[0])
    return _plain(items[index if index < len(items) else -1]) if items else None


def _member(kind: Any, part: str | int) -> Any:
    """Return the member of a union that a part of the location stands for."""
    if get_origin(kind) not in (Union, types.UnionType):
        return None
    for member in get_args(kind):
        plain = _plain(member)
        if as_model(plain):
            field = plain.model_fields.get("type")
            tagged = field is not None and get_origin(field.annotation) is Literal
            if plain.__name__ == part or (
                tagged and field is not None and part in get_args(field.annotation)
            ):
                return plain
    return None


def _holds(value: Any, key: str) -> bool:
    return isinstance(value, dict) and key in value
