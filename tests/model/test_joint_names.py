"""What moves other joints than a robot, or the same in another order, is refused by all that takes both.

What reads files, and what judges the motions of others, sorts those in another order by name, and says so.
"""

import inspect
import re

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PathWarning
from rrtik_ompl.base.lazy import public_values
from rrtik_ompl.description.dh import DhRow, robot_from_dh
from rrtik_ompl.viewer.subject import subject_of

MOTIONS = re.compile(r"\b(JointPath|Trajectory|HasWaypoints|ShownPath|AskedPath)\b")
ROBOTS = re.compile(r"\b(Robot|World|Judge|Problem|Showable|Asked)\b")
NAMES = ("first", "second", "third")
LIMITS = rrtik.RateLimits(1.0, 2.0)


def problem():
    robot = robot_from_dh("arm", [DhRow(a=0.5, joint=name) for name in NAMES], convention="standard", radius=0.02)
    return rrtik.Problem(rrtik.World(robot), [0.1, 0.2, 0.3], [0.4, 0.0, 0.1])


def path(names):
    return rrtik.JointPath([[0.1, 0.2, 0.3], [0.4, 0.0, 0.1]], names)


def motion(names):
    return rrtik.time_parameterize(path(names), LIMITS)


def _of_a_file(names, task, file, write, read):
    write(names).save(file)
    return read(file, task.robot)


TAKERS = {  # what takes a motion and a robot: how it is called
    "JointPath.violations": lambda names, task, file: path(names).violations(task.world),
    "JointPath.proved": lambda names, task, file: path(names).proved(task.world),
    "JointPath.played": lambda names, task, file: path(names).played(task.world),
    "Trajectory.played": lambda names, task, file: motion(names).played(task.world),
    "Trajectory.faults": lambda names, task, file: motion(names).faults(task.world),
    "Trajectory.prove": lambda names, task, file: motion(names).prove(task.world),
    "World.certificate": lambda names, task, file: task.world.certificate(path(names)),
    "one_joint_moves": lambda names, task, file: rrtik.one_joint_moves(path(names), task),
    "shorten": lambda names, task, file: rrtik.shorten(path(names), task),
    "time_parameterize": lambda names, task, file: rrtik.time_parameterize(path(names), task.robot),
    "view": lambda names, task, file: subject_of(task, path(names)),
    "time_parameterize_many": lambda names, task, file: rrtik.time_parameterize_many([path(names)], task.robot),
    "time_parameterize in a world": lambda names, task, file: rrtik.time_parameterize(
        path(names), LIMITS, blend=0.05, world=task.world
    ),
    "film": lambda names, task, file: rrtik.film(
        task, file.with_suffix(".gif"), path(names), rate=5, seconds=0.4, size="160x120"
    ),
    "picture": lambda names, task, file: rrtik.picture(task, file.with_suffix(".png"), path(names), size="160x120"),
    "view of a path before": lambda names, task, file: subject_of(task, path(NAMES), path(names)),
    "view of a trajectory": lambda names, task, file: subject_of(task, motion(names)),
    "JointPath.load": lambda names, task, file: _of_a_file(names, task, file, path, rrtik.JointPath.load),
    "prove": lambda names, task, file: rrtik.prove(task.world, path(names)),
    "prove of a trajectory": lambda names, task, file: rrtik.prove(task.world, motion(names)),
    "Trajectory.save": lambda names, task, file: motion(names).save(file.with_suffix(".yaml"), world=task.world),
    "Trajectory.load": lambda names, task, file: _of_a_file(names, task, file, motion, rrtik.Trajectory.load),
}
SORTERS = {  # the motion that they make of one whose joints are in another order
    "JointPath.load": lambda value: value.waypoints,
    "Trajectory.load": lambda value: value.positions,
    "prove": lambda value: None,
    "prove of a trajectory": lambda value: None,
}
NO_ANSWER_OF_NAMES = {"JointPath.proven_in"}  # asks who made a proof, which came from there


def public():
    """All public functions, and methods of public types' values, by name."""
    for name, value in public_values(rrtik).items():
        if not inspect.isclass(value):
            yield name, value
            continue
        for key, method in vars(value).items():
            if inspect.isfunction(method) and not key.startswith("_"):
                yield f"{name}.{key}", method


def takes_both(name, value):
    """Whether a function takes a motion, or is one of a motion's own, and a robot, or something with one."""
    if not callable(value):
        return False
    try:
        given = [str(each.annotation) for each in inspect.signature(value).parameters.values()]
    except ValueError:  # numbers of the library, such as NewType
        return False
    if name.split(".")[0] in ("JointPath", "Trajectory"):
        given.append("JointPath")
    return any(map(MOTIONS.search, given)) and any(map(ROBOTS.search, given))


def test_the_table_names_all_that_takes_a_motion_and_a_robot():
    found = {name for name, value in public() if takes_both(name, value)} - NO_ANSWER_OF_NAMES
    assert {"JointPath.violations", "shorten", "view"} <= found <= set(TAKERS)


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize("names", [NAMES[::-1], ("first", "second", "other")])
def test_other_names_of_joints_are_refused_in_one_line(taker, names, tmp_path):
    if taker in SORTERS and "other" not in names:
        return
    with pytest.raises(InputError, match=f"moves {', '.join(names)}, .*'arm'.*first") as error:
        TAKERS[taker](names, problem(), tmp_path / "motion.json")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("taker", SORTERS)
def test_another_order_is_sorted_by_name_with_a_warning(taker, tmp_path):
    with pytest.warns(PathWarning, match="sorted by name"):
        found = SORTERS[taker](TAKERS[taker](NAMES[::-1], problem(), tmp_path / "motion.json"))
    if found is not None:
        assert np.array_equal(found[[0, -1]], [[0.3, 0.2, 0.1], [0.1, 0.0, 0.4]])


@pytest.mark.parametrize("taker", TAKERS)
def test_the_names_of_the_robot_are_taken_and_no_names_are_as_good(taker, tmp_path):
    TAKERS[taker](NAMES, problem(), tmp_path / "named.json")
    if taker != "Trajectory.load":  # a message of ROS always names its joints
        TAKERS[taker](None, problem(), tmp_path / "unnamed.json")


def test_columns_in_the_order_of_the_robot_are_what_a_remedy_asks_for():
    order, task = NAMES[::-1], problem()
    columns = [order.index(name) for name in task.robot.joint_names]
    rows = path(order).waypoints[:, columns]
    assert rrtik.JointPath(rows, NAMES).violations(task.world) == ()
    assert np.array_equal(rows[:, 0], path(order).waypoints[:, 2])
