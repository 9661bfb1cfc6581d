"""Peers are asked about exactly our problems, and whoever is absent or lost says so."""

import sys

import numpy as np
import pinocchio as pin
import pytest

from rrtik_ompl import JointPath, load_problem, load_robot
from rrtik_ompl.planning.generated_problems import generated_problem


@pytest.mark.parametrize("of_meshes", [False, True])
def test_the_files_that_peers_read_hold_the_same_arm_among_the_same_obstacles(tmp_path, of_meshes):
    from bench.peers.description import task_of
    from bench.peers.libraries.ompl_callback import Checker
    from bench.peers.libraries.pinocchio_model import model_and_geometry

    problem = generated_problem(load_robot("ur5"), "clutter", 0) if of_meshes else load_problem("titan4_sdu")
    model, geometry = model_and_geometry(task_of(problem, tmp_path, 1.0))
    robot, free = problem.robot, Checker(model, geometry, broadphase=False)
    rows = np.random.default_rng(0).uniform(*robot.finite_range(), (100, robot.dof))
    assert [free(q) for q in rows] == problem.world.valid_batch(rows).tolist()
    data = model.createData()
    pin.framesForwardKinematics(model, data, rows[0])
    np.testing.assert_allclose(data.oMf[model.getFrameId("tip")].homogeneous, robot.fk(rows[0]).homogeneous, atol=1e-12)
    np.testing.assert_array_equal(model.lowerPositionLimit, robot.lower)


def test_a_problem_that_not_every_peer_can_read_is_refused(tmp_path):
    from bench.peers.description import NoTask, task_of

    with pytest.raises(NoTask, match=r"titan4_bar: .*one goal"):
        task_of(load_problem("titan4_bar"), tmp_path, 1.0)


def test_a_peer_finds_a_path_in_its_own_process_and_is_started_again_when_lost(tmp_path):
    from bench.peers.description import task_of
    from bench.peers.host import Host

    problem = load_problem("titan4_sdu")
    task = task_of(problem, tmp_path, 10.0)
    with Host("ompl_callback --broadphase", sys.executable) as host:
        assert "ompl " in host.versions
        first = host.ask(task, 1)
        host._process.kill()
        host._process.wait()
        again = host.ask(task, 1)
    assert np.array_equal(first.rows, again.rows)
    assert JointPath.of(problem.robot, first.rows).violations(problem.world) == ()


@pytest.mark.parametrize(
    ("module", "python", "why"),
    [
        ("ompl_callback", "/nowhere/python", "/nowhere/python: No such file"),
        ("nobody", sys.executable, "No module named bench.peers.libraries.nobody"),
    ],
)
def test_an_absent_peer_says_why(module, python, why):
    from bench.peers.host import Host

    with Host(module, python) as host:
        assert why in host.absent
