"""Certificates by a prover that lies: it takes solids for smaller than they are, and the verifier finds out."""

from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from bench.proofs.cases import random_scene
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.world import certificate_making
from rrtik_ompl.world.certificate_check import certificate_fault
from rrtik_ompl.world.proof import Prover
from rrtik_ompl.world.world import World
from rrtik_tests.turning_slider import slider

MOST_LIES = 20  # certificates of a robot; each takes some hundredths of a second
pytestmark = pytest.mark.kernels


def free_at_both_ends(world, rng, count):
    """Motions, shapes (n, dof), whose ends are free."""
    lower, upper = world.robot.finite_range()
    tails = rng.uniform(lower, upper, (count, world.robot.dof))
    heads = np.clip(tails + rng.normal(0.0, 1.2 / np.sqrt(world.robot.dof), tails.shape), lower, upper)
    free = world.valid_batch(tails) & world.valid_batch(heads)
    return tails[free], heads[free]


@pytest.mark.parametrize(
    ("name", "depth"), [("ur5_gripper", 0.05), ("titan4", 0.04), ("panda", 0.06), ("slider", 0.04)]
)
def test_what_a_lying_prover_says_of_a_motion_that_collides_is_refused(name, depth, tmp_path, monkeypatch):
    """The prover takes solids that overlap by ``depth`` [m] for apart."""
    robot, rng = slider(tmp_path) if name == "slider" else rrtik.load_robot(name), np.random.default_rng(8)
    world = World(robot, random_scene(robot, rng, margin=0.0))
    tails, heads = free_at_both_ends(world, rng, 1500)
    colliding = ~world.motion_valid_batch(tails, heads)
    honest = world.motions_proven(tails, heads)
    assert not (honest & colliding).any()
    monkeypatch.setattr(certificate_making, "SPARE", -depth)
    unchecked = lambda made, motions, *_: replace(made, motions=tuple(motions))  # noqa: E731
    monkeypatch.setattr(certificate_making, "_holding", unchecked)
    monkeypatch.setattr(Prover, "route", lambda self, rows, **_: Proof(len(rows) - 1, 0.0, ()))
    lies = 0
    for k in np.flatnonzero(colliding)[:200]:
        path = JointPath.of(robot, [tails[k], heads[k]])
        forged = world.certificate(path)
        if forged is not None:
            lies += 1
            assert certificate_fault(forged, world, path.waypoints)
        if lies == MOST_LIES:
            break
    assert lies >= 5


@pytest.mark.parametrize("name", ["titan4", "panda"])
def test_what_is_proven_for_a_slower_motion_does_not_hold_for_a_faster_one(name):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(9)
    world = World(robot, random_scene(robot, rng, margin=0.0))
    tails, heads = free_at_both_ends(world, rng, 1500)
    refused = 0
    for a, b in zip(tails, heads, strict=True):
        middle = 0.5 * (a + b)
        if not world.motion_proven(a, middle) or world.motion_valid(a, b):
            continue
        half = world.certificate(JointPath.of(robot, [a, middle]))
        path = JointPath.of(robot, [a, b])
        assert certificate_fault(replace(half, waypoints=path.waypoints), world, path.waypoints)
        refused += 1
    assert refused >= 3
