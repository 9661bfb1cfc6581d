"""Shortcuts in a kernel: free, never longer, the same for a seed, and near the shortest route where it is known."""

from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.geometry.collision.bodies import Body
from rrtik_ompl.kernels import FREE, UNDECIDED, FastWorld
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.kernels.search.shortcut import ShortcutSearch
from rrtik_ompl.model.transitions import route_length
from rrtik_tests.random_cases import KINDS, Case, arm, joint_values

pytestmark = pytest.mark.kernels

RESOLUTION = 0.02


def checked(world, chain, a, b, weights):
    """The kernels' answer for an edge, checked as a World would check it."""
    if tuple(a) > tuple(b):
        a, b = b, a
    steps = max(1, int(np.ceil(weights @ np.abs(b - a) / RESOLUTION - 1e-9)))
    ends = (row[None] @ chain.gain.T + chain.offset for row in (a, b))
    return world.classify_edges(*ends, [steps])[0]


def shortcuts(world, chain, route, *, weights, resolution, **options):
    """The search in a world whose motions are checked by this rule."""
    motions = FastMotions(world, chain.gain, chain.offset, weights=weights, resolution=resolution)
    return ShortcutSearch(motions, route, **options)


class Wandering:
    """A long free route of an arm among solids, and how to shorten it."""

    def __init__(self, name, seed, count=30):
        self.case = Case(name, seed, kinds=KINDS[:4], most_balls=2)
        self.world, self.chain = self.case.world, self.case.robot.chain
        self.weights = np.full(self.case.robot.dof, 0.7)
        free = self.case.sample(4000)
        free = free[self.world.classify(joint_values(self.case.robot, free)) == FREE]
        rng, route = np.random.default_rng(seed), [free[0]]
        for _ in range(100 * count):
            step = route[-1] + rng.normal(size=len(self.weights)) * 0.3
            step = np.clip(step, self.case.robot.lower, self.case.robot.upper)
            if len(route) < count and self.checked(route[-1], step) == FREE:
                route.append(step)
        self.route = np.array(route)

    def checked(self, a, b):
        return checked(self.world, self.chain, a, b, self.weights)

    def search(self, seed=0, **options):
        given = {"weights": self.weights, "resolution": RESOLUTION, "seed": seed, **options}
        return shortcuts(self.world, self.chain, self.route, **given)


WANDERINGS = [("titan4", 1), ("slider", 3), ("panda", 17), ("titan4", 4)]


@pytest.fixture(scope="module", params=WANDERINGS, ids=str)
def wandering(request):
    found = Wandering(*request.param)
    assert len(found.route) == 30
    return found


def test_every_edge_stays_free_and_the_ends_stay_to_the_bit(wandering):
    for seed in range(5):
        search = wandering.search(seed, asking=False)
        lengths = [route_length(wandering.route)]
        for tries in (1, 5, 20, 100, 400):
            search.run(tries)
            route = search.waypoints
            assert search.tries == tries or len(route) == 2
            assert all(wandering.checked(a, b) == FREE for a, b in pairwise(route))
            assert (route[0] == wandering.route[0]).all()
            assert (route[-1] == wandering.route[-1]).all()
            assert (route >= wandering.route.min(axis=0)).all()
            assert (route <= wandering.route.max(axis=0)).all()
            lengths.append(route_length(route))
        assert lengths == sorted(lengths, reverse=True)
        assert lengths[-1] < lengths[0]


def test_a_seed_gives_one_route_however_the_search_is_interrupted(wandering):
    whole = wandering.search(7)
    assert whole.run(200, chunk=1000)
    parts = wandering.search(7)
    while not parts.run(200, chunk=3, stop=lambda: True):
        pass
    np.testing.assert_array_equal(whole.waypoints, parts.waypoints)


def test_other_seeds_give_other_routes(wandering):
    routes = set()
    for seed in range(8):
        search = wandering.search(seed)
        search.run(3)
        routes.add(search.waypoints.tobytes())
    assert len(routes) > 1


def test_what_the_kernels_cannot_decide_is_asked_and_used_only_if_it_is_free(wandering):
    asked, allowed = [], set()

    def odd_ones_are_free(A, B):
        for a, b in zip(A, B, strict=True):
            asked.append(wandering.checked(a, b))
            if len(asked) % 2:
                allowed.add((a.tobytes(), b.tobytes()))
        return np.array([(a.tobytes(), b.tobytes()) in allowed for a, b in zip(A, B, strict=True)])

    for seed in range(5):
        search = wandering.search(seed)
        search.run(300, ask=odd_ones_are_free)
        for a, b in pairwise(search.waypoints):
            pair = {(a.tobytes(), b.tobytes()), (b.tobytes(), a.tobytes())}
            assert wandering.checked(a, b) == FREE or pair & allowed
    assert set(asked) <= {UNDECIDED}


def test_without_answers_undecided_shortcuts_are_left_out(wandering):
    routes = []
    for options, ask in (({"asking": False}, None), ({}, None), ({}, lambda A, B: np.zeros(len(A), dtype=bool))):
        search = wandering.search(3, **options)
        search.run(300, ask=ask)
        routes.append(search.waypoints)
    np.testing.assert_array_equal(routes[0], routes[1])
    np.testing.assert_array_equal(routes[0], routes[2])


def test_the_search_waits_for_its_answer():
    robot = arm("free point")
    solids = [Body("ball", 3, pin.SE3.Identity(), coal.Sphere(0.1), "link")]
    solids.append(Body("wall", 0, pin.SE3.Identity(), coal.Sphere(0.1), "obstacle"))
    around = np.array([[0.0, 0.0, 0.0, 0.1]])
    world = FastWorld(robot.chain, solids, [(0, 1)], outer=[around] * 2, inner=[np.zeros((0, 4))] * 2)
    route = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    solids[1].geometry.computeLocalAABB()
    for free, count in ((True, 2), (False, 3)):
        search = shortcuts(world, robot.chain, route, weights=np.ones(3), resolution=0.05, share=1.0, pull=0.0)
        looks = []
        search.run(100, ask=lambda A, B, free=free, looks=looks: looks.append((A, B)) or np.full(len(A), free))
        np.testing.assert_array_equal(np.stack(looks[0]), [[[-1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]]])
        assert len(search.waypoints) == count


def wall_world():
    """A point with a radius of 1 mm and a wall that it must go over: from x = -1 to x = 1, over z = 0.5 at x = 0."""
    robot = arm("free point")
    solid = coal.Box(0.02, 3.9, 2.0)
    solid.computeLocalAABB()
    wall = Body("wall", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5])), solid, "obstacle")
    point = Body("point", 3, pin.SE3.Identity(), coal.Sphere(1e-3), "link")
    spheres = np.array([[0.0, 0.0, 0.0, 1e-3]])
    return robot, FastWorld(robot.chain, [point, wall], [(0, 1)], outer=[spheres] * 2, inner=[spheres] * 2)


ROUTE_OVER = np.array([[-1, 0, 0], [-1.5, 0.5, 0.3], [-0.8, 1, 1.5], [0.1, -0.4, 1.8], [0.8, 0.3, 1.0], [1, 0, 0]])


@pytest.mark.parametrize(("kind", "worst"), [({"share": 0.0, "pull": 0.0}, 1.15), ({}, 1.02)])
def test_shortcuts_come_near_the_shortest_route(kind, worst):
    robot, world = wall_world()
    shortest = 2.0 * np.hypot(1.0, 0.5)
    for seed in range(5):
        options = {"weights": np.ones(3), "resolution": 0.01, "seed": seed, **kind}
        search = shortcuts(world, robot.chain, ROUTE_OVER, **options)
        assert search.run(3000, patience=1500)
        assert shortest - 0.02 < route_length(search.waypoints) < worst * shortest


def test_patience_ends_a_search_that_gains_nothing():
    robot, world = wall_world()
    tent = np.array([[-1, 0, 0], [0, 0, 0.52], [1, 0, 0]])
    search = shortcuts(world, robot.chain, tent, weights=np.ones(3), resolution=0.01, share=1.0)
    assert search.run(10**9, patience=50)
    assert search.tries == 50
    np.testing.assert_array_equal(search.waypoints, tent)


def test_the_metric_says_what_is_short():
    robot, world = wall_world()
    metric = np.array([1.0, 1.0, 0.0])  # to climb costs nothing
    options = {"weights": np.ones(3), "resolution": 0.01, "metric": metric}
    search = shortcuts(world, robot.chain, ROUTE_OVER, **options)
    search.run(3000)
    assert route_length(ROUTE_OVER * metric) > 3.0
    assert route_length(search.waypoints * metric) < 1.01 * 2.0
    assert search.gains > 0


def test_repeated_waypoints_and_a_route_of_two_are_taken():
    robot, world = wall_world()
    options = {"weights": np.ones(3), "resolution": 0.01}
    search = shortcuts(world, robot.chain, np.repeat(ROUTE_OVER, 3, axis=0), **options)
    search.run(1000)
    assert np.isfinite(search.waypoints).all()
    assert route_length(search.waypoints) < route_length(ROUTE_OVER)
    pair = shortcuts(world, robot.chain, ROUTE_OVER[:2], **options)
    assert pair.run(1000)
    np.testing.assert_array_equal(pair.waypoints, ROUTE_OVER[:2])


def test_a_route_may_grow_by_many_waypoints():
    robot, world = wall_world()
    search = shortcuts(world, robot.chain, ROUTE_OVER, weights=np.ones(3), resolution=0.01, share=0.0)
    search.run(200_000)
    assert len(search.waypoints) <= len(ROUTE_OVER) + 256
    assert route_length(search.waypoints) < route_length(ROUTE_OVER)


@pytest.mark.parametrize("route", [ROUTE_OVER[:1], 1e6 * ROUTE_OVER])
def test_routes_that_are_none_are_refused(route):
    robot, world = wall_world()
    with pytest.raises(InputError, match="waypoints to shorten"):
        shortcuts(world, robot.chain, route, weights=np.ones(3), resolution=0.01)


@pytest.mark.parametrize("wrong", [{"resolution": 0.0}, {"weights": [1]}])
def test_options_that_make_no_sense_are_refused(wrong):
    robot, world = wall_world()
    with pytest.raises(InputError):
        shortcuts(world, robot.chain, ROUTE_OVER, **{"weights": np.ones(3), "resolution": 0.01, **wrong})
