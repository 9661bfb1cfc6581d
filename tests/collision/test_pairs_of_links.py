"""Which links are compared: all but neighbours, and solids that always touch; beside Pinocchio and coal themselves."""

import pickle
import warnings
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.errors import DescriptionWarning
from rrtik_ompl.world import World

CYLINDER = '<origin xyz="0 0 -.2"/><geometry><cylinder radius=".04" length=".4"/></geometry>'
BLADE = '<origin xyz="0 0 .16"/><geometry><box size=".02 .02 .2"/></geometry>'
BALL = '<origin xyz="0 0 {}"/><geometry><sphere radius="{}"/></geometry>'
AXES = ("1 0 0", "0 0 1", "0 1 0")


def arm(*links):
    """Links one after the other, each with its solids; between any two a joint that turns."""
    names = [f"l{k}" for k in range(len(links))]
    parts = [
        f'<link name="{name}">{"".join(f"<collision>{solid}</collision>" for solid in solids)}</link>'
        for name, solids in zip(names, links, strict=True)
    ]
    parts += [
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="{AXES[k % 3]}"/>'
        '<limit lower="-3.1" upper="3.1" velocity="1" effort="1"/></joint>'
        for k in range(len(links) - 1)
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def srdf(tmp_path, content):
    file = tmp_path / "arm.srdf"
    file.write_text(f'<robot name="arm">{content}</robot>')
    return file


def touching(text, q):
    """Pairs of links that touch at a posture, of which no joint lies between directly, by Pinocchio and coal alone."""
    model = pin.buildModelFromXML(text)
    solids = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    data = model.createData()
    pin.forwardKinematics(model, data, np.asarray(q))
    found = set()
    for a, b in combinations(solids.geometryObjects, 2):
        if abs(a.parentJoint - b.parentJoint) < 2:
            continue
        poses = [data.oMi[each.parentJoint] * each.placement for each in (a, b)]
        ends = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
        if coal.collide(a.geometry, ends[0], b.geometry, ends[1], coal.CollisionRequest(), coal.CollisionResult()):
            found.add((a.parentJoint, b.parentJoint))
    return found


@pytest.mark.parametrize("between", [1, 2, 3])
def test_links_without_solids_make_no_neighbours_of_those_beside_them(between):
    text = arm([], [CYLINDER], *[[]] * between, [BLADE])
    robot = robot_from_urdf_text(text)
    world = World(robot)
    assert len(world.pairs) == 1
    Q = np.random.default_rng(between).uniform(robot.lower, robot.upper, (300, robot.dof))
    expected = [not touching(text, q) for q in Q]
    assert 10 < sum(expected) < 290
    assert world.valid_batch(Q).tolist() == expected


def test_neighbours_are_not_compared_unless_an_srdf_asks_for_it(tmp_path):
    text = arm([], [CYLINDER], [BLADE])
    assert World(robot_from_urdf_text(text)).pairs == ()
    asked = '<enable_collisions link1="l1" link2="l2"/>'
    robot = robot_from_urdf_text(text, srdf=srdf(tmp_path, asked))
    assert len(World(robot).pairs) == 1
    assert World(robot).valid([0.0, 0.0])
    assert World(pickle.loads(pickle.dumps(robot))).pairs == World(robot).pairs
    both = asked + '<disable_collisions link1="l1" link2="l2"/>'  # which has the last word in MoveIt
    assert World(robot_from_urdf_text(text, srdf=srdf(tmp_path, both))).pairs == ()


def test_of_links_that_always_touch_only_the_solids_that_do_are_left_out_and_named():
    """A hub of two balls, of which one holds the far link's near ball for ever; its far ball comes back to the hub."""
    hub, far = [BALL.format(0, 0.05), BALL.format(-0.3, 0.03)], [BALL.format(0, 0.05), BALL.format(0.3, 0.03)]
    text = arm([], hub, [], far)
    robot = robot_from_urdf_text(text)
    with pytest.warns(DescriptionWarning, match=r"'arm': not checked.*'l1' \(solid 1\) and 'l3' \(solid 1\); correct"):
        world = World(robot)
    assert len(world.pairs) == 3
    assert world.valid([0.0, 0.0, 0.0])
    assert not world.valid([0.0, 0.0, np.pi - 0.05])
    with warnings.catch_warnings():
        warnings.simplefilter("error", DescriptionWarning)  # said once for a robot
        World(robot)


def test_links_that_always_touch_over_one_without_solids_refuse_no_robot_that_has_an_srdf(tmp_path):
    ball = [BALL.format(0, 0.05)]
    file = srdf(tmp_path, '<disable_collisions link1="l0" link2="l1"/>')
    robot = robot_from_urdf_text(arm(ball, ball, [], ball), srdf=file)
    with pytest.warns(DescriptionWarning, match="'l1' and 'l3'"):
        assert not World(robot).valid(np.zeros(3))  # l0 and l3, which the file does not let touch
    also = srdf(
        tmp_path,
        '<disable_collisions link1="l0" link2="l3"/>',
    )
    robot = robot_from_urdf_text(arm(ball, ball, [], ball), srdf=also)
    with pytest.warns(DescriptionWarning, match="'l1' and 'l3'"):
        assert World(robot).valid(np.zeros(3))
