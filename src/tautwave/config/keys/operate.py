"""`operate`: how a rig is brought from one state to the next by the people around it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, field_validator
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import Block, NonNegative, Positive
from tautwave.config.keys.key_codes import CODES


def _check_key(name: Any) -> Any:
    if isinstance(name, str) and name not in CODES:
        raise PydanticCustomError(
            "key", "unknown key {name}; keys are KEY_A, KEY_SPACE, BTN_LEFT ...", {"name": name}
        )
    return name


KeyName = Annotated[str, BeforeValidator(_check_key)]
Word = Literal[
    "toggle", "engage", "clutch", "hold", "rest", "stop", "episode", "success", "failed", "again",
    "take_over", "hand_back",
]  # fmt: skip


class KeyDevice(Block):
    """A HID device whose keys give commands: a keyboard, a foot pedal, a button."""

    device: Annotated[str, Field(min_length=1)] = Field(
        description="Device file, such as `/dev/input/by-id/usb-...-event-kbd`; other programs do "
        "not receive its keys meanwhile."
    )
    keys: dict[KeyName, Word] = Field(
        default_factory=dict,
        description="Commands by key, such as `KEY_A: toggle`, in the names of Linux.",
    )
    dead_man: KeyName | None = Field(
        default=None,
        description="The rig engages only while this key is held; if released or disconnected, it "
        "holds.",
    )


class Trigger(Block):
    """Lines of a serial port beside the rig."""

    port: Annotated[str, Field(min_length=1)] = Field(
        description="Serial port: its RTS and DTR are on while an episode runs. A pipe receives "
        "the bytes 1 and 0."
    )
    command: Word | None = Field(default=None, description="Command given when CTS is asserted.")


class Resting(Block):
    """How axes are held, and how slaves are brought into place before they engage."""

    align_speed: Positive = Field(
        default=0.3,
        description="[rad/s | m/s] Maximum speed at which a slave moves to its master's position.",
    )
    align_acceleration: Positive = Field(
        default=1.0, description="[rad/s^2 | m/s^2] Maximum acceleration of that motion."
    )
    align_effort_share: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.2,
        description="Maximum effort of that motion, as a share of the slave's effort limit.",
    )
    hold_effort_share: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0,
        description="Maximum effort with which a held axis resists being moved from its place, as "
        "a share of what its load leaves of its effort limit; beyond it, the axis slips. 0: it is "
        "only damped.",
    )


class Episodes(Block):
    """Episodes that begin and end by themselves while the rig is engaged, as for a dataset."""

    count: Annotated[int, Field(ge=1, le=100_000)] = Field(
        description="Episodes to keep; after the last one, and its `reset_s`, the run ends. Those "
        "that are recorded again do not count."
    )
    episode_s: Positive = Field(description="[s] Length of an episode; it may be ended before.")
    reset_s: NonNegative = Field(
        default=5.0, description="[s] Between two episodes; the next may be begun before."
    )
    name: Annotated[str, Field(pattern=r"^\S{1,60}$")] = Field(
        default="episode", description="Name of each, a single word."
    )

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        if name in ("success", "failed", "again"):
            raise PydanticCustomError("name", "ends an episode; choose another name")
        return name


class PolicyLead(Block):
    """A program leads the real masters, each by its own motor, until a person takes over."""

    fps: Positive = Field(
        default=30.0,
        description="[Hz] Actions per second; the rig holds after three missing in a row.",
    )
    velocity_share: Annotated[float, Field(gt=0, le=0.9)] = Field(
        default=0.25,
        description="Maximum speed of the led master, as a share of its velocity limit.",
    )
    effort_share: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.5,
        description="Maximum effort that leads it, as a share of what its load leaves of its "
        "effort limit; a person who holds the master feels no more.",
    )
    leader: Literal["policy", "person"] = Field(
        default="policy",
        description="Who leads first; `take_over` and `hand_back` change it while the rig runs.",
    )


class Operate(Resting):
    """A rig that people operate, by keys, a script or a program."""

    start: Literal["idle", "engaged"] = Field(
        default="idle",
        description="State after enabling: idle waits for `engage`; engaged gives that command.",
    )
    scales: Annotated[tuple[Positive, ...], Field(strict=False)] = Field(
        default=(),
        description="Factors on every pair's `position_scale` that the command `scale` can "
        "select, besides 1; the rig is certified with each.",
    )
    key_devices: Annotated[tuple[KeyDevice, ...], Field(strict=False)] = Field(
        default=(),
        description="HID devices that give commands; one of their keys may be a dead-man switch.",
    )
    task: str = Field(
        default="",
        max_length=200,
        description="What is done in episodes whose mark does not say it, for a dataset; "
        "`run --task` sets it.",
    )
    episodes: Episodes | None = Field(
        default=None,
        description="Begins and ends episodes by the clock while the rig is engaged.",
    )
    policy: PolicyLead | None = Field(
        default=None,
        description="Actions of a program lead the masters by their own motors; a person takes "
        "over with `take_over`.",
    )
    trigger: Trigger | None = Field(
        default=None, description="Serial-port lines that signal episodes or give a command."
    )
