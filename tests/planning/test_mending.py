"""A mended motion is proven, keeps its ends and what was free, and says how far it departs."""

import numpy as np
import pytest
from scipy.ndimage import label

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import NotFoundError
from rrtik_ompl.planning.mending import mended

pytestmark = pytest.mark.kernels

FREE, MIDDLE, LAST = [0.2, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]


@pytest.fixture(scope="module")
def world():
    return rrtik.load_problem("planar3_boxes").world


def test_what_is_proven_stays_and_the_rest_is_replaced_near_by(world):
    found = mended(world, [FREE, MIDDLE, LAST], clearance=0.001)
    rows = np.asarray(found.path)
    assert world.has_proven(found.path.proof)
    assert found.path.proof.clearance == 0.001
    assert np.array_equal(rows[[0, 1, -1]], [FREE, MIDDLE, LAST])
    assert found.stretches == 1

    # On the straight motions that were given only the first and last joint of the last one stand at 0.
    steps = np.linspace(0.0, 1.0, 200)[:, None, None]
    dense = (rows[:-1] + steps * (rows[1:] - rows[:-1])).reshape(-1, 3)
    off = np.minimum(np.linalg.norm(dense[:, [0, 2]], axis=1), np.linalg.norm(dense[:, [1, 2]], axis=1))
    assert 0.0 < off.max() <= found.departure + 0.01


def gaps_from(motion, q):
    """Distances of configurations, shape (..., 3), from the straight lines of a motion."""
    found = np.full(q.shape[:-1], np.inf)
    for begin, along in zip(motion, np.diff(motion, axis=0), strict=False):
        shares = np.clip((q - begin) @ along / (along @ along), 0.0, 1.0)
        found = np.minimum(found, np.linalg.norm(q - begin - shares[..., None] * along, axis=-1))
    return found


def test_the_way_around_is_hardly_farther_from_the_motion_than_it_has_to_be():
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.05})
    motion = np.array([[-0.5, 0.6, 0.3], [0.1, 0.8, 0.1], [0.5, 0.6, 0.3]])
    disc = rrtik.Obstacle("disc", rrtik.Sphere(0.1), [*robot.fk(motion[1]).translation[:2] + 0.05, 0.0])
    world = rrtik.World(robot, rrtik.Scene([disc]))
    found = mended(world, motion)
    assert found.stretches == 1
    assert world.motions_proven(found.path[:-1], found.path[1:]).all()

    # The judge: cells around the motion, of which the free ones that are near enough to it join its ends.
    bounds = zip(motion.min(axis=0), motion.max(axis=0), strict=True)
    sides = [np.arange(low - 0.4, high + 0.4, 0.02) for low, high in bounds]
    cells = np.stack(np.meshgrid(*sides, indexing="ij"), axis=3)
    free = world.valid_batch(cells.reshape(-1, 3)).reshape(cells.shape[:3])
    distance = gaps_from(motion, cells)
    begin, end = (tuple(np.linalg.norm(cells - q, axis=3).flatten().argsort()[:1]) for q in motion[[0, -1]])

    def joined(largest):
        parts = label(free & (distance <= largest), np.ones((3, 3, 3)))[0].ravel()
        return parts[begin] == parts[end] > 0

    least = next(largest for largest in np.arange(0.02, 0.7, 0.01) if joined(largest))
    assert found.departure < 1.2 * least


def test_ways_around_are_pulled_towards_the_motion():
    robot = rrtik.load_robot("panda")
    motion = np.array(
        [
            [-2.71, -0.179, -1.183, -1.555, -1.907, -0.006, -2.82],
            [-2.897, -0.202, -0.518, -0.882, -2.522, 0.733, -2.346],
            [-2.897, -0.8, -0.724, -0.563, -1.826, 1.366, -1.777],
        ]
    )
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.041), [-0.058, 0.249, 0.919])
    world = rrtik.World(robot, rrtik.Scene([ball]))
    found = mended(world, motion)
    assert world.has_proven(found.path.proof)

    # The judge: at each place of the motion the nearest free one of many configurations around it.
    rng = np.random.default_rng(1)
    around = rng.normal(size=(2000, 7))
    around *= np.linspace(0.0, 0.5, 2000)[:, None] / np.linalg.norm(around, axis=1, keepdims=True)
    places = np.concatenate([np.linspace(*ends, 15) for ends in (motion[:2], motion[1:])])
    least = max(np.linalg.norm(around[world.valid_batch(robot.clamp(q + around)).argmax()]) for q in places)
    assert found.departure < 1.5 * least


def test_a_free_motion_is_its_own_mended_one(world):
    found = mended(world, [FREE, MIDDLE])
    assert np.array_equal(found.path, [FREE, MIDDLE])
    assert (found.stretches, found.departure) == (0, pytest.approx(0.0, abs=1e-12))


def test_a_curved_motion_becomes_lines_near_it(world):
    motion = rrtik.time_parameterize(
        rrtik.JointPath([FREE, MIDDLE, [0.0, 0.0, 0.3]]), world.robot, blend=0.1, world=world
    )
    found = mended(world, motion)
    assert found.stretches == 0
    tips = world.robot.fk_batch(found.path)[:, :3, 3]
    dense = world.robot.fk_batch(motion.sample(rate=1000.0))[:, :3, 3]
    assert np.linalg.norm(tips[:, None] - dense, axis=2).min(axis=1).max() < 2e-3


def test_an_end_that_touches_cannot_be_mended(world):
    with pytest.raises(NotFoundError, match=r"its end: .*box_right"):
        mended(world, [MIDDLE, [0.0, 1.5, 0.0]])
