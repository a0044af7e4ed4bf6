"""The result of a run as types: `summary.json` is written and read here alone."""

from __future__ import annotations

from tautwave.summary.file import (
    checked,
    plain_summary,
    read_summary,
    summary_of,
    summary_text,
    with_unwritten_report,
    write_summary,
)
from tautwave.summary.model import Summary, summary_schema

__all__ = [
    "Summary",
    "checked",
    "plain_summary",
    "read_summary",
    "summary_of",
    "summary_schema",
    "summary_text",
    "with_unwritten_report",
    "write_summary",
]
