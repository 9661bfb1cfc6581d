"""Commands to a gripper go with a motion: where the fingers are at any time, and out of every file again."""

import json
import warnings

import numpy as np
import pytest
import yaml

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PathWarning
from rrtik_ompl.model.gripper import GripperEvent

EVENTS = (
    GripperEvent(0.0, ("jaw",), (1.0,)),
    GripperEvent(1.0, ("jaw",), (0.2,), seconds=0.5, width=0.03, effort=4.0),
    GripperEvent(1.25, ("jaw",), (1.0,), seconds=0.1),
    GripperEvent(2.0, ("jaw",), (0.5,)),
)


def moving(events=EVENTS):
    return rrtik.Trajectory([0.0, 1.0, 1.25, 2.0], np.eye(4)[:, :2], np.zeros((4, 2)), gripper=events)


def test_joints_follow_each_command_evenly_from_where_they_are():
    motion = moving()
    clock = np.array([0.5, 1.0, 1.2, 1.3, 1.4, 2.0])
    # Half of the way to 0.2 is done when the next command comes, at 0.6.
    assert motion.gripper_positions(clock).ravel() == pytest.approx([1.0, 1.0, 0.68, 0.8, 1.0, 0.5])
    assert motion.gripper_positions(clock, commanded=True).ravel() == pytest.approx([1.0, 0.2, 0.2, 1.0, 1.0, 0.5])


def test_a_slower_motion_has_its_commands_later():
    slow = moving().slowed(3.0)
    clock = np.linspace(0.0, 2.0, 50)
    assert slow.gripper_positions(3.0 * clock) == pytest.approx(moving().gripper_positions(clock))


@pytest.mark.parametrize("ending", ["json", "csv", "yaml", "ros.json"])
def test_files_give_the_commands_back(tmp_path, ending):
    motion = moving()
    file = tmp_path / f"motion.{ending}"
    beside = None
    if ending in ("yaml", "ros.json"):
        beside = tmp_path / f"gripper.{ending.rpartition('.')[2]}"
    motion.save(file, gripper=beside)
    again = rrtik.Trajectory.load(file, gripper=beside).gripper
    if ending == "csv":  # which has where the joints have been told to go, alone
        again = tuple(GripperEvent(e.time, e.joints, e.positions, seconds=f.seconds, width=f.width, effort=f.effort)
                      for e, f in zip(again, EVENTS, strict=True))  # fmt: skip
    assert again == EVENTS


def test_a_table_keeps_its_arm_columns_beside_those_of_the_gripper(tmp_path):
    robot = rrtik.load_robot("so101")
    rows = np.zeros((2, 5))
    events = [robot.gripper.event(0.0, [1.0]), robot.gripper.event(0.5, [0.2], 0.1)]
    motion = rrtik.Trajectory([0.0, 0.5], rows, rows, joint_names=robot.joint_names, gripper=events)
    motion.save(tmp_path / "motion.csv")
    head = (tmp_path / "motion.csv").read_text().partition("\n")[0]
    assert head.endswith("wrist_roll acceleration,gripper gripper")
    (read,) = rrtik.load_motions(tmp_path / "motion.csv", robot)
    assert (read.positions == motion.positions).all()
    assert [(e.time, e.positions, e.gripper, e.units) for e in read.gripper] == [
        (e.time, e.positions, "gripper", ("rad",)) for e in events
    ]
    with pytest.raises(InputError, match="robot 'ur5' has") as caught:
        rrtik.Trajectory.load(tmp_path / "motion.csv", rrtik.load_robot("ur5"))
    assert "\n" not in str(caught.value)


def test_the_goals_of_the_actions_of_ros_have_the_fields_of_their_definitions(tmp_path):
    moving().save(tmp_path / "motion.yaml", gripper=tmp_path / "gripper.yaml")
    document = yaml.safe_load((tmp_path / "gripper.yaml").read_text())
    told = document["commands"][1]
    # control_msgs/action/GripperCommand and ParallelGripperCommand, whose command is a sensor_msgs/JointState
    assert told["GripperCommand"] == {"command": {"position": 0.2, "max_effort": 4.0}}
    goal = told["ParallelGripperCommand"]["command"]
    assert goal == {"name": ["jaw"], "position": [0.2], "velocity": [1.6], "effort": [4.0]}
    assert told["time_from_start"] == {"sec": 1, "nanosec": 0}


def test_two_joints_have_no_goal_for_one(tmp_path):
    pair = GripperEvent(0.0, ("a", "b"), (0.01, 0.02), units=("m", "m"))
    moving([pair]).save(tmp_path / "motion.ros.json", gripper=tmp_path / "gripper.json")
    (told,) = json.loads((tmp_path / "gripper.json").read_text())["commands"]
    assert "GripperCommand" not in told
    assert rrtik.Trajectory.load(tmp_path / "motion.ros.json", gripper=tmp_path / "gripper.json").gripper == (pair,)


def test_a_message_without_the_commands_says_so(tmp_path):
    with pytest.warns(PathWarning, match=r"no commands to the gripper; .*gripper='gripper.yaml'"):
        moving().save(tmp_path / "motion.yaml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        moving(()).save(tmp_path / "motion.yaml")
    for file, motion in (("motion.json", moving()), ("motion.yaml", moving(()))):
        with pytest.raises(InputError, match="leave gripper= out"):
            motion.save(tmp_path / file, gripper=tmp_path / "gripper.yaml")


def test_mcap_has_the_states_of_the_fingers_and_the_commands(tmp_path):
    reader = pytest.importorskip("mcap.reader")
    motion = moving()
    motion.save(tmp_path / "motion.mcap", rate=10.0)
    with (tmp_path / "motion.mcap").open("rb") as file:
        found = [
            (channel.topic, message.log_time * 1e-9, json.loads(message.data))
            for _, channel, message in reader.make_reader(file).iter_messages()
        ]
    states = [(time, state) for topic, time, state in found if topic == "/joint_states"]
    held = motion.gripper_positions([time for time, _ in states]).ravel()
    assert {len(state[key]) for _, state in states for key in ("name", "position", "velocity", "acceleration")} == {3}
    assert [state["position"][-1] for _, state in states] == pytest.approx(held.tolist())
    told = [(time, state["position"]) for topic, time, state in found if topic == "/gripper_command"]
    assert told == [(event.time, list(event.positions)) for event in EVENTS]
    read = rrtik.Trajectory.load(tmp_path / "motion.mcap")
    assert [(e.time, e.joints, e.positions, e.gripper, e.effort) for e in read.gripper] == [
        (e.time, e.joints, e.positions, e.gripper, e.effort) for e in motion.gripper
    ]


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ([GripperEvent(1.0, ["jaw"], [1.0])], "first at 0 s"),
        ([EVENTS[0], GripperEvent(3.0, ["jaw"], [1.0])], "after the end"),
        ([EVENTS[0], GripperEvent(1.0, ["claw"], [1.0])], "several grippers"),
        ([EVENTS[0], "open"], "each command to the gripper"),
        (7, "commands to the gripper"),
    ],
)
def test_commands_that_do_not_fit_are_refused(events, words):
    with pytest.raises(InputError, match=words) as caught:
        moving(events)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"time": -1.0}, {"time": np.nan}, {"joints": []}, {"joints": [1]}, {"joints": ["a", "a"]}, {"seconds": "long"},
        {"positions": [1.0, 2.0]}, {"positions": ["wide"]}, {"units": ["deg"]}, {"gripper": 3}, {"effort": -1.0},
        {"width": np.inf},
    ],
)  # fmt: skip
def test_a_command_is_checked(wrong):
    with pytest.raises(InputError) as caught:
        GripperEvent(**({"time": 0.0, "joints": ["jaw"], "positions": [1.0]} | wrong))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda told: told["commands"].clear(), "a list of commands"),
        (lambda told: told["commands"][1].pop("positions"), "command 2"),
        (lambda told: told["commands"][1].update(positions=["wide"]), "command 2: positions"),
        (lambda told: told["commands"].insert(0, 5), "command 1"),
        (lambda told: told.update(joint_names="jaw"), "command 1"),
        (lambda told: told["commands"][0].update(time_from_start=None), "command 1"),
    ],
)
def test_a_file_with_commands_that_are_none_is_refused_in_one_line(tmp_path, change, words):
    file = tmp_path / "motion.json"
    moving().save(file)
    document = json.loads(file.read_text())
    change(document["gripper"])
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=words) as caught:
        rrtik.Trajectory.load(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
