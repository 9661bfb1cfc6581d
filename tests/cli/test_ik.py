"""`rrtik ik` as a person uses it: one pose, a problem's goal, files of poses, trajectories, pages, bad input."""

import csv
import io
import json

import numpy as np
import pytest

from rrtik_ompl import JointGoal, load_problem, load_robot
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.poses import pose, pose_from_rpy, quaternion_xyzw
from rrtik_ompl.problem_files.poses import load_poses
from rrtik_tests.command_line import rrtik

Q = np.radians([40.0, 60.0, -120.0, 30.0, 40.0, 20.0])


def asked_pose(robot, q=Q):
    tip = robot.fk(q)
    return ["--position", *tip.translation, "--quat-xyzw", *quaternion_xyzw(tip)]


def test_all_solutions_of_a_pose_are_named_by_their_branch_and_reach_it(capsys):
    robot = load_robot("puma560")
    code, out, _ = rrtik(capsys, "ik", "puma560", *asked_pose(robot), "--all", "--json")
    found = json.loads(out)
    assert (code, found["found"], found["method"]) == (0, True, "closed-form")
    tips = robot.fk_batch(found["solutions"])
    np.testing.assert_allclose(tips, np.repeat(robot.fk(Q).homogeneous[None], len(tips), axis=0), atol=1e-9)
    assert len(tips) == len(set(found["branches"])) > 1
    assert set(" ".join(found["branches"]).split()) <= {"front", "back", "up", "down", "near", "flip"}


def test_the_table_is_in_degrees_and_begins_with_the_solution_near_the_posture_asked_for(capsys):
    robot = load_robot("puma560")
    near = ",".join(f"{value:.3f}" for value in np.degrees(Q) + 1.0)
    code, out, _ = rrtik(capsys, "ik", "puma560", *asked_pose(robot), "--near-deg", near)
    assert code == 0
    assert " joint1    joint2 " in out
    (row,) = [line for line in out.splitlines() if line.strip().startswith("1 ")]
    assert "40.00     60.00   -120.00     30.00     40.00     20.00" in row


def test_roll_pitch_yaw_say_the_same_as_a_quaternion(capsys):
    robot = load_robot("puma560")
    turn = pose_from_rpy([0.4, 0.2, 0.9], np.radians([10.0, 80.0, -30.0]))
    one = rrtik(capsys, "ik", "puma560", "--position", 0.4, 0.2, 0.9, "--rpy-deg", 10, 80, -30, "--json")
    two = rrtik(capsys, "ik", "puma560", "--position", 0.4, 0.2, 0.9, "--quat-xyzw", *quaternion_xyzw(turn), "--json")
    q = [json.loads(out)["solutions"][0] for _, out, _ in (one, two)]
    np.testing.assert_allclose(q[0], q[1], atol=1e-9)
    np.testing.assert_allclose(robot.fk(q[0]).homogeneous, turn.homogeneous, atol=1e-9)


def test_a_pose_out_of_reach_is_exit_1_with_the_reason_and_by_how_much(capsys):
    code, out, err = rrtik(capsys, "ik", "titan4", "--position", 3, 0, 0.1, "--rpy-deg", 0, 90, 0)
    assert (code, out) == (1, "")
    assert "no solution, unreachable: the closest configuration is 1." in err
    code, out, err = rrtik(capsys, "ik", "titan4", "--position", 3, 0, 0.1, "--rpy-deg", 0, 90, 0, "--csv")
    assert code == 1
    assert len(out.splitlines()) == 1
    assert "unreachable" in err


def test_a_problem_brings_robot_obstacles_start_and_goal(capsys):
    problem = load_problem("titan4_sdu")
    assert isinstance(problem.goal, JointGoal)
    code, out, _ = rrtik(capsys, "ik", "--problem", "titan4_sdu")
    assert code == 0
    assert "clearance" in out
    assert "10.00" in out
    blocked = problem.robot.fk(np.radians([0.0, 20.0, -60.0, 40.0, 0.0, 0.0]))
    assert not problem.world.valid(np.radians([0.0, 20.0, -60.0, 40.0, 0.0, 0.0]))
    arguments = ["--position", *blocked.translation, "--quat-xyzw", *quaternion_xyzw(blocked)]
    code, _, err = rrtik(capsys, "ik", "--problem", "titan4_sdu", *arguments)
    assert code == 1
    assert "no solution, collision:" in err
    assert rrtik(capsys, "ik", "titan4", *arguments)[0] == 0


def test_the_same_seed_gives_the_same_answer(capsys):
    asked = ("ik", "panda", "--position", 0.4, 0.2, 0.4, "--method", "genetic", "--json")
    one, two, other = (json.loads(rrtik(capsys, *asked, "--seed", seed)[1])["solutions"] for seed in (3, 3, 4))
    assert one == two
    assert one != other


def poses_csv(path, robot, rows):
    lines = ["x,y,z,qx,qy,qz,qw"]
    for row in rows:
        tip = robot.fk(row)
        lines.append(",".join(str(float(v)) for v in (*tip.translation, *quaternion_xyzw(tip))))
    path.write_text("\n".join(lines))
    return path


def test_a_file_of_poses_is_answered_row_by_row_and_one_without_solution_is_exit_1(capsys, tmp_path):
    robot = load_robot("puma560")
    file = poses_csv(tmp_path / "poses.csv", robot, [Q, Q + 0.05])
    code, out, _ = rrtik(capsys, "ik", "puma560", "--poses", file, "--json")
    found = json.loads(out)
    assert (code, found["found"]) == (0, [True, True])
    np.testing.assert_allclose(robot.fk(found["solutions"][1]).homogeneous, robot.fk(Q + 0.05).homogeneous, atol=1e-8)
    file.write_text(file.read_text() + "\n9,0,0,0,0,0,1\n")
    code, out, _ = rrtik(capsys, "ik", "puma560", "--poses", file, "--csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert code == 1
    assert [row["no solution"] for row in rows] == ["", "", "unreachable"]
    assert float(rows[0]["off [mm]"]) < 1e-6
    assert rows[2]["joint1 [deg]"] == ""
    out = rrtik(capsys, "ik", "puma560", "--poses", file)[1]
    assert "2 of 3 poses solved, off by at most 0 mm and 0 deg; no. 3: the closest configuration is 8." in out
    told = json.loads(rrtik(capsys, "ik", "puma560", "--poses", file, "--json")[1])
    assert [bool(detail) for detail in told["details"]] == [False, False, True]
    followed = json.loads(rrtik(capsys, "ik", "puma560", "--poses", file, "--trajectory", "--json")[1])
    assert followed["details"][2].startswith("the closest configuration is 8.")


def test_a_trajectory_is_followed_without_jumps_and_played_in_a_page(capsys, tmp_path):
    robot = load_robot("puma560")
    rows = Q + np.linspace(0.0, 0.4, 9)[:, None]
    file, page = poses_csv(tmp_path / "poses.csv", robot, rows), tmp_path / "way.html"
    code, out, _ = rrtik(capsys, "ik", "puma560", "--poses", file, "--trajectory", "--html", page)
    assert code == 0
    assert "9 of 9 poses solved, 0 jumps, closed-form" in out
    assert "trajectory of 9 points" in page.read_text()


def test_points_in_yaml_are_reached_with_any_orientation(capsys, tmp_path):
    file = tmp_path / "points.yaml"
    file.write_text("points: [[0.4, 0.2, 0.9], [0.4, 0.3, 0.9]]")
    code, out, _ = rrtik(capsys, "ik", "puma560", "--poses", file, "--json")
    tips = load_robot("puma560").fk_batch(json.loads(out)["solutions"])[:, :3, 3]
    assert code == 0
    np.testing.assert_allclose(tips, [[0.4, 0.2, 0.9], [0.4, 0.3, 0.9]], atol=1e-3)


def test_solutions_that_differ_by_full_turns_are_listed_once_and_counted(capsys):
    asked = ("ik", "ur5", "--position", 0.4, 0.2, 0.5, "--rpy-deg", 180, 0, 0, "--all", "--seconds", 30)
    found = json.loads(rrtik(capsys, *asked, "--json")[1])
    q, robot = np.array(found["solutions"]), load_robot("ur5")
    assert len(q) == 8
    apart = np.abs(np.exp(1j * q[:, None]) - np.exp(1j * q)).max(axis=2)
    assert (apart[~np.eye(8, dtype=bool)] > 0.1).all()
    # Five joints have room for two turns and the elbow for one: of 2 ** 5 ways the one nearest to the middle is listed.
    np.testing.assert_allclose(robot.upper - robot.lower, np.radians([720.0, 720.0, 360.0, 720.0, 720.0, 720.0]))
    assert (np.abs(q) <= np.pi).all()
    assert found["by_full_turns"] == [31] * 8
    out = rrtik(capsys, *asked)[1]
    assert "8 solutions and 248 more by full turns of joints" in out
    assert [line.split()[-1] for line in out.splitlines()[6:14]] == ["+31"] * 8
    rows = list(csv.DictReader(io.StringIO(rrtik(capsys, *asked, "--csv")[1])))
    assert [row["note"].split(", ") for row in rows] == [[name, "31 more by full turns"] for name in found["branches"]]


def test_full_turns_count_only_where_they_fit_the_limits(capsys):
    robot = load_robot("puma560")  # of its joints the last alone has room for more than a turn: 266 deg to either side
    for last, more in ((20.0, 0), (120.0, 1), (-266.0, 1)):
        q = np.radians([40.0, 60.0, -120.0, 30.0, 40.0, last])
        near = ",".join(map(str, np.degrees(q)))
        found = json.loads(rrtik(capsys, "ik", "puma560", *asked_pose(robot, q), "--near-deg", near, "--json")[1])
        assert found["by_full_turns"] == [more]
    found = json.loads(rrtik(capsys, "ik", "kinova", "--position", 0.3, 0.1, 0.4, "--json")[1])
    assert found["by_full_turns"] == [0]  # what turns without limits is not counted


def test_a_page_shows_every_solution_as_a_ghost_and_plans_to_one(capsys, tmp_path):
    page = tmp_path / "ik.html"
    code, out, _ = rrtik(capsys, "ik", "puma560", *asked_pose(load_robot("puma560")), "--all", "--html", page)
    assert code == 0
    assert f"wrote {page}" in out
    text = page.read_text()
    story = json.loads(text.split('id="story"', 1)[1].split(">", 1)[1].split("</script>", 1)[0])
    assert [ghost["name"] for ghost in story["ghosts"]][:2] == ["solution 1", "solution 2"]
    assert story["goal_ghost"] in [ghost["q"] for ghost in story["ghosts"]]
    np.testing.assert_allclose(story["plan"]["goal"], story["goal_ghost"], atol=1e-8)


def test_the_page_of_one_solution_plans_to_it(capsys, tmp_path):
    page = tmp_path / "ik.html"
    asked = rrtik(capsys, "ik", "titan4", "--position", 1.2, 0.3, 0.2, "--html", page)
    found = json.loads(rrtik(capsys, "ik", "titan4", "--position", 1.2, 0.3, 0.2, "--json")[1])
    story = json.loads(page.read_text().split('id="story"', 1)[1].split(">", 1)[1].split("</script>", 1)[0])
    assert asked[0] == 0
    np.testing.assert_allclose(story["plan"]["goal"], found["solutions"][0], atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give a robot, or --problem NAME"),
        (["puma560"], "give --position X Y Z"),
        (["pumma560", "--position", 1, 0, 0], "did you mean 'puma560'"),
        (["puma560", "--position", 1, 0, "nan"], "finite"),
        (["puma560", "--position", 1, 0, 0, "--quat-xyzw", 0, 0, 0, 2], "must have length 1, but has 2"),
        (["puma560", "--position", 1, 0, 0, "--quat-xyzw", 0, 0, 0, 1, "--rpy-deg", 0, 0, 0], "not both"),
        (["puma560", "--position", 1, 0, 0, "--near-deg", "1,2"], "has 6 joints"),
        (["puma560", "--position", 1, 0, 0, "--near-deg", "1,b"], "numbers with commas"),
        (["puma560", "--position", 1, 0, 0, "--near", "reddy"], "did you mean 'ready'"),
        (["puma560", "--position", 1, 0, 0, "--method", "fabrick"], "did you mean 'fabrik'"),
        (["panda", "--position", 0.4, 0, 0.4, "--method", "closed-form"], "brings no closed form; what fits: numeric"),
        (["puma560", "--position", 1, 0, 0, "--seed", -1], "neither a whole number of at least 0 nor"),
        (["puma560", "--position", 1, 0, 0, "--seconds", -1], "seconds must not be negative"),
        (
            ["puma560", "--position", 1, 0, 0, "--position-tolerance", -1],
            "tolerance: must be greater than 0, got -1",
        ),
        (
            ["puma560", "--position", 1, 0, 0, "--orientation-tolerance-deg", 1],
            "tolerance-deg is of an orientation",
        ),
        (["puma560", "--poses", "points.csv", "--orientation-tolerance-deg", 1], "a point has none: leave it out"),
        (["--problem", "puma_pose", "--position-tolerance", 1], "has tolerances of its own"),
        (["puma560", "--position", 1, 0, 0, "--trajectory"], "give --poses FILE too"),
        (["puma560", "--position", 1, 0, 0, "--poses", "x.csv"], "brings its own poses"),
        (["puma560", "--problem", "titan4_sdu"], "one of the two"),
        (["puma560", "--position", 1, 0, 0, "--json", "--csv"], "not both"),
        (["puma560", "--poses", "none.csv"], "none.csv: no such file"),
        (["puma560", "--position", 1, 0, 0, "--html", "page.pdf"], "unknown ending '.pdf'"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text("x,y,z\n0.4,0.2,0.9\n")
    code, out, err = rrtik(capsys, "ik", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "", "expected a line of column names"),
        ("a.csv", "x,y,z,qx\n1,2,3,4\n", "got x, y, z, qx"),
        ("a.csv", "x,y,z\n", "column names only"),
        ("a.csv", "x,y,z\n1,2\n", "row 2: expected 3 numbers, got 2"),
        ("a.csv", "x,y,z\n1,2,inf\n", "row 2: every number must be finite"),
        ("a.csv", "x,y,z\n1,2,c\n", "row 2: expected numbers, got '1,2,c'"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,3\n", "pose 1: quat_xyzw must have length 1"),
        ("a.json", '{"poses": [{"xyz": [1, 2, 3]}], "points": [[1, 2, 3]]}', "found poses and points"),
        ("a.json", '{"points": [[1, 2]]}', "points[0]"),
        ("a.txt", "1 2 3", "unknown ending '.txt'"),
    ],
)
def test_a_file_of_poses_that_cannot_be_used_is_named_with_the_place(tmp_path, name, text, said):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(InputError) as error:
        load_poses(file)
    assert str(error.value).startswith(str(file))
    assert said in str(error.value)


def test_poses_read_the_same_from_csv_and_json(tmp_path):
    one, two = tmp_path / "a.csv", tmp_path / "b.json"
    one.write_text("x,y,z,roll_deg,pitch_deg,yaw_deg\n1,2,3,10,20,30\n")
    two.write_text('{"poses": [{"xyz": [1, 2, 3], "rpy_deg": [10, 20, 30]}]}')
    wanted = pose_from_rpy([1, 2, 3], np.radians([10, 20, 30])).homogeneous
    for file in (one, two):
        np.testing.assert_allclose(load_poses(file), wanted[None], atol=1e-12)
    assert load_poses(one).shape == (1, 4, 4)
    np.testing.assert_array_equal(pose([1, 2, 3]).translation, load_poses(two)[0, :3, 3])
