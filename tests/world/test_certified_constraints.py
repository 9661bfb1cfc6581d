"""Certificates of motions with path constraints: what is kept is known by arithmetic, on a circle about z."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.constraints import inside, on_line, on_plane, orientation_of, upright
from rrtik_ompl.description.urdf import robot_from_urdf
from rrtik_ompl.model.certificate import Route, from_document, task_from_document
from rrtik_ompl.model.goal_kind import TaskRegion
from rrtik_ompl.problem_files.path_constraints import constraint_data
from rrtik_ompl.world.certificate_held import model_constraints
from rrtik_ompl.world.world import World
from rrtik_tests.checker_script import in_script

pytestmark = pytest.mark.kernels
REACH, ANGLE = 0.8, 0.3
ARM = f"""<robot name="hand"><link name="base"/>
<link name="arm"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.3 0.02 0.02"/></geometry></collision></link>
<link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-6" upper="6" velocity="1" effort="1"/></joint>
<joint name="end" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="{REACH} 0 0" rpy="0.4 0 0"/></joint>
</robot>"""
SAGITTA = REACH * (1.0 - np.cos(ANGLE))
ROWS = np.array([[-ANGLE], [ANGLE]])
BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [0.0, -1.0, 0.0])
ANYWHERE = np.outer([1e3] * 3 + [np.pi] * 3, [-1.0, 1.0])


def ranges(yaw, tolerance, roll=(0.3, 0.5)):
    bounds = ANYWHERE.copy()
    bounds[3:] = roll, (-0.1, 0.1), yaw
    return TaskRegion([0.0, 0.0, 0.0], bounds, orientation_tolerance=tolerance)


def about_z(angle, tolerance):
    """The tip's x axis points along the x axis turned by an angle."""
    bounds = ANYWHERE.copy()
    bounds[4:] = 0.0
    return TaskRegion(rrtik.pose([0, 0, 0], rpy=[0, 0, angle]), bounds, orientation_tolerance=tolerance)


START = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.0, -ANGLE), REACH * np.array([np.cos(ANGLE), -np.sin(ANGLE), 0.0]))
MIDDLE = rrtik.pose([REACH, 0.0, 0.0], rpy=[0.4, 0.0, 0.0])
DEGREES = np.degrees(ANGLE)
# Each with the least tolerance that the motion keeps: between its ends, or at them.
KINDS = {
    "plane": (lambda t: on_plane([REACH * np.cos(ANGLE), 0, 0], [1, 0, 0], tolerance=t), SAGITTA),
    "line": (lambda t: on_line([REACH * np.cos(ANGLE), 0, 0], [0, 1, 0], tolerance=t), SAGITTA),
    "box": (lambda t: inside([REACH * np.cos(ANGLE) - 0.05, 0, 0], [0.1, 2.0, 0.1], tolerance=t), SAGITTA),
    "plane and allowance": (
        lambda t: on_plane([REACH * np.cos(ANGLE), 0, 0], [1, 0, 0], tolerance=0.5 * t, allowance=0.5 * t),
        SAGITTA,
    ),
    "orientation": (lambda t: orientation_of(MIDDLE, np.degrees(t)), ANGLE),
    "direction": (lambda t: about_z(0.0, t), ANGLE),
    "ranges": (lambda t: ranges((-0.2, 0.2), t), ANGLE - 0.2),
    "ranges of two angles": (lambda t: ranges((-0.2, 0.2), t, roll=(0.5, 0.6)), ANGLE - 0.2 + 0.1),
    "from the first end": (lambda t: orientation_of(START, np.degrees(t)), 2.0 * ANGLE),
}


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    file = tmp_path_factory.mktemp("hand") / "hand.urdf"
    file.write_text(ARM)
    return robot_from_urdf(file, tip="tip")


def world_with(robot, *constraints):
    return World(robot, rrtik.Scene([BALL]), constraints=constraints)


def problem_text(world, folder):
    """What a problem file says of a scene and its path constraints."""
    file = folder / "scene.yaml"
    world.scene.save(file)
    constraints = [constraint_data(region) for region in world.settings.constraints]
    return f"{file.read_text()}\npath_constraints: {json.dumps(constraints)}\n"


def listed(world):
    return model_constraints(world.constraints)


def plain(certificate):
    return json.loads(json.dumps(certificate.document()))


def script_says(*certificates):
    """What the page's checker says of certificates, by what they say themselves."""
    found = in_script("data.map((file) => checkCertificate(file, {}))", [plain(each) for each in certificates])
    return [each["fault"] for each in found]


def route_of(timed):
    """The same motion, as a path or at constant speed."""
    return Route(ROWS, np.array([0.0, 2.0]), np.array([[[ANGLE]]])) if timed else Route(ROWS)


def true_and_forged(robot, kind, timed):
    """A certificate with a tolerance that is enough, and one with the same tolerance a little less."""
    make, least = KINDS[kind]
    true = world_with(robot, make(1.001 * least)).certificate(route_of(timed))
    return true, replace(true, constraints=listed(world_with(robot, make(0.999 * least))))


NOT_KEPT = "motion 1: path constraint 1, of 'tip', is not shown to be kept"


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_a_constraint_is_shown_if_its_tolerance_is_enough_and_not_if_it_is_less(robot, kind, timed):
    make, least = KINDS[kind]
    enough = world_with(robot, make(1.001 * least))
    less = world_with(robot, make(0.999 * least))
    true, forged = true_and_forged(robot, kind, timed)
    route = route_of(timed)
    assert enough.verify(from_document(plain(true)), route) == ""
    assert less.certificate(route) is None
    assert less.verify(true, route) == "it is for other path constraints: number 1, of 'tip', differs"
    assert less.verify(forged, route).startswith(NOT_KEPT)


def test_the_script_says_the_same_of_all_kinds(robot):
    pairs = [true_and_forged(robot, kind, timed) for kind in KINDS for timed in (False, True)]
    true, forged = (script_says(*each) for each in zip(*pairs, strict=True))
    assert set(true) == {""}
    assert set(forged) == {NOT_KEPT}


def test_a_timed_motion_that_swings_out_between_its_ends_keeps_nothing(robot):
    """From one end to the other it goes by way of 5/3 of the angle."""
    out = Route(ROWS, np.array([0.0, 1.0]), np.array([[[8.0 * ANGLE], [-12.0 * ANGLE]]]))
    world = world_with(robot, about_z(0.0, 1.05 * ANGLE))
    certificate = world.unheld.certificate(out)
    assert world.unheld.verify(certificate, out) == ""
    assert world.certificate(out) is None
    forged = replace(certificate, constraints=listed(world))
    assert "is not shown to be kept" in world.verify(forged, out)
    assert script_says(forged) == [NOT_KEPT]


def test_ranges_are_left_through_a_gap_that_is_narrower_than_a_motion(robot):
    """Both ends are in the range of yaw, on both sides of what it leaves out at half a turn."""
    world = world_with(robot, ranges((-np.pi + 0.04, np.pi - 0.04), 0.01))
    across = np.array([[np.pi - 0.042], [np.pi + 0.042]])
    along = np.array([[-np.pi + 0.042], [np.pi - 0.042]])
    certificate = world.certificate(along)
    assert world.verify(certificate, along) == ""
    assert world.certificate(across) is None
    forged = replace(world.unheld.certificate(across), constraints=certificate.constraints)
    assert "is not shown to be kept" in world.verify(forged, across)
    assert script_says(certificate, forged) == ["", NOT_KEPT]


def test_a_certificate_lists_all_constraints_that_are_asked_for_and_no_others(robot):
    regions = on_plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), about_z(0.0, 1.0)
    both = world_with(robot, *regions)
    certificate = both.certificate(ROWS)
    for other in (both.unheld, world_with(robot, regions[0]), world_with(robot, *regions[::-1])):
        assert other.verify(certificate, ROWS).startswith("it is for other path constraints")
    assert both.verify(both.unheld.certificate(ROWS), ROWS) == (
        "it is for other path constraints: it lists 0 of them, not 2"
    )


def test_constraints_are_those_of_the_asker_where_the_list_differs_by_less_than_a_billionth(robot, tmp_path):
    """Ranges of a billionth add up what roll and yaw are off, single values do not."""
    single = ANYWHERE.copy()
    single[3:] = [[0.2], [0.0], [0.0]]
    wider = single.copy()
    wider[3:, 1] += 8e-10
    other, world = (
        world_with(robot, TaskRegion([0.0, 0.0, 0.0], bounds, orientation_tolerance=0.45)) for bounds in (single, wider)
    )
    certificate = other.certificate(ROWS)
    assert other.verify(certificate, ROWS) == ""
    assert world.certificate(ROWS) is None
    assert world.verify(certificate, ROWS).startswith(NOT_KEPT)

    own = "{ scene: readScene(text, 'scene'), tip: 'tip' }"
    says = f"data.texts.map((text) => checkCertificate(data.file, {own}).fault)"
    texts = [problem_text(each, tmp_path) for each in (other, world)]
    assert in_script(says, {"texts": texts, "file": plain(certificate)}) == ["", NOT_KEPT]


def test_the_script_takes_one_frame_alone_for_the_tip_that_nobody_names(robot, tmp_path):
    world = world_with(robot, on_plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), about_z(0.0, 1.0))
    certificate = world.certificate(ROWS)
    first, second = certificate.constraints
    forged = replace(certificate, constraints=(first, replace(second, frame="arm")))
    says = "data.files.map((file) => checkCertificate(file, { scene: readScene(data.text, 'scene') }).fault)"
    found = in_script(says, {"text": problem_text(world, tmp_path), "files": [plain(certificate), plain(forged)]})
    assert found == ["", "it is for other path constraints: tip and arm cannot all be the robot's tip"]


def test_stages_of_a_task_have_their_constraints(robot):
    world = world_with(robot)
    task = rrtik.Task(
        [
            rrtik.MoveTo([ANGLE], [upright(robot, frame="arm", tolerance_deg=2.0)]),
            rrtik.MoveTo([-ANGLE]),
            rrtik.MoveTo([0.0], [about_z(0.0, 1.1 * ANGLE)]),
        ]
    )
    plan = task.plan(world, [-ANGLE], seed=1)
    certificate = plan.certificate()
    assert [len(part.constraints) for part in certificate.parts] == [1, 0, 1]
    assert plan.verify(task_from_document(plain(certificate))) == ""
    bare = replace(certificate, parts=tuple(replace(part, constraints=()) for part in certificate.parts))
    assert plan.verify(bare) == "part 1: it is for other path constraints: it lists 0 of them, not 1"
