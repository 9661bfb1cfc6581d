"""Measurements of the pilot's routes: how soon, how many moves, which errors they forgive, how a pilot fares."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import rrtik_ompl as rrtik
from bench.pilot.hands import follow_route
from bench.pilot.scene import NAME, PROBLEM, ROBOT, WORLD, green_grasps
from bench.shared.problems import goal_joints
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.pilot.devices.arm import joint_rates
from rrtik_ompl.pilot.devices.wrong_arm import Faults, WrongArm
from rrtik_ompl.pilot.routes.route import Route, route_to
from rrtik_ompl.pilot.routes.route_search import MIN_ROBUSTNESS, NoRoute, executions, free_rows
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.setup import SessionOptions, open_session

REACTION_SECONDS, OVERSHOOT, REPLANNING = 0.3, np.deg2rad(1.0), 2.0


class PanelRoutes(NamedTuple):
    """Routes of the panel scene, and clock and processor seconds from the command to the list of moves."""

    found: list[Route]
    clock: list[float]
    processor: list[float]


def panel_routes(count: int) -> PanelRoutes:
    """Plan to the green grasps in turn, from where the session starts; the first plan warms up."""
    engine = open_session(SessionOptions(NAME)).engine
    for k in range(5):
        engine.update(k / 30.0)
    session, found = engine.session, PanelRoutes([], [], [])
    green = green_grasps(session)
    for number in range(count + 1):
        kind, level = green[number % len(green)]
        session.means = replace(session.means, seed=number)
        session.command("grasp", session.time, type=kind, level=level)
        clock, processor = time.perf_counter(), time.process_time()
        session.command("plan", session.time)
        if number == 0:
            continue
        found.clock.append(time.perf_counter() - clock)
        found.processor.append(time.process_time() - processor)
        if session.route is not None:
            found.found.append(session.route)
    return found


def small_errors(count: int) -> tuple[list[float], int]:
    """Routes between random free postures: which share of executions with errors is free; how many are warned of."""
    free: list[float] = []
    rng, warned = np.random.default_rng(1), 0
    while len(free) + warned < count:
        ends = rng.uniform(ROBOT.lower, ROBOT.upper, (2, ROBOT.dof))
        if not WORLD.valid_batch(ends).all():
            continue
        route = route_to(WORLD, ends[0], ends[1], joint_rates(ROBOT), seed=len(free) + warned)
        if isinstance(route, NoRoute):
            continue
        if route.robustness < MIN_ROBUSTNESS:
            warned += 1
            continue
        made = executions(route.path, np.full(ROBOT.dof, OVERSHOOT), 1000, rng)
        free.append(float(free_rows(WORLD, made).mean()))
    return free, warned


class Piloted(NamedTuple):
    """Means over executions: seconds, and the share that touches something."""

    seconds: float
    touching: float


class SimulatedPilot(NamedTuple):
    """The same hands with the tool, with its bare list, and with a multi-joint route joint by joint."""

    tool: Piloted
    plans: float
    executions: int
    bare: Piloted
    naive: Piloted
    routes: int


def simulated_pilot(count: int) -> SimulatedPilot:
    """From the bay to the button, in all three ways."""
    rng, rates, rows = np.random.default_rng(3), joint_rates(ROBOT), []
    for seed in range(count):
        route = route_to(WORLD, np.array(PROBLEM.start), np.array(goal_joints(PROBLEM)), rates, seed)
        several = rrtik.plan(PROBLEM, "RRTConnect", seconds=5.0, seed=seed, shorten=False).path
        if isinstance(route, NoRoute) or several is None:
            continue
        rows.append([*_piloted(route.path, rates, rng), *_piloted(_naive(several), rates, rng)])
    bare_time, bare_hits, naive_time, naive_hits = (float(mean) for mean in np.mean(rows, axis=0))
    guided = np.array([_guided(seed, rates, rng) for seed in range(2 * count)])
    tool_time, tool_hits, plans = (float(mean) for mean in guided.mean(axis=0))
    bare, naive = Piloted(bare_time, bare_hits), Piloted(naive_time, naive_hits)
    return SimulatedPilot(Piloted(tool_time, tool_hits), plans, len(guided), bare, naive, len(rows))


def _guided(seed: int, rates: Any, rng: np.random.Generator) -> tuple[float, float, float]:
    """One execution with the tool: seconds, whether something was touched, and how often a route was planned anew.

    The pilot holds each move; every second press is let go a degree early, and the arm goes on by some error.
    """
    faults = Faults(overshoot=abs(rng.normal(0.0, OVERSHOOT, ROBOT.dof)))
    arm = WrongArm(ROBOT, PROBLEM.start, faults, rates)
    session = Session(PROBLEM, arm, seed=seed, past=True)
    made = follow_route(session, arm, hasty=True)
    touched = not WORLD.motion_valid_batch(made.rows[:-1], made.rows[1:]).all()
    seconds = made.moving + REACTION_SECONDS * made.presses + REPLANNING * made.plans
    return (seconds if session.message.startswith("all moves are") else np.inf), float(touched), float(made.plans)


def _naive(path: JointPath) -> JointPath:
    """Each edge of a multi-joint route as moves of joint 1, joint 2, and so on."""
    rows = [path.waypoints[0]]
    for goal in path.waypoints[1:]:
        for joint in range(path.waypoints.shape[1]):
            row = rows[-1].copy()
            row[joint] = goal[joint]
            if abs(row[joint] - rows[-1][joint]) > 1e-9:
                rows.append(row)
    return path.with_waypoints(np.array(rows))


def _piloted(path: JointPath, rates: Any, rng: np.random.Generator) -> tuple[float, float]:
    """Seconds that an execution takes, and the share of executions that touch something."""
    names, moves = list(path.joint_names), path.moves()
    seconds = sum(REACTION_SECONDS + abs(move.change) / rates[names.index(move.joint)] for move in moves)
    made = np.tile(path.start, (100, len(moves) + 1, 1))
    for number, move in enumerate(moves, start=1):
        made[:, number:, names.index(move.joint)] = move.end + rng.normal(0.0, OVERSHOOT, (100, 1))
    return seconds, 1.0 - float(free_rows(WORLD, made).mean())
