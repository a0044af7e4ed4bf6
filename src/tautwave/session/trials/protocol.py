"""Protocols of user studies: a rig, its conditions, how often, in which order."""

from __future__ import annotations

import random
import zlib
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from tautwave.config.keys.common import Block, Name, NonNegative, Positive
from tautwave.config.messages import read_model
from tautwave.config.text.document import read_text
from tautwave.errors import ConfigError


class Protocol(Block):
    """One study."""

    rig: Annotated[str, Field(min_length=1)] = Field(
        description="The rig file; a relative path starts at the protocol's folder."
    )
    task: str = Field(default="", description="Task of the participant, as written in the table.")
    conditions: Annotated[dict[Name, dict[str, Any]], Field(min_length=1)] = Field(
        description="Conditions by name, each with the keys that it changes, as for "
        "--set: `{coupling.delay_s: 0.05}`."
    )
    repetitions: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=1, description="Trials of each condition."
    )
    order: Literal["blocks", "shuffled", "as_written"] = Field(
        default="blocks",
        description="blocks: every condition once in random order, then again; shuffled: all trials"
        " in random order. The seed and the participant's name decide.",
    )
    seed: int = Field(default=0, description="Of the order.")
    trial_s: Positive = Field(description="[s] After which a trial ends on its own.")
    break_every: Annotated[int, Field(ge=0)] = Field(
        default=0, description="Trials between breaks; 0: no breaks."
    )
    break_s: NonNegative = Field(default=0.0, description="[s] Minimum length of a break.")
    ask: bool = Field(default=True, description="Ask after each trial whether it was a success.")


class Trial(NamedTuple):
    """One trial: its number from 1, condition, and which of its repetitions, from 1."""

    number: int
    condition: str
    repetition: int


def read_protocol(path: Path) -> Protocol:
    """Return a protocol.

    Raises
    ------
    ConfigError
        It is wrong; every mistake with its line.
    """
    document, validated = read_model(read_text(path, "protocol"), str(path), "protocol", Protocol)
    if document.problems or validated is None:
        raise ConfigError(document.sentences())
    protocol: Protocol = validated
    return protocol


def trials_of(protocol: Protocol, participant: str) -> list[Trial]:
    """Return the trials in the order of this participant."""
    stream = random.Random((protocol.seed << 32) + zlib.crc32(participant.encode()))
    names = list(protocol.conditions)
    order: list[tuple[str, int]] = []
    for repetition in range(1, protocol.repetitions + 1):
        block = [(name, repetition) for name in names]
        if protocol.order == "blocks":
            stream.shuffle(block)
        order += block
    if protocol.order == "shuffled":
        stream.shuffle(order)
    return [Trial(number, *one) for number, one in enumerate(order, 1)]
