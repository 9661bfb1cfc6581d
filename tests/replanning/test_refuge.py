"""What nothing can reach in time is what a bound on speeds says, and a contact that cannot be ruled out is proven."""

from itertools import pairwise

import numpy as np
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.refuge import Guard, _kept
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.replanning.unavoidable import ContactWarning, unavoidable
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import OPTIONS, box, place, plane

SPEED, TICK = 5.0, 0.1


def pressed(seconds=3.0):
    """Four walls that close in on the robot."""
    walls = []
    for name, x, y, wide, high in (
        ("left", 5, 10, 2, 12), ("right", 15, 10, 2, 12), ("top", 10, 15, 12, 2), ("bottom", 10, 5, 12, 2),
    ):  # fmt: skip
        inwards = place(x + 0.8 * (10 - x), y + 0.8 * (10 - y))
        walls.append(box(name, x, y, wide, high, TimedPoses([0.0, seconds], [place(x, y), inwards])))
    return plane(*walls, start=(10.3, 10.2))


def guard_of(problem):
    settings = ReplanSettings(step=0.5, rate=1.0 / TICK, speed_bound=SPEED)
    alone = problem.world.with_scene(Scene())
    guard = Guard(problem.world, alone, settings, 0.0, np.full(2, 0.5), np.random.default_rng(0))
    scene = problem.world.scene
    names = frozenset(o.name for o in scene.obstacles)
    guard.see(scene, dict.fromkeys(names, 0.0), names)
    return guard


def box_distance(points, obstacle):
    """Distance of points, shape (m, 2), from a box along the axes [m]."""
    away = np.abs(points - obstacle.pose.translation[:2]) - 0.5 * np.asarray(obstacle.shape.size)[:2]
    return np.linalg.norm(np.maximum(away, 0.0), axis=1)


def test_a_piece_is_kept_only_if_its_least_room_is_larger_than_the_growth():
    rng = np.random.default_rng(1)
    shares = np.linspace(0.0, 1.0, 401)
    kept = 0
    for _ in range(300):
        room, travel, growth = rng.uniform(0.0, 1.0, 2), rng.uniform(0.01, 1.0), np.sort(rng.uniform(0.0, 0.6, 2))
        least = np.maximum(room[0] - travel * shares, room[1] - travel * (1.0 - shares))
        truly = (least > growth[0] + shares * (growth[1] - growth[0])).all() and (room > growth).all()
        found = _kept(room[None], np.array([[travel]]), growth)[0, 0]
        assert not (found and not truly)
        kept += found
    assert kept > 20


def test_a_refuge_is_out_of_reach_for_as_long_as_it_says():
    problem = plane(box("chaser", 8.0, 10.0, 2.0, 2.0), box("other", 10.0, 13.0, 3.0, 1.0), start=(10.0, 10.0))
    robot_world = MovingWorld(problem.world, self_collision=False)
    guard = guard_of(problem)
    refuge = guard.refuge(problem.start, None, lambda ticks: robot_world)
    assert refuge.moves
    assert refuge.seconds >= TICK - 1e-9
    shares = np.linspace(0.0, 1.0, 50)
    points = problem.start + shares[:, None] * (refuge.q - problem.start)
    assert np.linalg.norm(refuge.q - problem.start) <= 0.5 + 1e-9
    for obstacle in problem.world.scene.obstacles:
        assert (box_distance(points, obstacle) > SPEED * TICK * shares).all()


def test_planes_prove_what_bounds_of_distances_do_not():
    guard = guard_of(plane(box("chaser", 8.0, 10.0, 2.0, 2.0), start=(9.2, 10.0)))
    q = np.array([9.2, 10.0])
    away, stays = guard._out_of_reach(q, np.array([[9.7, 10.0], [9.2, 10.0]]))
    assert away
    assert not stays


def test_a_robot_that_is_pressed_is_told_so_before_it_is_touched_and_the_proof_holds(tmp_path):
    problem = pressed()
    with pytest.warns(ContactWarning, match="which is proven") as warned:
        run = replan(problem, speed_bound=SPEED, record=tmp_path / "run.json", **(OPTIONS | {"seconds": 3.0}))
    assert len(warned) == 1

    first_contact = next(each for each in run.violations(problem) if each.touches)
    lost = [k for k, tick in enumerate(run.ticks) if tick.unavoidable is not None]
    assert lost[0] <= first_contact.tick
    assert all(tick.safe_seconds >= TICK - 1e-9 for tick in run.ticks[: lost[0]])
    assert "contact could not be ruled out in" in run.summary()

    # The boxes cover what the robot can reach, and in all of each one obstacle can touch it.
    rng = np.random.default_rng(0)
    again = ReplanRun.load(tmp_path / "run.json")
    for k in lost:
        tick = again.ticks[k]
        proof = tick.unavoidable
        scene = problem.world.scene.at(tick.time)
        reached = tick.q + rng.uniform(-0.5, 0.5, (2000, 2))
        reached = reached[np.linalg.norm(reached - tick.q, axis=1) <= 0.5]
        inside = ((reached[:, None] >= proof.lower) & (reached[:, None] <= proof.upper)).all(axis=2)
        assert inside.any(axis=1).all()
        for number, (_, name) in enumerate(proof.pairs):
            corners = np.array([[x, y] for x in (0, 1) for y in (0, 1)])
            corners = proof.lower[number] + corners * (proof.upper[number] - proof.lower[number])
            assert (box_distance(corners, scene.obstacle(name)) <= SPEED * proof.seconds).all()


@pytest.mark.parametrize("room", [0.0, 0.3])
def test_no_contact_is_called_unavoidable_where_there_is_a_way_out(room):
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    walls = [Obstacle(f"wall{y:g}", Box([20.0, 1.0, 1.0]), place(10.0, y)) for y in (9.2, 10.8)]
    if not room:
        walls += [Obstacle("end", Box([1.0, 20.0, 1.0]), place(x, 10.0)) for x in (9.2,)]
        walls += [Obstacle("far", Box([1.0, 20.0, 1.0]), place(x, 10.0)) for x in (10.9,)]
    world = World(robot, Scene(walls))
    growths = dict.fromkeys((o.name for o in walls), SPEED * TICK - room)
    found = unavoidable(world, np.array([10.0, 10.0]), growths, TICK, step=0.5, max_change=np.full(2, 0.5))
    assert (found is None) == bool(room)


def test_moves_of_a_run_with_a_bound_are_safe_for_the_tick_they_are_made_in():
    run = replan(pressed(12.0), speed_bound=SPEED, **(OPTIONS | {"seconds": 1.5}))
    assert all(before.safe_seconds is not None for before, _ in pairwise(run.ticks))
    assert replan(pressed(12.0), **(OPTIONS | {"seconds": 0.3})).ticks[0].safe_seconds is None
