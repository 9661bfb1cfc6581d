"""Measurements of a pilot's session without a page: its states and record, its lamps, what it refuses."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from bench.pilot.scene import NAME, PLACE, PROBLEM, ROBOT, VALVE, WORLD, seen_at
from rrtik_ompl.ik.analytic.closed_form import solutions
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED, lamps, stage_poses
from rrtik_ompl.pilot.routes.manoeuvre import check_move
from rrtik_ompl.pilot.routes.route import Route, propose
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.surroundings import Surroundings

JUDGED, LOOKED_AT, LOOKS = 1000, 500, 25


def scripted_scenario() -> tuple[list[str], bool]:
    """From the first picture to the grasp by commands alone: the states visited, and whether a replay ends alike."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "session.jsonl"
        first, modes = _drive(file)
        again = open_session(SessionOptions(NAME, replay=file)).engine
        again.update(1e6)
        again.update(1e6 + 1.0)  # as a page does over and over: what was held at the end is over by then
        return modes, np.array_equal(again.session.q, first) and again.session.mode == "manoeuvre"


def _drive(record: Path) -> tuple[Any, list[str]]:
    opened = open_session(SessionOptions(NAME, record=record))
    engine, now, modes = opened.engine, 0.0, ["manoeuvre"]
    session = engine.session
    engine.update(now)
    for command in ({"name": "grasp", "type": "aslant", "level": 1}, {"name": "plan"}, {"name": "accept"}):
        now += 0.1
        engine.execute(command, now)
        modes.append(session.mode)
    press = 0
    while session.mode == "following" and now < 600.0:
        press += session.state.press.over  # a press makes one move
        engine.execute({"name": "next", "press": press}, now)
        now += 0.03
        engine.update(now)
    q = session.q
    opened.close()
    return q, list(dict.fromkeys(modes))


class Lamps(NamedTuple):
    """Lamps of random object poses: how many of each colour, and of each how many lead to a route.

    Attributes:
        colors: How many of each.
        planned: How many of each lead to a route.
        wrong: Red ones of a grasp that has a branch inside the limits, and others of one that has none.
        offset: Farthest end of a route from its grasp [m].
        turn: Largest angle between them [rad].
    """

    colors: dict[str, int]
    planned: dict[str, int]
    wrong: int
    offset: float
    turn: float


def color_logic(count: int) -> Lamps:
    """Every lamp of random object poses against all branches of the closed form, and against the search for a route."""
    rng, wrong, offset, turn = np.random.default_rng(0), 0, 0.0, 0.0
    colors, planned = ({GREEN: 0, AMBER: 0, RED: 0} for _ in range(2))
    surroundings, start = Surroundings(WORLD), np.array(PROBLEM.start)
    for _ in range(count):
        T = pin.SE3(pin.exp3(rng.normal(0.0, 0.5, 3)) @ PLACE.rotation, rng.uniform([0.9, -0.6, -0.2], [1.6, 0.8, 0.8]))
        surroundings = surroundings.see([seen_at(T)])
        for lamp in lamps(surroundings.world, VALVE, T, start, holding=surroundings.holding("valve")):
            grasp = stage_poses(T, VALVE.grasp(lamp.type), lamp.level)[1]
            wrong += (lamp.color == RED) != (not solutions(ROBOT, grasp.homogeneous[None]).valid.any())
            colors[lamp.color] += 1
            route = propose(PROBLEM, surroundings, "valve", lamp, start, joint_rates(ROBOT), seed=1)
            if isinstance(route, Route):
                planned[lamp.color] += 1
                off = grasp.actInv(ROBOT.fk(route.path.end))
                offset = max(offset, float(np.linalg.norm(off.translation)))
                turn = max(turn, float(np.linalg.norm(pin.log3(off.rotation))))
    return Lamps(colors, planned, wrong, offset, turn)


class Preventive(NamedTuple):
    """Random commands, and what a second look says of those that were accepted."""

    commands: int
    accepted: int
    judged: int
    agree: bool
    looks: int
    bad: int


def preventive_checks(count: int) -> Preventive:
    """Random commands of one joint from random free postures; what is accepted is looked at a second time."""
    rng = np.random.default_rng(2)
    starts, ends, joints = _random_commands(count, rng)
    accepted = ROBOT.within_limits(ends)
    accepted[accepted] = WORLD.motion_valid_batch(starts[accepted], ends[accepted])
    some = rng.choice(len(starts), size=min(JUDGED, len(starts)), replace=False)
    verdicts = [check_move(WORLD, starts[k], int(joints[k]), float(ends[k, joints[k]])).allowed for k in some]
    agree = bool((np.array(verdicts) == accepted[some]).all())
    beyond = int((~ROBOT.within_limits(ends[accepted])).sum())
    fine = WORLD.with_resolution(WORLD.motion_resolution / 4.0).motion_valid_batch(starts[accepted], ends[accepted])
    chosen = rng.choice(np.flatnonzero(accepted), size=min(LOOKED_AT, int(accepted.sum())), replace=False)
    share = np.linspace(0.0, 1.0, LOOKS)[:, None, None]
    looks = (starts[chosen] + share * (ends[chosen] - starts[chosen])).reshape(-1, ROBOT.dof)
    bad = beyond + int((~fine).sum()) + int((~WORLD.certify(looks)).sum())
    return Preventive(len(starts), int(accepted.sum()), len(some), agree, len(looks), bad)


def _random_commands(count: int, rng: np.random.Generator) -> tuple[Any, Any, Any]:
    """Free postures, the same with one joint elsewhere, also beyond its limits, and the numbers of these joints."""
    starts = rng.uniform(ROBOT.lower, ROBOT.upper, (4 * count, ROBOT.dof))
    starts = starts[WORLD.valid_batch(starts)][:count]
    ends, joints = starts.copy(), rng.integers(ROBOT.dof, size=len(starts))
    width, middle = 1.2 * (ROBOT.upper - ROBOT.lower), 0.5 * (ROBOT.upper + ROBOT.lower)
    rows = np.arange(len(ends))
    ends[rows, joints] = (middle + rng.uniform(-0.5, 0.5, ends.shape) * width)[rows, joints]
    return starts, ends, joints
