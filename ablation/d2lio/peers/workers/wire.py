# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages between a peer's worker and us: a JSON header and raw arrays.

A message is `MAGIC`, the header's length (uint32, little endian), the header, then the bytes of the
arrays in the order of the header's `arrays` (name, dtype, shape). Only numpy is needed, so both
sides use this file.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

MAGIC = b"D2LP"
LARGEST = 1 << 30  # bytes; more than any scan, less than what garbage can ask for
PREFIX = struct.Struct("<4sI")

Arrays = dict[str, np.ndarray]


class WireError(ValueError):
    """What came is not a message."""


def pack(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray] | None = None) -> bytes:
    """One message as bytes."""
    blocks = {name: np.ascontiguousarray(array) for name, array in (arrays or {}).items()}
    described = [[name, array.dtype.str, list(array.shape)] for name, array in blocks.items()]
    text = json.dumps({**header, "arrays": described}).encode()
    payload = b"".join(array.tobytes() for array in blocks.values())
    return PREFIX.pack(MAGIC, len(text)) + text + payload


def unpack(read: Callable[[int], bytes]) -> tuple[dict[str, Any], Arrays]:
    """The next message; `read(n)` gives exactly n bytes.

    Raises:
        WireError: the bytes are no message.
    """
    magic, length = PREFIX.unpack(read(PREFIX.size))
    if magic != MAGIC or length > LARGEST:
        raise WireError(f"bytes that are no message: {magic!r}")
    try:
        header = json.loads(read(length))
        described = [(str(n), np.dtype(d), tuple(map(int, s))) for n, d, s in header.pop("arrays")]
    except (ValueError, TypeError, KeyError, AttributeError) as err:
        raise WireError(f"a header that is none: {err}") from None
    arrays = {}
    for name, dtype, shape in described:
        size = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
        if dtype.hasobject or min(shape, default=0) < 0 or not 0 <= size <= LARGEST:
            raise WireError(f"an array {name} of shape {shape} and type {dtype}")
        arrays[name] = np.frombuffer(bytearray(read(size)), dtype).reshape(shape)
    return header, arrays
