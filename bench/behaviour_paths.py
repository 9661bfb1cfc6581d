"""Cases of ``bench/behaviour.py``: plans, shortened paths and trajectories.

Every case ends by its own criterion long before its time limit, so the load of the machine does not matter. Planners
that work until a clock stops them are left out: PRM, PRMstar and those that go on improving their path.
"""

from __future__ import annotations

import json
from functools import cache, partial
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og

import rrtik_ompl as rrtik
import rrtik_planners
from bench.behaviour_problems import LONG, MADE, Cases, Result, problem_of

OWN = ("bicrdt", "crdt", "fastrrtconnect", "mbrrt", "drrt-con", "ikurt")
WHEEL = ("RRTConnect", "RRT", "KPIECE1", "BKPIECE1", "LBKPIECE1", "FMT", "BFMT")
METHODS = ("axis", "axis-rounds", "sequential", "random", "shortcut", "retraction", "corners", "ompl", "auto")
FEW = ("cut_two_ls", "planar3_boxes", "puma_pose", "titan4_bar", "titan4_sdu")
OPTIONS = (
    ("bicrdt", {"frozen_joints": [5]}),
    ("bicrdt", {"last_joints": [3]}),
    ("bicrdt", {"joint_costs": [3, 1, 1, 1, 1, 2]}),
    ("crdt", {"smallest_move": 0.02}),
    ("fewest-moves", {"smallest_move": 0.0087, "rounds": 3}),
    ("fastrrtconnect", {"range": 0.3}),
    ("fastrrtconnect", {"domain": 0.5}),
    ("drrt-con", {"range": 0.5}),
    ("mbrrt", {"scale_by_range": True}),
    ("ikurt", {"jacobian": False}),
    ("RRTConnect", {"range": 0.3}),
)


@cache
def plan_of(name: str, planner: Any, seed: int = 1, options: str = "{}", **more: Any) -> Any:
    chosen = json.loads(options) | ({"ik_seconds": LONG} if planner == "mbrrt" else {})
    return rrtik.plan(problem_of(name), planner, seconds=LONG, seed=seed, parameters=chosen, **more, shorten=False)


def plan_case(*given: Any, **more: Any) -> Result:
    plan = plan_of(*given, **more)
    counts = [plan.statistics.get(key, "-") for key in ("attempts", "rejected", "iterations", "vertices")]
    flags = f"{'found' if plan.found else 'not found'} {' '.join(map(str, counts))}"
    return flags, [plan.path.waypoints, plan.path.transitions] if plan.found else []


def plans() -> Cases:
    shipped = rrtik.list_problems()
    chosen = [(name, planner, 1) for name in shipped for planner in OWN]
    chosen += [(name, planner, 2) for name in ("titan4_sdu", "replan_ur5", "planar3_b") for planner in OWN]
    chosen += [(f"made_{robot}", planner, 3) for robot in MADE for planner in (*OWN[:4], "RRTConnect")]
    chosen += [(name, "fewest-moves", 1) for name in (*FEW, "planar3_c", "replan_pockets", "replan_titan4", "env_e")]
    ends_soon = ("env_e", "planar3_c", "planar6_c", "replan_ur5", "puma_position")  # elsewhere only its time ends it
    chosen += [(name, "ikurt-published", 1) for name in ends_soon]
    chosen += [(name, planner, 1) for name in FEW for planner in WHEEL]
    for given in chosen:
        yield f"plan {' '.join(map(str, given))}", partial(plan_case, *given)
    for planner, options in OPTIONS:
        yield f"plan titan4_sdu {planner} {options}", partial(plan_case, "titan4_sdu", planner, 1, json.dumps(options))
    for planner in ("bicrdt", "crdt", "fastrrtconnect", "mbrrt"):
        few_draws = partial(plan_case, "cut_disc", planner, 1, '{"max_iterations": 5}', restarts=1)
        yield f"plan cut_disc {planner} few draws", few_draws
        proven = partial(plan_case, "titan4_prisms", planner, accuracy="conservative")
        yield f"plan titan4_prisms {planner} conservative", proven


def plain_case(planner: str) -> Result:
    """A planner of ours in plain OMPL, with a checker in Python, so that nothing runs in a world's kernels."""
    space, bounds = ob.RealVectorStateSpace(3), ob.RealVectorBounds(3)
    bounds.setLow(-2.0)
    bounds.setHigh(2.0)
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: bool(abs(state[0]) > 0.4 or abs(state[1] - 0.3 * state[2]) > 0.5))
    setup.getSpaceInformation().setStateValidityCheckingResolution(0.01)
    start, goal = space.allocState(), space.allocState()
    for k in range(3):
        start[k], goal[k] = (-1.0, 0.1, 0.2)[k], (1.0, -0.1, -0.3)[k]
    setup.setStartAndGoalStates(start, goal)
    setup.setPlanner(getattr(rrtik_planners, planner)(setup.getSpaceInformation(), seed=4))
    solved = setup.solve(LONG)
    path = setup.getSolutionPath()
    rows = [[path.getState(i)[k] for k in range(3)] for i in range(path.getStateCount())]
    return f"{'found' if solved else 'not found'} {len(rows)}", [np.array(rows)]


def plain() -> Cases:
    for planner in rrtik_planners.__all__:
        yield f"plain OMPL {planner}", partial(plain_case, planner)


def shorten_case(name: str, planner: str, method: Any, **options: Any) -> Result:
    path = rrtik.shorten(plan_of(name, planner).path, problem_of(name), method=method, seed=1, **options)
    return f"{len(path.waypoints)}", [path.waypoints, np.array([path.length])]


def rules_case(method: Any) -> Result:
    rules = rrtik.MoveRules(problem_of("titan4_sdu").robot.joint_names, joint_costs=[2, 1, 1, 1, 1, 1], last_joints=[0])
    plan = plan_of("titan4_sdu", "bicrdt", 1, '{"last_joints": [0]}')
    path = rrtik.shorten(plan.path, problem_of("titan4_sdu"), method=method, seed=1, rules=rules)
    return f"{len(path.waypoints)}", [path.waypoints]


def staircase_case(name: str) -> Result:
    path = rrtik.one_joint_moves(plan_of(name, "RRTConnect").path, problem_of(name))
    return f"{len(path.waypoints)}", [path.waypoints]


def shortenings() -> Cases:
    for name in ("cut_disc", "planar3_b", "replan_ur5", "titan4_bar", "titan4_sdu"):
        for method in METHODS:
            yield f"shorten {name} RRTConnect {method}", partial(shorten_case, name, "RRTConnect", method)
        for method in ("axis", "axis-rounds", "fewest-moves", "sequential", "random", "shortcut", "retraction", "auto"):
            case = partial(shorten_case, name, "bicrdt", method, one_joint=True)
            yield f"shorten {name} bicrdt {method} one joint", case
        yield f"staircase {name}", partial(staircase_case, name)
    for method in ("axis", "axis-rounds", "fewest-moves", "retraction", "auto"):
        yield f"shorten titan4_sdu rules {method}", partial(rules_case, method)


def timed_case(name: str, planner: str, share: float, blend: float) -> Result:
    problem = problem_of(name)
    limits = rrtik.RateLimits.of(problem.robot, share=share)
    options = {"blend": blend, "world": problem.world} if blend else {}
    motion = rrtik.time_parameterize(plan_of(name, planner).path, limits, **options)
    sampled = [motion(t) for t in np.linspace(0.0, motion.duration, 9)]
    arrays = [motion.times, motion.positions, motion.velocities, motion.accelerations]
    return f"{len(motion.times)}", [*arrays, *(s.positions for s in sampled), *(s.velocities for s in sampled)]


def trajectories() -> Cases:
    for name in ("planar3_b", "puma_pose", "replan_ur5", "titan4_sdu", "made_panda"):
        for planner, share, blend in (("RRTConnect", 1.0, 0.0), ("bicrdt", 0.5, 0.0), ("RRTConnect", 1.0, 0.2)):
            yield f"timed {name} {planner} {share} {blend}", partial(timed_case, name, planner, share, blend)
