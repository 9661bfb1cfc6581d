"""Motions that must be proven, in kernels: the same answers as the prover's own."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
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
