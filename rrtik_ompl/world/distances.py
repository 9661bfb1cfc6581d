"""Distances of pairs of objects for rows of configurations, with nearest points and gradients.

Kernels measure convex solids, half-spaces and meshes. What they do not know (clouds, octrees of many cells, cones) or
cannot tell is measured by :mod:`rrtik_ompl.geometry.collision.distances`; without kernels, everything is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector, frozen, sealed
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.geometry.collision.bodies import Body, Pairs, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.cloud_solid import CloudSolid
from rrtik_ompl.geometry.collision.containment import Containment, has_inside
from rrtik_ompl.geometry.collision.distances import gap_beyond, measured, transform_of
from rrtik_ompl.kernels.distances.layout import BEYOND, CROSSING, MEASURED, UNKNOWN
from rrtik_ompl.kernels.distances.packing import DistanceRows, Measured, distance_rows
from rrtik_ompl.model.distances import Distances
from rrtik_ompl.model.robot import Chain, Robot

SHORTEST = 1e-9  # [m] of a vector between nearest points that has a direction

Names = Sequence[tuple[str, str]]


class Choice(NamedTuple):
    """Which distances are wanted.

    Attributes:
        pairs: Pairs of names; None for all that must not touch.
        nearest: So many of the smallest ones at each configuration; None for all.
        within: Larger distances are not measured [m]; infinite for all.
    """

    pairs: Names | None = None
    nearest: int | None = None
    within: float = float("inf")


class Asked(NamedTuple):
    """Pairs of objects that are measured.

    Attributes:
        names: Their names, p pairs.
        numbers: The numbers of the objects, shape (p, 2).
        columns: The same for kernels.
        margins: The distance that each pair has to keep [m], without the clearance of the world, shape (p,).
        beside_obstacles: Which have to keep that, too, shape (p,).
    """

    names: tuple[tuple[str, str], ...]
    numbers: NDArray[np.int64]
    columns: NDArray[np.int32]
    margins: Vector
    beside_obstacles: Mask


@dataclass(eq=False)
class Ruler:
    """Measures the objects of a world: all bodies of one name are one object.

    Attributes:
        robot: The arm.
        bodies: All bodies of the world.
        pairs: Pairs of indices into ``bodies`` that must not touch.
    """

    robot: Robot
    bodies: Sequence[Body]
    pairs: Pairs
    _containments: dict[tuple[Body, Body], Containment] = field(default_factory=dict)
    _last: tuple[Names | None, Asked] | None = None  # what was asked about

    def for_thread(self) -> Ruler:
        """Return the same ruler for another thread."""
        return Ruler(self.robot, self.bodies, self.pairs)

    def distances(self, rows: Matrix, choice: Choice, clearance: float) -> Distances:
        """Measure rows of configurations, shape (m, dof).

        Args:
            rows: The configurations.
            choice: Which distances are wanted.
            clearance: Distance that is kept from obstacles on top of their margins [m].

        Raises:
            UnknownNameError: If there is no object of a name.
            InputError: If a pair is an object and itself.
        """
        asked = self._asked(choice.pairs)
        values = np.ascontiguousarray(self.robot.chain.joint_values(rows))
        keep = 0 if choice.nearest is None else min(choice.nearest, len(asked.names))
        found = self.rows.measured(values, asked.columns, within=choice.within, keep=keep)
        self._look_again(rows, asked.numbers, found, choice.within)

        margins = asked.margins + np.where(asked.beside_obstacles, clearance, 0.0)
        shape = found.told.shape
        if choice.nearest is None:
            which = np.broadcast_to(np.arange(len(asked.names)), shape)
            return Distances(
                asked.names,
                which,
                sealed(found.values),
                sealed(found.points),
                sealed(found.gradients),
                np.broadcast_to(margins, shape),
            )
        which = np.argsort(np.where(found.told == BEYOND, np.inf, found.values), axis=1, kind="stable")[:, :keep]
        at = np.arange(len(rows))[:, None], which
        return Distances(
            asked.names,
            frozen(which, np.int64),
            sealed(found.values[at]),
            sealed(found.points[at]),
            sealed(found.gradients[at]),
            sealed(margins[which]),
        )

    def _asked(self, names: Names | None) -> Asked:
        """Return what is known of pairs of names; who asks many times asks about the same ones."""
        if self._last is None or self._last[0] != names:
            pairs = self._checked_names if names is None else tuple(names)
            numbers = self._numbers(pairs)
            hollow = np.asarray(self._hollow[numbers].any(axis=1))
            both = [sorted(self._members[k][0] for k in pair) for pair in numbers.tolist()]
            bodies = [(self.bodies[i], self.bodies[j]) for i, j in both]
            beside = [keeps_clearance(one, other) and bool(one.joint or other.joint) for one, other in bodies]
            margins = np.array([kept_apart(*pair) for pair in bodies])
            columns = self.rows.columns(numbers, hollow)
            self._last = names, Asked(pairs, numbers, columns, margins, np.array(beside, dtype=bool))
        return self._last[1]

    @cached_property
    def _objects(self) -> dict[str, list[int]]:
        """The numbers of the bodies of each object, by its name."""
        objects: dict[str, list[int]] = {}
        for number, body in enumerate(self.bodies):
            objects.setdefault(body.name, []).append(number)
        return objects

    @cached_property
    def _members(self) -> list[list[int]]:
        return list(self._objects.values())

    @cached_property
    def _hollow(self) -> Mask:
        """Which objects have a mesh that others may be inside, shape (objects,)."""
        return np.array([any(has_inside(self.bodies[k]) for k in own) for own in self._members], dtype=bool)

    @cached_property
    def rows(self) -> DistanceRows:
        """The objects as kernels have them."""
        return distance_rows(self.robot, [[self.bodies[k] for k in own] for own in self._members])

    @cached_property
    def _checked_names(self) -> tuple[tuple[str, str], ...]:
        """The pairs of objects that must not touch and of which at least one moves."""
        bodies = self.bodies
        return tuple(
            dict.fromkeys((bodies[i].name, bodies[j].name) for i, j in self.pairs if bodies[i].joint or bodies[j].joint)
        )

    def _numbers(self, names: Names) -> NDArray[np.int64]:
        """Return the numbers of the objects of pairs of names, shape (p, 2)."""
        number_of = {name: k for k, name in enumerate(self._objects)}
        for pair in names:
            for name in pair:
                if name not in number_of:
                    raise UnknownNameError("link or obstacle with solids", name, number_of, where="pairs")
            if pair[0] == pair[1]:
                raise InputError(f"pairs: '{pair[0]}' and itself have no distance; name two objects")
        return np.array([[number_of[name] for name in pair] for pair in names], dtype=np.int64).reshape(-1, 2)

    def _look_again(self, rows: Matrix, numbers: NDArray[np.int64], found: Measured, within: float) -> None:
        """Measure what kernels have left open, and look for what is inside something else."""
        open_rows, open_columns = np.nonzero(found.told > CROSSING)
        for row in np.unique(open_rows).tolist():
            frames = self.robot.chain.joint_frames(rows[row : row + 1])[0]
            for column in open_columns[open_rows == row].tolist():
                self._measure(found, (row, column), numbers[column].tolist(), frames, within)

    def _measure(
        self, found: Measured, place: tuple[int, int], pair: list[int], frames: NDArray[np.float64], within: float
    ) -> None:
        """Measure one pair of objects and write what is found; see :meth:`_look_again`."""
        own = [[self.bodies[k] for k in self._members[number]] for number in pair]
        if found.told[place] == UNKNOWN:
            numbers = product(range(len(own[0])), range(len(own[0]), len(own[0]) + len(own[1])))
            contacts = measured(own[0] + own[1], list(numbers), frames, near_only=False)
            nearest = min(contacts, key=lambda contact: contact.distance)
            points = np.array([nearest.point_first, nearest.point_second])
            way = points[0] - points[1]
            near = nearest.distance < within
            found.told[place] = MEASURED if near else BEYOND
            found.values[place] = nearest.distance if near else within
            found.points[place] = points if near and np.isfinite(points).all() else np.nan
            found.gradients[place] = 0.0
            if abs(nearest.distance) > SHORTEST and np.isfinite(found.points[place]).all():
                joints = [bodies[0].joint for bodies in own]
                unit = way / nearest.distance
                found.gradients[place] = gradient_at(self.robot.chain, frames, joints, points, unit)

        if found.values[place] > 0.0 and any(self._holds(both, frames) for both in product(own[0], own[1])):
            found.told[place] = CROSSING
            found.values[place] = 0.0
            found.points[place] = np.nan
            found.gradients[place] = 0.0

    def _holds(self, pair: tuple[Body, Body], frames: NDArray[np.float64]) -> bool:
        """Check whether one of two bodies whose surfaces do not cross is inside the other, or a point of a cloud is."""
        first, second = pair
        if isinstance(first.geometry, CloudSolid) or isinstance(second.geometry, CloudSolid):
            transforms = [transform_of(body, frames) for body in pair]
            return gap_beyond((first.geometry, transforms[0], second.geometry, transforms[1]), 0.0) is None
        if pair not in self._containments:
            self._containments[pair] = Containment(pair, ((0, 1),))
        return self._containments[pair].holds((0, 1), frames)


def gradient_at(
    chain: Chain, frames: NDArray[np.float64], joints: Sequence[int], points: Matrix, normal: Vector
) -> Vector:
    """Return the derivatives by a configuration of the distance of two points that joints carry, shape (dof,).

    Args:
        chain: The tree of joints.
        frames: Poses of all joint frames, the world's first, shape (joints + 1, 4, 4).
        joints: The numbers of the two frames.
        points: The points in the world [m], shape (2, 3).
        normal: Unit vector from the second point to the first one, shape (3,).
    """
    by_joints = np.zeros(len(chain.parent))
    for frame, point, sign in zip(joints, points, (1.0, -1.0), strict=True):
        joint = frame - 1
        while joint >= 0:
            own = frames[joint + 1]
            axis = own[:3, :3] @ chain.axis[joint]
            moves = axis if chain.prismatic[joint] else np.cross(axis, point - own[:3, 3])
            by_joints[joint] += sign * float(normal @ moves)
            joint = int(chain.parent[joint])
    return np.asarray(by_joints @ chain.gain)
