"""Several threads ask one world: answers as of one thread, and no kernel writes beyond its memory."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.threads import in_threads
from rrtik_tests.sizes import how_many

CALLS = how_many(100_000, 4_000)  # mixed


@pytest.fixture(scope="module")
def world():
    """A UR5 among boxes and points, which share memory that kernels write to."""
    robot, rng = rrtik.load_robot("ur5"), np.random.default_rng(4)
    places = rng.uniform(-0.9, 0.9, (3000, 3))
    places = places[np.linalg.norm(places[:, :2], axis=1) > 0.3]
    boxes = (rrtik.Obstacle(f"box {k}", rrtik.Box([0.1, 0.05, 0.08]), rrtik.pose(places[k])) for k in range(12))
    cloud = rrtik.Obstacle("cloud", rrtik.PointCloud(places[12:1200], 0.01))
    return rrtik.World(robot, rrtik.Scene((*boxes, cloud)))


def answers(world, rows, ends, seed):
    """What a world says to a share of the calls: configurations, motions, proofs, distances, in some order."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(CALLS // 8):
        k = int(rng.integers(len(rows)))
        kind = rng.integers(5)
        if kind == 0:
            found.append(world.valid(rows[k]))
        elif kind == 1:
            found.append(world.motion_valid(rows[k], ends[k]))
        elif kind == 2:
            found.append(world.motion_proven(rows[k], ends[k]))
        elif kind == 3:
            found.append(world.valid_batch(rows[k : k + 9]).tolist())
        else:
            found.append(world.prove(np.stack([rows[k], ends[k], rows[k]]), clearance=1e-4).unproven)
    return found


def test_threads_get_the_answers_of_one(world):
    rng = np.random.default_rng(5)
    rows = rng.uniform(*world.robot.finite_range(), (400, world.robot.dof))
    rows = np.concatenate([rows, rows[world.valid_batch(rows)]])
    ends = rows + rng.normal(scale=0.03, size=rows.shape)
    ask = partial(answers, world, rows, ends)
    alone = [ask(seed) for seed in range(8)]
    with ThreadPoolExecutor(4) as pool:
        assert [str(each) for each in pool.map(ask, range(8))] == [str(each) for each in alone]
        tables = list(pool.map(lambda _: (world.fast, world.prover), range(8)))
    assert world.fast.intact()
    assert all(fast.intact() and own.tables.packed.table.intact() for fast, own in tables)


def test_each_thread_has_its_own_memory_and_takes_the_proofs_of_others(world):
    q = np.array([[0.0, -1.2, 0.5, 0.0, 0.0, 0.0]] * 2)
    with ThreadPoolExecutor(1) as pool:
        there = pool.submit(lambda: (world.fast, world.motions, world.prove(q))).result()
    assert there[0] is not world.fast
    assert there[1].address != world.motions.address
    assert world.prover.made(there[2])
    assert rrtik.World(world.robot, world.scene).prover.made(there[2])  # which is made of the same values
    assert not rrtik.World(world.robot, world.scene.without("box 0")).prover.made(there[2])


@pytest.mark.parametrize("proof", ["preferred", "required", "off"])
def test_many_plans_are_those_of_single_calls(proof):
    robot, rng = rrtik.load_robot("ur5"), np.random.default_rng(7)
    places = [[0.5, 0.0, 0.3], [-0.4, 0.3, 0.5], [0.0, -0.6, 0.2]]
    boxes = (rrtik.Obstacle(f"{k}", rrtik.Box([0.2, 0.3, 0.1]), rrtik.pose(p)) for k, p in enumerate(places))
    world = rrtik.World(robot, rrtik.Scene(tuple(boxes)))
    rows = rng.uniform(*world.robot.finite_range(), (400, world.robot.dof))
    free, taken = rows[world.valid_batch(rows)], rows[~world.valid_batch(rows)]
    starts, goals = free[:40], free[-40:].copy()
    goals[3], goals[5], goals[7, 0] = taken[0], starts[5], 99.0
    ask = partial(rrtik.plan_many, world, starts, goals, "fastrrtconnect", seed=2, proof=proof, shorten=False)
    plans, together = ask(), ask(threads=3)
    assert sum(each.found for each in plans) > 30
    for start, goal, each, other in zip(starts, goals, plans, together, strict=True):
        assert str(each.path) == str(other.path)
        if each.problem is None:
            with pytest.raises(rrtik.ProblemError) as refused:
                rrtik.Problem(world, start, goal)
            assert each.reason == str(refused.value)
            continue
        alone = rrtik.plan(
            rrtik.Problem(world, start, goal), "fastrrtconnect", seed=each.seed, proof=proof, shorten=False
        )
        assert (alone.found, alone.reason, alone.statistics) == (each.found, each.reason, each.statistics)
        assert (alone.path is None) == (each.path is None)
        if alone.path is not None:
            assert np.array_equal(alone.path.waypoints, each.path.waypoints)
            assert str(alone.path.proof) == str(each.path.proof)
        assert np.array_equal(each.problem.start, start)


@pytest.mark.parametrize("planner", [None, "fastrrtconnect", "RRTConnect"])
def test_many_plans_do_not_depend_on_the_number_of_threads(planner):
    problem = rrtik.load_problem("planar3_boxes")
    goals = [rrtik.plan(problem, seed=1).path.end, problem.goal] * 3
    goals = goals[1::2] if planner is None else np.stack(goals[::2])
    plans = [rrtik.plan_many(problem.world, problem.start, goals, planner, seed=3, threads=n) for n in (1, 3)]
    for one, other in zip(*plans, strict=True):
        assert one.found
        assert (one.path.waypoints == other.path.waypoints).all()
        assert one.path.violations(problem.world) == ()
    assert len({each.path.waypoints.tobytes() for each in plans[0]}) > 1


def test_a_query_that_cannot_be_asked_is_a_plan_without_a_path():
    problem = rrtik.load_problem("planar3_boxes")
    starts = np.stack([problem.start, problem.start + 100.0])
    one, other = rrtik.plan_many(problem.world, starts, [problem.goal] * 2, seed=1)
    assert one.found
    assert not other.found
    assert "outside its limits" in other.reason


def test_starts_and_goals_that_do_not_fit_are_refused(world):
    with pytest.raises(InputError, match=r"starts.*goals.*2 and 3"):
        rrtik.plan_many(world, np.zeros((2, 6)), np.zeros((3, 6)))
    with pytest.raises(InputError, match="threads must be"):
        rrtik.plan_many(world, np.zeros((2, 6)), np.zeros((2, 6)), threads=0)
    with pytest.raises(InputError, match="goals"):
        rrtik.plan_many(world, np.zeros((2, 6)), np.zeros((2, 5)))
    some = [rrtik.JointGoal(np.zeros(6)), rrtik.JointGoal(np.zeros(5))]
    for planner in (None, "fastrrtconnect"):
        with pytest.raises(InputError, match=r"goals\[1\].*6 joints.*5 values"):
            rrtik.plan_many(world, np.zeros(6), some, planner)


def test_what_work_raises_in_a_thread_is_raised():
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda k: 1 // k, [1, 0, 2], threads=2)


def test_an_interrupt_ends_the_work_of_all_threads():
    caller = threading.current_thread()
    begun = threading.Event()
    ended = threading.Event()

    def work(number):
        if threading.current_thread() is caller:
            assert begun.wait(5.0)
            raise KeyboardInterrupt
        begun.set()
        try:
            while not time.sleep(1e-3):
                pass
        finally:
            ended.set()

    with pytest.raises(KeyboardInterrupt):
        in_threads(work, range(4), threads=2)
    assert ended.wait(5.0)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_inverse_kinematics_of_many_poses_does_not_depend_on_the_number_of_threads(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(1)
    poses = robot.fk_batch(rng.uniform(*robot.finite_range(), (700, robot.dof)))
    poses[3, :3, 3] = 9.0
    one, other = (rrtik.solve_ik_many(robot, poses, seconds=0.05, threads=n) for n in (1, 2))
    assert one.reasons == other.reasons
    assert not one.found[3]
    assert one.found.sum() > 600
    np.testing.assert_array_equal(one.q, other.q)


def another_form(world, draw):
    """A world made of another one in a way that is drawn."""
    way = draw.integers(6)
    if way == 0:
        return world.moved(str(draw.choice(["box 1", "box 7", "cloud"])), rrtik.pose(draw.uniform(-0.8, 0.8, 3)))
    if way == 1:
        return world.with_clearance(float(draw.choice([0.0, 0.01, 0.05])))
    if way == 2:
        return rrtik.World.of(replace(world.settings, self_margin=float(draw.choice([0.0, 0.01]))))
    if way == 3:
        return world.proving(float(draw.choice([0.0, 0.005])))
    if way == 4:
        return world.with_scene(replace(world.scene, obstacles=list(world.scene.obstacles)))
    return world.with_accuracy(str(draw.choice(["exact", "conservative"])))


def test_worlds_remade_by_several_threads_answer_as_fresh_ones(world):
    rng = np.random.default_rng(8)
    rows = rng.uniform(*world.robot.finite_range(), (40, world.robot.dof))
    ends = rows + rng.normal(scale=0.1, size=rows.shape)

    def said(asked):
        answers = asked.valid_batch(rows), asked.motion_valid_batch(rows, ends), asked.motions_proven(rows, ends)
        return np.concatenate(answers)

    known, found = [world], []

    def remake(seed):
        draw = np.random.default_rng(seed)
        for _ in range(how_many(1500, 20)):
            before = known[draw.integers(len(known))]
            after = another_form(before, draw)
            found.append((after.settings, said(after)))
            known.append(after)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(remake, range(4)))
    for settings, answers in found:
        scene = replace(settings.scene, obstacles=list(settings.scene.obstacles))  # it shares nothing
        fresh = rrtik.World.of(replace(settings, scene=scene))
        assert np.array_equal(said(fresh), answers), settings
