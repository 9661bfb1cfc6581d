"""Values that make no sense where no file says them: one line of ours, never an error of Python or of a library."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.planning.moves.rules import MoveRules
from rrtik_ompl.world.moving_world import MovingWorld


def world():
    return rrtik.World(
        rrtik.load_robot("planar3"), rrtik.Scene([rrtik.Obstacle("far", rrtik.Sphere(0.1), rrtik.pose([9, 9, 9]))])
    )


def small():
    return rrtik.Problem(world(), [0, 0, 0], [0.5, 0, 0])


def inflated(metres):
    MovingWorld(world()).move(world().scene, inflation={"far": metres})


def straight():
    return rrtik.JointPath.of(small().robot, [[0, 0, 0], [0.5, 0, 0]])


def region(**options):
    return rrtik.TaskRegion(rrtik.pose([1, 0, 0]), np.zeros((6, 2)), **options)


NAN = float("nan")
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
OMPL_OPTIONS = {
    "KPIECE1": {"border_fraction": 2.0},
    "FMT": {"free_space_volume": -1.0},
    "BFMT": {"radius_multiplier": 0.0},
    "BITstar": {"prune_threshold_fraction": -1.0},
}
CASES = {
    "resolution below 0": (lambda: world().with_resolution(-1), "motion_resolution must be 1e-05 metres or more"),
    "steps of NaN": (lambda: world().steps([NAN, 0, 0], [0, 0, 0]), "finite"),
    "steps of size 0": (lambda: world().steps([0, 0, 0], [1, 0, 0], 0.0), "resolution: must be greater than 0"),
    "frame of a number": (lambda: small().robot.fk([0, 0, 0], 5), "frame of robot 'planar3' must be of type str"),
    "parameters in a list": (lambda: rrtik.plan(small(), parameters=["range"]), "parameters of a planner"),
    "many of nothing": (lambda: rrtik.plan_many(None), "expected a list of problems"),
    "many with a list": (lambda: rrtik.plan_many(["planar3_boxes"], parameters=[1]), "parameters of a planner"),
    "planner that makes nothing": (lambda: rrtik.plan(small(), lambda si: None), "type Planner, got NoneType"),
    "rules in a list": (lambda: rrtik.shorten(straight(), small(), rules=["joint1"]), "rules.*MoveRules"),
    "half a vertex": (lambda: rrtik.Mesh(CORNERS, [[0, 1.5, 2]]), "whole, got 1.5"),
    "scale of a mesh": (lambda: rrtik.Mesh(CORNERS, [[0, 1, 2]], scale=NAN), "scale"),
    "escape in a name": (lambda: rrtik.Obstacle("a\x1b]0;b\x07", rrtik.Sphere(1)), r"a\\x1b\]0;b\\x07"),
    "half a letter in a name": (lambda: rrtik.JointPath([[0.0]], ["\ud800"]), r"\\ud800"),
    "number as a name": (lambda: rrtik.JointPath([[0.0]], [3]), "name of a joint of a path"),
    "unequal rows as a pose": (lambda: rrtik.PoseGoal([[1, 2], [3]]), "goal pose: expected numbers"),
    "unequal rows as an obstacle's pose": (lambda: rrtik.Obstacle("a", rrtik.Sphere(1), [[1], [2, 3]]), "pose of 'a'"),
    "unequal rows as configurations": (lambda: region().errors(small().robot, [[0, 0, 0], [1]]), "expected numbers"),
    "errors of no robot": (lambda: region().errors(None, [0, 0, 0]), "robot of a goal must be of type Robot"),
    "distance of a goal to nothing": (lambda: region().distance(small().robot, None), "expected shape"),
    "displacements that are none": (lambda: region().poses([1, 2]), "displacements in a region"),
    "nearest to no pose": (lambda: region().nearest(np.eye(4)), "poses of the tip: expected shape"),
    "draws of no generator": (lambda: region().drawn(3, 1), "rng of a region must be of type Generator"),
    "half a letter in a frame": (lambda: region(frame="\ud800"), r"frame of a region: '\\ud800'"),
    "half a letter in a frame asked for": (lambda: small().robot.fk([0, 0, 0], "\ud800"), r"no frame.*\\ud800"),
    "half a letter in a tip": (lambda: rrtik.load_robot("ur5", tip="\ud800"), r"tip of robot 'ur5': '\\ud800'"),
    "half a letter in a link": (lambda: rrtik.AttachedObject("a", "\ud800", rrtik.Sphere(1)), r"the link of 'a': "),
    "from_start of a number": (lambda: region(from_start=2), "from_start of a region must be of type bool"),
    "route of nothing": (lambda: MoveRules(["a"]).kept_by(None), "route: expected"),
    "route of no row": (lambda: MoveRules(["a"]).kept_by(np.zeros((0, 1))), "route: needs at least one row"),
    "route of other joints": (lambda: MoveRules(["a"]).kept_by([[0.0, 1.0]]), "route: expected an array of shape"),
    "head of no route": (lambda: MoveRules(["a"]).head([0.0]), "route: expected an array of shape"),
    "numbers as names of joints": (lambda: MoveRules([[1.0]]), "name of a joint must be of type str"),
    "inflation of NaN": (lambda: inflated(NAN), "inflation: that of 'far'"),
    "inflation without end": (lambda: inflated(np.inf), "inflation"),
} | {
    f"option of {name}": (
        lambda name=name, given=given: rrtik.plan(small(), name, parameters=given),
        f"planner {name}.*cannot be",
    )
    for name, given in OMPL_OPTIONS.items()
}  # fmt: skip


OF_OMPL = ("planner that makes nothing", *(case for case in CASES if case.startswith("option of ")))


@pytest.mark.parametrize("case", CASES)
def test_it_is_refused_in_one_line(case):
    if case in OF_OMPL:
        pytest.importorskip("ompl", reason="no OMPL")
    call, message = CASES[case]
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert str(caught.value).isprintable()


def test_steps_are_a_whole_number_that_grows_with_the_motion():
    counts = [world().steps([0, 0, 0], [share, 0, 0]) for share in (0.1, 0.2, 0.4)]
    assert 1 < counts[0] < counts[1] < counts[2]


def test_no_message_moves_the_cursor_of_a_terminal():
    assert str(RrtikError("a\x1b[2Jb\nc\ud800")) == "a\\x1b[2Jb c\\ud800"


def test_names_that_matplotlib_would_read_as_formulas_are_drawn(tmp_path):
    names = [r"$\frac$", "_hidden", "$a$"]
    rrtik.plot_joints(rrtik.JointPath([[0, 0, 0], [1, 2, 3]], names), tmp_path / "a.svg")
    drawn = (tmp_path / "a.svg").read_text()
    assert [name for name in names if name not in drawn] == []
