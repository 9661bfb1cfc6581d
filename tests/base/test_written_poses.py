"""Poses in the forms in which a person writes them."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PoseWarning
from rrtik_ompl.base.poses import pose, pose_from_rpy, quaternion_xyzw, rigid
from rrtik_ompl.problem_files.poses import load_poses

XYZ, RPY = [0.4, -0.1, 0.3], [0.2, -0.5, 1.0]
POSE = pose_from_rpy(XYZ, RPY)


@pytest.mark.parametrize(
    ("form", "meant"),
    [
        (POSE, POSE),
        (POSE.homogeneous, POSE),
        (POSE.homogeneous.tolist(), POSE),
        (XYZ, pin.SE3(np.eye(3), np.array(XYZ))),
        (XYZ + RPY, POSE),
        ([*XYZ, 0.0, 0.0, 1.0, 0.0], pose(XYZ, [0.0, 0.0, 1.0, 0.0])),
    ],
)
def test_all_forms_of_a_pose_mean_the_same(form, meant):
    assert np.allclose(rigid(form, "pose").homogeneous, meant.homogeneous)
    assert np.allclose(rrtik.PoseGoal(form).T_world_tip.homogeneous, meant.homogeneous)
    robot = rrtik.load_robot("ur5", base_pose=form)
    assert np.allclose(robot.fk(np.zeros(6), "base_link").homogeneous, meant.homogeneous)


def test_inverse_kinematics_takes_a_pose_in_any_form():
    robot = rrtik.load_robot("ur5")
    T = robot.fk([0.3, -1.2, 1.0, 0.4, 0.5, 0.6])
    wanted = rrtik.solve_ik(robot, rrtik.PoseGoal(T)).solutions
    quat = [*T.translation, *quaternion_xyzw(T)]
    for form in (T, T.homogeneous, T.homogeneous.tolist(), [*T.translation, *pin.rpy.matrixToRpy(T.rotation)], quat):
        assert np.allclose(rrtik.solve_ik(robot, form).solutions, wanted, atol=1e-4)


@pytest.mark.parametrize("form", [[0.1, 0.2], [[0.0, 1.0]], "here", [*XYZ, 0.0, 0.0, 2.0, 0.0], [0.0, np.nan, 0.0]])
def test_what_is_no_pose_is_refused_in_a_line(form):
    with pytest.raises(InputError, match=r"^here:") as caught:
        rigid(form, "here")
    assert "\n" not in str(caught.value)


def test_pose_takes_every_form_that_a_person_may_write():
    angles = rrtik.pose([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert angles.isApprox(rrtik.PoseGoal([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]).T_world_tip)
    assert rrtik.pose(angles.homogeneous) == angles
    with pytest.raises(InputError, match=r"pose: .*1e"):
        rrtik.pose([0.0, 0.0, 1e30])


HALF_TURN = np.diag([1.0, -1.0, -1.0])
FOLLOWS = "quat_xyzw.*read as x, y, z, w.*quat_wxyz"


def written(tmp_path, text):
    file = tmp_path / "written.yaml"
    file.write_text(text)
    return file


def scene_file(tmp_path, orientation):
    obstacle = f"{{name: a, sphere: 1, pose: {{xyz: [0, 0, 0], {orientation}}}}}"
    return written(tmp_path, f"version: 1\nscene: {{obstacles: [{obstacle}]}}\n")


def dh_file(tmp_path, orientation):
    rows = f"rows: [{{a: 1}}], tool: {{xyz: [0, 0, 0], {orientation}}}"
    return written(tmp_path, f"version: 1\nname: arm\ndh: {{convention: standard, {rows}}}\n")


def poses_file(tmp_path, orientation):
    return written(tmp_path, f"poses: [{{xyz: [0, 0, 0], {orientation}}}]\n")


DOORS = {
    "pose": lambda q, _: rrtik.pose([0, 0, 0], q),
    "row": lambda q, _: rigid([0, 0, 0, *q], "here"),
    "goal": lambda q, _: rrtik.PoseGoal([0, 0, 0, *q]),
    "obstacle": lambda q, _: rrtik.Obstacle("ball", rrtik.Sphere(0.1), [0, 0, 0, *q]),
    "region": lambda q, _: rrtik.TaskRegion([0, 0, 0, *q], np.zeros((6, 2))),
    "base": lambda q, _: rrtik.load_robot("ur5", base_pose={"xyz": [0, 0, 0], "quat_xyzw": q}),
    "scene file": lambda q, folder: rrtik.load_scene(scene_file(folder, f"quat_xyzw: {q}")),
    "table file": lambda q, folder: rrtik.load_robot(dh_file(folder, f"quat_xyzw: {q}")),
    "file of poses": lambda q, folder: load_poses(poses_file(folder, f"quat_xyzw: {q}")),
}


@pytest.mark.parametrize("door", DOORS)
def test_a_half_turn_that_would_be_no_rotation_in_another_order_is_doubted(door, tmp_path):
    with pytest.warns(PoseWarning, match=FOLLOWS) as caught:
        DOORS[door]([1.0, 0.0, 0.0, 0.0], tmp_path)
    assert len(str(caught[0].message).splitlines()) == 1
    DOORS[door]([0.0, 0.0, 0.0, 1.0], tmp_path)  # a warning is an error in tests
    DOORS[door]([0.0, 1.0, 0.0, 0.0], tmp_path)


def test_a_half_turn_is_written_without_a_warning(tmp_path):
    meant = [
        rrtik.pose([0, 0, 0], rpy=[np.pi, 0, 0]),
        rrtik.pose([0, 0, 0], quat_wxyz=[0, 1, 0, 0]),
        rigid([0, 0, 0, np.pi, 0, 0], "here"),
        rrtik.load_scene(scene_file(tmp_path, "rpy_deg: [180, 0, 0]")).obstacle("a").pose,
        rrtik.load_scene(scene_file(tmp_path, "quat_wxyz: [0, 1, 0, 0]")).obstacle("a").pose,
    ]
    for T in meant:
        assert np.allclose(T.rotation, HALF_TURN)


def test_a_half_turn_that_is_saved_is_read_without_a_warning(tmp_path):
    placement = pin.SE3(HALF_TURN, np.zeros(3))
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), placement)
    rrtik.Scene([ball]).save(tmp_path / "scene.yaml")
    assert rrtik.load_scene(tmp_path / "scene.yaml").obstacle("ball").pose == placement
    robot = rrtik.load_robot("planar3", base_pose=placement)
    rrtik.Problem(rrtik.World(robot), [0, 0, 0], [1, 0, 0]).save(tmp_path / "problem.yaml")
    again = rrtik.load_problem(tmp_path / "problem.yaml").robot
    assert (again.fk([0, 0, 0]).homogeneous == robot.fk([0, 0, 0]).homogeneous).all()


@pytest.mark.parametrize("seed", range(5))
def test_both_orders_of_a_quaternion_mean_the_same(seed):
    q = np.random.default_rng(seed).normal(size=4)
    q = q / np.linalg.norm(q)
    x, y, z, w = q
    assert rrtik.pose(XYZ, quat_wxyz=[w, x, y, z]) == rrtik.pose(XYZ, q) == rrtik.pose(XYZ, quat_xyzw=q)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"quat_xyzw": [0, 0, 0, 1], "rpy": [0, 0, 0]}, "pose: give one orientation, got quat_xyzw and rpy"),
        ({"quat_xyzw": [0, 0, 0, 1], "quat_wxyz": [1, 0, 0, 0]}, "got quat_xyzw and quat_wxyz"),
        ({"quat_wxyz": [1, 1, 0, 0]}, "pose: quat_wxyz must have length 1, but has 1.414; the order is w, x, y, z"),
        ({"quat_xyzw": [0, 0, 0]}, "pose: quat_xyzw"),
        ({"rpy": [0, 0]}, "pose: rpy"),
        ({"rpy": "down"}, "pose: rpy"),
    ],
)
def test_a_wrong_orientation_is_refused_in_a_line(given, words):
    with pytest.raises(InputError, match=words) as caught:
        rrtik.pose([0, 0, 0], **given)
    assert "\n" not in str(caught.value)


def test_an_orientation_beside_a_whole_pose_is_refused():
    with pytest.raises(InputError, match="pose: xyz"):
        rrtik.pose(np.eye(4), rpy=[0, 0, 0])


@pytest.mark.parametrize("write", [lambda rpy: rrtik.pose(XYZ, rpy=rpy), lambda rpy: rigid([*XYZ, *rpy], "here")])
def test_angles_that_look_like_degrees_are_doubted(write):
    with pytest.warns(PoseWarning, match="rpy.*read as radians.*deg2rad"):
        write([0.0, 90.0, 0.0])
    write([0.0, -2.0 * np.pi, 0.0])
