"""Proofs that a path constraint keeps configurations apart: right where something is said, and said where it is so."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.constraints.residuals import projected_rows
from rrtik_ompl.constraints.walls import separation
from rrtik_ompl.ik.held_tables import held_tables
from rrtik_ompl.kernels.search.constrained.search import ConstrainedSearch
from rrtik_ompl.model.scene import Scene

DOWN = np.array([0.0, -1.5, 1.5, -1.5, -0.5 * np.pi, 0.0])  # the tool of a UR5 points down


def test_the_wrist_of_a_ur5_cannot_flip_while_its_tool_points_down():
    robot = rrtik.load_robot("ur5")
    held = held_regions(robot, Scene(), [rrtik.constraints.upright(robot)], DOWN)
    turned = DOWN + np.pi * np.eye(6)[0]
    other = rrtik.solve_ik(robot, rrtik.PoseGoal(robot.fk(DOWN)), all=True).solutions
    flipped = other[np.sin(other[:, 4]) > 0.5]
    assert separation(held, DOWN, turned[None]) == ""
    assert len(flipped) > 0
    said = separation(held, DOWN, flipped)
    assert "keeps start and goal apart" in said
    assert separation(held, DOWN, np.vstack([flipped, turned])) == ""  # one of the goals is enough


def test_a_joint_that_stays_far_from_its_wall_does_not_keep_apart():
    robot = rrtik.load_robot("ur5")
    held = held_regions(robot, Scene(), [rrtik.constraints.upright(robot)], DOWN)
    swung = DOWN + np.array([0.3, 0.2, -0.2, 0.0, 0.0, 2.0])
    assert separation(held, DOWN, swung[None]) == ""


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("name", "kind"), [("ur5", "axis"), ("ur5", "ball"), ("titan4", "axis"), ("titan4", "ball"), ("puma560", "axis")]
)
def test_nothing_is_said_to_be_apart_that_trees_can_connect(name, kind):
    robot, seen = rrtik.load_robot(name), 0
    world, rng, box = rrtik.World(robot), np.random.default_rng(21), robot.finite_range()
    for seed in range(8):
        q = rng.uniform(*box)
        region = (
            rrtik.constraints.upright(robot) if kind == "axis" else rrtik.constraints.orientation_of(robot.fk(q), 3.0)
        )
        held = held_regions(robot, Scene(), [region], q)
        rows, there = projected_rows(robot, held, rng.uniform(*box, (8, robot.dof)))
        tables = held_tables(robot, held)
        search = ConstrainedSearch(world.motions, tables.held, *box)
        for goal in rows[there & held.held(rows)][:2]:
            if separation(held, q, goal[None]):
                seen += 1
                ends = q[None], goal[None]
                assert search.solve(*ends, seed, max_iterations=250, unchecked=True) is None
    assert seen > 0


def test_the_sum_of_the_joints_of_an_arm_in_a_plane_cannot_turn_while_its_orientation_is_kept():
    robot = rrtik.load_robot("planar10")
    start = np.tile([0.3, -0.3], 5)
    turned, swung = start + 0.2 * np.pi, start + np.tile([0.4, -0.4], 5)
    for region in (rrtik.constraints.upright(robot, "x"), rrtik.constraints.orientation_of(robot.fk(start), 2.0)):
        held = held_regions(robot, Scene(), [region], start)
        assert held.held(np.vstack([turned, swung])).all()
        assert "keeps start and goal apart: the sum of joints 'joint1'" in separation(held, start, turned[None])
        assert separation(held, start, swung[None]) == ""


def joint(number, kind, axis, limit):
    ends = "".join(f'{side}="{value}" ' for side, value in zip(("lower", "upper"), limit, strict=False))
    return (
        f'<link name="l{number}"/><joint name="j{number}" type="{kind}"><parent link="l{number - 1}"/>'
        f'<child link="l{number}"/><axis xyz="{axis}"/><limit {ends}velocity="1" effort="1"/></joint>'
    )


@pytest.mark.kernels
def test_a_joint_without_limits_may_go_the_other_way_round(tmp_path):
    joints = [("continuous", "1 0 0", ()), ("revolute", "0 1 0", (-2.9, -0.2)), ("revolute", "0 0 1", (-1.3, 1.3))]
    text = "".join(joint(number, *each) for number, each in enumerate(joints, 1))
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="l0"/>{text}</robot>')
    robot = rrtik.load_robot(tmp_path / "arm.urdf")
    first = np.array([0.67, -0.704, 1.073])
    held = held_regions(robot, Scene(), [rrtik.constraints.upright(robot, "x", tolerance_deg=59.0)], first)
    start, goal = np.array([-np.pi, -0.2, -1.2]), np.array([1.99, -0.3125, 1.19])
    nearer = goal - 2.0 * np.pi * np.eye(3)[0]
    assert held.held(np.array([start, goal, nearer])).all()
    tables, side = held_tables(robot, held), np.array([4.0 * np.pi, 3.0, 3.0])
    with pytest.warns(match="no collision geometry"):
        motions = rrtik.World(robot).motions
    search = ConstrainedSearch(motions, tables.held, -side, side)
    assert search.solve(start[None], goal[None], 1, max_iterations=5000, unchecked=True) is not None
    assert separation(held, start, goal[None]) == ""
    assert separation(held, start, nearer[None]) == ""
