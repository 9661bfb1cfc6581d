"""Triangles drawn in numpy, where OpenCV is older than 5 and has no rasteriser: the same picture, some times slower.

The ray r = (x, y, 1) of a pixel meets the plane of the triangle P0, P1, P2 at the depth d where d r = s0 P0 + s1 P1 +
s2 P2, with shares s that add up to one. So s / d = inv([P0 P1 P2]) r is linear in the pixel, also for a triangle that
reaches behind the camera, and nothing is clipped (M. Olano and T. Greer, "Triangle scan conversion using 2D homogeneous
coordinates", 1997).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector

MOST_PIXELS = 1_000_000  # that are looked at together; bounds the memory

Floats = NDArray[np.float32]


def rasterize(
    points: Floats,
    faces: NDArray[np.int32],
    colors: Floats,
    picture: tuple[Floats, Floats],
    matrix: Matrix,
    depth_range: tuple[float, float],
    *,
    both_sides: bool = False,
) -> None:
    """Draw triangles over what a picture shows; what lies behind that stays hidden.

    Args:
        points: Vertices in the frame of the camera (z forward, y down) [m], shape (n, 3).
        faces: Vertex indices, counter-clockwise seen from outside, shape (m, 3).
        colors: Of the vertices, shape (n, 3).
        picture: Colours, shape (height, width, 3), and depths [m], shape (height, width); both are changed.
        matrix: Of the camera, without distortion, shape (3, 3).
        depth_range: The nearest and the farthest depth that is drawn [m].
        both_sides: Whether to draw triangles that are seen from inside, too.
    """
    shown, depths = picture
    corners = points[faces].astype(np.float64)
    a, b, c = (corners[:, k] for k in range(3))
    normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    volumes = np.einsum("ij,ij->i", a, normals[:, 0])  # negative where the outside faces the camera

    low, high = _boxes(corners, matrix, depths.shape, depth_range[0])
    seen = (volumes != 0.0 if both_sides else volumes < 0.0) & (low <= high).all(axis=1)
    seen &= (corners[:, :, 2] > depth_range[0]).any(axis=1)
    inverses = normals[seen] / volumes[seen, None, None] @ np.linalg.inv(matrix)
    sizes = high[seen] - low[seen] + 1
    counts = sizes.prod(axis=1)

    # Triangles in a row, as many as have few pixels in their boxes.
    parts = np.flatnonzero(np.diff(np.cumsum(counts) // MOST_PIXELS)) + 1
    for share in np.split(np.arange(len(counts)), parts):
        owners = np.repeat(share, counts[share])
        places = np.arange(len(owners)) - np.repeat(np.cumsum(counts[share]) - counts[share], counts[share])
        columns = low[seen][owners, 0] + places % sizes[owners, 0]
        rows = low[seen][owners, 1] + places // sizes[owners, 0]

        # s / d of one corner after the other, where those before are not negative.
        shares: list[Vector] = []
        for slope in np.moveaxis(inverses, 1, 0):
            share_here = slope[owners, 0] * columns + slope[owners, 1] * rows + slope[owners, 2]
            inside = np.flatnonzero(share_here >= 0.0)
            shares = [each[inside] for each in (*shares, share_here)]
            owners, columns, rows = owners[inside], columns[inside], rows[inside]

        total = shares[0] + shares[1] + shares[2]
        deep = (1.0 / np.maximum(total, 1e-30)).astype(np.float32)

        kept = np.flatnonzero((deep >= depth_range[0]) & (deep < depths[rows, columns]))
        np.minimum.at(depths, (rows[kept], columns[kept]), deep[kept])
        kept = kept[deep[kept] == depths[rows[kept], columns[kept]]]
        corners_of = faces[seen][owners[kept]]
        mixed = sum(colors[corners_of[:, k]] * (shares[k] * deep)[kept, None] for k in range(3))
        shown[rows[kept], columns[kept]] = mixed


def _boxes(
    corners: Matrix, matrix: Matrix, size: tuple[int, ...], nearest: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the lowest and highest column and row of pixels whose centres a triangle may cover, each shape (m, 2).

    Of a triangle that reaches behind the camera these are the whole picture.
    """
    last = np.array(size[::-1]) - 1
    behind = np.less(corners[:, :, 2].min(axis=1), nearest)
    pixels = corners[:, :, :2] / np.where(behind[:, None, None], 1.0, corners[:, :, 2:])
    pixels = pixels * np.diag(matrix)[:2] + matrix[:2, 2]
    low = np.clip(np.ceil(pixels.min(axis=1) - 1e-6), 0, last + 1)
    high = np.clip(np.floor(pixels.max(axis=1) + 1e-6), -1, last)
    whole = behind[:, None]
    return np.where(whole, 0, low).astype(np.int64), np.where(whole, last, high).astype(np.int64)
