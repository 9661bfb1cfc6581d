"""The command line as a person uses it: what is printed, what is written, the exit codes, Ctrl-C."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest

from rrtik_ompl.cli.app import run
from rrtik_ompl.model.path import JointPath
from rrtik_tests.command_line import rrtik


def test_plan_prints_the_moves_and_saves_a_path_that_check_accepts(capsys, tmp_path):
    file = tmp_path / "path.json"
    code, out, err = rrtik(capsys, "plan", "titan4_sdu", "--seed", "1", "--out", str(file))
    assert (code, err) == (0, "")
    path = JointPath.load(file)
    assert f"{path.transitions} moves (no path can have fewer than 5)" in out
    rows = [line for line in out.splitlines() if line.rstrip().endswith(" deg")]
    assert len(rows) == path.transitions
    code, out, _ = rrtik(capsys, "check", "titan4_sdu", str(file))
    assert code == 0
    assert "valid, proven free at every configuration" in out


def test_check_names_a_motion_that_is_not_proven(capsys, tmp_path):
    scene = "{obstacles: [{name: wall, box: [30, 1, 4], pose: {xyz: [13, 10, 0]}}]}"
    robot = "{point2d: {radius: 0.5, bounds: [[0, 26], [0, 20]]}}"
    ends = "start: {joints: [2, 5]}\ngoal: {joints: [20, 5]}"
    (tmp_path / "wall.yaml").write_text(f"version: 1\nrobot: {robot}\nscene: {scene}\n{ends}\n")
    (tmp_path / "graze.csv").write_text("x,y\n2,5\n2,8.999999995\n20,5\n")  # nearer than rounding allows
    code, out, _ = rrtik(capsys, "check", str(tmp_path / "wall.yaml"), str(tmp_path / "graze.csv"))
    assert code == 0
    assert "0 of 2 motions proven free, the others checked every 5 mm, first motion 1" in out
    assert "'wall'" in out


def test_json_says_whether_a_path_is_proven(capsys):
    assert json.loads(rrtik(capsys, "plan", "titan4_prisms", "--seed", "1", "--json")[1])["proven"] is True


def test_the_same_seed_prints_the_same_moves(capsys):
    one, two, other = (
        json.loads(rrtik(capsys, "plan", "titan4_sdu", "--seed", s, "--json")[1])["waypoints"] for s in "778"
    )
    assert one == two
    assert one != other


def test_json_is_one_object_with_everything(capsys):
    code, out, _ = rrtik(capsys, "plan", "planar3_a", "--planner", "bicrdt", "--seed", "1", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["found"] is True
    assert found["lower_bound"] == 1
    assert found["transitions"] == len(found["moves"]) == len(found["waypoints"]) - 1
    assert found["seconds"]["plan"] > 0


def test_a_planner_that_moves_all_joints_prints_waypoints(capsys):
    code, out, _ = rrtik(capsys, "plan", "titan4_sdu", "--planner", "RRTConnect", "--seed", "1")
    assert code == 0
    assert "several joints move at once" in out
    assert "[deg]" in out


def test_options_of_the_planner_are_passed_on(capsys):
    asked = ("plan", "titan4_sdu", "--planner", "RRTConnect", "--seed", "1", "--parameter")
    code, _, err = rrtik(capsys, *asked, "rang=0.5")
    assert code == 2
    assert "did you mean 'range'" in err
    assert rrtik(capsys, *asked, "range=0.5")[0] == 0


def test_not_found_is_exit_1_with_the_reason_and_no_file(capsys, tmp_path):
    file = tmp_path / "path.json"
    code, out, err = rrtik(capsys, "plan", "titan4_sdu", "--seconds", "0.000001", "--out", str(file))
    assert (code, out) == (1, "")
    assert "not found: no path within 1e-06 s" in err
    assert not file.exists()


def test_check_rejects_a_path_through_the_panel(capsys, tmp_path):
    from rrtik_ompl import JointPath, load_problem

    problem = load_problem("titan4_sdu")
    file = tmp_path / "straight.json"
    JointPath.of(problem.world.robot, [problem.start, problem.goal.q]).save(file)
    code, out, _ = rrtik(capsys, "check", "titan4_sdu", str(file))
    assert code == 1
    assert "overlap" in out


def test_check_rejects_a_path_of_another_problem(capsys, tmp_path):
    file = tmp_path / "path.json"
    assert rrtik(capsys, "plan", "titan4_prisms", "--seed", "1", "--out", str(file))[0] == 0
    code, out, _ = rrtik(capsys, "check", "titan4_sdu", str(file))
    assert code == 1
    assert "does not begin at the start" in out


@pytest.mark.parametrize("ending", [".json", ".csv", ".txt"])
def test_a_path_in_place_of_a_problem_is_told_what_is_missing(capsys, tmp_path, ending):
    from rrtik_ompl import JointPath, load_problem

    file, problem = tmp_path / f"path{ending}", load_problem("planar3_a")
    JointPath.of(problem.robot, [problem.start, problem.goal.q]).save(file)
    code, out, err = rrtik(capsys, "check", str(file))
    assert (code, out) == (2, "")
    assert err.startswith(f"rrtik: {file}: a path")
    assert err.endswith(f"rrtik check PROBLEM {file.name}\n")
    assert err.count("\n") == 1
    assert "no such file" in rrtik(capsys, "check", str(tmp_path / f"other{ending}"))[2]


@pytest.mark.parametrize("ending", [".json", ".csv"])
def test_what_cannot_be_shown_alone_is_told_what_is_missing(capsys, tmp_path, ending):
    from rrtik_ompl import JointPath, load_problem

    file, problem = tmp_path / f"path{ending}", load_problem("planar3_a")
    JointPath.of(problem.robot, [problem.start, problem.goal.q]).save(file)
    said = f"rrtik: {file}: a path; give its problem too: rrtik show PROBLEM {file}\n"
    assert rrtik(capsys, "show", str(file)) == (2, "", said)

    run_file = tmp_path / "run.json"
    run_file.write_text('{"kind": "replan_run"}')
    replayed = f"give its scenario too: rrtik replan SCENARIO --replay {run_file} --html page.html\n"
    said = f"rrtik: {run_file}: a record of a run; {replayed}"
    assert rrtik(capsys, "show", str(run_file)) == (2, "", said)
    assert rrtik(capsys, "show", "replan_planar_arm", str(run_file)) == (2, "", said)


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """A path of the subsea unit that moves several joints at once."""
    file = tmp_path_factory.mktemp("paths") / "several.json"
    options = ["--planner", "RRTConnect", "--seed", "1", "--shorten", "none", "--out", str(file)]
    assert run(["plan", "titan4_sdu", *options]) == 0
    return str(file)


def test_a_path_of_several_joints_is_no_list_of_moves_until_it_is_converted(capsys, tmp_path, several):
    code, out, err = rrtik(capsys, "moves", several)
    assert (code, out) == (2, "")
    assert "several joints at once" in err
    assert "--problem" in err
    target = tmp_path / "moves.json"
    converted = ("moves", several, "--problem", "titan4_sdu", "--shorten", "axis", "--out", str(target))
    assert rrtik(capsys, *converted)[0] == 0
    assert JointPath.load(target).one_joint_at_a_time
    assert rrtik(capsys, "check", "titan4_sdu", str(target))[0] == 0
    assert rrtik(capsys, "moves", str(target))[0] == 0


def test_moves_are_printed_as_csv_json_and_sentences(capsys, several):
    asked = ("moves", several, "--problem", "titan4_sdu")
    rows = rrtik(capsys, *asked, "--csv")[1].splitlines()
    moves = json.loads(rrtik(capsys, *asked, "--json")[1])["moves"]
    said = rrtik(capsys, *asked, "--spoken")[1].splitlines()
    assert rows[0] == "move,joint,from,to,change,unit"
    assert len(rows) - 1 == len(moves) == len(said)
    assert all(" degrees to " in line for line in said)
    assert rrtik(capsys, *asked, "--csv", "--json")[0] == 2


def test_time_writes_a_trajectory_and_a_picture(capsys, tmp_path, several):
    from rrtik_ompl import Trajectory

    target, picture = tmp_path / "motion.json", tmp_path / "joints.png"
    code, out, err = rrtik(capsys, "time", "titan4_sdu", several, "--out", str(target), "--plot", str(picture))
    assert (code, err) == (0, "")
    motion = Trajectory.load(target)
    assert f"{motion.duration:.3f} s" in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    quick = ("--velocity-deg", "40", "--jerk-deg", "inf")
    faster = json.loads(rrtik(capsys, "time", "titan4_sdu", several, *quick, "--json")[1])
    assert faster["duration"] < motion.duration
    slower = json.loads(rrtik(capsys, "time", "titan4_sdu", several, "--share", "0.5", "--json")[1])
    assert slower["duration"] > motion.duration
    rounded = ("time", "titan4_sdu", several, "--blend-deg", "20", "--jerk-deg", "inf", "--json")
    assert json.loads(rrtik(capsys, *rounded)[1])["duration"] < motion.duration


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--velocity-deg", "0"), "--velocity-deg: expected numbers greater than 0, got 0"),
        (("--velocity-deg", "nan"), "--velocity-deg: expected numbers greater than 0, got nan"),
        (("--acceleration-deg", "1,2"), "6 joints"),
        (("--jerk-deg", "fast"), "expected a number"),
        (("--share", "0"), "share"),
        (("--blend-deg", "-1"), "0 degrees or more, got -1"),
        (("--rate", "100"), "give --out FILE too"),
        (("--payload", "1"), "give --torque too"),
        (("--tip-speed", "250"), "for 250 mm/s give 0.25"),
        (("--out", "motion.txt"), "unknown ending"),
        (("--plot", "joints.pdf"), "unknown ending"),
    ],
)
def test_limits_and_files_that_are_none_are_refused_in_one_line(capsys, several, options, words):
    code, out, err = rrtik(capsys, "time", "titan4_sdu", several, *options)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1


def test_a_plan_and_its_shortening_move_the_last_joint_last(capsys):
    last = ("--parameter", 'last_joints=["azimuth"]', "--seed", "2", "--json")
    found = json.loads(rrtik(capsys, "plan", "titan4_sdu", *last)[1])
    assert [move["joint"] for move in found["moves"]].index("azimuth") == found["transitions"] - 1


def test_a_path_of_one_waypoint_has_no_moves_to_list(capsys, tmp_path):
    file = tmp_path / "one.csv"
    file.write_text("a,b\n0,0\n")
    code, out, err = rrtik(capsys, "moves", str(file))
    assert (code, out) == (2, "")
    assert "one waypoint" in err


def test_a_path_that_is_not_valid_is_neither_timed_nor_converted(capsys, tmp_path):
    from rrtik_ompl import JointPath, load_problem

    problem = load_problem("titan4_sdu")
    file = tmp_path / "straight.json"
    JointPath.of(problem.robot, [problem.start, problem.goal.q]).save(file)
    for asked in (("time", "titan4_sdu", str(file)), ("moves", str(file), "--problem", "titan4_sdu")):
        code, out, err = rrtik(capsys, *asked)
        assert (code, out) == (2, "")
        assert "not valid" in err
        assert "overlap" in err


def test_show_takes_a_path_before(capsys, tmp_path, several):
    page = tmp_path / "page.html"
    code, out, _ = rrtik(capsys, "show", "titan4_sdu", several, "--before", several, "--html", str(page))
    assert (code, out) == (0, f"wrote {page}\n")
    assert '"before":"6 moves' in page.read_text()


@pytest.mark.parametrize("name", ["motion.json", "motion.csv", "motion.yaml"])
def test_show_plays_a_timed_motion_and_check_proves_it(capsys, tmp_path, several, name):
    file, page = tmp_path / name, tmp_path / "page.html"
    assert rrtik(capsys, "time", "titan4_sdu", several, "--out", str(file), "--rate", "100")[0] == 0
    code, out, err = rrtik(capsys, "show", "titan4_sdu", str(file), "--html", str(page))
    assert (code, out, err) == (0, f"wrote {page}\n", "")
    assert '"times":[' in page.read_text()
    code, out, err = rrtik(capsys, "check", "titan4_sdu", str(file))
    assert code == 0, err
    assert "valid, proven free at every time" in out


@pytest.mark.parametrize("kind", ["robots", "planners", "problems"])
def test_list_names_what_there_is(capsys, kind):
    expected = {"robots": "titan4", "planners": "bicrdt", "problems": "titan4_sdu"}[kind]
    code, out, _ = rrtik(capsys, "list", kind)
    assert code == 0
    assert expected in out.split()
    assert expected in rrtik(capsys, "list")[1].split()


@pytest.mark.parametrize("ending", [".csv", ".txt"])
def test_convert_between_path_formats(capsys, tmp_path, ending):
    source, target, back = tmp_path / "a.json", tmp_path / f"b{ending}", tmp_path / "c.json"
    assert rrtik(capsys, "plan", "planar3_a", "--seed", "1", "--out", str(source))[0] == 0
    assert rrtik(capsys, "convert", str(source), str(target))[0] == 0
    assert rrtik(capsys, "convert", str(target), str(back), "--robot", "planar3")[0] == 0
    assert (JointPath.load(source).waypoints == JointPath.load(back).waypoints).all()


def test_convert_writes_a_problem_that_loads_again(capsys, tmp_path):
    from rrtik_ompl.description.catalog import find_problem

    target = tmp_path / "copy.yaml"
    assert rrtik(capsys, "convert", str(find_problem("titan4_sdu")), str(target))[0] == 0
    assert rrtik(capsys, "check", str(target))[0] == 0


def test_a_file_that_cannot_be_written_is_refused_before_any_work(capsys):
    code, out, err = rrtik(capsys, "plan", "titan4_sdu", "--out", "no/such/folder/path.json")
    assert (code, out) == (2, "")
    assert "no/such/folder" in err


def test_help_and_version_are_there(capsys):
    assert rrtik(capsys, "plan", "--help")[0] == 0
    code, out, _ = rrtik(capsys, "--help")
    assert code == 0
    assert "..." not in out.partition("Commands:")[2]  # every command says what it does in a line that is not cut off
    code, out, _ = rrtik(capsys, "--version")
    assert code == 0
    assert out.startswith("rrtik ")


def test_the_package_can_be_run_as_a_module():
    done = subprocess.run([sys.executable, "-m", "rrtik_ompl", "list", "no"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("rrtik: ")


def command(*arguments):
    return [sys.executable, "-m", "rrtik_ompl.cli.app", *arguments]


def test_ctrl_c_exits_130_says_so_and_leaves_no_file(tmp_path):
    # a goal walled in: planning goes on until the interruption
    problem = tmp_path / "closed.yaml"
    problem.write_text(
        "version: 1\nrobot: {point2d: {radius: 0.1, bounds: [[0, 10], [0, 10]]}}\n"
        "scene: {obstacles: [{name: wall, box: [1, 30, 1], pose: {xyz: [5, 5, 0]}}]}\n"
        "start: {joints: [1, 1]}\ngoal: {joints: [9, 9]}\n"
    )
    out = tmp_path / "path.json"
    terminal, end = pty.openpty()  # on which the command shows that it plans
    process = subprocess.Popen(command("plan", str(problem), "--seconds", "60", "--out", str(out)), stderr=end)
    os.close(end)
    shown = ""
    while "planning" not in shown:
        shown += os.read(terminal, 1000).decode()
    process.send_signal(signal.SIGINT)
    with suppress(OSError):  # Linux's word for the end of a terminal
        while more := os.read(terminal, 1000):
            shown += more.decode()
    os.close(terminal)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown)  # the progress is taken away, by moves of the cursor
    assert process.wait(timeout=30) == 130
    assert shown.count("rrtik: ") == 1
    assert shown.splitlines()[-1].startswith("rrtik: interrupted")
    assert sorted(f.name for f in tmp_path.iterdir()) == ["closed.yaml"]


def test_ctrl_c_while_the_program_loads_is_one_line():
    code = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from rrtik_ompl.cli.entry import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code, "list"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "rrtik: interrupted; no file is half-written\n")


def test_an_interrupted_command_says_everything_and_takes_nothing_down():
    code = (
        "import atexit, rrtik_ompl.cli.app as app\n"
        "atexit.register(print, 'taken down')\n"
        "app.run = lambda: print('said') or app.INTERRUPTED\n"
        "from rrtik_ompl.cli.entry import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "said\n")


def test_rrtik_alone_prints_the_help(capsys):
    code, _, err = rrtik(capsys)
    assert code == 2
    assert "Usage: rrtik" in err


@pytest.mark.parametrize(("streams", "code"), [(">&-", 0), ("2>&-", 0), ("<&- >&- 2>&-", 0), (">/dev/full", 2)])
def test_streams_that_are_closed_or_full_give_no_traceback(streams, code):
    line = f'exec "$0" -m rrtik_ompl.cli.app plan planar3_a --seed 1 {streams}'
    done = subprocess.run(["sh", "-c", line, sys.executable], capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert done.stderr in ("", "rrtik: standard output cannot be written: No space left on device\n")


def test_an_error_stays_out_of_standard_output_if_standard_error_is_closed():
    line = 'exec "$0" -m rrtik_ompl.cli.app check nothing.yaml 2>&-'
    done = subprocess.run(["sh", "-c", line, sys.executable], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")


def test_letters_that_the_terminal_lacks_are_spelt_out(tmp_path):
    source = tmp_path / "übung.yaml"
    assert run(["convert", "planar3_a", str(source)]) == 0
    environment = dict(os.environ, PYTHONIOENCODING="ascii")
    done = subprocess.run(command("check", str(source)), capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(r"\xfcbung: start is free")


def test_a_narrow_terminal_cuts_no_number(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    _, out, _ = rrtik(capsys, "plan", "titan4_sdu", "--planner", "RRTConnect", "--seed", "1")
    assert "…" not in out


def test_a_reader_that_goes_away_is_no_error():
    process = subprocess.Popen(command("list"), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    _, err = process.communicate(timeout=60)
    assert b"Traceback" not in err


def test_nothing_is_printed_on_standard_error_when_it_is_no_terminal():
    environment = dict(os.environ, PYTHONWARNINGS="error")
    done = subprocess.run(
        command("plan", "titan4_sdu", "--seed", "1"), capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0
    assert done.stderr == ""


def test_play_of_a_goal_that_is_a_pose_begins_with_a_path_to_it(monkeypatch):
    served = []
    monkeypatch.setattr("rrtik_ompl.viewer.play", lambda problem, path, **options: served.append((problem, path)))
    assert run(["play", "ur5_table"]) == 0
    ((problem, path),) = served
    assert path.violations(problem.world) == ()
    np.testing.assert_array_equal(path.start, problem.start)
    reached = problem.robot.fk(path.end)
    wanted = problem.goal.pose
    assert np.linalg.norm(reached.translation - wanted.translation) < 0.002


@pytest.mark.parametrize(
    ("problem", "reason"), [("ur5_upright", "path constraints"), ("replan_ur5", "obstacles that move")]
)
def test_play_says_why_the_page_of_a_problem_cannot_plan(capsys, problem, reason):
    code, _, err = rrtik(capsys, "play", problem)
    assert code == 2
    assert re.search(rf"{problem}: its page cannot plan: it has {reason}", err)
