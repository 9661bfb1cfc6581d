"""Independent check of recorded runs: which bodies are too near at any time, by coal and a bound on the motion.

It builds bodies and pairs as a new :class:`rrtik_ompl.World` does and places each body where the record has it. It
does not use :class:`MovingWorld`, in which obstacles are moved while the arm is on its way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.copies import as_value
from rrtik_ompl.base.poses import pose_from_xyzw, travel_bound
from rrtik_ompl.geometry.collision.bodies import Body, contact_distance, keeps_clearance, kept_apart
from rrtik_ompl.geometry.collision.cloud_solid import Ends
from rrtik_ompl.geometry.collision.distances import gap_beyond, is_ours, own_nearest
from rrtik_ompl.geometry.collision.motion_bound import approach_weights
from rrtik_ompl.geometry.collision.shape_table import farthest
from rrtik_ompl.model.scene import Motion, Obstacle, Scene, TimedPoses, pairs_that_may_touch, pose_at
from rrtik_ompl.model.shapes import same_shape
from rrtik_ompl.model.world_settings import WorldSettings
from rrtik_ompl.replanning.feed import Feed, Snapshot
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.world.arrangement import arrangement_of
from rrtik_ompl.world.problem import Problem

FINEST_APPROACH = 2e-5  # [m]: an interval in which a pair approaches by less is judged by its middle alone
COARSEST_APPROACH = 2e-3  # [m]: the same for an interval in whose middle the pair is known to be too near
RELATIVE_ACCURACY = 0.1  # The same, as a share of the missing distance, if that is larger.
ROUNDING = 2e-6  # [m]: rounding of distances and of poses that are computed from times
TRUTHS_PER_TICK = 4  # times per tick at which a function of time is asked for the truth

Frames: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class RunViolation:
    """Two bodies that are nearer to each other in a run than they may be.

    Attributes:
        time: Time within the tick at which the most distance is missing [s].
        tick: Number of the tick.
        event: Event of the tick.
        first, second: Names of the two bodies.
        distance: Signed distance between them [m]; negative is the penetration depth, where their shapes allow it to be
            computed, and else 0 stands for an overlap.
        required_distance: Distance that had to be kept [m]: 0 (negative for a contact that the scene allows), or
            margins and clearance if the record calls the move proven.
        proven: Whether the record calls the move proven.
    """

    time: float
    tick: int
    event: str
    first: str
    second: str
    distance: float
    required_distance: float
    proven: bool

    __reduce__ = as_value

    @property
    def touches(self) -> bool:
        """Whether the two bodies touch or overlap; if not, they are only nearer than required."""
        return self.distance <= 0.0

    def __str__(self) -> str:
        where = f"tick {self.tick} at {self.time:.3f} s ({self.event}{', proven' * self.proven})"
        pair = f"'{self.first}' and '{self.second}'"
        if self.touches:
            deep = f" by {-1e3 * self.distance:.3g} mm" if self.distance < 0.0 else ""
            return f"{where}: {pair} {'overlap' if deep else 'touch'}{deep}"
        required = f"{1e3 * self.required_distance:.3g} mm"
        return f"{where}: {pair} are {1e3 * self.distance:.3g} mm apart, less than {required}"


def run_violations(
    ticks: Sequence[Tick],
    scenes: Sequence[Snapshot],
    problem: Problem,
    *,
    clearance: float,
    truth: Scene | Feed | None = None,
) -> tuple[RunViolation, ...]:
    """Return the violations of a run; see :meth:`rrtik_ompl.replanning.record.ReplanRun.violations`.

    The run is split into periods in which only poses change, and each tick of a period is judged by itself.

    Args:
        ticks: All ticks of the run.
        scenes: The scenes that were seen; empty for an old record, whose ticks hold poses instead.
        problem: The problem that was run.
        clearance: Distance that proven moves keep from obstacles in addition to the obstacles' margins [m].
        truth: Where obstacles really were, or None for where they were seen.

    Returns:
        For each tick and pair the worst violation, in the order of time, then of names.
    """
    if not ticks:
        return ()

    snapshots = _snapshots(ticks, scenes, problem.world.scene, truth)
    worst = dict[tuple[int, str, str], RunViolation]()

    for period in _periods(snapshots, ticks[-1].time):
        for violation in _PeriodJudge(problem.settings, ticks, period, clearance).violations():
            key = violation.tick, violation.first, violation.second
            if key not in worst or _lacking(violation) > _lacking(worst[key]):
                worst[key] = violation

    return tuple(sorted(worst.values(), key=lambda violation: (violation.time, violation.first, violation.second)))


def _lacking(violation: RunViolation) -> float:
    """Return how much of the required distance is missing [m]."""
    return violation.required_distance - violation.distance


def _snapshots(
    ticks: Sequence[Tick], scenes: Sequence[Snapshot], scene: Scene, truth: Scene | Feed | None
) -> Sequence[Snapshot]:
    """Return where obstacles were: the truth if it is given, else the seen scenes, else the poses of the ticks.

    Args:
        ticks: All ticks of the run.
        scenes: The scenes that were seen; empty for an old record.
        scene: The problem's scene, which gives an old record its shapes.
        truth: A scene that states its motions, or a function of time, which is sampled ``TRUTHS_PER_TICK`` times per
            tick.
    """
    if isinstance(truth, Scene):
        return [Snapshot(0.0, truth.at(0.0), stated=True)]
    if truth is not None:
        times = [tick.time for tick in ticks]
        numbers = np.arange(TRUTHS_PER_TICK * (len(times) - 1) + 1) / TRUTHS_PER_TICK
        instants = np.interp(numbers, np.arange(len(times)), times)
        return [Snapshot(time, truth(time)) for time in instants.tolist()]
    if scenes:
        return scenes
    first = scene.at(0.0)
    return [Snapshot(tick.time, _scene_at_tick(first, tick)) for tick in ticks]


def _scene_at_tick(scene: Scene, tick: Tick) -> Scene:
    """Return a scene with its obstacles, now at rest, at the poses that a tick records."""
    poses = {name: pose_from_xyzw(row[:3], row[3:]) for name, row in tick.poses.items()}
    obstacles = (replace(o, motion=None, pose=poses.get(o.name, o.pose)) for o in scene.obstacles)
    return replace(scene, obstacles=tuple(obstacles))


@dataclass(frozen=True, slots=True, eq=False)
class _Period:
    """A part of a run in which obstacles, shapes, margins and allowed pairs stay the same.

    Attributes:
        begin, end: Begin and end of the period [s].
        is_last: Whether the run ends with this period.
        scene: The scene of the period, whose obstacles state how they move.
        knots: Times in the whole run at which the straight motion of some obstacle may change [s], shape (m,).
    """

    begin: float
    end: float
    is_last: bool
    scene: Scene
    knots: Vector


def _periods(snapshots: Sequence[Snapshot], end: float) -> Iterator[_Period]:
    """Yield the periods of a run until ``end`` [s]; a new one begins where more than the poses changes."""
    obstacles = {o.name: o for each in snapshots for o in each.scene.obstacles}
    motions = {name: _motion_of(snapshots, each) for name, each in obstacles.items()}
    knots = np.unique([time for motion in motions.values() if motion is not None for time in _turning_times(motion)])
    begins = [
        0,
        *(k for k, (a, b) in enumerate(pairwise(snapshots), start=1) if not _same_but_for_poses(a.scene, b.scene)),
    ]

    for first, next_first in pairwise([*begins, len(snapshots)]):
        scene = snapshots[first].scene
        end_of_scenes = snapshots[next_first].time if next_first < len(snapshots) else end
        moving = tuple(replace(o, motion=motions[o.name]) for o in scene.obstacles)
        begin = snapshots[first].time if first else 0.0
        yield _Period(
            begin, min(end_of_scenes, end), next_first == len(snapshots), replace(scene, obstacles=moving), knots
        )


def _motion_of(snapshots: Sequence[Snapshot], obstacle: Obstacle) -> Motion | None:
    """Return how an obstacle moved: as its scene states, or straight from each pose where it was seen to the next."""
    name = obstacle.name
    if snapshots[0].stated:
        return obstacle.motion

    pose_of_time = {each.seen_at(name): o.pose for each in snapshots for o in each.scene.obstacles if o.name == name}
    times = sorted(pose_of_time)
    poses = [pose_of_time[time] for time in times]
    if all(np.array_equal(pose.homogeneous, poses[0].homogeneous) for pose in poses):
        return TimedPoses(times[:1], poses[:1])
    return TimedPoses(times, poses)


def _turning_times(motion: Motion) -> Vector:
    """Return the times at which a motion may change its direction or speed [s]."""
    return motion.times if isinstance(motion, TimedPoses) else np.zeros(1)


def _same_but_for_poses(first: Scene, second: Scene) -> bool:
    """Check whether two scenes have the same shapes, margins and allowed pairs, so that at most poses differ."""
    if first is second:
        return True
    given = {o.name: o for o in second.obstacles}
    if {o.name for o in first.obstacles} != given.keys():
        return False
    pairs = ((each, given[each.name]) for each in first.obstacles)
    same_solids = all(same_shape(a.shape, b.shape) and a.margin == b.margin for a, b in pairs)
    return same_solids and pairs_that_may_touch(first) == pairs_that_may_touch(second)


class _PeriodJudge:
    """Finds the pairs of bodies that are too near in one period of a run.

    Args:
        settings: Settings of the world of the run; the scene is taken from the period.
        ticks: All ticks of the run, also those outside the period.
        period: The period to judge.
        clearance: Distance that proven moves keep from obstacles in addition to the obstacles' margins [m].
    """

    def __init__(self, settings: WorldSettings, ticks: Sequence[Tick], period: _Period, clearance: float) -> None:
        robot = settings.robot
        self._robot = robot
        self._ticks = ticks
        self._period = period

        solids = arrangement_of(replace(settings, scene=period.scene))
        self._bodies = solids.bodies.as_tuple
        self._pairs = solids.pairs
        self._approach_weights = approach_weights(robot, self._bodies, self._pairs)
        self._pair_indices: NDArray[np.int64] = np.array(self._pairs, dtype=np.int64).reshape(-1, 2)

        self._obstacles = {o.name: o for o in period.scene.obstacles}
        # The pose of each solid in the frame of its joint or of its obstacle.
        self._local_poses = [
            (body.within if body.kind == "obstacle" else body.placement).homogeneous for body in self._bodies
        ]

        self._obstacle_names = list(self._obstacles)
        index_of_obstacle = {name: k for k, name in enumerate(self._obstacle_names)}
        # The index of the obstacle that each body is a part of; -1 for bodies of the arm.
        self._obstacle_of_body = np.array(
            [index_of_obstacle[b.name] if b.kind == "obstacle" else -1 for b in self._bodies]
        )

        self._obstacle_radii = np.array([farthest(o.shape, pin.SE3.Identity()) for o in self._obstacles.values()])
        self._bounding_balls = np.array([_bounding_ball(body) for body in self._bodies]).reshape(-1, 4)

        bodies_of_pairs = [(self._bodies[i], self._bodies[j]) for i, j in self._pairs]
        # The distance that each pair has to keep [m]: in unproven moves, which must only avoid contact, and in proven
        # moves, which keep margins and clearance too.
        self._contact_distances = np.array([min(contact_distance(*pair) or 0.0, 0.0) for pair in bodies_of_pairs])
        self._required_distances = np.array(
            [kept_apart(*pair) + (clearance if _clearance_applies(*pair) else 0.0) for pair in bodies_of_pairs]
        )

    def violations(self) -> Iterator[RunViolation]:
        """Yield the violations tick by tick; a pair may occur several times in a tick."""
        ticks = self._ticks
        period = self._period
        if len(self._pairs) == 0:
            return

        for number, tick in enumerate(ticks):
            is_last_tick = number + 1 == len(ticks)  # The last tick has no duration.
            end = tick.time if is_last_tick else ticks[number + 1].time
            begin = max(tick.time, period.begin)
            until = min(end, period.end)
            if begin >= until and not (is_last_tick and period.is_last):
                continue

            turns = period.knots[(period.knots > begin) & (period.knots < until)]
            times = [begin, *turns.tolist(), until]
            for a, b in pairwise(times):
                yield from self._violations_between(number, a, b)

    def _violations_between(self, number: int, begin: float, end: float) -> Iterator[RunViolation]:
        """Yield the pairs that are too near in a part of a tick, at most one violation a pair.

        The broad phase compares bounding balls in the middle of the part, where a pair can be at most half its approach
        bound farther apart than at its nearest. The narrow phase bisects in time, see :meth:`_nearest_time`.

        Args:
            number: Number of the tick.
            begin: Begin of the part [s]; between begin and end every body moves straight.
            end: End of the part [s].
        """
        required = self._required_distances if self._ticks[number].proven else self._contact_distances
        approaches = self._approach_bounds(number, begin, end)

        # Broad phase: the gaps between the bounding balls of each pair.
        poses = self._body_poses(number, 0.5 * (begin + end))
        centres = np.einsum("kij,kj->ki", poses[:, :3, :3], self._bounding_balls[:, :3]) + poses[:, :3, 3]
        first, second = self._pair_indices.T
        gaps = (
            np.linalg.norm(centres[first] - centres[second], axis=1)
            - self._bounding_balls[first, 3]
            - self._bounding_balls[second, 3]
        )
        # The comparison is negated, so that NaN, the gap of an unbounded shape, counts as too near.
        is_near = ~(gaps > required + 0.5 * approaches)

        # Narrow phase for the remaining pairs.
        for pair in np.flatnonzero(is_near).tolist():
            nearest = self._nearest_time(number, pair, begin, end, float(required[pair]), float(approaches[pair]))
            if nearest is not None:
                time, gap = nearest
                first_name, second_name = (self._bodies[k].name for k in self._pairs[pair])
                tick = self._ticks[number]
                yield RunViolation(
                    time, number, tick.event, first_name, second_name, gap, float(required[pair]), bool(tick.proven)
                )

    def _nearest_time(
        self, number: int, pair: int, begin: float, end: float, required: float, approach: float
    ) -> tuple[float, float] | None:
        """Find by bisection in time whether a pair comes too near in a part of a tick, and when it is nearest.

        The distance in the middle of the part can exceed that at any other time of it by at most half the approach. So
        if the middle keeps the required distance plus half the approach, the whole part is free. Else both halves are
        searched, until the approach is below the thresholds above.

        Args:
            number: Number of the tick.
            pair: Number of the pair.
            begin: Begin of the part [s].
            end: End of the part [s].
            required: Distance that the pair has to keep [m]; negative if it may overlap.
            approach: Upper bound on how much the distance of the pair can change in the part [m].

        Returns:
            The time [s] of the smallest signed distance among the times that were evaluated, and that distance [m];
            None if the pair keeps the required distance.
        """
        middle = 0.5 * (begin + end)
        # If the pair keeps the sufficient distance in the middle, it keeps the required one in the whole part.
        sufficient = required
        if approach > FINEST_APPROACH:
            sufficient += 0.5 * approach
        solids = self._solids_of_pair(number, pair, middle)
        if gap_beyond(solids, _less_rounding(sufficient)) is not None:
            return None

        middle_distance = _signed_distance(solids)
        lacking = middle_distance <= _less_rounding(required)
        # Where the penetration depth of an overlap is unknown, the distance reads 0, so a second test decides.
        if not lacking and required < 0.0:
            lacking = gap_beyond(solids, _less_rounding(required)) is None
        if approach <= FINEST_APPROACH and not lacking:
            return None

        if lacking and approach <= max(COARSEST_APPROACH, RELATIVE_ACCURACY * (required - middle_distance)):
            ends = [(time, _signed_distance(self._solids_of_pair(number, pair, time))) for time in (begin, end)]
            return min((middle, middle_distance), *ends, key=lambda candidate: candidate[1])

        candidates: list[tuple[float, float]] = []
        for a, b in ((begin, middle), (middle, end)):
            nearest = self._nearest_time(number, pair, a, b, required, 0.5 * approach)
            if nearest is not None:
                candidates.append(nearest)
        if lacking:
            candidates.append((middle, middle_distance))
        return min(candidates, key=lambda candidate: candidate[1], default=None)

    def _approach_bounds(self, number: int, begin: float, end: float) -> Vector:
        """Return upper bounds on how much nearer each pair can come in a part of a tick [m], shape (pairs,).

        The bound of a pair is the weighted change of the joints plus the travel of its obstacle.
        """
        change = np.abs(self._configuration(number, end) - self._configuration(number, begin))
        travels = [
            travel_bound(self._obstacle_pose(name, begin), self._obstacle_pose(name, end), radius)
            for name, radius in zip(self._obstacle_names, self._obstacle_radii.tolist(), strict=True)
        ]
        travel_of_body = np.array([0.0, *travels])[self._obstacle_of_body + 1]
        return np.asarray(self._approach_weights @ change + travel_of_body[self._pair_indices].sum(axis=1))

    def _body_poses(self, number: int, time: float) -> Frames:
        """Return the poses of all bodies at a time of a tick as homogeneous matrices, shape (bodies, 4, 4)."""
        joint_frames = self._robot.joint_frames(self._configuration(number, time)[None])[0]
        obstacle_poses = [self._obstacle_pose(name, time).homogeneous for name in self._obstacle_names]
        return np.array(
            [
                (joint_frames[body.joint] if obstacle < 0 else obstacle_poses[obstacle]) @ local_pose
                for body, obstacle, local_pose in zip(
                    self._bodies, self._obstacle_of_body, self._local_poses, strict=True
                )
            ]
        )

    def _solids_of_pair(self, number: int, pair: int, time: float) -> Ends:
        """Return the two solids of a pair at a time of a tick: geometry, pose, geometry, pose."""
        joint_frames = self._robot.joint_frames(self._configuration(number, time)[None])[0]
        first, second = self._pairs[pair]
        poses = []
        for body in (first, second):
            obstacle = self._obstacle_of_body[body]
            if obstacle < 0:
                carrier_pose = joint_frames[self._bodies[body].joint]
            else:
                carrier_pose = self._obstacle_pose(self._obstacle_names[obstacle], time).homogeneous
            body_pose = carrier_pose @ self._local_poses[body]
            poses.append(coal.Transform3s(body_pose[:3, :3], body_pose[:3, 3]))
        return self._bodies[first].geometry, poses[0], self._bodies[second].geometry, poses[1]

    def _configuration(self, number: int, time: float) -> Vector:
        """Return the configuration at a time of a tick, on the straight line to the next tick's; shape (dof,)."""
        ticks = self._ticks
        tick = ticks[number]
        if number + 1 == len(ticks):
            return tick.q
        next_tick = ticks[number + 1]
        return tick.q + (time - tick.time) / (next_tick.time - tick.time) * (next_tick.q - tick.q)

    def _obstacle_pose(self, name: str, time: float) -> pin.SE3:
        return pose_at(self._obstacles[name], time)


def _clearance_applies(first: Body, second: Body) -> bool:
    """Check whether the clearance of a run is promised for two bodies: an obstacle and a part that joints move."""
    return keeps_clearance(first, second) and max(first.joint, second.joint) > 0


def _less_rounding(required: float) -> float:
    """Return the required distance less an allowance for rounding [m]; it never turns negative by that.

    So contact stays forbidden where it was forbidden.
    """
    return required - ROUNDING if required < 0.0 else max(required - ROUNDING, 0.0)


def _bounding_ball(body: Body) -> tuple[float, float, float, float]:
    """Return a ball around a solid in its own frame: x, y, z of the centre and the radius [m]; inf for a half-space."""
    if isinstance(body.geometry, coal.Halfspace):
        return 0.0, 0.0, 0.0, float("inf")
    x, y, z = np.asarray(body.geometry.aabb_center).tolist()
    return x, y, z, float(body.geometry.aabb_radius)


def _signed_distance(solids: Ends) -> float:
    """Return the signed distance of two solids [m]: negative is the penetration depth; 0 if that depth is unknown."""
    if is_ours(solids):
        return float(own_nearest(solids).distance)
    if not coal.collide(*solids, coal.CollisionRequest(), coal.CollisionResult()):
        return max(float(coal.distance(*solids, coal.DistanceRequest(), coal.DistanceResult())), ROUNDING)
    return min(float(coal.distance(*solids, coal.DistanceRequest(), coal.DistanceResult())), 0.0)
