"""Files of certificates: written and read without loss, and refused in one line where they are broken."""

import json
import pickle
import re

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.files.text import MAX_BYTES
from rrtik_ompl.model.certificate import (
    MOST_CONSTRAINTS,
    MOST_CUTS,
    Certificate,
    ModelBody,
    ModelConstraint,
    ModelJoint,
    MotionEntries,
    from_document,
)
from rrtik_ompl.model.proof import Proof
from rrtik_ompl.model.scene import Obstacle, Scene
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.world.world import World


def certificate():
    """Of two motions, one of them without entries."""
    solids = np.array([[3, 0, 5, 1], [3, 0, 5, 1]])
    entries = MotionEntries(solids, np.array([[1, 0], [1, 1]]), np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 0.0]]))
    none = MotionEntries(np.zeros((0, 4), int), np.zeros((0, 2), int), np.zeros((0, 3)))
    rows = np.array([[0.1, -0.0], [1.0 / 3.0, 2e-300], [np.pi, -1e6]])
    pose = np.eye(4)[:3].ravel().tolist()
    joints = (ModelJoint("hinge", 0, pose, [0.0, 0.0, 1.0], False, [1.0, 0.0], 0.0),)
    cups = (ModelBody("cup", 0, "obstacle", 0, pose, {"box": [1.0, 2.0, 3.0]}, 0.01, 0.0, (("arm", -0.001),)),)
    arm = ModelBody("arm", 0, "link", 1, pose, {"mesh": 12, "extents": [1.0] * 14}, cuts=((0, 2, 0.25),))
    model = "arm", joints, (arm, *cups), ((0, 1, "allowed by the scene"),)
    bounds = [[-0.1, 0.1], [0.0, 0.0], [-1e3, 1e3], [0.0, 0.0], [-0.2, 0.1], [-np.pi, np.pi]]
    held = ModelConstraint("arm", 1, pose, pose, pose, bounds, [0.001, 0.01])
    return Certificate(*model, 0.001, 0.002, rows, (entries, none), constraints=(held,))


def test_a_certificate_is_read_as_it_was_written(tmp_path):
    file = tmp_path / "c.json"
    certificate().save(file)
    again = Certificate.load(file)
    assert again.document() == certificate().document()
    assert again.waypoints.tobytes() == certificate().waypoints.tobytes()
    assert [len(motion.solids) for motion in again.motions] == [2, 0]
    assert not again.waypoints.flags.writeable


def _with(field, value):
    return lambda document: document | {field: value}


def _without(field):
    return lambda document: {name: value for name, value in document.items() if name != field}


def _entry(row):
    return lambda document: document | {"motions": [[[3, 0, 5, 1, 0, 0], row], []]}


def _in(place, number, field, value):
    """Another value of a field of a joint or a body; ... for none."""

    def changed(document):
        items = [dict(item) for item in document[place]]
        items[number][field] = value
        return document | {place: items if value is not ... else [{"name": "nothing else"}]}

    return changed


NAN, INFINITE = float("nan"), float("inf")
BROKEN = {
    "no motions": (_without("motions"), "motions"),
    "no waypoints": (_without("waypoints"), "waypoints"),
    "unknown field": (_with("colour", "red"), "colour"),
    "future version": (_with("version", 3), "version"),
    "past version": (_with("version", 1), "version"),
    "true for a version": (_with("version", True), "version"),
    "version of a fraction": (_with("version", 1.0), "version"),
    "another kind": (_with("kind", "joint_path"), "kind"),
    "number for a name": (_with("robot", 7), "robot"),
    "digest of version 1": (_with("scene_digest", "0123"), "scene_digest"),
    "object for joints": (_with("joints", {}), "joints"),
    "number for a joint": (_with("joints", [7]), "joints[0]"),
    "joint of a name alone": (_in("joints", 0, "name", ...), "joints[0].parent"),
    "short pose": (_in("joints", 0, "pose", [1.0] * 11), "joints[0].pose"),
    "nan in an axis": (_in("joints", 0, "axis", [NAN, 0.0, 1.0]), "joints[0].axis"),
    "number for a truth": (_in("joints", 0, "slides", 0), "joints[0].slides"),
    "unknown field of a body": (_in("bodies", 1, "colour", "red"), "bodies[1].colour"),
    "text for a shape": (_in("bodies", 1, "shape", "box"), "bodies[1].shape"),
    "text in a shape": (_in("bodies", 1, "shape", {"box": [1.0, "2", 3.0]}), "bodies[1].shape.box"),
    "endless padding": (_in("bodies", 1, "padding", INFINITE), "bodies[1].padding"),
    "contact of a name": (_in("bodies", 1, "contacts", [["arm"]]), "bodies[1].contacts"),
    "cut along a fourth axis": (_in("bodies", 0, "cuts", [[0, 3, 0.0]]), "bodies[0].cuts[0]"),
    "true for an axis": (_in("bodies", 0, "cuts", [[0, True, 0.0]]), "bodies[0].cuts"),
    "nan for a cut": (_in("bodies", 0, "cuts", [[0, 1, NAN]]), "bodies[0].cuts"),
    "too many cuts": (_in("bodies", 0, "cuts", [0] * (MOST_CUTS + 1)), "bodies[0].cuts"),
    "pair without a reason": (_with("unchecked", [[0, 1]]), "unchecked[0]"),
    "constraints of none": (_with("constraints", []), "constraints"),
    "too many constraints": (_with("constraints", [0] * (MOST_CONSTRAINTS + 1)), "constraints"),
    "constraint of a name alone": (_in("constraints", 0, "name", ...), "constraints[0].frame"),
    "constraint by turns": (_in("constraints", 0, "turns", [1.0]), "constraints[0].turns"),
    "nan in a region": (_in("constraints", 0, "region", [NAN] * 12), "constraints[0].region"),
    "five bounds": (_in("constraints", 0, "bounds", [[0.0, 1.0]] * 5), "constraints[0].bounds"),
    "bounds turned over": (_in("constraints", 0, "bounds", [[1.0, 0.0]] * 6), "constraints[0].bounds"),
    "negative tolerance": (_in("constraints", 0, "tolerances", [-1.0, 0.0]), "constraints[0].tolerances"),
    "fraction of a joint": (_in("constraints", 0, "joint", 0.5), "constraints[0].joint"),
    "times without rates": (_with("times", [0.0, 1.0, 2.0]), "rates"),
    "text for a clearance": (_with("clearance", "0.001"), "clearance"),
    "true for a clearance": (_with("clearance", True), "clearance"),
    "text for a self margin": (_with("self_margin", "0.001"), "self_margin"),
    "negative self margin": (_with("self_margin", -1.0), "self_margin"),
    "nan for a clearance": (_with("clearance", NAN), "clearance"),
    "endless clearance": (_with("clearance", INFINITE), "clearance"),
    "negative clearance": (_with("clearance", -1.0), "clearance"),
    "text for waypoints": (_with("waypoints", "none"), "waypoints"),
    "text in waypoints": (_with("waypoints", [["0", "1"]] * 3), "waypoints"),
    "nan in waypoints": (_with("waypoints", [[0.0, NAN]] * 3), "waypoints"),
    "huge number in waypoints": (_with("waypoints", [[0, 10**400]] * 3), "waypoints"),
    "ragged waypoints": (_with("waypoints", [[0.0, 1.0], [0.0], [0.0, 1.0]]), "waypoints"),
    "empty waypoints": (_with("waypoints", []), "waypoints"),
    "too few motions": (_with("motions", [[]]), "motions"),
    "no list of motions": (_with("motions", {"0": []}), "motions"),
    "no list of entries": (_with("motions", [[], 4]), "motions[1]"),
    "short entry": (_entry([3, 0, 5, 1, 0]), "motions[0][1]"),
    "entry of seven": (_entry([3, 0, 5, 1, 0, 0, 1.0]), "motions[0][1]"),
    "no entry": (_entry(None), "motions[0][1]"),
    "negative body": (_entry([-3, 0, 5, 1, 0, 0]), "motions[0][1]"),
    "body of a fraction": (_entry([3.0, 0, 5, 1, 0, 0]), "motions[0][1]"),
    "true for a part": (_entry([3, True, 5, 1, 0, 0]), "motions[0][1]"),
    "huge body": (_entry([10**30, 0, 5, 1, 0, 0]), "motions[0][1]"),
    "deep level": (_entry([3, 0, 5, 1, 31, 0]), "motions[0][1]"),
    "number beyond its level": (_entry([3, 0, 5, 1, 2, 4]), "motions[0][1]"),
    "nan in a normal": (_entry([3, 0, 5, 1, 0, 0, NAN, 0.0, 1.0]), "motions[0][1]"),
    "endless normal": (_entry([3, 0, 5, 1, 0, 0, INFINITE, 0.0, 1.0]), "motions[0][1]"),
    "no normal": (_entry([3, 0, 5, 1, 0, 0, 0.0, 0.0, 0]), "motions[0][1]"),
    "normal of thousands of digits": (_entry([3, 0, 5, 1, 0, 0, 10**400, 0.0, 1.0]), "motions[0][1]"),
    "text in a normal": (_entry([3, 0, 5, 1, 0, 0, "1", 0.0, 0.0]), "motions[0][1]"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_certificate_is_refused_in_one_line_with_file_and_field(what, tmp_path):
    change, field = BROKEN[what]
    file = tmp_path / "c.json"
    file.write_text(json.dumps(change(certificate().document())))
    with pytest.raises(InputError, match=re.escape(field)) as caught:
        Certificate.load(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not JSON"),
        (b"[1, 2]", "expected an object"),
        (b"{", "not JSON"),
        (b"\x7fELF\xff\xfe", "not a text file"),
        (b"[" * 100_000, "nested"),
    ],
)
def test_a_file_that_is_no_json_object_is_refused(data, words, tmp_path):
    file = tmp_path / "c.json"
    file.write_bytes(data)
    with pytest.raises(InputError, match=words):
        Certificate.load(file)


def test_a_file_that_is_too_large_or_is_not_there_is_refused(tmp_path):
    with open(tmp_path / "large.json", "wb") as file:
        file.truncate(MAX_BYTES + 1)
    for name, words in (("large.json", "larger than 64 MiB"), ("none.json", "no such file"), ("c.yaml", "ending")):
        with pytest.raises(InputError, match=words):
            Certificate.load(tmp_path / name)
    with pytest.raises(InputError, match="ending"):
        certificate().save(tmp_path / "c.txt")


def test_every_cut_of_a_document_is_refused_or_read(tmp_path):
    text = json.dumps(certificate().document())
    for end in range(0, len(text), 7):
        (tmp_path / "c.json").write_text(text[:end])
        with pytest.raises(InputError):
            Certificate.load(tmp_path / "c.json")
    assert from_document(json.loads(text)).robot == "arm"


# --- digests -----------------------------------------------------------------------------------------------------


@pytest.mark.kernels
def test_a_proof_names_what_it_is_about():
    robot = rrtik.load_robot("planar3", parameters={"radius": 0.02})

    def digest(x, margin=0.0):
        wall = Obstacle("wall", Box([0.1, 0.1, 1.0]), rrtik.pose([x, 2.0, 0.0]), margin=margin)
        proof = World(robot, Scene([wall])).prove(np.zeros((2, 3)))
        assert pickle.loads(pickle.dumps(proof)) == proof
        assert pickle.loads(pickle.dumps(proof)).digest == proof.digest
        return proof.digest

    other = World(rrtik.load_robot("planar3", parameters={"radius": 0.03})).prove(np.zeros((2, 3))).digest
    found = [digest(1.0), digest(1.0 + 1e-9), digest(1.0, margin=0.001), other]
    assert len(set(found)) == 4
    assert all(re.fullmatch("[0-9a-f]{32}", text) for text in found)
    assert digest(1.0) == found[0]
    assert found[0][:16] == found[1][:16] != other[:16]


def test_a_proof_made_by_hand_has_no_digest():
    assert Proof(0, 0.0, ()).digest == ""
