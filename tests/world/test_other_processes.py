"""Public values in other processes: a round trip gives an equal one, read-only where it was, and errors arrive."""

import copy
import multiprocessing
import pickle
from dataclasses import fields, is_dataclass, replace
from functools import cache
from types import MappingProxyType

import cloudpickle
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base import errors
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.ik.singularity import singularity_report
from rrtik_ompl.pilot.overlay.virtual_camera import pinhole_camera
from rrtik_ompl.sensing.cameras.pictures import CameraLostError
from rrtik_ompl.sensing.markers.marker_map import GraspType, MarkedObject, MarkerMap, MountedMarker
from rrtik_ompl.sensing.scene_from_view import NoBaseError

AT = rrtik.pose([0.1, 0.2, 0.3])
BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.2), rrtik.pose([9, 9, 9]), margin=0.1)
THING = MarkedObject("thing", "target", (MountedMarker(1, 0.1, AT),), (BALL,), (GraspType("top", [AT]),))


@cache
def planar():
    return rrtik.load_robot("planar3")


@cache
def world():
    return rrtik.World(planar(), rrtik.Scene([BALL]), motion_resolution=0.02, self_margin=0.001)


@cache
def problem():
    return rrtik.Problem(world(), [0, 0, 0], [0.5, 0.2, 0], name="a", planner="bicrdt")


@cache
def plan():
    return rrtik.plan(problem(), seed=1)


VALUES = {
    "Plan": plan,
    "Problem": problem,
    "World": world,
    "Problem with constraints": lambda: rrtik.Problem(
        world(), [0, 0, 0], [0.5, 0.2, 0], constraints=[rrtik.TaskRegion(AT, np.tile([-9.0, 9.0], (6, 1)))]
    ),
    "Robot": planar,
    "Robot with a closed form": lambda: rrtik.load_robot("titan4"),
    "Robot with meshes": lambda: rrtik.load_robot("panda_primitives"),
    "JointPath": lambda: plan().path,
    "Proof": lambda: plan().path.proof,
    "Trajectory": lambda: rrtik.time_parameterize(plan().path, planar()),
    "RateLimits": lambda: rrtik.RateLimits.of(planar()),
    "IkResult": lambda: rrtik.solve_ik(planar(), rrtik.PositionGoal([1, 1, 0])),
    "SingularityReport": lambda: singularity_report(planar(), [0, 0, 0]),
    "ReachMap": lambda: rrtik.ik.reach_map(planar(), samples=100),
    "Certificate": lambda: world().certificate(plan().path),
    "TaskCertificate": lambda: rrtik.TaskCertificate((world().certificate(plan().path),)),
    "HeightField": lambda: rrtik.HeightField([[0.1, 0.2], [0.3, 0.4]], 0.1),
    "PointCloud": lambda: rrtik.PointCloud([[0, 0, 0], [0, 0, 1]], 0.1),
    "Roadmap": lambda: rrtik.Roadmap(world(), vertices=20, seed=1),
    "JointGoal": lambda: rrtik.JointGoal([0, 0, 0]),
    "PoseGoal": lambda: rrtik.PoseGoal(AT),
    "GoalSet": lambda: rrtik.GoalSet([rrtik.PoseGoal(AT), rrtik.PositionGoal([1, 0, 0])], "z", [1, 0, 0]),
    "MultiGoal": lambda: rrtik.MultiGoal({"link_2": rrtik.PositionGoal([1, 0, 0]), "tip": rrtik.PoseGoal(AT)}),
    "TaskRegion": lambda: rrtik.TaskRegion(AT, np.zeros((6, 2))),
    "Box": lambda: rrtik.Box([1, 2, 3]),
    "Cylinder": lambda: rrtik.Cylinder(1, 2),
    "Capsule": lambda: rrtik.Capsule(1, 2),
    "HalfSpace": lambda: rrtik.HalfSpace([0, 0, 2], 1),
    "Prism": lambda: rrtik.Prism([[0, 0], [1, 0], [0, 1]]),
    "Mesh": lambda: rrtik.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "Scene": lambda: rrtik.Scene([BALL], [rrtik.AttachedObject("t", "tip", rrtik.Sphere(1), AT)], [("t", "ball")]),
    "Obstacle": lambda: rrtik.Obstacle("a", rrtik.Sphere(1), motion=rrtik.replanning.ConstantVelocity([1, 0, 0])),
    "TimedPoses": lambda: rrtik.replanning.TimedPoses([0, 1], [AT, AT]),
    "MoveRules": lambda: rrtik.MoveRules(planar().joint_names, frozen_joints=["joint2"]),
    "Camera": pinhole_camera,
    "MarkerMap": lambda: MarkerMap("4x4_50", (THING,), AT),
    "Scenario": lambda: rrtik.replanning.Scenario.load("replan_ur5"),
}
THROUGH = {
    "a deep copy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "joblib and Dask": lambda value: cloudpickle.loads(cloudpickle.dumps(value)),
}
OWN = {"_digest", "_measure", "maker", "problem"}  # of one process; plans are sent without their problem
NOT_COMPARED = OWN | {"closed_form", "model", "collision", "looks"}


def same(first, second):
    """Whether two values are alike in all that they hold, read-only in the same places."""
    if type(first) is not type(second):
        return False
    if isinstance(first, pin.SE3):
        return np.array_equal(first.homogeneous, second.homogeneous)
    if isinstance(first, np.ndarray):
        return first.flags.writeable == second.flags.writeable and np.array_equal(first, second, equal_nan=True)
    if isinstance(first, rrtik.Robot):
        models = ("model", "collision", "visual")
        if not all(getattr(first, name) == getattr(second, name) for name in models):
            return False
    if isinstance(first, rrtik.Roadmap):
        known = (each.edges for each in (first.graph, second.graph))
        names = ("world", "seed", "near", "vertices")
        return np.array_equal(*known) and all(same(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, HeldRegions):
        return same(vars(first), vars(second))
    if isinstance(first, rrtik.World):
        names = ("robot", "scene", "motion_resolution", "accuracy", "self_margin", "pairs")
        return all(same(getattr(first, name), getattr(second, name)) for name in names)
    if is_dataclass(first):
        names = [field.name for field in fields(first) if field.name not in NOT_COMPARED]
        return all(same(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, rrtik.Problem | rrtik.MoveRules):
        return vars(first).keys() == vars(second).keys() and all(
            same(vars(first)[k], vars(second)[k]) for k in vars(first)
        )
    if isinstance(first, dict | MappingProxyType):
        return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(same, first, second))
    return bool(first == second)


def name_of(value):
    return type(value).__name__


@pytest.mark.parametrize("kind", VALUES)
@pytest.mark.parametrize("through", THROUGH)
def test_a_round_trip_gives_an_equal_value(kind, through):
    value = VALUES[kind]()
    assert same(value, THROUGH[through](value))


def there_and_back(value):
    """The value as another process has it, and its own digest of what matters."""
    return value


def by_joblib(function, values):
    joblib = pytest.importorskip("joblib")
    with joblib.parallel_config(backend="loky", n_jobs=2):
        return joblib.Parallel()(joblib.delayed(function)(value) for value in values)


def by_dask(function, values):
    dask = pytest.importorskip("dask")
    return list(dask.compute(*map(dask.delayed(function), values), scheduler="processes", num_workers=1))


@pytest.mark.parametrize("through", [by_joblib, by_dask], ids=lambda through: through.__name__)
def test_workers_of_others_send_back_equal_values(through):
    values = [make() for make in VALUES.values()]
    back = through(there_and_back, values)
    assert [kind for kind, a, b in zip(VALUES, values, back, strict=True) if not same(a, b)] == []


@pytest.fixture(scope="module", params=["spawn", "fork"])
def pool(request):
    with multiprocessing.get_context(request.param).Pool(1) as pool:
        yield pool


@pytest.mark.parametrize("kind", VALUES)
def test_another_process_sends_back_an_equal_value(kind, pool):
    value = VALUES[kind]()
    assert same(value, pool.apply_async(there_and_back, (value,)).get(timeout=120))


def asked(world, Q):
    """What a world answers."""
    certified = world.certify(Q)
    return world.valid_batch(Q), world.motion_valid_batch(Q[:-1], Q[1:]), certified, world.clearance(Q[0])


FORMS = {
    "as it is": lambda world: world,
    "fine": lambda world: world.with_resolution(1e-3),
    "conservative": lambda world: world.with_accuracy("conservative"),
    "wide": lambda world: world.with_clearance(0.2),
    "proving": lambda world: world.with_clearance(0.05).proving(0.1),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_worker_s_world_gives_the_same_answers(form, pool):
    near = rrtik.Obstacle("near", rrtik.Box([0.5, 0.5, 0.5]), rrtik.pose([1.5, 1.0, 0.0]), margin=0.05)
    world = FORMS[form](rrtik.World(planar(), rrtik.Scene([near])))
    Q = np.random.default_rng(1).uniform(planar().lower, planar().upper, (200, 3))
    here, there = asked(world, Q), pool.apply_async(asked, (world, Q)).get(timeout=120)
    assert all(np.array_equal(a, b) for a, b in zip(here[:-1], there[:-1], strict=True))
    assert there[-1] == pytest.approx(here[-1], abs=1e-9)  # coal's distances depend on those computed before, by 1e-11
    assert 0 < here[0].sum() < len(Q)


def test_problems_of_one_robot_arrive_with_one_robot():
    first, second = (pickle.loads(pickle.dumps(each)) for each in (problem(), problem().with_resolution(0.01)))
    assert first.robot is second.robot


ERRORS = [
    errors.RrtikError("a"),
    errors.InputError("a"),
    errors.MissingFileError("a"),
    errors.UnknownNameError("robot", "nope", ["b", "a"], where="file.yaml:3"),
    errors.ProblemError("a", [("b", "c")], part="goal"),
    errors.PlannerError("a"),
    CameraLostError("a"),
    NoBaseError("a"),
]


@pytest.mark.parametrize("error", ERRORS, ids=name_of)
def test_errors_arrive_with_what_they_carry(error):
    for other in (pickle.loads(pickle.dumps(error)), copy.deepcopy(error), copy.copy(error)):
        assert (type(other), str(other), vars(other)) == (type(error), str(error), vars(error))


def test_an_error_in_a_worker_does_not_hang_its_parent(pool):
    with pytest.raises(errors.UnknownNameError, match="no robot 'nope'") as caught:
        pool.apply_async(rrtik.load_robot, ("nope",)).get(timeout=120)
    assert "planar3" in caught.value.alternatives


def test_a_closed_form_that_has_no_name_is_named():
    with pytest.raises(errors.InputError, match=r"planar3.*closed_form"):
        pickle.dumps(replace(planar(), closed_form=lambda: None))
