"""Methods that a person calls, with arguments of another kind: one line of ours, never an error of Python or numpy."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, ProblemError, RrtikError, UnknownNameError, at_most
from rrtik_ompl.planning.moves.rules import MoveRules

ROBOT = rrtik.load_robot("planar3")
FAR = rrtik.Obstacle("far", rrtik.Sphere(0.1), rrtik.pose([9, 9, 9]))
SCENE = rrtik.Scene([FAR])
PATH = rrtik.JointPath.of(ROBOT, [[0, 0, 0], [0.5, 0, 0]])
SOLIDS = {"sphere": rrtik.Sphere(0.1), "capsule": rrtik.Capsule(0.1, 1), "box": rrtik.Box([1, 1, 1])}
SOLIDS |= {"cylinder": rrtik.Cylinder(0.1, 1)}
ODD = [None, "a", b"x", {"a": 1}, object(), len, np.zeros((2, 4)), [[1], [1, 2]], rrtik.Sphere(0.1), 10**400]


def refused(call, *args, **options):
    with pytest.raises(RrtikError) as caught:
        call(*args, **options)
    assert str(caught.value).isprintable()
    return str(caught.value)


@pytest.mark.parametrize("name", ["clamp", "onto_limits", "limit_fault"])
@pytest.mark.parametrize("odd", ODD, ids=lambda odd: type(odd).__name__)
def test_limits_are_asked_of_numbers(name, odd):
    assert "planar3" in refused(getattr(ROBOT, name), odd)


def test_limits_move_numbers_as_before():
    beyond = [[4.0, 0.1, -4.0]]
    assert (ROBOT.clamp(beyond) == np.clip(beyond, ROBOT.lower, ROBOT.upper)).all()
    assert (ROBOT.onto_limits(beyond) == beyond).all()
    assert (ROBOT.onto_limits(ROBOT.upper + 1e-6) == ROBOT.upper).all()


def test_a_fault_is_of_one_configuration():
    assert "shape" in refused(ROBOT.limit_fault, np.full((2, 3), 9.0))
    assert "'joint2' is at nan" in ROBOT.limit_fault(np.array([0.0, np.nan, 0.0]))


@pytest.mark.parametrize("odd", [None, 3, ["a"], np.zeros(2), {}], ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize(
    "call",
    [ROBOT.posture, SCENE.obstacle, SCENE.without, lambda name: SCENE.detaching(name, np.eye(4)), SCENE.attaching],
)
def test_names_are_text(call, odd):
    options = {"link": "tip"} if call == SCENE.attaching else {}
    assert "must be of type str" in refused(call, odd, **options)


@pytest.mark.parametrize("odd", [None, 3, "planar3", [0, 0, 0], FAR], ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize(
    ("call", "wanted"),
    [
        (ROBOT.link_of, "GeometryObject"),
        (PATH.proved, "World"),
        (lambda robot: rrtik.following.SimulatedLink(robot, [0, 0, 0]), "Robot"),
    ],
)
def test_what_is_needed_is_named(call, wanted, odd):
    assert f"must be of type {wanted}, got {type(odd).__name__}" in refused(call, odd)


@pytest.mark.parametrize("given", [("a", 0.0), ([0, 0], 0.0), ([0, 0, np.nan], 0.0), ([0, 0, 0], "now")])
def test_a_set_point_is_a_row_of_numbers_and_a_time(given):
    link = rrtik.following.SimulatedLink(ROBOT, [0, 0, 0])
    assert "set point" in refused(link.command, *given)
    assert link.sent == []


@pytest.mark.parametrize("odd", [None, "a", [1, 2], 1j, float("nan"), -0.01], ids=str)
@pytest.mark.parametrize("solid", SOLIDS)
def test_a_solid_grows_by_a_length(solid, odd):
    assert "margin" in refused(SOLIDS[solid].grown, odd)


@pytest.mark.parametrize("odd", [None, "a", 0.5, True, 3, 10**400, [8]], ids=lambda odd: str(odd)[:9])
@pytest.mark.parametrize("solid", ["sphere", "capsule"])
def test_a_ball_is_drawn_in_a_whole_number_of_segments(solid, odd):
    assert "segments" in refused(SOLIDS[solid].surface, odd)


@pytest.mark.parametrize(
    ("names", "options", "what"),
    [
        (3, {}, "names of joints"),
        ("abc", {}, "names of joints"),
        (["a"], {"dof": FAR}, "dof"),
        (["a"], {"dof": 10**400}, "dof"),
        ([], {"dof": 2, "joint_costs": None, "last_joints": 3}, "last_joints"),
    ],
)
def test_rules_are_of_named_joints(names, options, what):
    assert what in refused(MoveRules, names, **options)


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda odd: rrtik.constraints.orientation_of(np.eye(4), odd), "tolerances_deg"),
        (lambda odd: rrtik.constraints.upright(ROBOT, odd), "axis"),
        (lambda odd: rrtik.Mesh(np.eye(3), [[0, 1, 2]], odd), "source of a mesh"),
        (lambda odd: rrtik.Mesh(np.eye(3), odd), "triangles"),
        (lambda odd: ROBOT.within_limits([0, 0, 0], odd), "tolerance"),
        (lambda odd: rrtik.JointPath([[0, 0]], prismatic=odd), "path"),
        (lambda odd: rrtik.JointPath([[0, 0]], continuous=odd), "path"),
    ],
)
@pytest.mark.parametrize("odd", [np.zeros((2, 4)), [[1], [1, 2]], {"a": 1}], ids=lambda odd: type(odd).__name__)
def test_other_arguments_are_named(call, what, odd):
    message = refused(call, odd)
    assert what in message or "at least one triangle" in message


@pytest.mark.parametrize("odd", [3, None, object(), "ab"], ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize(
    "call",
    [
        lambda odd: SCENE.attaching("far", "tip", odd),
        lambda odd: UnknownNameError("link", "a", odd),
        lambda odd: ProblemError("a", odd),
        lambda odd: rrtik.JointPath([[0, 0]], odd) if odd is not None else rrtik.Scene(odd),
        lambda odd: rrtik.AttachedObject("a", "tip", rrtik.Sphere(1), allow=odd),
    ],
)
def test_lists_are_lists(call, odd):
    assert "must be a list" in refused(call, odd)


def test_an_attached_object_is_held_by_a_named_link():
    assert "link of 'a'" in refused(rrtik.AttachedObject, "a", 3, rrtik.Sphere(1))


def test_odd_alternatives_of_a_name_are_shown():
    assert UnknownNameError("link", "a", [3, FAR, "b"]).alternatives[0] == "3"


def test_a_name_too_long_for_the_system_is_one_of_no_problem():
    assert "no " in refused(rrtik.load_problem, "a" * 5000)


def test_a_number_beyond_all_floats_is_too_many():
    with pytest.raises(InputError, match="more than the 5"):
        at_most(10**400, 5, "things")
    with pytest.raises(InputError, match=r"things: 1e\+300 are more than the 5"):
        at_most(1e300, 5, "things")
