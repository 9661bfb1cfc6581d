"""One table of everything wrong that a person can type, write into a file, or hand to the API: one line, no traceback.

Rows of the command line: the files of the folder, the arguments, and what the line on standard error has to contain.
"""

import subprocess
import sys

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import RrtikError
from rrtik_ompl.base.poses import pose
from rrtik_ompl.cli.app import run
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Mesh, Prism, Sphere

ARM = "{planar: {lengths: [1, 1], limits_deg: [[-90, 90], [-90, 90]], radius: 0.01}}"
GOOD = f"""version: 1
robot: {ARM}
scene:
  obstacles:
    - {{name: wall, box: [0.2, 0.2, 1], pose: {{xyz: [-1.5, 0, 0]}}}}
start: {{joints_deg: [0, 0]}}
goal: {{joints_deg: [45, 30]}}
"""
URDF = """<robot name="arm"><link name="base"/><link name="hand"><collision><geometry>
<sphere radius="0.1"/></geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/>
<child link="hand"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
SRDF = """<robot name="arm"><group name="all"><joint name="turn"/></group></robot>"""
LIMITS = "joint_limits: {turn: {has_velocity_limits: true, max_velocity: 1.0}}\n"
DH = "version: 1\nname: arm\ndh: {convention: standard, rows: [{a: 1, limits_deg: [-90, 90]}]}\n"
PATH = '{"version": 1, "waypoints": [[0, 0], [0.5, 0]]}'
SPHERE = "{name: ball, sphere: 0.1, pose: {xyz: [-3, 0, 0]}}"


def task(old="", new="", robot=None):
    text = GOOD.replace(ARM, robot) if robot else GOOD
    assert old in text
    return {"task.yaml": text.replace(old, new, 1)}


def obstacle(entry):
    return task("{name: wall, box: [0.2, 0.2, 1], pose: {xyz: [-1.5, 0, 0]}}", entry)


def urdf(old="", new="", entry="{urdf: arm.urdf}", **files):
    assert old in URDF
    start = {"task.yaml": f"version: 1\nrobot: {entry}\nstart: {{joints: [0]}}\ngoal: {{joints: [0.5]}}\n"}
    others = {name.replace("_", "."): text for name, text in files.items()}
    return start | {"arm.urdf": URDF.replace(old, new, 1)} | others


def srdf(old, new, group="all"):
    assert old in SRDF
    return urdf(entry=f"{{urdf: arm.urdf, srdf: arm.srdf, group: {group}}}", arm_srdf=SRDF.replace(old, new, 1))


def limits(old, new):
    assert old in LIMITS
    return urdf(entry="{urdf: arm.urdf, joint_limits: limits.yaml}", limits_yaml=LIMITS.replace(old, new, 1))


def dh(old, new):
    assert old in DH
    return urdf(entry="{dh: dh.yaml}", dh_yaml=DH.replace(old, new, 1))


def mesh(name, data, rest=""):
    return obstacle(f"{{name: part, mesh: {name}{rest}}}") | {name: data}


CHECK = ("check", "task.yaml")
# fmt: off
ITS_PLANNER = ("plan", "task.yaml", "--planner")
OPTION = (*ITS_PLANNER, "bicrdt", "--parameter")
COMMAND_LINE = {
    # files
    "missing problem file": ({}, CHECK, ["task.yaml", "no such file"]),
    "misspelt problem file": (task(), ("check", "tsk.yaml"), ["tsk.yaml", "did you mean 'task.yaml'"]),
    "unknown problem": ({}, ("check", "titan4_sud"), ["titan4_sud", "did you mean 'titan4_sdu'"]),
    "empty problem name": ({}, ("check", ""), ["no problem"]),
    "a folder": ({}, ("check", "."), ["."]),
    "missing folder": ({}, ("check", "nowhere/task.yaml"), ["nowhere/task.yaml", "does not exist"]),
    "empty file": ({"task.yaml": ""}, CHECK, ["task.yaml", "empty"]),
    "binary file": ({"task.yaml": b"\x7fELF\xff\xfe"}, CHECK, ["task.yaml", "not a text file"]),
    "UTF-16 file": ({"task.yaml": GOOD.encode("utf-16")}, CHECK, ["task.yaml", "not a text file"]),
    "tab": (task("  obstacles", "\tobstacles"), CHECK, ["task.yaml:4", "tab"]),
    "open bracket": (task("[45, 30]", "[45, 30"), CHECK, ["task.yaml:7", "not valid YAML"]),
    "JSON list": ({"task.yaml": "[1, 2]"}, CHECK, ["task.yaml:1", "found a list of 2"]),
    "two documents": ({"task.yaml": GOOD + "---\n" + GOOD}, CHECK, ["task.yaml:8", "second document"]),
    "python object": (task("[45, 30]", "!!python/tuple [45, 30]"), CHECK, ["task.yaml:7", "goal.joints_deg", "tag"]),
    "XML": ({"task.yaml": URDF}, CHECK, ["task.yaml"]),
    # keys
    "key twice": (task("start:", "goal:"), CHECK, ["task.yaml:7", "'goal' stands here twice"]),
    "unknown key": (task("goal:", "gaol:"), CHECK, ["task.yaml:7", "gaol", "did you mean 'goal'"]),
    "missing start": (task("start: {joints_deg: [0, 0]}\n", ""), CHECK, ["task.yaml", "start", "missing"]),
    "missing version": (task("version: 1\n", ""), CHECK, ["task.yaml", "version", "missing"]),
    "future version": (task("version: 1", "version: 2"), CHECK, ["task.yaml:1", "version", "must be 1"]),
    "empty value": (task("{joints_deg: [45, 30]}", ""), CHECK, ["task.yaml:7", "goal", "nothing stands after"]),
    "unknown key in an obstacle": (obstacle("{name: a, sphere: 1, colour: red}"), CHECK, ["task.yaml:5", "colour"]),
    # values
    "joint count": (task("[45, 30]", "[45, 30, 0]"), CHECK, ["task.yaml:7", "goal", "2 joints"]),
    "text for a joint": (task("[45, 30]", "[45, deg]"), CHECK, ["task.yaml:7", "goal.joints_deg[1]", "text 'deg'"]),
    "NaN for a joint": (task("[45, 30]", "[45, .nan]"), CHECK, ["task.yaml:7", "goal.joints_deg[1]", "finite"]),
    "infinity for a joint": (task("[0, 0]", "[0, .inf]"), CHECK, ["task.yaml:6", "start.joints_deg[1]", "finite"]),
    "goal outside limits": (task("[45, 30]", "[45, 91]"), CHECK, ["task.yaml:7", "goal", "joint2"]),
    "start outside limits": (task("[0, 0]", "[-91, 0]"), CHECK, ["task.yaml:6", "start", "joint1"]),
    "start in collision": (task("[-1.5, 0, 0]", "[1.5, 0, 0]"), CHECK, ["task.yaml:6", "start", "wall"]),
    "goal in collision": (task("[-1.5, 0, 0]", "[0.7, 0.7, 0]"), CHECK, ["task.yaml:7", "goal", "wall"]),
    "unknown posture": (task("{joints_deg: [0, 0]}", "{posture: stowed}"), CHECK, ["task.yaml:6", "stowed"]),
    "no kind of goal": (task("{joints_deg: [45, 30]}", "{}"), CHECK, ["task.yaml:7", "goal", "joints_deg, joints"]),
    "long quaternion": (task("{joints_deg: [45, 30]}", "{pose: {xyz: [1, 1, 0], quat_xyzw: [1, 1, 0, 0]}}"), CHECK,
                        ["task.yaml:7", "goal", "quat_xyzw", "length 1"]),
    "negative tolerance": (task("{joints_deg: [45, 30]}", "{position: [1, 1, 0], tolerance: -1}"), CHECK,
                           ["task.yaml:7", "goal.tolerance", "greater than 0"]),
    "tiny resolution": ({"task.yaml": GOOD + "motion_resolution: 1e-300\n"}, CHECK,
                        ["task.yaml:8", "motion_resolution", "1e-05 or more"]),
    "zero resolution": ({"task.yaml": GOOD + "motion_resolution: 0\n"}, CHECK, ["task.yaml:8", "motion_resolution"]),
    # units
    "unit behind a number": (obstacle("{name: a, sphere: 10cm}"), CHECK, ["task.yaml:5", "sphere", "text '10cm'"]),
    "degrees that are no radians": (task("joints_deg: [45, 30]", "joints: [45, 30]"), CHECK, ["task.yaml:7", "joint1"]),
    "millimetres": (obstacle("{name: a, sphere: 5000000}"), CHECK, ["task.yaml:5", "sphere", "1e+06 or less"]),
    # shapes
    "no shape": (obstacle("{name: a}"), CHECK, ["task.yaml:5", "'a' needs exactly one of"]),
    "two shapes": (obstacle("{name: a, sphere: 1, box: [1, 1, 1]}"), CHECK, ["task.yaml:5", "sphere"]),
    "flat box": (obstacle("{name: a, box: [1, 1, 0]}"), CHECK, ["task.yaml:5", "box[2]"]),
    "polygon crosses itself": (obstacle("{name: a, polygon: [[0, 0], [2, 2], [3, 0], [0, 1]]}"), CHECK,
                               ["task.yaml:5", "crosses itself"]),
    "polygon without area": (obstacle("{name: a, polygon: [[0, 0], [1, 1], [2, 2]]}"), CHECK,
                             ["task.yaml:5", "no area"]),
    "zero normal": (obstacle("{name: a, half_space: {normal: [0, 0, 0]}}"), CHECK, ["task.yaml:5", "normal"]),
    "name twice": (obstacle(f"{SPHERE}\n    - {SPHERE}"), CHECK, ["task.yaml:3", "'ball' is used 2 times"]),
    "name of a link": (obstacle("{name: link1, sphere: 0.1}"), CHECK, ["task.yaml:3", "link1", "rename"]),
    "attached to no link": (task("start:", "  attached: [{name: a, link: jaw, sphere: 1}]\nstart:"), CHECK,
                            ["task.yaml:3", "jaw"]),
    "allowed pair unknown": (task("start:", "  allowed_collisions: [[wall, ghost]]\nstart:"), CHECK,
                             ["task.yaml:3", "ghost"]),
    "times backwards": (obstacle("{name: a, sphere: 0.1, motion: {waypoints: [{time: 1, pose: {xyz: [5, 0, 0]}}, "
                                 "{time: 0, pose: {xyz: [6, 0, 0]}}]}}"), CHECK, ["task.yaml:5", "times must"]),
    # meshes
    "missing mesh": (obstacle("{name: a, mesh: part.stl}"), CHECK, ["task.yaml:5", "part.stl", "no such file"]),
    "empty mesh": (mesh("part.stl", ""), CHECK, ["task.yaml:5", "part.stl", "empty"]),
    "text as mesh": (mesh("part.stl", "just words\n" * 20), CHECK, ["task.yaml:5", "part.stl", "not a usable mesh"]),
    "mesh without triangles": (mesh("part.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), CHECK, ["part.obj", "no triangles"]),
    "unknown kind of mesh": (mesh("part.step", "ISO-10303-21;\n"), CHECK, ["task.yaml:5", "part.step", "STL"]),
    "broken PLY": (mesh("part.ply", "ply\n"), CHECK, ["task.yaml:5", "part.ply", "not a usable mesh"]),
    "negative mesh scale": (mesh("part.obj", "", ", scale: -1"), CHECK, ["task.yaml:5", "scale", "greater than 0"]),
    # robots
    "unknown robot": (task(robot="titan5"), CHECK, ["task.yaml:2", "titan5", "titan4"]),
    "unknown robot option": (task(robot="{name: titan4, limit: envelope}"), CHECK, ["task.yaml:2", "'limit'"]),
    "unknown limit set": (task(robot="{name: titan4, limits: large}"), CHECK, ["task.yaml:2", "large", "envelope"]),
    "unknown tip": (urdf(entry="{urdf: arm.urdf, tip: tool}"), CHECK, ["task.yaml:2", "tool", "hand"]),
    "unknown joint": (urdf(entry="{urdf: arm.urdf, joints: [spin]}"), CHECK, ["task.yaml:2", "spin", "turn"]),
    "joint twice": (urdf(entry="{urdf: arm.urdf, joints: [turn, turn]}"), CHECK, ["task.yaml:2", "turn", "twice"]),
    "unknown locked joint": (urdf(entry="{urdf: arm.urdf, locked: {spin: 0}}"), CHECK, ["task.yaml:2", "spin"]),
    "planar arm of no links": (task(robot="{planar: {lengths: []}}"), CHECK, ["task.yaml:2", "lengths"]),
    "planar limits of one joint": (task(robot="{planar: {lengths: [1, 1], limits_deg: [[-9, 9]]}}"), CHECK,
                                   ["task.yaml:2", "limits_deg"]),
    "planar limits upside down": (task(robot="{planar: {lengths: [1, 1], limits_deg: [[9, -9], [-9, 9]]}}"), CHECK,
                                  ["task.yaml:2", "limits"]),
    # URDF
    "missing URDF": (task(robot="{urdf: arm.urdf}"), CHECK, ["task.yaml:2", "arm.urdf", "no such file"]),
    "broken URDF": (urdf("</robot>", ""), CHECK, ["task.yaml:2", "arm.urdf"]),
    "URDF of something else": (urdf(URDF, "<html><body/></html>"), CHECK, ["task.yaml:2", "arm.urdf", "robot"]),
    "URDF without joints": (urdf("revolute", "fixed"), CHECK, ["task.yaml:2", "joint"]),
    "unknown joint type": (urdf("revolute", "rotating"), CHECK, ["task.yaml:2", "arm.urdf", "rotating"]),
    "free-floating joint": (urdf("revolute", "floating"), CHECK, ["task.yaml:2", "arm.urdf", "no movable joint"]),
    "child link missing": (urdf('<child link="hand"/>', '<child link="claw"/>'), CHECK, ["task.yaml:2", "claw"]),
    "limits upside down": (urdf('lower="-1"', 'lower="2"'), CHECK, ["task.yaml:2", "turn"]),
    "limit is text": (urdf('lower="-1"', 'lower="low"'), CHECK, ["task.yaml:2", "turn", "low"]),
    "zero axis": (urdf('axis xyz="0 0 1"', 'axis xyz="0 0 0"'), CHECK, ["task.yaml:2", "turn", "axis"]),
    "missing mesh of a link": (urdf('<sphere radius="0.1"/>', '<mesh filename="hand.stl"/>'), CHECK,
                               ["task.yaml:2", "hand.stl"]),
    "link mesh in no package": (urdf('<sphere radius="0.1"/>', '<mesh filename="package://none/hand.stl"/>'), CHECK,
                                ["task.yaml:2", "package://none/hand.stl"]),
    "negative radius of a link": (urdf('radius="0.1"', 'radius="-0.1"'), CHECK, ["task.yaml:2", "hand", "radius"]),
    # SRDF, joint limits, DH
    "missing SRDF": (urdf(entry="{urdf: arm.urdf, srdf: arm.srdf, group: all}"), CHECK, ["task.yaml:2", "arm.srdf"]),
    "broken SRDF": (srdf("</robot>", ""), CHECK, ["task.yaml:2", "arm.srdf"]),
    "unknown group": (srdf("", "", group="arms"), CHECK, ["task.yaml:2", "arms", "all"]),
    "group without SRDF": (urdf(entry="{urdf: arm.urdf, group: all}"), CHECK, ["task.yaml:2", "group", "srdf"]),
    "group of unknown joints": (srdf('name="turn"', 'name="spin"'), CHECK, ["task.yaml:2", "spin"]),
    "unknown limit": (limits("max_velocity", "max_speed"), CHECK, ["limits.yaml:1", "max_speed"]),
    "negative velocity": (limits("1.0", "-1.0"), CHECK, ["task.yaml:2", "turn", "velocity"]),
    "limits without heading": (limits("joint_limits: ", "limits: "), CHECK, ["limits.yaml", "joint_limits"]),
    "DH convention missing": (dh("convention: standard, ", ""), CHECK, ["dh.yaml:3", "convention"]),
    "DH convention unknown": (dh("standard", "classic"), CHECK, ["dh.yaml:3", "convention", "modified"]),
    "DH angle in radians": (dh("a: 1", "alpha: 1"), CHECK, ["dh.yaml:3", "alpha_deg"]),
    "DH without rows": (dh("rows: [{a: 1, limits_deg: [-90, 90]}]", "rows: []"), CHECK, ["dh.yaml:3", "rows"]),
    # path files
    "missing path": (task(), (*CHECK, "path.json"), ["path.json", "no such file"]),
    "path is no JSON": (task() | {"path.json": "0 0\n"}, (*CHECK, "path.json"), ["path.json", "JSON"]),
    "path of three joints": (task() | {"path.txt": "0 0 0\n1 1 1\n"}, (*CHECK, "path.txt"), ["path.txt", "2"]),
    "ragged path": (task() | {"path.txt": "0 0\n1\n"}, (*CHECK, "path.txt"), ["path.txt", "line 2"]),
    "text in a path": (task() | {"path.csv": "joint1,joint2\n0,zero\n"}, (*CHECK, "path.csv"), ["path.csv"]),
    "NaN in a path": (task() | {"path.txt": "0 0\n0 nan\n"}, (*CHECK, "path.txt"), ["path.txt", "finite"]),
    "empty path": (task() | {"path.txt": ""}, (*CHECK, "path.txt"), ["path.txt", "empty"]),
    "path of another kind": (task() | {"a.json": '{"kind": "scene", "waypoints": [[0, 0]]}'}, (*CHECK, "a.json"),
                             ["a.json", "kind", "joint_path"]),
    "path that is endless to check": (task() | {"a.json": '{"waypoints": [[0, 0], [1e5, 0]]}'}, (*CHECK, "a.json"),
                                      ["checks are too many", "motion_resolution"]),
    "path far away": (task() | {"a.json": '{"waypoints": [[0, 0], [1e9, 0]]}'}, (*CHECK, "a.json"),
                      ["a.json", "1e+09", "units"]),
    "number of 400 digits in a path": (task() | {"a.json": f'{{"waypoints": [[{"9" * 400}, 0]]}}'}, (*CHECK, "a.json"),
                                       ["a.json", "expected numbers"]),
    "number of 5000 digits in a path": (task() | {"a.json": f'{{"waypoints": [[{"9" * 5000}, 0]]}}'},
                                        (*CHECK, "a.json"), ["a.json", "thousands of digits"]),
    "table without names": (task() | {"a.csv": "0,0\n1,1\n"}, (*CHECK, "a.csv"), ["a.csv: line 1", "names"]),
    "unknown kind of path": (task() | {"path.xls": PATH}, (*CHECK, "path.xls"), ["path.xls", ".json"]),
    # arguments
    "unknown command": ({}, ("paln", "titan4_sdu"), ["paln"]),
    "no problem given": ({}, ("plan",), ["Missing argument", "rrtik plan --help"]),
    "unknown option": ({}, ("plan", "titan4_sdu", "--sed", "1"), ["--sed"]),
    "option without value": ({}, ("plan", "titan4_sdu", "--seed"), ["--seed"]),
    "option with too few values": ({}, ("ik", "titan4", "--position", "1", "2"), ["--position", "rrtik ik --help"]),
    "no command of a group": ({}, ("markers",), ["Missing command", "rrtik markers --help"]),
    "unknown planner": (task(), ("plan", "task.yaml", "--planner", "bicdrt"), ["bicdrt", "did you mean 'bicrdt'"]),
    "seed is text": (task(), ("plan", "task.yaml", "--seed", "one"), ["--seed", "whole number", "random"]),
    "negative seed": (task(), ("plan", "task.yaml", "--seed", "-1"), ["seed", "-1"]),
    "no time": (task(), ("plan", "task.yaml", "--seconds", "0"), ["seconds"]),
    "endless time": (task(), ("plan", "task.yaml", "--seconds", "1e400"), ["seconds: must be a finite number"]),
    "more time than a clock has": (task(), ("plan", "task.yaml", "--seconds", "1e10"), ["seconds", "1e+09 or less"]),
    "endless restarts": (task(), ("plan", "task.yaml", "--restarts", "99999999999"), ["restarts", "from 0 to"]),
    "parameter that nobody has": (task(), (*OPTION, "max_iteration=9"),
                                  ["max_iteration", "did you mean 'max_iterations'"]),
    "parameter that is not given by hand": (task(), (*OPTION, "world=1"), ["world", "max_iter"]),
    "parameter of another type": (task(), (*OPTION, "max_iterations=few"), ["max_it", "'few'"]),
    "parameter is nan": (task(), (*ITS_PLANNER, "RRT", "--parameter", "range=NaN"), ["range", "finite"]),
    "time is nan": (task(), ("plan", "task.yaml", "--seconds", "nan"), ["seconds"]),
    "negative restarts": (task(), ("plan", "task.yaml", "--restarts", "-1"), ["restarts"]),
    "unknown shortener": (task(), ("plan", "task.yaml", "--shorten", "magic"), ["--shorten", "magic"]),
    "parameter without value": (task(), ("plan", "task.yaml", "--parameter", "range"), ["--parameter", "NAME=VALUE"]),
    "names without quotes": (task(), (*OPTION, "frozen_joints=[joint1]"), ["--parameter", "in quotes"]),
    "record of a replay": ({}, ("replan", "replan_ur5", "--replay", "a.json", "--record", "b.json"), ["leave out"]),
    "foreseen replay": ({}, ("replan", "replan_ur5", "--replay", "a.json", "--foreseen"), ["leave out --foreseen"]),
    "foreseen ticks": ({}, ("replan", "replan_ur5", "--foreseen", "--lookahead-ticks", "3"), ["--foreseen"]),
    "foreseen planner": ({}, ("replan", "replan_ur5", "--foreseen", "--planner", "drrt"), ["--planner", "leave out"]),
    "foreseen seconds": ({}, ("replan", "replan_ur5", "--foreseen", "--horizon", "nan"), ["horizon", "nan"]),
    "planner of a replay": ({}, ("replan", "replan_ur5", "--replay", "a.json", "--planner", "drrt"), ["leave out"]),
    "negative seed of a pilot": ({}, ("pilot", "titan4_sdu", "--simulated", "--seed", "-1"), ["--seed", "0"]),
    "out of unknown kind": (task(), ("plan", "task.yaml", "--out", "path.xls"), ["path.xls", ".json"]),
    "out is a folder": (task() | {"a.json/b": ""}, ("plan", "task.yaml", "--out", "a.json"), ["a.json", "a folder"]),
    "out in no folder": (task(), ("plan", "task.yaml", "--out", "no/path.json"), ["no/path.json", "does not exist"]),
    "page of unknown kind": (task(), ("plan", "task.yaml", "--html", "view.png"), ["view.png", ".html"]),
    "unknown list": ({}, ("list", "robot"), ["robot"]),
    "port is text": (task(), ("show", "task.yaml", "--port", "web"), ["--port", "integer"]),
    "convert to unknown kind": (task(), ("convert", "task.yaml", "out.foo"), ["out.foo", ".yaml"]),
    "convert nothing": ({}, ("convert", "task.yaml", "out.yaml"), ["task.yaml", "no such file"]),
    "convert a path to a problem": ({"a.json": PATH}, ("convert", "a.json", "b.yaml"), ["b.yaml"]),
}
# fmt: on


def place(folder, files):
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


@pytest.mark.parametrize(("files", "arguments", "fragments"), COMMAND_LINE.values(), ids=COMMAND_LINE)
def test_the_command_line_says_it_in_one_line_and_exits_with_2(
    tmp_path, monkeypatch, capfd, files, arguments, fragments
):
    place(tmp_path, files)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    code = run(list(arguments))
    err = capfd.readouterr().err
    assert code == 2, err
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    assert [part for part in fragments if part not in err] == [], err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("row", ["text as mesh", "broken URDF"])  # of which C++ libraries would print
def test_a_process_of_its_own_says_the_same(tmp_path, row):
    files, arguments, fragments = COMMAND_LINE[row]
    place(tmp_path, files)
    code = "from rrtik_ompl.cli.app import main; main()"
    done = subprocess.run([sys.executable, "-c", code, *arguments], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert all(part in done.stderr for part in fragments)


def test_the_good_file_that_the_table_spoils_is_good(tmp_path, monkeypatch, capsys):
    place(tmp_path, task() | {"path.json": PATH})
    monkeypatch.chdir(tmp_path)
    assert run(["check", "task.yaml"]) == 0
    for files in (urdf(), srdf("", ""), limits("", ""), dh("", ""), obstacle(SPHERE)):
        place(tmp_path, files)
        assert run(["check", "task.yaml"]) == 0, capsys.readouterr().err


def robot():
    return rrtik.load_robot("planar3")


def world():
    return rrtik.World(robot(), rrtik.Scene())


def small():
    return rrtik.Problem(world(), [0, 0, 0], [0.5, 0, 0])


NAN, TRIANGLE = float("nan"), [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
API = {
    "wrong number of joints": (lambda: rrtik.Problem(world(), [0, 0], [1, 1]), ["start", "3 joints"]),
    "NaN in the start": (lambda: rrtik.Problem(world(), [0, NAN, 0], [1, 1, 1]), ["start", "finite"]),
    "text in the start": (lambda: rrtik.Problem(world(), ["a", 0, 0], [1, 1, 1]), ["start", "numbers"]),
    "a matrix as start": (lambda: rrtik.Problem(world(), np.zeros((2, 3)), [1, 1, 1]), ["start", "shape"]),
    "ragged goal": (lambda: rrtik.Problem(world(), [0, 0, 0], [[1], [1, 2], [3]]), ["goal"]),
    "None as goal": (lambda: rrtik.Problem(world(), [0, 0, 0], None), ["goal"]),
    "a robot as world": (lambda: rrtik.Problem(robot(), [0, 0, 0], [1, 1, 1]), ["world", "World(robot, scene)"]),
    "goal outside limits": (lambda: rrtik.Problem(world(), [0, 0, 0], [0, 9, 0]), ["goal", "joint2"]),
    "zero resolution": (lambda: rrtik.World(robot(), rrtik.Scene(), motion_resolution=0), ["motion_resolution"]),
    "NaN resolution": (lambda: rrtik.World(robot(), rrtik.Scene(), motion_resolution=NAN), ["motion_resolution"]),
    "valid of two joints": (lambda: world().valid([0, 0]), ["3"]),
    "valid_batch of one row": (lambda: world().valid_batch([0, 0, 0]), ["shape"]),
    "motions of unequal number": (lambda: world().motion_valid_batch(np.zeros((2, 3)), np.zeros((1, 3))), ["2", "1"]),
    "infinite motion": (lambda: world().motion_valid([0, 0, 0], [0, float("inf"), 0]), ["finite"]),
    "box of two sides": (lambda: Box([1, 2]), ["box size", "shape"]),
    "negative box": (lambda: Box([1, 2, -3]), ["box size", "greater than 0"]),
    "sphere of no radius": (lambda: Sphere(0), ["sphere radius"]),
    "sphere of text": (lambda: Sphere("big"), ["sphere radius", "numbers"]),
    "cylinder of NaN": (lambda: Cylinder(0.1, NAN), ["cylinder length", "finite"]),
    "capsule of infinity": (lambda: Capsule(float("inf"), 1), ["capsule radius", "finite"]),
    "half-space without normal": (lambda: HalfSpace([0, 0, 0]), ["half-space normal"]),
    "polygon of two corners": (lambda: Prism([[0, 0], [1, 1]]), ["polygon", "3 different vertices"]),
    "triangle of no vertex": (lambda: Mesh(TRIANGLE, [[0, 1, 7]]), ["mesh", "vertex 7"]),
    "mesh of quads": (lambda: Mesh(TRIANGLE, [[0, 1, 2, 0]]), ["mesh", "triangle"]),
    "scene with a name twice": (lambda: rrtik.Scene((rrtik.Obstacle("a", Sphere(1)),) * 2), ["'a'", "2 times"]),
    "unknown obstacle": (lambda: rrtik.Scene().obstacle("wall"), ["wall"]),
    "quaternion w first": (lambda: pose([0, 0, 0], [2, 0, 0, 0]), ["quat_xyzw", "x, y, z, w"]),
    "pose goal of zeros": (lambda: rrtik.PoseGoal(np.zeros((3, 3))), ["goal pose", "(4, 4)"]),
    "position goal in 2-D": (lambda: rrtik.PositionGoal([0, 0]), ["goal position"]),
    "negative tolerance": (lambda: rrtik.PositionGoal([0, 0, 0], -1), ["goal tolerance"]),
    "region of nothing": (lambda: rrtik.GoalSet([]), ["goal"]),
    "set of configurations": (lambda: rrtik.GoalSet([np.zeros(7)]), ["configurations", "PoseGoal(robot.fk(q))"]),
    "position as joint values": (
        lambda: rrtik.Problem(rrtik.World(rrtik.load_robot("ur5")), [0.0] * 6, [0.3, 0.0, 0.5]),
        ["6 joints", "PositionGoal([x, y, z])"],
    ),
    "region about axis w": (lambda: rrtik.GoalSet([rrtik.PositionGoal([0, 0, 0])], "w"), ["free_rotation_axis"]),
    "unknown robot": (lambda: rrtik.load_robot("pand"), ["pand", "did you mean 'panda'"]),
    "unknown parameter of a robot": (
        lambda: rrtik.load_robot("titan4", parameters={"limit": "envelope"}),
        ["limit", "limits"],
    ),
    "fk of two joints": (lambda: robot().fk([0, 0]), ["3 joints"]),
    "unknown frame": (lambda: robot().fk([0, 0, 0], "claw"), ["claw"]),
    "unknown posture": (lambda: robot().posture("stowed"), ["stowed"]),
    "None as problem": (lambda: rrtik.load_problem(None), ["name of a file", "None"]),
    "a number as scene": (lambda: rrtik.load_scene(3), ["name of a file", "3"]),
    "a list as file to write": (lambda: rrtik.Scene().save(["a"]), ["name of a file", "list"]),
    "unknown planner": (lambda: rrtik.plan(small(), "RRTConect"), ["RRTConect", "RRTConnect"]),
    "no time to plan": (lambda: rrtik.plan(small(), seconds=-1), ["seconds"]),
    "seed is text": (lambda: rrtik.plan(small(), seed="one"), ["seed"]),
    "unknown shortener": (lambda: rrtik.shorten(rrtik.plan(small(), seed=1).path, small(), method="magic"), ["magic"]),
    "shortening no path": (lambda: rrtik.shorten(None, small()), ["path to shorten", "JointPath", "NoneType"]),
    "planning a file name": (lambda: rrtik.plan("titan4_sdu"), ["problem", "str", "load_problem"]),
    "a number as planner": (lambda: rrtik.plan(small(), 3), ["planner", "int", "list_planners"]),
    "a name as robot": (lambda: rrtik.World("panda"), ["robot of a world", "str", "load_robot"]),
    "a file as scene": (lambda: rrtik.World(robot(), "scene.yaml"), ["scene of a world", "load_scene"]),
    "scene of shapes": (lambda: rrtik.Scene([Sphere(1)]), ["each obstacle", "Obstacle", "Sphere"]),
    "three names that may touch": (lambda: rrtik.Scene([], [], [("a", "b", "c")]), ["allowed_collisions", "pairs"]),
    "obstacle of text": (lambda: rrtik.Obstacle("a", "box"), ["shape of 'a'", "Sphere, Cylinder", "str"]),
    "obstacle at no place": (lambda: rrtik.Obstacle("a", Sphere(1), [1, 2]), ["pose of 'a'", "SE3", "not 2 numbers"]),
    "obstacle without name": (lambda: rrtik.Obstacle(None, Sphere(1)), ["name", "str", "NoneType"]),
    "motion of numbers": (lambda: rrtik.Obstacle("a", Sphere(1), motion=[1, 0, 0]), ["motion of 'a'", "TimedPoses"]),
    "path checked in a robot": (lambda: rrtik.JointPath([[0, 0, 0]]).violations(robot()), ["world", "Robot"]),
    "path read for a name": (lambda: rrtik.JointPath.load("a.json", "titan4"), ["robot of a path", "load_robot"]),
    "robot of no name": (lambda: rrtik.load_robot(None), ["name of a file", "None"]),
    "fk_batch of two joints": (lambda: robot().fk_batch(np.zeros((4, 2))), ["shape (m, 3)", "(4, 2)"]),
    "reaching with two joints": (lambda: small().reached([0, 0]), ["3 joints"]),
    "path of nothing": (lambda: rrtik.JointPath([]), ["path waypoints"]),
    "path with NaN": (lambda: rrtik.JointPath([[0, NAN]]), ["path waypoints", "finite"]),
    "path of text": (lambda: rrtik.JointPath("path"), ["path waypoints"]),
    "saving to a folder that is not there": (lambda: rrtik.Scene().save("/no/s.yaml"), ["/no/s.yaml"]),
}  # fmt: skip


@pytest.mark.parametrize(("call", "fragments"), API.values(), ids=API)
def test_the_api_raises_one_line_of_ours(call, fragments):
    with pytest.raises(RrtikError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    assert [part for part in fragments if part not in message] == [], message


def test_the_table_is_long_enough():
    assert len(COMMAND_LINE) + len(API) >= 60


def test_letters_that_steer_a_terminal_are_spelt_out_in_every_line(capsys):
    assert run(["plan", "planar3_a", "--proof", "\x1b[2J"]) == 2
    said = capsys.readouterr().err
    assert "\\x1b[2J" in said
    assert said.rstrip("\n").isprintable()
