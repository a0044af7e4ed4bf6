"""`scene`: what the master's axes touch in place of a slave; its keys are those of its package."""

from __future__ import annotations

import json
from typing import Annotated, Any

from pydantic import SerializeAsAny, ValidationInfo, WrapValidator
from pydantic_core import PydanticCustomError

from tautwave import registry
from tautwave.config.keys.common import Block
from tautwave.errors import ConfigError

SCENE = "scene"
"""The key, and the name of the entry point behind it."""


class ControlKeys(Block):
    """Keys of what stands between the axes in place of a coupling."""

    @classmethod
    def model_for(cls, value: Any) -> type[ControlKeys]:
        """Return the block for `value` of the file; without its package one without keys."""
        if isinstance(value, ControlKeys):
            return type(value)
        try:
            model: type[ControlKeys] = registry.control_hooks(SCENE, "config").model_for(value)
        except ConfigError:
            return ControlKeys
        return model


def _choose(value: Any, handler: Any, info: ValidationInfo) -> Any:
    if isinstance(value, ControlKeys):
        return value
    try:
        registry.load_control(SCENE)
    except ConfigError as err:
        raise PydanticCustomError("part", "{text}", {"text": str(err)}) from None
    model = ControlKeys.model_for(value)
    if info.mode == "json":  # JSON mode accepts lists for tuples
        return model.model_validate_json(json.dumps(value), strict=True)
    return model.model_validate(value, strict=True)


AnyControl = Annotated[SerializeAsAny[ControlKeys], WrapValidator(_choose)]
