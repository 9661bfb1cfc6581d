"""Task files, plans in files, the commands and the page."""

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, UnknownNameError
from rrtik_ompl.cli.app import run
from rrtik_ompl.tasks.task_file import stage_data
from rrtik_ompl.viewer.task_story import run_of
from rrtik_tests.programs import needs_chromium

SMALL = """\
version: 1
robot: ur5
scene:
  obstacles:
    - {name: part, box: [0.05, 0.05, 0.05], pose: {xyz: [0.45, 0.11, 0.25]}}
  allowed_collisions: [[ee_link, part], [wrist_3_link, part]]
start: {joints: [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]}
task:
  - straight: {by: [0, 0, 0.05]}
  - attach: {object: part, link: ee_link, allow: [forearm_link], padding: 0.004}
  - alternatives:
      - - move_to: {position: [5.0, 0.0, 0.0]}
      - - move_to: {joints: [0.5, -1.6, 1.8, -0.2, 1.6, 0.0]}
        - straight: {by: [0, 0, 0.05], frame: tip}
  - detach: part
  - move_to: {posture: up}
"""


@pytest.fixture
def small(tmp_path):
    file = tmp_path / "small.yaml"
    file.write_text(SMALL)
    return file


@pytest.mark.kernels
@pytest.mark.parametrize("name", rrtik.list_tasks())
def test_every_shipped_task_has_a_plan_that_is_free_all_along(name):
    loaded = rrtik.Task.load(name)
    plan = loaded.plan(seed=1)
    assert plan.found, plan.reason
    for path, world in zip(plan.paths, plan.worlds, strict=True):
        assert path.proven
        assert path.violations(world) == ()


@pytest.mark.kernels
def test_the_drawers_tool_touches_nothing_on_its_way_out_of_half_a_millimetre_of_play():
    loaded = rrtik.Task.load("titan4_drawer")
    plan = loaded.plan(seed=1)
    world, path = plan.worlds[2], plan.paths[2]
    clearances = [world.clearance(q) for q in path.resample(0.01).waypoints]
    assert 2e-4 < min(clearances) < 5.1e-4


@pytest.mark.kernels
def test_a_plan_comes_back_from_its_file_as_it_was(small, tmp_path):
    loaded = rrtik.Task.load(small)
    plan = loaded.plan(seed=1)
    assert plan.found, plan.reason
    plan.save(tmp_path / "plan.json")
    again = rrtik.TaskPlan.load(tmp_path / "plan.json")
    assert again.chosen == plan.chosen == (1,)
    assert again.end.scene.names == plan.end.scene.names
    assert again.end.scene.attached == ()
    assert again.notes == plan.notes
    assert [stage_data(stage) for stage in again.stages] == [stage_data(stage) for stage in plan.stages]
    for one, other in zip(plan.paths, again.paths, strict=True):
        assert np.array_equal(one.waypoints, other.waypoints)
    for one, other, path in zip(plan.worlds, again.worlds, plan.paths, strict=True):
        assert one.scene.names == other.scene.names
        for a, b in zip(one.scene.attached, other.scene.attached, strict=True):
            assert (a.link, a.padding) == (b.link, b.padding) == ("ee_link", 0.004)
        assert path.violations(other) == ()


@pytest.mark.kernels
def test_a_saved_plan_is_shown_as_the_task_was(small, tmp_path, capsys):
    plan, made, shown = (tmp_path / name for name in ("plan.json", "made.html", "shown.html"))
    assert run(["task", str(small), "--seed", "1", "--out", str(plan), "--html", str(made)]) == 0
    assert run(["show", str(plan), "--html", str(shown)]) == 0
    stories = [re.search(r'id="story"[^>]*>(.*?)</script>', page.read_text(), re.S).group(1) for page in (made, shown)]
    one, other = (json.loads(story) for story in stories)
    assert other["title"] == "plan: 4 motions"
    assert {key for key in one if one[key] != other[key]} <= {"title", "plan"}
    capsys.readouterr()
    for more in (["path.json"], ["--scene", "scene.yaml"], ["--before", "path.json"]):
        assert run(["show", str(plan), *more]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "the plan of a task, which holds its paths and scenes" in said


@pytest.mark.slow
@pytest.mark.kernels
@needs_chromium
def test_a_saved_plan_is_filmed_with_all_its_motions(small, tmp_path):
    plan, film = tmp_path / "plan.json", tmp_path / "task.gif"
    assert run(["task", str(small), "--seed", "1", "--out", str(plan)]) == 0
    assert run(["show", str(plan), "--film", str(film), "--seconds", "0.5"]) == 0
    with Image.open(film) as moving:
        assert moving.n_frames == 7


@pytest.mark.kernels
def test_the_commands_write_what_they_say(small, tmp_path, capsys):
    out, html = tmp_path / "plan.json", tmp_path / "plan.html"
    assert run(["task", str(small), "--seed", "1", "--out", str(out), "--html", str(html)]) == 0
    said = capsys.readouterr().out
    assert "small: 4 motions, alternatives 2" in said
    assert "holds part" in said
    assert json.loads(out.read_text())["kind"] == "task_plan"
    story = html.read_text()
    assert "motion 2 of 4: carry part" in story
    assert "walk (" not in story
    assert run(["straight", "titan4_sdu", "--by", "0", "0", "0.02", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["found"], said["fraction"], said["proven"]) == (True, 1.0, True)
    assert run(["straight", "titan4_sdu", "--by", "1", "0", "0", "--out", str(tmp_path / "part.json")]) == 1
    said = capsys.readouterr().out
    assert "contact" in said or "limit" in said or "singular" in said
    assert len(rrtik.JointPath.load(tmp_path / "part.json").waypoints) > 1
    assert run(["list", "tasks"]) == 0
    assert "panda_pick_place" in capsys.readouterr().out


@pytest.mark.kernels
def test_the_page_carries_the_object_with_the_hand(small):
    loaded = rrtik.Task.load(small)
    plan = loaded.plan(seed=1)
    shown = run_of(plan.played())
    ticks = shown.ticks
    second = [tick for tick in ticks if tick.reason.startswith("motion 2")]
    robot, held = plan.worlds[1].robot, plan.worlds[1].scene.attached[0]
    for tick in second[:: len(second) // 4]:
        assert np.allclose(tick.poses["part"][:3], (robot.fk(tick.q, held.link) * held.pose).translation)
    still = [tick.poses["part"] for tick in ticks if tick.reason.startswith("motion 4")]
    assert np.allclose(still, still[0])
    farthest = rrtik.RateLimits.of(robot).velocity / shown.rate
    assert all((np.abs(b.q - a.q) <= farthest + 1e-6).all() for a, b in pairwise(ticks))


@pytest.mark.kernels
def test_the_page_plays_a_task_in_the_time_that_it_takes(small):
    loaded = rrtik.Task.load(small)
    plan = loaded.plan(seed=1)
    shown, timed = run_of(plan.played()), plan.time_parameterize()
    duration = timed.trajectory.duration
    assert shown.times[-1] == pytest.approx(duration, abs=2.0 / shown.rate)
    for tick in shown.ticks[:-1:20]:
        assert tick.q == pytest.approx(timed.trajectory(tick.time).positions, abs=1e-9)
        number = int(tick.reason.split()[1])
        assert timed.begins[number - 1] <= tick.time
    rest = timed.pauses[0]
    waiting = [tick.q for tick in shown.ticks if rest[0] < tick.time < rest[1]]
    assert len(waiting) > 5
    assert np.ptp(waiting, axis=0).max() < 1e-9


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("attach: {object: part,", "attach: {object: cup,", "no obstacle 'cup'"),
        ("detach: part", "detach: [part]", "detach"),
        (
            "  - straight: {by: [0, 0, 0.05]}\n",
            "  - detach: part\n",
            "small.yaml:9: task[0]: stage 1 (Detach 'part'): ",
        ),
        ("by: [0, 0, 0.05], frame: tip", "frame: tip", "needs exactly one of by, to"),
        ("by: [0, 0, 0.05], frame: tip", "by: [0, 0, 0], frame: tip", "leads nowhere"),
        ("posture: up", "posture: down", "posture"),
        ("  - detach: part\n", "  - drop: part\n", "a stage needs one of the keys"),
        ("position: [5.0", "place: [5.0", "goal needs one of the keys"),
        ("task:", "stages:", "stages"),
    ],
)
def test_a_bad_file_is_refused_with_file_and_line(small, capsys, old, new, words):
    small.write_text(SMALL.replace(old, new))
    assert run(["task", str(small)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_what_is_no_task_and_what_is_no_plan(tmp_path, small, capsys):
    with pytest.raises(UnknownNameError, match="no task 'panda_pick'"):
        rrtik.Task.load("panda_pick")
    problem = tmp_path / "problem.yaml"
    problem.write_text("version: 1\nrobot: ur5\nstart: {posture: up}\ngoal: {posture: up}\n")
    with pytest.raises(InputError, match="a problem, not a task"):
        rrtik.Task.load(problem)
    failed = rrtik.TaskPlan(False, (), (), (), (), "stage 1 failed")
    with pytest.raises(InputError, match="stage 1 failed"):
        failed.save(tmp_path / "plan.json")
    with pytest.raises(InputError, match="no motion"):
        failed.played()
    broken = tmp_path / "broken.json"
    broken.write_text('{"version": 1, "kind": "task_plan", "motions": []}')
    with pytest.raises(InputError, match=r"broken\.json"):
        rrtik.TaskPlan.load(broken)
    assert run(["task", "ur5_upright"]) == 2
    assert "'ur5_upright' is a problem, not a task" in capsys.readouterr().err
    for command in (["straight", "panda_pick_place", "--by", "0", "0", "0.1"], ["plan", "panda_pick_place"]):
        assert run(command) == 2
        assert "'panda_pick_place' is a task, not a problem" in capsys.readouterr().err
    assert run(["plan", str(small)]) == 2
    assert "a task, not a problem" in capsys.readouterr().err
    assert run(["straight", "titan4_sdu"]) == 2
    assert "only one of them" in capsys.readouterr().err


TOUR = """\
version: 1
robot: ur5
start: {joints: [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]}
goals:
  - {joints: [0.8, -1.6, 1.8, -0.2, 1.6, 0.0]}
  - {position: [0.3, 0.3, 0.4]}
  - {joints: [0.0, -1.6, 1.8, -0.2, 1.6, 0.0]}
path_constraints:
  - {upright: {axis: y, tolerance_deg: 20}}
"""


@pytest.mark.kernels
def test_goals_in_order_are_the_tour_that_python_plans(tmp_path, capsys):
    file = tmp_path / "tour.yaml"
    file.write_text(TOUR)
    loaded = rrtik.Task.load(file)
    plan = loaded.plan(seed=2)
    assert plan.found, plan.reason
    goals = [np.add(loaded.start, [0.8, 0, 0, 0, 0, 0]), rrtik.PositionGoal([0.3, 0.3, 0.4]), loaded.start]
    cup = rrtik.constraints.upright(loaded.world.robot, "y", tolerance_deg=20.0)
    tour = rrtik.Task([rrtik.MoveTo(goal) for goal in goals], constraints=[cup])
    assert np.array_equal(plan.path, tour.plan(loaded.world, loaded.start, seed=2).path)
    rrtik.Task(tour.stages, loaded.world, loaded.start, constraints=[cup]).save(tmp_path / "again.yaml")
    assert np.array_equal(plan.path, rrtik.Task.load(tmp_path / "again.yaml").plan(seed=2).path)
    plan.save(tmp_path / "plan.json")
    assert len(rrtik.TaskPlan.load(tmp_path / "plan.json").paths) == 3
    assert run(["task", str(file), "--seed", "2", "--trajectory", str(tmp_path / "tour.json")]) == 0
    assert "tour: 3 motions" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "goals:",
            "task: [{move_to: {posture: up}}]\ngoals:",
            "needs exactly one of task, goals; found task and goals",
        ),
        ("{position: [0.3", "{place: [0.3", "tour.yaml:6: goals"),
        ("joints: [0.8, ", "joints: [", r"tour.yaml:5: .*joints.*6 joints"),
        ("upright: {axis: y", "on_plane: {axis: y", "tour.yaml:9: path_constraints"),
        ("start: {joints: [0.0, -1.6, 1.8,", "start: {joints: [0.0, -1.6, 3.1,", "tour.yaml:3: start.*in collision"),
    ],
)
def test_a_bad_tour_is_refused_with_file_and_line(tmp_path, capsys, old, new, words):
    file = tmp_path / "tour.yaml"
    assert old in TOUR
    file.write_text(TOUR.replace(old, new))
    code = run(["task", str(file)])
    said = capsys.readouterr()
    assert code == 2
    assert re.search(words, said.err), said.err
    assert said.err.count("\n") == 1


def test_a_list_of_goals_is_no_problem_and_says_what_it_is(tmp_path, capsys):
    file = tmp_path / "tour.yaml"
    file.write_text(TOUR)
    assert run(["plan", str(file)]) == 2
    assert "a task, not a problem; use Task.load(file) or rrtik task tour.yaml" in capsys.readouterr().err
    file.write_text(TOUR.replace("goals:", "task:").replace("- {", "- move_to: {", 3))
    assert run(["task", str(file)]) == 2
    assert "path_constraints of a task stand beside its move_to stages" in capsys.readouterr().err
