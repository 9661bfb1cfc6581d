"""Verification of certificates: whether one proves a path free, computed anew in numpy from robot and scene alone.

The format and what has to be checked are described in ``docs/science/certificate.md``; numbers of sections refer to it.

All motions are seen from the frame of the last joint that carries both bodies of a pair. There a point of a body has at
most the acceleration C, so within an interval of width h it stays within the sagitta C h^2 / 8 of the chord between its
positions at the ends. Two parts are apart in the whole interval if, at both ends, a plane separates them by more than
the sum of both sagittas, or if balls that move along the chords are that far apart. Alternatively, the distance that
coal measures in the middle of an interval has to exceed the bound on the bodies' approach in half of it [16]. The
verifier searches for nothing: it only checks what the certificate states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import DISTANCE_TOLERANCE, Body, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.certificate import fixed_contact
from rrtik_ompl.geometry.collision.containment import filled
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.elements import (
    NamedBody,
    compared_pairs,
    model_body,
    model_joints,
    named_bodies,
    tracked_bodies,
    unchecked_pairs,
)
from rrtik_ompl.model.certificate import (
    DEEPEST,
    VERSION,
    Certificate,
    ModelBody,
    ModelConstraint,
    ModelJoint,
    MotionEntries,
    Route,
)
from rrtik_ompl.model.robot import Chain, Robot
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.world.certificate_course import LARGEST_VALUE, SAME, Course, Stack, powers_of
from rrtik_ompl.world.certificate_held import fault_of_constraints, model_constraints
from rrtik_ompl.world.certificate_intervals import Known, Numbers, Open, Rows, intervals_of, joined
from rrtik_ompl.world.certificate_parts import Parts, enclosed, inside_mesh, parts_of

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World

ROUNDING = 1e-8  # [m] added to every required gap, to cover rounding errors
SAME_EXTENT = 1e-6  # the same of extents, relative to the size of the shape and a metre
SHORTEST = 0.5  # least length of a normal
AT_ONCE = 20_000  # number of intervals that are computed together, to bound memory


def certificate_fault(
    certificate: Certificate, world: World, route: Route | ArrayLike, *, clearance: float = 0.0
) -> str:
    """Verify a certificate, as :meth:`rrtik_ompl.World.verify` but without checking the types of arguments (point 8).

    Args:
        certificate: The certificate.
        world: The robot and the scene.
        route: The motion, or the waypoints of a path, shape (k, dof).
        clearance: Least distance that the path has to keep from obstacles on top of their margins [m].

    Returns:
        The first fault in one line; "" if the certificate proves the path free.
    """
    asked = route if isinstance(route, Route) else Route(np.ascontiguousarray(route, dtype=np.float64))
    fault = _fault_of_header(certificate, world, asked, clearance)
    if fault:
        return fault
    try:
        named, tracks = bodies_of_route(world.robot, world.bodies, world.scene, asked)
        pairs = compared_pairs(named, world.pairs)
        constraints = model_constraints(world.constraints)
        fault = (
            _fault_of_model(certificate, world, named, pairs)
            or _fault_of_tracks(certificate, tracks)
            or _fault_of_listed(certificate.constraints, constraints)
        )
        if fault:
            return fault
        trees = [parts_of(each.elements, body.cuts) for each, body in zip(named, certificate.bodies, strict=True)]
    except InputError as error:
        return str(error)
    course = Course(world.robot.chain, asked, tracks)
    if fault := course.fault or fault_of_constraints(constraints, course):
        return fault
    return Motions(world.robot.chain, named, trees, pairs, course, certificate.clearance).fault(certificate.motions)


def bodies_of_route(
    robot: Robot, bodies: Sequence[Body], scene: Scene | None, route: Route
) -> tuple[list[NamedBody], Stack | None]:
    """Return the bodies of a certificate, and the poses of the obstacles that move, shape (tracks, k, 4, 4).

    Raises:
        InputError: If an obstacle changes its way between two waypoints.
    """
    named = named_bodies(bodies)
    if scene is None or not route.moving or route.times is None or all(o.motion is None for o in scene.obstacles):
        return named, None
    return tracked_bodies(named, scene, len(robot.chain.parent), route.times)


# --- what the certificate is about (point 3) -----------------------------------------------------------------------


def _fault_of_header(certificate: Certificate, world: World, route: Route, clearance: float) -> str:
    """Return the first mismatch between a certificate and a motion that concerns no entry; "" if there is none.

    Checked are the version, margins [m], clearance [m] and path, contacts between bodies that never move (no entry
    covers these), the bounds of the waypoints, and the number of motions.
    """
    robot = world.robot
    rows = route.waypoints
    if certificate.version != VERSION:
        return f"version {certificate.version} is not known here"
    if certificate.robot != robot.name or not _same_joints(certificate.joints, model_joints(robot)):
        return f"it is for another robot, '{certificate.robot}'"
    if certificate.self_margin != world.self_margin:
        return f"it is for another self margin, {certificate.self_margin:g} m"
    if not max(0.0, clearance) <= certificate.clearance < np.inf:
        return f"it is for a clearance of {certificate.clearance:g} m, not {clearance:g} m"

    # The waypoints have to agree to the bit, except that 0.0 equals -0.0.
    if not np.array_equal(rows, certificate.waypoints):
        return "it is for another path: waypoints differ"
    if fault := _fault_of_times(certificate, route):
        return fault

    passing = {each.name for each in world.scene.obstacles if route.moving and each.motion is not None}
    at_rest = [body.joint == 0 and body.name not in passing for body in world.bodies]
    pairs_at_rest = tuple(pair for pair in world.pairs if all(at_rest[k] for k in pair))
    touching = fixed_contact(world.bodies, pairs_at_rest)
    if touching is not None:
        return f"{' and '.join(map(repr, touching))} touch and never move"

    inside_limits = len(rows) > 0 and rows.shape[1] == robot.dof and bool(robot.within_limits(rows).all())
    if not inside_limits or not (np.abs(robot.joint_values(rows)) <= LARGEST_VALUE).all():
        return f"waypoints are not inside the limits of robot '{robot.name}', or beyond {LARGEST_VALUE:g}"

    motion_count = max(1, len(rows) - 1)
    if len(certificate.motions) != motion_count:
        return f"it has {len(certificate.motions)} motions, not {motion_count}"
    return ""


def _fault_of_times(certificate: Certificate, route: Route) -> str:
    """Return how a certificate differs from a motion between the waypoints, which are the same; "" if it does not."""
    if certificate.times is None or certificate.rates is None or route.times is None or route.rates is None:
        both = certificate.times is None and route.times is None and certificate.tracks is None
        return "" if both else "it is for another motion: one of them is timed, and the other a path"
    if not np.array_equal(certificate.times, route.times):
        return "it is for another motion: times differ"
    theirs, own = (powers_of(each) for each in (Route(route.waypoints, route.times, certificate.rates), route))
    with np.errstate(invalid="ignore"):
        pairs = zip_longest(theirs, own, fillvalue=np.zeros_like(own[0]))
        apart = np.sum([np.abs(a - b) for a, b in pairs], axis=0)
    if not (apart <= SAME).all():
        return "it is for another motion: rates differ"
    return ""


def _fault_of_tracks(certificate: Certificate, tracks: Stack | None) -> str:
    """Return whether obstacles move otherwise than the certificate says; "" if they do not."""
    if certificate.tracks is None and tracks is None:
        return ""
    if certificate.tracks is None or tracks is None:
        return "it is for another scene: obstacles move in one of them alone"
    same = certificate.tracks.shape[:2] == tracks.shape[:2] and _near(
        certificate.tracks, tracks[:, :, :3].reshape(*tracks.shape[:2], -1)
    )
    return "" if same else "it is for another scene: obstacles move otherwise"


def _fault_of_listed(theirs: Sequence[ModelConstraint], own: Sequence[ModelConstraint]) -> str:
    """Return whether a certificate lists other path constraints than those of a world; "" if it does not."""
    for k, (first, second) in enumerate(zip(own, theirs, strict=False), 1):
        numbers = ("pose", "within", "region", "bounds", "tolerances")
        same = (first.frame, first.joint) == (second.frame, second.joint)
        if not same or not all(_near(getattr(first, name), getattr(second, name)) for name in numbers):
            return f"it is for other path constraints: number {k}, of '{second.frame}', differs"
    if len(own) != len(theirs):
        return f"it is for other path constraints: it lists {len(theirs)} of them, not {len(own)}"
    return ""


def _fault_of_model(
    certificate: Certificate, world: World, named: Sequence[NamedBody], pairs: Sequence[tuple[int, int]]
) -> str:
    """Return the first difference between the bodies of a certificate and those of a world; "" if there is none."""
    own = [model_body(each) for each in named]
    theirs = certificate.bodies
    for first, second in zip(own, theirs, strict=False):
        if not _same_body(first, second):
            what = "robot, " if first.kind == second.kind == "link" else "scene: "
            return f"it is for another {what}'{second.name}' differs"
    if len(own) != len(theirs):
        missing = own[len(theirs)] if len(own) > len(theirs) else theirs[len(own)]
        return f"it is for another scene: '{missing.name}' is in one of them alone"

    unchecked = unchecked_pairs(world.robot, named, pairs)
    if [pair[:2] for pair in unchecked] != sorted(pair[:2] for pair in certificate.unchecked):
        return "it is for another scene: other pairs may touch"
    return ""


def _same_joints(first: Sequence[ModelJoint], second: Sequence[ModelJoint]) -> bool:
    """Check whether two robots have the same joints."""
    return len(first) == len(second) and all(
        (a.name, a.parent, a.slides) == (b.name, b.parent, b.slides)
        and all(_near(getattr(a, name), getattr(b, name)) for name in ("pose", "axis", "gain", "offset"))
        for a, b in zip(first, second, strict=True)
    )


def _same_body(first: ModelBody, second: ModelBody) -> bool:
    """Check whether two bodies are the same, whatever parts they are divided into."""
    names = [[getattr(each, name) for name in ("name", "number", "kind", "joint")] for each in (first, second)]
    contacts = [sorted(body.contacts) for body in (first, second)]
    return (
        names[0] == names[1]
        and _near([*first.pose, first.margin, first.padding], [*second.pose, second.margin, second.padding])
        and [name for name, _ in contacts[0]] == [name for name, _ in contacts[1]]
        and _near([distance for _, distance in contacts[0]], [distance for _, distance in contacts[1]])
        and _same_shape(first.shape, second.shape)
    )


def _same_shape(first: dict[str, object], second: dict[str, object]) -> bool:
    """Check whether two shapes have the same kind and measures."""
    if list(first) != list(second):
        return False
    extents = np.asarray(first.get("extents", [0.0]))
    far = SAME_EXTENT * (1.0 + float(np.abs(extents).max(initial=0.0)))
    return all(
        a == b if isinstance(a, str) else _near(a, second[name], far if name in ("extents", "moments") else SAME)
        for name, a in first.items()
        for b in (second[name],)
    )


def _near(first: object, second: object, tolerance: float = SAME) -> bool:
    """Check whether two numbers, or lists of numbers, are equal up to a tolerance."""
    try:
        one, other = (np.asarray(each, dtype=np.float64) for each in (first, second))
    except (TypeError, ValueError):
        return False
    return one.shape == other.shape and bool((np.abs(one - other) <= tolerance).all())


# --- motions (point 5) ---------------------------------------------------------------------------------------------


class Motions:
    """The motions of a certificate, with the pairs of bodies that must stay apart.

    Args:
        chain: The joints of the robot.
        named: The bodies.
        trees: Their parts.
        pairs: Pairs of numbers of bodies that are compared, of which at least one moves, the smaller number first.
        course: How joints and obstacles move.
        clearance: Distance to keep from obstacles [m].

    Attributes:
        pairs: The same pairs, in the order of entries: a body that rests in the frame of the pair is second.
        base_of_pair: The joint in whose frame each pair is seen: the last one that carries both bodies.
        required_gaps: Distance that each pair has to keep [m], including ``ROUNDING``.
        approaches, bends: Bounds of the sums of both bodies' speeds and accelerations for each pair and motion, if a
            motion takes time 1, shape (pairs, motions) [m].
        pushes: What of the latter comes from the accelerations of joints alone: how far a curved motion bends more
            than a straight one.
    """

    def __init__(
        self,
        chain: Chain,
        named: Sequence[NamedBody],
        trees: Sequence[Parts],
        pairs: Sequence[tuple[int, int]],
        course: Course,
        clearance: float,
    ) -> None:
        self.chain = chain
        self.named = named
        self.trees = trees
        self._course = course

        joints = [each.body.joint for each in named]
        endless = [tree.elements.key == "half_space" for tree in trees]
        seen = [(i, j, _common_joint(course.parents, joints[i], joints[j])) for i, j in pairs]
        self.pairs = [(i, j) if endless[j] or (joints[j] == base and not endless[i]) else (j, i) for i, j, base in seen]
        self.base_of_pair = np.array([base for _, _, base in seen], dtype=np.int64)
        self._bodies_of_pair = np.array(self.pairs, dtype=np.int64).reshape(-1, 2)
        self._rests = np.array([joints[j] == base for (_, j), (*_, base) in zip(self.pairs, seen, strict=True)], bool)

        required = []
        for i, j in self.pairs:
            first, second = sorted((i, j))
            ends = named[first].body, named[second].body
            kept = kept_apart(*ends) + (clearance if keeps_clearance(*ends) else 0.0)
            # What nothing moves cannot give way: an obstacle that passes it must not touch it, and that is all.
            passes = min(joints[i], joints[j]) == 0 and max(joints[i], joints[j]) > len(chain.parent)
            required.append(min(0.0, kept) if passes else kept)
        self.required_gaps = np.array(required) + ROUNDING
        self._by_hulls = np.array(required) < 0.0

        bounds_of = {k: self._bounds(k) for k in sorted({k for pair in self.pairs for k in pair})}
        bounds = np.array([bounds_of[i][base] + bounds_of[j][base] for i, j, base in seen])
        bounds = bounds.reshape(-1, 3, self._course.count)
        self.approaches = bounds[:, 0]
        self.bends = bounds[:, 1]
        self.pushes = bounds[:, 2]

        # Frames of joints in the frames of pairs, each combination once.
        both = np.array(joints, dtype=np.int64)[self._bodies_of_pair]
        views = np.stack([both, np.repeat(self.base_of_pair[:, None], 2, axis=1)], axis=2).reshape(-1, 2)
        self._views, view_of_body = np.unique(views, axis=0, return_inverse=True)
        self._view_of_pair = view_of_body.reshape(-1, 2)
        self._placements = np.array([each.body.placement.homogeneous for each in named]).reshape(-1, 4, 4)

        # Balls and boxes of all nodes of all bodies, one after the other.
        counts = [len(tree.spans) for tree in trees]
        self._firsts = np.cumsum([0, *counts])
        self._children = np.concatenate([tree.children for tree in trees])
        self._low = np.concatenate([tree.low for tree in trees])
        self._high = np.concatenate([tree.high for tree in trees])
        self._centres = np.concatenate([tree.centres for tree in trees])
        self._carried_centres = np.concatenate(
            [tree.centres @ place[:3, :3].T + place[:3, 3] for tree, place in zip(trees, self._placements, strict=True)]
        )
        self._radii = np.concatenate([np.where(tree.bounded, tree.radii, np.inf) for tree in trees])
        self._empty = np.concatenate([tree.empty for tree in trees])
        self._half_space = np.array([tree.elements.key == "half_space" for tree in trees], dtype=bool)
        self._planes = np.array([each.elements.measures.get("half_space", [0.0] * 4)[:3] for each in named])
        self._mesh = np.array([tree.elements.key == "mesh" for tree in trees], dtype=bool)

    def _bounds(self, number: int) -> dict[int, Matrix]:
        """Bound speed and acceleration of all points of a body as seen from each frame that carries it (point 5.4).

        Args:
            number: Index of the body.

        Returns:
            For each joint that carries the body, 0 for the world: bounds of speed and acceleration in each motion,
                which takes time 1, and what joints' accelerations add to the latter, shape (3, motions) [m].
        """
        body = self.named[number].body
        pose = body.placement.homogeneous
        joint = body.joint
        at_rest = np.zeros((3, self._course.count))
        if joint == 0:
            return {0: at_rest}
        if joint > self._course.joints:
            reach, _ = self.trees[number].reaches(pose, np.zeros(3))
            return {joint: at_rest, 0: self._course.bounds_on_track(joint, reach)}
        return self._course.bounds_on_joint(joint, *self.trees[number].reaches(pose, self.chain.axis[joint - 1]))

    # --- tests (point 7) ---

    def _frames(self, motion: Numbers, share: Vector) -> NDArray[np.float64]:
        """Compute the frames of joints in the frames of pairs at places of motions, shape (places, views, 4, 4)."""
        frames = self._course.frames(motion, share)
        joint, base = self._views.T
        outer = frames[:, base]
        seen = frames[:, joint]
        seen[:, :, :3, 3] -= outer[:, :, :3, 3]
        seen[:, :, :3] = outer[:, :, :3, :3].swapaxes(2, 3) @ seen[:, :, :3]
        return seen

    def _not_apart(self, rows: Rows, normals: Matrix | None = None) -> Numbers:
        """Return the indices of the rows whose nodes are not shown apart by planes, balls or boxes.

        Args:
            rows: The claims.
            normals: Normals of planes, shape (rows, 3), 0 where a row has none; None if there are no planes at all.
        """
        not_apart = [np.zeros(0, dtype=np.int64)]
        for first in range(0, len(rows.pair), AT_ONCE):
            some = rows.of(slice(first, first + AT_ONCE))
            ways = None if normals is None else normals[first : first + AT_ONCE]
            required = self.required_gaps[some.pair]
            required = required + 0.125 * self.bends[some.pair, some.motion] * some.width**2
            with np.errstate(invalid="ignore"):
                apart = self._gaps(some, ways) > required  # False for NaN
            not_apart.append(first + np.flatnonzero(~apart))
        return np.concatenate(not_apart)

    def _gaps(self, rows: Rows, normals: Matrix | None) -> Vector:
        """Return lower bounds of the gaps between nodes at both ends of intervals [m]."""
        shares = np.concatenate([rows.begin, rows.begin + rows.width])
        # Motion and share are encoded exactly in one number.
        places, where = np.unique(2.0 * np.tile(rows.motion, 2) + shares, return_inverse=True)
        frames = self._frames((places // 2.0).astype(np.int64), places % 2.0)
        first, second = self._view_of_pair[rows.pair].T
        begin, end = where.reshape(2, -1)
        ends = frames[begin, first], frames[end, first], frames[begin, second], frames[end, second]

        bodies = self._bodies_of_pair[rows.pair]
        gaps = self._ball_gaps(rows, bodies, ends)
        over = self._half_space[bodies[:, 1]]
        ways = np.zeros((len(over), 3)) if normals is None else normals.copy()
        if over.any():
            own = np.einsum("nij,nj->ni", self._placements[bodies[over, 1], :3, :3], self._planes[bodies[over, 1]])
            ways[over] = np.einsum("nij,nj->ni", ends[2][over, :3, :3], own)
        by_plane: Mask = np.asarray(ways.any(axis=1) | np.isnan(ways).any(axis=1))
        if by_plane.any():
            chosen = tuple(pose[by_plane] for pose in ends)
            gaps[by_plane] = self._plane_gaps(rows.of(by_plane), bodies[by_plane], chosen, ways[by_plane])
        return gaps

    def _ball_gaps(self, rows: Rows, bodies: Numbers, ends: tuple[Stack, ...]) -> Vector:
        """Compute lower bounds of gaps by balls and boxes (point 7.1): the first ball moves along a chord.

        Args:
            rows: The claims.
            bodies: Numbers of the two bodies of each, shape (n, 2).
            ends: Frames of both bodies' joints in the frame of the pair at begin and end: of the first body, then of
                the second, shape (n, 4, 4) each.
        """
        one = self._firsts[bodies[:, 0]] + rows.first
        other = self._firsts[bodies[:, 1]] + rows.second
        centres = (self._carried_centres[one],) * 2 + (self._carried_centres[other],) * 2
        a, b, c, d = (
            np.einsum("nij,nj->ni", pose[:, :3, :3], p) + pose[:, :3, 3] for pose, p in zip(ends, centres, strict=True)
        )
        rests = self._rests[rows.pair]

        # The second one at rest: the distance of its centre from the chord.
        chord = b - a
        start = a - c
        square = (chord * chord).sum(axis=1)
        share = np.clip(-(start * chord).sum(axis=1) / np.maximum(1e-30, square), 0.0, 1.0)
        at_rest = np.linalg.norm(start + share[:, None] * chord, axis=1)

        # The second one moving: each point of a chord is within half its length of its middle.
        half_chords = 0.5 * (np.sqrt(square) + np.linalg.norm(d - c, axis=1))
        moving = 0.5 * np.linalg.norm(a + b - c - d, axis=1) - half_chords
        gaps = np.where(rests, at_rest, moving) - self._radii[other]

        # The second one at rest: the chord's extent along each axis of its box, as far as it lies beyond the sides.
        place = self._placements[bodies[:, 1]]
        turn = ends[2][:, :3, :3] @ place[:, :3, :3]
        origin = np.einsum("nij,nj->ni", ends[2][:, :3, :3], place[:, :3, 3]) + ends[2][:, :3, 3]
        p, q = (np.einsum("nji,nj->ni", turn, x - origin) for x in (a, b))
        beyond = np.maximum(0.0, np.minimum(p, q) - self._high[other])
        beyond += np.maximum(0.0, self._low[other] - np.maximum(p, q))
        to_box = np.linalg.norm(beyond, axis=1)
        # A centre within the box may be deep in it.
        bounded = rests & np.isfinite(self._radii[other]) & (to_box > 0.0)
        gaps = np.where(bounded, np.maximum(gaps, to_box), gaps)
        return np.asarray(gaps - self._radii[one])

    def _plane_gaps(self, rows: Rows, bodies: Numbers, ends: tuple[Stack, ...], normals: Matrix) -> Vector:
        """Compute lower bounds of gaps along given normals (point 7.2); arguments as of :meth:`_ball_gaps`.

        The gap is the least height of the first node above the highest point of the second one, each taken at the end
        of the interval where it is worst; -inf where a normal is too short.
        """
        lengths = np.linalg.norm(normals, axis=1)
        units = normals / np.maximum(lengths, SHORTEST)[:, None]
        heights = []
        for number, pose in enumerate(ends):
            side = number // 2
            directions = units if side else -units
            carried = np.einsum("nji,nj->ni", pose[:, :3, :3], directions)
            place = self._placements[bodies[:, side]]
            local = np.einsum("nji,nj->ni", place[:, :3, :3], carried)
            height = (pose[:, :3, 3] * directions).sum(axis=1) + (place[:, :3, 3] * carried).sum(axis=1)
            node = (rows.first, rows.second)[side]
            for chosen in _groups(bodies[:, side], node):
                height[chosen] += self._support(int(bodies[chosen[0], side]), int(node[chosen[0]]), local[chosen])
            heights.append(height)
        gaps = -np.maximum(*heights[:2]) - np.maximum(*heights[2:])
        return np.where(lengths >= SHORTEST, gaps, -np.inf)

    def _support(self, number: int, node: int, directions: Matrix) -> Vector:
        """Return the support function of a node; of a half-space, whose own normal the direction is, its offset."""
        tree = self.trees[number]
        if tree.elements.key == "half_space":
            return np.full(len(directions), tree.elements.measures["half_space"][3])
        return tree.support(node, directions) if tree.bounded else np.full(len(directions), np.inf)

    def _measured_apart(self, motion: int, pair: int, begin: float, width: float) -> bool:
        """Check whether coal's distance in the middle of an interval proves two whole bodies apart on it (point 7.4).

        The distance has to exceed the required gap by the bodies' approach in half of the interval.
        """
        bodies = [self.named[k] for k in self.pairs[pair]]
        if self._by_hulls[pair] or any(len(each.members) > 1 or not each.elements.known for each in bodies):
            return False
        frames = self._course.frames(np.array([motion]), np.array([begin + 0.5 * width]))[0]
        required = self.required_gaps[pair] + DISTANCE_TOLERANCE + 0.5 * width * self.approaches[pair, motion]
        solid = [filled(each.body) for each in bodies]
        return bool(next(measured(solid, ((0, 1),), frames, near_only=False)).distance > required)

    # --- what has to be shown (point 8) ---

    def _what(self, motion: int, pair: int, begin: float, width: float) -> str:
        names = " and ".join(f"'{self.named[k].body.name}'" for k in self.pairs[pair])
        return f"motion {motion + 1}: {names} are not shown apart from {begin:g} to {begin + width:g} of it"

    def fault(self, motions: Sequence[MotionEntries], *, sufficient: bool = False) -> str:
        """Return the first fault of the entries of a certificate; "" if they prove all pairs apart in all motions.

        Args:
            motions: The entries of each motion.
            sufficient: Whether it is known that they are sufficient if they hold, as :meth:`needed` finds.
        """
        if fault := self._course.fault:
            return fault
        if fault := self._fault_of_numbers(motions):
            return fault
        entries = self._entries(motions)
        normals = np.concatenate([motion.normals for motion in motions])
        fault = self._fault_of_entries(entries, normals) or ("" if sufficient else self._fault_of_pairs(entries))
        return fault or self._fault_of_insides()

    def _fault_of_numbers(self, motions: Sequence[MotionEntries]) -> str:
        """Return the first entry that names no pair, node or interval."""
        counts = np.array([len(tree.spans) for tree in self.trees])
        for number, motion in enumerate(motions):
            (i, a, j, b), (level, k) = motion.solids.T, motion.intervals.T
            known = (self._pair_numbers(motion) >= 0) & (np.minimum(a, b) >= -1) & ((a < 0) == (b < 0))
            known &= (level >= 0) & (level <= DEEPEST) & (k >= 0) & (k < 2.0 ** np.clip(level, 0, DEEPEST))
            rows = np.flatnonzero(known)
            known[rows] &= (a[rows] < counts[i[rows]]) & (b[rows] < counts[j[rows]])
            if not known.all():
                row = int(np.argmin(known))
                what = f"parts {a[row]} and {b[row]} of a pair {i[row]} and {j[row]}"
                return f"motion {number + 1}: no {what}, or no interval {k[row]} of level {level[row]}"
        return ""

    def _pair_numbers(self, motion: MotionEntries) -> Numbers:
        """Return the number of the pair of each entry of a motion, -1 if there is none."""
        known = {pair: k for k, pair in enumerate(self.pairs)}
        first = motion.solids[:, 0].tolist()
        second = motion.solids[:, 2].tolist()
        return np.array([known.get(pair, -1) for pair in zip(first, second, strict=True)], dtype=np.int64)

    def _entries(self, motions: Sequence[MotionEntries]) -> Rows:
        """Return the entries of all motions, whose numbers are right."""
        counts = [len(motion.solids) for motion in motions]
        pair = np.concatenate([self._pair_numbers(motion) for motion in motions])
        solids = np.concatenate([motion.solids for motion in motions])
        level, number = np.concatenate([motion.intervals for motion in motions]).T
        width = np.asarray(0.5**level)
        motion = np.repeat(np.arange(self._course.count), counts)
        return Rows(motion, pair, solids[:, 1], solids[:, 3], number * width, width)

    def _fault_of_entries(self, entries: Rows, normals: Matrix) -> str:
        """Return the first entry that does not hold."""
        for k in self._open_of(entries, normals).tolist():
            motion, pair, _, _, begin, width = (column[k].item() for column in entries)
            return self._what(motion, pair, begin, width)
        return ""

    def _open_of(self, entries: Rows, normals: Matrix) -> Numbers:
        """Return the numbers of the entries that do not hold, in order."""
        # Where an overlap is allowed, meshes count as their hulls.
        bodies = self._bodies_of_pair[entries.pair]
        nodes = np.stack([entries.first, entries.second], axis=1)
        parted = (self._by_hulls[entries.pair][:, None] & self._mesh[bodies] & (nodes > 0)).any(axis=1)
        by_measure = entries.first < 0
        # A half-space has its own plane; no other one and no distance counts.
        refused = parted | (self._half_space[bodies[:, 1]] & (by_measure | normals.any(axis=1)))
        shown = np.flatnonzero(~by_measure & ~refused)
        open_rows = np.flatnonzero(refused).tolist()
        open_rows += shown[self._not_apart(entries.of(shown), normals[shown])].tolist()
        for k in np.flatnonzero(by_measure & ~refused).tolist():
            motion, pair, _, _, begin, width = (column[k].item() for column in entries)
            if not self._measured_apart(motion, pair, begin, width):
                open_rows.append(k)
        return np.array(sorted(open_rows), dtype=np.int64)

    def _fault_of_pairs(self, entries: Rows) -> str:
        """Return a pair that is not shown apart in a motion; "" if there is none."""
        known = self._known(entries)
        if known.too_many:
            return "it has too many parts to verify"
        for stuck in self._stuck(self.everything, known):
            begin = stuck.rows.begin
            width = stuck.rows.width
            return self._what(stuck.motion[0].item(), stuck.pair[0].item(), begin[0].item(), width[0].item())
        return ""

    @property
    def everything(self) -> Open:
        """What a certificate has to show: all pairs apart in all motions."""
        motion, pair = (x.ravel() for x in np.indices((self._course.count, len(self.pairs))))
        zeros = np.zeros(len(pair), dtype=np.int64)
        return Open(motion, pair, zeros, zeros, zeros, zeros, zeros)

    def _stuck(self, open_: Open, known: Known) -> Iterator[Open]:
        """Yield what is not shown apart and cannot be divided any further.

        Two nodes are apart on an interval if balls or boxes show it, if an entry says so of it or of an interval around
        it, or if both of its halves or all parts of one of the nodes are apart.
        """
        stack = [open_.of(slice(k, k + AT_ONCE)) for k in range(0, len(open_.pair), AT_ONCE)]
        while stack:
            taken = [stack.pop()]
            while stack and sum(len(each.pair) for each in taken) < AT_ONCE // 2:
                taken.append(stack.pop())
            now = joined(taken)
            has_both = np.logical_not(self._empty[self._node_numbers(now)].any(axis=1))
            now = now.of(has_both)
            now = now.of(self._not_apart(now.rows))
            now = now.of(known.entry_of(now) < 0)

            # Divide the interval where the motion bends by more than the size of both nodes, else the larger node.
            numbers = self._node_numbers(now)
            divided = self._children[numbers, 0] >= 0
            divided &= ~(self._by_hulls[now.pair][:, None] & self._mesh[self._bodies_of_pair[now.pair]])
            radii = np.where(np.isfinite(self._radii[numbers]), self._radii[numbers], 0.0)
            sagittas = 0.125 * self.bends[now.pair, now.motion] * 0.25**now.level
            alone = ~divided.any(axis=1)
            by_time: Mask = np.asarray((now.level < DEEPEST) & ((sagittas > radii.max(axis=1)) | alone))
            stuck: Mask = np.asarray(alone & ~by_time)
            if stuck.any():
                yield now.of(stuck)

            sizes = np.where(divided, self._radii[numbers], -np.inf)
            side = (sizes[:, 0] < sizes[:, 1] - SAME).astype(np.int64)
            by_node: Mask = np.asarray(~by_time & ~stuck)
            children = self._children[numbers[np.arange(len(side)), side]]
            halved = now.of(by_time).halves()
            parted = now.of(by_node).parts(side[by_node], children[by_node])
            rest = joined([halved, parted])
            stack += [rest.of(slice(k, k + AT_ONCE)) for k in range(0, len(rest.pair), AT_ONCE)]

    def in_order(self, motion: MotionEntries) -> MotionEntries:
        """Return entries whose bodies are in the order that entries have, planes turned over where they change."""
        numbers = len(self.named)
        pairs = self._bodies_of_pair @ [numbers, 1]
        turned = ~np.isin(motion.solids[:, [0, 2]] @ [numbers, 1], pairs)
        solids = np.where(turned[:, None], motion.solids[:, [2, 3, 0, 1]], motion.solids)
        return MotionEntries(solids, motion.intervals, np.where(turned[:, None], -motion.normals, motion.normals))

    def with_passing(self, motion: MotionEntries) -> MotionEntries:
        """Return entries, and one without a plane for each obstacle that passes what nothing moves."""
        joints = [each.body.joint for each in self.named]
        passing = [[i, 0, j, 0] for i, j in self.pairs if not any(0 < joints[k] <= self._course.joints for k in (i, j))]
        if not passing:
            return motion
        return MotionEntries(
            np.vstack([motion.solids, passing]),
            np.vstack([motion.intervals, np.zeros((len(passing), 2), dtype=np.int64)]),
            np.vstack([motion.normals, np.zeros((len(passing), 3))]),
        )

    def fitted(self, motions: Sequence[MotionEntries]) -> list[MotionEntries]:
        """Halve the intervals of entries until each holds, then join halves where one plane holds on both.

        Entries without a plane that do not hold get one; what holds on no interval is left out.
        """
        entries = self._entries(motions)
        normals = np.concatenate([motion.normals for motion in motions])
        over = self._half_space[self._bodies_of_pair[entries.pair, 1]]
        by_balls = np.flatnonzero(~normals.any(axis=1) & (entries.first >= 0) & ~over)
        weak = by_balls[self._not_apart(entries.of(by_balls))]
        normals[weak] = self._ways(entries.of(weak))
        while len(bad := self._open_of(entries, normals)):
            good = np.delete(np.arange(len(entries.pair)), bad)
            bad = bad[(entries.width[bad] > 0.5**DEEPEST) & (normals[bad].any(axis=1) | (entries.first[bad] < 0))]
            halves = np.repeat(bad, 2)
            width = 0.5 * entries.width[halves]
            later = np.arange(len(halves)) % 2
            parts = entries.of(halves)._replace(begin=entries.begin[halves] + later * width, width=width)
            entries = Rows(*(np.concatenate(both) for both in zip(entries.of(good), parts, strict=True)))
            normals = np.concatenate([normals[good], normals[halves]])

        level = DEEPEST
        while level > 0:
            # Both halves of an interval stand beside each other in this order.
            order = np.lexsort((entries.begin, entries.second, entries.first, entries.pair, entries.motion))
            entries = entries.of(order)
            normals = normals[order]
            same = np.ones(max(0, len(order) - 1), dtype=bool)
            for column in entries[:4]:
                same &= column[1:] == column[:-1]
            half = entries.width == 0.5**level
            even = np.round(entries.begin / entries.width) % 2 == 0
            same &= half[1:] & half[:-1] & even[:-1] & (entries.begin[1:] == entries.begin[:-1] + entries.width[:-1])
            firsts = np.flatnonzero(same & (entries.first[:-1] >= 0))
            whole = entries.of(firsts)._replace(width=2.0 * entries.width[firsts])
            for side in (0, 1):
                open_ = np.isin(np.arange(len(firsts)), self._not_apart(whole, normals[firsts + side]))
                joined_ = firsts[~open_]
                normals[joined_] = normals[joined_ + side]
                entries.width[joined_] *= 2.0
                kept = np.delete(np.arange(len(entries.pair)), joined_ + 1)
                firsts = np.searchsorted(kept, firsts[open_])
                whole = whole.of(open_)
                entries = entries.of(kept)
                normals = normals[kept]
            level -= 1
        return self._motions_of(entries, normals)

    def _ways(self, rows: Rows) -> Matrix:
        """Return the ways from the second nodes' boxes to the first nodes' middles, halfway, shape (n, 3) [m]."""
        places, where = np.unique(2.0 * rows.motion + rows.begin + 0.5 * rows.width, return_inverse=True)
        frames = self._frames((places // 2.0).astype(np.int64), places % 2.0)
        bodies = self._bodies_of_pair[rows.pair]
        first, second = self._view_of_pair[rows.pair].T
        pose = frames[where, first]
        centre = np.einsum(
            "nij,nj->ni", pose[:, :3, :3], self._carried_centres[self._firsts[bodies[:, 0]] + rows.first]
        )
        other = frames[where, second] @ self._placements[bodies[:, 1]]
        seen = np.einsum("nji,nj->ni", other[:, :3, :3], centre + pose[:, :3, 3] - other[:, :3, 3])
        node = self._firsts[bodies[:, 1]] + rows.second
        ways = np.einsum("nij,nj->ni", other[:, :3, :3], seen - np.clip(seen, self._low[node], self._high[node]))
        return np.asarray(ways / np.maximum(1e-300, np.linalg.norm(ways, axis=1))[:, None]).round(6)

    def _motions_of(self, entries: Rows, normals: Matrix) -> list[MotionEntries]:
        """Return entries as those of each motion."""
        bodies = self._bodies_of_pair[entries.pair]
        solids = np.column_stack([bodies[:, 0], entries.first, bodies[:, 1], entries.second])
        intervals = np.column_stack(intervals_of(entries))
        own = [entries.motion == motion for motion in range(self._course.count)]
        return [MotionEntries(solids[k], intervals[k], normals[k]) for k in own]

    def needed(self, motions: Sequence[MotionEntries]) -> Mask | None:
        """Return which entries, one motion after the other, a certificate cannot do without; None if some lack."""
        entries = self._entries(motions)
        if self._known(entries).too_many:
            return None

        # What balls show at the ends and in the middle of an interval, they may show on its parts: try without that.
        doubtful = np.flatnonzero(entries.first >= 0)
        for share in (0.0, 0.5, 1.0):
            some = entries.of(doubtful)
            still = some._replace(begin=some.begin + share * some.width, width=np.zeros(len(doubtful)))
            doubtful = np.delete(doubtful, self._not_apart(still))
        tried = np.delete(np.arange(len(entries.pair)), doubtful)
        known = self._known(entries.of(tried))
        everything = self.everything
        stuck = [each.motion * len(self.pairs) + each.pair for each in self._stuck(everything, known)]
        needed = entries.first < 0
        needed[tried[known.used]] = True
        if not stuck:
            return needed

        # Take back what is about a pair and motion that is not shown apart then.
        open_claims = np.concatenate(stuck)
        about = np.flatnonzero(np.isin(entries.motion * len(self.pairs) + entries.pair, open_claims))
        known = self._known(entries.of(about))
        left = everything.of(np.isin(everything.motion * len(self.pairs) + everything.pair, open_claims))
        if next(self._stuck(left, known), None) is not None:
            return None
        needed[about] = known.used | (entries.first[about] < 0)
        return needed

    def _known(self, entries: Rows) -> Known:
        nodes = max((len(tree.spans) for tree in self.trees), default=1)
        return Known(entries, self._course.count, len(self.pairs), nodes)

    def _node_numbers(self, open_: Open) -> Numbers:
        """Return the numbers of both nodes among all nodes of all bodies, shape (n, 2)."""
        return self._firsts[self._bodies_of_pair[open_.pair]] + np.stack([open_.first, open_.second], axis=1)

    def _fault_of_insides(self) -> str:
        """Return a body that is inside a mesh at the first waypoint; "" if there is none (point 7.3)."""
        frames = self._frames(np.zeros(1, dtype=np.int64), np.zeros(1))[0]
        placed = frames[self._view_of_pair] @ self._placements[self._bodies_of_pair]
        bounded = np.array([tree.bounded for tree in self.trees], dtype=bool)
        for outer in (0, 1):
            meshes, others = self._bodies_of_pair[:, [outer, 1 - outer]].T
            rows = np.flatnonzero(self._mesh[meshes] & ~self._by_hulls & bounded[others])
            one = placed[rows, outer]
            other = placed[rows, 1 - outer]
            turn = one[:, :3, :3].swapaxes(1, 2) @ other[:, :3, :3]
            shift = np.einsum("nji,nj->ni", one[:, :3, :3], other[:, :3, 3] - one[:, :3, 3])

            # Only a body whose ball comes near the mesh's box may be inside.
            mesh = self._firsts[meshes[rows]]
            inner = self._firsts[others[rows]]
            centre = np.einsum("nij,nj->ni", turn, self._centres[inner]) + shift
            gap = np.maximum(0.0, np.maximum(self._low[mesh] - centre, centre - self._high[mesh]))
            for k in np.flatnonzero(~(np.linalg.norm(gap, axis=1) > self._radii[inner])).tolist():
                if self._holds(int(meshes[rows[k]]), int(others[rows[k]]), turn[k], shift[k]):
                    names = [self.named[each[rows[k]]].body.name for each in (others, meshes)]
                    return f"'{names[0]}' is inside '{names[1]}' at the first waypoint, or a part of it is"
        return ""

    def _holds(self, outer: int, inner: int, turn: Matrix, shift: Vector) -> bool:
        """Check whether a mesh contains a connected part of another body, whose pose in its frame is given."""
        mesh = self.trees[outer]
        other = self.trees[inner]
        points = other.elements.points
        if other.elements.key != "mesh":  # of clouds, those in parts whose balls come near the mesh's box
            centres = other.centres @ turn.T + shift
            gap = np.maximum(0.0, np.maximum(mesh.low[0] - centres, centres - mesh.high[0]))
            points = points[other.elements_of_leaves(np.linalg.norm(gap, axis=1) <= other.radii)]
        points = points @ turn.T + shift
        inside = ((points >= mesh.low[0]) & (points <= mesh.high[0])).all(axis=(1, 2))
        corners = mesh.elements.points
        if other.elements.key == "mesh":
            return any(inside_mesh(corners, point) for point in enclosed(other.elements.points, points, inside))
        return any(inside_mesh(corners, point) for point in points[inside, 0])


def _groups(bodies: Numbers, nodes: Numbers) -> Iterator[Numbers]:
    """Yield the rows of each node of each body."""
    order = np.lexsort((nodes, bodies))
    changes = np.flatnonzero((np.diff(bodies[order]) != 0) | (np.diff(nodes[order]) != 0)) + 1
    yield from np.split(order, changes)


def _common_joint(parents: Numbers, first: int, second: int) -> int:
    """Return the last joint whose frame carries the frames of both joints, 0 for the world."""
    while first != second:  # parents have smaller numbers
        first, second = min(first, second), int(parents[max(first, second)])
    return first
