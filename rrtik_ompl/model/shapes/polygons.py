"""Simple polygons in the plane: validation and division into convex parts. Vertices have shape (k, 2) [m]."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError


def without_repeats(polygon: Matrix) -> Matrix:
    """Return the polygon without vertices that equal their successor, such as the repeated one of a closed ring."""
    vertices: Matrix = polygon[(polygon != np.roll(polygon, -1, axis=0)).any(axis=1)]
    return vertices


def check_simple(polygon: Matrix) -> None:
    """Refuse a polygon that is not simple.

    Raises:
        InputError: If two sides of the polygon cross or touch, or if it has no area.
    """
    a = polygon
    b = np.roll(polygon, -1, axis=0)
    from_first = a - a[0]
    farthest = from_first[np.linalg.norm(from_first, axis=1).argmax()]
    width = np.abs(from_first[:, 0] * farthest[1] - from_first[:, 1] * farthest[0]).max()
    extent = float(np.ptp(polygon, axis=0).max())
    if width <= 1e-12 * max(extent * extent, 1e-12):
        raise InputError("polygon has no area: its vertices lie on one line")

    for i in range(len(a)):
        if _turn(a[i - 1], a[i], b[i]) == 0.0 and (a[i] - a[i - 1]) @ (b[i] - a[i]) < 0.0:
            raise InputError(f"polygon folds back on itself at vertex {i}; delete it")
        for j in range(i + 2, len(a)):
            if (i, j) != (0, len(a) - 1) and _meet(a[i], b[i], a[j], b[j]):
                raise InputError(f"polygon crosses itself: side {i} meets side {j}; list its vertices in order")


def _meet(p: Vector, q: Vector, r: Vector, s: Vector) -> bool:
    """Check whether the segments p q and r s have a point in common."""
    if (np.maximum(p, q) < np.minimum(r, s)).any() or (np.maximum(r, s) < np.minimum(p, q)).any():
        return False
    return _turn(p, q, r) * _turn(p, q, s) <= 0.0 and _turn(r, s, p) * _turn(r, s, q) <= 0.0


def _turn(p: Vector, q: Vector, r: Vector) -> float:
    """Return twice the signed area of a triangle, which is positive if r lies left of the line p q."""
    return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))


def convex_parts(polygon: Matrix) -> tuple[Matrix, ...]:
    """Divide a simple polygon, shape (k, 2), into convex ones by ear clipping and greedy merging of neighbours."""
    area = np.sum(polygon[:, 0] * np.roll(polygon[:, 1], -1) - np.roll(polygon[:, 0], -1) * polygon[:, 1])
    ring = list(range(len(polygon))) if area > 0 else list(range(len(polygon)))[::-1]
    parts = [ring] if _is_convex(polygon, ring) else _merged(polygon, _ears(polygon, ring))
    return tuple(frozen(polygon[part]) for part in parts)


def _is_convex(polygon: Matrix, ring: list[int]) -> bool:
    size = len(ring)
    corners = ((polygon[ring[k]], polygon[ring[(k + 1) % size]], polygon[ring[(k + 2) % size]]) for k in range(size))
    return all(_turn(*corner) >= 0.0 for corner in corners)


def _ears(polygon: Matrix, ring: list[int]) -> list[list[int]]:
    """Triangulate by cutting ears [39].

    Args:
        polygon: All vertices, shape (k, 2).
        ring: Indices of vertices in counter-clockwise order.

    Returns:
        The triangles as lists of three indices.
    """
    rest = list(ring)
    triangles = []
    while len(rest) > 3:
        for k in range(len(rest)):
            before = rest[k - 1]
            tip = rest[k]
            after = rest[(k + 1) % len(rest)]
            p = polygon[before]
            q = polygon[tip]
            r = polygon[after]
            others = (polygon[i] for i in rest if i not in (before, tip, after))
            if _turn(p, q, r) > 0.0 and not any(_in_triangle(o, p, q, r) for o in others):
                triangles.append([before, tip, after])
                del rest[k]
                break
        else:  # Only straight corners are left, of which one is dropped, as it adds no area.
            flat = min(
                range(len(rest)), key=lambda k: abs(_turn(*(polygon[rest[(k + d) % len(rest)]] for d in (-1, 0, 1))))
            )
            del rest[flat]

    return [*triangles, rest]


def _in_triangle(point: Vector, p: Vector, q: Vector, r: Vector) -> bool:
    return _turn(p, q, point) >= 0.0 and _turn(q, r, point) >= 0.0 and _turn(r, p, point) >= 0.0


def _merged(polygon: Matrix, parts: list[list[int]]) -> list[list[int]]:
    """Merge neighbouring parts, lists of vertex indices, as long as their union is convex [40]."""
    parts = [list(part) for part in parts]
    while (found := _neighbours(polygon, parts)) is not None:
        i, j, union = found
        parts[i] = union
        del parts[j]
    return parts


def _neighbours(polygon: Matrix, parts: list[list[int]]) -> tuple[int, int, list[int]] | None:
    """Return the indices of the first two parts whose union is convex, and the union; None if there are none."""
    for i, j in combinations(range(len(parts)), 2):
        union = _joined(parts[i], parts[j])
        if union is not None and _is_convex(polygon, union):
            return i, j, union
    return None


def _joined(first: list[int], second: list[int]) -> list[int] | None:
    """Return the union of two counter-clockwise rings that share an edge, or None."""
    for k in range(len(first)):
        a = first[k]
        b = first[(k + 1) % len(first)]
        for m in range(len(second)):
            if second[m] == b and second[(m + 1) % len(second)] == a:
                around = [second[(m + 1 + s) % len(second)] for s in range(len(second))]  # the second ring from a to b
                return first[: k + 1] + around[1:-1] + first[k + 1 :]
    return None
