"""The page of a task shows the gripper's fingers where they are."""

from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.model.gripper import GripperJoints
from rrtik_ompl.tasks import Gripper, MoveTo, Task
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.task_story import subject_of_task
from rrtik_tests.page_pictures import screenshot

SOLID = '<{kind}><origin xyz="0 0 0.4"/><geometry><box size="0.1 0.1 {long}"/></geometry></{kind}>'
FINGER = "".join(SOLID.format(kind=kind, long=0.6) for kind in ("visual", "collision"))
URDF = f"""<robot name="fork"><link name="base"/><link name="palm"/>
<link name="left">{FINGER}</link><link name="right">{FINGER}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="palm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="out" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/>
<limit lower="0.1" upper="0.6" velocity="1" effort="1"/></joint>
<joint name="out2" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="-1 0 0"/>
<limit lower="0.1" upper="0.6" velocity="1" effort="1"/><mimic joint="out"/></joint></robot>"""


@pytest.fixture(scope="module")
def closing(tmp_path_factory):
    """A fork that turns, closes from 1.2 m to 0.4 m, and turns on."""
    file = tmp_path_factory.mktemp("fork") / "fork.urdf"
    file.write_text(URDF)
    robot = rrtik.load_robot(file, joints=["turn"], tip="palm", locked={"out": 0.6})
    robot = replace(robot, gripper=GripperJoints(("out",), (0.6,), (0.1,), 1.0))
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("wall", rrtik.Box([0.1, 0.1, 0.1]), [0.0, 0.0, 2.0])]))
    task = Task([MoveTo([0.5]), Gripper("close", width=0.2), MoveTo([1.0])])
    return world, task.plan(world, [0.0], seed=1)


def test_fingers_are_where_the_robot_of_each_motion_has_them(closing):
    world, plan = closing
    assert plan.found, plan.reason
    subject = subject_of_task(world, plan.played())
    poses = {name: rows for (_, name), rows in subject.fingers.poses.items()}
    assert poses.keys() == {":left_0", ":right_0"}
    for name, sign in ((":left_0", 1.0), (":right_0", -1.0)):
        assert np.allclose(poses[name], [[0, 0, 0, 0, 0, 0, 1], [-0.4 * sign, 0, 0, 0, 0, 0, 1]], atol=1e-12)
    at, clock = subject.fingers.at, subject.run.times
    (begin, end), begins = plan.time_parameterize().pauses[0], plan.time_parameterize().begins
    assert len(at) == len(clock)
    assert (np.diff(at) >= 0.0).all()
    assert (at[clock < begin - 0.1] == 0.0).all()
    assert (at[clock > end + 0.1] == 1.0).all()
    halfway = at[np.abs(clock - 0.5 * (begin + end)).argmin()]
    assert 0.4 < halfway < 0.6
    assert end == begins[1]


def test_a_task_without_gripper_has_no_fingers_that_move():
    loaded = rrtik.Task.load("titan4_drawer")
    plan = loaded.plan(seed=1)
    subject = subject_of_task(loaded.world, plan.played())
    assert subject.fingers.poses == {}


@pytest.mark.slow
def test_a_browser_shows_the_fingers_come_together(closing, tmp_path):
    world, plan = closing
    target = tmp_path / "fork.html"
    target.write_text(page(world, plan.played()), encoding="utf-8")
    begin, end = plan.time_parameterize().pauses[0]
    wide = []
    for time in (begin, 0.5 * (begin + end), end):
        picture = screenshot(target, f"#view=Front&time={time:.2f}")
        dark = (picture.max(axis=2) < 120).any(axis=0)
        columns = np.flatnonzero(dark)
        wide.append(columns[-1] - columns[0])
    assert wide[0] > 1.3 * wide[1] > 1.3 * 1.3 * wide[2]
