"""Stand-ins for installed drivers: a loopback, a third party's hardware, and two broken ones."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import Budget, DriverPlugin
from tautwave.types import CommandDelay


class LoopbackOptions(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    command_delay_s: Annotated[float, Field(ge=0)] = 0.0


class Watchdog(BaseModel):
    model_config = ConfigDict(extra="forbid")

    timeout_s: Annotated[float, Field(gt=0)] = 0.05


class AcmeOptions(BaseModel):
    """A third party's model: no strictness of its own, nested, with a required key."""

    port: str
    baud: Literal[57600, 115200, 1000000] = 115200
    gains: tuple[float, float] = (1.0, 2.0)
    watchdog: Watchdog = Watchdog()


class OpenOptions(BaseModel):
    """A model that wants to see unknown keys."""

    model_config = ConfigDict(extra="allow")


def _none(*_: Any) -> Any:
    raise NotImplementedError


def _made(*_: Any) -> Any:
    """A driver that says when its commands act: an `auto` of the coupling asks."""
    return SimpleNamespace(command_delay=CommandDelay(0, 0.0))


def _budget(*_: Any) -> Budget:
    return Budget(0.0, float("inf"), "")


def _plugin(
    options: type[BaseModel], *, hardware: bool, needs: tuple[str, ...] = ()
) -> DriverPlugin:
    return DriverPlugin(options, _made, _budget, _none, needs, hardware, "a stand-in")


loopback = _plugin(LoopbackOptions, hardware=False)._replace(positions=True)
acme = _plugin(AcmeOptions, hardware=True, needs=("acme_sdk", "json"))
opened = _plugin(OpenOptions, hardware=False)
not_a_plugin = 3
