"""Constructors declare what they take: any iterable, sequence or array, not the tuple or array that they keep."""

import inspect

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.model.world_settings import WorldSettings

# Made by the library, not by users, as are results, which have a reason or reasons.
MADE = {"Certificate", "Grasp", "Robot", "TaskCertificate", "ik.ReachMap"}
NARROW = ("tuple[", "list[", "Vector", "Matrix", "pin.SE3", "NDArray", "ndarray", "Any")
# What widens a pose is written beside it.
WIDE = ("ArrayLike | pin.SE3", "Sequence[", "Iterable[", "Mapping[")
KINDS = {name: kind for name, kind in public_values(rrtik).items() if inspect.isclass(kind)}


@pytest.mark.parametrize("name", sorted(KINDS.keys() - MADE))
def test_no_constructor_declares_less_than_it_takes(name):
    kind = KINDS[name]
    parameters = inspect.signature(kind).parameters
    if getattr(kind, "_is_protocol", False) or parameters.keys() & {"reason", "reasons", "findings"}:
        return
    declared = {name: str(each.annotation) for name, each in parameters.items()}
    assert not {
        name: text
        for name, text in declared.items()
        if any(word in text for word in NARROW) and not any(word in text for word in WIDE)
    }


def test_constructors_take_any_iterable():
    balls = [rrtik.Obstacle(name, rrtik.Sphere(0.1), place) for name, place in (("a", [1, 0, 0]), ("b", (0, 1, 0)))]
    scene = rrtik.Scene(iter(balls), allowed_collisions=[["a", "b"]])
    assert scene.obstacles == tuple(balls)
    assert scene.allowed_collisions == (("a", "b"),)
    held = rrtik.AttachedObject("c", "tip", rrtik.Sphere(0.1), allow=["a"])
    assert held.allow == ("a",)
    assert held.pose == pin.SE3.Identity()
    bounds = [[0, 0]] * 6
    region = rrtik.TaskRegion([1, 0, 0], bounds)
    assert rrtik.MoveTo("ready", [region]).constraints == (region,)
    assert len(rrtik.Task(stage for stage in [rrtik.MoveTo("ready")]).stages) == 1
    world = rrtik.World(rrtik.load_robot("planar3"), None, constraints=iter([region]))
    assert world.settings.constraints == (region,)
    assert np.array_equal(rrtik.PoseGoal([1, 0, 0]).T_world_tip.translation, [1.0, 0.0, 0.0])


def test_a_pair_of_names_is_no_text():
    with pytest.raises(rrtik.InputError, match="each of the allowed_collisions of a scene must be a list, got str"):
        rrtik.Scene(allowed_collisions=["ab"])


def test_a_world_declares_the_settings_with_their_defaults():
    of_world = inspect.signature(rrtik.World).parameters
    of_settings = inspect.signature(WorldSettings).parameters
    assert list(of_world) == list(of_settings)
    for name in list(of_world)[2:]:
        assert of_world[name].default == of_settings[name].default


def test_usual_calls_pass_the_type_checker() -> None:
    """The function has types, so that mypy checks the calls in it when it checks the tests."""
    robot = rrtik.load_robot("planar3")
    region = rrtik.TaskRegion([1, 0, 0], [[-9, 9]] * 6)
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), [3, 3, 0], margin=0.1)
    box = rrtik.Obstacle("box", rrtik.Box(0.1, 0.2, 0.3), [[1, 0, 0, 9], [0, 1, 0, 9], [0, 0, 1, 9], [0, 0, 0, 1]])
    held = rrtik.AttachedObject("cup", "tip", rrtik.Sphere(0.01), [0, 0, 1], allow=["ball"])
    scene = rrtik.Scene([ball, box], [held], [("cup", "planar3")])
    assert rrtik.Scene({ball}).with_(box).obstacles == (ball, box)

    world = rrtik.World(robot, None, clearance=0.01)
    path = rrtik.JointPath.of(robot, [[0, 0, 0], [1, 0, 0]])
    goals = rrtik.GoalSet([rrtik.PoseGoal([1, 0, 0]), rrtik.PositionGoal([1, 0, 0]), region])
    for goal in (path[-1], [0, 0, 0], rrtik.pose([1, 0, 0], rpy=[0, 0, 1]), np.eye(4), goals):
        assert rrtik.Problem(world, path[0], goal, constraints=iter([])).world is world

    grasp = [rrtik.MoveTo([0, 0, 0]), rrtik.Straight(by=[0, 0, 1]), rrtik.Attach("ball", "tip", allow="box")]
    task = rrtik.Task([rrtik.Alternatives([grasp, [rrtik.MoveTo("ready")]]), rrtik.Gripper("open")])
    assert len(task.stages) == 2
    assert len(rrtik.Task(rrtik.MoveTo(q) for q in path).stages) == 2

    rules = rrtik.MoveRules(iter("abc"), joint_costs=np.ones(3), frozen_joints=np.array([1]), last_joints=("c",))
    assert rules.frozen_joints == [1]
    motion = rrtik.time_parameterize(path, rrtik.RateLimits(1, [1, 2, 3], np.inf))
    assert all(world.valid(q) for q in motion.sample(10))
    assert scene.attaching("ball", "tip", ["box"], pose=[0, 0, 1]).attached[-1].name == "ball"
