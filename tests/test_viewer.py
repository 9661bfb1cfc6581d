"""The page that shows a problem: self-contained, complete, the same every time, readable, and served to nobody else."""

from __future__ import annotations

import dataclasses
import html
import http.client
import json
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import umsgpack
from scipy.spatial import ConvexHull

from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.errors import InputError
from rrtik_ompl.goal import GoalSet, JointGoal, PoseGoal, PositionGoal
from rrtik_ompl.poses import pose
from rrtik_ompl.robot import Robot
from rrtik_ompl.scene import AttachedObject, ConstantVelocity, Obstacle, Scene, TimedPoses
from rrtik_ompl.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Shape, Sphere
from rrtik_ompl.task_region import TaskRegion
from rrtik_ompl.viewer import view
from rrtik_ompl.viewer.drawing import palette
from rrtik_ompl.viewer.drawing.framing import frame_around
from rrtik_ompl.viewer.drawing.meshes import look_of_margin
from rrtik_ompl.viewer.drawing.viewpoint import behind, overview
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.picture import draw
from rrtik_ompl.viewer.serve import PageServer
from rrtik_ompl.viewer.story import grid_cell, play_times
from rrtik_ompl.viewer.subject import subject_of

URDF = """
<robot name="crane">
  <link name="base"><visual><geometry><cylinder radius="0.2" length="0.1"/></geometry></visual></link>
  <link name="tower"><visual><origin xyz="0 0 0.4"/><geometry><box size="0.12 0.12 0.8"/></geometry></visual></link>
  <link name="jib"><visual><origin xyz="0.4 0 0"/><geometry><box size="0.8 0.1 0.1"/></geometry></visual></link>
  <link name="hand"><visual><geometry><sphere radius="0.07"/></geometry></visual></link>
  <joint name="slew" type="revolute"><parent link="base"/><child link="tower"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="hoist" type="prismatic"><parent link="tower"/><child link="jib"/><axis xyz="0 0 1"/>
    <limit lower="0.1" upper="0.8" velocity="1" effort="1"/></joint>
  <joint name="spin" type="continuous"><parent link="jib"/><child link="hand"/><origin xyz="0.8 0.1 0" rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit velocity="1" effort="1"/></joint>
</robot>"""
WAYPOINTS = np.array([[0.0, 0.2, 0.0], [1.2, 0.2, 0.0], [1.2, 0.7, 0.0], [1.2, 0.7, 4.0], [-1.0, 0.7, 4.0]])
TETRAHEDRON = Mesh(0.3 * np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def crane() -> Robot:
    return robot_from_urdf_text(URDF, tip="hand")


@pytest.fixture(scope="module")
def scene() -> Scene:
    drift = TimedPoses([0.0, 4.0], [pose([-1, 0, 0.5]), pose([-1, 1, 0.5])])
    return Scene(
        obstacles=(
            Obstacle("crate", Box([0.3, 0.3, 0.3]), pose([0.9, -0.9, 0.15])),
            Obstacle("pole", Cylinder(0.05, 1.0), pose([-0.9, -0.6, 0.5])),
            Obstacle("bar </script><b>", Capsule(0.05, 0.4), pose([-0.8, 0.9, 0.3])),
            Obstacle("corner/part", Prism([[0, 0], [0.4, 0], [0.4, 0.1], [0.1, 0.1], [0.1, 0.4], [0, 0.4]], 0.2)),
            Obstacle("spike", TETRAHEDRON, pose([0.2, 1.2, 0])),
            Obstacle("ground", HalfSpace([0, 0, 1], -0.06)),
            Obstacle("buoy", Sphere(0.1), pose([1.2, 0.9, 0.9]), ConstantVelocity([0.1, 0, 0])),
            Obstacle("door", Box([0.05, 0.4, 0.4]), pose([-1, 0, 0.5]), drift),
        ),
        attached=(AttachedObject("hook", "hand", Box([0.04, 0.04, 0.2]), pose([0, 0, -0.12])),),
    )


def problem(robot: Robot, scene: Scene, goal: Any = None) -> Any:
    world = SimpleNamespace(robot=robot, scene=scene)
    return SimpleNamespace(world=world, start=WAYPOINTS[0], goal=goal or JointGoal(WAYPOINTS[-1]), name="lift")


@pytest.fixture(scope="module")
def text(crane: Robot, scene: Scene) -> str:
    return page(problem(crane, scene), SimpleNamespace(waypoints=WAYPOINTS))


def story(text: str) -> dict[str, Any]:
    found = re.search(r'<script id="story" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    loaded: dict[str, Any] = json.loads(found.group(1))
    return loaded


# The file -----------------------------------------------------------------------------------------------------------


def test_the_page_loads_nothing_from_anywhere(text: str) -> None:
    assert not re.findall(r"""(?:src|href)\s*=\s*["']?(?!data:)[a-z]*:?//""", text)
    assert not re.findall(r"@import|url\(\s*['\"]?https?:", text)
    policy = html.unescape(re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)[0])
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_the_page_names_every_obstacle_and_joint(text: str, crane: Robot, scene: Scene) -> None:
    told = story(text)
    assert [o["name"] for o in told["obstacles"]] == [o.name for o in scene.obstacles]
    assert [(j["name"], j["unit"]) for j in told["robot"]["joints"]] == [
        ("slew", "deg"),
        ("hoist", "m"),
        ("spin", "deg"),
    ]
    assert told["attached"] == ["hook"]
    assert told["title"] == "lift: path of 4 moves"


def test_a_name_cannot_break_out_of_the_page(text: str) -> None:
    assert "</script><b>" not in text
    assert "</title><b>" not in page(Scene(), title="</title><b>")


def test_the_same_input_gives_the_same_page(text: str, crane: Robot, scene: Scene) -> None:
    assert page(problem(crane, scene), SimpleNamespace(waypoints=WAYPOINTS)) == text


def test_the_page_is_written_whole_and_returned(crane: Robot, tmp_path: Path) -> None:
    target = tmp_path / "view.html"
    assert view(crane, html=target) == target
    assert target.read_text(encoding="utf-8") == page(crane)
    assert [p.name for p in tmp_path.iterdir()] == ["view.html"]


def test_a_failed_picture_leaves_the_old_file_alone(crane: Robot, tmp_path: Path) -> None:
    target = tmp_path / "view.html"
    target.write_text("old")
    with pytest.raises(InputError, match="3 joints"):
        view(crane, np.zeros((2, 5)), html=target)
    assert target.read_text() == "old"


def test_a_folder_that_does_not_exist_is_named(crane: Robot, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        view(crane, html=tmp_path / "nowhere" / "view.html")


def test_importing_the_library_does_not_import_meshcat() -> None:
    command = "import sys, rrtik_ompl; sys.exit('meshcat' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command], check=False).returncode == 0


# The picture --------------------------------------------------------------------------------------------------------


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
    assert drawn == {"box", "can"}
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
    assert drawn == {o.name.replace("/", "|") for o in scene.obstacles}
    assert "/meshcat/robot/spin/attached hook" in paths
    assert {p.split("/")[3] for p in paths if p.startswith("/meshcat/robot/")} == set(crane.model.names)
    assert {p.split("/")[3] for p in paths if p.startswith("/meshcat/later/")} == {"buoy", "door"}
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
    free = overview(points, Scene())
    wall = Obstacle("wall", Box([0.1, 4.0, 4.0]), pose([0.5 * np.sign(free[0]), 0.0, 0.5]))
    around = overview(points, Scene((wall,)))
    assert behind(points, free, wall).all()
    assert not behind(points, around, wall).any()
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


# The story ----------------------------------------------------------------------------------------------------------


def test_a_move_lasts_in_proportion_to_the_travel_of_its_joint(crane: Robot) -> None:
    times = play_times(crane, np.array([[0.0, 0.2, 0.0], [1.0, 0.2, 0.0], [1.0, 0.2, 2.0], [1.0, 0.2, 2.0]]), 2.0)
    first, second, still = np.diff(times)
    assert second == pytest.approx(2.0 * first)
    assert still == 0.0


def test_each_move_names_the_joints_that_move(text: str) -> None:
    assert [move["joints"] for move in story(text)["moves"]] == [[0], [1], [2], [0]]


@pytest.mark.parametrize(("size", "cell"), [(1.0, 0.05), (3.2, 0.2), (31.0, 2.0), (0.02, 0.001)])
def test_grid_cells_are_round_numbers(size: float, cell: float) -> None:
    assert grid_cell(size) == pytest.approx(cell)


def test_a_long_path_is_drawn_in_a_bounded_number_of_pieces(crane: Robot) -> None:
    way = np.linspace(WAYPOINTS[0], WAYPOINTS[-1], 2000)
    window, _ = draw(subject_of(crane, way))
    assert 100 <= sum("/trail/" in path for path in window.paths) <= 150
    assert not any("/beads/" in path for path in window.paths)


@pytest.mark.parametrize("shown", [None, 3, "titan4", SimpleNamespace(world=None)])
def test_what_cannot_be_shown_is_refused(shown: Any) -> None:
    with pytest.raises(InputError, match="give a problem, world, robot or scene"):
        page(shown)


def test_a_path_without_a_robot_is_refused(scene: Scene) -> None:
    with pytest.raises(InputError, match="needs a robot"):
        page(scene, WAYPOINTS)


@pytest.mark.parametrize("path", [np.zeros((0, 3)), np.zeros((2, 2)), [[0.0, np.nan, 0.0]], "path.json"])
def test_a_path_that_does_not_fit_is_refused(crane: Robot, path: Any) -> None:
    with pytest.raises(InputError, match="path"):
        page(crane, path)


# The server ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def server() -> Iterator[PageServer]:
    with PageServer("<p>hello</p>") as running:
        yield running


def ask(server: PageServer, path: str = "/", **headers: str) -> tuple[int, str, http.client.HTTPMessage]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read().decode()
    connection.close()
    return answer.status, body, answer.headers


def test_the_page_is_served_to_this_machine(server: PageServer) -> None:
    status, body, headers = ask(server)
    assert (status, body) == (200, "<p>hello</p>")
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert ask(server, Host=f"localhost:{server.port}")[0] == 200


def test_a_foreign_name_or_page_is_refused(server: PageServer) -> None:
    assert ask(server, Host="evil.example")[0] == 403
    assert ask(server, Host=f"evil.example:{server.port}")[0] == 403
    assert ask(server, Origin="http://evil.example")[0] == 403
    assert ask(server, path="/etc/passwd")[0] == 404


def test_the_server_listens_on_the_loopback_address_alone(server: PageServer) -> None:
    assert server.url == f"http://127.0.0.1:{server.port}/"
    with pytest.raises((ConnectionError, TimeoutError)):
        socket.create_connection(("127.0.0.2", server.port), timeout=2).close()


def test_a_port_that_is_taken_or_no_port_is_refused(server: PageServer) -> None:
    for port in (server.port, 70000):
        with pytest.raises(InputError, match=f"port {port}"):
            PageServer("", port)


SERVE_AND_PRESS_CTRL_C = """
import os, signal, threading
from rrtik_ompl.scene import Scene
from rrtik_ompl.viewer import view
signal.signal(signal.SIGINT, signal.default_int_handler)
def ready(url):
    print(url)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
print(view(Scene(), on_ready=ready))
"""


def test_serving_ends_quietly_when_ctrl_c_is_pressed() -> None:
    command = [sys.executable, "-c", SERVE_AND_PRESS_CTRL_C]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\nNone\n", ended.stdout)
    assert ended.stderr == ""


# In a browser -------------------------------------------------------------------------------------------------------

PANE = np.s_[50:700, 0:860]  # of a window of 1280 x 800: where the 3-D picture is


def chromium(url: str, *options: str) -> str:
    if CHROMIUM is None:
        pytest.skip("no chromium on PATH: pages cannot be looked at")
    common = (
        "--headless=new",
        "--no-sandbox",
        "--hide-scrollbars",
        "--window-size=1280,800",
        "--virtual-time-budget=8000",
    )
    graphics = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    ended = subprocess.run(
        [CHROMIUM, *common, *graphics, *options, url], capture_output=True, text=True, timeout=120, check=True
    )
    return ended.stdout


def screenshot(target: Path, fragment: str) -> np.ndarray:
    import cv2

    picture = target.with_suffix(".png")
    chromium(f"{target.as_uri()}{fragment}", f"--screenshot={picture}")
    return cv2.imread(str(picture))[PANE][..., ::-1].astype(float)


def share_of(color: str, picture: np.ndarray, likeness: float) -> float:
    """Share of pixels of a hue, whatever their lightness."""
    wanted = np.array(palette.fractions(color))
    wanted = (wanted - wanted.mean()) / np.linalg.norm(wanted - wanted.mean())
    tint = picture - picture.mean(axis=2, keepdims=True)
    strength = np.linalg.norm(tint, axis=2)
    alike = (tint @ wanted) > likeness * strength
    return float((alike & (strength > 25.0)).mean())


@pytest.fixture
def file(text: str, tmp_path: Path) -> Path:
    target = tmp_path / "view.html"
    target.write_text(text, encoding="utf-8")
    return target


def test_a_browser_shows_obstacles_trail_ghosts_and_a_robot_that_moves(file: Path) -> None:
    at_start, later = screenshot(file, ""), screenshot(file, "#waypoint=2")
    for picture in (at_start, later):
        assert share_of(palette.OBSTACLE, picture, 0.985) > 0.005
        assert share_of(palette.TRAIL, picture, 0.99) > 0.0005
        assert share_of(palette.GOAL, picture, 0.9) > 0.001
        assert (picture.max(axis=2) < 170).mean() > 0.005
    assert share_of(palette.START, later, 0.9) > 0.001
    assert (np.abs(at_start - later).max(axis=2) > 30).mean() > 0.005


def test_the_page_reads_degrees_metres_and_the_tip_where_the_robot_has_it(file: Path, crane: Robot) -> None:
    shown = chromium(f"{file.as_uri()}#waypoint=3", "--dump-dom").replace("\u2212", "-")
    assert 'data-ready="yes"' in shown
    assert re.search(r">slew</td><td[^>]*>68\.8 deg</td><td[^>]*>\u2192 -57\.3<", shown)
    assert re.search(r">hoist</td><td[^>]*>0\.700 m</td>", shown)
    assert re.search(r">spin</td><td[^>]*>229\.2 deg</td>", shown)
    assert "Move 4 of 4: slew 68.8 \u2192 -57.3 deg" in shown
    x, y, z = crane.fk(WAYPOINTS[3]).translation
    assert f"tip (hand): x {x:.3f}, y {y:.3f}, z {z:.3f} m" in shown
