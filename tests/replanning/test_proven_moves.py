"""Moves among obstacles that move are proven, from where these are at the moment."""

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, PointCloud, Prism, Sphere
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.travels import MotionTracker
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import OPTIONS, crossing, plane

SOLIDS = (
    Box([0.12, 0.08, 0.1]),
    Sphere(0.06),
    Cylinder(0.04, 0.2),
    Capsule(0.03, 0.15),
    Prism([(0, 0), (0.2, 0), (0.2, 0.05), (0.05, 0.05), (0.05, 0.2), (0, 0.2)], 0.1),
    HalfSpace([0.1, 0.2, 1.0], -0.5),
)


def scene(seed):
    rng, found = np.random.default_rng(seed), []
    for k, solid in enumerate(SOLIDS):
        way = rng.normal(size=3)
        here = rng.uniform(0.4, 0.9) * way / np.linalg.norm(way)
        here = np.array([0.0, 0.0, rng.uniform(-0.1, 0.1)]) if isinstance(solid, HalfSpace) else here
        turn = pin.exp3(rng.normal(size=3) * (0.1 if isinstance(solid, HalfSpace) else 1.0))
        found.append(Obstacle(f"o{k}", solid, pin.SE3(turn, here), margin=rng.uniform(0.0, 0.02)))
    return Scene(found)


def motions(robot, count):
    rng = np.random.default_rng(1)
    A = rng.uniform(*robot.finite_range(), (count, robot.dof))
    return A, np.clip(A + rng.normal(0.0, 0.15, A.shape), robot.lower, robot.upper)


@pytest.mark.parametrize("copies", [1, 3])
def test_obstacles_moved_in_the_table_are_where_a_new_world_has_them(copies):
    robot = load_robot("panda")
    A, B = motions(robot, 400)
    moving = MovingWorld(World(robot, scene(1)), copies=copies)
    for seed in (2, 3, 1, 4):
        moving.move(scene(seed), scene(seed + 9), inflation={f"o{k}": 0.01 * k for k in range(6)})
        wider = [
            Obstacle(o.name, o.shape, o.pose, margin=o.margin + 0.01 * k) for k, o in enumerate(scene(seed).obstacles)
        ]
        fresh = World(robot, Scene(wider))
        proven = moving.motions_proven(A, B)
        assert 0.05 < proven.mean() < 0.95
        assert (proven == fresh.motions_proven(A, B)).mean() > 0.995  # boxes along other axes at most
        assert not (proven & ~fresh.motion_valid_batch(A, B)).any()
        less = moving.motions_proven(A, B, less=0.005)
        assert (proven <= less).all()
        assert less.sum() > proven.sum()
    assert moving._prover.tables.packed.table.intact()


def test_nothing_is_proven_while_an_obstacle_overlaps_the_base():
    robot = load_robot("panda")
    A, B = motions(robot, 50)
    ball = Obstacle("ball", Sphere(0.1), pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0])))
    moving = MovingWorld(World(robot, Scene([ball])))
    assert moving.motions_proven(A, B).any()
    moving.move(Scene([Obstacle("ball", Sphere(0.1), pin.SE3.Identity())]))
    assert moving.blocked
    assert not moving.motions_proven(A, B).any()
    moving.move(Scene([ball]))
    assert moving.motions_proven(A, B).any()


def test_a_thin_plate_between_two_steps_is_found():
    robot = load_robot("point2d", parameters={"radius": 0.01, "bounds": [[0, 1], [0, 1]]})
    plate = Obstacle("plate", Box([1e-4, 2.0, 1.0]), pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0])))
    moving = MovingWorld(World(robot, Scene([plate]), motion_resolution=0.1))
    a, b = np.array([[0.0, 0.5]]), np.array([[1.0, 0.5]])
    assert moving.motions_proven(a, b)[0]
    moving.move(Scene([Obstacle("plate", plate.shape, pin.SE3(np.eye(3), np.array([0.55, 0.0, 0.0])))]))
    assert moving.motion_valid(a[0], b[0]), "the discrete check steps over it"
    assert not moving.motions_proven(a, b)[0]


@pytest.mark.parametrize("planner", ["drrt-con", "rrt-connect", "drrt"])
def test_a_run_says_which_moves_are_proven(planner, tmp_path):
    run = replan(crossing(), planner=planner, speed_bound=3.0, seed=1, record=tmp_path / "run.json", **OPTIONS)
    moves, proven = run.moves
    assert run.found
    assert moves == sum((a.q != b.q).any() for a, b in zip(run.ticks, run.ticks[1:], strict=False))
    assert proven >= 0.9 * moves
    assert f"{proven} of {moves} moves proven" in run.summary()
    assert (run.statistics["moves"], run.statistics["moves_proven"]) == (moves, proven)
    again = ReplanRun.load(tmp_path / "run.json")
    assert [tick.proven for tick in again.ticks] == [tick.proven for tick in run.ticks]


def test_proven_moves_keep_margin_and_clearance_from_where_obstacles_are_within_the_tick():
    problem, kept = crossing(), 0.3
    run = replan(problem, margin=0.1, clearance=kept, speed_bound=3.0, seed=2, **OPTIONS)
    assert run.found
    lift = problem.world.scene.obstacle("lift")
    half = 0.5 * np.asarray(lift.shape.size)[:2]
    checked = 0
    for tick, after in zip(run.ticks, run.ticks[1:], strict=False):
        if tick.proven:
            for share in np.linspace(0.0, 1.0, 11):
                there = lift.motion.pose_at(lift.pose, tick.time + share / run.rate).translation[:2]
                away = np.abs(tick.q + share * (after.q - tick.q) - there) - half
                assert np.linalg.norm(np.maximum(away, 0.0)) >= 0.1 + kept
                checked += 1
    assert checked > 100


def test_a_clearance_that_the_start_cannot_keep_is_refused():
    problem = plane(crossing().world.scene.obstacles[0], start=(9.0, 14.0))
    with pytest.raises(InputError, match=r"start: .*lower margin, clearance or speed_bound"):
        replan(problem, clearance=2.0, speed_bound=3.0, **OPTIONS)


@pytest.mark.parametrize("clearance", [-0.1, float("nan"), float("inf"), "wide"])
def test_a_clearance_that_makes_no_sense_is_refused(clearance):
    with pytest.raises(InputError, match="clearance"):
        replan(crossing(), clearance=clearance, **OPTIONS)


def test_a_cloud_that_has_grown_and_turns_is_as_fast_as_its_farthest_point():
    def seen(reach, angle):
        turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))
        return Scene([Obstacle("seen", PointCloud([[reach, 0.0, 0.0], [0.0, 0.1, 0.0]], 0.01), turned)])

    tracker = MotionTracker(None)
    for number, (reach, angle) in enumerate([(0.1, 0.0), (2.0, 0.0), (2.0, 0.3)]):
        tracker.update(Snapshot(0.1 * number, seen(reach, angle)))
    assert tracker.speeds["seen"] >= 2.0 * 0.3 / 0.1


def test_what_comes_back_in_another_shape_is_as_fast_as_its_farthest_point_now():
    def seen(length, angle):
        turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))
        return Scene([Obstacle("seen", Box([length, 0.1, 0.1]), turned)])

    tracker = MotionTracker(None)
    for number, scene in enumerate([seen(0.1, 0.0), Scene(), seen(4.0, 0.0), seen(4.0, 0.3)]):
        tracker.update(Snapshot(0.1 * number, scene))
    assert tracker.speeds["seen"] >= 2.0 * 0.3 / 0.1
