"""Every command fits the terminal: no line that it prints is wider, but for a name of a file, which stays whole."""

import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.cli.app import COMMANDS, run
from rrtik_ompl.cli.markers import markers
from rrtik_ompl.cli.plan_report import waypoints_table

pytestmark = pytest.mark.kernels

FAR = """version: 1
robot: panda
start: {posture: ready}
goal: {pose: {xyz: [2.0, 0, 0.5], rpy_deg: [180, 0, 0]}}
"""
POSES = "x,y,z,qx,qy,qz,qw\n0.4,0.2,0.5,1,0,0,0\n3,0,0,1,0,0,0\n"
SUITE = "version: 1\nproblems: [planar3_a]\nplanners: [bicrdt]\nruns: 1\nseconds: 2.0\n"
TASK = "version: 1\nrobot: ur5\nstart: {posture: up}\ntask: [{move_to: {position: [0.5, 0.1, 0.4]}}]\n"

RANDOM = TASK + "random: {start: {within_deg: 5}}\n"

GOOD = {  # commands that end well, each with an exit code of 0
    "plan": ["plan panda_shelf --seed 1 --out path.json", "plan planar3_a --planner bicrdt --out moves.json"],
    "straight": ["straight titan4_sdu --by 0 0 0.02"],
    "task": ["task task.yaml --out plan.json"],
    "demos": ["demos random.yaml --out demos --count 2 --jobs 1"],
    "check": ["check panda_shelf path.json", "check plan.json", "check replan_planar_arm run.json"],
    "prove": ["prove panda_shelf path.json"],
    "checker": ["checker checker.html"],
    "show": ["show panda_shelf path.json --html page.html", "show plan.json --html page.html"],
    "moves": ["moves moves.json", "moves moves.json --spoken", "moves path.json --problem panda_shelf"],
    "time": ["time panda_shelf path.json --out motion.json"],
    "replan": ["replan replan_planar_arm --record run.json"],
    "ik": [
        "ik ur5 --position 0.4 0.2 0.5 --rpy-deg 180 0 0 --all",
        "ik two_titan4 --position 1.2 0.2 0.3",
        "ik --problem titan4_sdu --all",
    ],
    "reach": ["reach planar3 --samples 2000"],
    "reproduce": ["reproduce --list", "reproduce titan4-size --quick"],
    "bench": ["bench suite.yaml --out bench"],
    "list": ["list", "list problems"],
    "convert": ["convert path.json path.csv"],
    "markers print": ["markers print sheet.pdf", "markers print board.pdf --kind board"],
}
BAD = {  # commands that find nothing, or that are wrong
    "plan": ["plan far.yaml --seconds 1", "plan titan5", "plan panda_shelf --proof perhaps", "plan path.json"],
    "straight": ["straight titan4_sdu --by 1 0 0", "straight titan4_sdu"],
    "task": ["task panda_shelf", "task titan4_sdu"],
    "demos": ["demos titan4_drawer --out drawers", "demos random.yaml --out demos --seed 7"],
    "check": ["check titan4_sdu path.json", "check path.json", "check run.json"],
    "prove": ["prove titan4_sdu path.json", "prove panda_shelf none.npz"],
    "checker": ["checker checker.txt"],
    "show": ["show path.json", "show run.json", "show plan.json path.json", "show panda_shelf far.yaml"],
    "play": ["play path.json"],
    "moves": ["moves path.json"],
    "time": ["time panda_shelf path.json --velocity-deg fast"],
    "replan": ["replan panda_shelf", "replan replan_planar_arm --foreseen --horizon 0.5"],
    "ik": ["ik ur5 --poses poses.csv", "ik ur5 --poses poses.csv --trajectory", "ik ur5 --position 3 0 0", "ik ur5"],
    "reach": ["reach planar4"],
    "overlay": ["overlay none.png planar3_a --camera-file none.yaml --map none.yaml --out out.png"],
    "pilot": ["pilot titan4_sdu", "pilot titan4_sdu --images none"],
    "reproduce": ["reproduce nothing", "reproduce"],
    "bench": ["bench nothing"],
    "list": ["list everything"],
    "warmup": ["warmup everything"],
    "convert": ["convert none.json none.csv"],
    "markers print": ["markers print sheet.pdf --numbers x"],
    "markers calibrate": ["markers calibrate none --out camera.yaml"],
    "markers map": ["markers map none --camera-file none.yaml --out map.yaml"],
    "markers sense": ["markers sense none.png --map none.yaml"],
}
UNTRIED = {  # commands of which no good end is tried, and why
    "play": "serves a page until Ctrl-C",
    "pilot": "serves a page until Ctrl-C",
    "warmup": "compiles for minutes",
    "overlay": "draws photographs; it prints one line",
    "markers calibrate": "needs photographs",
    "markers map": "needs photographs",
    "markers sense": "needs photographs",
}
MARKERS = [f"markers {each.name}" for each in markers.registered_commands]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which files are found."""
    made = tmp_path_factory.mktemp("widths")
    files = {"far.yaml": FAR, "poses.csv": POSES, "suite.yaml": SUITE, "task.yaml": TASK, "random.yaml": RANDOM}
    for name, text in files.items():
        (made / name).write_text(text)
    return made


def printed(capsys, line):
    """Run a command line and return its exit code and all lines that it prints."""
    code = run(line.split())
    said = capsys.readouterr()
    return code, (said.out + said.err).splitlines()


def too_wide(lines, width):
    """Lines that are too wide: a single long word, such as the name of a file, is none."""
    return [line for line in lines if len(line) > width and len(line.split()) > 1]


def test_every_command_is_tried():
    assert GOOD.keys() | UNTRIED.keys() == BAD.keys() | {"list"} == {*COMMANDS, *MARKERS}
    assert not GOOD.keys() & UNTRIED.keys()


@pytest.mark.slow
def test_what_commands_print_fits(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "80")
    for name in dict.fromkeys(("plan", "task", "replan", *GOOD, *BAD)):  # the first write files that others read
        for line, good in [(each, True) for each in GOOD.get(name, ())] + [(each, False) for each in BAD.get(name, ())]:
            code, lines = printed(capsys, line)
            assert code in ((0,) if good else (1, 2)), (line, lines)
            assert lines, line
            assert not too_wide(lines, 80), line


@pytest.mark.parametrize("name", [*COMMANDS, *MARKERS, "markers", ""])
def test_help_fits(name, monkeypatch, capsys):
    for width in (80, 60):
        monkeypatch.setenv("COLUMNS", str(width))
        code, lines = printed(capsys, f"{name} --help")
        assert code == 0
        assert not too_wide(lines, width)


@pytest.mark.parametrize("name", ["panda", "ur5", "two_titan4", "baxter", "kinova", "xarm7", "so101"])
@pytest.mark.parametrize("count", [2, 12])
def test_a_path_of_any_arm_fits_and_shows_every_value(name, count):
    robot = rrtik.load_robot(name)
    rows = [robot.clamp([-1.2345 * k] * robot.dof) for k in range(count)]
    path = rrtik.JointPath.of(robot, rows)
    for width in (60, 80, 167):
        text = waypoints_table(path).fitted(width)
        assert max(map(len, text.splitlines())) <= width
        assert sum(word.replace(".", "").lstrip("-").isdigit() and "." in word for word in text.split()) == (
            count * robot.dof
        )
