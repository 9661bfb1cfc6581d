from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ompl import base as ob

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ompl_bridge import StateIO, space_bounds, states


def information(dof: int, low: float = -2.0, high: float = 3.0) -> Any:
    space, bounds = ob.RealVectorStateSpace(dof), ob.RealVectorBounds(dof)
    bounds.setLow(low)
    bounds.setHigh(high)
    space.setBounds(bounds)
    return ob.SpaceInformation(space)


@pytest.fixture(params=["capsule", "slices"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "slices":
        monkeypatch.setattr(states, "_capsule", lambda buffer: None)
    return str(request.param)


@pytest.mark.parametrize("dof", [1, 2, 7, 14])
def test_a_configuration_survives_the_way_to_a_state_and_back(way: str, dof: int) -> None:
    si = information(dof)
    io, state = StateIO(si), si.allocState()
    q = np.random.default_rng(dof).normal(size=dof)
    io.write(state, q)
    assert state[0:dof] == q.tolist()
    np.testing.assert_array_equal(io.read(state), q)
    assert io.fast == (way == "capsule")


def test_what_was_read_is_a_private_copy(way: str) -> None:
    si = information(2)
    io, state = StateIO(si), si.allocState()
    io.write(state, np.array([1.0, 2.0]))
    first = io.read(state)
    io.write(state, np.array([3.0, 4.0]))
    io.read(state)
    assert first.tolist() == [1.0, 2.0], way


def test_bindings_that_refuse_the_capsule_are_served_with_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(states, "_capsule", lambda buffer: object())
    si = information(3)
    io, state = StateIO(si), si.allocState()
    assert not io.fast
    io.write(state, np.array([1.0, 2.0, 3.0]))
    assert io.read(state).tolist() == [1.0, 2.0, 3.0]


def test_bounds_are_read_per_coordinate() -> None:
    lower, upper = space_bounds(information(2))
    assert (lower.tolist(), upper.tolist()) == ([-2.0, -2.0], [3.0, 3.0])


@pytest.mark.parametrize(("low", "high"), [(-np.inf, np.inf), (0.0, 0.0)])
def test_missing_bounds_are_named_with_the_remedy(low: float, high: float) -> None:
    with pytest.raises(InputError, match=r"coordinate 0 .*setBounds"):
        space_bounds(information(2, low, high))


def test_other_spaces_are_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"needs a RealVectorStateSpace, .*SE3StateSpace"):
        StateIO(ob.SpaceInformation(ob.SE3StateSpace()))


def test_something_that_is_no_space_information_is_refused() -> None:
    with pytest.raises(InputError, match=r"SpaceInformation.*RealVectorStateSpace"):
        StateIO(ob.RealVectorStateSpace(2))
