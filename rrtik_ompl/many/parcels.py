"""What many jobs have in common: pickled once, sent to a process once (see `many.guard`), and unpacked there once."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
from numpy.typing import NDArray

Parcel = NDArray[np.uint8]


class _Last:
    """The parcel that was unpacked last in this process, and what it holds."""

    parcel: Parcel | None = None
    content: Any = None


def packed(content: object) -> Parcel:
    """Return what jobs have in common as the bytes that are sent to another process."""
    return np.frombuffer(pickle.dumps(content), np.uint8)


def unpacked(parcel: Parcel) -> Any:  # noqa: ANN401 - whatever was packed
    """Return what a parcel holds: the same object for consecutive jobs with the same parcel."""
    if _Last.parcel is not parcel:
        _Last.content = pickle.loads(parcel.data)
        _Last.parcel = parcel
    return _Last.content
