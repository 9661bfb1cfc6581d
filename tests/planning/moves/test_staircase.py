"""Any path becomes single-joint moves with the same ends; moves are listed, written and said."""

import csv
import io
from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose_from_rpy
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.planning.moves.staircase import one_joint_moves, staircase_orders
from rrtik_ompl.planning.moves.text import moves_csv, moves_document, spoken_moves
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.world.world import World

values = st.one_of(st.floats(-3.0, 3.0), st.integers(-2, 2).map(float))
routes = st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(values, min_size=n, max_size=n), min_size=2, max_size=6))
FREE = {n: World(load_robot("planar", parameters={"lengths": [1.0] * n})) for n in (1, 2, 3, 4)}


def corridor(clearance):
    """A disc between two long walls on both sides of the diagonal, from (3, 3) to (7, 7), with so much space left."""
    side = (0.1 + clearance + 0.5) * np.array([-1.0, 1.0]) / np.sqrt(2.0)
    walls = [
        Obstacle(
            name, Box([4.0 * np.sqrt(2.0), 1.0, 2.0]), pose_from_rpy([*(5.0 + sign * side), 0.0], [0.0, 0.0, np.pi / 4])
        )
        for name, sign in (("left", 1.0), ("right", -1.0))
    ]
    return World(load_robot("point2d", parameters={"radius": 0.1, "bounds": [[0, 10], [0, 10]]}), Scene(walls))


def rebuilt(path):
    """The waypoints that the list of moves leads through."""
    q, rows = path.start.copy(), [path.start.copy()]
    for move in path.moves():
        q[path.joint_names.index(move.joint)] = move.end
        rows.append(q.copy())
    return np.array(rows)


@settings(max_examples=60)
@given(routes)
def test_a_converted_path_keeps_its_ends_and_moves_one_joint_at_a_time(rows):
    world = FREE[len(rows[0])]
    path = JointPath.of(world.robot, rows)
    moves = one_joint_moves(path, world)
    assert (moves.start == path.start).all()
    assert (moves.end == path.end).all()
    assert ((moves.waypoints[1:] != moves.waypoints[:-1]).sum(axis=1) == 1).all()
    assert moves.one_joint_at_a_time
    assert moves.violations(world) == ()


@settings(max_examples=60)
@given(routes)
def test_the_list_of_moves_of_a_converted_path_leads_back_to_it(rows):
    world = FREE[len(rows[0])]
    moves = one_joint_moves(JointPath.of(world.robot, rows), world)
    assert np.allclose(rebuilt(moves)[-1], moves.end, atol=1e-7)
    assert len(moves.moves()) == moves.transitions


def test_a_joint_that_trembles_makes_no_moves():
    world = FREE[3]
    path = JointPath.of(world.robot, [[0, 0, 0], [1, 1e-9, 0], [1, 0, 1], [0.5, 1e-9, 1]])
    moves = one_joint_moves(path, world)
    assert [move.joint for move in moves.moves()] == ["joint1", "joint3", "joint1"]
    assert (moves.end == path.end).all()
    assert moves.one_joint_at_a_time


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_path_of_rrt_connect_is_converted_among_obstacles(seed):
    problem = load_problem("titan4_sdu")
    path = plan(problem, "RRTConnect", seed=seed, shorten=False).path
    moves = one_joint_moves(path, problem)
    assert not path.one_joint_at_a_time
    assert moves.one_joint_at_a_time
    assert moves.violations(problem.world) == ()
    assert (rebuilt(moves) == moves.waypoints).all()


def test_the_grid_is_fine_only_where_the_path_passes_close_to_something():
    world = corridor(0.05)
    path = JointPath.of(world.robot, [[3.5, 3.5], [9.8, 9.8]])
    moves = one_joint_moves(path, world)
    steps = np.abs(np.diff(moves.waypoints, axis=0)).max(axis=1)
    inside = (moves.waypoints[:-1] < 6.5).all(axis=1)
    assert moves.violations(world) == ()
    assert steps[inside].max() < 0.2
    assert steps.max() > 2.0 * steps[inside].max()


def test_where_no_staircase_passes_one_line_names_the_edge_and_the_remedy():
    world = corridor(0.05)
    path = JointPath.of(world.robot, [[3.5, 3.5], [3.51, 3.51], [9.0, 9.0]])
    assert path.violations(world) == ()
    with pytest.raises(InputError, match=r"motion 2.*single-joint"):
        one_joint_moves(path, world, finest=0.5)


def free_if_in(pairs):
    return lambda tails, heads: np.array([(tuple(a), tuple(b)) in pairs for a, b in zip(tails, heads, strict=True)])


@given(st.permutations(range(4)))
def test_the_one_free_order_is_found(order):
    a, b = np.zeros(4), np.ones(4)
    corners = [np.isin(range(4), order[:k]).astype(float) for k in range(5)]
    only = {(tuple(p), tuple(q)) for p, q in pairwise(corners)}
    assert staircase_orders(a, b, free_if_in(only)) == [tuple(order)]


@given(st.sets(st.integers(0, 31), max_size=24))
def test_an_order_is_found_if_and_only_if_one_of_all_is_free(blocked):
    a, b = np.zeros(3), np.ones(3)
    edges = [(m, k) for m in range(8) for k in range(3) if not m >> k & 1]

    def corner(mask):
        return tuple(float(mask >> k & 1) for k in range(3))

    free = {(corner(m), corner(m | 1 << k)) for n, (m, k) in enumerate(edges) if n not in blocked}

    def passes(order):
        masks = np.cumsum([0, *(1 << k for k in order)]).tolist()
        return all((corner(p), corner(q)) in free for p, q in pairwise(masks))

    found = staircase_orders(a, b, free_if_in(free))
    assert all(passes(order) for order in found)
    assert {order[0] for order in found} == {order[0] for order in permutations(range(3)) if passes(order)}


def test_a_path_of_one_waypoint_is_refused():
    with pytest.raises(InputError, match="one waypoint"):
        one_joint_moves(JointPath.of(FREE[2].robot, [[0, 0]]), FREE[2])


def test_the_edge_of_several_joints_is_named_as_it_stands_in_the_path():
    path = JointPath([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 1.0]])
    with pytest.raises(InputError, match="motion 3 moves several joints"):
        path.moves()


def test_a_path_that_is_not_valid_is_not_converted():
    problem = load_problem("titan4_sdu")
    with pytest.raises(InputError, match="motion 1 is not valid"):
        one_joint_moves(JointPath.of(problem.robot, [problem.start, problem.goal.q]), problem)


@pytest.mark.parametrize("finest", [0.0, -1.0, float("nan")])
def test_steps_of_nothing_are_refused(finest):
    with pytest.raises(InputError, match="finest"):
        one_joint_moves(JointPath.of(FREE[2].robot, [[0, 0], [1, 1]]), FREE[2], finest=finest)


def test_moves_carry_names_and_units():
    path = JointPath([[0.0, 0.0], [1.0, 0.0], [1.0, -0.2]], ["turn", "slide"], [False, True])
    first, second = path.moves()
    assert (first.joint, first.unit, first.change) == ("turn", "rad", 1.0)
    assert (second.joint, second.unit, second.change) == ("slide", "m", -0.2)
    with pytest.raises(AttributeError):
        first.joint = "other"


def test_the_error_of_a_path_of_several_joints_says_how_to_convert_it():
    with pytest.raises(InputError, match="one_joint_moves"):
        moves_csv(JointPath([[0, 0], [1, 1]]))


def test_the_csv_is_in_degrees_and_metres(sdu_route):
    rows = list(csv.DictReader(io.StringIO(moves_csv(JointPath(sdu_route)))))
    assert len(rows) == 7
    assert (rows[1]["joint"], float(rows[1]["from"]), float(rows[1]["to"])) == ("joint5", 90.0, 80.0)
    assert rows[1]["unit"] == "deg"
    assert moves_document(JointPath(sdu_route))[1]["to"] == pytest.approx(np.deg2rad(80))


def test_moves_are_said_as_a_pilot_says_them():
    degrees = np.deg2rad([[0, 19, 0], [0, 55, 0], [0, 55, 350.25], [-0.5, 55, 350.25]])
    turning = JointPath(degrees, ["base", "joint2", "wrist_3"], continuous=[False, False, True])
    assert spoken_moves(turning) == [
        "joint 2 up 36 degrees to 55",
        "wrist 3 forward 350.2 degrees to minus 9.7",
        "base down 0.5 degrees to minus 0.5",
    ]
    limited = JointPath(degrees, ["base", "joint2", "wrist_3"])
    assert spoken_moves(limited)[1] == "wrist 3 up 350.2 degrees to 350.2"
    sliding = JointPath([[0.3], [0.1]], ["boom"], [True])
    assert spoken_moves(sliding) == ["boom in 200 millimetres to 100"]
