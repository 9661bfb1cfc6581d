"""The numbers of one box in the tables of a scene, as packing computes them for all bodies.

See :mod:`.scene_tables` and :mod:`.solid_tables`; for a single body numpy takes ten times as long as numbers of Python.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, sqrt
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.geometry.collision.shape_table import Core
from rrtik_ompl.kernels.tables import scene_tables, solid_tables
from rrtik_ompl.kernels.tables.primitive_tables import above, below

Three: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class BoxNumbers:
    """A box where it is now.

    Attributes:
        outer, inner: Numbers of the primitives around and inside it, 16 each.
        bounds: Boxes around these in the world: sides of x, y, z, lower and upper one, shape (2, 3, 2).
        sizes: Of its solid, 10 numbers.
        corners: Of its solid, shape (8, 3).
    """

    outer: list[float]
    inner: list[float]
    bounds: NDArray[np.float32]
    sizes: list[float]
    corners: list[Three]


def box_numbers(core: Core, placement: pin.SE3, kept: float) -> BoxNumbers | None:
    """A box that stands still; None for one so thin, large or far away that it drops out of some table.

    Args:
        core: The box.
        placement: Where it is, ``pinocchio.SE3``.
        kept: What has to stay away from it [m].
    """
    assert core.half_sides is not None
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = placement.homogeneous.tolist()
    half = core.half_sides.tolist()
    far = max(abs(x), abs(y), abs(z))
    slack = scene_tables.SLACK_PER_METRE * (1.0 + far + sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]))
    turn = [x, y, z, a, d, g, b, e, h, c, f, i]
    numbers = list[list[float]]()
    sides = list[list[float]]()

    for grown in (slack + kept, -slack):
        u = half[0] + grown
        v = half[1] + grown
        w = half[2] + grown
        spread = [abs(m) * u + abs(n) * v + abs(o) * w for m, n, o in ((a, b, c), (d, e, f), (g, h, i))]
        beside = scene_tables.SLACK_PER_METRE * (1.0 + far + max(spread))
        if min(u, v, w) < 0.0 or max(far, u, v, w) >= solid_tables.MAX_COMPARED_SIZE:
            return None

        numbers.append([*turn, u, v, w, 0.0])
        sides.append([p - (s + beside) for p, s in zip((x, y, z), spread, strict=True)])
        sides.append([p + (s + beside) for p, s in zip((x, y, z), spread, strict=True)])

    corners = [
        (a * u + b * v + c * w + x, d * u + e * v + f * w + y, g * u + h * v + i * w + z)
        for u, v, w in core.corners.tolist()
    ]
    along = [(min(values), max(values)) for values in zip(*corners, strict=True)]
    size = max(max(abs(low), abs(high)) for low, high in along) + kept
    if size >= solid_tables.MAX_COMPARED_SIZE:
        return None

    middle = [0.5 * (low + high) for low, high in along]
    around = max(dist(corner, middle) for corner in corners) + kept
    bounds = np.array(sides)
    return BoxNumbers(
        numbers[0],
        numbers[1],
        np.stack([below(bounds[::2]), above(bounds[1::2])], axis=2),
        [0.0, c, f, i, kept, solid_tables.SLACK_PER_METRE * (1.0 + size), *middle, around],
        corners,
    )
