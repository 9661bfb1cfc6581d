"""Prepare the plan of a task for a picture: timed, tick by tick, with the verdict on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector, frozen
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.model.judgement import Judged, PathContact, Verdict
from rrtik_ompl.tasks import MoveTo, TaskPlan
from rrtik_ompl.tasks.setting import world_of_motion
from rrtik_ompl.tasks.timed import TimedTask
from rrtik_ompl.world.judgement import contacts_at
from rrtik_ompl.world.route_check import as_it_stands
from rrtik_ompl.world.world import World

RATE = 25.0  # ticks per second


@dataclass(frozen=True, slots=True, eq=False)
class PlayedTask:
    """A plan over time, as :meth:`TaskPlan.time_parameterize` times it: at the robot's limits, with rests.

    Attributes:
        plan: The plan; each of its motions has at least one tick.
        rate: Ticks per second.
        motions: Index of the motion of each tick, shape (ticks,).
        waypoints: Configuration at each tick, shape (ticks, dof).
        rests: How far the fingers have come in the rest before the next motion at each tick, from 0 to 1, shape
            (ticks,).
        judged: The verdict, by the ticks.
        held: The regions of path constraints, each with the configuration at which its motion begins, shape (dof,).
    """

    plan: TaskPlan
    rate: float
    motions: NDArray[np.int64]
    waypoints: Matrix
    rests: Vector
    judged: Judged
    held: tuple[tuple[HeldRegion, Vector], ...]


def played_task(plan: TaskPlan) -> PlayedTask:
    """Return a plan as it is played; see :meth:`TaskPlan.played`."""
    if not plan.paths:
        raise InputError("task plan to show: it has no motion" + (f": {plan.reason}" if plan.reason else ""))
    motions, rows, rests = _ticks(plan)
    return PlayedTask(plan, RATE, motions, frozen(rows), frozen(rests), _judged(plan, motions, rows), _held(plan))


def _ticks(plan: TaskPlan) -> tuple[NDArray[np.int64], Matrix, Vector]:
    """Return the ticks of a plan.

    A motion that leads nowhere takes no time, but has a tick too.

    Returns:
        For each tick the index of its motion, shape (ticks,); its configuration, shape (ticks, dof); and how far the
        fingers have come in a rest, shape (ticks,).
    """
    numbers = np.arange(len(plan.paths))
    starts = np.array([path.start for path in plan.paths])
    if not any(path.length > 0.0 for path in plan.paths):
        return numbers, starts, np.zeros(len(numbers))

    timed = plan.time_parameterize()
    samples = timed.trajectory.sample(RATE)
    motions = np.searchsorted(timed.begins, samples.times, side="right") - 1
    rests = np.array([_share_of_rest(timed, time) for time in samples.times.tolist()])

    motions_without_tick = np.setdiff1d(numbers, motions)
    motions = np.append(motions, motions_without_tick)
    rows = np.vstack([samples, starts[motions_without_tick]])
    rests = np.append(rests, np.zeros(len(motions_without_tick)))
    order = np.argsort(motions, kind="stable")
    return motions[order], rows[order], rests[order]


def _share_of_rest(timed: TimedTask, time: float) -> float:
    """Return how far the fingers have come in the rest in which a time lies, from 0 to 1; 0 outside of the rests."""
    begins, ends = timed.pauses.T
    # At its end the next motion begins, unless there is none.
    resting = timed.pauses[(begins < time) & ((time < ends) | (ends > timed.begins[-1]))]
    if not len(resting):
        return 0.0
    begin, end = resting[0]
    seconds = next((event.seconds for event in timed.trajectory.gripper if event.time == begin), end - begin)
    return float(min((time - begin) / seconds, 1.0)) if seconds else 1.0


def _judged(plan: TaskPlan, motions: NDArray[np.int64], rows: Matrix) -> Judged:
    """Return the verdict on a plan, by its ticks."""
    faults = plan.faults()
    parts = zip(plan.paths, plan.worlds, plan.stages, strict=True)
    worlds = [world_of_motion(path, world, stage) for path, world, stage in parts]
    proofs = zip(plan.paths, worlds, strict=True)
    proven = [path.proven if path.proof is not None else path.proved(world).proven for path, world in proofs]
    doubtful = [k for k, fine in enumerate(proven) if not fine or faults[k]]
    unproven = tuple(np.flatnonzero(np.isin(motions[:-1], doubtful)).tolist())

    if doubtful:
        summary = f"{len(doubtful)} of {len(proven)} motions not proven free"
        text = next((f"; motion {k + 1}: {found[0].reason}" for k, found in enumerate(faults) if found), "")
    else:
        summary = ""
        text = "every motion is proven free" + (", on the contacts that it stands on" if any(plan.contacts) else "")
    text += as_it_stands(plan.worlds[0].scene)

    contacts: list[PathContact] = []
    for k in doubtful:
        ticks = np.flatnonzero(motions == k)
        contacts += _contacts(worlds[k], ticks, rows[ticks], [fault.q for fault in faults[k]])
    return Judged(Verdict(not doubtful, text, unproven, summary), None, tuple(contacts))


def _contacts(world: World, ticks: NDArray[np.int64], rows: Matrix, faults: list[Vector]) -> Iterator[PathContact]:
    """Yield what touches in the ticks of a motion, and at its faults, each fault at the nearest tick."""
    yield from contacts_at(world.checks, ticks.astype(np.float64), rows)
    for q in faults:
        tick = float(ticks[np.abs(rows - q).sum(axis=1).argmin()])
        for contact in contacts_at(world.checks, np.array([tick]), q[None]):
            yield replace(contact, end=tick + 1.0)


def _held(plan: TaskPlan) -> tuple[tuple[HeldRegion, Vector], ...]:
    """Return the regions of all motions' path constraints, each with the configuration at which its motion begins."""
    regions_of_motions: list[tuple[HeldRegion, Vector]] = []
    for path, world, stage in zip(plan.paths, plan.worlds, plan.stages, strict=True):
        if isinstance(stage, MoveTo):
            constraints = held_regions(world.robot, world.scene, stage.constraints, path.start)
            regions_of_motions += [(region, path.start) for region in constraints.regions]
    return tuple(regions_of_motions)
