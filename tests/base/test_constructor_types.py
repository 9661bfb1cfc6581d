"""Constructors declare what they take: any iterable, sequence or array, not the tuple or array that they keep."""

import inspect

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.model.world_settings import WorldSettings

# Made by the library, not by users, as are results, which have a reason or reasons.
MADE = {"Certificate", "Robot", "ik.ReachMap"}
NARROW = ("tuple[", "list[", "Vector", "Matrix", "pin.SE3", "NDArray", "ndarray", "Any")
# What widens a pose is written beside it.
WIDE = ("ArrayLike | pin.SE3", "Sequence[", "Iterable[", "Mapping[")
KINDS = {name: kind for name, kind in public_values(rrtik).items() if inspect.isclass(kind)}


@pytest.mark.parametrize("name", sorted(KINDS.keys() - MADE))
def test_no_constructor_declares_less_than_it_takes(name):
    kind = KINDS[name]
    parameters = inspect.signature(kind).parameters
    if getattr(kind, "_is_protocol", False) or parameters.keys() & {"reason", "reasons"}:
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
