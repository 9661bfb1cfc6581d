"""A whole task as one timed motion: through every motion in its order, with rests, within all limits."""

import json
from itertools import pairwise

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl import Gripper, MoveTo, Straight, Task
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.app import run


@pytest.fixture(scope="module")
def served():
    loaded = rrtik.Task.load("panda_serve")
    return loaded.plan(seed=2)


@pytest.mark.kernels
def test_every_motion_begins_where_and_when_it_is_said_and_limits_are_kept(served):
    timed = served.time_parameterize(pause=0.5)
    motion, limits = timed.trajectory, rrtik.RateLimits.of(served.worlds[0].robot)
    assert len(timed.begins) == len(served.paths)
    for begin, path in zip(timed.begins, served.paths, strict=True):
        assert np.abs(motion(begin).positions - path.start).max() < 1e-8
        assert np.abs(motion(begin).velocities).max() < 1e-8
    assert np.abs(motion(motion.duration).positions - served.paths[-1].end).max() < 1e-8
    peaks = motion.peaks()
    for name in ("velocity", "acceleration", "jerk"):
        assert (getattr(peaks, name) <= getattr(limits, name) * (1.0 + 1e-9)).all()


@pytest.mark.kernels
def test_the_arm_rests_where_the_cup_is_taken_and_put_down(served):
    timed = served.time_parameterize(pause=0.5)
    assert np.diff(timed.pauses, axis=1) == pytest.approx(0.5)
    assert timed.pauses[:, 1] == pytest.approx(timed.begins[[2, 5]])  # the lift, and the retreat
    for first, last in timed.pauses:
        rows = timed.trajectory(np.linspace(first, last, 11)).positions
        assert np.abs(rows - rows[0]).max() < 1e-9
    # A rest is never shorter than the fingers take at the limit of their velocity.
    without = served.time_parameterize(pause=0.0)
    fingers = np.abs(np.diff([event.positions[0] for event in without.trajectory.gripper])) / 0.2
    assert np.diff(without.pauses, axis=1).ravel() == pytest.approx(fingers)
    assert timed.trajectory.duration == pytest.approx(without.trajectory.duration + 1.0 - fingers.sum())


@pytest.mark.kernels
def test_the_gripper_is_told_what_the_worlds_of_the_motions_have(served):
    timed = served.time_parameterize(pause=0.5)
    motion, (taken, let_go) = timed.trajectory, timed.pauses
    assert [event.time for event in motion.gripper] == pytest.approx([0.0, taken[0], let_go[0]])
    assert [event.width for event in motion.gripper] == pytest.approx([0.08, 0.05, 0.08])
    # While the arm moves, the fingers are where the world of the motion holds them, in which it is proven.
    ends = [*timed.begins[1:], motion.duration]
    for world, begin, end in zip(served.worlds, timed.begins, ends, strict=True):
        rests = [pause[0] for pause in timed.pauses if begin < pause[0] < end]
        clock = np.linspace(begin, min([end, *rests]), 20)
        held = world.robot.source["locked"]["panda_finger_joint1"]
        assert motion.gripper_positions(clock) == pytest.approx(held)


@pytest.mark.kernels
def test_what_the_fingers_do_last_is_waited_for():
    """A task that ends with an open gripper is over when it is open."""
    robot = rrtik.load_robot("so101", locked={"gripper": 0.0})
    plan = Task([MoveTo([0.3, 0.0, 0.0, 0.0, 0.0]), Gripper("open")]).plan(rrtik.World(robot), np.zeros(5), seed=1)
    timed = plan.time_parameterize(pause=0.0)
    first, last = timed.trajectory.gripper
    assert (first.positions, last.positions) == ((0.0,), robot.gripper.opened)
    assert timed.pauses[0] == pytest.approx([last.time, timed.trajectory.duration])
    assert timed.trajectory.gripper_positions([timed.trajectory.duration]) == pytest.approx(robot.gripper.opened[0])
    rows = timed.trajectory(np.linspace(*timed.pauses[0], 5))
    assert rows.positions == pytest.approx(np.tile(plan.paths[-1].end, (5, 1)))
    played = plan.played()
    assert played.rests[-1] == 1.0


@pytest.mark.kernels
def test_between_waypoints_each_motion_is_free_in_its_own_world_and_the_cup_upright(served):
    timed = served.time_parameterize()
    ends = [*timed.begins[1:], timed.trajectory.duration]
    for number, (begin, end) in enumerate(zip(timed.begins, ends, strict=True)):
        rows = timed.trajectory(np.arange(begin, end, 0.01)).positions
        assert served.worlds[number].valid_batch(rows).all()
    held = served.worlds[3].scene.attached[0]
    rows = timed.trajectory(np.linspace(timed.begins[3], timed.begins[4], 300)).positions
    axes = served.worlds[3].robot.fk_batch(rows, held.link)[:, :3, :3] @ held.pose.rotation[:, 2]
    assert np.degrees(np.arccos(np.clip(axes @ axes[0], -1.0, 1.0))).max() <= 5.2


@pytest.mark.kernels
def test_goals_one_after_the_other_are_one_motion(titan):
    """A list of goals to be reached in order is a task of as many stages."""
    world = rrtik.World(titan)
    goals = [titan.fk(np.radians(row)) for row in ([20, 30, -70, 20, 30, 40], [-20, 40, -90, 30, 0, 0])]
    plan = Task([*map(MoveTo, goals), MoveTo("ready")]).plan(world, "ready", seed=1)
    timed = plan.time_parameterize()
    assert timed.pauses.size == 0
    for goal, begin in zip(goals, timed.begins[1:], strict=True):
        away = goal.actInv(titan.fk(timed.trajectory(begin).positions))
        assert np.linalg.norm(away.translation) <= 1e-3
    assert all(a < b for a, b in pairwise(timed.begins))


@pytest.mark.kernels
def test_a_motion_of_no_length_takes_no_time_and_none_at_all_is_refused(titan):
    world = rrtik.World(titan)
    here = titan.fk(titan.posture("ready"))
    plan = Task([Straight(to=here), MoveTo("zero")]).plan(world, "ready", seed=1)
    assert plan.time_parameterize().begins.tolist() == [0.0, 0.0]
    still = Task([Straight(to=here)]).plan(world, "ready", seed=1)
    with pytest.raises(InputError, match="no motion"):
        still.time_parameterize()
    for wrong in ({"pause": -1.0}, {"pause": "long"}, {"blend": -1.0}):
        with pytest.raises(InputError) as caught:
            plan.time_parameterize(**wrong)
        assert "\n" not in str(caught.value)


@pytest.mark.kernels
def test_the_command_writes_what_the_gripper_is_told_beside_a_message(tmp_path, capsys):
    file = tmp_path / "task.ros.json"
    assert run(["task", "panda_serve", "--seed", "2", "--trajectory", str(file), "--pause", "0.5"]) == 0
    beside = tmp_path / "task.gripper.json"
    assert str(beside) in capsys.readouterr().out
    assert len(rrtik.Trajectory.load(file, gripper=beside).gripper) == 3


@pytest.mark.kernels
def test_the_command_saves_a_trajectory(tmp_path, capsys):
    file = tmp_path / "task.json"
    assert run(["task", "titan4_drawer", "--seed", "1", "--trajectory", str(file), "--pause", "0.5", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    motion = rrtik.Trajectory.load(file)
    assert said["duration"] == pytest.approx(motion.duration)
    assert run(["task", "titan4_drawer", "--trajectory", str(tmp_path / "task.docx")]) == 2
    assert ".json" in capsys.readouterr().err
