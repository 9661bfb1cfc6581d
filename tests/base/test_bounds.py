"""How many of everything there may be: above that, one line says the number and the limit."""

import subprocess
import sys

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.description.urdf import robot_from_urdf_text


def urdf(joints):
    """A chain of so many joints, about y and z in turn, one of them sliding, one without limits."""
    kinds = ["revolute"] * joints
    kinds[1:3] = ["prismatic", "continuous"][: joints - 1]
    link = '<link name="l{0}"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
    joint = (
        '<joint name="j{0}" type="{2}"><parent link="l{0}"/><child link="l{1}"/><origin xyz="0 0 1"/>'
        '<axis xyz="{3}"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )
    links = "".join(link.format(k) for k in range(joints + 1))
    axes = ("0 1 0", "0 0 1", "0.6 0.8 0")
    chain = "".join(joint.format(k, k + 1, kind, axes[k % 3]) for k, kind in enumerate(kinds))
    return f"<robot name='r'>{links}{chain}</robot>"


def planar(joints):
    return rrtik.load_robot("planar", parameters={"lengths": np.full(joints, 0.05)})


def straight(length):
    return rrtik.JointPath([[0.0], [length]])


BALL = rrtik.Sphere(0.1)
TOO_MANY = {
    "joints of a URDF": (lambda: robot_from_urdf_text(urdf(1_100)), "1100 are more than the 1001"),
    "rows of a DH table": (
        lambda: robot_from_dh("arm", [DhRow(a=0.1)] * 1_500, convention="standard"),
        "1501 are more than the 1001",
    ),
    "lengths of a planar arm": (
        lambda: rrtik.load_robot("planar", parameters={"lengths": np.ones(1_000_000)}),
        "1000001 are more than the 1001",
    ),
    "moving joints of a world": (lambda: rrtik.World(planar(1_000)), "1000 are more than the 200 .*fix some"),
    "moving joints of inverse kinematics": (
        lambda: rrtik.solve_ik(planar(201), rrtik.PositionGoal([5, 5, 0])),
        "201 are more than the 200",
    ),
    "obstacles": (lambda: rrtik.Scene([rrtik.Obstacle(f"o{k}", BALL) for k in range(10_001)]), "10001 .* 10000"),
    "triangles": (
        lambda: rrtik.Mesh(np.eye(3), np.broadcast_to(np.int8([0, 1, 2]), (5_000_001, 3))),
        "5000001 .* 5000000 .*simplify",
    ),
    "waypoints": (lambda: rrtik.JointPath(np.zeros((1_000_001, 1))), "1000001 .* 1000000"),
    "waypoints in small steps": (lambda: straight(1.0).resample(1e-12), "small steps: 1000000000000 .* 1000000"),
    "samples of a map": (
        lambda: rrtik.ik.reach_map(rrtik.load_robot("planar3"), samples=10**15),
        "samples: 1000000000000000 .* 1000000000",
    ),
    "times of a motion": (
        lambda: rrtik.Trajectory([0.0, 1.0], [[0.0], [0.5]], [[0.0], [0.0]]).sample(1e12),
        "at that rate: 1000000000000 ",
    ),
}


@pytest.mark.parametrize("case", TOO_MANY)
def test_too_many_are_refused_with_their_number_and_the_limit(case):
    call, message = TOO_MANY[case]
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_the_axes_of_a_long_chain_are_those_that_its_file_says():
    robot = robot_from_urdf_text(urdf(12))
    q = np.random.default_rng(1).uniform(-1.0, 1.0, 12)
    for k in range(12):  # by differences, the axis of each joint moves the tip as the Jacobian says
        step = np.zeros(12)
        step[k] = 1e-6
        moved = (robot.fk(q + step).translation - robot.fk(q - step).translation) / 2e-6
        assert moved == pytest.approx(robot.jacobian(q)[:3, k], abs=1e-8)


@pytest.mark.parametrize("joints", [7, 200, 201])
def test_long_arms_are_where_their_angles_say(joints):
    robot, q = planar(joints), np.random.default_rng(1).uniform(-0.1, 0.1, joints)
    turned = np.cumsum(q)
    x, y = 0.05 * np.cos(turned).sum(), 0.05 * np.sin(turned).sum()
    assert robot.fk(q).translation == pytest.approx([x, y, 0.0], abs=1e-9)
    assert robot.jacobian(q)[:2, 0] == pytest.approx([-y, x], abs=1e-9)
    assert robot.jacobian(q) == pytest.approx(robot.jacobian_batch(q[None])[0], abs=1e-9)


LOAD = """
import resource, sys, time
from rrtik_ompl.description.urdf import robot_from_urdf_text
from test_bounds import urdf
robot_from_urdf_text(urdf(10))
text = urdf(int(sys.argv[1]))
before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
assert robot_from_urdf_text(text).dof == int(sys.argv[1])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_the_memory_of_loading_a_robot_grows_with_its_joints_and_not_their_square():
    def kilobytes(joints):
        done = subprocess.run(
            [sys.executable, "-c", LOAD, str(joints)], cwd=__file__.rpartition("/")[0], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return int(done.stdout)

    assert kilobytes(1000) < 200_000  # it was gigabytes at 400
