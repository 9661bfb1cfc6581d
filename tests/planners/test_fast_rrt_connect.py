"""RRT-Connect in kernels finds the paths that the world calls free, on any arm, lazily or eagerly."""

from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from ompl import base as ob

from rrtik_ompl.base.budget import Budget
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.urdf import robot_from_urdf_text
from rrtik_ompl.kernels import FastWorld, needs_covers
from rrtik_ompl.kernels.covers.spheres import inner_spheres, outer_cover
from rrtik_ompl.kernels.search import connect
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.motions.motion_table import FastMotions
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.ompl_bridge import StateIO
from rrtik_ompl.ompl_bridge.attempt import attempt
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_planners import FastRRTConnect

pytestmark = [pytest.mark.kernels, pytest.mark.usefixtures("quiet_ompl")]

NONE = np.empty((0, 4))


def arm(*kinds, length=0.3):
    """A chain of bars in a plane: "r" turns, "p" slides along its bar, "m" turns with the joint before it, halved."""
    links, joints = ['<link name="l0"/>'], []
    for k, kind in enumerate(kinds, start=1):
        half = 0.5 * length
        shape = f'<origin xyz="{half} 0 0"/><geometry><box size="{length - 0.1} 0.03 0.05"/></geometry>'
        links.append(f'<link name="l{k}"><collision>{shape}</collision></link>')
        axis, low, high = ("1 0 0", -0.2, 0.2) if kind == "p" else ("0 0 1", -3.0, 3.0)
        follows = f'<mimic joint="j{k - 1}" multiplier="-0.5" offset="0.1"/>' if kind == "m" else ""
        joints.append(
            f'<joint name="j{k}" type="{"prismatic" if kind == "p" else "revolute"}"><parent link="l{k - 1}"/>'
            f'<child link="l{k}"/><origin xyz="{length if k > 1 else 0} 0 0"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="1" effort="1"/>{follows}</joint>'
        )
    return robot_from_urdf_text(f'<robot name="arm">{"".join(links + joints)}</robot>')


class Covered(World):
    """A world with kernels; with ``coarse`` covers, all that comes near anything is undecided."""

    def __init__(self, robot, obstacles=(), *, coarse=False, accuracy="exact"):
        super().__init__(robot, Scene(obstacles), motion_resolution=0.04, accuracy=accuracy)
        spheres = [self._spheres(body, coarse) for body in self.bodies]
        outer, inner = ([pair[k] for pair in spheres] for k in (0, 1))
        moving = [p for p in self.pairs if any(self.bodies[i].joint > 0 for i in p)]
        self.tables = FastWorld(robot.chain, self.bodies, moving, outer=outer, inner=inner)
        self.asked = []

    @property
    def fast(self):
        return self.tables

    @staticmethod
    def _spheres(body, coarse):
        outer, inner = needs_covers(body)
        if coarse:
            return NONE, NONE
        return outer_cover(body.geometry) if outer else NONE, inner_spheres(body.geometry) if inner else NONE

    def motion_valid_batch(self, A, B):
        free = super().motion_valid_batch(A, B)
        self.asked += list(zip(A.tolist(), B.tolist(), free.tolist(), strict=True))
        return free


def search_in(world, **options):
    chain = world.robot.chain
    rules = {
        "weights": world.weights,
        "resolution": world.motion_resolution,
        "gain": chain.gain,
        "offset": chain.offset,
    }
    own = {name: options.pop(name) for name in ("range_", "domain", "patience") if name in options}
    motions = FastMotions(world.fast, **{**rules, **options})
    return ConnectSearch(motions, world.robot.lower, world.robot.upper, **own)


def rows(*configurations):
    return np.array(configurations, dtype=float)


def require_path(world, path, starts, goals):
    assert path is not None
    assert path[0].tolist() in starts.tolist()
    assert path[-1].tolist() in goals.tolist()
    assert all(World.motion_valid(world, a, b) for a, b in pairwise(path))
    assert (np.diff(path, axis=0) != 0.0).any(axis=1).all()


def ball(name, x, y, radius):
    return Obstacle(name, Sphere(radius), pin.SE3(np.eye(3), np.array([x, y, 0.0])))


def wall(name, x, y, *size):
    return Obstacle(name, Box(np.array(size)), pin.SE3(np.eye(3), np.array([x, y, 0.0])))


BALLS = (ball("right", 0.75, 0.35, 0.15), ball("left", 0.75, -0.4, 0.15), ball("back", -0.5, 0.45, 0.2))


@cache
def three_joints(coarse=False, accuracy="exact"):
    return Covered(arm("r", "r", "r"), BALLS, coarse=coarse, accuracy=accuracy)


START, GOAL = rows([1.2, 0.1, 0.1]), rows([-1.3, 0.2, -0.1])


@pytest.mark.parametrize("coarse", [False, True])
@pytest.mark.parametrize("patience", [0, 4, 20])
def test_every_edge_of_a_path_is_free(coarse, patience):
    world = three_joints(coarse)
    search = search_in(world, patience=patience)
    for seed in range(3):
        path = search.solve(START, GOAL, seed, ask=world.motion_valid_batch)
        require_path(world, path, START, GOAL)


def test_a_conservative_search_asks_nothing():
    world = three_joints()
    search = search_in(world)
    path = search.solve(START, GOAL, 1)
    require_path(world, path, START, GOAL)
    assert search.statistics()["questions"] == 0
    assert search.statistics()["vertices"] >= 2


def test_motions_that_an_answer_rejects_are_never_part_of_the_path():
    world = three_joints(coarse=True)
    rejected = 0
    for patience in (0, 3, 20):
        search = search_in(world, patience=patience)
        for seed in range(2):
            world.asked.clear()
            path = search.solve(START, GOAL, seed, ask=world.motion_valid_batch)
            edges = list(pairwise(path.tolist()))
            refused = [(a, b) for a, b, free in world.asked if not free]
            rejected += len(refused)
            assert not any((a, b) in edges or (b, a) in edges for a, b in refused)
    assert rejected > 0


def test_a_gap_that_the_covers_close_is_passed_by_asking():
    shelf = wall("shelf", 0.55, 0.055, 0.3, 0.04, 1.0)  # nearer to the bar than the ball around it
    world = Covered(arm("r", "p"), [shelf], coarse=True)
    start, goal = rows([0.0, -0.15]), rows([0.0, 0.15])
    assert World.motion_valid(world, start[0], goal[0])
    search = search_in(world)
    assert search.solve(start, goal, 0, max_iterations=300) is None
    require_path(world, search.solve(start, goal, 0, ask=world.motion_valid_batch), start, goal)


@pytest.mark.parametrize("coarse", [False, True])
def test_the_path_does_not_depend_on_how_the_work_is_divided(coarse, monkeypatch):
    world = three_joints(coarse)
    paths = []
    for first, most in ((1, 1), (7, 7), (256, 1 << 20)):
        monkeypatch.setattr(connect, "FIRST_BUDGET", first)
        monkeypatch.setattr(connect, "MIN_BUDGET", first)
        monkeypatch.setattr(connect, "MAX_BUDGET", most)
        search = search_in(world)
        paths.append([search.solve(START, GOAL, s, ask=world.motion_valid_batch) for s in (4, 5, 4)])
    for one, two, again in paths:
        np.testing.assert_array_equal(one, paths[0][0])
        np.testing.assert_array_equal(two, paths[0][1])
        np.testing.assert_array_equal(again, one)
    assert not np.array_equal(paths[0][0], paths[0][1])


@pytest.mark.parametrize(
    "kinds",
    [("r",) * 2, ("r",) * 13, ("r", "p", "r"), ("r", "m", "r", "r"), ("p", "r", "m", "p", "r", "m")],
    ids="".join,
)
def test_any_arm_finds_its_way(kinds):
    robot = arm(*kinds, length=0.3 if len(kinds) < 10 else 0.12)
    size = 0.3 * len(kinds) if len(kinds) < 10 else 0.12 * len(kinds)
    world = Covered(robot, [ball("ball", 0.7 * size, 0.0, 0.12 * size)])
    turned = np.zeros(robot.dof)
    turned[int(robot.prismatic[0])] = 0.9
    start, goal = turned[None], -turned[None]
    assert world.valid_batch(np.vstack([start, goal])).all()
    assert not world.motion_valid(start[0], goal[0])
    search = search_in(world)
    require_path(world, search.solve(start, goal, 0, ask=world.motion_valid_batch), start, goal)


def test_several_starts_and_goals_are_joined_by_the_straight_motion_if_one_is_free():
    world = three_joints()
    starts, goals = np.vstack([START, [2.5, 0.0, 0.0]]), np.vstack([GOAL, START + 0.05])
    path = search_in(world).solve(starts, goals, 0, ask=world.motion_valid_batch)
    np.testing.assert_array_equal(path, [START[0], START[0] + 0.05])


def test_hundreds_of_roots_are_taken():
    world = three_joints()
    rng = np.random.default_rng(0)
    starts = START + rng.uniform(-0.01, 0.01, (700, 3))
    goals = GOAL + rng.uniform(-0.01, 0.01, (3000, 3))
    require_path(world, search_in(world).solve(starts, goals, 0, ask=world.motion_valid_batch), starts, goals)


def test_a_start_that_is_a_goal_is_a_path_of_one_row():
    world = three_joints()
    np.testing.assert_array_equal(search_in(world).solve(START, np.vstack([GOAL, START]), 0), START)


def test_without_a_way_the_search_ends_at_its_limit_or_when_it_is_stopped():
    robot = arm("r", "r")
    world = Covered(robot, [wall("above", 0.4, 0.25, 0.6, 0.05, 1.0), wall("below", 0.4, -0.25, 0.6, 0.05, 1.0)])
    start, goal = rows([0.0, 0.0]), rows([2.5, 0.0])
    assert world.valid_batch(np.vstack([start, goal])).all()
    search = search_in(world)
    assert search.solve(start, goal, 0, ask=world.motion_valid_batch, max_iterations=300) is None
    assert search.statistics()["iterations"] == 300
    calls = iter([False] * 5)
    assert search.solve(start, goal, 0, ask=world.motion_valid_batch, stop=lambda: next(calls, True)) is None
    assert next(calls, None) is None


def test_a_tree_that_outgrows_its_memory_goes_on(monkeypatch):
    world = three_joints()
    wanted = search_in(world, range_=0.05).solve(START, GOAL, 3, ask=world.motion_valid_batch)
    monkeypatch.setattr(connect, "FIRST_CAPACITY", 16)
    search = search_in(world, range_=0.05)
    np.testing.assert_array_equal(search.solve(START, GOAL, 3, ask=world.motion_valid_batch), wanted)
    assert search.statistics()["vertices"] > 32


def test_a_path_longer_than_the_memory_for_paths_comes_back_whole(monkeypatch):
    world = three_joints()
    wanted = search_in(world, range_=0.05).solve(START, GOAL, 3)
    monkeypatch.setattr(connect, "FIRST_PATH", 4)
    search = search_in(world, range_=0.05)
    for _ in range(2):  # the second time there is room
        np.testing.assert_array_equal(search.solve(START, GOAL, 3), wanted)
    assert len(wanted) > 8


def test_a_path_stays_as_it_is_when_the_search_goes_on():
    search = search_in(three_joints())
    path = search.solve(START, GOAL, 3)
    kept = path.copy()
    search.solve(GOAL, START, 4)
    np.testing.assert_array_equal(path, kept)


def test_what_is_proven_free_lies_in_the_box_and_clear_of_everything():
    world = three_joints()
    search, coarse = search_in(world), search_in(three_joints(coarse=True))
    Q = np.random.default_rng(2).uniform(world.robot.lower, world.robot.upper, (300, 3))
    free = world.valid_batch(Q)
    proven = np.array([search.proven_free(q[None]) for q in Q])
    assert 0.9 * free.sum() < proven.sum() <= free.sum()
    assert free[proven].all()
    assert free[[coarse.proven_free(q[None]) for q in Q]].all()
    assert search.proven_free(Q[proven])
    assert not search.proven_free(np.vstack([Q[proven], Q[~free][:1]]))
    assert not search.proven_free(START + np.array([0.0, 4.0, 0.0]))


def test_steps_by_length_are_an_alternative_rule():
    world = three_joints()
    search = search_in(world, weights=np.zeros(3), steps_per_unit=200.0)
    require_path(world, search.solve(START, GOAL, 0), START, GOAL)


def test_what_makes_no_sense_is_refused():
    world = three_joints()
    with pytest.raises(InputError, match="start 0"):
        search_in(world).solve(START + 9.0, GOAL, 0)
    with pytest.raises(InputError, match="goal 1"):
        search_in(world).solve(START, np.vstack([GOAL, GOAL * np.nan]), 0)
    with pytest.raises(InputError, match="shape"):
        search_in(world).solve(START[:, :2], GOAL, 0)
    with pytest.raises(InputError, match="range"):
        search_in(world, range_=-1.0)
    with pytest.raises(InputError, match="gain"):
        search_in(world, gain=np.eye(3)[:2], offset=np.zeros(2))
    with pytest.raises(InputError, match="farther than the checks cover"):
        search_in(world, offset=np.full(3, 2e8))
    with pytest.raises(InputError, match="resolution"):
        search_in(world, resolution=0.0)


def solved_by_planner(world, seed=5, start=START, goals=GOAL, valid=None, **options):
    """The planner in OMPL, its status and the path; ``valid`` judges states, by default in C++ that all are."""
    space, bounds = ob.RealVectorStateSpace(3), ob.RealVectorBounds(3)
    for k in range(3):
        bounds.setLow(k, float(world.robot.lower[k]))
        bounds.setHigh(k, float(world.robot.upper[k]))
    space.setBounds(bounds)
    si = ob.SpaceInformation(space)
    io, state, definition = StateIO(si), si.allocState(), ob.ProblemDefinition(si)
    everything = ob.AllValidStateValidityChecker(si)
    si.setStateValidityChecker(everything if valid is None else lambda s: bool(valid(io.read(s))))
    si.setup()
    io.write(state, start[0])
    definition.addStartState(state)
    goal = ob.GoalStates(si)
    for row in goals:
        io.write(state, row)
        goal.addState(state)
    definition.setGoal(goal)
    planner = FastRRTConnect(si, world=world, seed=seed, **options)
    planner.setProblemDefinition(definition)
    planner.setup()
    status = str(planner.solve(10.0))
    found = definition.getSolutionPath()
    return planner, status, None if found is None else io.rows(found)


@pytest.mark.parametrize("coarse", [False, True])
def test_the_planner_uses_the_kernels_of_its_world(coarse):
    world = three_joints(coarse)
    planner, status, path = solved_by_planner(world)
    assert (status, planner.error) == ("Exact solution", None)
    require_path(world, path, START, GOAL)
    assert planner.statistics["motions"] > 0
    assert planner.statistics["checked_motions"] == planner.statistics["motions"]
    assert planner.statistics["edges"] == planner.statistics["vertices"] - 2


@pytest.mark.parametrize("coarse", [False, True])
def test_ends_that_only_the_world_knows_to_collide_are_refused(coarse):
    world, colliding = three_joints(coarse), rows([0.45, 0.0, 0.0])
    assert not world.valid(colliding[0])
    assert solved_by_planner(world, start=colliding)[1] == "Invalid start"
    assert solved_by_planner(world, goals=colliding)[1] == "Invalid goal"
    _, status, path = solved_by_planner(world, goals=np.vstack([colliding, GOAL]))
    assert status == "Exact solution"
    require_path(world, path, START, GOAL)


def test_ends_that_are_known_to_be_free_are_not_checked_again():
    problem = Problem(three_joints(True), START[0], GOAL[0])
    once, again = (
        attempt(problem, FastRRTConnect, GOAL, Budget(seed=1, seconds=10.0), checked=checked)
        for checked in (True, False)
    )
    assert (once.statistics["checked_states"], again.statistics["checked_states"]) == (0, 2)
    np.testing.assert_array_equal(once.rows, again.rows)


def test_what_the_owner_of_the_space_refuses_is_refused():
    world, other = three_joints(), rows([-1.3, 0.1, 0.1])
    path = solved_by_planner(world, goals=np.vstack([GOAL, other]), valid=lambda q: q[1] != GOAL[0, 1])[2]
    require_path(world, path, START, other)
    assert solved_by_planner(world, valid=lambda q: q[0] < 1.0)[1] == "Invalid start"


def test_the_planner_asks_nothing_in_a_conservative_world():
    world = three_joints(False, "conservative")
    planner, status, path = solved_by_planner(world)
    assert status == "Exact solution"
    require_path(world, path, START, GOAL)
    assert (planner.statistics["questions"], planner.statistics["checked_motions"] > 0) == (0, True)


def test_the_planner_gives_the_same_path_for_the_same_seed():
    world = three_joints()
    one, two, other = (solved_by_planner(world, seed=s)[2] for s in (8, 8, 9))
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, other)


def test_the_planner_ends_at_its_iteration_limit():
    planner, status, _ = solved_by_planner(three_joints(), max_iterations=1, range=0.01)
    assert status == "Approximate solution"
    assert planner.statistics["iterations"] == 1


@pytest.mark.parametrize("options", [{"range": 0.0}, {"domain": -1.0}, {"max_iterations": 0}])
def test_options_of_the_planner_are_checked(options):
    with pytest.raises(InputError):
        solved_by_planner(three_joints(), **options)


def test_trees_of_one_size_do_not_go_on_seeing_one_half_of_the_space_each():
    found = plan(load_problem("cut_polygons"), "fastrrtconnect", seed=1835504127)
    assert found.path is not None
    assert found.statistics["iterations"] < 20_000
