"""MPlib's planner: called as its users call it, judged by Pinocchio and by the exact world of the whole robot."""

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import CloudWarning, InputError, PoseWarning, UnknownNameError
from rrtik_ompl.compat import mplib
from rrtik_ompl.compat.mplib import planner as screws
from rrtik_ompl.compat.mplib.collision_detection import fcl
from rrtik_ompl.compat.mplib.pose import placement
from rrtik_ompl.planning.tip_motion import attempts
from rrtik_robots.example_arms import data_folder

URDF = data_folder() / "panda_description/urdf/panda.urdf"
SRDF = data_folder() / "panda_description/srdf/panda.srdf"
HAND = "panda_hand"
START = np.array([0.0, 0.19, 0.0, -2.61, 0.0, 2.94, 0.78, 0.0137, 0.0137])
DOWN = [0.0, 1.0, 0.0, 0.0]
GOAL = np.array([0.45, 0.25, 0.35, *DOWN])
FAR = np.array([3.0, 0.0, 0.0, *DOWN])
MODEL = pin.buildModelFromUrdf(str(URDF))
pytestmark = pytest.mark.kernels


@pytest.fixture
def planner():
    return mplib.Planner(URDF, HAND, SRDF)


def hand_at(rows):
    """T_base_hand by Pinocchio for rows of the arm's joints."""
    data = MODEL.createData()
    poses = []
    for row in np.atleast_2d(rows):
        pin.framesForwardKinematics(MODEL, data, np.concatenate([row[:7], START[7:]]))
        poses.append(data.oMf[MODEL.getFrameId(HAND)].copy())
    return poses


def free_rows(planner, rows, obstacles=()):
    """Whether rows of the arm are free in the exact world of the whole robot, with the fingers where they are."""
    joints = [name for name in planner.user_joint_names if name != "panda_finger_joint2"]  # which follows the first
    robot = rrtik.load_robot(URDF, srdf=SRDF, joints=joints)
    full = np.column_stack([rows, np.full((len(rows), 1), START[7])])
    return rrtik.World(robot, rrtik.Scene(obstacles)).valid_batch(full)


def assert_timed(result, planner, step):
    assert result["status"] == "Success"
    time = result["time"]
    position = result["position"]
    velocity = result["velocity"]
    assert position.shape == velocity.shape == result["acceleration"].shape == (len(time), 7)
    assert time[0] == 0.0
    assert time[-1] == pytest.approx(result["duration"])
    assert np.diff(time).max() <= step * (1 + 1e-9)
    assert np.abs(np.diff(position, axis=0) / np.diff(time)[:, None]).max() <= planner.joint_vel_limits.max() * 1.001
    assert np.abs(velocity).max() <= planner.joint_vel_limits.max() * 1.001
    assert np.abs(result["acceleration"]).max() <= planner.joint_acc_limits.max() * 1.001


# --- poses -----------------------------------------------------------------------------------------------------------


def test_a_pose_of_both_versions_is_the_same_pose():
    T = pin.SE3(pin.Quaternion(0.5, 0.5, -0.5, 0.5).matrix(), np.array([0.1, 0.2, 0.3]))
    row = [0.1, 0.2, 0.3, 0.5, 0.5, -0.5, 0.5]
    sapien = SimpleNamespace(p=np.float32([[0.1, 0.2, 0.3]]), q=np.float32([[0.5, 0.5, -0.5, 0.5]]))
    for form in (row, np.reshape(row, (7, 1)), T.homogeneous, sapien, mplib.Pose(row[:3], row[3:]), mplib.Pose(T)):
        assert placement(form, "pose").isApprox(T, 1e-6)
    pose = mplib.Pose(row)
    assert np.asarray(pose).tolist() == pytest.approx(row)
    assert (len(pose), list(pose[:3])) == (7, [0.1, 0.2, 0.3])
    assert pose.distance(mplib.Pose()) == pytest.approx(np.sqrt(0.14) + 1.0)
    assert np.allclose((pose * pose.inv()).to_transformation_matrix(), np.eye(4))
    assert np.allclose(pose * [1.0, 2.0, 3.0], T.act(np.array([1.0, 2.0, 3.0])))


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ([0.1, 0.2, 0.3, 90.0, 0.0, 0.0, 45.0], "order is w, x, y, z"),
        ([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0], "length 1"),
        ([0.1, 0.2, 0.3, 3.14, 0.0, 0.0], "got 6 numbers"),
        ([0.1, np.nan, 0.3, 1.0, 0.0, 0.0, 0.0], "finite"),
        ("here", "expected numbers"),
    ],
)
def test_a_pose_that_is_none_is_refused_in_one_line(planner, pose, words):
    for call in (planner.plan_pose, planner.plan_qpos_to_pose, planner.plan_screw, planner.IK):
        with pytest.raises(InputError, match=words) as raised:
            call(pose, START)
        assert "\n" not in str(raised.value)


def test_a_quaternion_in_the_other_order_is_named(planner):
    with pytest.warns(PoseWarning, match="half a turn about z"):
        planner.set_base_pose([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    planner.set_base_pose(mplib.Pose())
    result = planner.plan_pose([0.6, 0.0, -0.1, 1.0, 0.0, 0.0, 0.0], START)  # meant to point down: x, y, z, w
    assert result["status"] == "IK Failed! Cannot find valid solution."
    assert "MPlib's order is w, x, y, z" in result["reason"]


# --- plans -----------------------------------------------------------------------------------------------------------


def test_the_poses_of_both_versions_are_reached_in_time_and_free(planner):
    old = planner.plan_qpos_to_pose(GOAL, START, None, 0.02)
    new = planner.plan_pose(mplib.Pose(GOAL), START, time_step=0.02)
    for result in (old, new):
        assert_timed(result, planner, 0.02)
        assert result["proven"]
        assert np.allclose(result["position"][0], START[:7])
        assert hand_at(result["position"][-1])[0].isApprox(placement(GOAL, ""), 1e-4)
        assert free_rows(planner, result["position"]).all()
    assert np.array_equal(old["position"], new["position"])  # the same seed, the same motion


def test_the_calls_of_maniskill_move_the_tip_along_screws(planner):
    """As its BaseMotionPlanningSolver makes and calls a planner, with poses that its scripts ask for."""
    links = planner.user_link_names
    joints = planner.user_joint_names
    planner = mplib.Planner(
        urdf=str(URDF), srdf=str(SRDF), user_link_names=links, user_joint_names=joints, move_group=HAND
    )
    planner.set_base_pose(np.hstack([np.float32([-0.615, 0.0, 0.0]), np.float32([1.0, 0.0, 0.0, 0.0])]))
    planner.joint_vel_limits = np.asarray(planner.joint_vel_limits) * 0.9
    planner.joint_acc_limits = np.asarray(planner.joint_acc_limits) * 0.9
    base = pin.SE3(np.eye(3), np.array([-0.615, 0.0, 0.0]))
    q = START.astype(np.float32)
    for target in ([-0.05, 0.06, 0.17, *DOWN], [-0.05, 0.06, 0.12, *DOWN], [0.1, -0.1, 0.3, 0.1, 0.99, 0.05, 0.086]):
        pose = np.float32(target)
        pose[3:] /= np.linalg.norm(pose[3:])
        result = planner.plan_screw(pose, q, time_step=0.05, use_point_cloud=False)
        assert_timed(result, planner, 0.05)
        assert result["proven"]
        begin = hand_at(q)[0]
        end = base.inverse() * placement(pose, "")
        turn = pin.log6(end * begin.inverse())
        way = [pin.exp6(pin.Motion(s * turn.vector)) * begin for s in np.linspace(0.0, 1.0, 400)]
        for hand in hand_at(result["position"]):
            assert min(np.linalg.norm(hand.translation - each.translation) for each in way) < 2e-3
        assert hand_at(result["position"][-1])[0].isApprox(end, 1e-4)
        q = np.concatenate([result["position"][-1], START[7:]]).astype(np.float32)


def test_a_screw_to_a_goal_a_little_out_of_reach_ends_where_it_is_nearest_and_says_so(planner):
    goal = np.array([0.7924, -0.1346, 0.1234, *DOWN])  # where ManiSkill's PullCubeTool-v1 sends the hand, seed 6
    start = np.array([-0.1388, 0.5532, 0.06, -1.3128, -0.0322, 1.8556, 0.7066, 0.0231, 0.0231])
    with pytest.warns(PoseWarning, match=r"plan_screw: the motion ends 3\.5 mm and 0\.14 deg from the goal"):
        result = planner.plan_screw(goal, start, time_step=0.05)
    assert "the end of the reach" in result["reason"]
    assert_timed(result, planner, 0.05)
    assert result["proven"]
    off = placement(goal, "").actInv(hand_at(result["position"][-1])[0])
    assert np.linalg.norm(off.translation) == pytest.approx(3.5e-3, abs=5e-5)
    assert np.linalg.norm(pin.log3(off.rotation)) == pytest.approx(np.radians(0.14), abs=1e-4)
    assert planner.IK(goal, start)[0] == "IK Failed! Cannot find valid solution."
    goal[0] += 0.02
    assert planner.plan_screw(goal, start)["status"] == "screw plan failed"


def test_a_screw_that_is_stopped_by_a_contact_is_not_called_out_of_reach(planner, monkeypatch):
    whole = attempts.attempt

    def stopped(world, way, q, leaning):
        found = whole(world, way, q, leaning)
        return replace(found, rows=found.rows[:-1], proof=None, fraction=0.98, why=lambda: "hand touches the box")

    for module, name in ((screws, "attempt"), (attempts, "attempt")):
        monkeypatch.setattr(module, name, stopped)
    with pytest.warns(PoseWarning, match="the screw ends after 98 % of the way: hand touches the box"):
        result = planner.plan_screw(GOAL, START)
    assert_timed(result, planner, 0.1)
    assert hand_at(result["position"][-1])[0].isApprox(placement(GOAL, ""), 1e-3)
    assert "reach" not in result["reason"]


def test_the_names_of_arguments_of_both_versions_are_taken(planner):
    first = planner.plan_screw(target_pose=GOAL, qpos=START)
    second = planner.plan_screw(goal_pose=mplib.Pose(GOAL), current_qpos=START[:7])
    assert first["status"] == second["status"] == "Success"
    assert planner.plan_screw(np.asarray(planner.transform_goal_to_wrt_base(GOAL)), START, wrt_world=False)["proven"]


def test_what_is_not_found_has_the_status_lines_of_mplib_and_a_reason(planner):
    for call, status in (
        (planner.plan_pose, "IK Failed! Cannot find valid solution."),
        (planner.plan_qpos_to_pose, "IK Failed! Cannot find valid solution."),
        (planner.plan_screw, "screw plan failed"),
    ):
        result = call(FAR, START)
        assert (result["status"], bool(result["reason"])) == (status, True)
    blocked = planner.IK(GOAL, START)[1][0]
    planner.put_object("block", fcl.Box([0.1, 0.1, 0.1]), [0.45, 0.25, 0.3, 1.0, 0.0, 0.0, 0.0])
    goal = planner.IK(mplib.Pose([0.45, -0.25, 0.35], DOWN), START)[1][0]
    assert planner.plan_qpos([goal], blocked)["status"] == "RRTConnect Failed. Invalid start"
    assert planner.plan_qpos_to_qpos([blocked], goal)["status"] == "RRT Failed. Invalid goal"
    assert planner.plan_qpos([blocked, goal], START)["status"] == "Success"
    assert planner.plan_screw(GOAL, START)["status"] == "screw plan failed"


def test_joints_that_are_fixed_or_masked_stand_still(planner):
    goal = START.copy()
    goal[[1, 3]] += 0.2, 0.3
    result = planner.plan_qpos([goal], START, fixed_joint_indices=[0, 2])
    assert_timed(result, planner, 0.1)
    assert np.ptp(result["position"][:, [0, 2]], axis=0).max() == 0.0
    status, found = planner.IK(GOAL, START, mask=[False, False, True, False, False, False, False, False, False])
    assert status == "Success"
    assert [q[2] for q in found] == [START[2]] * len(found)


def test_inverse_kinematics_answers_as_its_version_does(planner):
    status, found = planner.IK(GOAL, START)
    assert status == "Success"
    assert all(hand_at(q)[0].isApprox(placement(GOAL, ""), 1e-3) for q in found)
    distances = [np.linalg.norm(q - START) for q in found]
    assert distances == sorted(distances)
    assert np.array_equal(planner.IK(mplib.Pose(GOAL), START, return_closest=True)[1], found[0])
    assert planner.IK(FAR, START) == ("IK Failed! Cannot find valid solution.", [])
    assert planner.IK(mplib.Pose(FAR), START) == ("IK Failed! Cannot find valid solution.", None)


def test_a_path_is_timed_as_for_robotwin(planner):
    path = np.array([START[:7], START[:7] + 0.2, START[:7] - 0.1 * np.arange(7)])
    time, position, velocity, acceleration, duration = planner.TOPP(path, 1 / 250, verbose=True)
    assert_timed(
        {"status": "Success", "time": time, "position": position, "velocity": velocity}
        | {"acceleration": acceleration, "duration": duration},
        planner,
        1 / 250,
    )
    assert np.allclose(position[[0, -1]], path[[0, -1]])


# --- the world -------------------------------------------------------------------------------------------------------


def test_a_cloud_counts_unless_the_call_says_otherwise(planner):
    x, z = np.meshgrid(np.linspace(0.35, 0.8, 60), np.linspace(0.0, 0.45, 60))
    wall = np.column_stack([x.ravel(), np.full(x.size, 0.2), z.ravel()])
    goal = np.array([0.45, 0.42, 0.25, *DOWN])
    planner.set_base_pose([0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0])
    shift = np.array([0.5, 0.0, 0.1])
    goal[:3] += shift
    planner.update_point_cloud(wall + shift, 0.005)
    cloud = [rrtik.Obstacle("wall", rrtik.PointCloud(wall, 0.005))]
    around = planner.plan_pose(goal, START)
    through = planner.plan_pose(goal, START, use_point_cloud=False)
    assert around["proven"]
    assert free_rows(planner, around["position"], cloud).all()
    assert not free_rows(planner, through["position"], cloud).all()
    hit = np.flatnonzero(~free_rows(planner, through["position"], cloud))[0]
    middle = np.concatenate([through["position"][hit], START[7:]])
    assert {each.object_name2 for each in planner.check_for_env_collision(middle)} == {"scene_pcd"}
    assert planner.check_for_env_collision(planner.robot, middle, with_point_cloud=False) == []
    assert planner.remove_point_cloud()
    assert not planner.remove_point_cloud()


def test_the_next_cloud_gives_the_answers_of_a_new_planner(planner):
    x, z = np.meshgrid(np.linspace(0.35, 0.8, 60), np.linspace(0.0, 0.45, 60))
    wall = np.column_stack([x.ravel(), np.full(x.size, 0.2), z.ravel()])
    goal = np.array([0.45, 0.42, 0.25, *DOWN])
    rows = np.random.default_rng(3).uniform(-1.0, 1.0, (40, 9)) * 0.6 + START
    clouds = [wall, wall[::3] + np.array([0.0, 0.1, 0.0]), wall + np.array([0.05, -0.05, 0.0])]
    for cloud in clouds:
        planner.update_point_cloud(cloud, 0.005)
        fresh = mplib.Planner(URDF, HAND, SRDF)
        fresh.update_point_cloud(cloud, 0.005)
        hits = [[len(each.check_for_env_collision(row)) for row in rows] for each in (planner, fresh)]
        assert hits[0] == hits[1]
        assert any(hits[0])
        around = planner.plan_pose(goal, START)
        assert around["proven"]
        assert free_rows(planner, around["position"], [rrtik.Obstacle("wall", rrtik.PointCloud(cloud, 0.005))]).all()


def test_points_that_are_none_are_counted_and_an_empty_cloud_is_none(planner):
    with pytest.warns(CloudWarning, match="2 of 3 points are not finite"):
        planner.update_point_cloud([[0.5, 0.5, np.nan], [np.inf, 0.0, 0.0], [0.5, 0.5, 0.5]])
    assert planner.object_names == ["scene_pcd"]
    with pytest.warns(CloudWarning, match="empty"):
        planner.update_point_cloud(pc=np.empty((0, 3)), radius=0.002)
    assert planner.object_names == []
    with pytest.warns(CloudWarning, match="empty"), pytest.warns(CloudWarning, match="1 of 1 points are not finite"):
        planner.update_point_cloud([[np.nan] * 3])
    with pytest.raises(InputError, match=r"\(n, 3\)"):
        planner.update_point_cloud(np.zeros((4, 2)))


def test_what_is_attached_counts_until_it_is_detached(planner):
    free = planner.check_for_self_collision(START) + planner.check_for_env_collision(START)
    assert free == []
    planner.robot.set_qpos(START, True)
    planner.put_object("table", fcl.CollisionObject(fcl.Box([1.0, 1.0, 0.1]), [0.5, 0.0, -0.05, 1.0, 0.0, 0.0, 0.0]))
    planner.update_attached_box([0.04, 0.04, 0.9], np.reshape([0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0], (7, 1)))
    (name,) = planner.attached_names
    (hit,) = planner.planning_world.check_robot_collision()
    assert (hit.collision_type, hit.link_name1, hit.link_name2) == ("attached_sceneobject", name, "table")
    assert planner.check_for_env_collision(START, use_attach=False) == []
    assert planner.plan_screw(GOAL, START)["status"] == "screw plan failed"
    planner.acm.set_entry(name, "table", True)
    assert planner.check_for_env_collision() == []
    assert planner.detach_object(name, also_remove=True)
    assert not planner.detach_object(name)
    assert planner.plan_screw(GOAL, START)["proven"]


def test_an_object_is_taken_along_and_put_down(planner):
    planner.robot.set_qpos(START)
    world = planner.planning_world
    link = planner.move_group_link_id
    hand = hand_at(START)[0]
    at = hand.act(np.array([0.0, 0.0, 0.12]))
    world.add_object(fcl.FCLObject("cup", [*at, 1, 0, 0, 0], [fcl.CollisionObject(fcl.Sphere(0.03))]))
    planner.attach_object("cup", link)
    assert world.is_object_attached("cup")
    result = planner.plan_screw(GOAL, START)
    planner.robot.set_qpos(result["position"][-1])
    assert planner.detach_object("cup")
    ((_, place),) = planner._objects["cup"]
    assert np.allclose(place.translation, placement(GOAL, "").act(np.array([0.0, 0.0, 0.12])), atol=1e-3)
    assert world.remove_object("cup")
    assert not world.has_object("cup")


def test_kinematics_answer_as_to_robomme(planner):
    planner.pinocchio_model.compute_forward_kinematics(START)
    row = planner.pinocchio_model.get_link_pose(planner.link_name_2_idx[planner.move_group])
    hand = hand_at(START)[0]
    assert np.allclose(row[:3], hand.translation)
    assert placement(np.concatenate([row[:3], row[3:]]), "").isApprox(hand, 1e-9)
    assert planner.joint_limits.shape == (9, 2)
    assert planner.move_group_joint_indices == list(range(7))
    assert planner.wrap_joint_limit(START + 2.0 * np.pi * np.array([0, 0, 0, 0, 0, 0, 1, 0, 0]))


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("qpos", "words"),
    [
        (np.degrees(START), "np.radians"),
        (START[:5], "expected 9 values"),
        (np.where(np.arange(9) == 3, np.nan, START), "finite"),
    ],
)
def test_joints_that_are_none_are_refused_in_one_line(planner, qpos, words):
    for call in (planner.plan_pose, planner.plan_qpos_to_pose, planner.plan_screw, planner.IK):
        with pytest.raises(InputError, match=words) as raised:
            call(GOAL, qpos)
        assert "\n" not in str(raised.value)


def test_what_a_planner_cannot_be_made_of_is_refused(planner, tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        mplib.Planner(tmp_path / "none.urdf", HAND)
    with pytest.raises(UnknownNameError, match="panda_hand"):
        mplib.Planner(URDF, "panda_hnad", SRDF)
    with pytest.raises(UnknownNameError, match="panda_joint1"):
        mplib.Planner(URDF, HAND, SRDF, user_joint_names=["panda_jont1"])
    with pytest.raises(InputError, match="expected 7 numbers"):
        mplib.Planner(URDF, HAND, SRDF, joint_vel_limits=np.ones(9))
    with pytest.raises(InputError, match="1 objects, but 2 normal_object_names"):
        mplib.Planner(URDF, HAND, SRDF, normal_objects=[object()], normal_object_names=["a", "b"])
    with pytest.raises(InputError, match="constraint_function"):
        planner.plan_pose(GOAL, START, constraint_function=print)
    with pytest.raises(InputError, match="one configuration"):
        planner.plan_qpos([], START)


def test_the_modules_of_mplib_are_where_its_users_import_them():
    assert importlib.import_module("rrtik_ompl.compat.mplib.planner").Planner is mplib.Planner
    assert importlib.import_module("rrtik_ompl.compat.mplib.collision_detection").fcl is fcl
