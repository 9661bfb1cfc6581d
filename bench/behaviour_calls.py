"""Cases of ``bench/behaviour.py``: inverse kinematics, replanning, checks and reach maps.

Every case ends by its own criterion long before its time limit, so the load of the machine does not matter.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from bench.behaviour_paths import plan_of
from bench.behaviour_problems import LONG, MADE, Cases, Result, draws, goal_of, problem_of, robot_of, surroundings

SLOW_ALL = ("ccd", "pso", "pso-resampled", "pinocchio", "projection")  # seconds for all solutions of one goal


def ik_case(name: str, method: Any, kind: str, scene: bool = False, **options: Any) -> Result:
    robot = robot_of(name)
    world = problem_of(f"made_{name}").world if scene else None
    options = {"near": draws(robot, 1, 8)[0], **options}
    found = rrtik.solve_ik(robot, goal_of(kind, robot), method=method, world=world, seconds=LONG, seed=1, **options)
    return f"{len(found.solutions)} {found.reason} {found.iterations}", [found.solutions, found.residuals]


def batch_case(name: str, scene: bool) -> Result:
    robot = robot_of(name)
    world = problem_of(f"made_{name}").world if scene else None
    found = rrtik.solve_ik_many(robot, robot.fk_batch(draws(robot, 40, 6)), world=world, seconds=LONG, seed=1)
    return f"{found.found.sum()} {sorted(set(found.reasons))}", [found.q, found.found, found.residuals]


def track_case(name: str, method: Any, points: bool = False, **options: Any) -> Result:
    robot = robot_of(name)
    start = 0.5 * draws(robot, 1, 9)[0]
    poses = robot.fk_batch(start + np.linspace(0.0, 0.4, 20)[:, None])
    poses = poses[:, :3, 3] if points else poses
    found = rrtik.ik.solve_trajectory(robot, poses, method=method, near=start, seconds=LONG, seed=1, **options)
    return f"{sorted(set(found.reasons))} {found.jumps} {found.iterations}", [found.q, found.residuals]


def inverse_kinematics() -> Cases:
    method: Any
    calls: list[tuple[Any, ...]] = [("titan4", "closed-form", "position", {})]  # an error
    for method in rrtik.ik.list_methods():
        kinds = ("pose",) if method == "closed-form" else ("position",) if method == "fabrik" else ("pose", "position")
        arms = ("titan4", "puma560", "planar3") if method == "closed-form" else ("titan4", "puma560", "ur5", "panda")
        calls += [(name, method, kind, {}) for name in arms for kind in kinds]
        calls += [(name, method, kind, {"all": True}) for name in arms[:3] for kind in kinds if method not in SLOW_ALL]
    calls += [(arm, m, "pose", {"scene": True}) for arm in ("ur5", "panda") for m in ("numeric", "mb-rrt", "damped")]
    calls += [("titan4", m, "far", {}) for m in ("closed-form", "numeric", "mb-rrt")]
    calls += [(arm, m, "region", {}) for arm in ("titan4", "ur5") for m in ("auto", "numeric", "projection")]
    calls += [(arm, m, "set", {}) for arm in ("titan4", "ur5") for m in ("auto", "numeric", "genetic")]
    for name, method, kind, options in calls:
        yield f"ik {name} {method} {kind} {' '.join(options)}".strip(), partial(ik_case, name, method, kind, **options)
    for name, scene in (("titan4", False), ("puma560", False), ("ur5", True), ("panda", True), ("xarm7", False)):
        yield f"ik batch {name}", partial(batch_case, name, scene)
    tracks = [(name, "auto") for name in ("titan4", "puma560", "ur5", "panda")]
    for name, method in (*tracks, ("titan4", "genetic"), ("puma560", "genetic")):
        yield f"track {name} {method}", partial(track_case, name, method)
    yield "track titan4 points", partial(track_case, "titan4", "auto", points=True)
    yield "track ur5 free axis", partial(track_case, "ur5", "numeric", free_rotation_axis="z")


def run_case(run: Any) -> Result:
    events = [f"{run.count(e)}" for e in ("walk", "plan", "repair", "wait", "evade")]
    paths = [tick.path for tick in run.ticks if tick.path is not None]
    checked = np.array([tick.checked for tick in run.ticks])
    poses = [p for tick in run.ticks for _, p in sorted(tick.poses.items())]
    return f"{run.outcome} {' '.join(events)}", [run.configurations, run.times, checked, *paths, *poses]


def scenario_case(name: str, **options: Any) -> Result:
    return run_case(rrtik.replanning.Scenario.load(name).run(repair_budget=LONG, **options))


def feed_case(kind: str) -> Result:
    """Replanning of a UR5 whose surroundings come as motions, as a function of time, or with a goal that moves."""
    problem, scene = problem_of("made_ur5"), surroundings(robot_of("ur5"))
    first, *others = scene.obstacles
    there = rrtik.pose(first.pose.translation + np.array([0.1, 0.1, 0.0]))
    motion = (
        rrtik.replanning.TimedPoses([0.0, 2.0], [first.pose, there])
        if kind == "poses"
        else rrtik.replanning.ConstantVelocity([0.05, 0.02, 0.0])
    )
    moved = rrtik.Scene((rrtik.Obstacle(first.name, first.shape, first.pose, motion), *others))
    feed: Any = (lambda t: moved.at(min(t, 1.0))) if kind in ("function", "goal") else moved
    goal = (lambda t: problem.goal.q - 0.02 * min(t, 1.0)) if kind == "goal" else None
    options: dict[str, Any] = {"step": 0.05, "rate": 20, "seconds": 10, "seed": 2, "max_edge": 1.0}
    return run_case(rrtik.replan(problem, feed, goal_feed=goal, repair_budget=LONG, **options))


def replans() -> Cases:
    for name in ("replan_planar_arm", "replan_pockets", "replan_triangles", "replan_ur5", "replan_walls"):
        for seed, planner in ((0, "drrt-con"), (1, "drrt-con"), (0, "drrt"), (2, "rrt-connect")):
            yield f"replan {name} {planner} {seed}", partial(scenario_case, name, seed=seed, planner=planner)
        yield f"replan {name} ahead", partial(scenario_case, name, seed=3, lookahead_ticks=4)
    yield "replan replan_titan4", partial(scenario_case, "replan_titan4", seed=0)
    for kind in ("poses", "velocity", "function", "goal"):
        yield f"replan feed {kind}", partial(feed_case, kind)


def check_case(name: str) -> Result:
    """Checks of random configurations, of those near a path, and of motions; clearances; forward kinematics."""
    problem = problem_of(name)
    world, path = problem.world, plan_of(name, "RRTConnect", 3 if name.startswith("made_") else 1).path
    rng, random = np.random.default_rng(5), draws(problem.robot, 3000, 4)
    along = path.waypoints[rng.integers(len(path.waypoints), size=3000)]
    near = np.clip(along + rng.normal(scale=0.1, size=along.shape), problem.robot.lower, problem.robot.upper)
    answers = [world.valid_batch(random), world.valid_batch(near), world.certify(near[:500])]
    motions = [
        world.motion_valid_batch(random[:300], random[300:600]),
        world.motion_valid_batch(near[:999], along[:999]),
    ]
    clearances = np.array([world.clearance(q) for q in near[:20]])
    flags = " ".join(str(int(mask.sum())) for mask in (*answers, *motions))
    return flags, [*answers, *motions, clearances, problem.robot.fk_batch(random)]


def reach_case(name: str, **options: Any) -> Result:
    found = rrtik.ik.reach_map(robot_of(name), samples=20000, seed=1, **options)
    return f"{int(found.reached.sum())}", [found.values]


def others() -> Cases:
    shipped = ("cut_disc", "planar6_c", "puma_pose", "titan4_bar", "titan4_sdu", "replan_titan4")
    for name in (*shipped, *(f"made_{robot}" for robot in MADE)):
        yield f"checks {name}", partial(check_case, name)
    for name in ("titan4", "ur5"):
        yield f"reach {name}", partial(reach_case, name)
