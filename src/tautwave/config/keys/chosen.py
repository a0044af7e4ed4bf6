"""Blocks that may be a part: `part` names one that is installed, or its file."""

from __future__ import annotations

import json
import types
from collections.abc import Callable
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import AfterValidator, Field, TypeAdapter, ValidationInfo
from pydantic_core import PydanticCustomError

from tautwave import registry
from tautwave.config.keys.common import Block
from tautwave.errors import ConfigError

PartName = Annotated[
    str,
    Field(description="Name of an installed part (`tautwave drivers` lists them), or a .py file."),
]
PartHash = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
PART_HASH = Field(
    default=None,
    description="SHA-256 of the part's file as resolved by a run; any other text is rejected.",
)


def part_keys(base: type[Block], name: str) -> type[Block]:
    """Return the keys of the part `name`, of the group of `base`.

    Raises
    ------
    ConfigError
        There is no such part, it does not load, or its keys are not a `base`.
    """
    keys = registry.load_named(registry.load_part(base.part_group, name).keys)
    if not (isinstance(keys, type) and issubclass(keys, base)):
        raise ConfigError(f"{name}: its keys are not a tautwave.config.{base.__name__}")
    keys.part_word = f"part {name}"
    return keys


def named_block(kind: Any, value: Any) -> Any:
    """Return the model for `value`, a mapping of the file, where `kind` is allowed.

    `kind` is the type of a key: if it is a union with a part, the result is the keys of the part
    that `value` names, or the rest of the union.
    """
    bases = [member for member in get_args(kind) if getattr(member, "part_group", "")]
    if not bases or get_origin(kind) not in (Union, types.UnionType):
        return kind
    if isinstance(value, dict) and isinstance(value.get("part"), str):
        return _keys_or_refusal(bases[0], value["part"])
    left = tuple(member for member in get_args(kind) if member not in bases)
    return Union[left] if len(left) > 1 else left[0]  # noqa: UP007 - from a tuple


def chosen_part(base: type[Block], otherwise: Any) -> Callable[[Any, Any, ValidationInfo], Any]:
    """Return a validator that uses the keys of the part a block names, else `otherwise`."""
    plain: TypeAdapter[Any] = TypeAdapter(otherwise)

    def choose(value: Any, handler: Any, info: ValidationInfo) -> Any:
        if isinstance(value, Block):
            return value
        model: Any = plain
        if isinstance(value, dict) and isinstance(value.get("part"), str):
            model = TypeAdapter(_keys_or_refusal(base, value["part"]))
        if info.mode == "json":  # lists may fill tuples there
            return model.validate_json(json.dumps(value), strict=True)
        return model.validate_python(value, strict=True)

    return choose


def _keys_or_refusal(base: type[Block], name: str) -> type[Block]:
    try:
        return part_keys(base, name)
    except ConfigError as err:
        return _refusing(base, str(err))


def _refusing(base: type[Block], text: str) -> type[Block]:
    """Return a block that reports the mistake at `part`."""

    def refuse(name: str) -> str:
        raise PydanticCustomError("part", "{text}", {"text": text})

    body = {
        "__annotations__": {"part": Annotated[str, AfterValidator(refuse)]},
        "model_config": {**base.model_config, "extra": "ignore"},
        "__module__": __name__,
    }
    made: type[Block] = types.new_class("UnknownPart", (base,), exec_body=lambda n: n.update(body))
    return made
