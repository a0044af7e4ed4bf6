"""How the rows of a recording lie in its MCAP file."""

from __future__ import annotations

from typing import Any

import numpy as np

MAGIC = b"\x89MCAP0\r\n"
METADATA_NAME = "tautwave"
ENDING_NAME = "tautwave ending"
DESCRIBED = "described"
"""Key of the metadata: unit and meaning of each column, as JSON."""


def record_type(columns: int) -> np.dtype[Any]:
    """NumPy type of one message record of `columns` floats, from its opcode to its last float."""
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("cdr", "V4"),
            ("row", "<f8", (columns,)),
        ]
    )
