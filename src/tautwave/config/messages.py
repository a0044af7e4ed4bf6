"""pydantic's errors as messages: the key as written, the nearest key, what is allowed."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from tautwave.config.keys.common import Block
from tautwave.config.keys.coupling import laws_with
from tautwave.config.older import replaced_key
from tautwave.config.places import Place, locate, tags
from tautwave.config.text.document import Document, nearest, open_document, show_value
from tautwave.config.text.yaml12 import KeyPath, read_scalar
from tautwave.errors import ConfigError

_PATTERNS = {
    r"^[A-Za-z_][A-Za-z0-9_-]*$": "a name has letters, digits, _ and -, and begins with a letter",
    r"^(master|slave)\.[A-Za-z_][A-Za-z0-9_-]*$": "use the full axis name here, such as "
    "master.wrist or slave.wrist",
    r"^(master|slave)(\.[A-Za-z_][A-Za-z0-9_-]*)?$": "use master or slave here or, for one of "
    "several arms, its full name, such as master.left",
}


def validate(document: Document, model: type[Any], path: KeyPath = ()) -> Any:
    """Return the block at `path` as a `model`, or None after noting every mistake in it.

    The values go through JSON, in strict mode: no type is converted, but lists are accepted for
    tuples and names for enumerations, also in a third party's model.
    """
    try:
        return model.model_validate_json(json.dumps(document.get(path)), strict=True)
    except ValidationError as err:
        _report(document, model, path, err)
        return None


def read_model(text: str, name: str, kind: str, model: type[Any]) -> tuple[Document, Any]:
    """Return the text of a user's file as a document and as a `model`.

    Parameters
    ----------
    text : str
        YAML.
    name : str
        Name of the file in messages.
    kind : str
        Kind of file: `profile`.
    model : type
        Strict, as keys of rig files are.

    Raises
    ------
    ConfigError
        It is not YAML or does not fit the model; every mistake with file, line, key and nearest
        key.
    """
    document = open_document(text, name, Path(), kind)
    validated = validate(document, model)
    if document.problems:
        raise ConfigError(document.sentences())
    return document, validated


def salvage(model: type[Any], value: Any) -> Any:
    """Return `value` as a block, None if it is invalid or there is none; reports nothing."""
    if not isinstance(value, dict):
        return None  # the model, which takes milliseconds to build, would say so too
    try:
        return model.model_validate_json(json.dumps(value), strict=True)
    except ValidationError:
        return None


def _report(document: Document, model: type[Any], base: KeyPath, err: ValidationError) -> None:
    errors = err.errors(include_url=False)
    places = [locate(document, model, base, error["loc"]) for error in errors]
    meant = {
        (*place.path[:-1], close)
        for place, error in zip(places, errors, strict=True)
        if error["type"] == "extra_forbidden"
        for close in _meant(place)
    }
    for place, error in zip(places, errors, strict=True):
        if error["type"] == "missing" and place.path in meant:
            continue  # the misspelt key is this one
        if error["type"] == "too_short" and any(_inside(other, error) for other in errors):
            continue  # pydantic counts items that are right; those that are wrong are reported
        path, text = _sentence(document, place, error)
        document.report(path, text)


def _inside(inner: Any, outer: Any) -> bool:
    """Return whether an error is one of what another is about."""
    depth = len(outer["loc"])
    return len(inner["loc"]) > depth and inner["loc"][:depth] == outer["loc"]


def _keys(model: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()]


def _meant(place: Place) -> list[str]:
    import difflib

    return (
        difflib.get_close_matches(str(place.path[-1]), _keys(place.owner), n=1)
        if place.owner and place.path
        else []
    )


def unknown_key(word: str, model: type[BaseModel]) -> str:
    """Return the message about a key that `model` does not have."""
    keys = _keys(model)
    if (key := word.partition(":")[0]) in keys and key != word:
        return f"unknown key {word!r}; write a space after the colon"
    if not keys:
        return f"unknown key {word!r}; no keys are allowed here"
    return f"unknown key {word!r}{nearest(word, keys) or '.'} Allowed: {', '.join(keys)}"


def _foreign_key(word: str, model: type[BaseModel]) -> str:
    """Return the message about a key of other laws; '' if none has it."""
    if not (issubclass(model, Block) and model.part_word):
        return ""
    laws = laws_with(word, model)
    return (
        f"only for law {' or '.join(laws)}, but this is {model.part_word}; remove it"
        if laws
        else ""
    )


def _asked_by(word: str, model: type[BaseModel] | None) -> str:
    """Return which part requires a key; '' for a key that every part has."""
    if model is None or not (issubclass(model, Block) and model.part_word):
        return ""
    bases = [base for base in model.__mro__[1:] if issubclass(base, Block)]
    shared = any(word in base.model_fields for base in bases)
    return "" if shared else f" ({model.part_word})"


def _sentence(document: Document, place: Place, error: Any) -> tuple[KeyPath, str]:
    kind, context, path = error["type"], error.get("ctx", {}), place.path
    if isinstance(document.get(path[:-1]), int | float):
        path = path[:-1]  # a number where a mapping may stand, such as damping: 0.001
    of_key = bool(error["loc"]) and error["loc"][-1] == "[key]"
    value = path[-1] if of_key else document.get(path)
    got = f" (got {show_value(value)})"
    if kind == "extra_forbidden" and place.owner is not None:
        word = str(path[-1])
        text = replaced_key(word, place.owner) or _foreign_key(word, place.owner)
        return path, text or unknown_key(word, place.owner)
    if kind == "missing":
        if path and isinstance(path[-1], int):
            count = len(document.get(path[:-1]) or ())
            return path[:-1], f"Input should have {path[-1] + 1} items or more (got {count})"
        return path, "required key is missing" + _asked_by(str(path[-1]), place.owner)
    if kind == "union_tag_not_found":
        key = context["discriminator"].strip("'")
        return (*path, key), f"required key is missing; one of {', '.join(tags(place.kind))}"
    if kind == "union_tag_invalid":
        key, known = context["discriminator"].strip("'"), tags(place.kind)
        word, allowed = context["tag"], ", ".join(known)
        text = f"unknown {key} {word!r}{nearest(word, known) or '.'} Allowed: {allowed}"
        return (*path, key), text
    if kind == "literal_error":
        known = re.findall(r"'([^']*)'", context["expected"])
        if of_key:
            hint = nearest(str(value), known) or "."
            return path, f"unknown key {value!r}{hint} Allowed: {', '.join(known)}"
        hint = nearest(value, known) if isinstance(value, str) else ""
        return path, error["msg"] + got + hint
    if kind == "string_pattern_mismatch" and context["pattern"] in _PATTERNS:
        return path, f"{_PATTERNS[context['pattern']]} (got {show_value(error['input'])})"
    if kind in ("too_long", "too_short") and "actual_length" in context:
        wanted = context.get("max_length", context.get("min_length"))
        bound = "at most" if kind == "too_long" else "at least"
        items = "item" if wanted == 1 else "items"
        return path, f"Input should have {bound} {wanted} {items} (got {context['actual_length']})"
    if kind in ("order", "part", "size"):
        return path, error["msg"]
    if kind == "value_error":
        return path, str(context["error"])  # a block's own message
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return path, f"Input should be a mapping{got}"
    if kind in ("tuple_type", "list_type", "set_type"):
        return path, f"Input should be a list{got}"
    return path, error["msg"] + got + ("" if of_key else _hint(kind, value))


def _hint(kind: str, value: Any) -> str:
    """Return what to write instead, for common pitfalls of YAML and of units."""
    if value is None:
        return "; the key has no value"
    if kind == "bool_type" and str(value).lower() in ("yes", "no", "on", "off", "y", "n", "0", "1"):
        return "; write true or false"
    if kind not in ("float_type", "int_type") or not isinstance(value, str):
        return ""
    if isinstance(read_scalar(value), int | float):
        return "; leave out the quotes"
    if re.fullmatch(r"[-+]?\d[\d_]*_[\d_]*(\.[\d_]*)?", value):
        return "; leave out the underscores"
    if re.fullmatch(r"[-+]?\d+(:\d+)+(\.\d*)?", value):
        return "; write one number in the key's unit"
    if re.fullmatch(r"[-+]?\d+,\d+", value):
        return "; write a decimal point"
    if re.fullmatch(r"[-+]?[\d.]+([eE][-+]?\d+)?\s*[A-Za-zµ%/]+\S*", value):
        return "; numbers are SI and carry no unit"
    if re.search(r"[-+*/^()]", value) and re.search(r"\d", value):
        return "; expressions are not evaluated"
    return ""
