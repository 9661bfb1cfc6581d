"""A TITAN 4 that draws a tool out of a tight holder: proven but for the pair that may touch.

An interrupted run goes on where it was.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik
from bench.shared.clocks import least
from bench.shared.judge import distance
from bench.shared.parts import Parts
from bench.shared.run import Run
from bench.tip_motion.judge import Judge
from rrtik_bench.report.machine import processes, processor
from rrtik_bench.report.page import Report
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.tasks.stages import Stage
from rrtik_ompl.world.world import World

SHAFT, PLAY = 0.06, 0.0005  # [m]: side of the square shaft, and room on each side of it
LONG, DEEP, THICK = 0.30, 0.16, 0.05  # [m]: the tool, the holder along its axis, the walls of the holder
BACK, REACHED = 0.25, 0.12  # [m]: tip before the middle of the tool at first, and how far it goes on to grasp
OUT, UP = 0.12, 0.1  # [m]: that the tool is drawn out, and lifted
LIMIT, ROUNDS = 20.0, 2  # [s], calls
EVERY = 25  # of the judge's 50 parts of a motion, for all pairs; the tool in its holder is looked at in all of them
GRASP = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # the tip's z axis is the tool's x axis
INTRO = """The holder stands in front of the arm, 1.45 to 1.7 m away, 25 degrees to either side and 25 cm up or down at
most, and is turned by up to 10 degrees from the direction of the arm. It leaves 0.5 mm of play on each side of a shaft
of 60 mm, 8 cm deep in it. The arm moves to before the handle, goes straight on, takes the tool, draws it straight out
and lifts it. Gripper and tool may touch, nothing else may. The reasons of scenes without a plan are counted. The judge
is pinocchio and coal alone. Times: processor time of the whole plan, the smaller of two calls."""


@dataclass(frozen=True)
class Drawn:
    """What was measured of one scene; ``room``: the least distance of tool and holder while it is drawn out [m]."""

    found: bool
    seconds: float
    motions: int
    proven: int
    faults: int
    room: float
    reason: str


def scene_of(number: int) -> tuple[World, rrtik.Task]:
    """A holder with a tool, and the task."""
    rng = np.random.default_rng([11, number])
    side, turn, away, up = rng.uniform([-25.0, -10.0, 1.45, -0.25], [25.0, 10.0, 1.7, 0.25])
    at = np.array([away * np.cos(np.radians(side)), away * np.sin(np.radians(side)), up])
    place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(side + turn)), at)

    def box(name: str, sides: list[float], at: list[float]) -> rrtik.Obstacle:
        return rrtik.Obstacle(name, rrtik.Box(sides), place * pin.SE3(np.eye(3), np.array(at)))

    hole, axis = SHAFT + 2.0 * PLAY, 0.5 * LONG + 0.5 * DEEP - 0.08
    aside = 0.5 * (hole + THICK)
    obstacles = (
        box("tool", [LONG, SHAFT, SHAFT], [0.0, 0.0, 0.0]),
        box("holder left", [DEEP, THICK, hole + 2.0 * THICK], [axis, aside, 0.0]),
        box("holder right", [DEEP, THICK, hole + 2.0 * THICK], [axis, -aside, 0.0]),
        box("holder top", [DEEP, hole, THICK], [axis, 0.0, aside]),
        box("holder bottom", [DEEP, hole, THICK], [axis, 0.0, -aside]),
        box("holder back", [0.04, 0.3, 0.3], [axis + 0.5 * DEEP + 0.02, 0.0, 0.0]),
    )
    world = World(rrtik.load_robot("titan4"), rrtik.Scene(obstacles, allowed_collisions=(("gripper", "tool"),)))
    along = place.rotation[:, 0]
    stages: list[Stage] = [
        rrtik.MoveTo(place * pin.SE3(GRASP, np.array([-BACK, 0.0, 0.0]))),
        rrtik.Straight(by=REACHED * along),
        rrtik.Attach("tool", "gripper"),
        rrtik.Straight(by=-OUT * along),
        rrtik.Straight(by=[0.0, 0.0, UP]),
    ]
    return world, rrtik.Task(stages)


def drawn_out(number: int) -> Drawn:
    """One scene, planned and judged."""
    world, task = scene_of(number)
    seconds, plan = least(lambda: task.plan(world, "ready", seconds=LIMIT, seed=number), ROUNDS)
    faults, before = 0, world.robot.posture("ready")
    for path, around in zip(plan.paths, plan.worlds, strict=True):
        faults += Judge(around).cuts(path.waypoints, EVERY) > 0.0 or np.abs(path.start - before).max() > 1e-9
        before = path.end
    room = _room(plan.worlds[2], plan.paths[2].waypoints) if plan.found else float("inf")
    proven = sum(path.proven for path in plan.paths)
    return Drawn(plan.found, seconds, len(plan.paths), proven, int(faults), room, plan.reason)


def _room(world: World, rows: Matrix) -> float:
    """The least distance between the tool and its holder at 1/50 of every motion [m], below 0 if they touch."""
    model, data = world.robot.model, world.robot.model.createData()
    least = np.inf
    tool = next(body for body in world.bodies if body.name == "tool")
    walls = [body for body in world.bodies if body.name.startswith("holder")]
    dense = [a + share * (b - a) for a, b in pairwise(rows) for share in np.linspace(0.0, 1.0, 51)]
    for full in world.robot.pinocchio_configuration(np.array(dense)):
        pin.forwardKinematics(model, data, full)
        here = data.oMi[tool.joint] * tool.placement
        least = min(least, *(distance(tool.geometry, here, wall.geometry, wall.placement) for wall in walls))
    return least


def _kind(reason: str) -> str:
    """The stage that failed, and why, without numbers."""
    stage, _, why = reason.partition(" failed")
    kinds = {"inverse kinematics": "out of reach", "limit of joint": "limit of a joint", "singular": "singular posture"}
    return f"{stage}: {next((text for words, text in kinds.items() if words in why), why)}"


def main(run: Run, parts: Parts, *, scenes: int = 100) -> Report:
    """Measure."""
    report = run.report("A tool out of a tight holder", f"{processes(run.jobs)}, {processor()}", INTRO)
    own: list[Drawn] = parts(drawn_out, [(k,) for k in range(scenes)])
    found = [each for each in own if each.found]
    motions = sum(each.motions for each in found)
    proven = sum(each.proven for each in found)
    faults = sum(each.faults for each in found)
    room = min((each.room for each in found), default=np.inf)
    times = 1e3 * np.array([each.seconds for each in found])
    wanted = "all but for the allowed pair"
    report.bar("titan4: motions proven free", wanted, f"{proven} of {motions}", proven == motions)
    report.bar("titan4: motions with a fault, by the judge", "0", f"{faults} of {motions}", faults == 0)
    report.bar("titan4: tool and holder while it is drawn out", "> 0 mm apart", f"{1e3 * room:.3f} mm", room > 0.0)
    spread = f"{np.median(times):.0f} / {np.quantile(times, 0.95):.0f} / {times.max():.0f}" if found else "-"
    report.table("Plans", ["found", "ms, median / 95 % / worst"], [[f"{len(found)} of {len(own)}", spread]])
    reasons = Counter(_kind(each.reason) for each in own if not each.found)
    if reasons:
        report.table("Not found", ["reason", "scenes"], [[why, str(count)] for why, count in reasons.most_common()])
    return report
