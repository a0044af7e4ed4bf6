"""A finished table of a sweep as Parquet: the same rows with their types, and their origin.

Types follow from the sweep, not from the first rows: a key whose values are integers is `int64`,
one with any fraction `double`, one of true and false `bool`; anything else is text as in the CSV.
Measures are `double`: NaN where a simulation gave NaN, null where there was none. A key that a case
does not vary is null there, or empty text.
"""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tautwave.sweep.file import SweepPlan

TEXTS = ("id", "case", "outcome")
INTEGERS = ("cycles",)
NO_PYARROW = "No Parquet file: it requires pyarrow (pip install 'tautwave[parquet]')."


def column_types(plan: SweepPlan, header: Iterable[str]) -> dict[str, str]:
    """Return Arrow's name of the type of each column."""
    values: dict[str, list[Any]] = {}
    for choice in plan.points.varied():
        values.setdefault(choice.key, []).append(choice.value)
    types = dict.fromkeys(header, "double")
    types.update({key: type_of(values[key]) for key in plan.keys})
    types.update(dict.fromkeys(TEXTS, "string"))
    types.update(dict.fromkeys(INTEGERS, "int64"))
    return types


def type_of(values: Iterable[Any]) -> str:
    """Return Arrow's name of the type that holds all values of a key."""
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return "bool"
    if kinds == {int}:
        return "int64" if all(abs(value) < 2**63 for value in values) else "string"
    return "double" if kinds <= {int, float} else "string"


def origin(plan: SweepPlan) -> dict[str, str]:
    """Return the origin written into a file: the sweep, its rig file and the varied keys."""
    from tautwave import __version__

    return {
        "tautwave.version": __version__,
        "tautwave.sweep": plan.sweep.model_dump_json(exclude_defaults=True),
        "tautwave.rig": plan.sweep.rig,
        "tautwave.varied": json.dumps(plan.keys),
        "tautwave.measures": json.dumps(plan.sweep.measures),
    }


def write_parquet(table: Path, types: Mapping[str, str], about: Mapping[str, str]) -> Path | None:
    """Write a finished table as Parquet beside it, piece by piece; None without pyarrow.

    Parameters
    ----------
    table : Path
        The CSV file.
    types : mapping
        Arrow's type of each column, in their order.
    about : mapping
        Kept in the file's metadata.
    """
    if find_spec("pyarrow") is None:
        return None
    arrow: Any = importlib.import_module("pyarrow")
    reader: Any = importlib.import_module("pyarrow.csv")
    parquet: Any = importlib.import_module("pyarrow.parquet")
    fields = [(name, arrow.type_for_alias(kind)) for name, kind in types.items()]
    schema = arrow.schema(fields, metadata=dict(about))
    options = reader.ConvertOptions(
        column_types=schema,
        null_values=[""],
        true_values=["true"],
        false_values=["false"],
    )
    target = table.with_suffix(".parquet")
    part = table.with_suffix(".parquet.part")
    with (
        reader.open_csv(
            table, reader.ReadOptions(use_threads=False), convert_options=options
        ) as batches,
        parquet.ParquetWriter(part, schema) as out,
    ):
        for batch in batches:
            out.write_batch(batch.cast(schema))
    os.replace(part, target)
    return target
