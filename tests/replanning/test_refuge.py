"""What nothing can reach in time is what a bound on speeds says, and a contact that cannot be ruled out is proven."""

import re
from dataclasses import replace
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene, TimedPoses
from rrtik_ompl.model.shapes import Box, Sphere
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.refuge import Guard
from rrtik_ompl.replanning.replanner import replan, replan_with
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.replanning.settings import ReplanSettings
from rrtik_ompl.replanning.unavoidable import ContactWarning, Reach, Unavoidable, kept, way_out
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
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


def guard_of(problem, speed=SPEED, may_move=None):
    settings = ReplanSettings(step=0.5, rate=1.0 / TICK, speed_bound=speed)
    alone = problem.world.with_scene(Scene())
    guard = Guard(problem.world, alone, settings, 0.0, np.full(2, 0.5), np.random.default_rng(0))
    scene = problem.world.scene
    names = frozenset(o.name for o in scene.obstacles)
    guard.see(scene, dict.fromkeys(names, 0.0), names if may_move is None else frozenset(may_move))
    return guard


def box_distance(points, obstacle):
    """Distance of points, shape (m, 2), from a box along the axes [m]."""
    away = np.abs(points - obstacle.pose.translation[:2]) - 0.5 * np.asarray(obstacle.shape.size)[:2]
    return np.linalg.norm(np.maximum(away, 0.0), axis=1)


def test_a_piece_is_kept_only_if_its_least_room_is_larger_than_the_growth():
    rng = np.random.default_rng(1)
    shares = np.linspace(0.0, 1.0, 401)
    count = 0
    for _ in range(300):
        room, travel, growth = rng.uniform(0.0, 1.0, 2), rng.uniform(0.01, 1.0), np.sort(rng.uniform(0.0, 0.6, 2))
        least = np.maximum(room[0] - travel * shares, room[1] - travel * (1.0 - shares))
        truly = (least > growth[0] + shares * (growth[1] - growth[0])).all() and (room > growth).all()
        found = kept(room[None], np.array([[travel]]), growth)[0, 0]
        assert not (found and not truly)
        count += found
    assert count > 20


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


def test_a_refuge_behind_a_corner_of_the_path_is_out_of_reach_on_the_straight_way_to_it():
    corner = [10.177, 10.177]
    end = [10.354, 10.0]  # The arm would be there after a tick, around the post.
    post = box("post", 10.177, 9.53, 0.02, 1.0)
    lid = box("lid", 10.0, 11.3, 8.0, 2.0)
    problem = plane(post, lid, box("chaser", 8.6, 10.0, 2.0, 8.0), start=(10.0, 10.0))
    nearer = problem.world.with_scene(Scene([post, lid, box("chaser", 9.0, 10.0, 2.0, 8.0)]))
    predicted = MovingWorld(nearer, self_collision=False)
    guard = guard_of(problem, speed=2.0, may_move={"chaser"})
    path = np.array([problem.start, corner, end, [13.0, 9.5]])
    refuge = guard.refuge(problem.start, path, lambda ticks: predicted)
    assert refuge.seconds >= TICK - 1e-9
    points = problem.start + np.linspace(0.0, 1.0, 500)[:, None] * (refuge.q - problem.start)
    for obstacle in (post, lid):
        assert (box_distance(points, obstacle) > 0.0).all()


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
            ends = proof.lower[number] + corners * (proof.upper[number] - proof.lower[number])
            on_the_way = tick.q + proof.seconds[number] / TICK * (ends - tick.q)
            assert (box_distance(on_the_way, scene.obstacle(name)) <= SPEED * proof.seconds[number]).all()


def gaps(ends, shares, q, boxes):
    """How far a point keeps from all that boxes can reach, on motions to ends, (m, 2), at shares, (m, k) or (k,)."""
    shares = np.broadcast_to(shares, (len(ends), np.shape(shares)[-1]))
    points = (q + shares[:, :, None] * (ends - q)[:, None]).reshape(-1, 2)
    near = np.min([box_distance(points, each) for each in boxes], axis=0)
    return near.reshape(shares.shape) - SPEED * TICK * shares


def hemmed_in(rng):
    """A point with two to four boxes around it, most of which it cannot wait for."""
    q = rng.uniform(1.0, 19.0, 2)
    boxes = []
    for k in range(int(rng.integers(2, 5))):
        wide, high = rng.uniform(0.4, 4.0, 2)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        way = np.array([np.cos(angle), np.sin(angle)])
        out = way / np.abs(way / [0.5 * wide, 0.5 * high]).max()  # from the middle of the box to its edge
        boxes.append(box(f"box{k}", *(q + out + rng.uniform(0.02, 0.45) * way), wide, high))
    return q, boxes


def test_every_tick_has_a_way_out_or_a_proof_that_there_is_none():
    robot = load_robot("point2d", parameters={"radius": 0.0, "bounds": [[0, 20], [0, 20]]})
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(*(2 * [np.linspace(-0.5, 0.5, 41)])), axis=-1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) <= 0.5]
    narrow = dict.fromkeys(("way out", "proof"), 0)
    for _ in range(50):
        q, boxes = hemmed_in(rng)
        best = gaps(q + grid, np.linspace(0.0, 1.0, 11), q, boxes).min(axis=1).max()
        names = [each.name for each in boxes]
        before, after = dict.fromkeys(names, 0.0), dict.fromkeys(names, SPEED * TICK)
        reach = Reach(World(robot, Scene(boxes)), q, 0.5, np.full(2, 0.5), TICK, before, after, 1e-5)
        found = way_out(reach, lambda q: True)

        if isinstance(found, Unavoidable):
            assert best < 0.0
            narrow["proof"] += best > -0.05
            ends = q + rng.uniform(-1.0, 1.0, (500, 2)) * 0.5
            ends = ends[np.linalg.norm(ends - q, axis=1) <= 0.5]
            inside = ((ends[:, None] >= found.lower) & (ends[:, None] <= found.upper)).all(axis=2)
            assert inside.any(axis=1).all()
            shares = found.seconds[inside.argmax(axis=1)] / TICK
            assert (gaps(ends, shares[:, None], q, boxes) <= 0.0).all()
        else:
            assert found is not None
            assert best > -0.03  # The grid is coarse.
            narrow["way out"] += best < 0.05
            assert np.linalg.norm(found - q) <= 0.5 + 1e-9
            assert (gaps(found[None], np.linspace(0.0, 1.0, 2001), q, boxes) > 0.0).all()
    assert min(narrow.values()) >= 3


def coal_distance(world, pair, q):
    """Distance of a link and an obstacle by pinocchio and coal."""
    link, obstacle = (next(body for body in world.bodies if body.name == name) for name in pair)
    model = world.robot.model
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    places = data.oMi[link.joint] * link.placement, obstacle.placement
    first, second = (coal.Transform3s(place.rotation, place.translation) for place in places)
    request = coal.DistanceRequest()
    return coal.distance(link.geometry, first, obstacle.geometry, second, request, coal.DistanceResult())


def test_an_arm_of_six_joints_has_a_way_out_or_a_proof_in_most_ticks_and_coal_confirms_both():
    robot = load_robot("ur5")
    rng = np.random.default_rng(7)
    step, seconds = 0.05, 0.02
    decided = dict.fromkeys(("way out", "proof", "neither"), 0)
    for _ in range(16):
        q = rng.uniform(-2.0, 2.0, 6)
        frames = robot.joint_frames(q[None])[0]
        beside = rng.normal(size=3)
        place = frames[int(rng.integers(2, 5)), :3, 3] + rng.uniform(0.13, 0.2) * beside / np.linalg.norm(beside)
        ball = Obstacle("ball", Sphere(0.04), place)
        world = World(robot, Scene([ball])).with_accuracy("exact")
        if not world.valid(q):
            continue
        grown = rng.uniform(0.01, 0.2)
        reach = Reach(world, q, step, np.full(6, step), seconds, {"ball": 0.0}, {"ball": grown}, 1e-6)
        found = way_out(reach, lambda q: True)

        if isinstance(found, Unavoidable):
            decided["proof"] += 1
            ways = rng.normal(size=(30, 6))
            ends = q + step * rng.uniform(0.5, 1.0, (30, 1)) * ways / np.linalg.norm(ways, axis=1, keepdims=True)
            for end in ends:
                box = int(((end >= found.lower) & (end <= found.upper)).all(axis=1).nonzero()[0][0])
                share = found.seconds[box] / seconds
                assert coal_distance(world, found.pairs[box], q + share * (end - q)) <= grown * share + 1e-9
        elif found is not None:
            decided["way out"] += 1
            pairs = [pair for pair in world.distances(q).names if "ball" in pair]
            for share in np.linspace(0.0, 1.0, 21):
                gap = min(coal_distance(world, pair, q + share * (found - q)) for pair in pairs)
                assert gap > grown * share
        else:
            decided["neither"] += 1
    assert decided["proof"] >= 3
    assert decided["way out"] >= 3
    assert decided["neither"] <= 2


def test_moves_of_a_run_with_a_bound_are_safe_for_the_tick_they_are_made_in():
    run = replan(pressed(12.0), speed_bound=SPEED, **(OPTIONS | {"seconds": 1.5}))
    assert all(before.safe_seconds is not None for before, _ in pairwise(run.ticks))
    assert replan(pressed(12.0), **(OPTIONS | {"seconds": 0.3})).ticks[0].safe_seconds is None


def beside_goal(gap):
    """A box at rest beside the goal, which a feed shows, so that it may begin to move."""
    return plane(box("post", 19.0, 11.0 + gap, 2.0, 2.0), start=(13.0, 10.0))


def test_a_goal_is_entered_where_the_arm_is_safe_until_it_arrives():
    problem = beside_goal(0.6)  # It could be there in 0.12 s, and a way out has to be left for 0.5 s elsewhere.
    run = replan(problem, lambda t: problem.world.scene, speed_bound=SPEED, **(OPTIONS | {"seconds": 3.0}))
    assert run.found
    assert all(tick.safe_seconds >= TICK - 1e-9 for tick in run.ticks[:-1])


def test_a_run_that_waits_says_which_obstacle_it_waits_for_and_with_which_bound_it_would_go():
    problem = beside_goal(0.3)
    options = OPTIONS | {"seconds": 3.0}
    run = replan(problem, lambda t: problem.world.scene, speed_bound=SPEED, **options)
    assert run.outcome == "out of time"
    said = re.fullmatch(
        r"'post' could reach the arm at the goal within 0.5 s; "
        r"with a speed_bound of (\S+) m/s it would go there", run.reason,
    )  # fmt: skip
    bound = float(said[1])
    assert 0.0 < bound < 0.3 / 0.5  # The box at the goal, the time that is needed.
    assert replan(problem, lambda t: problem.world.scene, speed_bound=bound, **options).found


def test_a_way_that_leads_too_near_to_what_could_move_is_led_around_it():
    scenario = Scenario.load("replan_planar_arm")
    settings = replace(scenario.settings, speed_bound=3.8, repair_budget=30.0, seed=1, seconds=15.0)
    run = replan_with(settings, scenario.problem)
    assert run.found
    assert all(tick.safe_seconds >= settings.tick - 1e-9 for tick in run.ticks[:-1])
    assert not run.violations(scenario.problem)


@pytest.mark.parametrize("seed", range(4))
def test_a_path_close_to_what_stands_still_is_gone_along_beside_what_moves(seed):
    scenario = Scenario.load("replan_pockets")  # its path grazes the corner of an obstacle at rest
    run = scenario.run(seed=seed, repair_budget=1.0, speed_bound=1.0)
    assert run.found
    assert all(tick.safe_seconds > 0.0 for tick in run.ticks[:-1])


def test_the_base_too_is_safe_for_as_long_as_a_run_says():
    post = Obstacle("post", Box([0.05, 0.05, 0.05]), [0.12, 0.0, -0.12])
    problem = Problem(World(load_robot("ur5"), Scene([post])), [0.0, -1.57, *4 * [0.0]], [1.0, -1.57, *4 * [0.0]])
    distance = float(problem.world.distances(problem.start, [("base_link", "post")]).values[0])
    speed = 0.5
    run = replan(problem, lambda t: problem.world.scene, speed_bound=speed, step=0.05, rate=20.0, seconds=0.1)
    for tick in run.ticks:
        assert 0.05 <= tick.safe_seconds < distance / speed
