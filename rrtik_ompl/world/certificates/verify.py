"""Whether a certificate proves a path: computed again in numpy, from the description of the robot and the scene alone.

Seen from the frame that carries both bodies of a pair, a point of one has at most the acceleration C in a motion, and
stays within C h^2 / 8 of the chord between its places at the ends of an interval of width h. What is farther apart at
both ends than both sagittas, by a plane or between balls on their chords, is so in between. What coal measures in the
middle of an interval is apart in it if that is more than both come nearer [16]. Nothing is searched here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import groupby, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.certificate import fixed_contact
from rrtik_ompl.geometry.collision.contacts import measured
from rrtik_ompl.geometry.collision.containment import Containment
from rrtik_ompl.geometry.collision.digests import robot_digest, scene_digest
from rrtik_ompl.geometry.collision.margins import DISTANCE_TOLERANCE, keeps_clearance, kept_apart
from rrtik_ompl.kernels.layout import CONVEX_SOLID, HALF_SPACE_SOLID
from rrtik_ompl.kernels.tables.solid_tables import UNKNOWN, ConvexSolid, convex_solids, placed_solids
from rrtik_ompl.model.certificate import DEEPEST, VERSION, Certificate, MotionEntries
from rrtik_ompl.model.robot import Chain

if TYPE_CHECKING:
    from rrtik_ompl.world.world import World

ROUNDING = 1e-8  # [m] that every gap has to exceed beside all else
LARGEST_VALUE = 1e3  # [rad] or [m] of a joint, up to which that is enough
UNIT = 1e-9  # how far a normal may be from unit length, and from that of a half-space
AT_ONCE = 20_000  # intervals, to bound memory
_turned = partial(np.einsum, "nij,nj->ni")

Numbers = NDArray[np.int64]
Poses = tuple[NDArray[np.float64], Matrix]  # rotations, shape (n, 3, 3), and origins, shape (n, 3)


class Side(NamedTuple):
    """A solid of each body of a pair, on an interval of a motion."""

    motion: int
    pair: int
    one: int
    other: int
    begin: float
    width: float


def verify_certificate(certificate: Certificate, world: World, waypoints: ArrayLike, *, clearance: float = 0.0) -> str:
    """As :func:`rrtik_ompl.verify_certificate`, which refuses arguments of another kind first."""
    rows = np.ascontiguousarray(waypoints, dtype=np.float64)
    robot = world.robot
    kept = certificate.clearance
    moves = max(1, len(rows) - 1)

    standing = tuple(pair for pair in world.pairs if all(world.bodies[k].joint == 0 for k in pair))
    touching = fixed_contact(robot, world.bodies, standing)  # a matter of coal, and of no motion

    same = np.array_equal(rows, certificate.waypoints)  # to the bit, but for the sign of a zero
    fits = same and len(rows) > 0 and rows.shape[1] == robot.dof and bool(robot.within_limits(rows).all())
    sound = fits and bool((np.abs(robot.joint_values(rows)) <= LARGEST_VALUE).all())

    faults = {
        f"version {certificate.version} is not known here": certificate.version != VERSION,
        f"it is for another robot, '{certificate.robot}'": certificate.robot_digest != robot_digest(robot),
        f"it is for another self margin, {certificate.self_margin:g} m": certificate.self_margin != world.self_margin,
        "it is for another scene": certificate.scene_digest != scene_digest(world.bodies, world.pairs),
        f"it is for a clearance of {kept:g} m, not {clearance:g} m": not max(0.0, clearance) <= kept < np.inf,
        "it is for another path: waypoints differ": not same,
        f"{' and '.join(map(repr, touching or ()))} touch and never move": touching is not None,
        f"waypoints are not inside the limits of robot '{robot.name}', or beyond {LARGEST_VALUE:g}": not sound,
        f"it has {len(certificate.motions)} motions, not {moves}": len(certificate.motions) != moves,
    }

    if any(faults.values()):
        return next(text for text, found in faults.items() if found)
    return Motions(world, np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows, kept).fault(certificate.motions)


class Solid:
    """A body or a convex part of it; with a ball and, along axes' columns, a box: endless if a part is not convex."""

    def __init__(self, parts: tuple[ConvexSolid, ...], axes: Matrix) -> None:
        self.parts = parts
        self.axes = axes
        self.convex = all(part.kind == CONVEX_SOLID for part in parts)

        self.centre = np.zeros(3)
        self.middle = np.zeros(3)
        self.half = np.full(3, np.inf)
        self.radius = np.inf

        if self.convex:
            low = -self.highest(-axes.T)
            high = self.highest(axes.T)
            self.middle = 0.5 * (low + high)
            self.half = 0.5 * (high - low)
            self.centre = axes @ (0.5 * (low + high))
            self.radius = self.far(lambda points: points - self.centre)

    def far(self, moved: Callable[[Matrix], Matrix]) -> float:
        """The largest length of what a function makes of the points of the parts [m]."""
        return max(float(np.linalg.norm(moved(p.corners), axis=1).max()) + p.disc + p.radius for p in self.parts)

    def highest(self, ways: Matrix) -> Vector:
        """How far it reaches along unit vectors of the joint's frame, shapes (n, 3) and (n,)."""
        heights = []
        for part in self.parts:
            across = np.linalg.norm(np.cross(ways, part.axis), axis=1)
            height = (ways @ part.corners.T).max(axis=1) + part.disc * across + part.radius
            if part.kind == HALF_SPACE_SOLID:
                height = np.where(np.abs(ways - part.axis).max(axis=1) <= UNIT, part.disc, np.inf)
            heights.append(height if part.kind in (CONVEX_SOLID, HALF_SPACE_SOLID) else height + np.inf)
        return np.asarray(np.max(heights, axis=0))


class Motions:
    """The bodies, pairs and solids of a world, and motions of its robot between waypoints, shape (k, dof)."""

    def __init__(self, world: World, rows: Matrix, clearance: float) -> None:
        self.chain = world.robot.chain
        self.bodies = world.bodies
        self.values: Matrix = rows @ self.chain.gain.T + self.chain.offset

        self.solids = list[Solid]()
        self.numbers: dict[tuple[int, int], int] = {}  # of solids, by body and part; part -1 is the whole body
        self.parts = [self._describe(number, body) for number, body in enumerate(self.bodies)]

        joints = [body.joint for body in self.bodies]
        self.joint_of = np.array([joints[k] for k, _ in self.numbers], dtype=np.int64)

        moving = [(i, j, _common(self.chain, joints[i], joints[j])) for i, j in world.pairs if joints[i] or joints[j]]
        self.pairs = [(i, j) if joints[j] == base else (j, i) for i, j, base in moving]
        self.bases = np.array([base for _, _, base in moving], dtype=np.int64)

        both = [(self.bodies[i], self.bodies[j]) for i, j in self.pairs]
        kept = [kept_apart(a, b) + (clearance if keeps_clearance(a, b) else 0.0) for a, b in both]
        self.margins = np.array(kept) + ROUNDING

        bounds = np.array([self._bounds(i, base) + self._bounds(j, base) for i, j, base in moving])
        self.rates, self.bends = bounds.reshape(-1, 2, len(rows) - 1).transpose(1, 0, 2)

    def _describe(self, number: int, body: Body) -> range:
        """Add the solids of a body; returns the numbers of its parts."""
        own = convex_solids(body.geometry).around
        pose = body.placement.homogeneous
        parts = tuple(placed_solids(own, np.array([pose] * len(own)))) or (UNKNOWN,)
        turn = pose[:3, :3]
        for part in range(-1, len(parts)):
            self.numbers[number, part] = len(self.solids)
            self.solids.append(Solid(parts if part < 0 else (parts[part],), turn))
        return range(len(parts))

    def _bounds(self, number: int, base: int) -> Matrix:
        """Bounds of velocity and acceleration of a body's points, seen from a frame, in each motion [m], two rows."""
        rates = np.abs(np.diff(self.values, axis=0))
        chain = self.chain
        body = self.solids[self.numbers[number, -1]]
        velocity, bend = np.zeros((2, len(rates)))
        joint = self.bodies[number].joint
        if joint == base or not body.convex:
            return np.full((2, len(rates)), 0.0 if joint == base else np.inf)

        far = body.far(lambda points: points)
        reach = body.far(lambda points: np.cross(points, chain.axis[joint - 1]))

        while joint != base:  # inwards: a turn adds centripetal and Coriolis terms, a slide adds velocity alone
            k = joint - 1
            w = rates[:, k]
            slides = bool(chain.prismatic[k])
            bend = bend if slides else bend + w * (2.0 * velocity + w * reach)
            velocity = velocity + w * (1.0 if slides else reach)

            joint = int(chain.parent[k]) + 1
            origin = chain.placement[k][:3, 3]
            slide = float(np.abs(self.values[:, k]).max()) if slides else 0.0
            reach = float(np.linalg.norm(np.cross(origin, chain.axis[joint - 1]))) + slide + far
            far += float(np.linalg.norm(origin)) + slide

        return np.array([velocity, bend])

    def _frames(self, motion: Numbers, share: Vector) -> Poses:
        """Frames of all joints, the world first, at shares of motions: shapes (n, joints + 1, 3, 3) and (.., 3)."""
        chain = self.chain
        begin = self.values[motion]
        values = begin + share[:, None] * (self.values[motion + 1] - begin)
        turns = np.zeros((len(values), len(chain.parent) + 1, 3, 3))
        origins = np.zeros((len(values), len(chain.parent) + 1, 3))
        turns[:, 0] = np.eye(3)

        for k, parent in enumerate(chain.parent):
            x, y, z = chain.axis[k]
            place = chain.placement[k]
            slides = bool(chain.prismatic[k])
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

            q = values[:, k, None]
            shift = place[:3, 3] + (q * (place[:3, :3] @ (x, y, z)) if slides else 0.0 * q)
            angle = 0.0 * q[:, :, None] if slides else q[:, :, None]
            turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)

            turns[:, k + 1] = turns[:, parent + 1] @ place[:3, :3] @ turn
            origins[:, k + 1] = origins[:, parent + 1] + _turned(turns[:, parent + 1], shift)

        return turns, origins

    def _ball_gaps(self, one: Numbers, other: Numbers, seen: list[Poses], rests: Mask) -> Vector:
        """Gaps between the one solid's ball on its chord and the other's ball on its own or, at rest, its box [m]."""
        first = [self.solids[k] for k in one.tolist()]
        second = [self.solids[k] for k in other.tolist()]
        centres = [np.array([s.centre for s in solids]) for solids in (first, first, second, second)]
        p, q, begin, end = (pose[1] + _turned(pose[0], c) for pose, c in zip(seen, centres, strict=True))

        chord = q - p
        start = p - begin
        length = partial(np.linalg.norm, axis=1)
        share = np.clip(-(start * chord).sum(axis=1) / np.maximum(1e-30, (chord * chord).sum(axis=1)), 0.0, 1.0)

        moving = length(0.5 * (p + q - begin - end)) - 0.5 * (length(chord) + length(end - begin))
        balls = np.where(rests, length(start + share[:, None] * chord), moving) - [s.radius for s in second]

        back = (seen[2][0] @ np.array([s.axes for s in second])).transpose(0, 2, 1)
        a, b = (_turned(back, x - seen[2][1]) - [s.middle for s in second] for x in (p, q))
        half = np.array([s.half for s in second])
        outside = np.maximum(0.0, np.minimum(a, b) - half) + np.minimum(0.0, np.maximum(a, b) + half)
        boxes = np.where(rests, length(outside), -np.inf)

        return np.asarray(np.maximum(balls, boxes) - [s.radius for s in first])

    def _plane_gaps(self, one: Numbers, other: Numbers, seen: list[Poses], normals: Matrix) -> Vector:
        """Gaps of planes that are beside solids at both ends [m]; none where a normal is not of unit length."""
        lengths = np.linalg.norm(normals, axis=1)
        heights = []
        for solids, (turns, origins), sign in zip((one, one, other, other), seen, (-1.0, -1.0, 1.0, 1.0), strict=True):
            ways = sign * normals / np.maximum(lengths, 0.5)[:, None]
            own = _turned(turns.transpose(0, 2, 1), ways)
            height = (origins * ways).sum(axis=1)
            for number in np.unique(solids).tolist():
                height[solids == number] += self.solids[number].highest(own[solids == number])
            heights.append(height)

        return np.where(np.abs(lengths - 1.0) <= UNIT, -np.maximum(*heights[:2]) - np.maximum(*heights[2:]), -np.inf)

    def _open(self, sides: list[Side], normals: Matrix | None = None) -> list[int]:
        """Which sides are not shown apart, by planes or, where there is none or its normal is 0, by balls and boxes."""
        found: list[int] = []
        for first in range(0, len(sides), AT_ONCE):
            motion, pair, one, other, begins, widths = map(np.array, zip(*sides[first : first + AT_ONCE], strict=True))

            ends = 2.0 * np.concatenate([motion, motion]) + np.concatenate(
                [begins, begins + widths]
            )  # motion and share in one number, exactly
            nodes, where = np.unique(ends, return_inverse=True)
            turns, origins = self._frames((nodes // 2.0).astype(np.int64), nodes % 2.0)

            seen = list[Poses]()
            base = self.bases[pair]
            for solid, node in product((one, other), where.reshape(2, -1)):
                back = turns[node, base].transpose(0, 2, 1)
                joint = self.joint_of[solid]
                seen.append((back @ turns[node, joint], _turned(back, origins[node, joint] - origins[node, base])))

            gaps = self._ball_gaps(one, other, seen, self.joint_of[other] == base)
            if normals is not None:
                ways = normals[first : first + AT_ONCE]
                gaps = np.where(ways.any(axis=1), self._plane_gaps(one, other, seen, ways), gaps)

            enough = self.margins[pair] + 0.125 * self.bends[pair, motion] * widths**2
            found += (first + np.flatnonzero(~(gaps > enough))).tolist()
        return found

    def _measured_apart(self, side: Side) -> bool:
        """Whether coal finds two whole bodies farther apart in the middle of an interval than they come nearer."""
        turns, origins = self._frames(np.array([side.motion]), np.array([side.begin + 0.5 * side.width]))
        frames = np.tile(np.eye(4), (turns.shape[1], 1, 1))
        frames[:, :3, :3] = turns[0]
        frames[:, :3, 3] = origins[0]

        both = tuple(self.bodies[k] for k in self.pairs[side.pair])
        kept = self.margins[side.pair] + DISTANCE_TOLERANCE + 0.5 * side.width * self.rates[side.pair, side.motion]
        apart = next(measured(both, ((0, 1),), frames, near_only=False)).distance > kept
        whole = side[:4] == self._all_of(side.motion, side.pair)[:4]
        return bool(whole and apart and not Containment(both, ((0, 1),)).holds((0, 1), frames))

    def _all_of(self, motion: int, pair: int, a: int = -1, b: int = -1) -> Side:
        i, j = self.pairs[pair]
        return Side(motion, pair, self.numbers[i, a], self.numbers[j, b], 0.0, 1.0)

    def _say(self, side: Side, what: str) -> str:
        pair = " and ".join(f"'{self.bodies[k].name}'" for k in self.pairs[side.pair])
        return f"motion {side.motion + 1}: {pair} {what} {side.begin:g} to {side.begin + side.width:g} of it"

    def fault(self, motions: tuple[MotionEntries, ...]) -> str:
        """The first thing that entries do not show; "" if they show all pairs apart in all of the motions."""
        places = {pair: k for k, pair in enumerate(self.pairs)}
        sides = list[Side]()
        for number, motion in enumerate(motions):
            for (i, a, j, b), (level, k) in zip(motion.solids.tolist(), motion.intervals.tolist(), strict=True):
                if (i, j) not in places or not {(i, a), (j, b)} <= self.numbers.keys() or level > DEEPEST:
                    return f"motion {number + 1}: no parts {a} and {b} of a pair {i} and {j}, or no level {level}"
                width = 0.5**level
                sides.append(Side(number, places[i, j], self.numbers[i, a], self.numbers[j, b], k * width, width))

        covered = {key: list(given) for key, given in groupby(sorted(sides), lambda side: side[:4])}
        for given in covered.values():
            if [0.0, *(side.begin + side.width for side in given)] != [*(side.begin for side in given), 1.0]:
                return self._say(given[0], "have entries with a gap or an overlap, the first of them from")

        for k in self._open(sides, np.concatenate([motion.normals for motion in motions])):
            if not self._measured_apart(sides[k]):
                return self._say(sides[k], "are not shown apart from")

        every = (self._all_of(*both) for both in product(range(len(motions)), range(len(self.pairs))))
        whole = [side for side in every if side[:4] not in covered]
        split = [(whole[k][:2], *self.pairs[whole[k].pair]) for k in self._open(whole)]
        parts = (self._all_of(*both, *ab) for both, i, j in split for ab in product(self.parts[i], self.parts[j]))
        rest = [side for side in parts if side[:4] not in covered]

        return next((self._say(rest[k], "are not shown apart from") for k in self._open(rest)), "")


def _common(chain: Chain, first: int, second: int) -> int:
    """The last frame that carries both of two frames."""
    while first != second:  # parents have smaller numbers
        first, second = min(first, second), int(chain.parent[max(first, second) - 1]) + 1
    return first
