"""Routes pulled taut along contacts: proven, never longer, the same for a seed, and as short as where that is known."""

from dataclasses import replace
from itertools import pairwise

import coal
import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.geometry.collision.solids import is_mesh
from rrtik_ompl.kernels.search.contacts.pulling import Pulling
from rrtik_ompl.kernels.tables.solid_tables import convex_solids
from rrtik_ompl.model.transitions import route_length
from rrtik_ompl.planning.shortening.task import box_around
from rrtik_ompl.world.proven_motions import ProvenMotions

pytestmark = pytest.mark.kernels

KEPT = 0.002


def pulling(world, route, **options):
    """The pull of a route in a world in which all motions keep a clearance."""
    motions = ProvenMotions(world, KEPT)
    return Pulling(motions.motions, route, *box_around(motions, route), **options)


@pytest.fixture(scope="module", params=["planar3_boxes", "titan4_sdu", "ur5_table"])
def problem(request):
    return rrtik.load_problem(request.param)


@pytest.fixture(scope="module")
def route(problem):
    return rrtik.plan(problem, "RRTConnect", seed=3, clearance=KEPT, shorten=False).path.waypoints


def test_the_result_is_proven_shorter_and_has_the_same_ends(problem, route):
    lengths = []
    for seed in range(4):
        pull = pulling(problem.world, route, seed=seed)
        pull.run()
        lengths.append(route_length(pull.waypoints))
        assert pull.intact()
        assert (pull.waypoints[[0, -1]] == route[[0, -1]]).all()
        assert problem.world.prove(pull.waypoints, clearance=KEPT).proven
    assert max(lengths) < 0.99 * route_length(route)


def test_more_work_never_makes_a_route_longer(problem, route):
    lengths = [route_length(route)]
    for work in (5, 20, 80, 320):
        pull = pulling(problem.world, route, seed=4, work=work)
        pull.run()
        lengths.append(route_length(pull.waypoints))
        assert problem.world.prove(pull.waypoints, clearance=KEPT).proven
    assert lengths == sorted(lengths, reverse=True)


def test_a_seed_gives_one_route_however_it_is_interrupted(problem, route):
    whole, parts, again = (pulling(problem.world, route, seed=5, work=300) for _ in range(3))
    assert whole.run()
    while not parts.run(work=3, stop=lambda: True):
        problem.world.prove(route, clearance=0.05)  # others prove with the same tables meanwhile
    again.run()
    np.testing.assert_array_equal(whole.waypoints, again.waypoints)
    assert abs(route_length(parts.waypoints) / route_length(whole.waypoints) - 1.0) < 0.05


def test_many_waypoints_are_no_obstacle(problem, route):
    fine = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(route)])
    fine = np.vstack([fine, route[-1]])
    assert len(fine) > 100
    pull = pulling(problem.world, fine)
    pull.run()
    assert pull.intact()
    assert problem.world.prove(pull.waypoints, clearance=KEPT).proven
    assert route_length(pull.waypoints) < 0.99 * route_length(route)


def point_among(*obstacles):
    """A disc of one centimetre in the plane."""
    robot = rrtik.load_robot("point2d", parameters={"radius": 0.01, "bounds": [[-2, 2], [-2, 2]]})
    return rrtik.World(robot, rrtik.Scene(obstacles))


OVER = np.array([[-1.0, 0.0], [-1.5, 0.4], [-0.8, 1.5], [0.1, 1.8], [0.8, 1.0], [1.0, 0.0]])
WALL = rrtik.Box(0.02, 4.0, 2.0)
IN_WALL = rrtik.pose((0.0, -1.5, 0.0))  # its top is at y = 0.5
POINTS = rrtik.PointCloud(np.column_stack([np.zeros(60), np.linspace(-1.0, 0.49, 60), np.zeros(60)]), 0.01)


@pytest.mark.parametrize("obstacle", [rrtik.Obstacle("wall", WALL, IN_WALL), rrtik.Obstacle("cloud", POINTS)])
def test_a_point_goes_over_a_wall_by_nearly_the_shortest_way(obstacle):
    """As a string over the edge, a known length: a wall of half a metre, or points in a row that reach as high.

    A single route may end at a corner that lies a little aside, and which one does differs from processor to processor.
    """
    world = point_among(obstacle)
    shortest = 2.0 * np.hypot(1.0, 0.5)
    rng = np.random.default_rng(0)
    lengths = []
    for _ in range(15):
        route = OVER.copy()
        route[1:-1] += 0.05 * rng.normal(size=route[1:-1].shape)
        pull = pulling(world, route, work=300, least_gain=1e-3)
        pull.run()
        assert pull.intact()
        assert world.prove(pull.waypoints, clearance=KEPT).proven
        lengths.append(route_length(pull.waypoints) / shortest)
    assert 1.0 < min(lengths) < 1.02
    assert np.mean(lengths) < 1.06
    assert max(lengths) < 1.1


@pytest.mark.parametrize("work", [1, 2, 5, 20])
def test_a_motion_that_no_work_is_left_for_is_not_called_proven(work):
    through = np.array([[-1.0, 0.0], [-1.2, 0.3], [-1.4, 0.1], [-1.2, -0.3], [-1.0, 0.2], [1.0, 0.2]])
    pull = pulling(point_among(rrtik.Obstacle("wall", WALL, IN_WALL)), through, work=work)
    pull.run()
    assert not pull.proven


def test_bends_stay_in_the_box():
    motions = ProvenMotions(point_among(rrtik.Obstacle("wall", WALL, IN_WALL)), KEPT)
    lower = np.array([-1.5, 0.0])
    upper = np.array([1.5, 1.8])
    pull = Pulling(motions.motions, OVER, lower, upper)
    pull.run()
    assert ((pull.waypoints >= lower) & (pull.waypoints <= upper)).all()


def piece_of(body, part):
    """A body for coal that is one of the convex pieces of a body of several."""
    if part < 0 or not is_mesh(body.geometry):
        return body
    points = coal.StdVec_Vec3s()
    points.extend(convex_solids(body.geometry).around[part].corners)
    return replace(body, geometry=coal.Convex.convexHull(points, True, None))


def test_gaps_are_coal_s_distances_and_gradients_their_differences(problem, route):
    """Of contacts on the route as it is after a step."""
    world = problem.world
    prover = world.prover
    compared = 0
    for work in range(10, 60, 2):
        pull = pulling(world, route, seed=1, work=work)
        pull.run()
        table = pull.table
        rows = pull.waypoints
        for contact in np.flatnonzero(table.measured[: table.contacts].view(np.int64)).tolist():
            edge, pair = (int(numbers.view(np.int64)[contact]) for numbers in (table.edges, table.pairs))
            share = table.shares[contact]
            q = (1.0 - share) * rows[edge] + share * rows[edge + 1]
            sides = prover.tables.packed.sides[pair].reshape(2, 2).tolist()
            pieces = [piece_of(prover.bodies[body], part) for body, part in sides]
            margin = prover.table(KEPT).margins[pair]

            def distance(at, pieces=pieces):
                frames = world.robot.joint_frames(at[None])[0]
                return next(measured(pieces, [(0, 1)], frames, near_only=False)).distance

            gap = table.next_gaps[contact]
            if abs(distance(q) - margin - gap) > 1e-3:
                continue  # a gap that is measured to three percent
            gradient = table.next_gradients[contact * len(q) : (contact + 1) * len(q)]
            steps = 1e-5 * np.eye(len(q))
            expected = [(distance(q + step) - distance(q - step)) / 2e-5 for step in steps]
            np.testing.assert_allclose(gradient, expected, atol=0.15)  # gaps are measured to three percent
            compared += 1
    assert compared > 3


def test_what_cannot_be_proven_is_refused(problem, route):
    with pytest.raises(rrtik.InputError, match="kernels can prove"):
        pulling(problem.world, route[:1])
    with pytest.raises(rrtik.InputError, match="kernels can prove"):
        Pulling(problem.world.motions, route, problem.robot.lower, problem.robot.upper)
