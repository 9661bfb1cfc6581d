from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.transitions import (
    lower_bound,
    merge_moves,
    moved,
    moves_several,
    route_length,
    single_joint,
    transitions,
)

# What RRT-Connect gives for the prism test in [1, ch. 6.3], degrees, joint 5 as printed.
RRT_CONNECT = np.deg2rad(
    [
        [0, 0, 0, 0, 90, 0],
        [-7.73, 24.42, 18.64, 0.64, 81.13, -69.05],
        [-37.94, 15.77, 3.761, -0.70, 70.10, -43.18],
        [-30, 0, 0, 0, 90, 0],
    ]
)


def axis_routes(dof: int = 3) -> st.SearchStrategy[np.ndarray]:
    """Routes of single-joint moves on a small grid, with repeated joints and null moves."""
    move = st.tuples(st.integers(0, dof - 1), st.integers(-2, 2))

    def build(moves: list[tuple[int, int]]) -> np.ndarray:
        rows = [np.zeros(dof)]
        for joint, step in moves:
            rows.append(rows[-1].copy())
            rows[-1][joint] += step
        return np.array(rows)

    return st.lists(move, max_size=15).map(build)


def test_the_published_sdu_list_has_seven_transitions_and_its_length(sdu_route: np.ndarray) -> None:
    assert transitions(sdu_route) == 7
    assert route_length(sdu_route) == pytest.approx(3.162, abs=5e-4)
    assert single_joint(sdu_route)
    assert lower_bound(sdu_route[0], sdu_route[-1]) == 5


def test_the_published_prism_list_has_three_transitions_against_a_lower_bound_of_one(prism_route: np.ndarray) -> None:
    assert transitions(prism_route) == 3
    assert lower_bound(prism_route[0], prism_route[-1]) == 1


def test_a_path_of_all_joints_has_as_many_transitions_as_edges_and_is_no_single_joint_route() -> None:
    assert transitions(RRT_CONNECT) == 3
    assert not single_joint(RRT_CONNECT)


def test_sigma_is_one_only_for_changes_above_the_tolerance() -> None:
    degree = np.deg2rad(1.0)
    assert moved([0.0, 0.0], [0.5 * degree, 2.0 * degree], degree).tolist() == [False, True]
    assert lower_bound([0.0, 0.0], [1e-9, 1e-7]) == 1


def test_lower_bound_refuses_configurations_of_different_length() -> None:
    with pytest.raises(InputError, match="goal"):
        lower_bound([0.0, 0.0], [1.0])


def test_consecutive_moves_of_one_joint_count_once() -> None:
    assert merge_moves([[0.0, 0], [1, 0], [2, 0], [2, 1]]).tolist() == [[0, 0], [2, 0], [2, 1]]


def test_there_and_back_again_vanishes_and_joins_its_neighbours() -> None:
    assert merge_moves([[0.0, 0], [1, 0], [1, 1], [1, 0], [2, 0]]).tolist() == [[0, 0], [2, 0]]


def test_a_route_that_stands_still_has_no_transitions() -> None:
    assert transitions([[1.0, 2.0], [1.0, 2.0]]) == 0
    assert transitions([[1.0, 2.0]]) == 0


def test_a_route_needs_a_configuration() -> None:
    with pytest.raises(InputError, match="at least one"):
        transitions(np.empty((0, 3)))


@settings(deadline=None)
@given(axis_routes())
def test_merging_keeps_the_ends_and_leaves_single_joint_moves_of_alternating_joints(route: np.ndarray) -> None:
    merged = merge_moves(route, tolerance=0.0)
    np.testing.assert_array_equal(merged[[0, -1]], route[[0, -1]])
    assert single_joint(merged)
    joints = (np.diff(merged, axis=0) != 0.0).argmax(axis=1)
    assert (joints[1:] != joints[:-1]).all()


@settings(deadline=None)
@given(axis_routes())
def test_transitions_lie_between_the_lower_bound_and_the_number_of_edges(route: np.ndarray) -> None:
    assert lower_bound(route[0], route[-1]) <= transitions(route) <= len(route) - 1


@settings(deadline=None)
@given(axis_routes())
def test_transitions_do_not_depend_on_the_direction(route: np.ndarray) -> None:
    assert transitions(route) == transitions(route[::-1])


@given(st.lists(st.lists(st.sampled_from([-0.9, 0.0, 0.9, 3.0, 8.0]), min_size=2, max_size=2), max_size=9))
def test_a_path_that_is_told_at_once_to_move_several_joints_never_merges_into_single_moves(steps) -> None:
    rows = np.cumsum([[0.0, 0.0], *steps], axis=0)  # in tolerances, so that null moves add up
    if moves_several(rows, tolerance=1.0):
        assert not single_joint(merge_moves(rows, 1.0), 1.0)
    assert moves_several(RRT_CONNECT)
