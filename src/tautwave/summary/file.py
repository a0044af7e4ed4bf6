"""`summary.json` as a file: the only place that reads it or writes it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from tautwave import formats
from tautwave.config.guard import parse_json, read_guarded
from tautwave.errors import ConfigError, RecordingError
from tautwave.files import json_ready, write_text
from tautwave.summary.model import Summary
from tautwave.summary.older import upgraded

NAME = "summary.json"

Part = TypeVar("Part", bound=BaseModel)

LARGEST = 16 * 1024 * 1024
"""Bytes of a file that is read: a run of many pairs leaves some 100 kB."""


def plain_summary(summary: Summary) -> dict[str, Any]:
    """Return the content of `summary.json` as plain data: what is known, and nothing else."""
    data = summary.model_dump(mode="json", exclude_unset=True)
    return {"format": formats.SUMMARY, **data}


def summary_text(summary: Summary) -> str:
    """Return the text of `summary.json`."""
    return json.dumps(plain_summary(summary), indent=2, allow_nan=False) + "\n"


def write_summary(directory: Path, summary: Summary) -> None:
    """Write the summary into the directory of a run.

    Raises
    ------
    WritingError
        It cannot be written.
    """
    write_text(directory / NAME, summary_text(summary))


def with_unwritten_report(summary: Summary, reason: str, no_room: bool) -> Summary:
    """Return a summary that says why its report is missing; without room the run is incomplete."""
    sentence = f"the report could not be written: {reason}"
    update = {"report_error": sentence}
    if no_room:
        update["incomplete"] = "; ".join(filter(None, (summary.incomplete, sentence)))
    return summary.model_copy(update=update)


def read_summary(directory: Path) -> tuple[Summary, list[str]]:
    """Return the summary in the directory of a run, of any version, and what is wrong with it.

    What is wrong there is left out, each with a sentence; unknown keys are those of a later
    tautwave that writes the same version.

    Raises
    ------
    ConfigError
        There is none that can be read.
    RecordingError
        It is of a newer version.
    """
    path = directory / NAME
    try:
        data = parse_json(read_guarded(path, "summary", LARGEST))
    except ConfigError as err:
        raise ConfigError(str(err).replace(str(path), NAME, 1)) from err
    except ValueError as err:
        raise ConfigError(f"{NAME} cannot be read: {err}") from err
    if not isinstance(data, dict) or not data:
        raise ConfigError(f"{NAME} holds no summary")
    newer = formats.too_new("summary", data.get("format"), formats.SUMMARY)
    if newer is not None:
        raise RecordingError(f"{path}: format {newer}")
    return summary_of(data)


def checked(model: type[Part], data: Any) -> Part:
    """Return data as a part of the summary, as it would be read from the file.

    Raises
    ------
    ValidationError
        It is not what the part declares.
    """
    return model.model_validate_json(json.dumps(json_ready(data)))


def summary_of(data: Mapping[str, Any]) -> tuple[Summary, list[str]]:
    """Return data as a summary, and a sentence on each value in it that is left out as wrong."""
    known: Any = upgraded(data)
    wrong: list[str] = []
    while True:
        try:
            return checked(Summary, known), wrong
        except ValidationError as err:
            for place, sentence in _mistakes(err):
                known = _without(known, place)
                wrong += [f"{NAME}: {sentence}"] if sentence else []


def _mistakes(err: ValidationError) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield where something is wrong, the last first, and what; '' for a key that is unknown."""
    for one in reversed(err.errors(include_url=False, include_context=False)):
        # A missing key makes its whole block unreadable; a wrong key of a mapping ends in [key].
        place = one["loc"][:-1] if one["type"] == "missing" else one["loc"]
        place = place[:-1] if place[-1:] == ("[key]",) else place
        if one["type"] == "extra_forbidden":
            yield place, ""
        else:
            sentence = f"{'.'.join(map(str, one['loc']))}: {one['msg']}"
            yield place, f"{sentence}; it is left out"


def _without(data: Any, place: tuple[str | int, ...]) -> Any:
    """Return data without the value at a place, or without the nearest block that is there."""
    if not place:
        return {}
    key, *rest = place
    if isinstance(data, dict) and key in data:
        if rest and isinstance(data[key], dict | list):
            return {**data, key: _without(data[key], tuple(rest))}
        return {name: value for name, value in data.items() if name != key}
    if isinstance(data, list) and isinstance(key, int) and key < len(data):
        if rest and isinstance(data[key], dict | list):
            return [*data[:key], _without(data[key], tuple(rest)), *data[key + 1 :]]
        return [*data[:key], *data[key + 1 :]]
    return data
