"""Data that all worlds of a robot share, so that a new scene does not cost the arm's part again.

Kept for each robot are what depends on nothing else, the sphere covers and the placed solids of its links, and the
arm's part of the tables that were packed last (joints, balls and solids). A new world takes over one of these if it has
the same bodies, of which the same pairs are checked. The cache never changes tables that it shares. A moving world,
whose obstacles are moved in place, shares only the arm's part.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import cached_property
from itertools import product
from random import Random

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies, pair_array
from rrtik_ompl.geometry.collision.bodies import Pairs as Pairs
from rrtik_ompl.geometry.collision.solids import of_each, once_per_geometry
from rrtik_ompl.kernels import FastWorld, needs_covers
from rrtik_ompl.kernels.covers.cache import cached_inner_spheres, cached_outer_cover
from rrtik_ompl.kernels.proof.groups import BLOCK, MANY, Members
from rrtik_ompl.kernels.proof.moving import MovedSolids
from rrtik_ompl.kernels.proof.neighbours import cells_of, joints_between
from rrtik_ompl.kernels.proof.packing import ProofPairs, cloud_bodies
from rrtik_ompl.kernels.proof.placed import PlacedBodies, bodies_in_place
from rrtik_ompl.kernels.proof.rows import PROOF_KERNELS
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.neighbour_tables import Cells
from rrtik_ompl.kernels.tables.packing import ArmTables, alike, partners
from rrtik_ompl.kernels.tables.robot_tables import usable_cover
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.model.robot import Robot

SLIDING_MARGIN = 1e-3  # [m] range beyond the limits of prismatic joints that the tables cover
LOOKS = 64  # configurations by which it is told how often covers meet
OFTEN = 0.1  # share of these, from which on balls tell too little of two links
MOST_PIECES = 32  # pairs of convex pieces of two links; their cells are then found in a few hundredths of a second
KEPT_PROOFS = 8  # tables of proofs
KEPT_ARMS = 12  # tables of an arm: with nothing or a thing in its hand, open or closed, with its own pairs or without
NO_SPHERES = np.empty((0, 4))

Spheres = tuple[Matrix, Matrix]  # outer and inner cover of a body: centre and radius, shape (n, 4) [m]


class ArmCache:
    """The covers of a robot's links and the arm's part of the tables that were packed last for its worlds.

    Made by :func:`arm_cache`, one for each robot.

    Attributes:
        covers: Outer and inner sphere cover of each link, in the order of :func:`link_bodies`.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.covers: tuple[Spheres, ...] = tuple(_spheres(body) for body in link_bodies(robot))
        self._cells: dict[Pairs, dict[tuple[int, int], Cells]] = {}  # of the pairs of links that a world has
        self._proofs: dict[Hashable, tuple[tuple[Body | None, ...], ProofPairs]] = {}  # tables that none is proven with
        self._arms: list[ArmTables] = []  # of the arm with what it has held, the latest first

    def links_of(self, bodies: Sequence[Body]) -> PlacedBodies | None:
        """Return the links' convex solids as tables of proofs have them.

        Args:
            bodies: The bodies of a world; those of the robot's links first. If these are others, the result is None.
        """
        return self._links if self._begin_with_links(bodies) else None

    def proof_table(self, bodies: Sequence[Body], pairs: Pairs) -> ProofPairs | None:
        """Return the table of a proof with memory of its own, from one that was packed for bodies of the same kinds.

        Only the bodies that are others, or elsewhere, are put into it. The result is None if there is no such table.

        Args:
            bodies: The bodies of a world.
            pairs: Pairs of indices into ``bodies`` that must not touch.
        """
        kept = self._proofs.get(_kind_of_proof(bodies, pairs))
        if kept is None:
            return None

        known, packed = kept
        both = zip(bodies, known, strict=True)
        others = [k for k, (body, other) in enumerate(both) if not _in_same_place(body, other)]
        if any(k < len(self.covers) for k in others):  # it looks neighbours among the links up in cells of these links
            return None

        table = packed.for_thread(placing=True)
        rows = MovedSolids(table)
        return table if all(rows.put(k, bodies[k]) for k in others) else None

    def keep_proof(self, bodies: Sequence[Body], pairs: Pairs, packed: ProofPairs) -> None:
        """Keep a copy of a table that was packed for bodies, for :meth:`proof_table`; arguments as there.

        Of a cloud it keeps no body, so that a scan is freed when nobody else holds it: clouds are always put in anew.
        """
        is_put_as_packed = max(map(len, packed.groups), default=0) <= BLOCK  # what is around more is only bounded
        few = sum(body.joint == 0 for body in bodies) < MANY  # neighbours among many depend on where they are
        if any(body.contacts for body in bodies) or not (few and is_put_as_packed and self._begin_with_links(bodies)):
            return

        clouds = cloud_bodies(bodies)
        known = tuple(None if k in clouds else body for k, body in enumerate(bodies))
        kept = known, packed.for_thread(placing=True)
        others = list(self._proofs.items())[-(KEPT_PROOFS - 1) :]
        self._proofs = dict([*others, (_kind_of_proof(bodies, pairs), kept)])

    @cached_property
    def _links(self) -> PlacedBodies:
        bodies = link_bodies(self._robot)
        solids = of_each((body.geometry for body in bodies), convex_solids)
        return bodies_in_place(self._robot.chain, bodies, solids, strokes(self._robot))

    def _begin_with_links(self, bodies: Sequence[Body]) -> bool:
        """Check whether bodies begin with the robot's links as they are in the robot."""
        links = link_bodies(self._robot)
        return len(bodies) >= len(links) and all(
            body.geometry is link.geometry and body.joint == link.joint and body.placement == link.placement
            for body, link in zip(bodies, links, strict=False)
        )

    def covers_of(self, bodies: Sequence[Body]) -> tuple[Spheres, ...]:
        """Return the outer and inner sphere covers of all bodies of a world, those of the robot's links first."""
        others = bodies[len(self.covers) :]
        spheres_of_key: dict[tuple[int, bool], Spheres] = {}  # obstacles of equal size share a geometry
        keys = [(id(body.geometry), body.joint > 0) for body in others]
        for key, body in zip(keys, others, strict=True):
            if key not in spheres_of_key:
                spheres_of_key[key] = _spheres(body)
        return (*self.covers, *(spheres_of_key[key] for key in keys))

    def cells(self, bodies: Sequence[Body], pairs: Pairs) -> dict[tuple[int, int], Cells]:
        """Return where neighbours among the links are apart, by their numbers, if their covers meet often.

        Links that kernels compare together with others of the same joint have one table: where all of them are apart.

        Args:
            bodies: The bodies of a world; those of the robot's links first.
            pairs: Pairs of indices into ``bodies`` that must not touch.
        """
        if library(PROOF_KERNELS) is None or not self._begin_with_links(bodies):
            return {}
        listed = pair_array(pairs)
        links = np.sort(listed[(listed < len(self.covers)).all(axis=1)], axis=1).tolist()
        own = tuple((first, second) for first, second in links)
        if own not in self._cells:
            sets = {k: members for members in alike(bodies, partners(bodies, own)) for k in members}
            units = dict.fromkeys((sets.get(first, (first,)), sets.get(second, (second,))) for first, second in own)
            known = {unit: self._cells_of(*unit) for unit in units}
            self._cells[own] = {
                (min(i, j), max(i, j)): cells
                for unit, cells in known.items()
                if cells is not None
                for i, j in product(*unit)
            }
        return self._cells[own]

    def _cells_of(self, first: Members, second: Members) -> Cells | None:
        """Return where two sets of links are apart, those of a set on one joint; None if no table is worthwhile."""
        robot = self._robot
        links = link_bodies(robot)
        sides = [links[k] for k in first], [links[k] for k in second]
        if joints_between(robot.chain, sides[0][0], sides[1][0]) is None:
            return None
        solids = {body: convex_solids(body.geometry) for side in sides for body in side}
        pieces = [sum(len(solids[body].around) for body in side) for side in sides]
        if pieces[0] * pieces[1] > MOST_PIECES or not self._often_near(first, second):
            return None
        return cells_of(robot.chain, sides, solids, strokes(robot))

    def _often_near(self, first: Members, second: Members) -> bool:
        """Check whether the outer covers of two sets of links meet in many of some random configurations."""
        robot = self._robot
        lower, upper = robot.finite_range()
        rng = Random(0)  # of Python, as numpy's takes 20 ms to load
        shares = np.array([[rng.random() for _ in range(robot.dof)] for _ in range(LOOKS)])
        frames = robot.chain.joint_frames(lower + shares * (upper - lower))
        placed = []
        for members in (first, second):
            balls = [self._placed_balls(k, frames) for k in members]
            centres = np.concatenate([own for own, _ in balls], axis=1)
            placed.append((centres, np.concatenate([own for _, own in balls])))
        (one, radii), (other, other_radii) = placed
        gaps = np.linalg.norm(one[:, :, None] - other[:, None], axis=3) - radii[:, None] - other_radii
        return bool((gaps.min(axis=(1, 2)) < 0.0).mean() > OFTEN)

    def _placed_balls(self, number: int, frames: NDArray[np.float64]) -> tuple[NDArray[np.float64], Vector]:
        """Return the balls of a link's outer cover at m frames: centres, shape (m, n, 3), and radii, shape (n,)."""
        body = link_bodies(self._robot)[number]
        cover = usable_cover(body.geometry, self.covers[number][0])
        poses = frames[:, body.joint] @ body.placement.homogeneous
        centres = np.einsum("mij,nj->mni", poses[:, :3, :3], cover[:, :3]) + poses[:, None, :3, 3]
        return centres, cover[:, 3]

    def pack(self, bodies: Sequence[Body], pairs: Pairs, covers: Sequence[Spheres]) -> FastWorld:
        """Pack the kernels' tables of a world; the arm's part is that of tables packed before where it is the same.

        Args:
            bodies: The bodies; those of the robot's links first.
            pairs: Pairs of indices into ``bodies`` that must not touch.
            covers: See :meth:`covers_of`.
        """
        tables = FastWorld(
            self._robot.chain,
            bodies,
            pairs,
            outer=[around for around, _ in covers],
            inner=[inside for _, inside in covers],
            solids=of_each((body.geometry for body in bodies), convex_solids),
            strokes=strokes(self._robot),
            cells=self.cells(bodies, pairs),
            like=tuple(self._arms),
        )
        others = [each for each in self._arms if each is not tables.arm]
        self._arms = [tables.arm, *others[: KEPT_ARMS - 1]]
        return tables


def _kind_of_proof(bodies: Sequence[Body], pairs: Pairs) -> Hashable:
    """Return what is equal for bodies whose tables differ in what is said of single bodies alone."""
    return pairs, tuple((body.joint, body.kind, body.margin, body.padding, body.contacts) for body in bodies)


def _in_same_place(body: Body, other: Body | None) -> bool:
    """Check whether a body is another one, or in its place; None is in no place."""
    if body is other or other is None:
        return body is other
    return body.geometry is other.geometry and np.array_equal(body.placement.homogeneous, other.placement.homogeneous)


@kept_with
def arm_cache(robot: Robot) -> ArmCache:
    """Return the cache of a robot, the same object each time; the robot keeps it."""
    return ArmCache(robot)


def _spheres(body: Body) -> Spheres:
    outer, inner = needs_covers(body)
    return (
        _outer_cover(body.geometry) if outer else NO_SPHERES,
        _inner_spheres(body.geometry) if inner else NO_SPHERES,
    )


# Files are read, and covers made, once for each geometry.
_outer_cover = once_per_geometry(cached_outer_cover)
_inner_spheres = once_per_geometry(cached_inner_spheres)


def strokes(robot: Robot) -> Vector:
    """Return the largest magnitude of each joint value within the limits, shape (joints,) [rad or m].

    Continuous joints count as 0; ``SLIDING_MARGIN`` is added to all.
    """
    largest_values = np.maximum(np.abs(robot.lower), np.abs(robot.upper))
    largest_values = np.where(np.isfinite(largest_values), largest_values, 0.0)
    reach: Vector = np.abs(robot.chain.gain) @ largest_values + np.abs(robot.chain.offset) + SLIDING_MARGIN
    return reach
