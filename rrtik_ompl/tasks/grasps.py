"""Sample grasps of an obstacle by a gripper whose two fingers slide towards each other.

Two fingers hold a body by friction if the line between the points that they press on lies in the friction cones of both
[79]. Such pairs of points are sampled from the surface, and the hand is turned about their line at random, as in [80].
What is kept, the arm reaches free of collision, from a distance and in a straight line; and the fingers lie flat enough
against the surface to press on the two points, by coal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import TAU, Matrix, Vector, frozen, not_negative, positive, seed_of, whole_number
from rrtik_ompl.base.copies import in_one_line
from rrtik_ompl.base.errors import InputError, at_most, require
from rrtik_ompl.geometry.collision.bodies import Body, link_bodies
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.ik.batch import free_configurations
from rrtik_ompl.ik.method_interface import mid_range_configuration
from rrtik_ompl.model.goal import PoseGoal
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Capsule, Cylinder, Shape, Sphere
from rrtik_ompl.planning.tip_motion import straight
from rrtik_ompl.tasks.setting import with_gripper
from rrtik_ompl.tasks.stages import Attach, Gripper, MoveTo, Stage, Straight
from rrtik_ompl.world.world import World, form_of

MOST = 1000  # grasps in one call
EACH = 32  # candidates for each grasp that is wanted,
AT_ONCE = 256  # and the most that are sampled together
TRIES = 4096  # candidates, after which fewer grasps have to do
CHOICE = 3  # times as many grasps as are wanted, of which the best are returned
ROUNDS = 4  # configurations that are tried for each candidate where there is no closed form
FLAT = 5e-4  # [m] how far an object may stand out beside the two points on which the fingers press
ROUNDING = 1e-5  # [m] of distances
SAME = 1e-6  # [m] or [1] difference of two places, or axes, that counts as none
PAD = 0.01  # [m] distance of the points that are pressed from the ends of fingers that do not reach the tip


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
        before = MoveTo(PoseGoal(self.pose * pin.SE3(np.eye(3), -self.approach)))
        reach = [Straight(by=self.approach, frame="tip")] if self.approach.any() else []
        take = [Attach(self.object, self.link), Gripper("close", opening=self.opening)]
        return [Gripper("open"), before, *reach, *take]


def grasps(
    world: World,
    obstacle: str,
    *,
    count: int = 8,
    friction: float = 0.5,
    clearance: float = 0.002,
    approach: float = 0.1,
    near: ArrayLike | None = None,
    seed: int | None = 0,
) -> tuple[Grasp, ...]:
    """Sample grasps of an obstacle by the robot's gripper that the arm can reach.

    Args:
        world: Robot and scene; the gripper is taken as open.
        obstacle: Name of the obstacle.
        count: How many grasps are wanted, at most 1000.
        friction: Coefficient of friction between fingers and obstacle.
        clearance: Distance that arm and open hand keep from obstacles, this one too, on top of their margins [m].
        approach: Length of the straight way to the grasp, along the fingers [m].
        near: Configuration near which the arm is at the grasps, shape (dof,); the middle of the limits if None.
        seed: The same seed gives the same grasps; None draws one.

    Returns:
        At most ``count`` grasps, those with the largest clearance first; empty if none was found.

    Raises:
        InputError: If the robot has no pair of fingers that slide, the obstacle is not bounded, or an argument is not
            valid.
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
    hand = _Hand(world.robot)
    robot = hand.robot
    posture = mid_range_configuration(robot) if near is None else robot.configuration(near, "near")
    thing = world.scene.obstacle(obstacle)
    if not thing.shape.bounded:
        raise InputError(f"grasps: '{obstacle}' is not bounded, so that no hand goes around it; give a box, or a mesh")

    opened = world if robot is world.robot else form_of(world, robot=robot)
    free = opened.with_clearance(max(kept_apart, world.settings.clearance))
    others = opened.with_scene(opened.scene.without(obstacle))
    parts = [body for body in opened.bodies if body.name == obstacle]
    rng = np.random.default_rng(seed_of(seed))
    shift = frozen(length * hand.forward)
    before = pin.SE3(np.eye(3), -shift)
    together = min(EACH * wanted, AT_ONCE)
    found: list[Grasp] = []

    for _ in range(TRIES // together):
        pairs = _pairs(thing.shape, cone, hand.gap - 2.0 * kept_apart, together, rng)
        points = pairs @ thing.pose.rotation.T + thing.pose.translation
        poses = hand.poses(points, rng)
        Q = free_configurations(robot, poses, posture, free, ROUNDS) if len(poses) else np.empty((0, robot.dof))
        for k in np.flatnonzero(~np.isnan(Q[:, 0])):
            pose = pin.SE3(poses[k])
            width = hand.closed_on(parts, pose, float(np.linalg.norm(points[k, 1] - points[k, 0])))
            if width is None or (length and straight(free, Q[k], pose * before).fraction < 1.0):
                continue
            grasp = Grasp(
                object=obstacle,
                link=robot.tip,
                pose=pose,
                points=frozen(points[k]),
                width=width,
                opening=hand.opening(width),
                approach=shift,
                q=frozen(Q[k]),
                clearance=others.clearance(Q[k]),
            )
            found.append(grasp)
            if len(found) == CHOICE * wanted:
                break
        if len(found) >= wanted:
            break
    return tuple(sorted(found, key=lambda grasp: -grasp.clearance)[:wanted])


def _pairs(shape: Shape, cone: float, widest: float, tries: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample pairs of points on the surface of a shape that flat fingers can press together.

    Where the surface is round, a flat finger touches it where its normal is that of the finger, so that the normals of
    both points are along their line.

    Args:
        shape: The shape.
        cone: Cosine of half the angle of the friction cone.
        widest: Largest distance of the two points [m].
        tries: How many pairs are tried.
        rng: The source of random numbers.

    Returns:
        The pairs, in the frame of the shape, shape (k, 2, 3) [m].
    """
    if isinstance(shape, Sphere):
        ways = rng.normal(size=(tries, 3))
        half = shape.radius * ways / np.linalg.norm(ways, axis=1)[:, None]
        pairs = np.stack([half, -half], axis=1)
    elif isinstance(shape, Cylinder | Capsule):
        pairs = _pairs_of_cylinder(shape, tries, rng)
    else:
        surface = shape.surface()
        pairs = np.array([*_pairs_of_triangles(surface.vertices[surface.faces], cone, tries, rng)]).reshape(-1, 2, 3)
    narrow: NDArray[np.bool_] = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1) <= widest
    return pairs[narrow]


def _pairs_of_cylinder(shape: Cylinder | Capsule, tries: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Sample pairs of opposite points of a cylinder: across it or, unless its ends are round, from end to end."""
    turns = rng.uniform(0.0, TAU, tries)
    circle = np.stack([np.cos(turns), np.sin(turns), np.zeros(tries)], axis=1)
    along = shape.length * rng.uniform(-0.5, 0.5, tries)[:, None] * [0.0, 0.0, 1.0]
    pairs = np.stack([along + shape.radius * circle, along - shape.radius * circle], axis=1)

    if isinstance(shape, Cylinder):
        across = rng.random(tries) < shape.length / (shape.length + shape.radius)  # in proportion to the areas
        inside = shape.radius * np.sqrt(rng.random(tries))[:, None] * circle
        end = np.array([0.0, 0.0, 0.5 * shape.length])
        pairs = np.where(across[:, None, None], pairs, np.stack([inside + end, inside - end], axis=1))
    return pairs


def _pairs_of_triangles(
    corners: NDArray[np.float64], cone: float, tries: int, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Yield pairs of points, shape (2, 3): one on a face, and the one behind it, where a line along its normal leaves.

    Args:
        corners: Triangles, their corners anticlockwise from outside, shape (m, 3, 3).
        cone: Cosine of half the angle of the friction cone, in which the other point's normal is.
        tries: How many lines are tried.
        rng: The source of random numbers.
    """
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    solid = areas > 0.0
    first = corners[solid, 0]
    sides = sides[solid]
    areas = areas[solid]
    normals = normals[solid] / areas[:, None]

    for face in rng.choice(len(normals), tries, p=areas / areas.sum()):
        shares = rng.random(2)
        if shares.sum() >= 1.0:
            shares = 1.0 - shares  # the other half of a parallelogram
        point = first[face] + shares @ sides[face]
        inward = -normals[face]

        # Where the line meets the triangles, after Moeller and Trumbore.
        across = np.cross(inward, sides[:, 1])
        offset = point - first
        other = np.cross(offset, sides[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / np.einsum("ij,ij->i", sides[:, 0], across)
            a = scale * np.einsum("ij,ij->i", offset, across)
            b = scale * (other @ inward)
            far = scale * np.einsum("ij,ij->i", sides[:, 1], other)
            hits = np.flatnonzero((a >= 0.0) & (b >= 0.0) & (a + b <= 1.0) & (far > SAME))
        if len(hits):
            last = hits[far[hits].argmax()]
            if normals[last] @ inward >= cone:
                yield np.stack([point, point + far[last] * inward])


class _Hand:
    """The hand of a robot: two fingers that slide apart along one axis, and all in the frame of the joint behind it.

    Attributes:
        robot: The robot with its gripper open.
        forward: The way along the fingers, in the axes of the tip, shape (3,).
        gap: Distance between the open fingers [m].
    """

    def __init__(self, robot: Robot) -> None:
        if robot.gripper is None:
            raise InputError(f"robot '{robot.name}' has no gripper joints, so that there are no grasps by two fingers")
        self.robot = with_gripper(robot, Gripper("open"))
        tip = robot.model.frames[robot.model.getFrameId(robot.tip)]
        self._joint = tip.parentJoint
        self._T_joint_tip = tip.placement
        self._no_frames = np.tile(np.eye(4), (robot.model.njoints, 1, 1))

        shut = link_bodies(with_gripper(robot, Gripper("close")))
        bodies = [pair for pair in zip(link_bodies(self.robot), shut, strict=True) if pair[0].joint == self._joint]
        palm = [body for body, closed in bodies if body.placement.isApprox(closed.placement, SAME)]
        fingers = [(body, closed) for body, closed in bodies if not body.placement.isApprox(closed.placement, SAME)]
        axis, self._fingers = _opposed(fingers, robot)
        outer, inner = ([body for body, _ in finger] for finger in self._fingers)
        ways = [shift @ axis for finger in self._fingers for _, shift in finger]
        self._travel = max(ways) - min(ways)

        forward = self._forward(axis, [*outer, *inner], palm)
        ends = np.concatenate([_corners(body) for body in (*outer, *inner)]) @ forward
        point = np.array(tip.placement.translation)
        if not ends.min() <= point @ forward <= ends.max():
            point += (ends.max() - PAD - point @ forward) * forward

        # Behind the fingers' tips there may be parts that always touch, such as those that guide them.
        pads = [
            [body for body in finger if _beside(body, float(point @ forward), forward)] for finger in (outer, inner)
        ]
        nearest = min(self._contacts(pads[0] or outer, pads[1] or inner, np.eye(4)), key=lambda each: each.distance)
        self.gap = nearest.distance
        middle = 0.5 * axis @ (nearest.point_first + nearest.point_second)
        self._point = point + (middle - point @ axis) * axis
        self._own = np.column_stack([axis, forward, np.cross(axis, forward)])
        self.forward = self._T_joint_tip.rotation.T @ forward

    def _forward(self, axis: Vector, fingers: list[Body], palm: list[Body]) -> Vector:
        """Return the way from palm to fingers, shape (3,): an axis of the tip if one is at right angles to theirs."""
        centre = _centre(palm) if palm else np.zeros(3)
        way = _centre(fingers) - centre
        way -= (way @ axis) * axis
        axes = np.concatenate([self._T_joint_tip.rotation.T, -self._T_joint_tip.rotation.T])
        across = axes[np.abs(axes @ axis) < SAME]
        return np.array(across[np.argmax(across @ way)]) if len(across) else way / np.linalg.norm(way)

    def opening(self, width: float) -> float:
        """Return how far the gripper is open, 0 to 1, with its fingers a width [m] apart."""
        return float(np.clip((width - self.gap) / self._travel + 1.0, 0.0, 1.0))

    def poses(self, points: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Return poses of the tip with the fingers on pairs of points, (k, 2, 3) -> (k, 4, 4), turned at random."""
        ways = points[:, 1] - points[:, 0]
        ways = ways / np.linalg.norm(ways, axis=1)[:, None]
        sides = rng.normal(size=ways.shape)
        sides -= np.einsum("ij,ij->i", sides, ways)[:, None] * ways
        sides /= np.linalg.norm(sides, axis=1)[:, None]
        T_world_joint = np.tile(np.eye(4), (len(points), 1, 1))
        T_world_joint[:, :3, :3] = np.stack([ways, sides, np.cross(ways, sides)], axis=2) @ self._own.T
        T_world_joint[:, :3, 3] = points.mean(axis=1) - T_world_joint[:, :3, :3] @ self._point
        return np.asarray(T_world_joint @ self._T_joint_tip.homogeneous)

    def closed_on(self, parts: list[Body], pose: pin.SE3, width: float) -> float | None:
        """Return the distance of the fingers [m] when they press on an object; None if not on two points of it.

        Args:
            parts: The bodies of the object.
            pose: Pose of the tip.
            width: Distance of the two points [m].
        """
        near = width + 2.0 * FLAT
        opening = (near - self.gap) / self._travel + 1.0
        if not 0.0 <= opening <= 1.0:
            return None
        frame = (pose * self._T_joint_tip.inverse()).homogeneous
        gaps = []
        for finger in self._fingers:
            closing = [_shifted(body, (opening - 1.0) * shift) for body, shift in finger]
            gaps.append(min(contact.distance for contact in self._contacts(closing, parts, frame)))
        return near - 2.0 * min(gaps) if min(gaps) > 0.0 and max(gaps) <= FLAT + ROUNDING else None

    def _contacts(self, hand: list[Body], others: list[Body], frame: NDArray[np.float64]) -> Iterator[Contact]:
        """Yield the contacts of bodies of the hand with others, its joint at a place in the world, shape (4, 4)."""
        frames = self._no_frames.copy()
        frames[self._joint] = frame
        pairs = list(product(range(len(hand)), range(len(hand), len(hand) + len(others))))
        return measured([*hand, *others], pairs, frames, near_only=False)


def _opposed(fingers: list[tuple[Body, Body]], robot: Robot) -> tuple[Vector, list[list[tuple[Body, Vector]]]]:
    """Return the axis along which fingers open, shape (3,), and for both fingers their bodies and how these open.

    Args:
        fingers: What moves: each body with the gripper open, and closed.
        robot: The robot.

    Raises:
        InputError: If they are no pair that slides along one axis.
    """
    shifts = [body.placement.translation - closed.placement.translation for body, closed in fingers]
    axis = shifts[0] / max(np.linalg.norm(shifts[0]), SAME) if shifts else np.zeros(3)
    along = [float(shift @ axis) for shift in shifts]
    slide = all(np.allclose(body.placement.rotation, closed.placement.rotation, atol=SAME) for body, closed in fingers)
    slide = slide and np.allclose(shifts, np.outer(along, axis), atol=SAME)
    if not slide or not along or not min(along) < 0.0 < max(along):
        raise InputError(f"robot '{robot.name}': its gripper is no pair of fingers that slide towards each other")

    bodies = [(body, shift, way) for (body, _), shift, way in zip(fingers, shifts, along, strict=True)]
    return axis, [[(body, shift) for body, shift, way in bodies if (way > 0.0) == side] for side in (False, True)]


def _shifted(body: Body, shift: Vector) -> Body:
    """Return a body elsewhere in the frame of its joint, by a shift of shape (3,) [m]."""
    return replace(body, placement=pin.SE3(body.placement.rotation, body.placement.translation + shift))


def _beside(body: Body, place: float, axis: Vector) -> bool:
    """Check whether a body reaches to a place [m] along an axis, shape (3,)."""
    along = _corners(body) @ axis
    return bool(along.min() <= place <= along.max())


def _centre(bodies: list[Body]) -> Vector:
    """Return the middle of the boxes around some bodies, in the frame of their joint, shape (3,) [m]."""
    return np.asarray(np.mean([_corners(body).mean(axis=0) for body in bodies], axis=0))


def _corners(body: Body) -> Matrix:
    """Return the corners of a box around a body, in the frame of its joint, shape (8, 3) [m]."""
    body.geometry.computeLocalAABB()
    box = body.geometry.aabb_local
    local = np.array(list(product(*zip(box.min_, box.max_, strict=True))))
    return np.asarray(local @ body.placement.rotation.T + body.placement.translation)
