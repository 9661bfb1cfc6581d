"""How a picture shows an ideal marker: light that changes over it, a tone curve, white that is cut off."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.sensing.cameras.tone import coded_values, light_of

Pixels = NDArray[np.float32]

CUT_OFF = 250.0  # a larger grey value may be of any light


def shown(ideal: Pixels, seen: Pixels, tone: float) -> Pixels:
    """An ideal marker, blurred, as a picture shows it. Of the same shape.

    Black and white each have a light that changes evenly over the marker; both are fitted to the picture, where it is
    not cut off.

    Args:
        ideal: From 0 to 255.
        seen: The picture in its frame, of the same shape.
        tone: Of the picture.
    """
    height, width = ideal.shape
    share = ideal.ravel() / np.float32(255.0)
    even = _even(height, width)
    columns = np.concatenate([even, share * even])
    whole = seen.ravel() < CUT_OFF
    light = light_of(tone)[np.clip(np.rint(seen.ravel()), 0, 255).astype(np.intp)]
    inside = columns * whole
    normal = (inside @ columns.T).astype(np.float64) + 1e-3 * np.eye(6)
    weights = np.linalg.solve(normal, (inside @ light).astype(np.float64))
    made = weights.astype(np.float32) @ columns
    return coded_values(made, tone).reshape(ideal.shape)


@lru_cache(maxsize=64)
def _even(height: int, width: int) -> Pixels:
    """One, and what changes evenly across and down. Shape (3, height * width)."""
    down, across = np.mgrid[-1.0 : 1.0 : height * 1j, -1.0 : 1.0 : width * 1j].astype(np.float32)
    found = np.stack([np.ones(height * width, dtype=np.float32), across.ravel(), down.ravel()])
    found.flags.writeable = False
    return found
