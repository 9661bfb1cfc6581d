"""Convex pieces tell that a mesh is far enough away, and never say so where it is not; coal measures the meshes."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import box_of
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.geometry.collision.solids import is_mesh, mesh_arrays
from rrtik_ompl.tasks import nearness

MESHES = {
    body.name: body.geometry
    for robot in ("panda", "ur5")
    for body in link_bodies(rrtik.load_robot(robot))
    if is_mesh(body.geometry)
}
LEAST = 1e-3


def placed(pose):
    return coal.Transform3s(pose.rotation, pose.translation)


@pytest.mark.parametrize("name", ["panda_link5", "forearm_link"])
@pytest.mark.parametrize("other", [coal.Box(0.03, 0.02, 0.05), coal.Sphere(0.02), MESHES["panda_hand"]])
def test_what_is_beyond_by_pieces_is_beyond_by_the_mesh(name, other):
    mesh = MESHES[name]
    rng = np.random.default_rng(0)
    low, high = box_of(mesh_arrays(mesh)[0])
    by_pieces = []
    for _ in range(200):
        pose = pin.SE3(pin.Quaternion(rng.normal(size=4)).normalized().matrix(), rng.uniform(low - 0.03, high + 0.03))
        ends = (mesh, placed(pin.SE3.Identity()), other, placed(pose))
        gap = coal.distance(*ends, coal.DistanceRequest(), coal.DistanceResult())
        if abs(gap - LEAST) < 1e-6:
            continue
        told = nearness.beyond_by_pieces(ends, LEAST)
        assert nearness.beyond(ends, LEAST) == (gap > LEAST)
        assert gap > LEAST or not told
        by_pieces.append((gap > LEAST, told))

    apart, told = np.array(by_pieces).T
    assert 20 < apart.sum() < 190
    assert told.sum() > 0.5 * apart.sum()  # within the mesh, which is hollow, nothing is told


def test_a_mesh_is_not_asked_where_its_pieces_are_apart(monkeypatch):
    mesh = MESHES["forearm_link"]
    asked = []
    distance = nearness.distance
    monkeypatch.setattr(nearness, "distance", lambda *ends: asked.append(is_mesh(ends[0])) or distance(*ends))

    settled = 0
    for point in np.random.default_rng(1).uniform(*box_of(mesh_arrays(mesh)[0]), (500, 3)):
        asked.clear()
        pose = placed(pin.SE3(np.eye(3), point))
        if nearness.beyond((mesh, placed(pin.SE3.Identity()), coal.Sphere(0.002), pose), LEAST):
            settled += len(asked) > 1 and not any(asked)  # within the hull, but beside all pieces
    assert settled > 3
