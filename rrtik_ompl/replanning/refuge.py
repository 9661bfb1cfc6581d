"""Where an arm goes so that nothing can reach it in time, if no obstacle is faster than stated.

An obstacle that was seen ``age`` seconds ago is, ``t`` seconds from now, within ``speed * (age + t)`` of where it was
seen. A motion that keeps farther than that from all seen places, at each time of it, touches nothing, whatever the
obstacles do [78]. docs/science/evasion.md has the theorem. Accelerations of the arm are not considered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.replanning.evading import directions
from rrtik_ompl.replanning.faults import TIME_RESOLUTION
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.replanning.travels import SPEED_WARNING_RATIO
from rrtik_ompl.replanning.unavoidable import kept
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World

# Motions are looked at some times within the first tick [ticks], and then at others, in units of one tick or more; a
# bound on the motion closes the gaps between looks.
FIRST_LOOKS = (0.0, 0.25, 0.5, 0.75, 1.0)
FURTHER_LOOKS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0)
# In a unit of several ticks obstacles come at most so far as a share of the arm's fastest point in a tick. So the arm
# gives slow obstacles a wide berth, which costs little.
UNIT_SHARE = 0.3
LONGEST_UNIT = 0.1  # [s]
NEEDED = 5.0  # A step along the path is made if with it there is a motion that is safe for so many units.
RATED = (1.0, 2.0, 3.0, 4.0, 6.0)  # when ways out are rated by where obstacles are predicted to be [units]
SOON = 3.0  # Refuges have most room then [units]; it is one of the times above, whose world is there already.
ENOUGH = 1.0  # Of ways out that are safe for so many units the prediction decides.
DIRECTIONS = 64  # random directions in which refuges are looked for
LENGTHS = (0.25, 1.0, 2.0, 4.0)  # how far away, in units at full speed
MOST_TARGETS = 64  # refuges with most room, to which ways are looked at
MOST_TRIED = 16  # best ways that are checked for self-collision
PIECES = 32  # parts of a tick in each of which obstacles are grown to their size at its end
SPARE = 1e-9  # [s]: rounding of times

Ways = NDArray[np.float64]  # configurations at some times, shape (m, k, n)


@dataclass(frozen=True, slots=True, eq=False)
class Refuge:
    """The begin of a motion that is safe for a while.

    Attributes:
        q: Where the arm is after a tick, shape (n,).
        seconds: How long the motion is proven safe [s], from the begin of the tick; 0 if it is not.
        moves: Whether the arm moves in the tick.
    """

    q: Vector
    seconds: float
    moves: bool


class Guard:
    """Chooses motions that no obstacle can reach in time.

    Args:
        world: The robot and the first scene, with exact checks.
        alone: The robot without obstacles, which checks and proves that it does not touch itself.
        settings: Step, ticks and the bound on speeds, which must be stated.
        keep: Distance to obstacles that is kept where that is possible [m].
        max_change: How far each joint can move in a tick [rad or m], shape (n,).
        rng: Source of random directions.
    """

    def __init__(
        self,
        world: World,
        alone: World,
        settings: ReplanSettings,
        keep: float,
        max_change: Vector,
        rng: np.random.Generator,
    ) -> None:
        assert settings.speed_bound is not None
        self._world = world
        self._alone = alone
        self._step = settings.step
        self._tick = settings.tick
        self._speed = settings.speed_bound * SPEED_WARNING_RATIO
        self._keep = keep
        self._max_change = max_change
        self._rng = rng
        self._fastest = float((world.weights * np.minimum(settings.step, max_change)).max())  # [m] in a tick
        self._unit = self._unit_for(self._speed)  # [ticks]
        self._looks = np.unique([*FIRST_LOOKS, *(self._unit * np.array(FURTHER_LOOKS))])
        self._parts: dict[bool, tuple[frozenset[str], MovingWorld | None]] = {}

    @property
    def needed(self) -> float:
        """How long motions have to be safe, the tick included, so that the arm goes on [s]."""
        return NEEDED * self._unit * self._tick

    def _unit_for(self, speed: float) -> int:
        """Return the ticks of a unit among obstacles of a speed [m/s]."""
        return max(int(min(UNIT_SHARE * self._fastest / (speed * self._tick), LONGEST_UNIT / self._tick)), 1)

    def bound_for(self, room: float) -> float:
        """Return a bound on speeds with which nothing comes as far as ``room`` [m] in the time that is needed [m/s]."""
        longest = max(int(LONGEST_UNIT / self._tick), 1)
        bounds = ((unit, max(room, 0.0) / (NEEDED * unit * self._tick)) for unit in range(1, longest + 1))
        return max(bound for unit, bound in bounds if unit == longest or bound == 0.0 or self._unit_for(bound) <= unit)

    def see(self, scene: Scene, ages: Mapping[str, float], may_move: frozenset[str]) -> None:
        """Take over where obstacles were seen.

        Args:
            scene: The last scene.
            ages: How long ago each obstacle was seen [s], by name.
            may_move: Names of the obstacles that may move; the others stay where they are.
        """
        stay = frozenset(o.name for o in scene.obstacles) - may_move
        for moving, names in ((True, may_move), (False, stay)):
            part = _part_of(scene, names)
            known = self._parts.get(moving)
            if known is None or known[0] != names:
                world = MovingWorld(self._world.with_scene(part), self_collision=False) if names else None
                self._parts[moving] = names, world
            world = self._parts[moving][1]
            if world is not None:
                seconds = {name: ages[name] + TIME_RESOLUTION if moving else 0.0 for name in names}
                world.move(part, inflation={name: self._speed * age for name, age in seconds.items()})

    def seconds_after(self, q: Vector, path: Matrix, *, stays: bool = False) -> tuple[float, bool]:
        """Return how long the best motion that begins with a step keeps its distance, and whether that is enough.

        It is if the motion does so for as long as is needed, or to the end of the path, where the run ends.

        Args:
            q: The robot's configuration, shape (n,).
            path: Where it would be after the tick, and its path from there to a goal, shape (k, n).
            stays: Whether the arm must be able to stand where the step ends for as long as is needed.

        Returns:
            The time, at most :attr:`needed` [s].
        """
        after = path[0]
        looks = self._looks[self._looks <= NEEDED * self._unit]
        step = q + np.minimum(looks, 1.0)[:, None] * (after - q)
        seconds = float(self._safe_seconds(step[None], looks)[0, 0])  # It may stand where the step ends.
        if seconds >= self.needed - SPARE:
            return seconds, True
        proven = 0.0
        if seconds < self._tick - SPARE:
            # The bounds between looks are coarse: beside an obstacle that stays, planes may still prove the step.
            if not self._out_of_reach(q, after[None], self._keep)[0]:
                return seconds, False
            proven = 1.0

        further = np.maximum(looks - 1.0, 0.0)
        ways = self._ways(after, self._targets(after, path), further)
        ways = np.concatenate([ways, self._along(path, further)[None]])
        ways = np.where((looks <= 1.0)[None, :, None], step[None], ways)
        kept_seconds = self._safe_seconds(ways, looks, proven)[:, 0]
        seconds = float(kept_seconds.max())
        ticks = 1.0 + float(ticks_of(np.diff(path, axis=0), self._step, self._max_change).sum())
        arrival = float(np.ceil(ticks - SPARE)) * self._tick
        arrives = float(kept_seconds[-1]) >= arrival - SPARE
        return seconds, arrives or (seconds >= self.needed - SPARE and not stays)

    def refuge(self, q: Vector, path: Matrix | None, ahead: Callable[[int], MovingWorld]) -> Refuge:
        """Return the begin of the best motion from ``q``.

        What counts is first how long nothing can touch the arm, then how long nothing can come nearer than ``keep``,
        then the room beside obstacles where they are predicted to be. Standing still is one of the motions, and is
        preferred where it keeps that distance for as long as is needed.

        Args:
            q: The robot's configuration, shape (n,).
            path: Its path, shape (k, n), or None.
            ahead: Returns the world predicted so many ticks ahead, without self-collision. It may move and return the
                same object each time.
        """
        soon_ticks = round(SOON * self._unit)
        soon = ahead(soon_ticks)
        ways = self._ways(q, np.vstack([q, self._targets(q, path, soon)]), self._looks)
        if path is not None and len(path) > 1:
            ways = np.concatenate([ways, self._along(path, self._looks)[None]])
        kept_seconds, seconds = self._safe_seconds(ways, self._looks).T
        if kept_seconds[0] >= self.needed - SPARE:
            return Refuge(q, float(seconds[0]), moves=False)

        room = np.full(len(ways), np.inf)
        for ticks in dict.fromkeys((soon_ticks, 1, *(round(self._unit * units) for units in RATED))):
            room = np.minimum(room, ahead(ticks).clearance(ways[:, self._look_at(ticks)]))
        ends = ways[:, self._look_at(1)]
        if seconds.max() < self._tick - SPARE:
            seconds = np.where(self._out_of_reach(q, ends), self._tick, seconds)
        enough = ENOUGH * self._unit * self._tick
        ranks = -room, -np.minimum(kept_seconds, enough), -np.minimum(seconds, enough)
        order = np.lexsort(ranks)[:MOST_TRIED]
        for k in order.tolist():
            if not (ends[k] != q).any():
                return Refuge(q, float(seconds[k]), moves=False)
            if self._alone.motion_valid(q, ends[k]):
                return Refuge(ends[k], float(seconds[k]), moves=True)
        return Refuge(q, float(seconds[0]), moves=False)

    def _safe_seconds(self, ways: Ways, looks: Vector, proven: float = 0.0) -> Matrix:
        """Return how long motions keep the distance ``keep``, and how long they touch nothing [s], shape (m, 2).

        Both are at most the time of the last look.

        Args:
            ways: Configurations at the looks, between which the joints go straight, shape (m, k, n).
            looks: Times in ticks, increasing from 0, shape (k,).
            proven: Until then the motions are known to keep ``keep`` [ticks].
        """
        count, _, joints = ways.shape
        travels = np.abs(np.diff(ways, axis=1)) @ self._world.weights
        safe = np.ones((count, len(looks), 2), dtype=bool)
        safe[:, -1] = False  # Nothing is known of what comes after the last look.
        for moving, (_, world) in self._parts.items():
            if world is not None:
                room = world.clearance(ways.reshape(-1, joints)).reshape(count, -1)
                growth = self._speed * self._tick * looks if moving else np.zeros_like(looks)
                for k, keep in enumerate((self._keep, 0.0)):
                    safe[:, :-1, k] &= kept(room, travels, keep + growth) | (looks[1:] <= proven)
        return np.asarray(self._tick * looks[safe.argmin(axis=1)])

    def _out_of_reach(self, q: Vector, ends: Matrix, keep: float = 0.0) -> Mask:
        """Return which motions of one tick from ``q`` to ends, shape (m, n), are proven safe by planes, shape (m,).

        They keep the distance ``keep`` [m] from what obstacles can reach. It is exact where :meth:`_safe_seconds` has
        only bounds of distances, and takes longer.
        """
        free = np.ones(len(ends), dtype=bool)
        for before, after in pairwise(np.linspace(0.0, 1.0, PIECES + 1).tolist()):
            for moving, (_, world) in self._parts.items():
                if world is not None and free.any():
                    growth = self._speed * self._tick * after if moving else 0.0
                    edges = ends[free] - q
                    proven = world.motions_proven(q + before * edges, q + after * edges, less=-growth - keep)
                    free[free] = proven
        return free

    def _targets(self, q: Vector, path: Matrix | None, soon: MovingWorld | None = None) -> Matrix:
        """Return configurations around ``q`` with the most room, shape (m, n)."""
        moves = self._max_change * directions(q, self._max_change, self._rng, path, DIRECTIONS)
        moves *= np.minimum(self._step / np.linalg.norm(moves, axis=1), 1.0)[:, None]
        robot = self._world.robot
        targets = np.vstack([np.clip(q + self._unit * length * moves, robot.lower, robot.upper) for length in LENGTHS])
        world = self._parts[True][1] or self._parts[False][1]
        if world is None:
            return targets[:MOST_TARGETS]
        best = np.argsort(-world.clearance(targets), kind="stable")[:MOST_TARGETS]
        if soon is not None:
            best = np.union1d(best, np.argsort(-soon.clearance(targets), kind="stable")[:MOST_TARGETS])
        return targets[best]

    def _ways(self, q: Vector, targets: Matrix, looks: Vector) -> Ways:
        """Return where the arm is on its straight ways at full speed from ``q`` to targets, shape (m, n), and stays."""
        edges = targets - q
        ticks = ticks_of(edges, self._step, self._max_change)

        def at(times: Vector) -> Ways:
            with np.errstate(divide="ignore", invalid="ignore"):
                shares = np.where(ticks[:, None] > 0.0, times / ticks[:, None], 1.0)
            return np.asarray(q + np.minimum(shares, 1.0)[:, :, None] * edges[:, None, :])

        return _straight_in_ticks(at, looks)

    def _along(self, path: Matrix, looks: Vector) -> Matrix:
        """Return where the arm is on its way along the path, shape (k, n), at times in ticks."""
        ends = np.concatenate([[0.0], np.cumsum(ticks_of(np.diff(path, axis=0), self._step, self._max_change))])

        def at(times: Vector) -> Matrix:
            return np.column_stack([np.interp(times, ends, values) for values in path.T])

        return _straight_in_ticks(at, looks)

    def _look_at(self, ticks: int) -> int:
        """Return the number of the look after so many ticks."""
        return int(np.searchsorted(self._looks, ticks))


def _straight_in_ticks(at: Callable[[Vector], Ways], looks: Vector) -> Ways:
    """Return where the arm is at times in ticks, shape (k,), if it goes straight, at one speed, within each tick.

    Args:
        at: Returns where it is when ticks begin and end, shape (..., k, n).
        looks: The times.
    """
    begins = at(np.floor(looks))
    shares = looks % 1.0
    return np.asarray(begins + shares[:, None] * (at(np.ceil(looks)) - begins))


def ticks_of(edges: Matrix, step: float, max_change: Vector) -> Vector:
    """Return how many ticks straight motions by ``edges``, shape (m, n), take; fractions count; shape (m,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rates = np.where(edges == 0.0, 0.0, np.abs(edges) / max_change)
    return np.asarray(np.maximum(np.linalg.norm(edges, axis=1) / step, rates.max(axis=1)))


def _part_of(scene: Scene, names: frozenset[str]) -> Scene:
    """Return a scene with only some of its obstacles."""
    return scene.without(*(o.name for o in scene.obstacles if o.name not in names))
