"""Plans in time among every kind of shape that moves, judged by pinocchio, coal and scipy alone.

An interrupted run goes on where it was.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from dataclasses import dataclass
from typing import Annotated

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, interp1d
from scipy.spatial.transform import Rotation, Slerp
from typer import Option

import rrtik_ompl as rrtik
from bench.shared.judge import Contacts, placed
from bench.shared.parts import Parts
from bench.shared.run import Run
from bench.shared.solids import coal_solids, one_of_each, reach_of
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.replanning.in_time import TimedPlan, plan_in_time
from rrtik_ompl.world.problem import fixed_ends

PLANS, AT_ONCE = 2000, 100
ROBOTS = ("planar3", "ur5", "titan4")
MARGIN, RATE, HORIZON = 0.02, 10.0, 20.0
ITERATIONS, SECONDS = 400, 600.0  # so long by the clock that it never decides
SPEEDS = (0.05, 0.5)  # [m/s], the fastest of an obstacle's points
ROOM = 0.05  # [m] around the start, and around a goal that nothing covers
LID_SHARE, LID_SECONDS = 0.3, (1.0, 6.0)  # of the problems: an obstacle stands on the goal, and goes then
SIZES = 10  # of the shapes of each kind and robot
EVERY = 0.01  # [s] from a look of the judge to the next one; the arm's own contacts: ten times that
SEEDS, MANY_SEEDS = 5, 30  # seeds of a problem, and problems that are planned with them
ROUNDING = 1e-6
KEPT = MARGIN - 1e-4  # [m] coal's distances are that exact


@dataclass(frozen=True)
class Outcome:
    """A problem in short.

    Attributes:
        robot: Its name.
        kinds: The kinds of its shapes that move.
        covered: Whether something stands on the goal at first.
        reason: Why there is no plan, or "".
        seconds: Processor time of the plan [s].
        arrival: When the arm arrives [s].
        least: The lower bound of the plan [s].
        bound: The first time from then on at which coal finds the goal free, in whole slots [s].
        looks: How often the judge has looked.
        contacts, near, own: Looks with contact, nearer than the margin, and with contact of the arm with itself.
        velocity, acceleration: Largest share of the joints' limits.
        off: Distance of the record from the motion [rad or m].
        free_until: What the plan says [s].
        stay_looks, stay_contacts: Looks from the arrival until then, at most until the horizon, and those with contact.
        ends_near: Whether coal finds an obstacle at that time about as near as it may be; None for later times.
        straight: Whether the straight motion at full speed touches something.
    """

    robot: str
    kinds: list[str]
    covered: bool
    reason: str
    seconds: float
    arrival: float = np.nan
    least: float = np.nan
    bound: float = np.nan
    looks: int = 0
    contacts: int = 0
    near: int = 0
    own: int = 0
    velocity: float = 0.0
    acceleration: float = 0.0
    off: float = 0.0
    free_until: float = 0.0
    stay_looks: int = 0
    stay_contacts: int = 0
    ends_near: bool | None = None
    straight: bool = False


# Problems.


def problem_of(number: int) -> rrtik.Problem:
    """A problem among four obstacles of different kinds, about all of which move."""
    rng = np.random.default_rng([50, number])
    name = ROBOTS[number % len(ROBOTS)]
    robot = rrtik.load_robot(name)
    while True:
        obstacles = [_obstacle(rng, *each, name) for each in _drawn(rng, number % SIZES, name)]
        with_lid = rng.random() < LID_SHARE
        rows = _free_rows(robot, Scene(obstacles), rng)
        if len(rows) < 2:
            continue
        start = rows[0]
        goal = rows[int(np.argmax(np.linalg.norm(rows - start, axis=1)))]
        if with_lid:
            obstacles[-1] = _lid(rng, obstacles[-1], robot.fk(goal).translation)
        try:
            return rrtik.Problem(rrtik.World(robot, Scene(obstacles)), start, goal, name=f"{name}_{number}")
        except rrtik.ProblemError:  # the lid touches the start, or the base
            continue


def _drawn(rng: np.random.Generator, size: int, robot: str) -> list[tuple[str, Shape]]:
    """Kinds of shapes, the last of which may be put onto the goal."""
    shapes = one_of_each(np.random.default_rng([51, size]), 0.15 * reach_of(robot))
    kinds = rng.choice(list(shapes), 4, replace=False).tolist()
    kinds.sort(key="half-space".__ne__)
    return [(kind, shapes[kind]) for kind in kinds]


def _obstacle(rng: np.random.Generator, kind: str, shape: Shape, robot: str) -> Obstacle:
    """A solid that wanders around the base and turns, or a ground that rises and sinks."""
    reach = reach_of(robot)
    speed = rng.uniform(*SPEEDS)
    if kind == "half-space":
        tilt = pin.exp3(np.array([*rng.normal(0.0, 0.05, 2), 0.0]))
        low = pin.SE3(tilt, np.array([0.0, 0.0, -rng.uniform(0.4, 0.7) * reach]))
        high = pin.SE3(tilt, low.translation + tilt @ np.array([0.0, 0.0, 0.15 * reach]))
        return Obstacle(kind, shape, low, TimedPoses(0.15 * reach / speed * np.arange(6), [low, high] * 3))

    flat = np.array([1.0, 1.0, 0.1 if robot == "planar3" else 1.0])
    place = _around(rng, reach, flat)
    poses = [pin.SE3(pin.exp3(rng.normal(size=3)), place)]
    times = [0.0]
    while times[-1] < HORIZON:
        there = _around(rng, reach, flat)
        seconds = float(np.linalg.norm(there - poses[-1].translation)) / (0.5 * speed)
        spin = rng.normal(size=3)
        way = float(np.linalg.norm(spin)) * max(shape.bounding_radius, 1e-3)
        spin *= min(0.5 * speed * seconds / way, 1.0)
        poses.append(pin.SE3(poses[-1].rotation @ pin.exp3(spin), there))
        times.append(times[-1] + seconds)
    return Obstacle(kind, shape, poses[0], TimedPoses(times, poses))


def _around(rng: np.random.Generator, reach: float, flat: Vector) -> Vector:
    """A place in a shell around the base."""
    way = rng.normal(size=3) * flat
    place: Vector = rng.uniform(0.4, 1.1) * reach * way / np.linalg.norm(way)
    return place


def _lid(rng: np.random.Generator, obstacle: Obstacle, tip: Vector) -> Obstacle:
    """The obstacle on the tip's place at the goal, from where it goes straight away from the base after a while."""
    leaves = rng.uniform(*LID_SECONDS)
    speed = rng.uniform(*SPEEDS)
    here = pin.SE3(obstacle.pose.rotation, tip)
    there = pin.SE3(here.rotation, tip + 2.0 * tip / max(float(np.linalg.norm(tip)), 1e-3))
    motion = TimedPoses([0.0, leaves, leaves + 2.0 / speed], [here, here, there])
    return Obstacle(obstacle.name, obstacle.shape, here, motion)


def _free_rows(robot: rrtik.Robot, scene: Scene, rng: np.random.Generator) -> Matrix:
    """Configurations with room around them at first."""
    world = rrtik.World(robot, scene).with_clearance(ROOM)
    lower, upper = (np.clip(ends, -0.6 * np.pi, 0.6 * np.pi) for ends in robot.finite_range())
    rows: Matrix = rng.uniform(lower, upper, (60, robot.dof))
    return rows[world.valid_batch(rows)]


def planned(problem: rrtik.Problem, seed: int) -> TimedPlan:
    """The plan."""
    return plan_in_time(
        problem, rate=RATE, horizon=HORIZON, margin=MARGIN, iterations=ITERATIONS, seconds=SECONDS, seed=seed
    )


# The judge.


@dataclass(frozen=True)
class Solid:
    """A solid of coal, fixed in a frame, and a ball around it there; an infinite one around a half-space.

    Attributes:
        geometry: The solid.
        within: Its pose in the frame.
        middle: Of the ball, in the frame [m].
        radius: Of the ball [m].
    """

    geometry: coal.CollisionGeometry
    within: pin.SE3
    middle: Vector
    radius: float

    @classmethod
    def of(cls, geometry: coal.CollisionGeometry, within: pin.SE3) -> Solid:
        """The solid with the ball that coal puts around it."""
        geometry.computeLocalAABB()
        if isinstance(geometry, coal.Halfspace):
            return cls(geometry, within, np.zeros(3), np.inf)
        return cls(geometry, within, within.act(np.asarray(geometry.aabb_center)), float(geometry.aabb_radius))

    def near(self, places: Matrix, points: Matrix, distance: float) -> NDArray[np.bool_]:
        """Which points are nearer than a distance [m] to the ball, or to the half-space.

        Args:
            places: Poses of the frame, shape (k, 4, 4).
            points: A point for each, shape (k, 3).
            distance: See above.
        """
        if isinstance(self.geometry, coal.Halfspace):
            normals = places[:, :3, :3] @ self.within.rotation @ self.geometry.n
            on_plane = self.within.act(self.geometry.d * np.asarray(self.geometry.n))
            heights = ((points - _moved(places, on_plane)) * normals).sum(axis=1)
            return np.asarray(heights < distance)
        return np.asarray(np.linalg.norm(points - _moved(places, self.middle), axis=1) < self.radius + distance)


class Judge:
    """Looks at an arm among obstacles at many times: pinocchio places the links, coal compares the solids.

    Coal is asked where balls around a link, around an obstacle and around its solid are too near to tell.
    """

    def __init__(self, problem: rrtik.Problem) -> None:
        robot = problem.robot
        self._robot = robot
        self._links = robot.collision.geometryObjects
        self._data = robot.model.createData()
        self._frames = robot.collision.createData()
        self._own = [Solid.of(link.geometry, pin.SE3.Identity()) for link in self._links]
        self._obstacles = [
            (o, [Solid.of(*each) for each in coal_solids(o.shape)]) for o in problem.settings.scene.obstacles
        ]

    def gaps(self, rows: Matrix, times: Vector, distance: float) -> NDArray[np.int64]:
        """Per look 0 if nothing is nearer than the distance [m], 1 if something is, and 2 for a contact, shape (k,).

        What no joint moves keeps no margin.

        Args:
            rows: The configuration at each time, or a single one for all, shape (k, n) or (1, n).
            times: The times [s], shape (k,).
            distance: See above.
        """
        found = np.zeros(len(times), dtype=np.int64)
        poses = np.empty((len(self._links), len(rows), 4, 4))
        for k, q in enumerate(self._robot.pinocchio_configuration(rows)):
            pin.updateGeometryPlacements(self._robot.model, self._data, self._robot.collision, self._frames, q)
            poses[:, k] = [frame.homogeneous for frame in self._frames.oMg]
        poses = np.broadcast_to(poses, (len(self._links), len(times), 4, 4))

        for obstacle, solids in self._obstacles:
            places = places_of(obstacle, times)
            middle = np.mean([solid.middle for solid in solids], axis=0)
            radius = max(float(np.linalg.norm(solid.middle - middle)) + solid.radius for solid in solids)

            for link, own, there in zip(self._links, self._own, poses, strict=True):
                room = distance if link.parentJoint else max(distance - KEPT, 0.0)
                own_middles = _moved(there, own.middle)
                apart = np.linalg.norm(own_middles - _moved(places, middle), axis=1)
                near = apart < own.radius + radius + room
                for solid in solids if near.any() else ():
                    close = near & (found < 2)
                    close[close] = solid.near(places[close], own_middles[close], own.radius + room)
                    for k in np.flatnonzero(close).tolist():
                        ends = own.geometry, pin.SE3(there[k]), solid.geometry, pin.SE3(places[k]) * solid.within
                        if found[k] == 0 and _closer(*ends, room):
                            found[k] = 1
                        if found[k] and _closer(*ends, 0.0):
                            found[k] = 2
        return found


def places_of(obstacle: Obstacle, times: Vector) -> Matrix:
    """Where an obstacle is at many times by scipy, from the poses that its motion states, shape (k, 4, 4)."""
    places = np.tile(obstacle.pose.homogeneous, (len(times), 1, 1))
    motion = obstacle.motion
    if motion is None:
        return places

    assert isinstance(motion, TimedPoses)
    stated = np.array([pose.homogeneous for pose in motion.poses])
    now = np.clip(times, motion.times[0], motion.times[-1])
    places[:, :3, :3] = Slerp(motion.times, Rotation.from_matrix(stated[:, :3, :3]))(now).as_matrix()
    places[:, :3, 3] = interp1d(motion.times, stated[:, :3, 3], axis=0)(now)
    return places


def _moved(poses: Matrix, point: Vector) -> Matrix:
    """A point of a frame in many poses of the frame, shape (k, 3)."""
    moved: Matrix = poses[:, :3, :3] @ point + poses[:, :3, 3]
    return moved


def _closer(
    first: coal.CollisionGeometry, pose: pin.SE3, second: coal.CollisionGeometry, place: pin.SE3, distance: float
) -> bool:
    request = coal.CollisionRequest()
    request.security_margin = distance
    return bool(coal.collide(first, placed(pose), second, placed(place), request, coal.CollisionResult()))


def peaks(spline: CubicHermiteSpline) -> tuple[Vector, Vector]:
    """The largest speeds and accelerations of the joints, exact, as each piece is a cubic; shape (n,) each."""
    # The second derivative in a piece.
    constant = 2.0 * spline.c[1]
    linear = 6.0 * spline.c[0]
    seconds = np.diff(spline.x)[:, None]
    accelerations = np.abs([constant, constant + linear * seconds]).max(axis=(0, 1))

    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.clip(np.nan_to_num(-constant / linear), 0.0, seconds)
    speeds = [np.abs(spline.c[2] + t * (constant + 0.5 * t * linear)) for t in (0.0, turn, seconds)]
    return np.max(speeds, axis=(0, 1)), accelerations


def _looks(begin: float, end: float) -> Vector:
    return np.linspace(begin, end, max(int(np.ceil((end - begin) / EVERY)), 1) + 1)


def outcome(number: int) -> Outcome:
    """A problem planned and judged."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = problem_of(number)
        began = time.process_time()
        plan = planned(problem, number)
        seconds = time.process_time() - began
        kinds = [o.name for o in problem.settings.scene.obstacles if o.motion is not None]
        covered = not problem.world.valid(fixed_ends(problem)["goal"])
        if plan.motion is None or plan.trajectory is None:
            return Outcome(problem.robot.name, kinds, covered, plan.reason, seconds)
        return judged(problem, plan, kinds, covered, seconds)


def judged(problem: rrtik.Problem, plan: TimedPlan, kinds: list[str], covered: bool, seconds: float) -> Outcome:
    """What the judge says of a plan."""
    robot = problem.robot
    run = plan.require()
    motion = plan.trajectory
    assert motion is not None
    judge = Judge(problem)
    spline = CubicHermiteSpline(motion.times, motion.positions, motion.velocities)
    times = _looks(0.0, float(motion.times[-1]))
    rows = spline(times)
    gaps = judge.gaps(rows, times, KEPT)

    own = Contacts(rrtik.World(robot, Scene()))
    touches_itself = sum(any(True for _ in own.depths(q)) for q in rows[::10])
    limits = rrtik.RateLimits.of(robot)
    speeds, accelerations = peaks(spline)

    # Until when the arm may stay, and what comes then.
    goal = rows[-1]
    stay = _looks(plan.arrival, min(plan.free_until, HORIZON))
    stay_gaps = judge.gaps(goal[None], stay, KEPT)
    ends_near = None
    if plan.free_until < HORIZON:
        reached = judge.gaps(goal[None], np.array([plan.free_until]), MARGIN + (run.clearance or 0.0) + 2e-4)
        ends_near = bool(reached[0])

    # The first slot in which the goal is free at all.
    slots = np.arange(round(plan.least_seconds * RATE), round(plan.arrival * RATE) + 1) / RATE
    at_goal = judge.gaps(goal[None], slots, KEPT)
    bound = float(slots[np.flatnonzero(at_goal == 0)[0]]) if (at_goal == 0).any() else np.nan

    shares = np.linspace(0.0, 1.0, 101)
    straight = problem.start + shares[:, None] * (goal - problem.start)
    hit = bool((judge.gaps(straight, shares * plan.least_seconds, 0.0) == 2).any())
    return Outcome(
        robot.name, kinds, covered, "", seconds, plan.arrival, plan.least_seconds, bound, len(times),
        int((gaps == 2).sum()), int((gaps == 1).sum()), touches_itself, float((speeds / limits.velocity).max()),
        float((accelerations / limits.acceleration).max()),
        float(np.abs(spline(run.times) - run.configurations).max()), plan.free_until, len(stay),
        int((stay_gaps > 0).sum()), ends_near, hit,
    )  # fmt: skip


def arrivals(number: int) -> list[float]:
    """When the plans of several seeds arrive [s]; inf for those that were not found."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = problem_of(number)
        return [planned(problem, seed).arrival for seed in range(SEEDS)]


# The page.


def main(
    run: Run,
    parts: Parts,
    *,
    plans: Annotated[int, Option(help="Plans that are judged.", min=1)] = PLANS,
    seeded: Annotated[int, Option(help="Problems that are planned with several seeds.")] = MANY_SEEDS,
) -> Report:
    """Measure."""
    report = run.report("Plans in time among what moves")
    drawn: list[Outcome] = []
    found: list[Outcome] = []
    while len(found) < plans:
        drawn += parts(outcome, [(number,) for number in range(len(drawn), len(drawn) + AT_ONCE)])
        found = [each for each in drawn if not each.reason]

    enough = "" if len(found) >= PLANS else f" (fewer than {PLANS:,})"
    looks, contacts, near, own = (sum(getattr(o, name) for o in found) for name in ("looks", "contacts", "near", "own"))
    held = contacts + near + own == 0 and not enough
    report.bar(
        f"{PLANS:,} plans: contacts, or less than the margin", "0",
        f"{contacts + own}, {near} at {looks:,} times of {len(found):,} plans{enough}", held,
    )  # fmt: skip
    speed, acceleration = max(o.velocity for o in found), max(o.acceleration for o in found)
    measured = f"at most {speed:.7f} and {acceleration:.7f} of them"
    report.bar("limits of speed and acceleration", "kept", measured, max(speed, acceleration) <= 1.0 + ROUNDING)
    stays, stay_looks = sum(o.stay_contacts for o in found), sum(o.stay_looks for o in found)
    report.bar("less than the margin between arrival and free_until", "0", f"{stays} of {stay_looks:,}", stays == 0)
    covered = [o for o in drawn if o.covered]
    waited = [o for o in covered if not o.reason]
    late = sum(o.arrival < o.bound - ROUNDING for o in found)
    report.bar("arrivals while the goal is not free", "0", f"{late} of {len(found):,}", late == 0)

    head = ["problems", "planned", "of goals covered at first", "at the bound", "over the bound: median", "95 %",
            "worst [s]", "processor time a plan: mean, 95 % [s]"]  # fmt: skip
    rows = [_row(name, [o for o in drawn if o.robot == name]) for name in ROBOTS]
    report.table("Arrivals", ["robot", *head], [*rows, _row("all", drawn)])
    report.table("Where the straight way at full speed", *_straight(found))

    if seeded:
        report.note("Seeds", _spread(np.array(parts(arrivals, [(number,) for number in range(seeded)]))))

    ends = [o.ends_near for o in found if o.ends_near is not None]
    kinds = Counter(kind for o in found for kind in o.kinds)
    listed = ", ".join(f"{kind} {number:,}" for kind, number in sorted(kinds.items()))
    reasons = Counter(_short(o.reason) for o in drawn if o.reason)
    why = "; ".join(f"{what}: {number}" for what, number in reasons.most_common()) or "none"
    off = max(o.off for o in found)
    report.note(
        "What was looked at",
        f"Plans in which each kind moved: {listed}. Of {len(drawn):,} problems without a plan: {why}. Of "
        f"{len(covered):,} goals that were covered at first {len(waited):,} were waited for. In {sum(ends):,} of "
        f"{len(ends):,} plans whose free_until lies within the horizon coal finds an obstacle at that time as near as "
        f"it may be. The record is where the motion is, to {off:.0e}.",
    )
    report.note("How it is read", READING)
    return report


def _row(name: str, drawn: list[Outcome]) -> list[str]:
    found = [o for o in drawn if not o.reason]
    over = np.array([o.arrival - o.bound for o in found] or [np.nan])
    covered = [o for o in drawn if o.covered]
    seconds = np.array([o.seconds for o in drawn] or [np.nan])
    return [
        name, f"{len(drawn):,}", f"{len(found):,}", f"{sum(not o.reason for o in covered)} of {len(covered)}",
        f"{np.mean(over < ROUNDING):.0%}", f"{np.median(over):.1f}", f"{np.percentile(over, 95):.1f}",
        f"{over.max():.1f}", f"{seconds.mean():.2f}, {np.percentile(seconds, 95):.2f}",
    ]  # fmt: skip


def _straight(found: list[Outcome]) -> tuple[list[str], list[list[str]]]:
    rows = []
    for touches in (False, True):
        some = np.array([o.arrival - o.bound for o in found if o.straight == touches] or [np.nan])
        what = "touches something" if touches else "touches nothing"
        rows.append([what, str(len(some)), f"{np.mean(some < ROUNDING):.0%}", f"{np.median(some):.1f}",
                     f"{np.percentile(some, 95):.1f}"])  # fmt: skip
    return ["the judge says", "plans", "at the bound", "over the bound: median", "95 % [s]"], rows


def _spread(times: Matrix) -> str:
    """How much the arrivals of the seeds of problems differ, shape (problems, seeds)."""
    times = times[np.isfinite(times).all(axis=1)]
    spread = times.max(axis=1) - times.min(axis=1)
    same, worst = int((spread < ROUNDING).sum()), float(spread.max(initial=0.0))
    return (
        f"{same} of {len(times)} problems: all {SEEDS} seeds arrive at the same time; worst difference {worst:.1f} s."
    )


def _short(reason: str) -> str:
    """A reason without its numbers and names."""
    if "reaches" in reason:
        return "an obstacle reaches the base"
    return reason.partition(";")[0].partition(" in ")[0].partition(" at any")[0]


READING = (
    "Each problem has four obstacles of different kinds that wander around the base and turn, none of whose points is "
    f"faster than {SPEEDS[0]:g} to {SPEEDS[1]:g} m/s, or a ground that rises and sinks; in {LID_SHARE:.0%} of the "
    f"problems one stands on the goal's place for {LID_SECONDS[0]:g} to {LID_SECONDS[1]:g} s and then leaves. The "
    f"plan keeps {1e3 * MARGIN:g} mm, has {RATE:g} slots a second, and arrives by {HORIZON:g} s. The judge takes the "
    f"exported motion as scipy's cubic through its knots, looks every {1e3 * EVERY:g} ms (for the arm's own contacts, "
    "tenfold), places links by pinocchio and solids, made from the numbers of each shape, where the obstacles' "
    "motions say, as scipy interpolates these, and compares by coal those that balls around them do not tell apart; "
    "speeds and accelerations are the exact peaks of the pieces. The bound is the first slot, after the time that the "
    "limits of the joints need, in which coal finds the goal free: no plan arrives earlier."
)
