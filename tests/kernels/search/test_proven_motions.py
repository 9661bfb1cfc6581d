"""Motions that must be proven, in kernels: the same answers as the prover's own, and routes pulled taut among them."""

from itertools import pairwise

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.search.taut.tightening import Tightening
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.world.proven_motions import ProvenMotions, proven_motions

KEPT = 0.002


@pytest.fixture(scope="module", params=["planar3_boxes", "titan4_sdu"])
def problem(request):
    return rrtik.load_problem(request.param)


@pytest.fixture(scope="module")
def route(problem):
    return rrtik.plan(problem, "RRTConnect", seed=3, clearance=KEPT, shorten=False).path.waypoints


def near(route, seed, count=300):
    """Motions between places near a route."""
    rng = np.random.default_rng(seed)
    places = route[rng.integers(len(route), size=(2, count))]
    return places + 0.2 * rng.normal(size=places.shape)


def test_motions_are_free_if_and_only_if_the_prover_proves_them(problem, route):
    world = problem.world
    starts, ends = (np.clip(rows, world.robot.lower, world.robot.upper) for rows in near(route, 1))
    proven = world.motions_proven(starts, ends, clearance=KEPT)
    found = ProvenMotions(world, KEPT).motion_valid_batch(starts, ends)
    assert 0.05 < proven.mean() < 0.95
    np.testing.assert_array_equal(found, proven)


def test_another_proof_meanwhile_changes_nothing(problem, route):
    world, motions = problem.world, ProvenMotions(problem.world, KEPT)
    starts, ends = (np.clip(rows, world.robot.lower, world.robot.upper) for rows in near(route, 2, 50))
    before = motions.motion_valid_batch(starts, ends)
    world.prove(route, clearance=0.05)
    np.testing.assert_array_equal(motions.motion_valid_batch(starts, ends), before)


def test_without_kernels_the_world_proves(problem, route):
    blind = problem.world.proving(0.0)
    assert blind.fast is None
    starts, ends = route[:-1], route[1:]
    assert proven_motions(blind, KEPT, route).motion_valid_batch(starts, ends).all()
    with pytest.raises(rrtik.InputError, match="no kernels"):
        ProvenMotions(blind, KEPT)


def test_a_taut_route_is_proven_and_shorter_with_the_same_ends(problem, route):
    motions = ProvenMotions(problem.world, KEPT)
    work, lengths = Tightening(motions.motions, route, seed=4), [route_length(route)]
    for checks in (10, 40, 160, 640):
        work.run(checks)
        lengths.append(route_length(work.waypoints))
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] < 0.99 * lengths[0]
    assert work.intact()
    assert (work.waypoints[[0, -1]] == route[[0, -1]]).all()
    assert len(work.waypoints) <= len(route)
    assert problem.world.prove(work.waypoints, clearance=KEPT).proven


def test_a_taut_route_does_not_depend_on_interruptions(problem, route):
    motions = ProvenMotions(problem.world, KEPT)
    whole, parts = (Tightening(motions.motions, route, seed=5) for _ in range(2))
    whole.run(300)
    for checks in range(7, 301, 7):
        parts.run(checks)
    parts.run(300)
    np.testing.assert_array_equal(whole.waypoints, parts.waypoints)
    other = Tightening(motions.motions, route, seed=6)
    other.run(300)
    assert not np.array_equal(whole.waypoints, other.waypoints)


def test_routes_are_pulled_taut_by_checks_in_steps_too(problem, route):
    work = Tightening(problem.world.motions, route, seed=4)
    work.run(400)
    assert route_length(work.waypoints) < route_length(route)
    assert all(problem.world.motion_valid(a, b) for a, b in pairwise(work.waypoints))


def test_a_route_that_is_none_is_refused(problem, route):
    with pytest.raises(rrtik.InputError, match="a route of two or more"):
        Tightening(problem.world.motions, route[:1])
