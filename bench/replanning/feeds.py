"""Feeds with faults: an arm among obstacles whose scenes come late, twice, out of order, or tell less than the truth.

Each run is judged by coal alone against where the obstacles really were.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from typer import Option

import rrtik_ompl as rrtik
from bench.replanning import scenes
from bench.replanning.runs import ARMS, LONGEST, MARGIN, RATE, arm_options, arm_problem
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.contact_check import check_contacts
from rrtik_bench.moving_scenes import moving_scene
from rrtik_bench.report.page import Report
from rrtik_ompl.model.scene import Obstacle, Scene, pose_at
from rrtik_ompl.model.shapes import Box, Capsule, Prism, Shape, Sphere
from rrtik_ompl.replanning.faults import ANSWERS
from rrtik_ompl.replanning.feed import SILENCE_SECONDS, Snapshot, feed_of
from rrtik_ompl.replanning.loop import Loop
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.settings import ReplanSettings

SHARE = 0.1  # of the scenes, or of the obstacles, that each fault strikes
LONGEST_BURST = 10  # scenes that an obstacle is out of view, or has another name
LONGEST_DELAY = 5  # scenes
GROWTH = 1.2
GLARE_SCENES = 3
AWAY = pin.SE3(np.eye(3), np.array([0.0, 0.0, 1e3]))
NEWS = ("appears on the arm", "appears", "changes size", "changes shape")
WORDS = ("an obstacle is too near", "an obstacle closes in", "no motion of the arm rules out a contact")


@dataclass(frozen=True)
class Place:
    """Where runs are made.

    Attributes:
        rate: Ticks and scenes a second [Hz].
        longest: Longest run [s].
        events: What happens once in a run happens before this time [s], in which about half of the way is done.
        glare: What a sensor takes the arm itself for.
        ratio: Speed of the obstacles in the plane, as a share of the robot's; 0 for the arm.
    """

    rate: float
    longest: float
    events: float
    glare: Shape
    ratio: float = 0.0

    def problem(self, seed: int) -> rrtik.Problem:
        """The problem of a seed, whose obstacles state how they move in truth."""
        return scenes.triangles(self.ratio, seed) if self.ratio else arm_problem("ur5", seed)

    def options(self) -> dict[str, Any]:
        """Settings of the runs."""
        if not self.ratio:
            return arm_options("ur5")
        bound = {"speed_bound": self.ratio * scenes.STEP * scenes.RATE, "seconds": self.longest}
        return {**scenes.OPTIONS, **bound, "limits": scenes.limits()}

    def more(self, count: int, seed: int) -> tuple[Obstacle, ...]:
        """Further obstacles of the same kind."""
        if self.ratio:
            return self.problem(seed).world.scene.obstacles[:count]
        return moving_scene(rrtik.load_robot("ur5"), count, ARMS["ur5"]["speed"], seed, seconds=self.longest).obstacles


PLACES = {
    "ur5": Place(RATE, LONGEST, 1.5, Sphere(0.05)),
    "plane": Place(scenes.RATE, 40.0, 3.0, Sphere(1.0), 0.2),
}
WHERE = {"plane": "a point among six triangles, 0.2 of its speed", "ur5": "a UR5 among 20 obstacles at 0.2 m/s"}


@dataclass(frozen=True)
class Actor:
    """A solid of the truth: what moves it, when it is there [s], and its name in the feed."""

    name: str
    solid: Obstacle
    begin: float
    end: float

    def at(self, now: float) -> Obstacle:
        """The solid at a time, without its motion; far away while it is not there."""
        pose = pose_at(self.solid, now) if self.begin <= now < self.end else AWAY
        return Obstacle(self.name, self.solid.shape, pose)


@dataclass(frozen=True)
class FeedOutcome:
    """A run in short.

    Attributes:
        outcome: Whether it arrived, or why not.
        duration: Time of the run [s].
        faults: How many of each kind there were.
        proven, moving, told, untold: Ticks with contact in which the move is called proven; and of the others those in
            which the arm goes along its path without a word, those of which the record says that an obstacle is too
            near or has come or changed, and those in which the arm stands or evades without a word.
    """

    outcome: str
    duration: float
    faults: dict[str, int]
    proven: int
    moving: int
    told: int
    untold: int


def actors_of(problem: rrtik.Problem, place: Place, rng: np.random.Generator) -> list[Actor]:
    """The obstacles of a problem, of which some grow, change their shape or appear."""
    actors = []
    for o in problem.world.scene.obstacles:
        chance = rng.random()
        when = rng.uniform(0.0, place.events) if chance < 2.0 * SHARE else np.inf
        actors.append(Actor(o.name, o, 0.0, when))
        if chance < 2.0 * SHARE:
            shape = grown(o.shape) if chance < SHARE else other(o.shape)
            actors.append(Actor(o.name, replace(o, shape=shape), when, np.inf))

    later = place.more(max(round(SHARE * len(problem.world.scene.obstacles)), 1), int(rng.integers(2**31)))
    return actors + [Actor(f"later {o.name}", o, rng.uniform(0.0, place.events), np.inf) for o in later]


def grown(shape: Shape) -> Shape:
    """A larger shape of the same kind."""
    if isinstance(shape, Box):
        return Box(GROWTH * shape.size)
    if isinstance(shape, Capsule):
        return Capsule(GROWTH * shape.radius, GROWTH * shape.length)
    if isinstance(shape, Prism):
        return Prism(GROWTH * shape.polygon, shape.height)
    return Sphere(GROWTH * shape.bounding_radius)


def other(shape: Shape) -> Shape:
    """Another kind of shape around the same place."""
    return Box([2.0 * shape.radius] * 3) if isinstance(shape, Sphere) else Sphere(shape.bounding_radius)


def scenes_of(
    actors: list[Actor], robot: rrtik.Robot, place: Place, loops: list[Loop], rng: np.random.Generator
) -> Iterator[Snapshot]:
    """The scenes in the order in which they arrive; ``loops`` holds the loop, which knows where the arm is."""
    names = list(dict.fromkeys(actor.name for actor in actors))
    left = dict.fromkeys(names, 0)
    alias = dict.fromkeys(names, 0)
    glare_at = int(rng.uniform(0.3, place.events) * place.rate)
    glare: list[Obstacle] = []
    waiting: list[tuple[int, bool, Snapshot]] = []

    for k in range(int(place.longest * place.rate) + 1):
        now = k / place.rate
        seen = []
        for actor in actors:
            if not actor.begin <= now < actor.end:
                continue
            for bursts in (left, alias):
                begins = rng.random() < 2.0 * SHARE / LONGEST_BURST
                bursts[actor.name] = (
                    int(rng.integers(1, LONGEST_BURST + 1)) if begins else max(bursts[actor.name] - 1, 0)
                )
            if k == 0 or not left[actor.name]:
                name = f"{actor.name}, named anew" if k and alias[actor.name] else actor.name
                seen.append(replace(actor.at(now), name=name))
        if k == glare_at and loops:
            frames = robot.joint_frames(loops[0].q[None])[0]
            spot = frames[int(rng.integers(min(3, len(frames) - 1), len(frames)))]
            glare = [Obstacle("glare", place.glare, pin.SE3(spot[:3, :3], spot[:3, 3]))]
        if glare_at <= k < glare_at + GLARE_SCENES:
            seen += glare

        snapshot = Snapshot(now, Scene(seen))
        late, swapped, twice = (rng.random(3) < SHARE) & (k > 0)
        delay = int(rng.integers(1, LONGEST_DELAY + 1)) if late else int(swapped)
        waiting += [(k + delay, bool(swapped), snapshot)] * (2 if twice else 1)

        due = sorted((each for each in waiting if each[0] <= k), key=lambda each: each[1])
        waiting = [each for each in waiting if each[0] > k]
        yield from (each for *_, each in due)


def run_with_faults(place: Place, seed: int, patience: float) -> tuple[ReplanRun, list[Actor]]:
    """A run, and the truth."""
    problem = place.problem(seed)
    rng = np.random.default_rng([seed, 7])
    actors = actors_of(problem, place, rng)
    loops: list[Loop] = []
    settings = ReplanSettings(seed=seed, **place.options())
    feed = feed_of(scenes_of(actors, problem.robot, place, loops, rng), patience)
    loop = Loop(problem, feed, settings, None, time.process_time, patience)
    loops.append(loop)
    return loop.run_ticks(), actors


def feed_outcome(name: str, seed: int, patience: float) -> FeedOutcome:
    """A run in short, judged."""
    place = PLACES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run, actors = run_with_faults(place, seed, patience)

    def truth(now: float) -> Scene:
        return Scene([replace(actor.at(now), name=f"{actor.name}#{k}") for k, actor in enumerate(actors)])

    kinds: Counter[str] = Counter()
    report = check_contacts(place.problem(seed).robot, run, truth, samples_per_tick=5)
    for moment, event, *bodies in report.contacts:
        tick = run.ticks[min(int(moment * place.rate + 1e-6), len(run.ticks) - 1)]
        name = bodies[-1].partition("#")[0]
        news = any(name in f.obstacle and f.kind in NEWS and abs(moment - f.time) <= 1.0 for f in run.faults)
        told = tick.reason.startswith(WORDS) or news
        if tick.proven:
            kinds["proven"] += 1
        elif told:
            kinds["told"] += 1
        else:
            kinds["moving" if event in ("plan", "walk", "repair") else "untold"] += 1

    faults: Counter[str] = Counter(fault.kind for fault in run.faults)
    return FeedOutcome(
        run.outcome, run.ticks[-1].time, dict(faults), kinds["proven"], kinds["moving"], kinds["told"],
        kinds["untold"],
    )  # fmt: skip


def main(
    run: Run,
    parts: Parts,
    *,
    plane: Annotated[int, Option(help="Runs of the point in the plane.")] = 440,
    arm: Annotated[int, Option(help="Runs of the UR5; half as many with a feed_patience of 0.5 s.")] = 60,
) -> Report:
    """Measure."""
    report = run.report("Feeds with faults")
    ways = {("plane", SILENCE_SECONDS): plane, ("ur5", SILENCE_SECONDS): arm, ("ur5", 0.5): arm // 2}
    each = {way: parts(feed_outcome, [(way[0], seed, way[1]) for seed in range(n)]) for way, n in ways.items() if n}
    head = ["where", "feed_patience [s]", "runs", "arrived", "median, p95 of the arrivals [s]", "ended otherwise"]
    rows = [[WHERE[name], f"{wait:g}", str(len(found)), *_ends(found)] for (name, wait), found in each.items()]
    report.table("Arrivals", head, rows)

    head = ["where", "feed_patience [s]", "runs with contact"]
    head += ["move called proven", "other move without a word", "with a word", "stands without a word"]
    rows = [[WHERE[name], f"{wait:g}", *_contacts(found)] for (name, wait), found in each.items()]
    report.table("Runs with contact, and ticks with contact", head, rows)

    faults = sum((Counter(one.faults) for found in each.values() for one in found), Counter[str]())
    rows = [[kind, str(faults[kind]), answer] for kind, answer in ANSWERS.items()]
    report.table("Faults of all runs", ["fault", "times", "answer"], rows)

    silent = sum(one.proven + one.moving + one.untold for found in each.values() for one in found)
    total = sum(map(len, each.values()))
    report.bar("ticks with contact without a word", "0", f"{silent} in {total} runs", silent == 0)
    report.note("How it is read", READING)
    return report


def _ends(found: list[FeedOutcome]) -> list[str]:
    times = [each.duration for each in found if each.outcome == "arrived"] or [np.nan]
    others = Counter(each.outcome for each in found if each.outcome != "arrived")
    arrived = sum(each.outcome == "arrived" for each in found)
    middle, late = np.percentile(times, (50, 95))
    return [str(arrived), f"{middle:.2f}, {late:.2f}", ", ".join(f"{k}: {v}" for k, v in others.items()) or "none"]


def _contacts(found: list[FeedOutcome]) -> list[str]:
    kinds = ("proven", "moving", "told", "untold")
    touching = sum(any(getattr(each, kind) for kind in kinds) for each in found)
    return [str(touching), *(str(sum(getattr(each, kind) for each in found)) for kind in kinds)]


READING = (
    f"Of the scenes {SHARE:.0%} each come late (by one to {LONGEST_DELAY}), twice, and after the next one. Each "
    f"obstacle is out of view for {SHARE:.0%} of the time, and has another name for {SHARE:.0%}, for up to "
    f"{LONGEST_BURST} scenes at once. Of the obstacles {SHARE:.0%} each grow by {GROWTH - 1.0:.0%} and change their "
    f"shape, from one moment to the next and in truth, and {SHARE:.0%} more appear, in truth too, on the arm if it is "
    f"there; once in each run, for {GLARE_SCENES} scenes, the feed shows a ball on the arm that is not there. The "
    f"UR5 reads the feed {RATE:g} times a second and keeps {1e3 * MARGIN:g} mm, the point {scenes.RATE:g} times and "
    "keeps no margin; the speed bound is that of the obstacles. A contact is judged by coal alone, five times a tick, "
    "against where everything was in truth. It has a word if the record does not call the move proven, and says in "
    "that tick that an obstacle is too near or that no motion rules a contact out, or within a second that this "
    "obstacle has appeared or has changed its size or shape: before a scene shows that, nobody can say it."
)
