"""The arm over a picture: silhouettes against a plain z-buffer, registration against projection, what hides what."""

import cv2
import numpy as np
import pinocchio as pin
import pytest

from bench.shared.reference_z_buffer import reference_z_buffer
from rrtik_bench.sensing.synthetic_camera import published_camera
from rrtik_ompl import load_robot
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Prism, Sphere
from rrtik_ompl.pilot.overlay import augment
from rrtik_ompl.pilot.overlay.augment import MAX_LAYERS, Augmenter, Ghost
from rrtik_ompl.pilot.overlay.rasterizer import (
    FARTHEST_DRAWN,
    Canvas,
    Placed,
    figure_of,
    obstacle_surfaces,
    placed,
    robot_surfaces,
    surface_of_shape,
)
from rrtik_ompl.pilot.overlay.virtual_camera import background, orbit_pose, pinhole_camera

CAMERA = published_camera()
BENT = published_camera((0.05, -0.12, 0.0005, -0.0007, 0.03))
EYE = orbit_pose([0.8, 0.0, 0.2], 2.2, np.radians(-50.0), np.radians(25.0))


@pytest.fixture(params=["of this OpenCV", "in numpy"])
def rasterizer(request, monkeypatch):
    """OpenCV's rasteriser if it has one, which came with version 5, and ours without it."""
    if request.param == "in numpy":
        monkeypatch.delattr(cv2, "triangleRasterize", raising=False)


@pytest.mark.usefixtures("rasterizer")
@pytest.mark.parametrize("name", ["titan4", "ur5"])
def test_silhouette_and_depth_are_those_of_a_z_buffer(name):
    robot = load_robot(name)
    arm = figure_of(robot_surfaces(robot, 3000))
    q = 0.3 * np.ones(robot.dof)
    shown = placed(arm, EYE.inverse().homogeneous @ robot.joint_frames(q[None])[0])
    canvas = Canvas(CAMERA)
    canvas.draw(shown)
    truth, _ = reference_z_buffer(CAMERA, shown)
    assert canvas.drawn.sum() > 3000
    assert np.array_equal(canvas.drawn, truth < FARTHEST_DRAWN)
    assert np.abs(canvas.depths - truth)[canvas.drawn].max() < 1e-4


@pytest.mark.usefixtures("rasterizer")
@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "lens"])
def test_what_is_drawn_lies_where_the_camera_sees_it(camera):
    rng = np.random.default_rng(0)
    for _ in range(12):
        centre = rng.uniform([-0.35, -0.25, 0.9], [0.35, 0.25, 2.0])
        ball = figure_of([surface_of_shape(Sphere(0.01), "#ffffff")])
        canvas = Canvas(camera)
        canvas.draw(placed(ball, pose(centre).homogeneous[None]))
        v, u = np.nonzero(canvas.drawn)
        assert np.array([u.mean(), v.mean()]) == pytest.approx(camera.project(centre[None])[0], abs=0.5)


def test_colours_are_mixed_in_space_and_a_floor_may_reach_behind_the_camera(monkeypatch):
    monkeypatch.delattr(cv2, "triangleRasterize", raising=False)
    points = np.array([[0.0, 0.5, 40.0], [-30.0, 0.5, -10.0], [30.0, 0.5, -10.0]], np.float32)  # half a metre below
    shades = 0.5 + 0.01 * points[:, 2:] * np.ones(3, np.float32)  # linear in the depth
    canvas = Canvas(CAMERA)
    for faces in ([[0, 1, 2]], [[0, 2, 1]]):
        canvas.draw(Placed(points, np.array(faces, np.int32), shades))  # one of them is seen from inside

    (_, _, cx), (_, fy, cy), _ = CAMERA.matrix
    rows = np.arange(CAMERA.height)
    depths = 0.5 * fy / np.maximum(rows - cy, 1e-9)  # of the floor in each row
    middle = round(cx)
    shown = depths < 39.0
    assert shown.sum() > 200
    assert not canvas.drawn[: int(cy)].any()
    assert canvas.depths[shown, middle] == pytest.approx(depths[shown], rel=1e-5)
    assert canvas.colors[shown, middle, 1] == pytest.approx(0.5 + 0.01 * depths[shown], abs=1e-5)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Box([0.2, 0.3, 0.4]), 0.024),
        (Sphere(0.1), 4 / 3 * np.pi * 1e-3),
        (Cylinder(0.1, 0.3), np.pi * 3e-3),
        (Capsule(0.1, 0.3), np.pi * (3e-3 + 4e-3 / 3)),
        (Prism([[0, 0], [1, 0], [0, 1]], 0.5), 0.25),
    ],
)
def test_surfaces_are_closed_and_face_outwards(shape, volume):
    surface = surface_of_shape(shape, "#ffffff")
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(volume, rel=0.04)
    assert np.linalg.norm(surface.normals, axis=1) == pytest.approx(1.0)


def test_a_half_space_has_no_surface():
    with pytest.raises(InputError, match="cannot be drawn"):
        surface_of_shape(HalfSpace([0, 0, 1], 0.0), "#ffffff")
    assert obstacle_surfaces([Obstacle("floor", HalfSpace([0, 0, 1], 0.0))]) == ()


def test_the_arm_is_drawn_and_hidden_by_what_is_really_there():
    robot = load_robot("titan4")
    grey = np.full((480, 640), 120, np.uint8)
    augmenter = Augmenter(robot, CAMERA)
    q = np.zeros(6)
    plain = augmenter.draw(grey, EYE, q)
    changed = (plain != 120).any(axis=2)
    middle = EYE.act(np.array([0.0, 0.0, 1.0]))
    wall = Obstacle("wall", Box([3.0, 3.0, 0.01]), pin.SE3(EYE.rotation, middle))
    hidden = augmenter.draw(grey, EYE, q, real=[wall])
    assert changed.sum() > 2000
    assert (hidden == 120).all()
    behind = Obstacle("wall", Box([9.0, 9.0, 0.01]), pin.SE3(EYE.rotation, EYE.act(np.array([0.0, 0.0, 8.0]))))
    assert np.array_equal(augmenter.draw(grey, EYE, q, real=[behind]), plain)


def test_ghosts_trails_and_frames_are_seen_through_and_leave_the_picture_as_it_was():
    robot = load_robot("ur5")
    grey = np.full((480, 640, 3), 120, np.uint8)
    augmenter = Augmenter(robot, CAMERA)
    q = np.zeros(6)
    other = np.full(6, 0.4)
    ghost = augmenter.draw(grey, EYE, ghosts=[Ghost(other, "#00ff00", 0.5)])
    rows = (ghost != 120).any(axis=2)
    assert rows.sum() > 500
    assert (ghost[rows][:, 1] > ghost[rows][:, 2]).all()  # greener than red
    assert (grey == 120).all()
    trail = np.array([robot.fk(q + t).translation for t in np.linspace(0.0, 0.4, 15)])
    lines = augmenter.draw(grey, EYE, trail=trail, frames=[robot.fk(q)])
    assert 50 < (lines != 120).any(axis=2).sum() < 10_000


def test_a_gripper_without_a_configuration_is_drawn_where_the_arm_would_have_it():
    robot = load_robot("titan4")
    q = robot.posture("ready")
    blank = np.zeros((CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    drawing = Augmenter(robot, CAMERA, 2000)
    arm = drawing.draw(blank, EYE, ghosts=[Ghost(q, opacity=1.0)]).any(axis=2)
    gripper = drawing.draw(blank, EYE, ghosts=[Ghost(None, opacity=1.0, T_base_tip=robot.fk(q))]).any(axis=2)
    assert 100 < gripper.sum() < 0.5 * arm.sum()
    assert (gripper & ~arm).sum() < 5
    elsewhere = robot.fk(q) * pose([0.0, 0.0, 0.3])
    assert (drawing.draw(blank, EYE, ghosts=[Ghost(None, T_base_tip=elsewhere)]).any(axis=2) != gripper).sum() > 100


def test_what_lies_behind_the_camera_is_not_drawn():
    away = pin.SE3(EYE.rotation @ np.diag([-1.0, 1.0, -1.0]), EYE.translation)
    robot = load_robot("ur5")
    grey = np.full((480, 640, 3), 120, np.uint8)
    out = Augmenter(robot, CAMERA).draw(grey, away, np.zeros(6), trail=np.zeros((5, 3)), frames=[pose([0, 0, 0.1])])
    assert (out == 120).all()


def test_what_is_kept_from_picture_to_picture_is_what_would_be_drawn_anew():
    robot = load_robot("titan4")
    grey = np.full((480, 640, 3), 120, np.uint8)
    kept = Augmenter(robot, CAMERA)
    postures = np.random.default_rng(0).uniform(-0.5, 0.5, (MAX_LAYERS + 2, 6))
    for q in postures:
        kept.draw(grey, EYE, q)
    aside = orbit_pose([0.8, 0.0, 0.2], 2.5, np.radians(-60.0), np.radians(25.0))
    first = postures[0]
    last = postures[-1]
    for q, eye, color in [(last, EYE, None), (first, EYE, None), (last, aside, None), (last, EYE, "#00ff00")]:
        box = [Obstacle("box", Box([0.3, 0.3, 0.3]), pose([0.6, float(q[0]), 0.2]))]
        new = Augmenter(robot, CAMERA)
        pictures = [each.draw(grey, eye, q, obstacles=box, color=color) for each in (kept, new)]
        assert np.array_equal(*pictures)
        assert np.array_equal(kept.depths(), new.depths())


def test_the_eye_looks_at_its_centre_with_the_world_upright():
    camera = pinhole_camera(320, 240)
    T = orbit_pose([1.0, 2.0, 0.5], 3.0, 0.7, 0.4)
    centre, above = (camera.project(T.actInv(np.array(p))[None])[0] for p in ([1, 2, 0.5], [1, 2, 1.0]))
    assert centre == pytest.approx([159.5, 119.5])
    assert above[1] < centre[1]
    assert above[0] == pytest.approx(centre[0])
    assert background(camera).shape == (240, 320, 3)


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(InputError, match="picture"):
        Augmenter(load_robot("ur5"), CAMERA).draw(np.zeros((10, 10, 3), np.uint8), EYE)


def test_ghosts_of_large_pictures_are_where_finer_ones_would_be(monkeypatch):
    camera = pinhole_camera(1280, 720)
    robot = load_robot("titan4")
    blank = np.zeros((720, 1280, 3), dtype=np.uint8)
    q = np.zeros(robot.dof)
    coarse = Augmenter(robot, camera).draw(blank, EYE, ghosts=[Ghost(q, opacity=1.0)]).any(axis=2)
    monkeypatch.setattr(augment, "FINE_PIXELS", camera.width * camera.height)
    fine = Augmenter(robot, camera).draw(blank, EYE, ghosts=[Ghost(q, opacity=1.0)]).any(axis=2)
    assert fine.sum() > 10_000
    around = np.ones((3, 3), dtype=np.uint8)
    edge = cv2.dilate(fine.view(np.uint8), around) != cv2.erode(fine.view(np.uint8), around)
    assert not (coarse != fine)[~edge].any()
    assert abs(int(coarse.sum()) - int(fine.sum())) < 0.01 * fine.sum()
