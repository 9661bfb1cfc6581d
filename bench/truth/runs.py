"""Section: runs of replanning and plans in time among every kind of shape, by every kind of feed, judged twice.

One judge is the library's own, :meth:`ReplanRun.violations`, with the true course of each obstacle. The other one is
below: pinocchio and coal alone, with solids made here from the numbers of each shape, looked at densely in time.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin

from bench.shared.judge import overlap
from bench.shared.parts import Parts
from bench.shared.solids import coal_solids, one_of_each, reach_of
from rrtik_bench.report.page import Report
from rrtik_ompl import (
    Obstacle,
    Problem,
    Robot,
    Scene,
    World,
    load_robot,
    replan,
)
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.shapes import Shape
from rrtik_ompl.replanning import ConstantVelocity, TimedPoses, plan_in_time
from rrtik_ompl.replanning.feed import Snapshot, Source
from rrtik_ompl.replanning.record import ReplanRun

RUNS, OF_A_PART = 2000, 10
ROBOTS = ("planar3", "ur5", "titan4")
MARGIN, RATE, SPEED = 0.02, 50.0, 0.2
ROOM = 0.05  # [m] around the arm at the beginning
LOOKS = 6  # of the second judge in a tick
SECONDS = 4.0


def _way(rng: np.random.Generator, solid: Shape, here: pin.SE3, name: str) -> TimedPoses | ConstantVelocity:
    """A motion of which no point is faster than SPEED: straight on, or to and fro, turning if it has an end."""
    direction = rng.normal(size=3)
    direction *= SPEED / np.linalg.norm(direction)
    if name == "half-space":
        return TimedPoses([0.0, 1.0, 9.0], [here, here, pin.SE3(here.rotation, here.translation + 0.2 * direction)])
    if rng.random() < 0.4:
        return ConstantVelocity(-SPEED * here.translation / np.linalg.norm(here.translation))
    times, places = [0.0], [here]
    for _ in range(6):
        seconds = rng.uniform(0.3, 1.5)
        spin = rng.normal(size=3)
        spin *= 0.4 * SPEED * seconds / (np.linalg.norm(spin) * max(solid.bounding_radius, 1e-3))
        heading = rng.normal(size=3) - places[-1].translation
        shift = 0.5 * SPEED * seconds * heading / np.linalg.norm(heading)
        places.append(pin.SE3(places[-1].rotation @ pin.exp3(spin), places[-1].translation + shift))
        times.append(times[-1] + seconds)
    return TimedPoses(times, places)


def _case(number: int) -> tuple[Problem, set[str]]:
    """A problem with obstacles of some kinds, about half of which move, and the names of these kinds."""
    rng = np.random.default_rng([20, number])
    name = ROBOTS[number % len(ROBOTS)]
    robot, reach = load_robot(name), reach_of(name)
    for _ in range(50):
        solids = one_of_each(rng, 0.18 * reach)
        kinds = rng.choice(list(solids), 4, replace=False).tolist()
        obstacles = []
        for kind in kinds:
            way = rng.normal(size=3) * [1.0, 1.0, 0.1 if name == "planar3" else 1.0]
            here = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(0.35, 0.9) * reach * way / np.linalg.norm(way))
            if kind == "half-space":  # the ground, a little tilted
                tilt = pin.exp3(np.array([*rng.normal(0.0, 0.05, 2), 0.0]))
                here = pin.SE3(tilt, np.array([0.0, 0.0, -rng.uniform(0.3, 0.6) * reach]))
            moves = rng.random() < 0.6
            motion = _way(rng, solids[kind], here, kind) if moves else None
            obstacles.append(Obstacle(kind, solids[kind], here, motion))
        problem = _between(robot, Scene(tuple(obstacles)), rng)
        if problem is not None:
            return problem, set(kinds)
    raise RuntimeError(f"no start and goal in case {number}")


def _between(robot: Robot, scene: Scene, rng: np.random.Generator) -> Problem | None:
    """A start and a goal with room around them; None if there are none."""
    world = World(robot, scene)
    lower, upper = (np.clip(ends, -0.6 * np.pi, 0.6 * np.pi) for ends in robot.finite_range())
    rows = rng.uniform(lower, upper, (60, robot.dof))
    rows = rows[world.valid_batch(rows)]
    rows = rows[[world.clearance(q) > ROOM for q in rows]]
    if len(rows) < 2:
        return None
    far = int(np.argmax(np.linalg.norm(rows - rows[0], axis=1)))
    return Problem(world, rows[0], rows[far], name="case")


def _seen(truth: Scene, time: float) -> Scene:
    """What a camera sees: where all is, and nothing of how it goes on."""
    return Scene(tuple(Obstacle(o.name, o.shape, o.pose) for o in truth.at(time).obstacles))


def _stream(
    truth: Scene, every: float, *, begin: float = 0.0, end: float = 99.0, silent: tuple[float, float] = (0.0, 0.0)
) -> Iterator[tuple[float, Scene]]:
    for k in range(int(min(end, SECONDS + 1.0) / every) + 1):
        time = k * every
        if not silent[0] < time < silent[1]:
            yield begin + time, _seen(truth, time)


def _hidden(truth: Scene) -> Iterator[Snapshot]:
    """Pictures at 50 Hz, in which the first obstacle is hidden now and then."""
    name = truth.obstacles[0].name
    for k in range(int((SECONDS + 1.0) / 0.02) + 1):
        time = 0.02 * k
        since = 0.5 * np.floor(time / 0.5) if time % 1.0 >= 0.5 else time
        now, then = _seen(truth, time), _seen(truth, float(since))
        scene = Scene((then.obstacles[0], *now.obstacles[1:]))
        yield Snapshot(time, scene, {name: time - float(since)} if since < time else {})


FEEDS: dict[str, Callable[[Scene], Source | None]] = {
    "stated motions": lambda truth: None,
    "a function": lambda truth: lambda time: _seen(truth, time),
    "50 Hz": lambda truth: _stream(truth, 0.02),
    "50 Hz, clock since 1970": lambda truth: _stream(truth, 0.02, begin=1.7e9),
    "10 Hz, clock from 100 s": lambda truth: _stream(truth, 0.1, begin=100.0),
    "1 Hz": lambda truth: _stream(truth, 1.0),
    "silent from 0.4 to 1.2 s": lambda truth: _stream(truth, 0.02, silent=(0.4, 1.2)),
    "ends at 0.5 s": lambda truth: _stream(truth, 0.02, end=0.5),
    "one obstacle hidden now and then": _hidden,
    "in milliseconds": lambda truth: ((1e3 * time, scene) for time, scene in _stream(truth, 0.02)),
}
IN_TIME = "plan in time"


def judged_runs(first: int, count: int) -> list[dict[str, float | str]]:
    """Runs from a number on: of each what came out, and what both judges found."""
    told = []
    for number in range(first, first + count):
        names = [IN_TIME, *FEEDS]
        feed = names[(number // len(ROBOTS)) % len(names)]
        problem, kinds = _case(number)
        told.append({"feed": feed, "kinds": ",".join(sorted(kinds)), **_judged(problem, feed, number)})
    return told


def _judged(problem: Problem, feed: str, number: int) -> dict[str, float | str]:
    truth = problem.world.scene
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            run = _run(problem, feed, number)
        except InputError as error:
            return {"outcome": "refused", "reason": str(error)}
        if run is None:
            return {"outcome": "no plan", "reason": ""}
        found = run.violations(problem, truth)
    moves, proven = run.moves
    touched = {each.tick for each in found if each.touches}
    events = Counter(run.ticks[tick].event for tick in touched)
    second = _touched(problem.robot, run, truth)
    return {
        "outcome": run.outcome,
        "reason": run.reason,
        "moves": float(moves),
        "proven": float(proven),
        "contacts": float(len(touched)),
        "standing": float(sum(run.ticks[tick].proven is None for tick in touched)),
        "evading": float(events["evade"]),
        "proven wrong": float(len({each.tick for each in found if each.proven})),
        "proven wrong, second judge": float(sum(run.ticks[tick].proven is True for tick in second)),
        "unseen by the judge": float(len(second - touched)),
    }


def _run(problem: Problem, feed: str, number: int) -> ReplanRun | None:
    if feed == IN_TIME:
        plan = plan_in_time(
            problem, rate=10.0, horizon=2.5 * SECONDS, margin=MARGIN, iterations=1500, seconds=60.0, seed=1
        )
        return plan.motion
    source = FEEDS[feed](problem.world.scene)
    return replan(
        problem, source, step=0.03, rate=RATE, margin=MARGIN, speed_bound=SPEED, seconds=SECONDS, repair_budget=1.0,
        seed=number,
    )  # fmt: skip


# The second judge.


def _touched(robot: Robot, run: ReplanRun, truth: Scene) -> set[int]:
    """The ticks in which a link and an obstacle overlap."""
    model, links = robot.model, robot.collision
    data, placed = model.createData(), links.createData()
    solids = {o.name: coal_solids(o.shape) for o in truth.obstacles}
    for geometry in links.geometryObjects:
        geometry.geometry.computeLocalAABB()
    for some in solids.values():
        for solid, _ in some:
            solid.computeLocalAABB()
    found = set()
    for number, (tick, after) in enumerate(pairwise(run.ticks)):
        for share in np.arange(LOOKS) / LOOKS:
            q = tick.q + share * (after.q - tick.q)
            time = tick.time + share * (after.time - tick.time)
            pin.updateGeometryPlacements(model, data, links, placed, robot.pinocchio_configuration(q[None])[0])
            if _any_touch(links, placed, truth.at(time), solids):
                found.add(number)
                break
    return found


def _any_touch(
    links: pin.GeometryModel,
    placed: pin.GeometryData,
    scene: Scene,
    solids: dict[str, list[tuple[coal.CollisionGeometry, pin.SE3]]],
) -> bool:
    for geometry, place in zip(links.geometryObjects, placed.oMg, strict=True):
        if geometry.parentJoint == 0:
            continue
        link = geometry.geometry
        centre = place.act(np.asarray(link.aabb_center))
        for obstacle in scene.obstacles:
            for solid, within in solids[obstacle.name]:
                there = obstacle.pose * within
                if not isinstance(solid, coal.Halfspace):
                    gap = np.linalg.norm(there.act(np.asarray(solid.aabb_center)) - centre)
                    if gap > link.aabb_radius + solid.aabb_radius:
                        continue
                if overlap(link, place, solid, there) is not None:
                    return True
    return False


def section(parts: Parts, size: float) -> Report:
    """Runs of all kinds, judged twice."""
    count = max(OF_A_PART, round(RUNS * size))
    blocks = [(first, min(OF_A_PART, count - first)) for first in range(0, count, OF_A_PART)]
    told = [each for part in parts(judged_runs, blocks) for each in part]
    report = Report("", "")

    ran = [each for each in told if "moves" in each]
    wrong = int(_sum(ran, "proven wrong") + _sum(ran, "proven wrong, second judge"))
    moves, proven = int(_sum(ran, "moves")), int(_sum(ran, "proven"))
    what = f"{count:,} runs: contacts, or less than margin and clearance, in moves that are called proven"
    report.bar(what, "0, by both judges", f"{wrong} in {proven:,} proven of {moves:,} moves", wrong == 0)
    unseen = int(_sum(ran, "unseen by the judge"))
    report.bar("contacts that pinocchio and coal see and the judge of runs does not", "0", f"{unseen}", unseen == 0)
    milliseconds = [each for each in told if each["feed"] == "in milliseconds"]
    refused = sum("milliseconds" in str(each.get("reason")) for each in milliseconds)
    begun = sum("the start" in str(each.get("reason")) or "start:" in str(each.get("reason")) for each in milliseconds)
    measured = f"{refused + begun} of {len(milliseconds)}"
    report.bar("feeds in milliseconds", "refused in one line", measured, refused + begun == len(milliseconds))

    rows = []
    for feed in [IN_TIME, *FEEDS]:
        some = [each for each in told if each["feed"] == feed]
        outcomes = Counter(str(each["outcome"]) for each in some)
        shown = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
        columns = ("moves", "proven", "contacts", "standing", "evading", "proven wrong", "proven wrong, second judge")
        rows.append([feed, str(len(some)), shown, *(f"{int(_sum(some, name)):,}" for name in columns)])
    heads = ["feed", "runs", "came out", "moves", "proven", "ticks with contact", "of these standing", "evading"]
    heads += ["proven wrong", "the same, second judge"]
    kinds = Counter(kind for each in ran for kind in str(each["kinds"]).split(","))
    listed = ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items()))
    text = (
        f"Obstacles move at up to {SPEED:g} m/s, the stated bound; the margin is {1e3 * MARGIN:g} mm. Runs in which "
        f"each kind stood: {listed}. A tick with contact whose move is not called proven is one of which nothing was "
        "promised: the arm stood, evaded, or went where no proof was found."
    )
    report.table("Runs judged", heads, rows, text=text)
    return report


def _sum(some: list[dict[str, float | str]], name: str) -> float:
    return sum(float(each.get(name, 0.0)) for each in some)
