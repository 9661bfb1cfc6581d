"""MB-RRT on real arms: joint limits, obstacles, one-axis joints, poses, and its place among methods and planners."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rrtik_ompl as rrtik
from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.ik.mb_rrt.axes import axes_of
from rrtik_ompl.ik.mb_rrt.search import LinkWorlds, search
from rrtik_ompl.ik.mb_rrt.workspace_tree import WorkspaceTree, grow_by_rule_b
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.shapes import Cylinder
from rrtik_ompl.ompl_bridge.setup import ValidityCallback, space_information
from rrtik_ompl.planning.plan import plan
from rrtik_planners import MBRRT
from rrtik_robots.planar import planar

LIMITED = planar(lengths=[0.1] * 10, limits_deg=[(-180, 180)] + [(-60, 60)] * 9)
MOST = 1000


def passes_to_an_end(tree):
    while tree.passes < MOST:
        ends = tree.grow()
        if len(ends):
            return tree.passes, ends
    return MOST, ends


def ring_of_discs():
    angle = 2.0 * np.pi * np.arange(7) / 7
    centres = 0.35 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)])
    discs = [rrtik.Obstacle(f"disc{k}", Cylinder(0.1, 1.0), pin.SE3(np.eye(3), c)) for k, c in enumerate(centres)]
    return rrtik.World(rrtik.load_robot("planar10"), rrtik.Scene(tuple(discs)))


def test_arcs_inside_joint_limits_end_exactly_on_goals_that_are_feasible():
    rng, axes, passes = np.random.default_rng(0), axes_of(LIMITED, False), []
    for q in rng.uniform(LIMITED.lower, LIMITED.upper, (40, 10)):
        goal = LIMITED.fk(q).translation
        done, ends = passes_to_an_end(WorkspaceTree(axes, goal, np.zeros(10), rng))
        passes.append(done)
        assert LIMITED.within_limits(ends, 1e-9).all()
        assert np.linalg.norm(LIMITED.fk_batch(ends)[:, :3, 3] - goal, axis=1).max() < 1e-12
    assert np.mean(np.array(passes) < MOST) >= 0.95
    assert np.mean(passes) <= 10


@given(st.lists(st.floats(0.05, 1.0), min_size=1, max_size=8), st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_a_planar_arm_anywhere_in_space_is_solved_exactly(lengths, seed):
    rng = np.random.default_rng(seed)
    base = pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), rng.uniform(-1.0, 1.0, 3))
    robot = planar(lengths=lengths, base_pose=base)
    goal = robot.fk(rng.uniform(-np.pi, np.pi, len(lengths))).translation
    _, ends = passes_to_an_end(WorkspaceTree(axes_of(robot, False), goal, np.zeros(len(lengths)), rng))
    assert len(ends) == 1
    assert np.linalg.norm(robot.fk(ends[0]).translation - goal) < 1e-10


def test_edges_are_links_that_keep_clear_of_obstacles():
    world, rng = ring_of_discs(), np.random.default_rng(0)
    axes = axes_of(world.robot, False)
    check = LinkWorlds(world, axes).free
    for goal in ([0.6, 0.1, 0.0], [0.0, 0.2, 0.0], [-0.9, 0.0, 0.0], [0.1, -0.55, 0.0]):
        _, ends = passes_to_an_end(WorkspaceTree(axes, np.array(goal), np.zeros(10), rng, check))
        assert world.certify(ends).all()
        assert np.linalg.norm(world.robot.fk_batch(ends)[:, :3, 3] - goal, axis=1).max() < 1e-12


def test_the_world_of_the_first_links_says_what_the_whole_world_says_of_them():
    world, rng = ring_of_discs(), np.random.default_rng(1)
    worlds = LinkWorlds(world, axes_of(world.robot, False))
    Q = rng.uniform(world.robot.lower, world.robot.upper, (200, 10))
    free = np.array([worlds.free(level, Q) for level in range(10)])
    assert (free[1:] <= free[:-1]).all()
    assert 0 < free[-1].sum() < free[0].sum()
    np.testing.assert_array_equal(free[-1], world.valid_batch(Q))
    titan = rrtik.load_problem("titan4_sdu").world
    worlds = LinkWorlds(titan, axes_of(titan.robot, True))
    Q = rng.uniform(titan.robot.lower, titan.robot.upper, (100, 6))
    assert (titan.valid_batch(Q) <= worlds.free(2, Q)).all()


@pytest.mark.parametrize("name", ["panda", "puma560", "titan4", "ur5"])
def test_the_points_of_the_axes_bound_what_the_rest_of_an_arm_can_reach(name):
    robot = rrtik.load_robot(name)
    rng = np.random.default_rng(0)
    Q = rng.uniform(*robot.finite_range(), (300, robot.dof))
    for oriented in (False, True):
        axes = axes_of(robot, oriented)
        poses = robot.fk_batch(Q)
        aims = poses[:, :3, :3] @ axes.aim + poses[:, :3, 3]
        assert max(axes.shortfall(aim) for aim in aims) == 0.0
        frames = np.tile(axes.fixed[0], (len(Q), 1, 1))
        for level in range(axes.count):
            angle = Q[:, axes.joints[level]] + axes.offset[level]
            turn = np.tile(np.eye(4), (len(Q), 1, 1))
            turn[:, :2, :2] = np.moveaxis([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], 2, 0)
            turned = frames @ turn
            points = turned[:, :3, :3] @ axes.points[level] + turned[:, :3, 3]
            distance = np.linalg.norm(points - aims, axis=1)
            assert (distance <= axes.max_span[level] + 1e-9).all()
            assert (distance >= axes.min_span[level] - 1e-9).all()
            frames = turned @ axes.fixed[level + 1]


def test_of_a_spherical_wrist_the_tree_aims_at_its_centre():
    axes = axes_of(rrtik.load_robot("puma560"), True)
    np.testing.assert_allclose(axes.max_span[3:], 0.0, atol=1e-9)
    assert axes.max_span[2] > 0.0


@pytest.mark.parametrize("name", ["planar10", "planar3", "panda", "puma560", "titan4", "ur5"])
def test_poses_and_positions_of_every_arm_are_solved(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(3)
    for q in rng.uniform(*robot.finite_range(), (8, robot.dof)):
        tip = robot.fk(q)
        for goal in (rrtik.PoseGoal(tip, 1e-5, 1e-5), rrtik.PositionGoal(tip.translation, 1e-5)):
            result = solve_ik(robot, goal, method="mb-rrt", seconds=10.0)
            assert (result.found, result.method) == (True, "mb-rrt")
            assert goal.satisfied(robot, result.solutions).all()
            assert robot.within_limits(result.solutions, 0.0).all()
            assert result.iterations >= 16


def test_joints_that_do_not_move_the_tip_stay_where_they_are():
    robot = rrtik.load_robot("puma560")
    near = robot.configuration([0.3, -0.5, 0.8, 0.4, -0.7, 1.1])
    goal = rrtik.PositionGoal(robot.fk([0.9, -0.2, 0.4, 0.0, 0.0, 0.0]).translation)
    result = solve_ik(robot, goal, method="mb-rrt", near=near)
    np.testing.assert_allclose(result.solutions[0, 3:], near[3:], atol=1e-9)


def test_a_planar_pose_is_met_to_the_rounding():
    robot = rrtik.load_robot("planar6")
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper)
    result = solve_ik(robot, rrtik.PoseGoal(robot.fk(q), 1e-9, 1e-9), method="mb-rrt", all=True)
    assert len(result.solutions) > 20
    assert result.residuals.max() < 1e-12


def zigzag(count):
    rows = [DhRow(a=0.1, alpha=(-1.0) ** k * np.pi / 2) for k in range(count)]
    return robot_from_dh("zigzag", rows, convention="standard")


def test_rule_b_of_one_axis_joints_comes_within_a_hundredth_of_the_reach():
    robot, rng, solved = zigzag(7), np.random.default_rng(0), 0
    axes = axes_of(robot, False)
    for q in rng.uniform(-np.pi, np.pi, (10, 7)):
        goal = robot.fk(q).translation
        run = grow_by_rule_b(axes, goal, tolerance=0.007, passes=600, rng=rng)
        distance = np.linalg.norm(robot.fk_batch(run.q)[:, :3, 3] - goal, axis=1)
        np.testing.assert_allclose(distance, run.misses, atol=1e-9)
        solved += run.solved_in > 0
    assert solved >= 9


def test_one_pass_and_a_polish_solve_seven_one_axis_joints():
    robot, rng = zigzag(7), np.random.default_rng(0)
    for q in rng.uniform(-np.pi, np.pi, (20, 7)):
        goal = rrtik.PositionGoal(robot.fk(q).translation, 1e-4)
        options = {"near": np.zeros(7), "accept": lambda Q: np.ones(len(Q), dtype=bool), "budget": Budget()}
        found = search(robot, goal, rng=rng, width=1, **options)
        assert len(found.q) == 1
        assert found.passes <= 3


def test_a_goal_behind_obstacles_is_solved_free_of_collision():
    world = ring_of_discs()
    goal = rrtik.PositionGoal([0.7, 0.0, 0.0], 1e-6)
    result = solve_ik(world.robot, goal, method="mb-rrt", world=world, seconds=20.0)
    assert result.found
    assert world.certify(result.solutions).all()


def test_a_goal_that_only_its_tolerance_brings_into_reach_is_solved():
    robot = rrtik.load_robot("planar10")
    for point in ([1.0005, 0.0, 0.0], [0.4, 0.3, 0.0008], [0.0, -0.7, -0.0009]):
        goal = rrtik.PositionGoal(point, tolerance=1e-3)
        result = solve_ik(robot, goal, method="mb-rrt")
        assert result.found
        assert goal.satisfied(robot, result.solutions).all()
        assert not solve_ik(robot, rrtik.PositionGoal(point, tolerance=1e-4), method="mb-rrt").found


def test_failures_say_why():
    robot = rrtik.load_robot("planar10")
    far = solve_ik(robot, rrtik.PositionGoal([1.3, 0.0, 0.0]), method="mb-rrt")
    assert (far.found, far.reason) == (False, "unreachable")
    assert "0.3" in far.detail
    sliding = rrtik.load_robot("point2d")
    with pytest.raises(InputError, match="a joint of the robot slides"):
        solve_ik(sliding, rrtik.PositionGoal([1.0, 1.0, 0.0]), method="mb-rrt")


@pytest.mark.parametrize("name", ["planar6_c_pose", "puma_pose", "puma_position"])
def test_the_planner_reaches_goals_of_the_tip(name):
    problem = rrtik.load_problem(name)
    found = plan(problem, MBRRT, seed=1, seconds=20.0)
    assert found.found, found.reason
    assert found.statistics["tree_goals"] > 0
    assert problem.reached(found.path.end)


def test_the_planner_says_what_it_needs():
    problem = rrtik.load_problem("puma_pose")
    si = space_information(problem, problem.start[None], ValidityCallback(problem.world))
    with pytest.raises(InputError, match="MBRRT needs world="):
        MBRRT(si, goal=problem.goal)
    with pytest.raises(InputError, match="ik_seconds"):
        MBRRT(si, ik_seconds=0.0)
    with pytest.raises(InputError, match="parameter of planner MBRRT"):
        plan(problem, MBRRT, parameters={"goal": None})
