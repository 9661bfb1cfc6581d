"""What stands in model/ is data: it needs no engine, never changes, and is copied and pickled by its fields."""

import copy
import inspect
import pickle
import pkgutil
import subprocess
import sys
from dataclasses import FrozenInstanceError, fields, is_dataclass
from functools import cache
from importlib import import_module
from types import MappingProxyType

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
import rrtik_ompl.model
from rrtik_ompl.base.copies import changed
from rrtik_ompl.model.certificate import (
    Certificate,
    ModelBody,
    ModelConstraint,
    ModelJoint,
    MotionEntries,
    Route,
    TaskCertificate,
)
from rrtik_ompl.model.gripper import GripperEvent, GripperJoints
from rrtik_ompl.model.judgement import (
    ClearanceCurve,
    Contact,
    Finding,
    Judged,
    MotionVerdict,
    PathContact,
    Played,
    Verdict,
    Violation,
)
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.proof import Gap, Proof
from rrtik_ompl.model.shapes.mesh_repair import edges_of
from rrtik_ompl.model.shapes.point_tree import point_tree
from rrtik_ompl.model.shapes.shape import Measure
from rrtik_ompl.model.world_settings import WorldSettings

AT = rrtik.pose([0.1, 0.2, 0.3])
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([9.0, 0.0, 0.0]))
CONTACT = Contact("link1", "ball", -0.01, POINTS[0], POINTS[1])
CURVE = ClearanceCurve(np.array([0, 0]), np.array([0.0, 1.0]), np.array([0.1, 0.2]), (("link1", "ball"),) * 2, ())
ENTRIES = MotionEntries(np.zeros((1, 4), np.int64), np.zeros((1, 2), np.int64), np.zeros((1, 3)))
FOUND = Finding("touching", 1.1, 1.3, 1.2, 0.5, POINTS[0], "link1", "ball", -0.01, "they overlap")
HINGE = ModelJoint("hinge", 0, [0.0] * 12, [0.0, 0.0, 1.0], False, [1.0], 0.0)
UPRIGHT = ModelConstraint("arm", 1, [0.0] * 12, [0.0] * 12, [0.0] * 12, [[-1.0, 1.0]] * 6, [0.001, 0.1])
LINK = ModelBody("arm", 0, "link", 1, [0.0] * 12, {"sphere": 0.1}, cuts=((0, 2, 0.5),))
VERDICT = Verdict(True, "every move is proven free")


@cache
def arm():
    return rrtik.load_robot("planar3")


def certificate():
    return Certificate("arm", (HINGE,), (LINK,), ((0, 1, "held"),), 0.001, 0.0, POINTS[:2], (ENTRIES,))


SAMPLES = {
    "AttachedObject": lambda: rrtik.AttachedObject("tool", "tip", rrtik.Sphere(0.1), AT),
    "Box": lambda: rrtik.Box([1.0, 2.0, 3.0]),
    "Capsule": lambda: rrtik.Capsule(1.0, 2.0),
    "Cells": lambda: rrtik.Octree([[0, 0, 0]], [0.1]).clouds[0],
    "Certificate": certificate,
    "Chain": lambda: arm().chain,
    "ClearanceCurve": lambda: CURVE,
    "ConstantVelocity": lambda: rrtik.replanning.ConstantVelocity([1.0, 0.0, 0.0]),
    "Contact": lambda: CONTACT,
    "Cylinder": lambda: rrtik.Cylinder(1.0, 2.0),
    "Distances": lambda: rrtik.World(arm(), rrtik.Scene([BALL])).distances(np.zeros(3)),
    "Edges": lambda: edges_of(np.array([[0, 1, 2], [2, 1, 3]])),
    "Finding": lambda: FOUND,
    "Gap": lambda: Gap(1, 0.5, "link1", "ball"),
    "GoalSet": lambda: rrtik.GoalSet([AT, rrtik.PositionGoal([1.0, 0.0, 0.0])], "z"),
    "GripperEvent": lambda: GripperEvent(1.0, ("jaw",), (0.2,)),
    "GripperJoints": lambda: GripperJoints(("jaw",), (0.2,), (0.0,), 0.4),
    "HalfSpace": lambda: rrtik.HalfSpace([0.0, 0.0, 1.0], 0.0),
    "HeightField": lambda: rrtik.HeightField([[0.1, 0.2], [0.3, 0.4]], 0.1),
    "JointGoal": lambda: rrtik.JointGoal([0.0, 0.0, 0.0]),
    "JointPath": lambda: JointPath.of(arm(), POINTS).with_proof(Proof(2, 0.001, (Gap(1, 0.5, "link1", "ball"),))),
    "Judged": lambda: Judged(VERDICT, CURVE, (PathContact(0.0, 1.0, CONTACT, frozenset({"link1", "ball"})),)),
    "Measure": lambda: Measure("length"),
    "Mesh": lambda: rrtik.Mesh(POINTS, [[0, 1, 2]]),
    "ModelBody": lambda: LINK,
    "ModelConstraint": lambda: UPRIGHT,
    "ModelJoint": lambda: HINGE,
    "MotionEntries": lambda: ENTRIES,
    "MotionVerdict": lambda: MotionVerdict(3, 0.001, touching=(1,), findings=(FOUND,)),
    "MultiGoal": lambda: rrtik.MultiGoal({"tip": rrtik.PositionGoal([1.0, 0.0, 0.0])}),
    "Obstacle": lambda: BALL,
    "Octree": lambda: rrtik.Octree([[0, 0, 0]], [0.1]),
    "PathContact": lambda: PathContact(0.0, 1.0, CONTACT, frozenset({"link1", "ball"})),
    "Played": lambda: Played(POINTS, None, Judged(VERDICT, None, ())),
    "PointCloud": lambda: rrtik.PointCloud(POINTS, 0.1),
    "PointTree": lambda: point_tree(POINTS),
    "PoseGoal": lambda: rrtik.PoseGoal(AT),
    "PositionGoal": lambda: rrtik.PositionGoal([1.0, 0.0, 0.0]),
    "Prism": lambda: rrtik.Prism(POINTS[:, :2]),
    "Proof": lambda: Proof(2, 0.001, (Gap(1, 0.5, "link1", "ball"),), 0.0, "12"),
    "Robot": arm,
    "Route": lambda: Route(POINTS, np.arange(3.0), np.ones((2, 1, 3)), moving=True),
    "Scene": lambda: rrtik.Scene([BALL]),
    "SearchTree": lambda: rrtik.plan(rrtik.load_problem("planar3_a"), "crdt", seed=1, tree=True).tree,
    "Sphere": lambda: rrtik.Sphere(0.1),
    "TaskCertificate": lambda: TaskCertificate((certificate(),)),
    "TaskRegion": lambda: rrtik.TaskRegion(AT, np.zeros((6, 2))),
    "TimedPoses": lambda: rrtik.replanning.TimedPoses([0.0, 1.0], [AT, AT]),
    "Touching": lambda: rrtik.Touching("cup", "table", -0.001),
    "Verdict": lambda: VERDICT,
    "Violation": lambda: Violation(0, POINTS[0], "in collision"),
    "WorldSettings": lambda: WorldSettings(arm(), rrtik.Scene([BALL]), clearance=0.01),
}
OF_ONE_PROCESS = {"_measure", "maker", "closed_form", "model", "collision", "looks"}
THROUGH = {
    "copy": copy.copy,
    "deep copy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
}


def modules():
    """Names of all modules of the room."""
    return [each.name for each in pkgutil.walk_packages(rrtik_ompl.model.__path__, "rrtik_ompl.model.")]


def values():
    """Names of all dataclasses of the room of which there can be values."""
    for module in map(import_module, modules()):
        for name, kind in vars(module).items():
            own = inspect.isclass(kind) and kind.__module__ == module.__name__
            if own and is_dataclass(kind) and not name.startswith("_") and not inspect.isabstract(kind):
                yield name


def same(first, second):
    """Whether two values have the same fields, arrays read-only in the same places."""
    if type(first) is not type(second):
        return False
    if isinstance(first, pin.SE3):
        return np.array_equal(first.homogeneous, second.homogeneous)
    if isinstance(first, np.ndarray):
        return first.flags.writeable == second.flags.writeable and np.array_equal(first, second)
    if is_dataclass(first):
        names = [each.name for each in fields(first) if each.name not in OF_ONE_PROCESS]
        return all(same(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, dict | MappingProxyType):
        return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(same, first, second))
    return first == second


def test_every_value_of_the_room_is_in_this_table():
    assert sorted(set(values())) == sorted(SAMPLES)


def test_the_room_loads_itself_files_and_base_and_no_engine():
    work = f"""
import sys
from importlib import import_module
for name in {modules()}:
    import_module(name)
rooms = {{name.split(".")[1] for name in sys.modules if name.startswith("rrtik_ompl.")}}
print(sorted(rooms), sorted({{"numba", "llvmlite", "ompl", "scipy"}} & set(sys.modules)))
"""
    told = subprocess.run([sys.executable, "-c", work], check=True, capture_output=True, text=True)
    assert told.stdout.strip() == "['base', 'files', 'model'] []"


@pytest.mark.parametrize("name", SAMPLES)
def test_no_field_of_a_value_can_be_set(name):
    value = SAMPLES[name]()
    for field in fields(value):
        with pytest.raises(FrozenInstanceError):
            setattr(value, field.name, None)


@pytest.mark.parametrize("way", THROUGH)
@pytest.mark.parametrize("name", SAMPLES)
def test_a_value_is_copied_and_pickled_by_its_fields(name, way):
    value = SAMPLES[name]()
    assert same(THROUGH[way](value), value)


@pytest.mark.parametrize("name", SAMPLES)
def test_a_value_is_changed_by_its_fields(name):
    value = SAMPLES[name]()
    field = fields(value)[-1].name
    other = changed(value, **{field: None})
    assert getattr(other, field) is None
    for each in fields(value)[:-1]:
        assert getattr(other, each.name) is getattr(value, each.name)
