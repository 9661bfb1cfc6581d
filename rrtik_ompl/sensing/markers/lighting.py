"""How a picture shows ideal markers: light that changes over them, a tone curve, white that is cut off."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
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
    return np.asarray(_shown([ideal], seen, [tone])[0].reshape(ideal.shape), dtype=np.float32)


def likenesses(ideals: list[Pixels], seen: Pixels, tones: list[float]) -> Vector:
    """How like a picture is to some ideal markers that are shown by some tones: correlations. Shape (k,).

    Args:
        ideals: k of them, or one for all tones.
        seen: The picture, as for `shown`.
        tones: k of them, or one for all ideals.
    """
    models = _shown(ideals, seen, tones)
    models -= models.mean(axis=1, keepdims=True)
    middle = seen.ravel() - seen.mean()
    found = models @ middle / np.sqrt(np.einsum("ij,ij->i", models, models) * (middle @ middle) + 1e-9)
    return np.asarray(found, dtype=np.float64)


def _shown(ideals: list[Pixels], seen: Pixels, tones: list[float]) -> Pixels:
    """Of each ideal and its tone, as a row: all by one product of matrices, for markers are small. Shape (k, n)."""
    even, pairs = _even(*seen.shape)
    grey = seen.ravel()
    whole = (grey < CUT_OFF).astype(np.float32)
    shares = np.stack([ideal.ravel() for ideal in ideals]) / np.float32(255.0)
    places = np.clip(np.rint(grey), 0, 255).astype(np.intp)
    lights = np.stack([light_of(tone)[places] for tone in tones])

    # Normal equations of three numbers for black and three for white, of what is not cut off.
    known = (pairs * whole).T
    squares = [np.ones((1, len(grey)), dtype=np.float32) @ known, shares @ known, (shares * shares) @ known]
    normal = np.empty((len(shares), 6, 6))
    for (row, column), product in zip(((0, 0), (0, 3), (3, 3)), squares, strict=True):
        normal[:, row : row + 3, column : column + 3] = product.reshape(-1, 3, 3)
    normal[:, 3:, :3] = normal[:, :3, 3:]

    inside = (even * whole).T
    right = np.empty((max(len(shares), len(tones)), 6))
    right[:, :3] = lights @ inside
    right[:, 3:] = (lights * shares) @ inside

    weights = np.linalg.solve(normal + 1e-3 * np.eye(6), right[..., None])[..., 0].astype(np.float32)
    made = weights[:, :3] @ even + shares * (weights[:, 3:] @ even)
    if len(tones) == 1:
        return coded_values(made, tones[0])
    return np.stack([coded_values(row, tone) for row, tone in zip(made, tones, strict=True)])


@lru_cache(maxsize=64)
def _even(height: int, width: int) -> tuple[Pixels, Pixels]:
    """One, and what changes evenly across and down, shape (3, height * width); the products of each two, (9, ...)."""
    down, across = np.mgrid[-1.0 : 1.0 : height * 1j, -1.0 : 1.0 : width * 1j].astype(np.float32)
    found = np.stack([np.ones(height * width, dtype=np.float32), across.ravel(), down.ravel()])
    pairs = (found[:, None] * found).reshape(9, -1)

    for each in (found, pairs):
        each.flags.writeable = False

    return found, pairs
