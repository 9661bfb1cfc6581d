"""Motions of the tip along straight lines, arcs and screws, which the joints follow without jumps or collisions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Matrix, dimensions, not_negative, positive, seed_of
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, listed, require
from rrtik_ompl.base.poses import rigid
from rrtik_ompl.base.units import DEGREE
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.result import required
from rrtik_ompl.planning.tip_motion.attempts import Way, farthest, path_of
from rrtik_ompl.planning.tip_motion.following import Tolerance
from rrtik_ompl.planning.tip_motion.rails import Rail, arc_rail, screw_rail, straight_rail
from rrtik_ompl.world.problem import usable_configuration
from rrtik_ompl.world.world import World

DEVIATION = 1e-4  # [m]
TURN_DEVIATION = 0.1 * DEGREE  # [rad]
BRANCHES = 16  # configurations at a start pose that are tried


@dataclass(frozen=True, slots=True, eq=False)
class TipMotion:
    """The result of a motion of the tip: how far it came, and why it ended.

    Attributes:
        path: Its configurations, every motion proven free; None if the fraction is 0.
        fraction: Share of the way that the path covers, from 0 to 1.
        reason: Why it ends there: a joint at its limit, a singular posture, the bodies in contact; "" if it is
            complete.
        seconds: Wall time taken [s].
        statistics: "starts", the number of start configurations, and "attempts", how many ways were tried from them.

    Example:
        >>> world, q = rrtik.World(rrtik.load_robot("ur5")), np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
        >>> far = rrtik.tip.straight(world, q, world.robot.fk(q).translation + [2.0, 0.0, 0.0])
        >>> 0.0 < far.fraction < 1.0, far.reason != ""
        (True, True)
    """

    path: JointPath | None
    fraction: float
    reason: str
    seconds: float
    statistics: Mapping[str, int]

    __repr__ = in_one_line

    @property
    def found(self) -> bool:
        """Whether the path covers the whole way."""
        return self.fraction == 1.0

    @property
    def proven(self) -> bool | None:
        """Whether the path is proven free, as it always is; None without a path."""
        return None if self.path is None else self.path.proven

    def require(self) -> JointPath:
        """Return the path of the whole way.

        Raises:
            NotFoundError: If it ends before.

        Example:
            >>> world = rrtik.World(rrtik.load_robot("ur5"))
            >>> rrtik.tip.straight(world, [0.0, -1.6, 1.8, -0.2, 1.6, 0.0], [0.45, 0.11, 0.6]).require().proven
            True
        """
        came = f"the tip came {100.0 * self.fraction:.3g} % of its way"
        return required(self.path if self.found else None, came, self.reason)


def straight(
    world: World,
    q: ArrayLike | str | pin.SE3,
    T_world_goal: ArrayLike | pin.SE3,
    *,
    deviation: float = DEVIATION,
    turn_deviation: float = TURN_DEVIATION,
    clearance: float | None = None,
    seed: int | None = 0,
) -> TipMotion:
    """Move the tip in a straight line while its axes turn about one axis, as far as the arm can without collision.

    The tip stays within the deviations during the motions between waypoints, not only at the waypoints: the deviation
    is bounded by derivatives of the kinematics. Joints move without jumps, at most 0.25 rad or m between waypoints. All
    motions are proven free (:meth:`World.prove`). A redundant arm uses its freedom to stay away from its limits [60],
    and tries other ways to use it if it is stopped.

    Args:
        world: Robot and scene.
        q: Start: a configuration, shape (dof,), the name of a posture, or a pose of the tip as ``SE3`` or matrix, shape
            (4, 4). Of the configurations at a pose, the one from which the tip comes farthest is used.
        T_world_goal: Pose of the tip at the end, see :func:`rrtik_ompl.base.poses.rigid`. A position alone, [x, y, z],
            keeps the orientation of the start.
        deviation: Greatest distance of the tip from the line [m].
        turn_deviation: Greatest deviation of its orientation [rad].
        clearance: Clearance from every obstacle on top of its margin [m]; that of the world if None or less.
        seed: Seed of the random numbers with which a redundant arm tries other ways; None draws one.

    Raises:
        ProblemError: If q is in collision or outside the limits.
        InputError: If an argument makes no sense.
        UnknownNameError: If there is no posture of that name.

    Example:
        >>> import rrtik_ompl as rrtik
        >>> world = rrtik.World(rrtik.load_robot("ur5"))
        >>> lift = rrtik.tip.straight(world, [0.0, -1.6, 1.8, -0.2, 1.6, 0.0], [0.45, 0.11, 0.6])
        >>> lift.fraction, lift.path.proven
        (1.0, True)
    """

    def rails(begin: pin.SE3) -> list[Rail]:
        return [straight_rail(begin, _goal(T_world_goal, begin, "T_world_goal"))]

    return _moved(world, q, rails, deviation, turn_deviation, clearance, seed)


def arc(
    world: World,
    q: ArrayLike | str | pin.SE3,
    T_world_goal: ArrayLike | pin.SE3,
    through: ArrayLike,
    *,
    deviation: float = DEVIATION,
    turn_deviation: float = TURN_DEVIATION,
    clearance: float | None = None,
    seed: int | None = 0,
) -> TipMotion:
    """Move the tip on the circle through a point to a goal; everything else is as for :func:`straight`.

    Args:
        world: Robot and scene.
        q: Start, see :func:`straight`.
        T_world_goal: Pose of the tip at the end, see :func:`straight`.
        through: Point in the world that the tip passes [m], shape (3,).
        deviation: Greatest distance of the tip from the line [m].
        turn_deviation: Greatest deviation of its orientation [rad].
        clearance: Clearance from every obstacle on top of its margin [m]; that of the world if None or less.
        seed: Seed of the random numbers with which a redundant arm tries other ways; None draws one.

    Raises:
        ProblemError: See :func:`straight`.
        UnknownNameError: See :func:`straight`.
        InputError: See :func:`straight`; also if the three points lie on a line.

    Example:
        >>> world, q = rrtik.World(rrtik.load_robot("ur5")), np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
        >>> here = world.robot.fk(q).translation
        >>> rrtik.tip.arc(world, q, here + [0.0, 0.1, 0.0], through=here + [0.0, 0.05, 0.05]).fraction
        1.0
    """

    def rails(begin: pin.SE3) -> list[Rail]:
        return [arc_rail(begin, _goal(T_world_goal, begin, "T_world_goal"), through)]

    return _moved(world, q, rails, deviation, turn_deviation, clearance, seed)


def screw(
    world: World,
    q: ArrayLike | str | pin.SE3,
    T_world_goal: ArrayLike | pin.SE3,
    *,
    turns: int = 0,
    deviation: float = DEVIATION,
    turn_deviation: float = TURN_DEVIATION,
    clearance: float | None = None,
    seed: int | None = 0,
) -> TipMotion:
    """Move the tip about and along one line of the world at the same time, like a screw, a door or a valve.

    Args:
        world: Robot and scene.
        q: Start, see :func:`straight`.
        T_world_goal: Pose of the tip at the end, see :func:`straight`.
        turns: Whole turns on top of the shortest way to the goal; a negative number turns the other way.
        deviation: Greatest distance of the tip from the line [m].
        turn_deviation: Greatest deviation of its orientation [rad].
        clearance: Clearance from every obstacle on top of its margin [m]; that of the world if None or less.
        seed: Seed of the random numbers with which a redundant arm tries other ways; None draws one.

    Raises:
        ProblemError: See :func:`straight`.
        UnknownNameError: See :func:`straight`.
        InputError: See :func:`straight`; also if whole turns are wanted although the goal is not turned.

    Example:
        >>> world, q = rrtik.World(rrtik.load_robot("ur5")), np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
        >>> valve = world.robot.fk(q)
        >>> valve.rotation = valve.rotation @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        >>> rrtik.tip.screw(world, q, valve).fraction  # a quarter turn about the tip's z axis
        1.0
    """

    def rails(begin: pin.SE3) -> list[Rail]:
        return [screw_rail(begin, _goal(T_world_goal, begin, "T_world_goal"), turns)]

    return _moved(world, q, rails, deviation, turn_deviation, clearance, seed)


def follow(
    world: World,
    q: ArrayLike | str | pin.SE3,
    poses: Sequence[ArrayLike | pin.SE3],
    *,
    deviation: float = DEVIATION,
    turn_deviation: float = TURN_DEVIATION,
    clearance: float | None = None,
    seed: int | None = 0,
) -> TipMotion:
    """Move the tip in straight lines from pose to pose; everything else is as for :func:`straight`.

    Args:
        world: Robot and scene.
        q: Start, see :func:`straight`.
        poses: Poses of the tip in their order, each as ``T_world_goal`` of :func:`straight`.
        deviation: Greatest distance of the tip from the line [m].
        turn_deviation: Greatest deviation of its orientation [rad].
        clearance: Clearance from every obstacle on top of its margin [m]; that of the world if None or less.
        seed: Seed of the random numbers with which a redundant arm tries other ways; None draws one.

    Raises:
        ProblemError: See :func:`straight`.
        InputError: See :func:`straight`; also if there is no pose.
        UnknownNameError: See :func:`straight`.

    Example:
        >>> world, q = rrtik.World(rrtik.load_robot("ur5")), np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
        >>> here = world.robot.fk(q).translation
        >>> rrtik.tip.follow(world, q, [here + [0.0, 0.0, 0.1], here + [0.0, 0.1, 0.1]]).fraction
        1.0
    """

    def rails(begin: pin.SE3) -> list[Rail]:
        stations = [begin]
        for k, each in enumerate(listed(poses, "poses")):
            stations.append(_goal(each, stations[-1], f"poses[{k}]"))
        if len(stations) < 2:
            raise InputError("poses: a motion of the tip needs at least one pose to go to")
        return [straight_rail(a, b) for a, b in pairwise(stations)]

    return _moved(world, q, rails, deviation, turn_deviation, clearance, seed)


def _goal(value: ArrayLike | pin.SE3, begin: pin.SE3, what: str) -> pin.SE3:
    """Return a pose as SE3; a position alone keeps the orientation of the start."""
    goal = rigid(value, what)
    if not isinstance(value, pin.SE3) and np.shape(value) == (3,):
        return pin.SE3(begin.rotation, goal.translation)
    return goal


def _moved(
    world: World,
    q: ArrayLike | str | pin.SE3,
    rails: Callable[[pin.SE3], list[Rail]],
    deviation: float,
    turn_deviation: float,
    clearance: float | None,
    seed: int | None,
) -> TipMotion:
    """Check the arguments, and follow the rails that ``rails`` builds from the pose of the tip at the start.

    Args:
        world: Robot and scene.
        q: Start, see :func:`straight`.
        rails: Returns the rails for the pose of the tip at the start.
        deviation: Greatest distance of the tip from the rails [m].
        turn_deviation: Greatest deviation of its orientation [rad].
        clearance: Clearance from every obstacle on top of its margin [m].
        seed: Seed of the random numbers.
    """
    budget = Budget()
    tolerance = Tolerance(positive(deviation, "deviation"), positive(turn_deviation, "turn_deviation"))
    if tolerance.turn > 1.0:
        raise InputError(f"turn_deviation must be 1 rad at most, got {tolerance.turn:g}; is it in radians?")
    number = seed_of(seed)
    require(world, World, "world", "use World(robot, scene)")
    required_clearance = (
        None if clearance is None else max(not_negative(clearance, "clearance"), world.settings.required_clearance)
    )

    begin, starts = _begin(world, q, number)
    way = Way(tuple(rails(begin)), tolerance, required_clearance, number)
    if way.leads_nowhere(world.robot):
        raise InputError("the tip is at the goal already: there is no line to follow")
    best = farthest(world, way, starts)
    counts = {"starts": len(starts), "attempts": best.attempts}
    return TipMotion(path_of(world, best), best.fraction, best.reason, budget.elapsed, counts)


def _begin(world: World, q: ArrayLike | str | pin.SE3, seed: int) -> tuple[pin.SE3, Matrix]:
    """Return the pose of the tip at the start, and the start configurations to try.

    Returns:
        The pose (SE3), and configurations, shape (k, dof): the given one, or those of inverse kinematics for a pose.

    Raises:
        ProblemError: If it is in collision or outside the limits.
        InputError: If no configuration is at the pose, or q is neither.
        UnknownNameError: If there is no posture of that name.
    """
    robot = world.robot
    if isinstance(q, str):
        q = robot.posture(q)
    if not isinstance(q, pin.SE3) and dimensions(q) < 2:
        start = usable_configuration(world, q, "start")
        return robot.fk(start), start[None]

    begin = rigid(q, "start")
    found = solve_ik(robot, PoseGoal(begin), all=True, world=world, seed=seed)
    if not found.found:
        raise InputError(f"start: no configuration of robot '{robot.name}' is at this pose: {found.detail}")
    return begin, found.solutions[:BRANCHES]
