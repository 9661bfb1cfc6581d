"""Motions in files of other programs: each kind is read, and what cannot be meant is refused in one line."""

import json

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, PathWarning

ROWS = [[0.0, 0.0, 0.0], [0.5, 0.2, 0.1], [1.0, 0.0, 0.0]]
NAMES = ["joint1", "joint2", "joint3"]
ARM = """<robot name="arm"><link name="base"/>{}</robot>"""
PART = """<link name="l{0}"><collision><geometry><box size="0.2 0.02 0.02"/></geometry></collision></link>
<joint name="j{0}" type="revolute"><parent link="{1}"/><child link="l{0}"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>"""


@pytest.fixture(scope="module")
def robot():
    return rrtik.load_robot("planar3")


def message(rows=ROWS, names=NAMES, times=(0.0, 0.5, 1.0), **more):
    points = [
        {"positions": list(row), "time_from_start": {"sec": int(t), "nanosec": round(1e9 * (t % 1.0))}}
        for row, t in zip(rows, times, strict=False)
    ]
    for key, values in more.items():
        for point, value in zip(points, values, strict=True):
            point[key] = list(value)
    return {"header": {"frame_id": ""}, "joint_names": list(names), "points": points}


def robot_trajectory(**more):
    return {"joint_trajectory": message(**more), "multi_dof_joint_trajectory": {"joint_names": [], "points": []}}


def written(value):
    return lambda file: file.write_text(value if isinstance(value, str) else json.dumps(value))


def arrays(**values):
    return lambda file: np.savez(file, **values)


ALIASES = "a0: &a0 [1, 1]\n" + "\n".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 11))
ECHO = "joint_names: [joint1, joint2, joint3]\npoints:\n" + "".join(
    f"- positions: [{a}, {b}, 1e-17]\n  velocities: []\n  time_from_start: {{sec: {k}, nanosec: 0}}\n"
    for k, (a, b, _) in enumerate(ROWS)
)
# What a file is called, what makes it, and how many motions it has.
FILES = {
    "JointTrajectory": ("a.json", written(message()), 1),
    "RobotTrajectory": ("a.json", written(robot_trajectory()), 1),
    "DisplayTrajectory": ("a.json", written({"trajectory": [robot_trajectory()] * 2, "trajectory_start": {}}), 2),
    "a response": ("a.json", written({"motion_plan_response": {"trajectory": robot_trajectory()}}), 1),
    "a list": ("a.json", written([message(), robot_trajectory()]), 2),
    "ros2 topic echo": ("a.yaml", written(f"{ECHO}---\n{ECHO}"), 2),
    "our message": ("a.yaml", lambda file: motion().save(file), 1),
    "our trajectory": ("a.json", lambda file: motion().save(file), 1),
    "our table": ("a.csv", lambda file: motion().save(file), 1),
    "our path": ("a.json", lambda file: rrtik.JointPath(ROWS, NAMES).save(file), 1),
    "OMPL's matrix": ("a.txt", lambda file: rrtik.JointPath(ROWS, NAMES).save(file), 1),
    "a table": ("a.csv", written("joint3,joint1,joint2\n0,0,0\n0.1,0.5,0.2\n0,1,0\n"), 1),
    "a timed table": ("a.csv", written("t,joint1,joint2,joint3\n0,0,0,0\n1,0.5,0.2,0.1\n3,1,0,0\n"), 1),
    "a table of LeRobot": (
        "a.csv",
        written("timestamp,action.joint1.pos,action.joint2.pos,action.joint3.pos\n0,0,0,0\n1,.5,.2,.1\n2,1,0,0\n"),
        1,
    ),
    "an array": ("a.npy", lambda file: np.save(file, ROWS), 1),
    "rows": ("a.json", written(ROWS), 1),
    "MPlib": ("a.npz", arrays(position=ROWS, velocity=np.zeros((3, 3)), time=[0.0, 0.1, 0.2]), 1),
    "cuRobo": ("a.npz", arrays(position=np.array([ROWS]), dt=0.02, joint_names=NAMES), 1),
    "roboplan": ("a.npz", arrays(joint_names=NAMES, times=[0, 1, 2], positions=ROWS, velocities=ROWS), 1),
    "LeRobot": (
        "a.npz",
        lambda file: np.savez(file, **{"action": np.array(ROWS, np.float32), "observation.state": np.array(ROWS)}),
        2,
    ),
}


def motion():
    return rrtik.time_parameterize(rrtik.JointPath(ROWS, NAMES), rrtik.RateLimits(1.0, 4.0, 40.0))


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.filterwarnings("ignore:.*sorted by name")
def test_each_kind_of_file_is_read(kind, robot, tmp_path):
    name, write, count = FILES[kind]
    write(tmp_path / name)
    found = rrtik.load_motions(tmp_path / name, robot)
    assert len(found) == count
    for each in found:
        rows = each.waypoints if isinstance(each, rrtik.JointPath) else each.positions
        assert np.allclose(rows[[0, -1]], [ROWS[0], ROWS[-1]], atol=1e-7)
        assert rrtik.prove(rrtik.World(robot), each).proven


def test_what_is_between_the_points_is_what_the_message_has(robot, tmp_path):
    rows = np.array(ROWS)
    (tmp_path / "a.json").write_text(json.dumps(message(velocities=rows, accelerations=[*rows[:2], []])))
    (found,) = rrtik.load_motions(tmp_path / "a.json", robot)
    assert np.allclose(found.times, [0.0, 0.5, 1.0])
    assert np.isnan(found.accelerations[2]).all()
    world = rrtik.World(robot)
    assert rrtik.prove(world, found).curve == "cubics and quintics"
    assert rrtik.prove(world, found, between="lines").curve == "lines"
    with pytest.raises(InputError, match="quintics between points need accelerations"):
        rrtik.prove(world, rrtik.ReceivedMotion("a", rows, found.times, rows), between="quintics")


def test_degrees_are_converted_if_they_are_said_to_be(robot, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(message(np.rad2deg(ROWS), velocities=np.rad2deg(ROWS))))
    (found,) = rrtik.load_motions(tmp_path / "a.json", robot, degrees=True)
    assert np.allclose(found.positions, ROWS)
    assert np.allclose(found.velocities, ROWS)


def test_columns_in_another_order_are_sorted_by_name_and_it_is_said(robot, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(message(np.array(ROWS)[:, ::-1], NAMES[::-1])))
    with pytest.warns(PathWarning, match=r"a\.json.*sorted by name"):
        (found,) = rrtik.load_motions(tmp_path / "a.json", robot)
    assert np.allclose(found.positions, ROWS)


def test_joints_that_the_robot_holds_may_be_there_if_they_stand_where_it_holds_them(tmp_path):
    (tmp_path / "arm.urdf").write_text(
        ARM.format("".join(PART.format(k, f"l{k - 1}" if k else "base") for k in range(3)))
    )
    arm = rrtik.load_robot(tmp_path / "arm.urdf", tip="l2", joints=["j0", "j1"], locked={"j2": 0.5})
    file = tmp_path / "a.json"
    rows = np.array([[0.5, 0.0, 0.1], [0.5, 0.3, 0.2], [0.5, 0.3, 0.4]])
    file.write_text(json.dumps(message(rows, ["j2", "j0", "j1"])))
    (found,) = rrtik.load_motions(file, arm)
    assert np.array_equal(found.positions, rows[:, 1:])

    file.write_text(json.dumps(message(rows + np.array([0.1, 0.0, 0.0]), ["j2", "j0", "j1"])))
    with pytest.raises(InputError, match=r"'j2' stands at 0.6, .* holds it at 0.5: .*locked="):
        rrtik.load_motions(file, arm)
    file.write_text(json.dumps(message(rows, ["j1", "j2", "j0"])))
    with pytest.raises(InputError, match="'j2' moves, and robot 'arm' holds it"):
        rrtik.load_motions(file, arm)


def cut_short():
    return ECHO.replace("1e-17]", "'...']", 1)


BAD = {
    "degrees": (message([[0.0] * 3, [90.0, 45.0, 0.0], [0.0] * 3]), "point 2: joint 'joint1' is at 90.*--degrees"),
    "times that go back": (message(times=(0.0, 1.0, 0.5)), "point 3: its time 0.5 s is not after"),
    "NaN": (message([[0.0, np.nan, 0.0]] * 3), "finite"),
    "another robot": (message(names=["a", "b", "c"]), "no values of joint1, joint2, joint3.*another robot's"),
    "one joint too few": (message(np.zeros((3, 2)), NAMES[:2]), "no values of joint3"),
    "one joint too many": (message(np.zeros((3, 4)), [*NAMES, "d"]), "'d' is no joint of robot 'planar3'"),
    "a name twice": (message(names=["joint1", "joint2", "joint2"]), "2 different ones"),
    "too few names": (message(names=NAMES[:2]), "2 joint names.*3 columns"),
    "rows of different lengths": (message([[0.0, 0.0], [0.0] * 3, [0.0] * 3]), "all of the same length"),
    "no positions": ({"joint_names": NAMES, "points": [{"time_from_start": 0.0}]}, "point 1: no positions"),
    "no times": ({"joint_names": NAMES, "points": [{"positions": [0, 0, 0]}] * 2}, "point 1: no time_from_start"),
    "velocities of another shape": (
        message(velocities=[[0.0, 1.0]] * 3),
        r"velocities of a motion: expected shape \(3, 3\)",
    ),
    "a moving base": (
        {"joint_trajectory": message(), "multi_dof_joint_trajectory": {"joint_names": ["b"], "points": [{}]}},
        "moves a base",
    ),
    "nothing": ({}, "holds no motion"),
    "deep": ([[[[[[[[[[[[[[[[[[[[[[[{}]]]]]]]]]]]]]]]]]]]]]]], "nested too deeply"),
    "columns without names": ({"position": np.zeros((2, 6)).tolist()}, "6 columns, and robot 'planar3' 3 joints"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_meant_is_refused_in_one_line(case, robot, tmp_path):
    document, words = BAD[case]
    (tmp_path / "a.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=rf"^[^\n]*a\.json: [^\n]*{words}"):
        rrtik.load_motions(tmp_path / "a.json", robot)


def test_other_files_are_refused_in_one_line(robot, tmp_path):
    for name, content, words in (
        ("a.yaml", cut_short(), "--full-length"),
        ("a.yaml", "a: [", "not YAML"),
        ("a.yaml", ALIASES, "aliases"),
        ("a.yaml", "joint_names: [a]\npoints: &points [*points]", "aliases"),
        ("a.csv", "0,0,0\n1,0,0\n", "names of the joints"),
        ("a.npy", "no array", "not a whole .npy"),
        ("a.npz", "no array", "not a whole .npz"),
        ("a.pt", "", "unknown ending"),
    ):
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError, match=rf"^[^\n]*{name}: [^\n]*{words}"):
            rrtik.load_motions(tmp_path / name, robot)


def test_the_way_to_a_first_point_that_is_late_is_said_not_to_be_judged(robot, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(message(times=(0.5, 1.0, 2.0))))
    with pytest.warns(PathWarning, match="begins at 0.5 s"):
        (found,) = rrtik.load_motions(tmp_path / "a.json", robot)
    assert found.times[0] == 0.0


def test_a_bag_is_read(robot, tmp_path):
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    header = kinds["Header"](kinds["Time"](0, 0), "")
    none = np.empty(0)
    points = [
        kinds["JointTrajectoryPoint"](np.array(row), none, none, none, kinds["Duration"](k, 0))
        for k, row in enumerate(ROWS)
    ]
    states = [kinds["JointState"](header, NAMES[::-1], np.array(row[::-1]), none, none) for row in ROWS]
    given = {"JointTrajectory": [kinds["JointTrajectory"](header, NAMES, points)], "JointState": states}
    for name, messages in given.items():
        with Writer(tmp_path / name, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            kind = messages[0].__msgtype__
            connection = writer.add_connection("/topic", kind, typestore=store)
            for k, each in enumerate(messages):
                writer.write(connection, int(1e9 * k), store.serialize_cdr(each, kind))
        (found,) = rrtik.load_motions(tmp_path / name, robot)
        assert np.allclose(found.positions, ROWS)
        assert np.allclose(found.times, [0.0, 1.0, 2.0])


def test_a_table_of_lerobot_has_a_motion_for_each_episode_in_degrees(robot, tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "data" / "chunk-000" / "file-000.parquet"
    file.parent.mkdir(parents=True)
    (tmp_path / "meta").mkdir()
    motors = [*(f"{name}.pos" for name in NAMES[::-1]), "gripper.pos"]
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": {"action": {"names": motors}}}))
    rows = np.rad2deg(ROWS)[:2, ::-1] * 2.0
    action = np.column_stack([rows, [30.0, 100.0]]).tolist() * 2
    columns = {"action": action, "timestamp": [0.0, 0.5, 0.0, 0.5], "episode_index": [0, 0, 1, 1]}
    pq.write_table(pa.table(columns), file)

    with pytest.warns(PathWarning, match=r"'gripper' is left out|another order"):
        first, second = rrtik.load_motions(file, robot, degrees=True)
    assert np.allclose(first.positions, 2.0 * np.array(ROWS)[:2], atol=1e-12)
    assert np.array_equal(first.positions, second.positions)
    assert np.array_equal(first.times, [0.0, 0.5])
    assert "episode 1" in second.name
    with pytest.warns(PathWarning), pytest.raises(InputError, match=r"file-000\.parquet: episode 0.*degrees=True"):
        rrtik.load_motions(file, robot)

    file.write_bytes(b"PAR1 and no more")
    with pytest.raises(InputError, match=r"file-000\.parquet: not Parquet"):
        rrtik.load_motions(file, robot)
    pq.write_table(pa.table({"other": [1.0]}), file)
    with pytest.raises(InputError, match="no column action"):
        rrtik.load_motions(file, robot)
