"""RRT-Connect along path constraints in Python: the search of `kernels/search/constrained/` where there are no kernels.

Source: CBiRRT2 [17, section 5]: both trees grow by short steps, each of which is projected onto the constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.budget import Stop
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.ik.held_tables import projected_onto, shortest_step
from rrtik_ompl.kernels.search.connect_lengths import connect_lengths
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.planning.search.rrt_connect import ConfigurationTree, path_between
from rrtik_ompl.world.motion_queries import MotionFree

FARTHEST = 2.0  # times the length of a step that projection may lead
NEARER = 0.05  # share of the length of a step by which it must come nearer
LENGTHENED = 1.6  # factor of the next step after one that was possible


@dataclass(frozen=True, slots=True, eq=False)
class AlongRules:
    """How trees grow along constraints.

    Attributes:
        lower, upper: The box of configurations, shape (n,).
        longest, shortest: Lengths of a step [unit of the box].
        projected: Moves a configuration, shape (n,), onto the constraints; None where that fails.
        motion_free: Checks whether a straight motion is free and keeps the constraints.
    """

    lower: Vector
    upper: Vector
    longest: float
    shortest: float
    projected: Callable[[Vector], Vector | None]
    motion_free: MotionFree


def rules_along(
    robot: Robot,
    constraints: HeldRegions,
    box: tuple[Vector, Vector],
    range_: float | None,
    motion_free: MotionFree,
) -> AlongRules:
    """Return the rules of a search along an arm's path constraints.

    Args:
        robot: The arm.
        constraints: What its configurations keep.
        box: Bounds of the configurations, shape (n,) each.
        range_: Longest step [unit of the configurations]; what suits the box if None.
        motion_free: Checks whether a straight motion is free and keeps the constraints.
    """
    longest, _ = connect_lengths(*box, range_, None, turning=np.ones(robot.dof, dtype=bool))

    def projected(row: Vector) -> Vector | None:
        found = projected_onto(robot, constraints, row[None])
        return found[0] if len(found) else None

    return AlongRules(*box, longest, min(shortest_step(constraints), longest), projected, motion_free)


class AlongConstraints:
    """A search between configurations that keep the constraints.

    Args:
        starts: Shape (s, n).
        goals: Shape (g, n).
        rules: How the trees grow.
        rng: Draws the samples.
    """

    def __init__(self, starts: Matrix, goals: Matrix, rules: AlongRules, rng: np.random.Generator) -> None:
        self.trees = ConfigurationTree(starts), ConfigurationTree(goals)
        self.iterations = 0
        self._rules = rules
        self._rng = rng

    def run(self, stop: Stop, limit: float) -> Matrix | None:
        """Search until there is a path, shape (k, n), or ``stop`` says so, or for ``limit`` samples altogether."""
        if self.iterations == 0 and (path := self._met(1, 0, stop)) is not None:
            return path
        while not stop() and self.iterations < limit:
            self.iterations += 1
            side = int(self.trees[0].size > self.trees[1].size)
            tree = self.trees[side]
            sample = self._rng.uniform(self._rules.lower, self._rules.upper)
            vertex, _ = self._walked(tree, sample, stop, exact=False)
            path = self._met(side, vertex, stop)
            if path is not None:
                return path
        return None

    def _met(self, side: int, vertex: int, stop: Stop) -> Matrix | None:
        """Return the path through a vertex of a tree, if the other tree walks there; else None."""
        other = self.trees[1 - side]
        last, reached = self._walked(other, self.trees[side].row(vertex).copy(), stop, exact=True)
        if not reached:
            return None
        ends = (vertex, last) if side == 0 else (last, vertex)
        return path_between(*(tree.branch(end) for tree, end in zip(self.trees, ends, strict=True)))

    def _walked(self, tree: ConfigurationTree, aim: Vector, stop: Stop, *, exact: bool) -> tuple[int, bool]:
        """Walk from the nearest vertex towards an aim as far as it goes.

        Args:
            tree: Gets the new vertices.
            aim: Shape (n,).
            stop: True ends the walk.
            exact: Whether the aim keeps the constraints, and is to be reached itself.

        Returns:
            The last vertex, and whether the aim is reached.
        """
        rules = self._rules
        vertex = tree.nearest(aim)
        length = rules.longest
        while not stop():
            here = tree.row(vertex).copy()
            left = float(np.linalg.norm(aim - here))
            if exact and left == 0.0:
                return vertex, True
            if length < rules.shortest or left < rules.shortest * NEARER:
                break

            last = exact and length >= left
            step = min(length, left)
            row = aim if last else rules.projected(here + (aim - here) * (step / left))
            if row is not None and (last or self._leads_on(here, row, aim, step)) and rules.motion_free(here, row):
                vertex = tree.add(row, vertex)
                length = min(LENGTHENED * length, rules.longest)
            else:
                length = 0.5 * step
        return vertex, False

    def _leads_on(self, here: Vector, row: Vector, aim: Vector, step: float) -> bool:
        """Check whether a projected step is not much longer than meant, and comes nearer to the aim."""
        nearer = float(np.linalg.norm(aim - here) - np.linalg.norm(aim - row))
        return nearer >= NEARER * step and float(np.linalg.norm(row - here)) <= FARTHEST * step
