"""Paths saved with what proves them."""

import json
import pickle
import re

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def problem():
    return rrtik.load_problem("planar3_boxes")


@pytest.fixture(scope="module")
def path(problem):
    return rrtik.plan(problem, seed=1).path


def test_a_path_saved_with_its_proof_is_read_as_a_path_and_as_a_certificate(problem, path, tmp_path):
    file = tmp_path / "path.json"
    path.save(file, proof=True)
    again, certificate = rrtik.JointPath.load(file, problem.robot), rrtik.Certificate.load(file)
    assert again.waypoints.tobytes() == path.waypoints.tobytes()
    assert certificate.document() == problem.world.certificate(path, path.proof.clearance).document()
    assert problem.world.verify(certificate, again.waypoints, clearance=0.001) == ""
    path.save(file)
    assert "certificate" not in json.loads(file.read_text())


def test_a_zero_with_a_sign_is_a_zero(problem, tmp_path):
    file = tmp_path / "path.json"
    signed = rrtik.JointPath.of(problem.robot, [[0.0, -0.0, 0.0], [0.1, -0.0, 0.0]])
    assert np.signbit(signed.waypoints[:, 1]).all()
    signed.proved(problem.world).save(file, proof=True)
    again = rrtik.JointPath.load(file, problem.robot)
    assert problem.world.verify(rrtik.Certificate.load(file), again.waypoints) == ""
    assert problem.world.verify(rrtik.Certificate.load(file), signed.waypoints) == ""


def test_a_certificate_may_be_asked_for_waypoints(problem, path):
    of_rows = problem.world.certificate(path.waypoints.tolist(), path.proof.clearance)
    assert of_rows.document() == problem.world.certificate(path, path.proof.clearance).document()


def test_a_path_whose_numbers_are_of_other_joints_is_not_verified(problem, path):
    certificate = problem.world.certificate(path)
    assert problem.world.verify(certificate, path) == ""
    assert problem.world.verify(certificate, rrtik.JointPath(path.waypoints)) == ""
    turned = rrtik.JointPath(path.waypoints, path.joint_names[::-1])
    with pytest.raises(InputError, match="put its columns in that order"):
        problem.world.verify(certificate, turned)


def test_a_self_margin_and_held_obstacles_are_in_the_certificate(problem, path, tmp_path):
    world = rrtik.World(problem.robot, problem.world.scene, self_margin=0.001)
    path.proved(world).save(tmp_path / "path.json", proof=True)
    certificate = rrtik.Certificate.load(tmp_path / "path.json")
    assert certificate.self_margin == 0.001
    assert world.verify(certificate, path.waypoints) == ""


@pytest.mark.parametrize("how", ["no proof", "other waypoints", "elsewhere", "not proven", "a table"])
def test_what_has_no_proof_at_hand_is_refused_in_one_line(how, problem, path, tmp_path):
    other = {
        "no proof": lambda: path.with_waypoints(path.waypoints),
        "other waypoints": lambda: path.resample(0.1),
        "elsewhere": lambda: pickle.loads(pickle.dumps(path)),
        "not proven": lambda: path.with_waypoints(path.waypoints[[0, -1]]).proved(problem.world),
        "a table": lambda: path,
    }[how]()
    words = {"elsewhere": "do not prove it here", "not proven": "'link2' and 'box_right'", "a table": "use .json"}
    name = "path.csv" if how == "a table" else "path.json"
    with pytest.raises(InputError, match=re.escape(words.get(how, "it has none"))) as caught:
        other.save(tmp_path / name, proof=True)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / name).exists()


def test_a_proof_from_another_process_is_made_again_by_the_world(problem, path, tmp_path):
    pickle.loads(pickle.dumps(path)).proved(problem.world).save(tmp_path / "path.json", proof=True)
    assert rrtik.Certificate.load(tmp_path / "path.json").waypoints.shape == path.waypoints.shape


def test_a_path_without_a_certificate_is_none(path, tmp_path):
    path.save(tmp_path / "path.json")
    with pytest.raises(InputError, match=r"path\.json: .*certificate"):
        rrtik.Certificate.load(tmp_path / "path.json")
    (tmp_path / "path.json").write_text(json.dumps({**path.document(), "certificate": {"motions": "all"}}))
    with pytest.raises(InputError, match=r"path\.json: "):
        rrtik.Certificate.load(tmp_path / "path.json")
    (tmp_path / "path.json").write_text(json.dumps({**path.document(), "certificate": np.pi}))
    with pytest.raises(InputError, match=r"path\.json: "):
        rrtik.Certificate.load(tmp_path / "path.json")
