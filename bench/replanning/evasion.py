"""Six triangles as fast as the robot, with a bound on their speed: contacts, proofs, arrivals.

Coal alone judges, with every triangle where it really is. An interrupted run goes on where it was.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from typing import Annotated

import coal
import numpy as np
from typer import Option

import rrtik_ompl as rrtik
from bench.replanning import scenes
from bench.replanning.runs import plane_run, still
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.contact_check import check_contacts
from rrtik_bench.report.page import Report
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.replanning.unavoidable import ContactWarning
from rrtik_ompl.world.arrangement import arranged

BOUND = scenes.STEP * scenes.RATE  # [m/s], as fast as the robot
FIRST_SEED = 10_000  # Smaller ones were looked at while this was written.
SAMPLES = 500  # configurations in reach that the boxes of a proof have to cover
ROUNDING = 1e-6  # [m]


@dataclass(frozen=True)
class Outcome:
    """What the page needs of a run.

    Attributes:
        arrived: Whether the goal was reached.
        seconds: Processor time of the run [s].
        ticks: Number of ticks.
        contacts: Numbers of the ticks with contact.
        safe: How many ticks are called safe for a tick or more.
        unsafe: Numbers of the others.
        lost: Numbers of the ticks with a proof that no motion rules out a contact.
        refused: Numbers of those whose proof coal does not confirm.
        warnings: Number of warnings that a contact cannot be avoided.
    """

    arrived: bool
    seconds: float
    ticks: int
    contacts: tuple[int, ...]
    safe: int
    unsafe: tuple[int, ...]
    lost: tuple[int, ...]
    refused: tuple[int, ...]
    warnings: int


def outcome(seed: int) -> Outcome:
    """A run that sees places and no motions, judged. The clock stands still, so that no repair is cut short."""
    problem = scenes.triangles(1.0, seed)
    scene = problem.world.scene
    begin = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = plane_run(problem, seed, scene_feed=lambda at: still(scene.at(at)), clock=lambda: 0.0, speed_bound=BOUND)
    seconds = time.process_time() - begin
    return judged(problem, run, seconds, sum(each.category is ContactWarning for each in caught))


def judged(problem: rrtik.Problem, run: ReplanRun, seconds: float, warned: int) -> Outcome:
    """What coal and the truth say of a run."""
    report = check_contacts(problem.robot, run, problem.world.scene)
    touching = tuple(sorted({int(contact[0] * run.rate + 1e-6) for contact in report.contacts}))
    tick = 1.0 / run.rate - 1e-9
    asked = [k for k, each in enumerate(run.ticks) if each.safe_seconds is not None]
    unsafe = tuple(k for k in asked if (run.ticks[k].safe_seconds or 0.0) < tick)
    lost = tuple(k for k in asked if run.ticks[k].unavoidable is not None)
    refused = tuple(k for k in lost if not holds(problem, run.ticks[k], run.step))
    return Outcome(
        run.found, seconds, len(run.ticks), touching, len(asked) - len(unsafe), unsafe, lost, refused, warned
    )


def holds(problem: rrtik.Problem, tick: Tick, step: float) -> bool:
    """Whether a tick's proof holds: its boxes cover what is in reach, and coal measures no larger distances."""
    proof = tick.unavoidable
    assert proof is not None
    rng = np.random.default_rng(0)
    rows = tick.q + rng.uniform(-step, step, (SAMPLES, len(tick.q)))
    in_reach = rows[np.linalg.norm(rows - tick.q, axis=1) <= step]
    in_reach = in_reach[((in_reach >= problem.robot.lower) & (in_reach <= problem.robot.upper)).all(axis=1)]
    inside = (in_reach[:, None] >= proof.lower) & (in_reach[:, None] <= proof.upper)
    covered = bool(inside.all(axis=2).any(axis=1).all())

    # Where the arm is at the time of each box, on its motion to the centre.
    shares = proof.seconds * scenes.RATE
    on_the_way = tick.q + shares[:, None] * (0.5 * (proof.lower + proof.upper) - tick.q)
    elsewhere = shares * (0.5 * (proof.upper - proof.lower) @ problem.world.weights)

    scene = problem.world.scene.at(tick.time)
    bodies = arranged(problem.robot, scene, 0.0).bodies.as_tuple
    frames = problem.robot.joint_frames(on_the_way)
    for number, (link, obstacle) in enumerate(proof.pairs):
        own, other = (next(body for body in bodies if body.name == name) for name in (link, obstacle))
        poses = frames[number, own.joint] @ own.placement.homogeneous, other.placement.homogeneous
        places = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in poses]
        solids = own.geometry, places[0], other.geometry, places[1]
        distance = coal.distance(*solids, coal.DistanceRequest(), coal.DistanceResult())
        if distance + elsewhere[number] > BOUND * proof.seconds[number] + ROUNDING:
            return False
    return covered


def main(
    run: Run,
    parts: Parts,
    *,
    runs: Annotated[int, Option(help="Runs, each with a seed of its own.", min=1)] = 3000,
) -> Report:
    """Measure."""
    report = run.report("Evasions among obstacles as fast as the robot")
    found: list[Outcome] = parts(outcome, [(seed,) for seed in range(FIRST_SEED, FIRST_SEED + runs)])

    touched = [each for each in found if each.contacts]
    unannounced = sum(not set(each.contacts) <= set(each.lost) for each in touched)
    in_safe_ticks = sum(len(set(each.contacts) - set(each.unsafe)) for each in found)
    enough = "" if runs >= 3000 else " (fewer than 3,000 runs)"
    report.bar(
        "runs with contact in a tick that did not begin with its proof", "0 of 3,000",
        f"{unannounced} of {runs}{enough}", unannounced == 0 and not enough,
    )  # fmt: skip
    report.bar("ticks with contact among those called safe", "0",
               f"{in_safe_ticks} of {sum(each.safe for each in found)}", in_safe_ticks == 0)  # fmt: skip
    proofs = sum(len(each.lost) for each in found)
    refused = sum(len(each.refused) for each in found)
    report.bar("proofs that coal does not confirm", "0", f"{refused} of {proofs}", refused == 0)
    unproven = sum(each.warnings > 0 and not each.lost for each in found)
    report.bar("warnings without a proof", "0", f"{unproven} of {sum(each.warnings for each in found)}", unproven == 0)

    head = ["runs", "arrived", "ticks a run", "with contact", "a contact proven unavoidable", "neither safe nor proven",
            "processor time a tick [ms]"]  # fmt: skip
    open_runs = sum(len(each.unsafe) > len(each.lost) for each in found)
    ticks = sum(each.ticks for each in found)
    counts = [len(found), sum(each.arrived for each in found), f"{ticks / len(found):.0f}", len(touched)]
    counts += [sum(bool(each.lost) for each in found), open_runs]
    seconds = sum(each.seconds for each in found)
    report.table("Six triangles, speed ratio 1", head, [[*map(str, counts), f"{1e3 * seconds / ticks:.1f}"]])
    report.note("How it is read", READING)
    return report


READING = (
    "The scene is that of the DRRT-Con report: a point that goes 0.5 m a tick, six triangles of that speed, which turn "
    "at random, 10 ticks a second. Seeds count from 10,000; none of these runs was looked at while the code was "
    "written. The run sees where they are at the begin of a tick and knows the bound, but not their courses. 'Proven "
    "unavoidable' means: no motion of the tick rules out a contact, whatever the robot does, because the triangles "
    "could be anywhere within the bound (docs/science/evasion.md). Many of these contacts do not happen. 'Neither safe "
    "nor proven' counts runs in which some tick had no safe motion that was found, nor a proof that there is none. "
    "Contacts are looked for ten times a tick by coal. Proofs are verified by coal's distances at the centres of their "
    "boxes, and by random configurations in reach."
)
