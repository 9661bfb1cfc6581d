"""Tone curves: how a camera codes light as grey values, and back.

Most cameras and files code light by the curve of sRGB (IEC 61966-2-1) or one like it, some do not. Lenses blur light,
not grey values: edges lie elsewhere in a coded picture, by a tenth of a pixel. The family of curves here has one
number, the tone: 0 for light itself, 1 for sRGB, in between and beyond by powers.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

LINEAR, SRGB = 0.0, 1.0
TONES = (-0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25)  # that are tried where none is known
_SHADES = 4096  # that are told apart
_TOE, _SLOPE, _LINK = 0.04045, 12.92, 0.055  # of sRGB's curve, a straight line below the toe


def coded(light: NDArray[np.float32], tone: float) -> NDArray[np.float32]:
    """Grey values of light, both from 0 to 1 (more is cut off at 1). Of the same shape.

    Args:
        light: From 0 for none to 1 for the brightest that is not cut off.
        tone: 0 linear, 1 sRGB.
    """
    # The inverse of `_decoded`, between 4097 of its values.
    value = np.linspace(0.0, 1.0, 4097)
    return np.interp(light, _decoded(value, tone), value).astype(np.float32)


@lru_cache(maxsize=256)
def light_of(tone: float) -> NDArray[np.float32]:
    """The light, from 0 to 255, of each of the 256 grey values of a picture. Shape (256,)."""
    table = (255.0 * _decoded(np.arange(256) / 255.0, tone)).astype(np.float32)
    table.flags.writeable = False
    return table


def coded_values(light: NDArray[np.float32], tone: float) -> NDArray[np.float32]:
    """Grey values of light, both from 0 to 255, by a table: for whole pictures. Of the same shape."""
    places = np.clip(light * np.float32((_SHADES - 1) / 255.0), 0.0, _SHADES - 1)
    return np.asarray(_grey_of(round(tone, 2))[np.rint(places).astype(np.intp)], dtype=np.float32)


@lru_cache(maxsize=256)
def _grey_of(tone: float) -> NDArray[np.float32]:
    table = np.float32(255.0) * coded(np.linspace(0.0, 1.0, _SHADES, dtype=np.float32), tone)
    table.flags.writeable = False
    return table


def _decoded(value: NDArray[np.float64], tone: float) -> NDArray[np.float64]:
    light = np.where(value <= _TOE, value / _SLOPE, ((value + _LINK) / (1.0 + _LINK)) ** 2.4)
    safe = np.maximum(value, 1e-12)
    return np.where(value > 0.0, safe * (np.maximum(light, 1e-12) / safe) ** tone, 0.0)
