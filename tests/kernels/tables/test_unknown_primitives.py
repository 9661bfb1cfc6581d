"""A primitive of a kind that has no formula is an error, wherever it is met: never taken for one of another kind."""

from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import scene_bodies
from rrtik_ompl.kernels import FastWorld, layout
from rrtik_ompl.kernels.reference import checks as reference
from rrtik_ompl.kernels.tables.primitive_tables import primitive_table
from rrtik_ompl.kernels.tables.scene_tables import outer_primitives

pytestmark = pytest.mark.kernels

UNKNOWN = layout.KINDS.stop


def spoiled_world():
    """A point beside a ball whose kind nobody knows, and the bodies."""
    robot = rrtik.load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0, 10], [0, 10]]})
    fast = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("ball", rrtik.Sphere(1.0), rrtik.pose([5, 5, 0]))])).fast
    assert isinstance(fast, FastWorld)
    for primitives in fast._primitives:
        primitives.heads.reshape(-1, layout.HEAD_INTS)[:, layout.KIND] = UNKNOWN
    return fast


NEAR = np.array([[5.0, 6.2]])
CALLS = {
    "configurations": lambda fast: fast.classify(NEAR),
    "without narrow phase": lambda fast: fast.classify(NEAR, resolve=False),
    "motions": lambda fast: fast.classify_edges(NEAR, NEAR + 0.1, [3]),
    "distances": lambda fast: fast.clearance(NEAR),
    "pairs": lambda fast: fast.undecided_pairs(NEAR),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=list(CALLS))
def test_kernels_refuse_a_kind_that_they_do_not_know(call):
    with pytest.raises(InputError, match="kernels do not know"):
        call(spoiled_world())


@pytest.mark.parametrize("call", CALLS.values(), ids=list(CALLS))
def test_the_reference_refuses_a_kind_that_it_does_not_know(call):
    fast = spoiled_world()
    fast._kernels = None
    with pytest.raises(InputError, match=f"unknown kind {UNKNOWN}; have 0 to {UNKNOWN - 1}"):
        call(fast)


def test_until_python_hears_of_it_the_primitive_is_in_the_way_everywhere():
    fast = spoiled_world()
    found = np.zeros(1, dtype=np.int32)
    beside = np.array([[6.0, 6.2]])  # apart from the ball, not from its bounding box
    assert fast._kernels.classify(fast.address, beside.ctypes.data, 1, found.ctypes.data, False) == layout.UNSOUND
    assert found[0] == layout.UNDECIDED


@pytest.mark.parametrize("twin", [reference.meets_primitive, reference.primitive_gap])
def test_each_twin_refuses_it(twin):
    given = (np.zeros((1, 3)), np.ones(1)) if twin is reference.meets_primitive else (np.zeros((1, 3)),)
    with pytest.raises(InputError, match=f"unknown kind {UNKNOWN}"):
        twin(spoiled_world()._primitives[0], 0, *given)


def test_no_table_is_packed_with_it():
    robot = rrtik.load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0, 10], [0, 10]]})
    (body,) = scene_bodies(robot, rrtik.Scene([rrtik.Obstacle("box", rrtik.Box([1, 1, 1]))]))
    known = outer_primitives([body], [np.zeros((0, 4))])
    checked = np.ones((1, 1), dtype=bool)
    assert primitive_table(known, checked).count == 1
    with pytest.raises(InputError, match=f"unknown kind {UNKNOWN}; have 0 to {UNKNOWN - 1}"):
        primitive_table(replace(known, kinds=np.array([UNKNOWN])), checked)
