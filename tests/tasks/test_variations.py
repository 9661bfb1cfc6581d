"""Instances of tasks: goals go along with what is taken and set down, draws stay in their ranges, bad files say why."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.demos import Displacement, Randomness
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.tasks.randomness import Draws

BENCH = """\
version: 1
robot: ur5
scene:
  obstacles:
    - {name: part, box: [0.05, 0.05, 0.05], pose: {xyz: [0.45, 0.11, 0.25]}}
    - {name: tray, box: [0.2, 0.2, 0.01], pose: {xyz: [0.45, -0.4, 0.2]}}
start: {joints: [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]}
task:
  - move_to: {position: [0.45, 0.11, 0.4]}
  - alternatives:
      - - straight: {by: [0, 0, -0.1]}
        - attach: {object: part, link: ee_link}
      - - straight: {to: {xyz: [0.45, 0.11, 0.3]}}
        - attach: {object: part, link: ee_link}
  - straight: {by: [0.02, 0, 0.1]}
  - move_to: {pose: {xyz: [0.45, -0.4, 0.4], rpy_deg: [180, 0, 0]}}
  - straight: {by: [0, 0.01, -0.1], frame: tip}
  - detach: part
  - straight: {by: [0.03, 0, 0.1]}
  - move_to: {task_region: {frame: {xyz: [0.3, 0.1, 0.5]}, x: [-0.1, 0.1]}}
  - move_to: {posture: up}
"""
RANDOM = """
random:
  objects:
    tray: {x: [-0.05, 0.05], yaw_deg: [-30, 30]}
    part: {x: [-0.1, 0.1], y: [-0.02, 0.02], yaw_deg: [-90, 90]}
  places:
    part: {x: [-0.01, 0.01], along_with: tray}
  start: {within_deg: 5}
  apart: [{pair: [part, tray], least: 0.45}]
"""


@pytest.fixture
def bench(tmp_path):
    file = tmp_path / "bench.yaml"
    file.write_text(BENCH + RANDOM)
    return rrtik.Task.load(file)


def turn(yaw, about, by):
    """A turn about the z axis through a point, and a shift."""
    R = pin.rpy.rpyToMatrix(0.0, 0.0, yaw)
    return pin.SE3(R, np.asarray(about) + by - R @ about)


def test_goals_go_along_with_what_is_taken_and_where_it_is_set_down(bench):
    taken = turn(0.5, [0.45, 0.11, 0.25], [0.1, 0.0, 0.02])
    placed = turn(-0.3, [0.45, -0.4, 0.2], [0.0, 0.1, 0.0])
    part = bench.world.scene.obstacle("part").pose
    new = bench.varied(rrtik.Variation({"part": taken * part}, {"part": placed}, "up"))
    old = bench.stages

    assert new.start == "up"
    assert new.world.scene.obstacle("part").pose.isApprox(taken * part)
    assert np.allclose(new.stages[0].goal.position, taken.act(np.array([0.45, 0.11, 0.4])))
    first, second = new.stages[1].options
    assert np.allclose(first[0].by, [0.0, 0.0, -0.1])
    assert second[0].to.isApprox(taken * old[1].options[1][0].to)
    assert np.allclose(new.stages[2].by, taken.rotation @ [0.02, 0.0, 0.1])  # after it was taken
    assert new.stages[3].goal.pose.isApprox(placed * old[3].goal.pose)
    assert np.allclose(new.stages[4].by, [0.0, 0.01, -0.1])  # along axes of the tip
    assert np.allclose(new.stages[6].by, placed.rotation @ [0.03, 0.0, 0.1])
    assert new.stages[7].goal is old[7].goal
    assert new.stages[8].goal == "up"


def test_goals_that_lead_to_nothing_are_moved_on_their_own(bench):
    aside = Displacement(x=(0.1, 0.1), yaw=(0.2, 0.2), about=[0.3, 0.1, 0.0])
    task = rrtik.Task(bench.stages, bench.world, bench.start, random=Randomness(goals=aside))
    drawn = Draws(task).draw(np.random.default_rng(0)).task
    motion = turn(0.2, [0.3, 0.1, 0.0], [0.1, 0.0, 0.0])
    assert drawn.stages[7].goal.T_world_w.isApprox(motion * bench.stages[7].goal.T_world_w)
    assert drawn.stages[8].goal == "up"
    assert drawn.stages[3].goal.pose.isApprox(bench.stages[3].goal.pose)
    assert np.allclose(drawn.stages[6].by, bench.stages[6].by)


def test_draws_stay_in_their_ranges_and_apart_and_the_same_seed_draws_the_same(bench):
    draws = Draws(bench)
    tray = bench.world.scene.obstacle("tray").pose
    rejected = 0
    for number in range(40):
        drawn = draws.draw(np.random.default_rng(number))
        poses = drawn.poses
        aside = poses["part"].translation - [0.45, 0.11, 0.25]
        assert (np.abs(aside) <= [0.1, 0.02, 1e-12]).all()
        assert np.linalg.norm(poses["part"].translation - poses["tray"].translation) >= 0.45
        assert np.abs(drawn.task.start - bench.start).max() <= np.radians(5.0) + 1e-12

        # Where the part is set down goes along with the tray, up to 1 cm along x.
        goals = [each.stages[3].goal.pose for each in (bench, drawn.task)]
        left = (poses["tray"] * tray.inverse()).inverse() * goals[1] * goals[0].inverse()
        assert np.allclose(left.rotation, np.eye(3))
        assert (np.abs(left.translation) <= [0.01, 1e-12, 1e-12]).all()

        again = draws.draw(np.random.default_rng(number))
        assert all(again.poses[name].isApprox(pose, 0.0) for name, pose in poses.items())
        rejected += sum(drawn.rejected.values())
    assert rejected > 0


@pytest.mark.kernels
def test_draws_take_over_the_worlds_of_earlier_ones(bench, monkeypatch):
    made = []
    pack = FastWorld.__init__
    monkeypatch.setattr(FastWorld, "__init__", lambda *args, **options: [made.append(1), pack(*args, **options)][-1])
    draws = Draws(bench)
    counts = []
    for number in range(6):
        assert draws.draw(np.random.default_rng(number)).task is not None
        counts.append(len(made))
    assert 0 < counts[1] == counts[-1]


def test_a_draw_in_which_things_overlap_is_drawn_anew():
    boxes = [rrtik.Obstacle(name, rrtik.Box(0.1, 0.1, 0.1), [x, 0.5, 0.0]) for name, x in (("a", 0.5), ("b", 0.7))]
    world = rrtik.World(rrtik.load_robot("ur5"), rrtik.Scene(boxes))
    stages = [rrtik.MoveTo("up")]
    near = rrtik.Task(stages, world, "up", random=Randomness({"a": Displacement(x=(0.0, 0.2))}))
    drawn = [Draws(near).draw(np.random.default_rng(k)) for k in range(20)]
    assert {reason for each in drawn for reason in each.rejected} == {"'a' overlaps 'b'"}
    assert all(abs(each.poses["a"].translation[0] - 0.7) >= 0.1 for each in drawn)

    inside = rrtik.Task(stages, world, "up", random=Randomness({"a": Displacement(x=(0.2, 0.2))}))
    none = Draws(inside).draw(np.random.default_rng(0))
    assert none.task is None
    assert none.reason == "none of 100 draws was usable; 100 times: 'a' overlaps 'b'"


def test_what_is_random_is_written_and_read(bench, tmp_path):
    bench.save(tmp_path / "again.yaml")
    again = rrtik.Task.load(tmp_path / "again.yaml")
    for number in range(3):
        one, other = (Draws(each).draw(np.random.default_rng(number)) for each in (bench, again))
        for name, pose in one.poses.items():
            assert pose.isApprox(other.poses[name], 1e-12)
        assert np.allclose(one.task.start, other.task.start)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("part: {x: [-0.1", "party: {x: [-0.1", "random: no obstacle 'party'; did you mean 'part'?"),
        ("x: [-0.1, 0.1]", "x: [0.1, -0.1]", "displacement: x: the lowest value comes first, got [0.1, -0.1]"),
        ("x: [-0.1, 0.1]", "x: 0.1", "must be a list in square brackets, found 0.1"),
        ("yaw_deg: [-90, 90]", "yaw: [-1, 1]", "unknown key 'yaw'; did you mean 'yaw_deg'?"),
        ("along_with: tray", "along_with: bowl", "random: along_with: no obstacle that is displaced"),
        ("along_with: tray", "yaw_deg: [0, 9]", "places: 'part': is turned; say about which point, about: [x, y, z]"),
        ("  places:\n    part", "  places:\n    tray", "no object that the task detaches 'tray'"),
        ("within_deg: 5", "joints: [[0, 1]]", "random: start: joints"),
        ("within_deg: 5", "joints_deg: [[0, 900], [0, 1], [0, 1], [0, 1], [0, 1], [0, 1]]", "outside its limits"),
        ("within_deg: 5", "within: 1, joints: [[0, 1]]", "a random start needs exactly one of"),
        ("least: 0.45", "least: -1", "must be 0 or more"),
    ],
)
def test_bad_files_get_a_line_that_names_the_place(tmp_path, old, new, said):
    text = BENCH + RANDOM
    assert old in text
    (tmp_path / "bad.yaml").write_text(text.replace(old, new))
    with pytest.raises(InputError) as error:
        rrtik.Task.load(tmp_path / "bad.yaml")
    assert said in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "bad.yaml"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"poses": {"none": [0.0, 0.0, 0.0]}}, "no obstacle 'none'"),
        ({"places": {"tray": [0.0, 0.0, 0.0]}}, "no object that is set down 'tray'"),
        ({"poses": {"part": [0.0, np.nan, 0.0]}}, "'part'"),
        ({"poses": [1.0]}, "use {name: pose}"),
    ],
)
def test_bad_variations_get_a_line(bench, given, said):
    with pytest.raises(InputError, match=said.replace("{", r"\{")):
        bench.varied(rrtik.Variation(**given))


def test_a_task_without_anything_random_says_so():
    with pytest.raises(InputError, match="give its file a section random:"):
        Draws(rrtik.Task.load("titan4_drawer"))
