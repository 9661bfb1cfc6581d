"""Octrees of many cells: checks, distances and proofs agree with those of a box for each cell."""

from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision import shape_table
from rrtik_ompl.geometry.collision.cloud_solid import cloud_gap, cloud_solid, nearest_of_cloud
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.model.shapes.octree import FEW_CELLS

POSE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.5, 1.1), np.array([0.03, -0.02, 0.3]))


@pytest.fixture(scope="module")
def worlds():
    """An arm among cells of three sizes: as clouds of cubes, and as boxes."""
    rng = np.random.default_rng(0)
    centres = np.unique(0.1 * rng.integers(-15, 15, (400, 3)) + 0.05, axis=0)
    centres = centres[np.linalg.norm(centres, axis=1) > 0.3]
    tree = rrtik.Octree(centres, rng.choice([0.03, 0.06, 0.1], len(centres)))
    robot = rrtik.load_robot("ur5")
    made = []
    for few in (0, FEW_CELLS):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(shape_table, "FEW_CELLS", few)
            made.append(rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("map", tree, POSE)])))
    return made


def rows(world, count, seed):
    robot = world.robot
    return np.random.default_rng(seed).uniform(*robot.finite_range(), (count, robot.dof))


def test_many_cells_are_one_solid_for_each_size():
    centres = np.indices((11, 11, 11)).reshape(3, -1).T
    tree = rrtik.Octree(centres, np.where(centres[:, 0] < 5, 0.5, 1.0))
    solids = [piece.geometry.cloud for piece in pieces(tree)]
    assert [(len(cells.points), cells.half) for cells in solids] == [(605, 0.25), (726, 0.5)]
    assert sum(len(cells.points) for cells in tree.clouds) == len(centres)
    few = rrtik.Octree(centres[:FEW_CELLS], 0.5)
    assert len(pieces(few)) == FEW_CELLS


def test_cells_contain_the_cubes_whose_centres_are_rounded():
    tree = rrtik.Octree([[1000.0 + 1e-5, 0.0, 0.3]], 0.1)
    (cells,) = tree.clouds
    centres = cells.points.astype(np.float64)
    assert (np.abs(centres - tree.centres) + 0.05 <= cells.half + 1e-12).all()
    assert cells.half < 0.05 + 1e-4


@pytest.mark.kernels
def test_cells_and_boxes_collide_alike(worlds):
    cells, boxes = worlds
    asked = rows(cells, 3000, 1)
    free = cells.valid_batch(asked)
    assert (free == boxes.valid_batch(asked)).all()
    assert 0.1 < free.mean() < 0.9


@pytest.mark.parametrize("kind", ["cubes", "balls"])
@pytest.mark.parametrize("other", [coal.Capsule(0.05, 0.3), coal.Box(0.3, 0.1, 0.2)])
def test_a_solid_is_as_far_from_a_cloud_as_from_the_nearest_of_its_parts(other, kind):
    """Also where the part that is nearest to the solid's bounding box is not the nearest to the solid."""
    rng = np.random.default_rng(5)
    other.computeLocalAABB()
    centres = 0.1 * rng.integers(-8, 8, (300, 3))
    (cubes,) = rrtik.Octree(centres, 0.06).clouds
    solid, part = {
        "cubes": (cloud_solid(cubes), coal.Box(0.06, 0.06, 0.06)),
        "balls": (cloud_solid(rrtik.PointCloud(centres, radius=0.03)), coal.Sphere(0.03)),
    }[kind]
    pose = coal.Transform3s(POSE.rotation, POSE.translation)
    for _ in range(60):
        turn = pin.Quaternion(rng.normal(size=4)).normalized().toRotationMatrix()
        place = coal.Transform3s(turn, rng.uniform(-0.9, 0.9, 3))
        gaps = []
        for centre in centres:
            own = coal.Transform3s(POSE.rotation, POSE.act(centre))
            gaps.append(coal.distance(other, place, part, own, coal.DistanceRequest(), coal.DistanceResult()))
        ends = (other, place, solid, pose)
        if min(gaps) > 0.0:
            assert nearest_of_cloud(ends).distance == pytest.approx(min(gaps), abs=1e-6)
        assert (cloud_gap(ends, 0.01) is None) == (min(gaps) < 0.01)


@pytest.mark.kernels
def test_a_motion_that_is_proven_among_cells_is_free_of_boxes(worlds):
    cells, boxes = worlds
    starts = rows(cells, 300, 3)
    starts = starts[boxes.valid_batch(starts)][:80]
    ends = cells.robot.clamp(starts + np.random.default_rng(4).normal(0.0, 0.15, starts.shape))
    proven = cells.motions_proven(starts, ends)
    among_boxes = boxes.motions_proven(starts, ends)
    assert 0.1 < proven.mean() < 0.9
    assert (proven == among_boxes).mean() > 0.97  # both may give up where there is next to no room
    for start, end in zip(starts[proven], ends[proven], strict=True):
        assert boxes.valid_batch(np.linspace(start, end, 60)).all()


@pytest.mark.kernels
def test_a_plan_around_a_wall_of_cells_keeps_off_it():
    places = np.indices((3, 20, 32)).reshape(3, -1).T  # a wall in the way, of 1,920 cells
    tree = rrtik.Octree(0.025 * places, 0.025)
    robot = rrtik.load_robot("ur5")
    world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("wall", tree, [0.35, -0.3, -0.1])]))
    wall = rrtik.Obstacle("wall", rrtik.Box(0.075, 0.5, 0.8), [0.375, -0.0625, 0.2875])
    same = rrtik.World(robot, rrtik.Scene([wall]))
    start, goal = [-1.2, -1.0, 1.2, -1.8, -1.6, 0.0], [1.2, -1.0, 1.2, -1.8, -1.6, 0.0]
    assert not world.motion_valid(start, goal)
    plan = rrtik.plan(rrtik.Problem(world, start, goal), seed=1)
    assert plan.proven
    waypoints = plan.require().waypoints
    for one, other in pairwise(waypoints):
        assert same.valid_batch(np.linspace(one, other, 200)).all()
