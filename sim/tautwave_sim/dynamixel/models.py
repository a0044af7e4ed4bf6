"""All models by name and number."""

from __future__ import annotations

from difflib import get_close_matches

from tautwave_sim.dynamixel.items import Model
from tautwave_sim.dynamixel.old_series import old_series
from tautwave_sim.dynamixel.x_series import x_series

MODELS: dict[str, Model] = {model.name: model for model in (*x_series(), *old_series())}


def find_model(name: str, firmware: int | None = None) -> Model:
    """Return a model by its name, with the table that a firmware version has.

    Raises
    ------
    ValueError
        There is none of this name.
    """
    if name not in MODELS:
        close = get_close_matches(name.upper(), MODELS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(MODELS)}"
        raise ValueError(f"there is no servo model {name!r}; {hint}")
    model = MODELS[name]
    if firmware is None:
        return model
    if model.protocol >= 2.0:
        again = x_series(firmware_430=firmware, firmware_330=firmware)
        return next(one for one in again if one.name == name)
    return model
