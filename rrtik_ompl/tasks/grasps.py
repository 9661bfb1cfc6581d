"""Sample grasps of an obstacle by a gripper of two fingers that slide towards each other, or turn.

Two fingers hold a body by friction if the line between the points that they press on lies in the friction cones of both
[79]. Such pairs of points are sampled from the surface, and the hand is turned about their line at random, as in [80];
the wrist of an arm of fewer than six joints has the turns that it can. What is kept, the arm reaches free of collision,
from a distance and in a straight line; and closed fingers press on two such points, by coal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen, not_negative, positive, seed_of, whole_number
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, at_most, require
from rrtik_ompl.geometry.collision.bodies import kept_apart
from rrtik_ompl.ik.batch import free_configurations
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.planning.tip_motion import straight
from rrtik_ompl.tasks.fingers import FLAT, Hold, TwoFingers, two_fingers
from rrtik_ompl.tasks.grasp_points import pairs
from rrtik_ompl.tasks.stages import Attach, Gripper, MoveTo, Stage, Straight
from rrtik_ompl.world.world import World, form_of

MOST = 1000  # grasps in one call
EACH = 32  # candidates for each grasp that is wanted,
AT_ONCE = 256  # and the most that are sampled together
TRIES = 4096  # candidates, after which fewer grasps have to do
CHOICE = 3  # times as many grasps as are wanted, of which the best are returned
ROUNDS = 4  # configurations that are tried for each candidate where there is no closed form
ANY_POSE = 6  # joints of an arm that reaches poses of any turn
STEPS = 30  # of inverse kinematics of an arm of fewer joints
DAMPING = 1e-6  # of its least squares [m^2]
EXACT = 1e-4  # [m] or [rad] of the place of a grasp


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """A grasp of an obstacle by two fingers, which :func:`grasps` has found.

    Attributes:
        object: Name of the obstacle.
        link: Link that carries it then: the tip of the robot.
        pose: Pose of the tip, T_world_tip.
        points: The two points on which the fingers press, in the world [m], shape (2, 3).
        width: Distance between the fingers [m].
        opening: How far the gripper is open, 0 shut to 1 wide open.
        approach: The straight way to the grasp, along the fingers, in the axes of the tip [m], shape (3,).
        opened: How far the gripper is open until then.
        way: If one finger stands still, configurations before the approach and after it, shape (2, dof): from the
            second one the arm moves sideways to ``q``, until that finger touches. None if both fingers move.
        q: A configuration of the arm at the grasp, shape (dof,).
        clearance: Distance of arm and open hand at that configuration from all but the object, margins taken off [m].

    Example:
        >>> world = rrtik.Task.load("panda_pick_place").world
        >>> first, *_ = rrtik.grasps(world, "cup", count=3, seed=1)
        >>> first.object, round(first.width, 3)
        ('cup', 0.05)
    """

    object: str
    link: str
    pose: pin.SE3
    points: Matrix
    width: float
    opening: float
    approach: Vector
    q: Vector
    clearance: float
    opened: float = 1.0
    way: Matrix | None = None

    __repr__ = in_one_line

    def stages(self) -> list[Stage]:
        """Return the stages of a task that take the object: before it, straight to it, and close.

        Example:
            >>> world = rrtik.Task.load("panda_pick_place").world
            >>> grasps = rrtik.grasps(world, "cup", count=3, seed=1)
            >>> take = rrtik.Alternatives([grasp.stages() for grasp in grasps])
            >>> rrtik.Task([take, rrtik.Straight(by=[0.0, 0.0, 0.1])]).plan(world, "ready", seed=1).found
            True
        """
        take = [Attach(self.object, self.link), Gripper("close", opening=self.opening)]
        opened = Gripper("open", opening=None if self.opened == 1.0 else self.opened)
        if self.way is not None:
            return [opened, *(MoveTo(q) for q in (*self.way, self.q)), *take]

        before = MoveTo(PoseGoal(self.pose * pin.SE3(np.eye(3), -self.approach)))
        reach = [Straight(by=self.approach, frame="tip")] if self.approach.any() else []
        return [opened, before, *reach, *take]


def grasps(
    world: World,
    obstacle: str,
    *,
    count: int = 8,
    friction: float = 0.5,
    clearance: float = 0.002,
    approach: float = 0.1,
    opened: float = 1.0,
    near: ArrayLike | None = None,
    seed: int | None = 0,
) -> tuple[Grasp, ...]:
    """Sample grasps of an obstacle by the robot's gripper that the arm can reach.

    Args:
        world: Robot and scene; the gripper is taken as open as ``opened`` says.
        obstacle: Name of the obstacle.
        count: How many grasps are wanted, at most 1000.
        friction: Coefficient of friction between fingers and obstacle.
        clearance: Distance that arm and open hand keep from obstacles, this one too, on top of their margins [m].
        approach: Length of the straight way to the grasp, along the fingers [m].
        opened: How far the gripper is open before it closes, above 0 to 1: jaws that turn wide open need much room.
        near: Configuration near which the arm is at the grasps, shape (dof,); the middle of the limits if None.
        seed: The same seed gives the same grasps; None draws one.

    Returns:
        At most ``count`` grasps, those with the largest clearance first; empty if none was found.

    Raises:
        InputError: If the robot has no two fingers that each slide or turn, the obstacle is not bounded, or an argument
            is not valid.
        UnknownNameError: If there is no such obstacle.

    Example:
        >>> world = rrtik.Task.load("panda_pick_place").world
        >>> grasps = rrtik.grasps(world, "cup", count=3, seed=1)
        >>> len(grasps), grasps[0].points.shape
        (3, (2, 3))
    """
    require(world, World, "world of grasps", "use World(robot, scene)")
    require(obstacle, str, "name of an obstacle")
    wanted = whole_number(count, "count of grasps", 1)
    at_most(wanted, MOST, "count of grasps")
    cone = float(np.cos(np.arctan(positive(friction, "friction of grasps"))))
    kept_apart = not_negative(clearance, "clearance of grasps")
    length = not_negative(approach, "approach of grasps")
    share = positive(opened, "opened of grasps")
    if share > 1.0:
        raise InputError(f"opened of grasps: expected a share above 0, at most 1, got {share:g}")
    posture = mid_range_configuration(world.robot) if near is None else world.robot.configuration(near, "near")
    fault = world.robot.limit_fault(posture)
    if fault:
        raise InputError(f"near, of grasps: {fault}")
    thing = world.scene.obstacle(obstacle)
    if not thing.shape.bounded:
        raise InputError(f"grasps: '{obstacle}' is not bounded, so that no hand goes around it; give a box, or a mesh")

    sampler = _Sampler(world, obstacle, two_fingers(world.robot, share), cone, kept_apart, length, posture)
    rng = np.random.default_rng(seed_of(seed))
    together = min(EACH * wanted, AT_ONCE)
    found: list[Grasp] = []
    for _ in range(TRIES // together):
        for grasp in sampler.some(together, rng):
            found.append(grasp)
            if len(found) == CHOICE * wanted:
                break
        if len(found) >= wanted:
            break
    return tuple(sorted(found, key=lambda grasp: -grasp.clearance)[:wanted])


class _Sampler:
    """Samples grasps of an obstacle.

    Args:
        world: Robot and scene.
        name: Name of the obstacle.
        hand: The hand of the robot.
        cone: Cosine of half the angle of the friction cone.
        clearance: Distance that arm and open hand keep from obstacles [m].
        length: Length of the straight way to a grasp [m].
        near: Configuration near which the arm is at the grasps, shape (dof,).
    """

    def __init__(
        self, world: World, name: str, hand: TwoFingers, cone: float, clearance: float, length: float, near: Vector
    ) -> None:
        self.robot = hand.robot
        self.hand = hand
        self.thing = world.scene.obstacle(name)
        self.cone = cone
        self.near = near
        self.widest = hand.gap - 2.0 * clearance
        self.approach = frozen(length * hand.forward)
        opened = world if self.robot is world.robot else form_of(world, robot=self.robot)
        self.free = opened.with_clearance(max(clearance, world.settings.clearance))
        self.others = opened.with_scene(opened.scene.without(name))
        self.parts = [body for body in opened.bodies if body.name == name]

        # A finger that stands still comes from the side, as far away as it has to be until then, and may touch the
        # thing in the end.
        self.aside = 0.0
        self.arriving = opened
        if hand.standing:
            jaws = [body for body in opened.bodies if body.name == hand.standing]
            margin = max(kept_apart(jaw, part) for jaw in jaws for part in self.parts)
            self.aside = margin + self.free.settings.clearance + FLAT
            touching = Touching(hand.standing, name, 0.0)
            self.arriving = opened.with_scene(replace(opened.scene, contacts=(*opened.scene.contacts, touching)))

    def some(self, tries: int, rng: np.random.Generator) -> Iterator[Grasp]:
        """Yield the grasps among some candidates."""
        place = self.thing.pose
        points = pairs(self.thing.shape, self.cone, self.widest, tries, rng) @ place.rotation.T + place.translation
        poses = [self._moved(pin.SE3(pose), pair, self.aside)
                 for pose, pair in zip(self.hand.poses(points, rng), points, strict=True)]  # fmt: skip
        Q = self._configurations(self.free, poses, points, self.near)
        for k in np.flatnonzero(~np.isnan(Q[:, 0])):
            grasp = self._grasp(poses[k], points[k], Q[k])
            if grasp is not None:
                yield grasp

    def _grasp(self, pose: pin.SE3, pair: Matrix, q: Vector) -> Grasp | None:
        """Return the grasp by two points, shape (2, 3); None if fingers do not press there, or the arm does not arrive.

        Args:
            pose: Pose of the tip beside it.
            pair: The points.
            q: A configuration there, shape (dof,).
        """
        hold = self._hold(pose, pair, q)
        if hold is not None and not _same_place(hold.pose, self._moved(pose, pair, -self.aside)):
            # To touch with both fingers the hand was shifted: once more the arm takes the place that it can.
            pose = self._moved(hold.pose, pair, self.aside)
            (q,) = self._configurations(self.free, [pose], pair[None], q)
            hold = None if np.isnan(q[0]) else self._hold(pose, pair, q)
        if hold is None:
            return None

        beside = self._moved(hold.pose, pair, self.aside)
        way = [q, q]
        if self.approach.any():
            back = straight(self.free, q, beside * pin.SE3(np.eye(3), -self.approach))
            if back.path is None or not back.found:
                return None
            way[0] = back.path.end
        if self.aside:
            (q,) = self._configurations(self.arriving, [hold.pose], pair[None], q)
            if np.isnan(q[0]) or not (self.free.motion_valid(*way) and self.arriving.motion_valid(way[1], q)):
                return None
        return Grasp(
            object=self.thing.name,
            link=self.robot.tip,
            pose=self.robot.fk(q) if self.aside else hold.pose,
            points=hold.points,
            width=hold.width,
            opening=hold.opening,
            approach=self.approach,
            q=frozen(q),
            clearance=self.others.clearance(q),
            opened=self.hand.opened,
            way=frozen(np.array(way)) if self.aside else None,
        )

    def _hold(self, pose: pin.SE3, pair: Matrix, q: Vector) -> Hold | None:
        """Return how the hand holds the thing, from a place beside it that the arm has at q, shape (dof,)."""
        there = pose if self.robot.dof >= ANY_POSE else self.robot.fk(q)
        return self.hand.closed_on(self.parts, self._moved(there, pair, -self.aside), pair, self.cone)

    def _moved(self, pose: pin.SE3, pair: Matrix, distance: float) -> pin.SE3:
        """Return a pose moved by a distance [m], away from the thing on the side of the first point of a pair."""
        way = pair[0] - pair[1]
        return pin.SE3(pose.rotation, pose.translation + distance * way / np.linalg.norm(way))

    def _configurations(
        self, world: World, poses: Sequence[pin.SE3], points: NDArray[np.float64], near: Vector
    ) -> Matrix:
        """Return a free configuration for each pose, NaN where there is none, shape (k, dof).

        An arm of few joints may turn the hand about the line of the points that it presses on, shape (k, 2, 3).
        """
        if not len(poses):
            return np.empty((0, self.robot.dof))
        if self.robot.dof >= ANY_POSE:
            matrices = np.array([pose.homogeneous for pose in poses])
            return free_configurations(self.robot, matrices, near, world, ROUNDS)

        return _with_any_turn(world, poses, points, near)


def _with_any_turn(world: World, poses: Sequence[pin.SE3], points: NDArray[np.float64], near: Vector) -> Matrix:
    """Return free configurations at poses that may be turned about a line, by damped least squares for all at once.

    Args:
        world: The world.
        poses: The k poses, with any turn.
        points: Two points of the line of each, in the world, shape (k, 2, 3).
        near: Where the search begins; then at random, shape (dof,).

    Returns:
        The configurations, NaN where none was found, shape (k, dof).
    """
    robot = world.robot
    lines = points[:, 1] - points[:, 0]
    lines /= np.linalg.norm(lines, axis=1)[:, None]
    in_tip = np.array([pose.actInv(pair[0]) for pose, pair in zip(poses, points, strict=True)])
    ways = np.array([pose.rotation.T @ line for pose, line in zip(poses, lines, strict=True)])
    found = np.full((len(poses), robot.dof), np.nan)
    rng = np.random.default_rng(len(poses))

    for attempt in range(ROUNDS):
        left = np.flatnonzero(np.isnan(found[:, 0]))
        Q = np.tile(near, (len(left), 1))
        if attempt > 0:
            Q = rng.uniform(*robot.finite_range(), Q.shape)
        for _ in range(STEPS):
            T, J = robot.fk_jacobian_batch(Q)
            arms = np.einsum("kij,kj->ki", T[:, :3, :3], in_tip[left])
            seen = np.einsum("kij,kj->ki", T[:, :3, :3], ways[left])
            errors = np.hstack([arms + T[:, :3, 3] - points[left, 0], seen - lines[left]])
            moved = np.concatenate([J[:, :3] + _turning(J[:, 3:], arms), _turning(J[:, 3:], seen)], axis=1)
            transposed = moved.transpose(0, 2, 1)
            normal = transposed @ moved + DAMPING * np.eye(robot.dof)
            steps = np.linalg.solve(normal, transposed @ errors[:, :, None])[:, :, 0]
            Q = robot.clamp(Q - np.clip(steps, -0.5, 0.5))
        good = (np.abs(errors).max(axis=1) <= EXACT) & world.valid_batch(Q)
        found[left[good]] = Q[good]
    return found


def _turning(J: NDArray[np.float64], arms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how points at the ends of arms, (k, 3), move by angular Jacobians, shape (k, 3, dof)."""
    return np.cross(J.transpose(0, 2, 1), arms[:, None, :]).transpose(0, 2, 1)


def _same_place(first: pin.SE3, second: pin.SE3) -> bool:
    return bool(np.linalg.norm(first.translation - second.translation) <= EXACT)
