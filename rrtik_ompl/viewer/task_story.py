"""The plan of a task as a run that the page replays: the arm's motions, and objects where they are carried."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_row
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.model.scene import AttachedObject, Obstacle, Scene
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.tasks import MoveTo, TaskPlan
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.tasks.timed import time_task
from rrtik_ompl.viewer.fingers import fingers_of
from rrtik_ompl.viewer.path_contacts import PathContact, contacts_at
from rrtik_ompl.viewer.subject import Showable, Subject, played
from rrtik_ompl.viewer.verdict import Judged, Verdict
from rrtik_ompl.world.route_check import as_it_stands
from rrtik_ompl.world.world import World

TASK = "task"  # the planner of a run that shows one
RATE = 25.0  # ticks per second
SAME_PLACE = 1e-9  # [m], and alike for a turn


def subject_of_task(shown: Showable, plan: TaskPlan) -> Subject:
    """What a page shows of a plan: its run, the regions that are kept on the way, and the gripper at work.

    The arm, what stands and what is held are those of the plan's own worlds, whatever world it is shown with. What a
    joint carries in the same place from beginning to end is drawn there, everything else where it is in each tick.

    Raises:
        InputError: If there is no plan to show, or it does not fit what is shown.
    """
    rows = _timed(plan)
    first = plan.worlds[0]
    kept = _kept(plan)
    run = _run(plan, rows, kept)
    places = _places(first, rows[0][1])
    loose = [item for item in first.scene.attached if item.name not in kept]
    things: list[Obstacle | AttachedObject] = [*first.scene.obstacles, *loose]
    scene = Scene(
        tuple(Obstacle(each.name, each.shape, places[each.name], margin=each.margin) for each in things),
        tuple(item for item in first.scene.attached if item.name in kept),
    )
    subject = played(shown, run)
    at = np.array([number + share for number, _, share in rows])
    judged = _judged(plan, rows)
    return replace(
        subject,
        robot=first.robot,
        scene=scene,
        held=held_in(plan),
        fingers=fingers_of(plan, first.robot, at),
        verdict=judged.verdict,
        contacts=judged.contacts,
    )


def run_of(plan: TaskPlan) -> ReplanRun:
    """The run that shows a plan as :func:`time_task` times it: at the robot's own limits, with rests between motions.

    Raises:
        InputError: If there is no plan to show.
    """
    return _run(plan, _timed(plan), _kept(plan))


def _kept(plan: TaskPlan) -> frozenset[str]:
    """Names of what a joint carries in the same place in all motions."""
    carried = [_carried(world) for world in plan.worlds]
    return frozenset(
        name
        for name, (joint, place) in carried[0].items()
        if all(
            name in each and each[name][0] == joint and np.allclose(each[name][1], place, rtol=0.0, atol=SAME_PLACE)
            for each in carried
        )
    )


def _carried(world: World) -> dict[str, tuple[int, Matrix]]:
    """For all that is held, the joint that carries it, and where on that, shape (4, 4)."""
    model = world.robot.model
    frames = {item.name: model.frames[model.getFrameId(item.link)] for item in world.scene.attached}
    places = {item.name: frames[item.name].placement * item.pose for item in world.scene.attached}
    return {name: (int(frames[name].parentJoint), place.homogeneous) for name, place in places.items()}


def _run(plan: TaskPlan, rows: list[tuple[int, Vector, float]], kept: frozenset[str]) -> ReplanRun:
    robot = plan.worlds[0].robot
    ticks: list[Tick] = []
    for number, q, _ in rows:
        path, world = plan.paths[number], plan.worlds[number]
        text = f"motion {number + 1} of {len(plan.paths)}: {plan.stages[number]}"
        poses = {name: pose_row(place) for name, place in _places(world, q).items() if name not in kept}
        ticks.append(Tick(len(ticks) / RATE, q, "walk", path.waypoints, poses, {}, reason=text))
    return ReplanRun(
        problem=robot.name,
        robot=robot.name,
        joint_names=robot.joint_names,
        planner=TASK,
        seed=0,
        step=1.0,
        rate=RATE,
        margin=0.0,
        speed_bound=None,
        ticks=ticks,
        outcome="arrived",
    )


def _judged(plan: TaskPlan, rows: list[tuple[int, Vector, float]]) -> Judged:
    """The verdict on a plan, by the ticks of its run."""
    faults = plan.faults()
    motions = zip(plan.paths, plan.worlds, plan.stages, strict=True)
    worlds = [world_of_motion(path, world, stage) for path, world, stage in motions]
    proofs = zip(plan.paths, worlds, strict=True)
    proven = [path.proven if path.proof is not None else path.proved(world).proven for path, world in proofs]
    doubtful = [k for k, fine in enumerate(proven) if not fine or faults[k]]
    numbers = np.array([number for number, _, _ in rows])
    ticks = np.flatnonzero(np.isin(numbers[:-1], doubtful))
    text = f"{len(doubtful)} of {len(proven)} motions not proven free (violet)"
    first = next((f"motion {k + 1}: {motion[0].reason}" for k, motion in enumerate(faults) if motion), "")
    if not doubtful:
        text = "every motion is proven free" + (", on the contacts that it stands on" if any(plan.contacts) else "")
    elif first:
        text += f"; {first}"
    contacts = tuple(
        contact
        for k in doubtful
        for contact in _contacts(worlds[k], np.flatnonzero(numbers == k), rows, [fault.q for fault in faults[k]])
    )
    text += as_it_stands(plan.worlds[0].scene)
    return Judged(Verdict(not doubtful, text, tuple(ticks.tolist())), None, contacts)


def _contacts(
    world: World, ticks: NDArray[np.int64], rows: list[tuple[int, Vector, float]], faults: list[Vector]
) -> Iterator[PathContact]:
    """What touches in the ticks of a motion, and at the library's faults of it, each in the tick that is nearest."""
    placed = np.array([rows[k][1] for k in ticks])
    yield from contacts_at(world, ticks.astype(np.float64), placed)
    for q in faults:
        tick = float(ticks[np.abs(placed - q).sum(axis=1).argmin()])
        for contact in contacts_at(world, np.array([tick]), q[None]):
            yield replace(contact, end=tick + 1.0)


def held_in(plan: TaskPlan) -> tuple[tuple[HeldRegion, Vector], ...]:
    """The regions of the path constraints of all motions, and where each motion begins, shape (dof,)."""
    found: list[tuple[HeldRegion, Vector]] = []
    for path, world, stage in zip(plan.paths, plan.worlds, plan.stages, strict=True):
        if isinstance(stage, MoveTo):
            held = held_regions(world.robot, world.scene, stage.constraints, path.start)
            found += [(region, path.start) for region in held.regions]
    return tuple(found)


def _timed(plan: TaskPlan) -> list[tuple[int, Vector, float]]:
    """Number of the motion, configuration and share of the rest before the next motion that is over, tick after tick.

    A motion that leads nowhere has a tick too.

    Raises:
        InputError: If there is no motion.
    """
    if not plan.paths:
        raise InputError("task plan to show: it has no motion" + (f": {plan.reason}" if plan.reason else ""))
    if not any(path.length > 0.0 for path in plan.paths):
        return [(number, path.start, 0.0) for number, path in enumerate(plan.paths)]
    timed = time_task(plan)
    clock, states = timed.trajectory.sampled(RATE)
    numbers = np.searchsorted(timed.begins, clock, side="right") - 1
    missing = np.setdiff1d(np.arange(len(plan.paths)), numbers).tolist()  # what leads nowhere takes no time
    rests = [_share_of_rest(timed.pauses, time) for time in clock.tolist()]
    rows = [*zip(numbers.tolist(), states.positions, rests, strict=True)]
    rows += [(k, plan.paths[k].start, 0.0) for k in missing]
    return [(number, frozen(q), share) for number, q, share in sorted(rows, key=lambda row: row[0])]


def _share_of_rest(pauses: Matrix, time: float) -> float:
    """How much is over of the rest, of some rests (begin, end), in which a time lies; 0 between them."""
    resting = pauses[(pauses[:, 0] < time) & (time < pauses[:, 1])]
    return float((time - resting[0, 0]) / (resting[0, 1] - resting[0, 0])) if len(resting) else 0.0


def _places(world: World, q: Vector) -> dict[str, pin.SE3]:
    """Where obstacles and what is held are."""
    places = {item.name: world.robot.fk(q, item.link) * item.pose for item in world.scene.attached}
    return places | {item.name: item.pose for item in world.scene.at(0.0).obstacles}
