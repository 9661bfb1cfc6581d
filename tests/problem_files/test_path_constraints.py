"""The ``path_constraints:`` section: every kind, writing and reading, errors with file and line."""

import numpy as np
import pytest

from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.problem_files.problem import load_problem

START = "[0.3, -1.2, 1.4, -0.4, 0.6, 0.2]"
HERE = "{xyz: [-0.336, -0.277, 0.378]}"


def load(folder, constraints, goal=START):
    file = folder / "task.yaml"
    text = f"version: 1\nrobot: ur5\nstart: {{joints: {START}}}\ngoal: {{joints: {goal}}}\n"
    file.write_text(f"{text}path_constraints:\n{constraints}")
    return load_problem(file)


ALL = """
- {upright: {axis: x, tolerance_deg: 7}, frame: tool0}
- {on_plane: {point: [0, 0, 0.4], normal: [0, 0, 1], tolerance: 0.5}}
- {on_line: {point: [0, 0, 0.4], direction: [1, 0, 0], tolerance: 0.9}}
- {inside: {pose: {xyz: [0, 0, 0]}, sides: [3, 3, 3]}, frame: wrist_3_link}
- orientation_of: {pose: {xyz: [0, 0, 0]}, tolerances_deg: [180, 70, 180]}
- task_region: {frame: {xyz: [0, 0, 0]}, x: [-2, 2], y: [-2, 2], z: [-2, 2], roll: [-3.2, 3.2], pitch: [-3.2, 3.2],
    yaw: [-3.2, 3.2]}
"""


def test_every_kind_is_read_and_written_back(tmp_path):
    problem = load(tmp_path, ALL.replace("[180, 70, 180]", "[180, 74, 180]"))
    assert [region.frame for region in problem.constraints] == ["tool0", None, None, "wrist_3_link", None, None]
    problem.save(tmp_path / "again.yaml")
    again = load_problem(tmp_path / "again.yaml")
    for one, other in zip(problem.constraints, again.constraints, strict=True):
        np.testing.assert_array_equal(one.bounds, other.bounds)
        np.testing.assert_allclose(one.T_world_w.homogeneous, other.T_world_w.homogeneous, atol=1e-14)
        np.testing.assert_allclose(one.T_w_tip.homogeneous, other.T_w_tip.homogeneous, atol=1e-14)
        assert (one.frame, one.orientation_tolerance) == (other.frame, other.orientation_tolerance)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        ("- {upright: {axis: w}}", r"task.yaml:6: path_constraints\[0\].*axis.*'x', 'y' or 'z'"),
        (
            "- {upright: {}}\n- {uprite: {}}",
            r"task.yaml:7: .*keys upright, .*found .*\(uprite\); did you mean 'upright'",
        ),
        ("- {on_plane: {point: [0, 0, 1]}}", r"task.yaml:6: .*normal.*missing"),
        ("- {on_line: {point: [0, 0, 1], direction: [1, 1, 0]}}", r"task.yaml:6: .*direction must have length 1"),
        ("- {upright: {}, frame: mug}", r"task.yaml:5: path_constraints.*no frame of path constraint 1 'mug'"),
        ("- {upright: {tolerance_deg: 85}}", r"task.yaml:6: .*80 or less, got 85"),
    ],
)
def test_errors_name_file_line_and_key(tmp_path, constraints, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, constraints)


def test_a_start_outside_is_an_error_of_the_start_line(tmp_path):
    with pytest.raises(ProblemError, match=r"task.yaml:3: start.*constraint 1.*mm"):
        load(tmp_path, "- {on_plane: {point: [0, 0, 2], normal: [0, 0, 1]}}")
