"""A way out of a tick, or a proof that there is none: whatever the arm does, some obstacle can touch it in the tick.

In a tick the arm goes straight, at one speed. So a motion is the configuration where it ends, and boxes cover all of
these. In each box one obstacle, grown by what the bound on its speed allows until some time of the tick, touches one
link on all motions that end there: at this time of the motion to the box's centre it is nearer than its growth, by more
than any point of the link is elsewhere then on another of these motions. Boxes of which this cannot be said are halved,
across what moves the link that lacks most room at the centre, until the motion to the centre of one of them keeps apart
from all obstacles, which is a way out, or until none is left. A link that never moves is touched on all motions.
docs/science/evasion.md has the theorem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.world.world import World

MOST_BOXES = 4096  # after which the search is given up, for an arm of few joints
MANY_JOINTS = 4
FEW_BOXES = 1024  # the same for an arm of so many joints or more, each of whose boxes takes longer
FIRST_LOOKS = 4  # parts of a motion at whose ends it is looked at; twice as many where boxes are half as wide
MOST_HALVINGS = 9  # of parts of a motion that is to be proven
ROUNDING = 1e-6  # [m] of distances


class ContactWarning(UserWarning):
    """It is proven that no motion of the arm rules out a contact."""


@dataclass(frozen=True, slots=True, eq=False)
class Unavoidable:
    """A proof that contact cannot be ruled out in a tick, for each motion that the arm could make.

    Attributes:
        lower, upper: Corners of boxes that cover all configurations that the arm can reach in the tick, shape (k, n).
        seconds: For each box a time of the tick, from its begin [s], shape (k,).
        pairs: For each box a link and an obstacle that can touch it by then, wherever in the box the motion ends.
        distances: For each box the distance of this obstacle, where it was seen, from the link at that time of the
            motion to the centre [m], shape (k,).
    """

    lower: Matrix
    upper: Matrix
    seconds: Vector
    pairs: tuple[tuple[str, str], ...]
    distances: Vector

    __reduce__ = as_value

    @property
    def sentence(self) -> str:
        """What is proven, in one line."""
        names = ", ".join(f"'{name}'" for name in dict.fromkeys(obstacle for _, obstacle in self.pairs))
        seconds = self.seconds.max()
        return f"no motion of the arm rules out a contact with {names} within {seconds:.3g} s, which is proven"


@dataclass(frozen=True, eq=False)
class Reach:
    """What the arm and the obstacles can reach in a tick.

    Attributes:
        world: The robot and the obstacles where they were seen.
        q: The robot's configuration at the begin of the tick, shape (n,).
        step: How far the arm can go in the tick [unit of the space].
        max_change: How far each joint can move in it [rad or m], shape (n,).
        seconds: Length of the tick [s].
        before, after: How far each obstacle may be from where it was seen at the begin of the tick and at its end [m],
            by name.
        spare: Room that a motion has to leave beside that [m], which accounts for rounding.
    """

    world: World
    q: Vector
    step: float
    max_change: Vector
    seconds: float
    before: Mapping[str, float]
    after: Mapping[str, float]
    spare: float

    @cached_property
    def ends(self) -> tuple[Vector, Vector]:
        """The corners of a box around all configurations that the arm can reach, shapes (n,)."""
        change = np.minimum(self.max_change, self.step)
        robot = self.world.robot
        return np.maximum(self.q - change, robot.lower), np.minimum(self.q + change, robot.upper)

    @cached_property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The links that move, each with an obstacle that it must not touch and that may reach it in the tick."""
        return tuple(self._near)

    @cached_property
    def weights(self) -> Matrix:
        """How far any point of the link of each pair moves at most per unit of each joint [m per rad, or 1], (p, n)."""
        return np.array(list(self._near.values())).reshape(-1, len(self.q))

    @cached_property
    def _near(self) -> dict[tuple[str, str], Vector]:
        """The pairs and their weights."""
        world = self.world
        every = approach_weights(world.robot, world.bodies, world.pairs)
        weights: dict[tuple[str, str], Vector] = {}
        for (first, second), row in zip(world.pairs, every, strict=True):
            pair = _link_first(world.bodies[first].name, world.bodies[second].name, self.after)
            weights[pair] = np.maximum(weights.get(pair, 0.0), row)

        found = world.distances(self.q)
        near = {}
        for named, distance in zip(found.names, found.values.tolist(), strict=True):
            pair = _link_first(*named, self.after)
            lower, upper = self.ends
            if pair[1] in self.after and distance - (upper - lower) @ weights[pair] <= self.after[pair[1]] + self.spare:
                near[pair] = weights[pair]
        return near

    def distances(self, rows: Matrix) -> Matrix:
        """Return the distances of the pairs at configurations, shape (m, n), or lower bounds of them [m], (m, p)."""
        lower, upper = self.ends
        of_interest = max(self.after.values()) + float((upper - lower) @ self.world.weights)
        return self.world.distances(rows, self.pairs, within=of_interest).values

    def growths(self, shares: Vector) -> Matrix:
        """Return how far the obstacles of the pairs may have gone at shares of the tick, shape (k,) [m], (k, p)."""
        before, after = (np.array([way[obstacle] for _, obstacle in self.pairs]) for way in (self.before, self.after))
        return np.asarray(before + shares[:, None] * (after - before))

    def keeps_apart(self, end: Vector) -> bool:
        """Check whether nothing can reach the arm on its motion to ``end``, shape (n,), with ``spare`` left."""
        shares = np.linspace(0.0, 1.0, FIRST_LOOKS + 1)
        way = float(np.abs(end - self.q) @ self.world.weights)
        for _ in range(MOST_HALVINGS):
            room = self.distances(self.q + shares[:, None] * (end - self.q)).T
            growth = self.growths(shares).T + self.spare
            if (room <= growth).any():
                return False
            doubtful = ~kept(room, way * np.diff(shares), growth).all(axis=0)
            if not doubtful.any():
                return True
            middles = 0.5 * (shares[1:] + shares[:-1])
            shares = np.sort(np.append(shares, middles[doubtful]))
        return False


def way_out(reach: Reach, may_go: Callable[[Vector], bool]) -> Vector | Unavoidable | None:
    """Return the end of a motion of a tick on which nothing can touch the arm, or a proof that there is none.

    Args:
        reach: What arm and obstacles can reach.
        may_go: Says of a configuration, shape (n,), whether the motion to it is free but for what may move.

    Returns:
        Where the motion ends, shape (n,); the proof; or None if neither was found.
    """
    q = reach.q
    lower, upper = (corner[None] for corner in reach.ends)
    if (base := _base_touched(reach)) is not None:
        return Unavoidable(lower, upper, np.array([reach.seconds]), (base[0],), np.array([base[1]]))
    if not reach.pairs:
        return q if may_go(q) else None

    proven: list[tuple[Vector, Vector, float, tuple[str, str], float]] = []
    asked = 0
    halvings = 0
    while len(lower) > 0:
        asked += len(lower)
        if asked > (MOST_BOXES if len(q) < MANY_JOINTS else FEW_BOXES):
            return None

        shares = np.linspace(0.0, 1.0, (FIRST_LOOKS << halvings // len(q)) + 1)
        centres = 0.5 * (lower + upper)
        rows = q + shares[:, None] * (centres - q)[:, None, :]
        distances = reach.distances(rows.reshape(-1, len(q))).reshape(len(centres), len(shares), -1)
        beside = distances - reach.growths(shares)
        least = beside.min(axis=1)  # of each box and pair

        room = np.where(_in_reach(reach, centres), least.min(axis=1), -np.inf)
        best = int(room.argmax())
        if room[best] > 0.0 and reach.keeps_apart(centres[best]) and may_go(centres[best]):
            return np.asarray(centres[best])

        # No point of a link is farther from where it is on the motion to the centre.
        elsewhere = shares[:, None] * (0.5 * (upper - lower) @ reach.weights.T)[:, None, :]
        most = (beside + elsewhere).reshape(len(centres), -1)
        looked, pair = np.divmod(most.argmin(axis=1), len(reach.pairs))
        touched = most.min(axis=1) < -ROUNDING
        for k in np.flatnonzero(touched).tolist():
            distance = float(distances[k, looked[k], pair[k]])
            proven.append((lower[k], upper[k], reach.seconds * shares[looked[k]], reach.pairs[pair[k]], distance))

        weights = reach.weights[least.argmin(axis=1)]
        lower, upper = _halves(lower[~touched], upper[~touched], weights[~touched])
        halvings += 1
        within = _in_reach(reach, np.clip(q, lower, upper))
        lower, upper = lower[within], upper[within]

    lows, highs, seconds, pairs, near = zip(*proven, strict=True)
    return Unavoidable(np.array(lows), np.array(highs), np.array(seconds), pairs, np.array(near))


def kept(room: Matrix, travels: Matrix, growth: Matrix) -> Mask:
    """Return in which pieces of motions there is always more room than obstacles have grown, shape (m, k - 1).

    From one end of a piece to the other no point of the arm goes farther than ``travels``. So the room in between is at
    least the larger of two lines that fall from the ends inwards; beside the growth it is least where they meet, or at
    the end.

    Args:
        room: Lower bounds of the distance to obstacles at the ends of the pieces [m], shape (m, k).
        travels: Bounds of the motion in each piece [m], shape (m, k - 1) or (k - 1,).
        growth: How much obstacles have grown at the ends [m], increasing, shape (m, k) or (k,).
    """
    first, last = room[:, :-1], room[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        meeting = np.clip(np.where(travels > 0.0, 0.5 + 0.5 * (first - last) / travels, 1.0), 0.0, 1.0)
        least = np.where(travels > 0.0, 0.5 * (first + last - travels), last)
    grown = growth[..., :-1] + meeting * np.diff(growth)
    return np.asarray((first > growth[..., :-1]) & (last > growth[..., 1:]) & (least > grown))


def _in_reach(reach: Reach, rows: Matrix) -> Mask:
    """Return which configurations, shape (m, n), are within a step, shape (m,)."""
    return np.asarray(np.linalg.norm(rows - reach.q, axis=1) <= reach.step)


def _base_touched(reach: Reach) -> tuple[tuple[str, str], float] | None:
    """Return a link that never moves and an obstacle that can touch it, with their distance [m]; None without any.

    Coal measures these few pairs: to pack a new scene for kernels would take far longer.
    """
    world = reach.world
    bodies = world.bodies
    pairs_at_rest = [pair for pair in world.pairs if all(bodies[k].joint == 0 for k in pair)]
    frames = world.robot.chain.joint_frames(reach.q[None])[0]

    def beside(contact: Contact) -> float:
        return contact.distance - reach.after[_link_first(contact.first, contact.second, reach.after)[1]]

    nearest = min(measured(bodies, pairs_at_rest, frames, near_only=False), key=beside, default=None)
    if nearest is None or beside(nearest) >= -ROUNDING:
        return None
    return _link_first(nearest.first, nearest.second, reach.after), nearest.distance


def _link_first(first: str, second: str, obstacles: Mapping[str, float]) -> tuple[str, str]:
    """Return the names of a pair, that of the obstacle last."""
    return (first, second) if second in obstacles else (second, first)


def _halves(lower: Matrix, upper: Matrix, weights: Matrix) -> tuple[Matrix, Matrix]:
    """Return both halves of boxes, each cut across the edge along which most is moved by its weights, (m, n)."""
    axes = np.argmax((upper - lower) * weights, axis=1)
    rows = np.arange(len(lower))
    middles = 0.5 * (lower[rows, axes] + upper[rows, axes])
    first_upper = upper.copy()
    first_upper[rows, axes] = middles
    second_lower = lower.copy()
    second_lower[rows, axes] = middles
    return np.vstack([lower, second_lower]), np.vstack([first_upper, upper])
