"""Costs of paths as OMPL objectives, for RRT*, BIT* and the other planners that improve a path.

OMPL's PRM and PRMstar call an objective in a second thread, which waits for the interpreter forever: they only work
with :func:`path_length`.
"""

from __future__ import annotations

import numpy as np
from ompl import base as ob

from rrtik_ompl.base.arrays import Vector, positive
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.ompl_bridge.states import StateIO
from rrtik_ompl.world.world import World

STEPS = 8  # parts of a motion over which a cost is summed up
NEAREST = 1e-3  # [m] clearances below this cost no more
STILL = 1e-9  # [unit of the space] a joint that moves less does not move


def path_length(si: ob.SpaceInformation) -> ob.OptimizationObjective:
    """Return the length of a path in joint space [rad; m], OMPL's own objective.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> si = rrtik.ompl.space_information(rrtik.World(rrtik.load_robot("titan4")))
        >>> objective = rrtik.ompl.objectives.path_length(si)
    """
    return ob.PathLengthOptimizationObjective(si)


def clearance(si: ob.SpaceInformation, world: World, *, weight: float = 0.05) -> ob.OptimizationObjective:
    """Return the length of a path in joint space, weighted more where the arm is near to a body.

    Each piece counts ``1 + weight / clearance`` times its length.

    Args:
        si: From `space_information()`, or another one over the arm's joints.
        world: Computes the clearance.
        weight: The clearance at which a piece counts double [m].

    Raises:
        InputError: If the weight is not a number above 0, or world or space do not fit.
    """
    return _Clearance(si, world, positive(weight, "weight"))


def single_joint_moves(si: ob.SpaceInformation) -> ob.OptimizationObjective:
    """Return how many joints move, added up over the motions of a path.

    It ranks paths of single-joint moves. In a tree of straight motions nearly every motion moves every joint, so
    planners of such trees gain little from it.
    """
    return _Moves(si)


def tip_travel(si: ob.SpaceInformation, robot: Robot, *, frame: str | None = None) -> ob.OptimizationObjective:
    """Return the distance that the tip travels [m].

    Args:
        si: From `space_information()`, or another one over the arm's joints.
        robot: The arm.
        frame: A frame of the arm in place of its tip.

    Raises:
        InputError: If the robot does not fit the space.
    """
    return _TipTravel(si, robot, frame)


class _Objective(ob.OptimizationObjective):  # type: ignore[misc]  # OMPL has no types
    """Base class: the cost of a motion is :meth:`cost`; states cost nothing."""

    def __init__(self, si: ob.SpaceInformation, dof: int | None = None) -> None:
        super().__init__(si)
        self._states = StateIO(si)
        if dof is not None and dof != self._states.dof:
            raise InputError(f"objective: the space has {self._states.dof} coordinates, the robot {dof} joints")

    def stateCost(self, _: ob.State) -> ob.Cost:
        """Return zero cost; called by OMPL."""
        return ob.Cost(0.0)

    def motionCost(self, first: ob.State, second: ob.State) -> ob.Cost:
        """Return the cost of the motion between two states; called by OMPL."""
        return ob.Cost(self.cost(self._states.read(first), self._states.read(second)))

    def cost(self, a: Vector, b: Vector) -> float:
        """Return the cost of the straight motion from a to b, shapes (n,)."""
        raise NotImplementedError


class _Clearance(_Objective):
    """Length, weighted more near obstacles; see :func:`clearance`."""

    def __init__(self, si: ob.SpaceInformation, world: World, weight: float) -> None:
        super().__init__(si, world.robot.dof)
        self._world = world
        self._weight = weight

    def cost(self, a: Vector, b: Vector) -> float:
        middles = a + (np.arange(STEPS)[:, None] + 0.5) / STEPS * (b - a)
        clearances = [max(self._world.clearance(q), NEAREST) for q in middles]
        return float(np.linalg.norm(b - a) * np.mean(1.0 + self._weight / np.array(clearances)))


class _Moves(_Objective):
    """The number of joints that move."""

    def cost(self, a: Vector, b: Vector) -> float:
        return float(np.count_nonzero(np.abs(b - a) > STILL))


class _TipTravel(_Objective):
    """The distance that a frame of the arm travels [m]."""

    def __init__(self, si: ob.SpaceInformation, robot: Robot, frame: str | None) -> None:
        super().__init__(si, robot.dof)
        self._robot = robot
        self._frame = frame
        robot.fk_batch(np.zeros((1, robot.dof)), frame)  # refuses an unknown frame here, not inside OMPL

    def cost(self, a: Vector, b: Vector) -> float:
        rows = a + np.linspace(0.0, 1.0, STEPS + 1)[:, None] * (b - a)
        places = self._robot.fk_batch(rows, self._frame)[:, :3, 3]
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
