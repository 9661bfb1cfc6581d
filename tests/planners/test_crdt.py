from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.model.transitions import single_joint
from rrtik_ompl.ompl_bridge.contract import small_problem, solution_rows
from rrtik_planners import CRDT, BiCRDT
from rrtik_planners.crdt_tree import CrdtTree, Outcome


class Interval:
    """A checker that blocks every motion that enters an axis-aligned box (and counts nothing)."""

    checked_states = 0
    checked_motions = 0

    def __init__(self, low: Any = 9.0, high: Any = 9.0) -> None:
        self.low, self.high = np.array(low), np.array(high)

    def valid(self, q: np.ndarray) -> bool:
        return self.motion_valid(q, q)

    def motion_valid(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Axis moves only: their bounding box is the motion itself."""
        apart = (np.maximum(a, b) < self.low) | (np.minimum(a, b) > self.high)
        return bool(apart.any())

    def motion_valid_batch(self, A: np.ndarray, B: np.ndarray) -> np.ndarray:
        return np.array([self.motion_valid(a, b) for a, b in zip(A, B, strict=True)])


def rules(dof: int, scale: Any = 1.0, smallest_move: float = 0.0) -> CrdtRules:
    return CrdtRules(-np.ones(dof), np.ones(dof), np.full(dof, scale), np.full(dof, smallest_move), np.ones(dof))


def grown(*targets: Any, checker: Any = None, dof: int = 2, seed: int = 0) -> tuple[CrdtTree, list[Any]]:
    tree = CrdtTree(np.zeros((1, dof)), rules(dof))
    rng = np.random.default_rng(seed)
    return tree, [tree.extend(np.array(t, dtype=float), checker or Interval(), rng) for t in targets]


def test_a_free_extension_reaches_its_target_exactly() -> None:
    tree, (extension,) = grown((0.1, 0.7))
    assert extension.outcome is Outcome.REACHED
    assert tree.vertex(extension.vertex).tolist() == [0.1, 0.7]
    assert tree.size == 3


def test_an_extension_keeps_its_free_leading_part() -> None:
    # From (1, 0) the first axis goes on to x = 2; from there y is blocked.
    tree, (_, extension) = grown((1, 0), (2, 1), checker=Interval((1.5, 0.5), (2.5, 1.5)))
    assert extension.outcome is Outcome.ADVANCED
    assert tree.branch(extension.vertex).tolist() == [[0, 0], [1, 0], [2, 0]]


def test_an_extension_that_adds_nothing_is_trapped() -> None:
    tree, (extension,) = grown((1, 0), checker=Interval((0.5, -1.0), (0.6, 1.0)))
    assert extension.outcome is Outcome.TRAPPED
    assert tree.size == 1


def test_a_target_that_is_a_vertex_is_reached_without_growth() -> None:
    tree, (first, second) = grown((1, 0), (1, 0))
    assert second.outcome is Outcome.REACHED
    assert second.vertex == first.vertex
    assert tree.size == 2


@pytest.mark.parametrize("seed", range(5))
def test_the_axis_that_led_to_a_vertex_goes_first(seed: int) -> None:
    tree, (_, extension) = grown((1, 0, 0), (2, 1, 1), dof=3, seed=seed)
    assert tree.branch(extension.vertex)[2].tolist() == [2, 0, 0]


def test_the_root_has_no_direction_and_takes_either_axis_first() -> None:
    firsts = {tuple(grown((1, 1), seed=seed)[0].vertex(1).tolist()) for seed in range(20)}
    assert firsts == {(1.0, 0.0), (0.0, 1.0)}


def test_turning_back_within_the_last_edge_splits_it() -> None:
    tree, (first, second) = grown((4, 0), (3, 0))
    assert tree.branch(second.vertex).tolist() == [[0, 0], [3, 0]]
    assert tree.branch(first.vertex).tolist() == [[0, 0], [3, 0], [4, 0]]


def test_turning_back_beyond_the_parent_starts_from_the_parent() -> None:
    tree, (_, corner, back) = grown((0, 1), (0.1, 1), (-0.4, 1.0))
    assert tree.branch(corner.vertex).tolist() == [[0, 0], [0, 1], [0.1, 1]]
    assert tree.branch(back.vertex).tolist() == [[0, 0], [0, 1], [-0.4, 1]]


def test_turning_back_exactly_to_the_parent_adds_nothing() -> None:
    tree = CrdtTree(np.zeros((1, 2)), rules(2))
    rng = np.random.default_rng(0)
    tree.extend(np.array([1.0, 0.0]), Interval(), rng)
    extension = tree.extend_from(1, np.array([0.0, 0.0]), Interval(), rng)
    assert (extension.outcome, extension.vertex, tree.size) == (Outcome.REACHED, 0, 2)


def test_the_nearest_vertex_is_measured_in_the_scaled_metric() -> None:
    roots = np.array([[0.0, 0.0], [3.0, 1.0]])
    assert CrdtTree(roots, rules(2)).nearest(np.array([2.0, 0.0])) == 1
    assert CrdtTree(roots, rules(2, (0.1, 1.0))).nearest(np.array([2.0, 0.0])) == 0


def test_the_arrays_grow_and_keep_what_they_hold() -> None:
    rng = np.random.default_rng(3)
    targets = rng.uniform(-1, 1, (1000, 2))
    tree, extensions = grown(*targets)
    assert tree.size > 1000
    for target, extension in zip(targets, extensions, strict=True):
        np.testing.assert_array_equal(tree.vertex(extension.vertex), target)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**20), st.integers(1, 5), st.booleans())
def test_every_edge_of_the_tree_moves_one_joint_and_is_free(seed: int, dof: int, coarse: bool) -> None:
    rng = np.random.default_rng(seed)
    targets = rng.uniform(-1, 1, (60, dof))
    targets = np.round(targets * 4) / 4 if coarse else targets  # repeated coordinates: turning back exactly
    checker = Interval(np.full(dof, 0.3), np.full(dof, 0.6))
    tree, extensions = grown(*targets, checker=checker, dof=dof, seed=seed)
    for extension in extensions:
        branch = tree.branch(extension.vertex)
        assert single_joint(branch)
        assert all(checker.motion_valid(a, b) for a, b in pairwise(branch))
        np.testing.assert_array_equal(branch[0], np.zeros(dof))


@pytest.mark.parametrize("planner", [CRDT, BiCRDT])
def test_an_iteration_limit_ends_the_search(planner: Any) -> None:
    setup = small_problem(lambda s: bool(abs(s[0]) > 0.5))
    ours = planner(setup.getSpaceInformation(), seed=1, max_iterations=5)
    setup.setPlanner(ours)
    setup.solve(60.0)
    assert ours.statistics["iterations"] == 5


def test_crdt_reports_the_way_to_the_vertex_nearest_to_an_unreachable_goal() -> None:
    setup = small_problem(lambda s: bool(abs(s[0]) > 0.5))
    setup.setPlanner(CRDT(setup.getSpaceInformation(), seed=1, max_iterations=50))
    assert str(setup.solve(60.0)) == "Approximate solution"
    rows = solution_rows(setup)
    assert rows is not None
    difference = setup.getProblemDefinition().getSolutionDifference()
    assert difference == pytest.approx(np.linalg.norm(rows[-1] - 1.0))
    assert difference > 1.4


def test_crdt_ends_sooner_with_a_larger_goal_tolerance() -> None:
    means = []
    for tolerance in (0.5, 2.0):
        counts = []
        for seed in range(20):
            setup = small_problem()
            planner = CRDT(setup.getSpaceInformation(), seed=seed, goal_tolerance=tolerance)
            setup.setPlanner(planner)
            assert str(setup.solve(10.0)) == "Exact solution"
            counts.append(planner.statistics["iterations"])
        means.append(np.mean(counts))
    assert means[1] < means[0]


def test_the_scaled_metric_changes_the_search() -> None:
    vertices: list[list[float]] = [[], []]
    for seed in range(5):
        for scaled in (False, True):
            setup = small_problem()
            bounds = setup.getStateSpace().getBounds()
            bounds.setHigh(2, 50.0)
            setup.getStateSpace().setBounds(bounds)
            options = {"scale_by_range": scaled, "max_iterations": 99, "goal_tolerance": 0.1}
            planner = CRDT(setup.getSpaceInformation(), seed=seed, **options)
            setup.setPlanner(planner)
            setup.solve(10.0)
            vertices[scaled].append(planner.statistics["vertices"])
    assert vertices[0] != vertices[1]


@pytest.mark.parametrize("options", [{"goal_tolerance": 0.0}, {"goal_tolerance": -1.0}, {"max_iterations": 0}])
def test_options_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        CRDT(small_problem().getSpaceInformation(), **options)
