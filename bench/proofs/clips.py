"""Segments whose checked points are free and that clip something between them: whether `prove` finds each, and where.

MoveIt's users report it (moveit2#3759): a controller goes from point to point, and a planner has looked at some places
between. Here a ball or the edge of a plate is pushed into the way of an arm, less than a millimetre deep, where none of
nine even places is touched. The judge takes poses from Pinocchio; how far a ball is from a solid it calculates itself,
how far a plate is, by coal. An interrupted run goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated

import coal
import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.robustness.contact_judge import Part, parts_of
from bench.robustness.solid_distance import distance_to
from bench.shared.clocks import spent
from bench.shared.judge import distance, placed
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.base.choices import Between

ARMS = ("planar3", "titan4", "ur5", "panda")
CHECKED = np.linspace(0.0, 1.0, 9)  # shares of a segment at which a planner looks
DENSE = np.linspace(0.0, 1.0, 401)
HALVINGS = 24
PLACE = 1e-3  # [m] within which an end of a contact has to be named
RADIUS = 0.05  # [m] of the links of the arm in the plane
INSIDE = 0.002  # [m] radius of balls inside of links

HOW = """Segments with random ends that are free without obstacles, straight or a cubic with velocities at its ends. A
ball (3 to 15 mm) or a plate (4 mm thick, 0.3 m long) at the tip is pushed into its way, 10 micrometres to 1 mm deep, so
that nine even places keep free of it. The judge looks at 401 places and locates the ends of the contact by bisection.
Off: how far any point of the arm can move from where the judge sees the contact begin or end to where `prove` says so.
A contact counts as confirmed if coal finds the two bodies touching at the configuration that is named, and so does the
judge."""
SOLID = """To coal a mesh is its triangles: a body that is wholly inside of one does not touch it, and has a positive
distance. To a world a closed mesh is a solid, as it is to a person: what is inside touches. Balls of 2 mm at points
inside of the links of an arm, by the winding number of the triangles, while the arm moves by 0.05 rad."""


@dataclass(frozen=True)
class Clip:
    """A segment that clips something, and what is said of it.

    Attributes:
        ball: Whether it clips a ball, else a plate.
        depth: How deep at most by the judge [m].
        status: Of the verdict.
        off: Largest way of a point of the arm between an end of the contact and where it is said to be [m].
        short: How much deeper it is at its deepest place than where the verdict says that it is worst [m].
        coal: Whether coal finds the two touching there.
        solid: Whether the judge does.
        seconds: Processor time of the verdict [s].
    """

    ball: bool
    depth: float
    status: str
    off: float
    short: float
    coal: bool
    solid: bool
    seconds: float


@dataclass(frozen=True)
class Inside:
    """Balls inside of the links of an arm: how many, how many are found, and how many coal's surfaces touch."""

    balls: int
    found: int
    coal: int


class Judge:
    """Measures how far an arm is from something that stands still."""

    def __init__(self, robot: rrtik.Robot) -> None:
        self._robot = robot
        self._data = robot.model.createData()
        self.parts = parts_of(rrtik.World(robot))

    def poses(self, q: Vector) -> list[pin.SE3]:
        """Poses of the arm's solids."""
        pin.forwardKinematics(self._robot.model, self._data, self._robot.pinocchio_configuration(q[None])[0])
        return [self._data.oMi[part.joint] * part.placement for part in self.parts]

    def gap(self, q: Vector, thing: rrtik.Obstacle) -> float:
        """Signed distance of the nearest of the arm's solids [m]."""
        least = np.inf
        for part, pose in zip(self.parts, self.poses(q), strict=True):
            least = min(least, _gap(part, pose, thing, least))
        return least

    def touching(self, q: Vector, thing: rrtik.Obstacle, link: str) -> bool:
        """Whether coal finds that a link touches it."""
        shape = _coal_of(thing)
        return any(
            coal.collide(
                part.geometry, placed(pose), shape, placed(thing.pose), coal.CollisionRequest(), coal.CollisionResult()
            )
            for part, pose in zip(self.parts, self.poses(q), strict=True)
            if part.name == link
        )


def _gap(part: Part, pose: pin.SE3, thing: rrtik.Obstacle, most: float) -> float:
    """Signed distance of two solids [m]; ``most`` or more where it is more."""
    place = pose.actInv(thing.pose.translation)
    centre, half = part.box
    if isinstance(thing.shape, rrtik.Sphere):
        away = float(np.linalg.norm(np.maximum(np.abs(place - centre) - half, 0.0))) - thing.shape.radius
        if away >= most:
            return away
        return float(distance_to(part.shape, place[None], most + thing.shape.radius)[0]) - thing.shape.radius
    return distance(part.geometry, pose, _coal_of(thing), thing.pose)


def _coal_of(thing: rrtik.Obstacle) -> coal.ShapeBase:
    shape = thing.shape
    if isinstance(shape, rrtik.Sphere):
        return coal.Sphere(shape.radius)
    assert isinstance(shape, rrtik.Box)
    return coal.Box(*shape.size)


@cache
def _arm(name: str) -> tuple[rrtik.Robot, rrtik.World, Judge]:
    robot = rrtik.load_robot(name, parameters={"radius": RADIUS} if name == "planar3" else None)
    return robot, rrtik.World(robot), Judge(robot)


def clips(arm: str, way: Between, first: int, count: int) -> list[Clip]:
    """Segments of an arm that clip something; the same number gives the same one."""
    return [_clip(arm, way, number) for number in range(first, first + count)]


def _clip(arm: str, way: Between, number: int) -> Clip:
    robot, alone, judge = _arm(arm)
    rng = np.random.default_rng([3759, ARMS.index(arm), number])
    low, high = robot.finite_range()
    while True:
        a = rng.uniform(low, high)
        ends = np.array([a, np.clip(a + rng.uniform(-0.3, 0.3, robot.dof), low, high)])
        slopes = rng.uniform(-0.4, 0.4, ends.shape) if way == "cubics" else np.tile(ends[1] - ends[0], (2, 1))
        motion = rrtik.ReceivedMotion("segment", ends, [0.0, 1.0], slopes)
        if not rrtik.prove(alone, motion, between=way).proven:
            continue

        def at(share: float, ends: Matrix = ends, slopes: Matrix = slopes) -> Vector:
            return _hermite(ends, slopes, share)

        thing = _in_the_way(rng, robot, judge, at)
        if thing is None:
            continue
        gaps = np.array([judge.gap(at(share), thing) for share in DENSE])
        inside = np.flatnonzero(gaps < 0.0)
        once = len(inside) > 0 and np.ptp(inside) == len(inside) - 1 and inside[0] > 0 and inside[-1] < len(DENSE) - 1
        if once and gaps.min() > -1.5e-3:
            return _judged(rrtik.World(robot, rrtik.Scene([thing])), motion, way, judge, thing, at, gaps)


def _hermite(ends: Matrix, slopes: Matrix, x: float) -> Vector:
    """The cubic through two points with two slopes, which is straight if these are its chord."""
    return np.asarray(
        (1 + 2 * x) * (1 - x) ** 2 * ends[0]
        + x * (1 - x) ** 2 * slopes[0]
        + x**2 * (3 - 2 * x) * ends[1]
        - x**2 * (1 - x) * slopes[1]
    )


def _in_the_way(
    rng: np.random.Generator, robot: rrtik.Robot, judge: Judge, at: Callable[[float], Vector]
) -> rrtik.Obstacle | None:
    """A ball or a plate that the arm clips between two checked places; None if this attempt gives none."""
    place = rng.uniform(0.15, 0.85)
    tip = robot.fk(at(place)).translation
    outwards = rng.normal(size=3)
    outwards /= np.linalg.norm(outwards)
    radius = rng.uniform(0.003, 0.015)
    shape = rrtik.Sphere(radius) if rng.random() < 0.5 else rrtik.Box([2.0 * radius, 0.3, 0.004])
    turn = pin.exp3(rng.normal(size=3))
    depth = 10.0 ** rng.uniform(-5.0, -3.0)

    def thing(away: float) -> rrtik.Obstacle:
        return rrtik.Obstacle("thing", shape, pin.SE3(turn, tip + away * outwards))

    near = [at(share) for share in np.linspace(place - 0.1, place + 0.1, 9)]
    deep = 0.0
    free = 0.4
    if min(judge.gap(q, thing(deep)) for q in near) > 0.0 or min(judge.gap(q, thing(free)) for q in near) < 0.0:
        return None
    for _ in range(HALVINGS // 2):
        middle = 0.5 * (deep + free)
        if min(judge.gap(q, thing(middle)) for q in near) < -depth:
            deep = middle
        else:
            free = middle
    found = thing(deep)
    return found if min(judge.gap(at(share), found) for share in CHECKED) > 0.0 else None


def _judged(
    world: rrtik.World,
    motion: rrtik.ReceivedMotion,
    way: Between,
    judge: Judge,
    thing: rrtik.Obstacle,
    at: Callable[[float], Vector],
    gaps: Vector,
) -> Clip:
    seconds, verdict = spent(lambda: rrtik.prove(world, motion, between=way))
    depth = -float(gaps.min())
    ball = isinstance(thing.shape, rrtik.Sphere)
    worst = verdict.worst
    if worst is None or verdict.status != "touching":
        return Clip(ball, depth, verdict.status, np.inf, np.inf, False, False, seconds)

    inside = np.flatnonzero(gaps < 0.0)
    ends = [
        _end(judge, thing, at, DENSE[k], DENSE[beyond])
        for k, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1))
    ]
    named = min(each.begin for each in verdict.findings), max(each.end for each in verdict.findings)
    ways = [world.weights @ np.abs(at(share) - at(other)) for share, other in zip(ends, named, strict=True)]
    there = judge.gap(worst.q, thing)
    touches = judge.touching(worst.q, thing, worst.first)
    return Clip(ball, depth, verdict.status, float(max(ways)), max(depth + there, 0.0), touches, there < 0.0, seconds)


def _end(judge: Judge, thing: rrtik.Obstacle, at: Callable[[float], Vector], blocked: float, free: float) -> float:
    """The share of a segment between two places at which a contact ends."""
    for _ in range(HALVINGS):
        middle = 0.5 * (blocked + free)
        if judge.gap(at(middle), thing) < 0.0:
            blocked = middle
        else:
            free = middle
    return blocked


def inside(arm: str, count: int) -> Inside:
    """Balls wholly inside of links."""
    robot, _, judge = _arm(arm)
    rng = np.random.default_rng(3759)
    low, high = robot.finite_range()
    balls = found = seen = 0
    while balls < count:
        q = rng.uniform(low, high)
        k = int(rng.integers(len(judge.parts)))
        part = judge.parts[k]
        centre, half = part.box
        point = centre + rng.uniform(-1.0, 1.0, 3) * half
        ends = np.array([q, np.clip(q + 0.05, low, high)])
        fixed = part.joint == 0 or not rrtik.World(robot).motion_proven(*ends)
        if fixed or distance_to(part.shape, point[None])[0] > -2.0 * INSIDE:
            continue
        ball = rrtik.Obstacle("ball", rrtik.Sphere(INSIDE), judge.poses(q)[k].act(point))
        balls += 1
        seen += judge.touching(q, ball, part.name)
        verdict = rrtik.prove(rrtik.World(robot, rrtik.Scene([ball])), ends)
        found += verdict.status == "touching"
    return Inside(balls, found, seen)


def fill(report: Report, found: dict[tuple[str, str], list[Clip]], hidden: dict[str, Inside]) -> None:
    """The acceptance rows and both tables."""
    every = [clip for some in found.values() for clip in some]
    touching = [clip for clip in every if clip.status == "touching"]
    report.bar(
        "segments that clip something: found", "all", f"{len(touching)} of {len(every)}", len(touching) == len(every)
    )
    off = max(clip.off for clip in every)
    report.bar("ends of the contact: off", "<= 1 mm", f"{1e3 * off:.2g} mm", off <= PLACE)
    sure = sum(clip.coal and clip.solid for clip in touching)
    report.bar("confirmed at the place named, by coal and by the judge", "all", f"{sure} of {len(touching)}",
               sure == len(touching))  # fmt: skip
    balls = sum(each.balls for each in hidden.values())
    seen = sum(each.found for each in hidden.values())
    report.bar("balls inside of links: found", "all", f"{seen} of {balls}", seen == balls)

    rows = []
    for (arm, way), some in found.items():
        depths = 1e6 * np.array([clip.depth for clip in some])
        ms = 1e3 * np.array([clip.seconds for clip in some])
        tests = [[c.ball, c.status == "touching", c.coal, c.solid] for c in some]
        counts = [len(some), *np.sum(tests, axis=0).tolist()]
        sizes = [1e3 * max(c.off for c in some), 1e6 * max(c.short for c in some)]
        rows.append([f"{arm}, {way}", *map(str, counts), f"{depths.min():.3g} to {depths.max():.3g}",
                     *(f"{size:.2g}" for size in sizes), f"{np.median(ms):.3g}", f"{ms.max():.3g}"])  # fmt: skip
    heads = [
        "",
        "segments",
        "at a ball",
        "found",
        "confirmed by coal",
        "by the judge",
        "depths [um]",
        "ends off, at most [mm]",
    ]
    heads += ["deeper elsewhere, at most [um]", "median [ms]", "most [ms]"]
    report.table("Clips between checked points", heads, rows, text=HOW)
    cells = [[arm, f"{each.balls}", f"{each.found}", f"{each.coal}"] for arm, each in hidden.items()]
    heads = ["arm", "balls", "found touching by `prove`", "touching by coal's surfaces"]
    report.table("What is wholly inside of a link", heads, cells, text=SOLID)


def main(
    run: Run,
    parts: Parts,
    *,
    count: Annotated[int, Option(help="Segments of each arm, straight ones and as many cubics.")] = 25,
    balls: Annotated[int, Option(help="Inside of the links of each arm.")] = 25,
) -> Report:
    """Measure."""
    kinds = [(arm, way) for arm in ARMS for way in ("lines", "cubics")]
    asked = [(arm, way, first, 1) for arm, way in kinds for first in range(count)]
    found = dict[tuple[str, str], list[Clip]]({kind: [] for kind in kinds})
    for (arm, way, _, _), some in zip(asked, parts(clips, asked), strict=True):
        found[arm, way] += some
    hidden = dict(zip(ARMS, parts(inside, [(arm, balls) for arm in ARMS]), strict=True))
    report = run.report("Clips between checked points", f"{processes(run.jobs)}, {processor()}")
    fill(report, found, hidden)
    return report
