"""Stages that keep path constraints: a cup that stays upright while it is carried."""

import base64
import gzip
import json
import re

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Alternatives, Attach, MoveTo, Straight, Task
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.problem_files.path_constraints import constraint_data
from rrtik_ompl.tasks.contact_life import follow_contacts
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.tasks.task_file import stage_data
from rrtik_ompl.tasks.worlds import Worlds
from rrtik_ompl.viewer.page import page


@pytest.fixture(scope="module")
def serving():
    return rrtik.Task.load("panda_serve")


@pytest.fixture(scope="module")
def served(serving):
    return serving.plan(seed=2)


def axis_of(world, q, name):
    """Where the z axis of what is held points, by pinocchio alone, shape (3,)."""
    robot, held = world.robot, next(item for item in world.scene.attached if item.name == name)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.pinocchio_configuration(q)[0])
    return (data.oMf[robot.model.getFrameId(held.link)] * held.pose).rotation[:, 2]


@pytest.mark.kernels
def test_the_cup_stays_upright_while_it_is_carried_and_nothing_is_touched(served):
    assert served.found, served.reason
    world, path = served.worlds[3], served.paths[3]
    first = axis_of(world, path.start, "cup")
    tilts = [np.arccos(min(first @ axis_of(world, q, "cup"), 1.0)) for q in path.resample(0.005).waypoints]
    assert np.degrees(max(tilts)) <= 5.2
    assert path.violations(world) == ()
    problem = rrtik.Problem(world, path.start, path.end, constraints=served.stages[3].constraints)
    assert path.violations(problem.world) == ()


@pytest.mark.kernels
def test_without_the_constraint_the_same_carry_tilts(serving):
    stages = [MoveTo(s.goal) if isinstance(s, MoveTo) else s for s in serving.stages]
    plan = Task(stages).plan(serving.world, serving.start, seed=2)
    assert plan.found, plan.reason
    world, path = plan.worlds[3], plan.paths[3]
    first = axis_of(world, path.start, "cup")
    assert min(first @ axis_of(world, q, "cup") for q in path.resample(0.01).waypoints) < np.cos(np.radians(6.0))


@pytest.mark.kernels
def test_a_plan_with_constraints_comes_back_from_its_file(served, tmp_path):
    served.save(tmp_path / "plan.json")
    again = rrtik.TaskPlan.load(tmp_path / "plan.json")
    assert [stage_data(stage) for stage in again.stages] == [stage_data(stage) for stage in served.stages]
    assert again.stages[3].constraints[0].from_start
    assert again.stages[3].constraints[0].frame == "cup"


@pytest.mark.kernels
def test_the_page_draws_the_regions_of_stages_where_they_begin(served):
    ((region, begin),) = served.played().held
    stage = served.stages.index(next(each for each in served.stages if getattr(each, "constraints", ())))
    assert region.frame == "cup"
    assert (begin == served.paths[stage].start).all()
    assert region.outside(begin) == (0.0, 0.0)
    text = page(served.worlds[0], served.played(), still=True)
    packed = re.search(r'<script id="commands"[^>]*>\s*(\S+?)\s*</script>', text)
    assert packed is not None
    commands = json.loads(gzip.decompress(base64.b64decode(packed[1])))
    assert any(b"constraints/0/axis" in base64.b64decode(command) for command in commands)


@pytest.mark.kernels
def test_a_constraint_that_no_goal_keeps_is_the_reason(serving):
    robot = serving.world.robot
    level = rrtik.constraints.upright(robot, tolerance_deg=5.0)
    tip = robot.fk(serving.start)
    turned = pin.SE3(tip.rotation @ pin.rpy.rpyToMatrix(0.8, 0.0, 0.0), tip.translation)
    plan = Task([MoveTo(turned, [level])]).plan(serving.world, serving.start, seed=1, seconds=2.0)
    assert not plan.found
    assert "keeps the path constraints" in plan.reason
    broken = rrtik.constraints.on_plane([0.0, 0.0, 1.5], [0.0, 0.0, 1.0])
    plan = Task([MoveTo("ready", [broken])]).plan(serving.world, serving.start, seed=1)
    assert not plan.found
    assert "start breaks path constraint 1" in plan.reason
    assert "mm outside" in plan.reason


@pytest.mark.parametrize("value", [None, 3, "upright", [None], [3], [np.eye(4)]])
def test_what_is_no_constraint_is_refused(value):
    with pytest.raises(InputError, match="constraint") as caught:
        MoveTo("ready", value)
    assert "\n" not in str(caught.value)


def test_a_frame_that_is_not_there_or_not_held_is_refused_before_the_search(serving):
    robot = serving.world.robot
    cup, mug = (rrtik.constraints.upright(robot, frame=name) for name in ("cup", "mug"))
    with pytest.raises(InputError, match=r"stage 1 \(MoveTo\).*'mug'"):
        Task([MoveTo("ready", [mug])]).plan(serving.world, serving.start)
    taken = Attach("cup", "panda_hand")
    with pytest.raises(InputError, match=r"stage 2 \(MoveTo\).*'cup'"):
        Task([Alternatives([[taken], [Straight(by=[0, 0, 0.1])]]), MoveTo("ready", [cup])]).plan(
            serving.world, serving.start
        )


def test_a_region_from_the_start_is_written_as_upright_or_not_at_all(serving):
    robot = serving.world.robot
    for axis in ("x", "y", "z"):
        said = constraint_data(rrtik.constraints.upright(robot, axis, tolerance_deg=7.0, frame="cup"))
        assert said["upright"]["axis"] == axis
        assert said["upright"]["tolerance_deg"] == pytest.approx(7.0)
        assert said["frame"] == "cup"
    other = rrtik.TaskRegion(pin.SE3.Identity(), np.zeros((6, 2)), from_start=True)
    with pytest.raises(InputError, match="other than upright"):
        constraint_data(other)


@pytest.mark.kernels
def test_a_motion_keeps_its_constraints_after_a_contact_has_ended():
    """What is held stands on a table, is lifted, and tilts when the table is far away."""
    robot = rrtik.load_robot("ur5")
    q = np.array([0.0, -1.6, 1.8, -0.2, 1.6, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    cup = rrtik.Obstacle("cup", rrtik.Box([0.06, 0.06, 0.1]), robot.fk(q).translation - 0.12 * up)
    table = rrtik.Obstacle("table", rrtik.Box([0.5, 0.5, 0.02]), cup.pose.translation - 0.06 * up)
    standing = rrtik.World(robot, rrtik.Scene([cup, table]))
    worlds = Worlds(standing)
    held = Setting.of(standing, worlds).after(Attach("cup", "tool0"), q).world
    level = rrtik.constraints.upright(robot, frame="cup", tolerance_deg=5.0)
    world = rrtik.Problem(held, q, q, constraints=[level]).world

    lifted = np.add(q, [0.0, -0.2, 0.0, 0.2, 0.0, 0.0])
    ends = np.add(lifted, [[0.3, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 0.0, 0.0]])
    paths = [rrtik.JointPath.of(robot, [q, lifted, end]) for end in ends]
    level_all_along, tilted = (follow_contacts(path, world, frozenset(), (), worlds) for path in paths)
    assert level_all_along.fault == ""
    assert "path constraint 1 (frame 'cup')" in tilted.fault
    assert tilted.world.constraints is not None  # in which a detour is planned
