"""The same answers for worlds of a tenth of a millimetre and of ten kilometres, by both exact checks and contacts."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision import certificate
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.shape_table import pieces
from rrtik_ompl.world import exact_checks
from rrtik_tests.sizes import how_many

SCALES = [1e-4, 1e-3, 1e-2, 1.0, 1e2, 1e4]


KINDS = {
    "box": lambda scale: rrtik.Box(np.array([1.0, 0.6, 0.4]) * scale),
    "ball": lambda scale: rrtik.Sphere(0.3 * scale),
    "cylinder": lambda scale: rrtik.Cylinder(0.2 * scale, scale),
    "capsule": lambda scale: rrtik.Capsule(0.1 * scale, scale),
}


def answers(first, second, pose):
    """Whether the checks of worlds, of the second check and of contacts call two solids apart."""
    (one,), (other,) = pieces(first), pieces(second)
    matrix = pose.homogeneous
    poses = coal.Transform3s(np.eye(3), np.zeros(3)), coal.Transform3s(pose.rotation, pose.translation)
    bodies = [Body("one", 1, pin.SE3.Identity(), one.geometry, "link"), Body("other", 0, pose, other.geometry, "link")]
    near = measured(bodies, [(0, 1)], np.eye(4)[None].repeat(2, axis=0), near_only=True)
    return (
        exact_checks.distance(one.geometry, poses[0], other.geometry, poses[1]) is not None,
        certificate.distance(one.geometry, np.eye(4), other.geometry, matrix) is not None,
        next(iter(near), None) is None,
    )


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("a", "b"), [(a, b) for k, a in enumerate(KINDS) for b in list(KINDS)[k:]])
def test_a_pair_of_any_size_is_free_where_the_pair_of_a_metre_is(a, b, scale):
    rng = np.random.default_rng(1)
    for k in range(how_many(300, 25)):
        turn = pin.exp3(rng.normal(size=3) * (0.1 if k % 2 else 1.0))
        at = rng.normal(size=3) * 0.4
        free, *others = answers(KINDS[a](1.0), KINDS[b](1.0), pin.SE3(turn, at))
        assert others == [free, free]
        (one,), (other,) = pieces(KINDS[a](1.0)), pieces(KINDS[b](1.0))
        poses = coal.Transform3s(np.eye(3), np.zeros(3)), coal.Transform3s(turn, at)
        gap = coal.distance(
            one.geometry, poses[0], other.geometry, poses[1], coal.DistanceRequest(), coal.DistanceResult()
        )
        if not free or gap > 0.01:  # coal ends at 1e-6 m, which is much of the smallest
            assert set(answers(KINDS[a](scale), KINDS[b](scale), pin.SE3(turn, at * scale))) == {free}


def lowest(first, second):
    """The distance of two segments by alternating projections, which a convex square cannot escape."""
    a, u = first[0], first[1] - first[0]
    b, v = second[0], second[1] - second[0]
    s = t = 0.5
    for _ in range(4000):
        s = np.clip((b + t * v - a) @ u / (u @ u), 0.0, 1.0)
        t = np.clip((a + s * u - b) @ v / (v @ v), 0.0, 1.0)
    return float(np.linalg.norm(a + s * u - b - t * v))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 0.001, 0.1, 1.0, np.pi / 2])
@pytest.mark.parametrize("scale", SCALES)
def test_the_distance_of_capsules_is_that_of_their_axes_less_their_radii(scale, angle):
    rng = np.random.default_rng(2)
    for _ in range(how_many(100, 2)):
        turn = pin.exp3(rng.normal(size=3)) @ pin.exp3(np.array([angle, 0.0, 0.0]))
        pose = pin.SE3(turn, rng.normal(size=3) * 0.3 * scale)
        solids = rrtik.Capsule(0.1 * scale, scale), rrtik.Capsule(0.02 * scale, 0.4 * scale)
        bodies = [
            Body(f"{k}", 0, pin.SE3.Identity() if k == 0 else pose, pieces(s)[0].geometry, "link")
            for k, s in enumerate(solids)
        ]
        axes = [
            body.placement.act(np.array([0.0, 0.0, z]))
            for body, s in zip(bodies, solids, strict=True)
            for z in (-0.5 * s.length, 0.5 * s.length)
        ]
        (found,) = measured(bodies, [(0, 1)], np.eye(4)[None], near_only=False)
        assert found.distance == pytest.approx(lowest(axes[:2], axes[2:]) - 0.12 * scale, abs=2e-6 * scale)
        between = np.linalg.norm(found.point_first - found.point_second)
        assert between == pytest.approx(abs(found.distance), abs=1e-9 * scale)
