"""Limits of the tip and of torques: judged by Pinocchio, on a dense grid."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.motion.trajectory import RateLimits, time_parameterize
from rrtik_ompl.world.world import World


@pytest.fixture(scope="module")
def ur5():
    robot = load_robot("ur5")
    rows = [[0.0, -1.2, 1.0, -1.0, 0.5, 0.0], [1.0, -0.6, 0.6, -1.4, 0.2, 1.0], [1.6, -1.4, 1.3, -0.5, -0.4, 1.0]]
    return robot, JointPath.of(robot, rows)


def dense(motion, count=4000):
    return motion(np.linspace(0.0, motion.duration, count))


def tips_at(robot, rows):
    data, tip = robot.model.createData(), robot.model.getFrameId(robot.tip)
    found = []
    for q in robot.pinocchio_configuration(rows):
        pin.framesForwardKinematics(robot.model, data, q)
        found.append(data.oMf[tip].translation.copy())
    return np.array(found)


def torques(robot, state, mass):
    model = robot.model.copy()
    tip = model.frames[model.getFrameId(robot.tip)]
    model.inertias[tip.parentJoint] += pin.Inertia(mass, tip.placement.translation, np.zeros((3, 3)))
    data = model.createData()
    return np.array([pin.rnea(model, data, *row).copy() for row in zip(*state, strict=True)])


@pytest.mark.parametrize("blend", [0.0, 0.3])
@pytest.mark.parametrize("jerk", [np.inf, 60.0])
def test_the_tip_keeps_its_speed_and_acceleration(ur5, blend, jerk):
    robot, path = ur5
    limits = RateLimits.of(robot, jerk=jerk)
    free = time_parameterize(path, limits, blend=blend, world=World(robot))
    motion = time_parameterize(path, limits, blend=blend, world=World(robot), tip_speed=0.4, tip_acceleration=1.0)
    clock = np.linspace(0.0, motion.duration, 4001)
    tips, h = tips_at(robot, motion(clock).positions), motion.duration / 4000
    speeds = np.linalg.norm(np.diff(tips, axis=0), axis=1) / h
    pushes = np.linalg.norm(np.diff(tips, 2, axis=0), axis=1) / h**2
    assert 0.3 < speeds.max() <= 0.4 * 1.001
    assert 0.5 < pushes.max() <= 1.0 * 1.01
    assert motion.duration > free.duration
    assert (motion.peaks().velocity <= limits.velocity).all()


@pytest.mark.parametrize("name", ["ur5", "panda"])
@pytest.mark.parametrize("jerk", [np.inf, 60.0])
def test_torques_with_three_kilograms_in_the_hand_stay_within_their_limits(name, jerk):
    robot = load_robot(name)
    middle = robot.posture("default") if name == "panda" else np.array([0.0, -1.2, 1.0, -1.0, 0.5, 0.0])
    step = 0.35 * np.resize([1.0, -0.7, 0.6, 0.8], robot.dof)
    path = JointPath.of(robot, [middle - step, middle + 0.5 * step[::-1], middle + step])
    limits = RateLimits.of(robot, acceleration=40.0, jerk=jerk)
    efforts = np.array(robot.model.upperEffortLimit)
    rest = np.zeros_like(path.waypoints)
    most = np.minimum(efforts, np.abs(torques(robot, (path.waypoints, rest, rest), 3.0)).max(axis=0) + 8.0)
    world = World(robot)
    fast = time_parameterize(path, limits, blend=0.2, world=world)
    motion = time_parameterize(path, limits, blend=0.2, world=world, torque=most, payload=3.0)
    assert (np.abs(torques(robot, dense(fast), 3.0)) > most).any()  # it matters
    assert (np.abs(torques(robot, dense(motion), 3.0)) <= most * 1.001).all()
    with pytest.raises(InputError, match="hold the arm still") as caught:
        time_parameterize(path, limits, blend=0.2, world=world, torque=True, payload=300.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tip_speed": np.inf}, "tip speed"),
        ({"tip_speed": 0.0}, "tip speed"),
        ({"tip_speed": 250.0}, "for 250 mm/s give 0.25"),
        ({"tip_acceleration": -1.0}, "tip acceleration"),
        ({"tip_acceleration": 2000.0}, r"for 2000 mm/s\^2 give 2"),
        ({"torque": [1.0]}, "torque limits"),
        ({"torque": 0.0}, "greater than 0"),
        ({"payload": 1.0}, "payload"),
        ({"payload": -1.0, "torque": True}, "payload"),
    ],
)
def test_limits_that_are_none_are_refused_in_one_line(ur5, options, words):
    robot, path = ur5
    with pytest.raises(InputError, match=words) as caught:
        time_parameterize(path, robot, **options)
    assert "\n" not in str(caught.value)


def test_limits_of_the_tip_need_a_robot_and_torques_inertias(ur5):
    with pytest.raises(InputError, match="robot"):
        time_parameterize(ur5[1], RateLimits.of(ur5[0]), tip_speed=1.0)
    planar = load_robot("planar3")
    with pytest.raises(InputError, match="no inertias"):
        time_parameterize(JointPath.of(planar, [[0.0] * 3, [1.0] * 3]), planar, torque=5.0)


def test_the_force_of_a_joint_that_slides_is_said_in_newtons():
    mass = '<inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    joint = '<joint name="lift" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="0 0 1"/>'
    joint += '<limit lower="0" upper="1" effort="20" velocity="1"/></joint>'
    robot = robot_from_urdf_text(f'<robot name="r"><link name="base"/><link name="car">{mass}</link>{joint}</robot>')
    with pytest.raises(InputError, match=r"'lift'.*49\.\d N.*20 N"):
        time_parameterize(JointPath.of(robot, [[0.0], [1.0]]), robot, torque=True)
