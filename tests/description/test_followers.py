"""Joints that follow others: what they follow keeps within every limit of theirs, whatever says that they follow."""

import warnings

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.arrays import TAU
from rrtik_ompl.base.errors import DescriptionWarning, InputError
from rrtik_ompl.cli.ik_report import fold_full_turns
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.ik.goal_configurations import goal_configurations
from rrtik_ompl.ik.method_interface import IkResult
from rrtik_ompl.ik.solve import solve_ik
from rrtik_ompl.model.goal import PoseGoal, joint_difference
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.planning.search.roadmap import Roadmap
from rrtik_ompl.tasks import MoveTo, Task
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World

JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/><axis xyz="0 0 1"/>
<limit lower="{low}" upper="{high}" velocity="{rate}" effort="1"/>{mimic}</joint>"""
MIMIC = '<mimic joint="{source}" multiplier="{gain}" offset="{offset}"/>'


def joint(name, parent, low, high, rate=2.0, kind="revolute", **mimic):
    text = MIMIC.format(**mimic) if mimic else ""
    return JOINT.format(name=name, parent=parent, low=low, high=high, rate=rate, kind=kind, mimic=text)


def urdf(*joints):
    links = "".join(f'<link name="{name}"/>' for name in ("base", *(f"{each}_link" for each in "abc"[: len(joints)])))
    return f'<robot name="pair">{links}{"".join(joints)}</robot>'


def pair(gain, offset, low, high, rate=2.0):
    leader = joint("a", "base", -2, 2)
    return urdf(leader, joint("b", "a_link", low, high, rate, source="a", gain=gain, offset=offset))


@pytest.mark.parametrize(
    ("gain", "offset", "limits", "expected"),
    [
        (-1, 0.1, (-0.2, 0.2), (-0.1, 0.3)),
        (2, 0, (-1, 1), (-0.5, 0.5)),
        (1, 0, (0, 1), (0, 1)),
        (0.1, 0, (-1, 1), (-2, 2)),
        (0, 0.5, (0, 1), (-2, 2)),
    ],
)
def test_a_follower_cuts_the_range_of_what_it_follows(gain, offset, limits, expected):
    robot = robot_from_urdf_text(pair(gain, offset, *limits))
    assert (robot.lower[0], robot.upper[0]) == pytest.approx(expected)
    assert World(robot).valid(robot.upper)
    assert World(robot).valid(robot.upper + 0.01) is False


@pytest.mark.parametrize(("gain", "offset", "limits"), [(1, 3, (-1, 1)), (0, 2, (-1, 1)), (-1, 0, (2.5, 3))])
def test_a_range_that_no_value_is_in_is_ignored_and_said_with_both_names(gain, offset, limits):
    """So it is in files of the Robotiq 2F-85, whose jaw follows by -1 and has the limits of its leader."""
    with pytest.warns(DescriptionWarning, match=r"'a'.*-2 \.\. 2.*'b'.*which are ignored; correct"):
        robot = robot_from_urdf_text(pair(gain, offset, *limits), where="pair.urdf")
    assert (robot.lower.tolist(), robot.upper.tolist()) == ([-2.0], [2.0])


def test_a_gripper_that_is_held_still_refuses_no_arm():
    """Its limits contradict each other, but nothing moves it."""
    text = urdf(
        joint("a", "base", -1, 1),
        joint("b", "a_link", 0, 1),
        joint("c", "b_link", 3, 4, source="b", gain=1, offset=0),
    )
    assert robot_from_urdf_text(text, joints=["a"]).joint_names == ("a",)


def test_what_is_held_still_stands_where_its_followers_may_be():
    text = urdf(
        joint("a", "base", -1, 1),
        joint("b", "a_link", -1, 1),
        joint("c", "b_link", 0.5, 1, source="b", gain=1, offset=0),
    )
    robot = robot_from_urdf_text(text, joints=["a"])
    assert robot.fk([0.0], "b_link").rotation[1, 0] == pytest.approx(np.sin(0.5))


LIMITS_FILE = """joint_limits:
  a: {max_velocity: 3, max_acceleration: 4, max_jerk: 50}
  b: {max_velocity: 1, max_acceleration: 2, max_jerk: 10, min_position: -0.5, max_position: 1}
"""
MJCF = """<mujoco><compiler angle="radian"/><worldbody>
<body name="u"><joint name="a" axis="0 0 1" range="-2 2" ref=".2"/>
<geom size=".1"/><body name="v"><joint name="b" axis="0 0 1" range="-.5 1" ref="-.3"/><geom size=".1"/>
<body name="w"><joint name="c" axis="0 0 1" range="-.6 .4"/><geom size=".1"/></body></body></body></worldbody>
<equality><joint joint1="b" joint2="a" polycoef=".1 -.5 0 0 0"/><joint joint1="c" joint2="b" polycoef="0 2 0 0 0"/>
</equality></mujoco>"""


def chained():
    """A follower of a follower."""
    return urdf(
        joint("a", "base", -2, 2),
        joint("b", "a_link", -0.5, 1, 1, source="a", gain=-0.5, offset=0.3),
        joint("c", "b_link", -0.6, 0.4, 0.5, source="b", gain=2, offset=0.1),
    )


KINDS = {
    "URDF": (".urdf", lambda: pair(-3, 0.4, -0.5, 1, 1.5), None),
    "URDF with joint_limits.yaml": (".urdf", lambda: pair(-3, 0.4, -5, 5), LIMITS_FILE),
    "URDF, a slide that follows a turn": (
        ".urdf",
        lambda: urdf(
            joint("a", "base", -2, 2),
            joint("b", "a_link", 0, 0.01, 0.1, kind="prismatic", source="a", gain=0.02, offset=0),
        ),
        None,
    ),
    "URDF, a follower of a follower": (".urdf", chained, None),
    "MJCF": (".xml", lambda: MJCF, None),
    "MJCF with joint_limits.yaml": (".xml", lambda: MJCF, LIMITS_FILE),
}
OWN = {  # limits of position, velocity, acceleration and jerk that no follower may pass
    "URDF": {"b": (-0.5, 1, 1.5, np.inf, np.inf)},
    "URDF with joint_limits.yaml": {"b": (-0.5, 1, 1, 2, 10)},
    "URDF, a slide that follows a turn": {"b": (0, 0.01, 0.1, np.inf, np.inf)},
    "URDF, a follower of a follower": {"b": (-0.5, 1, 1, np.inf, np.inf), "c": (-0.6, 0.4, 0.5, np.inf, np.inf)},
    "MJCF": {"b": (-0.5, 1, *[np.inf] * 3), "c": (-0.6, 0.4, *[np.inf] * 3)},
    "MJCF with joint_limits.yaml": {"b": (-0.5, 1, 1, 2, 10), "c": (-0.6, 0.4, *[np.inf] * 3)},
}


@pytest.mark.parametrize("kind", KINDS)
def test_no_limit_of_a_follower_is_passed_whatever_says_that_it_follows(tmp_path, kind):
    suffix, text, limits = KINDS[kind]
    file = tmp_path / f"arm{suffix}"
    file.write_text(text())
    options = {}
    if limits is not None:
        options["joint_limits"] = tmp_path / "joint_limits.yaml"
        options["joint_limits"].write_text(limits)
    robot = load_robot(file, **options)
    assert robot.joint_names == ("a",)
    ends = robot.joint_values(np.array([robot.lower, robot.upper]))
    names = list(robot.model.names)[1:]
    touched = False
    for name, (low, high, *rates) in OWN[kind].items():
        row = names.index(name)
        assert (low - 1e-9 <= ends[:, row]).all()
        assert (ends[:, row] <= high + 1e-9).all()
        touched |= bool(np.isclose(ends[:, row], low).any() or np.isclose(ends[:, row], high).any())
        gain = abs(robot.chain.gain[row, 0])
        for key, most in zip(("velocity", "acceleration", "jerk"), rates, strict=True):
            assert gain * getattr(robot, key)[0] <= most + 1e-9, key
    assert touched  # and no more is cut than must be


def test_followers_of_followers_and_references_are_those_of_mujoco(tmp_path):
    """By the constraint of MuJoCo: y - y0 = a0 + a1 (x - x0), where the file draws the bodies at x0 and y0."""
    file = tmp_path / "arm.xml"
    file.write_text(MJCF)
    robot = load_robot(file)
    a, b, c = robot.joint_values(np.array([[0.5]]))[0]
    assert b == pytest.approx(-0.3 + 0.1 - 0.5 * (a - 0.2))
    assert c == pytest.approx(2.0 * (b + 0.3))


GEARS = (1.0, -1.0, 2.0, 0.5, 1.5, -0.25)  # of a follower, by the angle of an endless leader
ENDLESS = """<robot name="geared"><link name="base"/><link name="a_link"/><link name="b_link"/>
<joint name="a" type="{kind}"><parent link="base"/><child link="a_link"/><axis xyz="0 0 1"/>
<limit lower="-{limit}" upper="{limit}" velocity="1" effort="1"/></joint>
<joint name="b" type="continuous"><parent link="a_link"/><child link="b_link"/><origin xyz=".3 0 0"/><axis xyz="0 1 0"/>
{mimic}</joint></robot>"""


def geared(gain, kind="continuous", limit=7):
    return ENDLESS.format(kind=kind, limit=limit, mimic=MIMIC.format(source="a", gain=gain, offset=0.2))


def places_by_pinocchio(text, gain, q):
    """Every frame for values of the leader, by Pinocchio's own reader of URDF, shape (m, frames, 4, 4)."""
    model = pin.buildModelFromXML(text.replace("<mimic", "<!--mimic").replace('offset="0.2"/>', 'offset="0.2"/>-->'))
    data, found = model.createData(), []
    for value in np.ravel(q):
        angles = {"a": value, "b": gain * value + 0.2}
        full = [x for name in ("a", "b") for x in _written(model.joints[model.getJointId(name)], angles[name])]
        pin.framesForwardKinematics(model, data, np.array(full))
        found.append([place.homogeneous for place in data.oMf])
    return np.array(found)


def _written(joint, angle):
    return (angle,) if joint.nq == 1 else (np.cos(angle), np.sin(angle))


def _difference(robot, q):
    base = np.zeros(1)
    return base + joint_difference(robot, q[None], base)[0]


def _planned(robot, q):
    found = plan(Problem(World(robot), [0.3], q), seed=1, seconds=2.0)
    return found.path.end


def _by_task(robot, q):
    return Task([MoveTo(q)]).plan(World(robot), [0.3], seed=1, seconds=2.0).require().end


def _by_kinematics(robot, q):
    found = solve_ik(robot, PoseGoal(robot.fk(q, "b_link")), near=[0.0], seed=1)
    return found.solutions


def _joined_on_a_roadmap(robot, q):
    found = Roadmap(World(robot), vertices=20, seed=1).path([0.3], q)
    return found.end


def _folded(robot, q):
    given = IkResult(q[None], np.zeros((1, 2)), "", "", 0, "damped", 0.0)
    return fold_full_turns(robot, given, np.zeros(1))[0].solutions


ALIKE = {  # what the library gives for the posture q, which it then calls the same
    "goal of a problem": lambda robot, q: Problem(World(robot), [0.3], q).goal.q,
    "goals of a search": lambda robot, q: (
        goal_configurations(Problem(World(robot), [0.3], q), np.random.default_rng(1)).rows
    ),
    "shortest difference": _difference,
    "end of a plan": _planned,
    "end of a task": _by_task,
    "inverse kinematics": _by_kinematics,
    "a roadmap": _joined_on_a_roadmap,
    "folded solutions": _folded,
}


@pytest.mark.parametrize("way", ALIKE)
@pytest.mark.parametrize("gain", GEARS)
def test_what_the_library_calls_the_same_posture_is_the_same_for_all_that_follows(gain, way):
    text = geared(gain)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = robot_from_urdf_text(text, tip="b_link")
    assert robot.continuous[0] == (gain == round(gain))
    for q in ([TAU], [-TAU + 0.4], [2.5]):
        given = np.atleast_2d(ALIKE[way](robot, np.array(q)))
        expected = places_by_pinocchio(text, gain, q)
        assert np.allclose(places_by_pinocchio(text, gain, given), expected, atol=1e-3), q
        assert np.allclose(robot.fk_batch(given, "b_link"), expected[:, -1], atol=1e-3)


@pytest.mark.parametrize(("gain", "turns"), [(0.5, 2), (1.5, 2), (-0.25, 4), (0.333333, 3), (0.001, 100), (np.pi, 7)])
def test_a_leader_whose_whole_turns_are_other_postures_gets_limits_and_a_warning(gain, turns):
    with pytest.warns(DescriptionWarning, match=f"'geared': joint 'a'.*'b'.*{turns} turn"):
        robot = robot_from_urdf_text(geared(gain), tip="b_link")
    assert robot.upper[0] == -robot.lower[0] == turns * TAU
    assert not robot.continuous[0]


@pytest.mark.parametrize("gain", GEARS)
def test_a_posture_is_turned_into_the_limits_only_if_it_stays_the_same(gain):
    text = geared(gain, "revolute", 1)
    robot = robot_from_urdf_text(text, tip="b_link", postures={"far": {"a": TAU - 0.5}})
    given = places_by_pinocchio(text, gain, robot.posture("far"))
    assert np.allclose(given, places_by_pinocchio(text, gain, TAU - 0.5))


@pytest.mark.parametrize("gain", [1, 0.5])
def test_a_slide_without_limits_is_refused_whatever_follows_it(tmp_path, gain):
    file = tmp_path / "slides.xml"
    file.write_text(
        '<mujoco><worldbody><body name="u"><joint name="a" type="slide"/><geom size=".1"/>'
        '<body name="v"><joint name="b" type="slide"/><geom size=".1"/></body></body></worldbody>'
        f'<equality><joint joint1="b" joint2="a" polycoef="0 {gain} 0 0 0"/></equality></mujoco>'
    )
    with pytest.raises(InputError, match=r"joint 'a'.*finite limits"):
        load_robot(file)
