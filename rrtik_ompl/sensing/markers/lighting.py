"""Model how a picture renders ideal markers: uneven light, a tone curve, and white that is clipped.

Most cameras and files code light by the curve of sRGB (IEC 61966-2-1) or a similar one, some do not. Lenses blur light,
not grey values: this moves edges in the coded picture by a tenth of a pixel. The family of curves used here has one
parameter, the tone: 0 for linear light, 1 for sRGB, and powers of the curve in between and beyond.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector

Pixels = NDArray[np.float32]

CUT_OFF = 250.0  # larger grey values may be clipped
LINEAR, SRGB = 0.0, 1.0
TONES = (-0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25)  # tones that are tried if none is known
_SHADES = 4096  # resolution of the table of grey values
_TOE, _SLOPE, _LINK = 0.04045, 12.92, 0.055  # parameters of sRGB's curve, which is linear below the toe


def shown(ideal: Pixels, seen: Pixels, tone: float) -> Pixels:
    """Render a blurred ideal marker as in a picture; the result has the same shape.

    The light on black and on white cells each varies linearly over the marker. Both are fitted to those pixels of the
    picture that are not clipped.

    Args:
        ideal: The marker, values from 0 to 255.
        seen: The picture in the frame of the marker, of the same shape.
        tone: Tone of the picture.
    """
    return np.asarray(_shown_rows([ideal], seen, [tone])[0].reshape(ideal.shape), dtype=np.float32)


def likenesses(ideals: list[Pixels], seen: Pixels, tones: list[float]) -> Vector:
    """Return the correlations of a picture with several renderings of ideal markers, shape (k,).

    Args:
        ideals: k markers, or one for all tones.
        seen: The picture, as for `shown`.
        tones: k tones, or one for all markers.
    """
    models = _shown_rows(ideals, seen, tones)
    models -= models.mean(axis=1, keepdims=True)
    centred = seen.ravel() - seen.mean()
    correlations = models @ centred / np.sqrt(np.einsum("ij,ij->i", models, models) * (centred @ centred) + 1e-9)
    return np.asarray(correlations, dtype=np.float64)


def _shown_rows(ideals: list[Pixels], seen: Pixels, tones: list[float]) -> Pixels:
    """Render ideal markers as rows of an array, shape (k, n), with one matrix product for all, as markers are small."""
    basis, basis_products = _even_light(*seen.shape)
    grey = seen.ravel()
    not_cut_off = (grey < CUT_OFF).astype(np.float32)
    whiteness = np.stack([ideal.ravel() for ideal in ideals]) / np.float32(255.0)
    grey_indices = np.clip(np.rint(grey), 0, 255).astype(np.intp)
    lights = np.stack([light_of(tone)[grey_indices] for tone in tones])

    # Set up the normal equations of three coefficients for black and three for white, from pixels that are not clipped.
    known_products = (basis_products * not_cut_off).T
    products = [
        np.ones((1, len(grey)), dtype=np.float32) @ known_products,
        whiteness @ known_products,
        (whiteness * whiteness) @ known_products,
    ]
    normal = np.empty((len(whiteness), 6, 6))
    for (row, column), product in zip(((0, 0), (0, 3), (3, 3)), products, strict=True):
        normal[:, row : row + 3, column : column + 3] = product.reshape(-1, 3, 3)
    normal[:, 3:, :3] = normal[:, :3, 3:]

    known_basis = (basis * not_cut_off).T
    right_sides = np.empty((max(len(whiteness), len(tones)), 6))
    right_sides[:, :3] = lights @ known_basis
    right_sides[:, 3:] = (lights * whiteness) @ known_basis

    weights = np.linalg.solve(normal + 1e-3 * np.eye(6), right_sides[..., None])[..., 0].astype(np.float32)
    linear_light = weights[:, :3] @ basis + whiteness * (weights[:, 3:] @ basis)
    if len(tones) == 1:
        return coded_values(linear_light, tones[0])
    return np.stack([coded_values(row, tone) for row, tone in zip(linear_light, tones, strict=True)])


@lru_cache(maxsize=64)
def _even_light(height: int, width: int) -> tuple[Pixels, Pixels]:
    """Return the basis 1, x, y of light that varies linearly, and the products of each two of its elements.

    Returns:
        Shapes (3, height * width) and (9, height * width).
    """
    down, across = np.mgrid[-1.0 : 1.0 : height * 1j, -1.0 : 1.0 : width * 1j].astype(np.float32)
    basis = np.stack([np.ones(height * width, dtype=np.float32), across.ravel(), down.ravel()])
    products = (basis[:, None] * basis).reshape(9, -1)

    for array in (basis, products):
        array.flags.writeable = False

    return basis, products


def coded(light: NDArray[np.float32], tone: float) -> NDArray[np.float32]:
    """Convert light to grey values by the tone curve, both from 0 to 1; brighter light is clipped.

    Args:
        light: From 0 for none to 1 for the brightest that is not clipped.
        tone: 0 for linear, 1 for sRGB.
    """
    # `_decoded` is inverted by interpolation between 4097 of its values.
    value = np.linspace(0.0, 1.0, 4097)
    return np.interp(light, _decoded(value, tone), value).astype(np.float32)


@lru_cache(maxsize=256)
def light_of(tone: float) -> NDArray[np.float32]:
    """Return the light, from 0 to 255, of each of the 256 grey values, shape (256,)."""
    table = (255.0 * _decoded(np.arange(256) / 255.0, tone)).astype(np.float32)
    table.flags.writeable = False
    return table


def coded_values(light: NDArray[np.float32], tone: float) -> NDArray[np.float32]:
    """Convert light to grey values, both from 0 to 255, by a table, which is fast for whole pictures."""
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
