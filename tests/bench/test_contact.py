"""The judge of contacts: it measures what is known, and sees verdicts that are wrong."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from bench.robustness import contact
from bench.robustness.contact_judge import Judge
from bench.robustness.solid_distance import distance_to, lowest
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, PointCloud, Prism, Sphere

CORNERS = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])
SURFACE = Box([0.2, 0.4, 0.6]).surface()
SOLIDS = {
    "box": Box([0.2, 0.4, 0.6]),
    "mesh": Mesh(*SURFACE),
    "prism": Prism([[-0.1, -0.2], [0.1, -0.2], [0.1, 0.2], [-0.1, 0.2]], 0.6),
}


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_box_is_as_far_away_whatever_it_is_made_of(kind):
    points = np.array([[0.1, 0.2, 0.4], [0.4, 0.0, 0.0], [0.4, 0.6, 0.3], [0.0, 0.0, 0.1], [0.05, 0.15, -0.25]])
    wanted = [0.1, 0.3, 0.5, -0.1, -0.05]
    assert distance_to(SOLIDS[kind], points) == pytest.approx(wanted, abs=1e-12)
    way = np.array([0.6, 0.0, 0.8])
    assert lowest(SOLIDS[kind], way) == pytest.approx((CORNERS @ way).min())


def test_round_solids_are_as_far_away_as_by_hand():
    assert distance_to(Capsule(0.1, 1.0), np.array([[0.3, 0, 0.2], [0, 0.4, 0.8]])) == pytest.approx([0.2, 0.4])
    assert distance_to(Cylinder(0.1, 1.0), np.array([[0.3, 0, 0.2], [0, 0.4, 0.9]])) == pytest.approx([0.2, 0.5])
    assert distance_to(Sphere(0.5), np.array([[0.0, 0.6, 0.0]])) == pytest.approx([0.1])


def world_beside(shape, gap):
    """A bar along x, and a solid that ends 5 cm from its frame towards the bar, a gap [m] beside that."""
    robot = rrtik.load_robot("planar", parameters={"lengths": [1.0], "limits_deg": [[-90, 90]], "radius": 0.05})
    place = rrtik.pose([0.5, 0.1 + gap, 0.0])
    return rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("near", shape, place, margin=0.0)]))


BESIDE = {
    "box": Box([0.1, 0.1, 0.1]),
    "ball": Sphere(0.05),
    "half-space": HalfSpace([0.0, -1.0, 0.0], 0.05),
    "mesh": Mesh(*Box([0.1, 0.1, 0.1]).surface()),
    "cloud": PointCloud(np.zeros((1, 3)), 0.05),
}


@pytest.mark.parametrize("gap", [1e-3, 5e-6])
@pytest.mark.parametrize("kind", BESIDE)
def test_gaps_are_measured_to_a_nanometre(kind, gap):
    found = Judge(world_beside(BESIDE[kind], gap)).nearest(np.zeros(1))
    assert (found.gap, found.kinds[1]) == (pytest.approx(gap, abs=1e-9), type(BESIDE[kind]).__name__)


@pytest.mark.parametrize("kind", ["box", "ball", "mesh", "cloud"])
def test_overlaps_are_seen(kind):
    assert Judge(world_beside(BESIDE[kind], -5e-5)).nearest(np.zeros(1)).gap < -2e-5


def test_worlds_of_robots_are_right_at_contact():
    for robot in ("titan4", "z1", "panda"):
        found = contact.contacts(robot, 1, 20)
        assert (found.contacts, found.too_deep, found.too_far, found.wrong) == (20, 0, 0, [])


def test_a_world_that_is_wrong_is_seen(monkeypatch):
    made = contact.contact_world
    monkeypatch.setattr(contact, "contact_world", lambda rng, name: made(rng, name).with_clearance(1e-5))
    assert contact.contacts("titan4", 1, 20).too_far > 0
