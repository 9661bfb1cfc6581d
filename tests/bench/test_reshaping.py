"""The loop around a replanner: paths that are bent, motions that are slowed, and when the planner is called."""

import numpy as np
import pytest

from rrtik_bench.drrt_con import FASTEST
from rrtik_bench.reshaping import NONE, Reshaper, bent, hit_edges, reshaped
from rrtik_ompl.model.transitions import route_length

SCENE = "replan_triangles"


class Disc:
    """A disc in the plane; motions are checked every hundredth."""

    def __init__(self, centre, radius):
        self.centre, self.radius = np.array(centre), radius

    def valid_batch(self, Q):
        return np.linalg.norm(Q - self.centre, axis=1) > self.radius

    def motion_valid_batch(self, A, B):
        shares = np.linspace(0.0, 1.0, 101)[:, None, None]
        points = A + shares * (B - A)
        return (np.linalg.norm(points - self.centre, axis=2) > self.radius).all(axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_a_bent_path_is_free_and_nowhere_farther_from_the_old_one_than_is_allowed(seed):
    path, disc, shift = np.array([[0.0, 0.0], [10.0, 0.0]]), Disc([5.0, 0.2], 0.6), 1.5
    found = bent(path, 0.25, shift, disc, np.random.default_rng(seed))
    assert found is not None
    assert disc.motion_valid_batch(found[:-1], found[1:]).all()
    assert (found[[0, -1]] == path).all()
    assert np.abs(found[:, 1]).max() <= shift + 1e-12
    assert route_length(found) >= route_length(path)


def test_a_path_that_needs_more_than_is_allowed_is_not_bent():
    path = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert bent(path, 0.25, 0.5, Disc([5.0, 0.0], 1.0), np.random.default_rng(0)) is None
    assert bent(path, 0.25, 2.0, Disc([0.0, 0.0], 1.0), np.random.default_rng(0)) is None  # the robot's own place
    assert bent(path, 0.25, 2.0, Disc([5.0, 9.0], 1.0), np.random.default_rng(0)) is None  # nothing is hit


def test_hits_are_where_the_path_meets_something():
    points, hits = hit_edges(np.array([[0.0, 0.0], [10.0, 0.0]]), 0.5, Disc([5.0, 0.0], 1.0))
    assert points[hits, 0].min() == pytest.approx(3.5, abs=0.51)
    assert points[hits + 1, 0].max() == pytest.approx(6.5, abs=0.51)


def test_without_a_reshaper_nothing_is_slowed_or_edited_and_it_is_the_planner_that_answers():
    found = reshaped(SCENE, NONE, 0, FASTEST)
    assert set(found.acts) <= {"", "planned"}
    assert found.calls >= found.run.count("repair") + found.run.count("plan")


def test_a_motion_is_slowed_in_proportion_and_never_longer_than_patience():
    patience = 5
    found = reshaped(SCENE, Reshaper(brake=6.0, patience=patience), 0, FASTEST)
    steps = np.linalg.norm(np.diff(found.run.configurations, axis=0), axis=1)
    slowed = np.array([act == "slowed" for act in found.acts])[:-1]
    assert slowed.any()
    assert steps[slowed].min() < 0.9 * steps.max()
    longest = max(len(run) for run in "".join("x" if each else " " for each in slowed).split())
    assert longest <= patience
    assert found.run.found
    assert found.untouched
