"""The 3-D picture: every solid, margin, goal and path is in it, and the camera sees them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import umsgpack
from scipy.spatial import ConvexHull

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.constraints.shorthands import on_plane, upright
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.goal import GoalSet, MultiGoal, PoseGoal, PositionGoal
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, Shape, Sphere
from rrtik_ompl.viewer.drawing.framing import behind, frame_around, overview
from rrtik_ompl.viewer.drawing.meshes import look_of_margin
from rrtik_ompl.viewer.drawing.nodes import TriangleGeometry
from rrtik_ompl.viewer.drawing.robot_picture import node_name
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.subject import subject_of
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.crane import TETRAHEDRON, URDF, WAYPOINTS, problem, story


def gap_to_box(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.maximum(np.abs(points) - [0.1, 0.15, 0.25], 0.0), axis=1)


def gap_to_cylinder(points: np.ndarray) -> np.ndarray:
    aside = np.maximum(np.linalg.norm(points[:, :2], axis=1) - 0.2, 0.0)
    return np.hypot(aside, np.maximum(np.abs(points[:, 2]) - 0.25, 0.0))


def gap_to_capsule(points: np.ndarray) -> np.ndarray:
    return np.hypot(np.linalg.norm(points[:, :2], axis=1), np.maximum(np.abs(points[:, 2]) - 0.2, 0.0)) - 0.1


@pytest.mark.parametrize(
    ("shape", "gap"),
    [(Box([0.2, 0.3, 0.5]), gap_to_box), (Cylinder(0.2, 0.5), gap_to_cylinder), (Capsule(0.1, 0.4), gap_to_capsule)],
    ids=["box", "cylinder", "capsule"],
)
def test_a_margin_is_drawn_as_far_from_the_shape_as_it_is_wide(shape: Shape, gap: Any) -> None:
    look = look_of_margin(shape, 0.05)
    assert look is not None
    assert isinstance(look.geometry, TriangleGeometry)
    corners = look.geometry.vertices
    assert gap(corners) == pytest.approx(0.05)
    a, b, c = (corners[look.geometry.faces[:, k]] for k in range(3))
    hull = ConvexHull(corners).volume
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(hull, rel=1e-3)  # closed, facing out


def test_margins_are_drawn_with_their_obstacles_and_told(crane: Robot) -> None:
    obstacles = (
        Obstacle("box", Box([0.1, 0.1, 0.1]), pose([1.0, 1.0, 0.0]), margin=0.05),
        Obstacle("can", Cylinder(0.1, 0.3), pose([1.0, -1.0, 0.0]), margin=0.02),
        Obstacle("bare", Sphere(0.1), pose([-1.0, 1.0, 0.0])),
        Obstacle("spike", TETRAHEDRON, pose([-1.0, -1.0, 0.0]), margin=0.1),
    )
    subject = subject_of(problem(crane, Scene(obstacles)), WAYPOINTS)
    window, _ = draw(subject)
    drawn = {path.split("/")[3] for path in window.paths if path.endswith("/margin")}
    assert drawn == {":box", ":can"}
    told = story(page(problem(crane, Scene(obstacles)), WAYPOINTS))["obstacles"]
    assert [(o["margin"], o["margin_drawn"]) for o in told] == [(0.05, True), (0.02, True), (0.0, False), (0.1, False)]


def test_a_path_to_compare_with_is_counted_in_moves_of_one_joint(crane: Robot, scene: Scene) -> None:
    in_two = np.insert(WAYPOINTS, 1, 0.5 * (WAYPOINTS[0] + WAYPOINTS[1]), axis=0)
    told = story(page(problem(crane, scene), WAYPOINTS, before=in_two))["before"]
    assert told.startswith("4 moves")
    assert "now 4," in told


def test_every_solid_is_in_the_picture(crane: Robot, scene: Scene) -> None:
    window, _ = draw(subject_of(problem(crane, scene), WAYPOINTS))
    paths = set(window.paths)
    drawn = {path.split("/")[3] for path in paths if path.startswith("/meshcat/obstacles/")}
    assert drawn == {node_name(o.name) for o in scene.obstacles}
    assert "/meshcat/robot/:spin/held:hook" in paths
    joints = {path.split("/")[3] for path in paths if path.startswith("/meshcat/robot/")}
    assert joints == {node_name(name) for name in crane.model.names}
    assert {p.split("/")[3] for p in paths if p.startswith("/meshcat/later/")} == {":buoy", ":door"}
    assert {p for p in paths if p.startswith("/meshcat/trail/")} == {f"/meshcat/trail/piece {k}" for k in (0, 1, 3)}


def test_a_robot_without_visual_geometry_is_drawn_by_its_collision_geometry() -> None:
    bare = robot_from_urdf_text(URDF.replace("visual>", "collision>"), tip="hand")
    window, _ = draw(subject_of(bare))
    assert sum(path.startswith("/meshcat/robot/") and "tip frame" not in path for path in window.paths) == 4


def test_goals_are_drawn_as_frames_and_points(crane: Robot) -> None:
    reach = PoseGoal(crane.fk(WAYPOINTS[-1]))
    for goal, part in [
        (reach, "0/frame/x"),
        (PositionGoal([0.5, 0.5, 0.5]), "0/point"),
        (GoalSet([reach, reach], box=[0.1, 0.1, 0.0]), "1/region"),
        (TaskRegion.about_axis(reach.T_world_tip, [0.0, 0.0, 1.0]), "0/frame 7/y"),
        (TaskRegion(reach.T_world_tip, [[0.0, 0.1]] + 5 * [[0.0, 0.0]]), "0/region"),
    ]:
        window, _ = draw(subject_of(problem(crane, Scene(), goal)))
        assert f"/meshcat/goal/{part}" in window.paths


def test_a_pose_goal_has_a_ghost_only_once_a_path_shows_how_it_is_reached(crane: Robot) -> None:
    asked = problem(crane, Scene(), PoseGoal(crane.fk(WAYPOINTS[-1])))
    assert story(page(asked))["goal_ghost"] is None
    assert story(page(asked, WAYPOINTS))["goal_ghost"] == WAYPOINTS[-1].tolist()


def test_the_camera_takes_in_arm_and_obstacles_but_not_all_of_a_huge_floor() -> None:
    arm = np.array([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]])
    near = Obstacle("near", Sphere(0.5), pose([2.0, 0.0, 0.0]))
    floor = Obstacle("floor", Box([50.0, 50.0, 0.1]), pose([0.0, 0.0, -0.1]))
    frame = frame_around(arm, Scene((near, floor)))
    assert frame.high[0] == pytest.approx(2.5)
    assert frame.low[0] > -3.0


def test_the_camera_looks_from_where_no_obstacle_stands_in_the_way() -> None:
    points = np.array([[0.0, 0.0, 0.5]])
    frame = frame_around(np.array([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]]), Scene())
    free = overview([points], Scene(), frame)
    wall = Obstacle("wall", Box([0.1, 4.0, 4.0]), pose([0.5 * np.sign(free[0]), 0.0, 0.5]))
    around = overview([points], Scene((wall,)), frame)
    assert behind(points, 3.0 * free, wall).all()
    assert not behind(points, 3.0 * around, wall).any()
    assert not behind(points, 0.4 * free, wall).any()  # the eye is on this side of the wall
    assert around[2] > 0.0


def test_a_plane_world_is_flattened_so_that_obstacles_do_not_cover_the_arm(crane: Robot, scene: Scene) -> None:
    flat = dataclasses.replace(crane, planar=True)
    window, frame = draw(subject_of(problem(flat, scene), WAYPOINTS))
    commands = [umsgpack.unpackb(command) for command in window.commands]
    squeeze = next(c["matrix"] for c in commands if (c["type"], c["path"]) == ("set_transform", "/meshcat/obstacles"))
    assert squeeze[0] == squeeze[5] == 1.0
    assert squeeze[10] * (frame.high[2] - frame.low[2]) < 0.02 * frame.size


def test_the_way_before_is_drawn_and_measured_beside_the_way_after(crane: Robot, scene: Scene) -> None:
    asked = problem(crane, scene)
    after = WAYPOINTS[[0, -1]]
    window, frame = draw(subject_of(asked, after, before=WAYPOINTS))
    assert "/meshcat/before" in window.paths
    tips = crane.fk_batch(WAYPOINTS)[:, :3, 3]
    assert (tips >= frame.low - 1e-9).all()
    assert (tips <= frame.high + 1e-9).all()
    told = story(page(asked, after, before=WAYPOINTS))
    assert told["before"].startswith(f"{len(WAYPOINTS) - 1} moves, length")
    assert "; now 1, " in told["before"]
    assert story(page(asked, after))["before"] == ""


def test_a_way_before_without_one_after_is_refused(crane: Robot) -> None:
    with pytest.raises(InputError, match="none after it"):
        page(crane, before=WAYPOINTS)
    with pytest.raises(InputError, match="3 joints"):
        page(crane, WAYPOINTS, before=WAYPOINTS[:, :2])


def test_regions_of_path_constraints_are_drawn(crane: Robot) -> None:
    start = WAYPOINTS[0]
    level = on_plane(crane.fk(start).translation, [0.0, 0.0, 1.0])
    held = Problem(World(crane), start, start, constraints=[upright(crane, tolerance_deg=10.0), level])
    window, _ = draw(subject_of(held))
    assert {"/meshcat/constraints/0/axis", "/meshcat/constraints/1/place"} <= set(window.paths)
    assert "/meshcat/constraints/0/place" not in window.paths


def test_the_ways_of_both_tips_are_drawn() -> None:
    two = load_robot("two_titan4")
    left, right = (PositionGoal([1.5, y, 0.0]) for y in (0.4, -0.4))
    goal = MultiGoal({"left_grip_point": left, "right_grip_point": right})
    rows = two.posture("ready") + np.array([[0.0], [0.05]])
    subject = subject_of(Problem(World(two), rows[0], goal), rows)
    assert subject.tips == ("left_grip_point", "right_grip_point")
    window, _ = draw(subject)
    trails = [path for path in window.paths if path.startswith("/meshcat/trail/")]
    assert trails == ["/meshcat/trail/piece 0", "/meshcat/trail/piece 0/tip 2"]
