"""The judge of runs finds what touches in a record, whoever made it, and takes nobody's word for it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from bench.truth.shape_kinds import kinds
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.app import run as rrtik
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.model.scene import ConstantVelocity, Obstacle, Scene, TimedPoses, Touching
from rrtik_ompl.model.shapes import Box, HalfSpace, PointCloud
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.replanning import record
from rrtik_ompl.replanning.feed import Snapshot
from rrtik_ompl.replanning.record import ReplanRun
from rrtik_ompl.replanning.replanner import replan
from rrtik_ompl.replanning.scenario import Scenario
from rrtik_ompl.replanning.tick import Tick
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.moving_plane import OPTIONS, crossing
from rrtik_tests.run_judge import judged

SHAPES = {name: make(np.random.default_rng(0), 0.5) for name, make in kinds().items()}
RATE = 10.0


def arm():
    return load_robot("planar3")


def along(x, y, z=0.0):
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def by_hand(robot, rows, scenes, *, proven=None, margin=0.0, clearance=None):
    """A record that nobody has checked."""
    run = ReplanRun("by hand", robot.name, robot.joint_names, "none", 0, 1.0, RATE, margin, None, clearance=clearance)
    for k, q in enumerate(rows):
        event = "walk" if k + 1 < len(rows) else "arrive"
        run.ticks.append(Tick(k / RATE, np.asarray(q, dtype=float), event, None, {}, {}, 0, "", proven))
    for seen in scenes:
        run.see(seen)
    run.outcome = "arrived"
    return run


def swing(robot, count=13):
    """The stretched arm turns across the x axis."""
    turn = np.linspace(-0.7, 0.7, count)
    return np.stack([turn, np.zeros(count), np.zeros(count)], axis=1)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("moves", [False, True])
def test_an_arm_that_sweeps_through_any_shape_is_seen(name, moves, tmp_path):
    robot = arm()
    reach = 0.8 * float(robot.fk([0.0, 0.0, 0.0]).translation[0])
    here = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([reach, 0.0, -0.05]))
    if isinstance(SHAPES[name], HalfSpace):
        here = pin.SE3(pin.exp3(np.array([0.0, 0.5 * np.pi, 0.0])), np.array([0.9 * reach, 0.0, 0.0]))
        here.rotation = here.rotation @ pin.exp3(np.array([0.0, np.pi, 0.0]))  # all beyond it is solid
    away = pin.SE3(here.rotation, here.translation + np.array([9.0, 0.0, 0.0]))
    motion = TimedPoses([0.0, 0.1, 0.9, 1.2], [away, here, here, away]) if moves else None
    scene = Scene([Obstacle(name, SHAPES[name], away if moves else here, motion)])
    problem = Problem(World(robot, Scene()), [-0.7, 0, 0], [0.7, 0, 0])
    run = by_hand(robot, swing(robot), [Snapshot(0.0, scene, stated=True)], proven=True)
    found = run.violations(problem)
    assert any(each.touches and each.second == name for each in found)
    assert all(each.proven for each in found)

    run.save(tmp_path / "run.json")
    again = ReplanRun.load(tmp_path / "run.json").violations(problem)
    assert [(each.tick, each.first) for each in again] == [(each.tick, each.first) for each in found]
    assert [each.distance for each in again] == pytest.approx([each.distance for each in found], abs=1e-5)

    aside = Scene([replace(scene.obstacles[0], pose=away, motion=None)])
    assert by_hand(robot, swing(robot), [Snapshot(0.0, aside, stated=True)], proven=True).violations(problem) == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_the_judge_agrees_with_new_worlds_at_each_time(seed):
    rng = np.random.default_rng(seed)
    robot = arm()
    reach = float(robot.fk([0.0, 0.0, 0.0]).translation[0])
    some = rng.choice([name for name, shape in SHAPES.items() if shape.bounded], 5, replace=False)
    obstacles = []
    for name in some:
        places = [along(*(rng.uniform(0.3, 1.0) * reach * np.array([np.cos(a), np.sin(a)])), -0.1) for a in
                  rng.uniform(-2.0, 2.0, 3)]  # fmt: skip
        obstacles.append(Obstacle(str(name), SHAPES[name], places[0], TimedPoses([0.0, 0.7, 1.4], places)))
    scene = Scene(obstacles)
    rows = np.cumsum(rng.normal(0.0, 0.12, (13, 3)), axis=0)
    run = by_hand(robot, rows, [Snapshot(0.0, scene, stated=True)])
    problem = Problem(World(robot, Scene()), [0.1, 0.2, 0.3], [0.3, 0.2, 0.3])
    told = {each.tick for each in run.violations(problem) if each.touches}
    seen = set()
    for k in range(12):
        for share in np.linspace(0.0, 1.0, 5):
            world = World(robot, scene.at((k + share) / RATE))
            if not world.valid(rows[k] + share * (rows[k + 1] - rows[k])):
                seen.add(k)
    assert seen <= told
    assert len(told - seen) <= 1  # a graze between two of these looks
    assert 0 < len(told) < 13


def test_a_plate_that_flies_past_between_two_ticks_is_seen():
    robot = arm()
    bullet = Obstacle("bullet", Box([1e-3, 0.1, 0.1]), along(0.5, -3.0), ConstantVelocity([0.0, 100.0, 0.0]))
    run = by_hand(robot, [[0, 0, 0]] * 3, [Snapshot(0.0, Scene([bullet]), stated=True)])
    found = run.violations(Problem(World(robot), [0, 0, 0], [1, 0, 0]))
    assert {each.tick for each in found} == {0}
    assert found[0].time == pytest.approx(0.03, abs=0.002)


def test_what_is_called_proven_has_to_keep_margin_and_clearance_and_the_rest_must_not_touch():
    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[-2, 2], [-2, 2]]})
    scene = Scene([Obstacle("wall", Box([0.2, 4.0, 1.0]), along(1.0, 0.0), margin=0.05)])
    rows, seen = [[0.0, 0.0], [0.75, 0.0], [0.0, 0.0]], [Snapshot(0.0, scene, stated=True)]
    problem = Problem(World(robot, Scene()), [0, 0], [0, 1])
    nearest = 0.9 - 0.75 - 0.1
    for margin, clearance, kept in ((0.0, None, 0.05), (0.02, None, 0.07), (0.02, 0.01, 0.08)):
        run = by_hand(robot, rows, seen, proven=True, margin=margin, clearance=clearance)
        found = run.violations(problem)
        assert [each.required_distance for each in found] == pytest.approx([kept] * len(found))
        assert bool(found) == (nearest < kept - 1e-5)
        assert not any(each.touches for each in found)
        assert by_hand(robot, rows, seen, proven=False, margin=margin).violations(problem) == ()
    assert "are 50 mm apart, less than 80 mm" in str(found[0])


def test_pairs_may_touch_only_while_a_scene_allows_it():
    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[-2, 2], [-2, 2]]})
    wall = Obstacle("wall", Box([0.2, 4.0, 1.0]), along(1.0, 0.0))
    link = robot.link_names[-1]
    seen = [Snapshot(0.0, Scene([wall], allowed_collisions=[(link, "wall")])), Snapshot(0.3, Scene([wall]))]
    run = by_hand(robot, [[1.0, 0.0]] * 6, seen)
    found = run.violations(Problem(World(robot), [0, 0], [0, 1]))
    assert [each.tick for each in found] == [3, 4, 5]  # the last of them has no motion


def test_between_two_sightings_obstacles_go_straight():
    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[-2, 2], [-2, 2]]})
    at = {t: Scene([Obstacle("box", Box([0.2, 0.2, 1.0]), along(0.0, y))]) for t, y in ((0.0, -1.0), (1.0, 1.0))}
    run = by_hand(robot, [[0.0, 0.0]] * 11, [Snapshot(time, scene) for time, scene in at.items()])
    found = run.violations(Problem(World(robot), [0, 0], [0, 1]))
    assert {each.tick for each in found} == {4, 5}
    assert min(each.distance for each in found) == pytest.approx(-0.2, abs=2e-3)


def test_a_record_of_before_is_judged_by_the_poses_of_its_ticks():
    problem = crossing()
    run = replan(problem, seed=1, **OPTIONS, speed_bound=3.0)
    run.scenes.clear()
    assert run.violations(problem) == ()
    through = np.linspace(problem.start, problem.goal.q, len(run.ticks))
    run.ticks[:] = [replace(tick, q=q) for tick, q in zip(run.ticks, through, strict=True)]
    assert {each.second for each in run.violations(problem)} == {"lift"}


def test_a_cloud_that_is_seen_anew_is_judged_as_it_was_then_and_too_many_points_are_not_kept(monkeypatch, tmp_path):
    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[-2, 2], [-2, 2]]})

    def seen(time):
        return Scene([Obstacle("cloud", PointCloud([[0.0, 1.0 - time, 0.0], [0.0, 2.0, 0.0]], 0.05))])

    run = by_hand(robot, [[0.0, 0.0]] * 11, [Snapshot(k / RATE, seen(k / RATE)) for k in range(11)])
    problem = Problem(World(robot), [0, 0], [0, 1])
    run.save(tmp_path / "run.json")
    for each in (run, ReplanRun.load(tmp_path / "run.json")):
        assert {each.tick for each in each.violations(problem)} == {9, 10}
    monkeypatch.setattr(record, "MOST_POINTS", 10)
    short = by_hand(robot, [[0.0, 0.0]] * 11, [Snapshot(k / RATE, seen(k / RATE)) for k in range(11)])
    short.save(tmp_path / "short.json")
    for each in (short, ReplanRun.load(tmp_path / "short.json")):
        with pytest.raises(InputError, match=r"too large.*0\.5 s"):
            each.violations(problem)
        assert {each.tick for each in each.violations(problem, seen)} == {8, 9, 10}  # straight on between two looks


def test_a_run_of_another_robot_is_not_judged():
    run = by_hand(arm(), [[0, 0, 0]], [])
    with pytest.raises(InputError, match="other joints"):
        run.violations(crossing())


def test_the_command_judges_a_record(tmp_path, capsys):
    file = tmp_path / "run.json"
    scenario = Scenario.load("replan_planar_arm")
    scenario.run(seed=1, repair_budget=30.0, record=file)
    assert rrtik(["check", "replan_planar_arm", str(file)]) == 0
    assert "nothing touches" in capsys.readouterr().out

    document = json.loads(file.read_text())
    goal = load_problem("replan_planar_arm").goal.q
    first = np.array(document["ticks"][0]["q"])
    for k, tick in enumerate(document["ticks"]):
        tick["q"] = (first + (k + 1) / len(document["ticks"]) * (goal - first)).tolist()
    file.write_text(json.dumps(document))
    assert rrtik(["check", "replan_planar_arm", str(file)]) == 1
    said = capsys.readouterr().out
    assert "tick " in said
    assert "overlap by" in said
    assert "mm" in said
    assert "ticks touch something" in said


def test_the_command_refuses_a_record_of_another_robot_in_one_line(tmp_path, capsys):
    Scenario.load("replan_walls").run(seconds=0.3, record=tmp_path / "run.json")
    assert rrtik(["check", "titan4_prisms", str(tmp_path / "run.json")]) == 2
    said = capsys.readouterr().err
    assert "run.json: " in said
    assert said.count("\n") == 1


def test_the_record_holds_what_was_seen(tmp_path):
    problem = crossing()
    scene = problem.world.scene
    run = judged(replan(problem, scene.at, seed=1, **OPTIONS, speed_bound=3.0), problem)
    run.save(tmp_path / "run.json")
    again = ReplanRun.load(tmp_path / "run.json")
    assert [seen.time for seen in again.scenes] == [seen.time for seen in run.scenes]
    for one, other in zip(run.scenes, again.scenes, strict=True):
        pair = one.scene.obstacle("lift"), other.scene.obstacle("lift")
        assert pair[0].pose.homogeneous == pytest.approx(pair[1].pose.homogeneous)
    assert again.clearance == run.clearance


def test_a_contact_that_the_scene_names_may_go_as_deep_as_it_says_and_no_deeper(tmp_path):
    robot = load_robot("point2d", parameters={"radius": 0.1, "bounds": [[-2, 2], [-2, 2]]})
    wall = Obstacle("wall", Box([0.2, 4.0, 1.0]), along(1.0, 0.0))
    scene = Scene((wall,), contacts=(Touching(robot.link_names[-1], "wall", -0.01),))
    problem = Problem(World(robot), [0, 0], [0, 1])
    for deep, wrong in ((0.008, False), (0.012, True)):
        run = by_hand(robot, [[0.8 + deep, 0.0]] * 3, [Snapshot(0.0, scene, stated=True)], proven=True, margin=0.02)
        run.save(tmp_path / "run.json")
        for each in (run, ReplanRun.load(tmp_path / "run.json")):
            assert bool(each.violations(problem)) == wrong
