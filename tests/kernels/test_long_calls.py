"""No call of a kernel lasts long, as Ctrl-C and ``stop=`` wait for its end; each kernel is among those named here."""

import re
import time
from functools import partial

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.simd.code_files import kernel_modules, source_text
from rrtik_ompl.kernels.simd.library import library

LONGEST = 0.05  # [s] of processor time

# What bounds a call of each kernel.
RESUMED = {  # a budget of work; whoever calls it looks at the clock in between
    "search.connect_kernels": ("solve", "resume", "solve_each"),
    "search.constrained.kernels": ("solve", "resume"),
    "search.contacts.kernels": ("pull",),
    "search.crdt.kernels": ("resume_pair", "resume_single"),
    "search.repair_kernels": ("check_path", "repair_path"),
    "search.roadmap.kernels": ("seed_samples", "grow", "connect", "check_edges", "search_on", "learn"),
    "search.short.kernels": ("find", "finish", "answer_each"),
    "search.shortcut_kernels": ("resume",),
    "ik.rail_kernels": ("follow",),
}
IN_BLOCKS = {  # the number of rows, which come in blocks
    "checks.check_kernels": ("classify", "classify_edges", "mark_pairs"),
    "checks.distance_kernels": ("measure",),
    "distances.kernels": ("measure",),
    "ik.branch_kernels": ("parallel_axes", "parallel_arm", "ball_arm"),
    "ik.ik_kernels": ("walk", "solve"),
    "proof.proof_kernels": ("prove",),
    "search.constrained.kernels": ("project_rows",),
    "search.motions.edge_kernels": ("prove_edges",),
    "search.motions.proven_kernels": ("judge",),
    "timing.run_kernels": ("sample_cubics",),
}
ONE_THING = {  # one pose, one picture, one query, one path, or one solid whose cover is made once
    "clouds.picture_kernels": ("find_cells",),
    "covers.cell_kernels": ("cut_at_planes", "merge", "winding_numbers"),
    "covers.cut_kernels": ("hull_volume_of", "cut_volumes"),
    "covers.point_kernels": ("farthest_points", "farthest_beyond", "distances", "inside", "choose_balls"),
    "covers.search_kernels": ("reach_table", "greedy_cover", "nearest_of_each", "recentre"),
    "ik.ik_kernels": ("choose_apart",),
    "ik.near_kernels": ("walk_near", "turn_near", "choose_near"),
    "ik.pose_kernels": ("nearest_branch", "all_branches", "walk_to_pose"),
    "search.connect_kernels": ("keep_path", "rows_free"),
    "search.constrained.kernels": ("reject", "connect"),
    "search.motions.edge_kernels": ("check_state",),
    "search.repair_kernels": ("finish",),
    "search.roadmap.kernels": ("insert", "doubt", "pose", "forget_query", "begin", "answer"),
    "timing.kernels": ("sample_curve", "find_squares"),
    "timing.run_kernels": ("time_run", "time_lines", "find_peaks", "find_pushes"),
}


def test_of_every_kernel_it_is_said_what_bounds_a_call():
    said = [f"{module}.{name}" for kind in (RESUMED, IN_BLOCKS, ONE_THING) for module in kind for name in kind[module]]
    there = [
        f"{module}.{name}"
        for module in kernel_modules()
        for name in re.findall(r"@entry\ndef (\w+)", source_text(module))
    ]
    assert sorted(said) == sorted(there)


@pytest.fixture
def longest(monkeypatch):
    """The longest call of each kernel, by its name [s]."""
    seconds = {}

    def timed(name, kernel, *numbers):
        begin = time.thread_time()
        answer = kernel(*numbers)
        seconds[name] = max(seconds.get(name, 0.0), time.thread_time() - begin)
        return answer

    for module in {**RESUMED, **IN_BLOCKS}:
        loaded = library(module)
        for name, kernel in list(vars(loaded).items()):
            monkeypatch.setattr(loaded, name, partial(timed, f"{module}.{name}", kernel))
    return seconds


@pytest.fixture(scope="module")
def hard():
    """A problem that takes long: the arm has to go round a wall."""
    robot = rrtik.load_robot("planar3")
    walls = [rrtik.Obstacle("wall", rrtik.Box([0.02, 9.0, 1.0]), rrtik.pose([-0.2, 0.0, 0.0]))]
    world = rrtik.World(robot, rrtik.Scene(walls))
    rows = np.random.default_rng(1).uniform(-3.0, 3.0, (4000, robot.dof))
    rows = rows[world.valid_batch(rows)]
    return rrtik.Problem(world, rows[rows[:, 0].argmin()], rows[rows[:, 0].argmax()])


WORK = {
    name: partial(lambda name, problem: rrtik.plan(problem, name, seconds=0.3), name)
    for name in ("fastrrtconnect", "bicrdt", "crdt", "roadmap")
} | {
    "improve": lambda problem: rrtik.plan(problem, seconds=0.3, improve=0.3),
    "valid": lambda problem: problem.world.valid_batch(rows_of(problem, 60_000)),
    "motions": lambda problem: problem.world.motion_valid_batch(rows_of(problem, 4000), rows_of(problem, 4000)[::-1]),
    "proofs": lambda problem: problem.world.motions_proven(rows_of(problem, 3000), rows_of(problem, 3000)[::-1]),
    "inverse kinematics": lambda problem: poses_of(rrtik.load_robot("ur5"), 60_000),
}


def rows_of(thing, count):
    robot = thing.robot if isinstance(thing, rrtik.Problem) else thing
    return np.random.default_rng(2).uniform(*robot.finite_range(), (count, robot.dof))


def poses_of(robot, count):
    return rrtik.solve_ik_many(robot, robot.fk_batch(rows_of(robot, count)), threads=1)


@pytest.mark.parametrize("work", WORK)
def test_no_call_of_a_kernel_lasts_long(hard, longest, work):
    WORK[work](hard)
    assert longest
    slow = {name: seconds for name, seconds in longest.items() if seconds > LONGEST}
    assert not slow
