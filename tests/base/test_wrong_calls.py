"""Every public constructor answers every wrong call in one line that names what is wrong and what is meant."""
# mypy: disable-error-code="call-arg"

import inspect
import warnings

import numpy as np
import pytest

import rrtik_ompl as rrtik
from bench.robustness.values import ODD, good
from rrtik_ompl.base.lazy import guided, public_values

# Made by the library, not by users, as are results, which have a reason or reasons.
MADE = {"Robot", "Stage", "ik.ReachMap", "ompl.BenchmarkNotes", "ompl.RegionConstraint"}
PLACED = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def is_made_by_users(name, kind):
    if not inspect.isclass(kind) or issubclass(kind, Exception) or getattr(kind, "_is_protocol", False):
        return False
    if kind.__init__ is object.__init__:  # a kind of values that users name, but do not make
        return False
    return name not in MADE and not inspect.signature(kind).parameters.keys() & {"reason", "reasons"}


KINDS = {name: kind for name, kind in public_values(rrtik).items() if is_made_by_users(name, kind)}
# Odd values that do not fill the memory before they are refused.
FEW = [odd for odd in ODD if getattr(odd, "nbytes", 0) < 1e6 and not isinstance(odd, range)]
OTHERS = "numpy", "pinocchio", "pin.SE3(", "Boost", "ufunc", "broadcast", "ambiguous", "__init__", "Traceback"


def refused(call):
    """The message with which a call is refused; None if it is answered."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call()
        except rrtik.RrtikError as error:
            return str(error)
        return None


def needed(kind):
    return [each for each in inspect.signature(kind).parameters.values() if each.default is each.empty]


@pytest.mark.parametrize("name", KINDS)
def test_a_wrong_number_or_name_of_arguments_is_answered_with_the_call_that_is_meant(name):
    kind = KINDS[name]
    word = kind.__name__
    calls = {"missing a required argument": lambda: kind()} if needed(kind) else {}
    calls |= {
        "too many positional arguments (int, int": lambda: kind(*range(30)),
        "there is no argument 'diameter'": lambda: kind(diameter=0.1),
    }
    for fault, call in calls.items():
        with pytest.raises(rrtik.InputError) as caught:
            call()
        message = str(caught.value)
        assert message.startswith(f"{word}: {fault}")
        assert f"; write {word}(" in message
        assert "self" not in message.replace("self_margin", "")


@pytest.mark.parametrize("name", KINDS)
def test_an_odd_first_argument_is_answered_or_refused_in_a_line(name):
    kind = KINDS[name]
    parameters = list(inspect.signature(kind).parameters.values())
    for place, parameter in enumerate(parameters[:3]):
        for odd in (*FEW, *good()):
            args = [odd if number == place else 0.1 for number in range(max(len(needed(kind)), place + 1))]
            if parameter.kind not in PLACED or len(args) > sum(each.kind in PLACED for each in parameters):
                continue
            message = refused(lambda args=args: kind(*args))
            assert message is None or ("\n" not in message and len(message) > 10), args
            assert message is None or not any(word in message.replace("pinocchio.SE3", "") for word in OTHERS), message


def test_an_error_within_a_constructor_stays_what_it_is():
    class Ball:
        def __init__(self, radius):
            len(radius)

    guided(Ball)
    with pytest.raises(TypeError, match="has no len"):
        Ball(0.1)


def test_a_protocol_is_not_made_but_classes_of_it_are_also_those_of_another_class():
    class Device:
        def __init__(self, port):
            self.port = port

    class Link(rrtik.following.RobotLink, Device):
        pass

    assert Link("usb").port == "usb"
    with pytest.raises(rrtik.InputError, match="RobotLink is a protocol: write a class"):
        rrtik.following.RobotLink()


def robot():
    return rrtik.load_robot("planar3")


BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [3, 3, 0])
Q = [0, 0, 0]
USUAL = {
    "robot and scene in a problem": (
        lambda: rrtik.Problem(robot(), rrtik.Scene(), Q, Q),
        r"write Problem\(World\(robot, ",
    ),
    "robot in a problem": (lambda: rrtik.Problem(robot(), Q, Q), r"World, got Robot; use World\(robot, scene\)"),
    "list in place of a scene": (lambda: rrtik.World(robot(), [BALL]), r"Scene, got list; use Scene\(obstacles\)"),
    "scene first": (lambda: rrtik.World(rrtik.Scene(), robot()), r"robot of a world .* got Scene; use load_robot"),
    "wrong setting": (
        lambda: rrtik.World(robot(), clearence=0.1),
        r"World: there is no argument 'clearence'.*clearance=",
    ),
    "obstacle in place of a list": (lambda: rrtik.Scene(BALL), "obstacles of a scene must be a list, got Obstacle"),
    "shape in place of an obstacle": (lambda: rrtik.Scene([rrtik.Sphere(0.1)]), "type Obstacle, got Sphere"),
    "class in place of a shape": (
        lambda: rrtik.Obstacle("a", rrtik.Sphere),
        "shape of 'a' .* got the class Sphere; use",
    ),
    "list in place of a shape": (lambda: rrtik.Obstacle("a", [1, 1, 1]), r"got list; use Box\(x, y, z\)"),
    "shape before the name": (lambda: rrtik.Obstacle(rrtik.Sphere(0.1), "a"), "name of an obstacle .* got Sphere"),
    "two sides": (lambda: rrtik.Box(0.1, 0.2), r"box size: three lengths are needed, write Box\(x, y, z\) or"),
    "one side": (lambda: rrtik.Box(0.1), r"box size: three lengths are needed"),
    "radius in a list": (lambda: rrtik.Sphere([0.1]), "sphere radius"),
    "diameter": (
        lambda: rrtik.Cylinder(diameter=0.1, length=1),
        r"no argument 'diameter'; write Cylinder\(radius, length\)",
    ),
    "numbers of a normal": (lambda: rrtik.HalfSpace(0, 0, 1), r"write HalfSpace\(normal, offset=0.0\)"),
    "file in place of points": (lambda: rrtik.Mesh("a.stl"), r"or Mesh.load\(file"),
    "robot in place of limits": (lambda: rrtik.RateLimits(robot()), r"or RateLimits.of\(robot"),
    "degrees": (lambda: rrtik.Problem(rrtik.World(robot()), [0, 90, 0], Q), r"joint values are radians.*np\.radians"),
    "degrees of a goal": (lambda: rrtik.Problem(rrtik.World(robot()), Q, [0, -45, 0]), r"goal: .*radians: for degrees"),
    "quaternion in place of a tolerance": (lambda: rrtik.PoseGoal([1, 0, 0], [0, 0, 0, 1]), "position_tolerance"),
}


@pytest.mark.parametrize("case", USUAL)
def test_a_usual_mistake_is_told_what_to_write(case):
    call, words = USUAL[case]
    with pytest.raises(rrtik.RrtikError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_box_takes_three_lengths_or_a_list_of_them():
    for box in (rrtik.Box(0.1, 0.2, 0.3), rrtik.Box([0.1, 0.2, 0.3]), rrtik.Box(np.array([0.1, 0.2, 0.3]))):
        assert box.size.tolist() == [0.1, 0.2, 0.3]
    with pytest.raises(rrtik.InputError, match="greater than 0"):
        rrtik.Box(0.1, 0.2, -0.3)


def test_a_joint_a_little_outside_its_limits_is_no_matter_of_units():
    with pytest.raises(rrtik.ProblemError, match="outside its limits") as caught:
        rrtik.Problem(rrtik.World(robot()), [0, 4, 0], Q)
    assert "degrees write" not in str(caught.value)
