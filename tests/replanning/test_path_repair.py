"""One tick: a blocked path is cut from both sides and reconnected, shortened, and walked by a step."""

from __future__ import annotations

import numpy as np
import pytest

from rrtik_ompl.planning.search.rrt_connect import ConfigurationTree
from rrtik_ompl.replanning.connecting import PythonConnect, TreeOptions
from rrtik_ompl.replanning.drrt_con import (
    DrrtCon,
    FromScratch,
    dense_sequential_cut,
    points_along,
    without_points_between,
)
from rrtik_ompl.replanning.loop import one_step, to_first_corner
from rrtik_ompl.replanning.single_tree import trimmed
from rrtik_tests.moving_plane import HIGH, LOW


class Scripted:
    """A checker in the plane: a disc that is not free, and counts of the calls."""

    def __init__(self, centre, radius):
        self.centre, self.radius, self.calls = np.array(centre, dtype=float), radius, 0

    def valid_batch(self, Q):
        return np.linalg.norm(Q - self.centre, axis=1) > self.radius

    def motion_valid_batch(self, A, B):
        self.calls += 1
        way = B - A
        share = ((self.centre - A) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
        foot = A + np.clip(share, 0.0, 1.0)[:, None] * way
        return np.linalg.norm(foot - self.centre, axis=1) > self.radius


def on_straight_path(length=20.0):
    """DRRT-Con with a straight path along y = 10, found while nothing was in its way."""
    planner = DrrtCon(PythonConnect(TreeOptions(LOW, HIGH, 1.0, seed=3)), 1.0)
    assert planner.begin(np.array([0.0, 10.0]), np.array([[length, 10.0]]), Scripted((0, 0), 0.1))
    return planner


def test_a_blocked_path_keeps_its_beginning_and_its_end():
    planner, checker = on_straight_path(), Scripted((10.0, 10.0), 2.0)
    assert not planner.check_path(checker)
    assert planner.repair(checker)
    assert planner.check_path(checker)
    kept = planner.path[np.abs(planner.path[:, 1] - 10.0) < 1e-12]
    assert kept[:, 0].min() == 0.0
    assert kept[:, 0].max() == 20.0
    assert (kept[:, 0] > 2.0).any()
    assert np.abs(planner.path[:, 1] - 10.0).max() > 1.5


def test_a_look_asks_once_for_all_motions():
    planner, checker = on_straight_path(), Scripted((10.0, 17.0), 1.0)
    assert planner.check_path(checker)
    assert checker.calls == 1


def test_where_no_way_is_found_the_path_is_kept_and_serves_again_without_a_search():
    planner, lid = on_straight_path(), Scripted((20.0, 10.0), 2.0)
    assert not planner.check_path(lid)
    assert not planner.repair(lid)
    drawn = planner.connect.samples
    assert planner.path is not None
    assert planner.check_path(Scripted((20.0, 17.0), 2.0))
    assert planner.connect.samples == drawn


def test_from_scratch_forgets_the_pieces():
    planner = FromScratch(PythonConnect(TreeOptions(LOW, HIGH, 1.0, seed=3)), 1.0)
    planner.begin(np.array([0.0, 10.0]), np.array([[20.0, 10.0]]), Scripted((0, 0), 0.1))
    checker = Scripted((10.0, 10.0), 2.0)
    planner.check_path(checker)
    assert planner.repair(checker)
    assert checker.motion_valid_batch(planner.path[:-1], planner.path[1:]).all()


def test_the_sequential_cut_shortens_and_keeps_both_ends():
    checker = Scripted((10.0, 10.0), 2.0)
    zigzag = np.array([[0.0, 10.0], [3.0, 14.0], [6.0, 12.0], [9.0, 16.0], [12.0, 13.0], [16.0, 15.0], [20.0, 10.0]])
    cut = dense_sequential_cut(zigzag, 0.5, checker)
    assert (cut[[0, -1]] == zigzag[[0, -1]]).all()
    assert checker.motion_valid_batch(cut[:-1], cut[1:]).all()
    assert np.linalg.norm(np.diff(cut, axis=0), axis=1).sum() < 23.0


def test_points_along_a_path_are_dense_and_fall_away_again():
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0]])
    dense = points_along(path, 0.5)
    assert np.linalg.norm(np.diff(dense, axis=0), axis=1).max() <= 0.5 + 1e-9
    assert without_points_between(dense) == pytest.approx(path)


def test_a_step_goes_round_corners_or_stops_at_them_and_keeps_the_limits():
    path = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 5.0]])
    place_, passed = one_step(path, 0.5, np.array([9.0, 9.0]))
    assert place_ == pytest.approx([0.3, 0.2])
    assert passed == 1
    assert to_first_corner(path, 0.5, np.array([9.0, 9.0]))[0] == pytest.approx([0.3, 0.0])
    slow, _ = one_step(path, 0.5, np.array([0.1, 9.0]))
    assert slow == pytest.approx([0.1, 0.0])


def test_trimming_cuts_off_what_hangs_on_a_blocked_edge():
    tree = ConfigurationTree(np.array([[0.0, 0.0]]))
    a = tree.add(np.array([5.0, 0.0]), 0)
    tree.add(np.array([9.0, 0.0]), a)
    tree.add(np.array([0.0, 5.0]), 0)
    left = trimmed(tree, Scripted((3.0, 0.0), 0.5))
    assert np.array(left.rows).tolist() == [[0.0, 0.0], [0.0, 5.0]]
