"""Certificates on the command line."""

import json

import numpy as np
import pytest

from rrtik_ompl.model.path import JointPath
from rrtik_tests.command_line import rrtik

pytestmark = pytest.mark.kernels
GRAZED = """version: 1
robot: {point2d: {radius: 0.5, bounds: [[0, 26], [0, 20]]}}
scene: {obstacles: [{name: wall, box: [30, 1, 4], pose: {xyz: [13, 10, 0]}}]}
start: {joints: [2, 8.999999995]}
goal: {joints: [20, 8.999999995]}
"""


@pytest.fixture
def files(tmp_path, capsys):
    """A path and its certificate."""
    path, proof = tmp_path / "path.json", tmp_path / "proof.json"
    arguments = ("titan4_prisms", "--seed", "1", "--out", path, "--certificate", proof)
    code, out, err = rrtik(capsys, "plan", *arguments)
    assert (code, err) == (0, "")
    assert out.splitlines()[-2:] == [f"wrote {path}", f"wrote {proof}"]
    return path, proof


def test_a_certificate_that_plan_writes_is_verified_in_one_line(files, capsys):
    code, out, err = rrtik(capsys, "check", "titan4_prisms", files[0], "--certificate", files[1])
    assert (code, err) == (0, "")
    (line,) = out.splitlines()
    assert line.startswith(f"{files[1]}: holds: ")
    assert "10 mm kept from obstacles" in line


def test_a_path_and_its_certificate_in_one_file_are_checked_together(files, tmp_path, capsys):
    both = tmp_path / "both.json"
    code, out, err = rrtik(capsys, "plan", "titan4_prisms", "--seed", "1", "--out", both, "--certificate", both)
    assert (code, err) == (0, "")
    assert json.loads(both.read_text())["certificate"] == json.loads(files[1].read_text())
    code, out, _ = rrtik(capsys, "check", "titan4_prisms", both)
    assert (code, out.splitlines()[-1].startswith(f"{both}: holds: ")) == (0, True)
    document = json.loads(both.read_text())
    document["certificate"]["clearance"] = 0.02
    both.write_text(json.dumps(document))
    code, out, _ = rrtik(capsys, "check", "titan4_prisms", both)
    assert (code, f"{both}: does not hold: motion" in out.splitlines()[-1]) == (1, True)


def test_a_certificate_that_does_not_hold_is_refused_with_the_fault(files, capsys):
    path, proof = files
    document = json.loads(proof.read_text())
    number, motion = next((k, motion) for k, motion in enumerate(document["motions"]) if motion)
    row = next(row for row in motion if len(row) > 6)
    row[6:] = [-x for x in row[6:]]
    proof.write_text(json.dumps(document))
    code, out, _ = rrtik(capsys, "check", "titan4_prisms", path, "--certificate", proof)
    assert code == 1
    assert f"does not hold: motion {number + 1}: " in out
    assert len(out.splitlines()) == 1


def test_another_path_and_another_problem_are_refused(files, capsys):
    path, proof = files
    rows = np.array(JointPath.load(path).waypoints)
    rows[1] += 1e-6
    JointPath.load(path).with_waypoints(rows).save(path.with_name("other.json"))
    code, out, _ = rrtik(capsys, "check", "titan4_prisms", path.with_name("other.json"), "--certificate", proof)
    assert (code, "another path" in out) == (1, True)
    code, out, _ = rrtik(capsys, "check", "titan4_sdu", path, "--certificate", proof)
    assert (code, "another scene" in out) == (1, True)


def test_bad_input_is_one_line_and_exit_code_2(files, capsys):
    path, proof = files
    for arguments in ((path, "--certificate", path), (path, "--certificate", "none.json"), ("--certificate", proof)):
        code, out, err = rrtik(capsys, "check", "titan4_prisms", *arguments)
        assert (code, out, len(err.splitlines())) == (2, "", 1)
    code, _, err = rrtik(capsys, "plan", "titan4_prisms", "--certificate", "proof.txt")
    assert (code, "ending" in err) == (2, True)


def test_a_path_that_is_not_proven_gives_no_certificate_and_exit_code_1(tmp_path, capsys):
    (tmp_path / "wall.yaml").write_text(GRAZED)
    proof = tmp_path / "proof.json"
    arguments = (tmp_path / "wall.yaml", "--planner", "RRTConnect", "--seed", "1", "--certificate", proof)
    code, out, err = rrtik(capsys, "plan", *arguments)
    assert (code, proof.exists()) == (1, False)
    assert "no certificate: the path is not proven free" in err
    assert "'wall'" in err
    assert len(err.splitlines()) == 1
    assert "wrote" not in out
