"""Bodies, pairs and covers as the tables that checks read: what depends on the arm alone, and what on the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rrtik_ompl.arrays import Vector
from rrtik_ompl.fast.layout import PAIRS
from rrtik_ompl.fast.robot_tables import (
    MovingBody,
    Spheres,
    Table,
    arm_table,
    ball_table,
    moving_body,
    rounding_margin,
    usable_cover,
)
from rrtik_ompl.fast.scene_tables import inner_rows, outer_rows, rows_table
from rrtik_ompl.robot import Chain


@dataclass(frozen=True, slots=True, eq=False)
class ArmTables:
    """All that depends on the moving bodies alone."""

    bodies: tuple[Any, ...]
    covers: tuple[Spheres, ...]
    pairs: tuple[tuple[int, int], ...]
    strokes: Vector
    margin: float
    arm: Table
    balls: tuple[Table, Table]

    def serves(
        self, bodies: Sequence[Any], covers: Sequence[Spheres], pairs: Sequence[tuple[int, int]], strokes: Vector
    ) -> bool:
        """Whether the tables of these bodies would be the same."""
        return (
            len(bodies) == len(self.bodies)
            and tuple(pairs) == self.pairs
            and np.array_equal(strokes, self.strokes)
            and all(np.array_equal(a, b) for a, b in zip(covers, self.covers, strict=True))
            and all(_same(a, b) for a, b in zip(bodies, self.bodies, strict=True))
        )


def arm_tables(
    chain: Chain,
    bodies: Sequence[Any],
    moving: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    outer: Sequence[Spheres],
    inner: Sequence[Spheres],
    limits: Vector,
    like: ArmTables | None,
) -> ArmTables:
    """Tables of the moving bodies (numbers in ``bodies``); those of ``like`` if they are the same."""
    place = {body: k for k, body in enumerate(moving)}
    own = tuple((place[i], place[j]) for i, j in pairs if i in place and j in place)
    carried = tuple(bodies[k] for k in moving)
    covers = tuple(np.asarray(spheres[k], dtype=np.float64) for k in moving for spheres in (outer, inner))
    if like is not None and like.serves(carried, covers, own, limits):
        return like
    reaches = [(b.joint, _reach(b, covers[2 * k])) for k, b in enumerate(carried)]
    margin = rounding_margin(chain, reaches, limits)
    packed: list[MovingBody] = [
        moving_body(chain, body, covers[2 * k], covers[2 * k + 1], margin) for k, body in enumerate(carried)
    ]
    balls = (ball_table(packed, own, inner=False), ball_table(packed, own, inner=True))
    return ArmTables(carried, covers, own, limits, margin, arm_table(chain), balls)


def standing_tables(
    bodies: Sequence[Any],
    moving: Sequence[int],
    standing: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    outer: Sequence[Spheres],
    inner: Sequence[Spheres],
) -> tuple[Table, Table]:
    """Rows that contain what stands still, and rows inside it."""
    listed = {frozenset(pair) for pair in pairs}
    checked = np.array([[frozenset((i, j)) in listed for j in standing] for i in moving], dtype=bool)
    checked = checked.reshape(len(moving), len(standing))
    around = [(s, row) for s, k in enumerate(standing) for row in outer_rows(bodies[k], outer[k])]
    inside = [(s, row) for s, k in enumerate(standing) for row in inner_rows(bodies[k], inner[k])]
    return rows_table(around, checked), rows_table(inside, checked)


def flag_places(
    pairs: Sequence[tuple[int, int]], arm: ArmTables, moving: Sequence[int], standing: Sequence[int]
) -> dict[int, tuple[int, int]]:
    """For each flag that the kernels can set its pair."""
    number = {frozenset(pair): pair for pair in pairs}
    crossing = {
        m * len(standing) + s: number[frozenset((i, j))]
        for m, i in enumerate(moving)
        for s, j in enumerate(standing)
        if frozenset((i, j)) in number
    }
    own = arm.balls[0][PAIRS].reshape(-1, 2)
    start = len(moving) * len(standing)
    return crossing | {start + k: number[frozenset((moving[i], moving[j]))] for k, (i, j) in enumerate(own)}


def _reach(body: Any, outer: Spheres) -> float:
    """Distance of the farthest point of a body's outer spheres from its joint's frame [m]."""
    spheres = usable_cover(body.geometry, outer)
    centres = spheres[:, :3] @ np.array(body.placement.rotation).T + np.array(body.placement.translation)
    return float((np.linalg.norm(centres, axis=1) + spheres[:, 3]).max())


def _same(first: Any, second: Any) -> bool:
    """Whether two bodies are the same solid carried in the same way."""
    return (
        first.joint == second.joint
        and first.geometry is second.geometry
        and np.array_equal(first.placement.homogeneous, second.placement.homogeneous)
    )
