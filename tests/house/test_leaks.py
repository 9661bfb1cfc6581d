"""What nobody holds any more is gone: living instances are counted after the examples of all public types."""

import doctest
import gc
import inspect
import weakref
from collections import Counter

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values
from rrtik_tests.sizes import how_many

PUBLIC = public_values(rrtik)
OURS = ("rrtik_ompl", "rrtik_planners", "rrtik_robots")
KEPT_WITH_CLASSES = {"ompl.SafePlanner"}  # its example makes a class, which the cache of traits keeps
KEPT_WITH_ROBOTS = {"Body"}  # of links: caches keep those of some robots; the last test bounds these
ROBOTS_KEPT = 64  # by caches
REACH = "robot = rrtik.load_robot('planar3')"
CAMERA = "camera = rrtik.sensing.Camera([[900, 0, 320], [0, 900, 240], [0, 0, 1]], 640, 480)"
MARKER_MAP = "marker_map = rrtik.sensing.MarkerMap('DICT_4X4_50', [], rrtik.pose())"
SHORT_OF_AN_EXAMPLE = {
    "AttachedObject": "rrtik.AttachedObject('tool', 'link3', rrtik.Box([0.1, 0.1, 0.1]))",
    "replanning.ConstantVelocity": "rrtik.replanning.ConstantVelocity([0.1, 0, 0])",
    "replanning.TimedPoses": "rrtik.replanning.TimedPoses([0.0, 1.0], [rrtik.pose([0, 0, 0]), rrtik.pose([1, 0, 0])])",
    "Obstacle": "rrtik.Obstacle('b', rrtik.Sphere(0.1), rrtik.pose([1, 0, 0]))",
    "Scene": "rrtik.Scene([rrtik.Obstacle('b', rrtik.Sphere(0.1), rrtik.pose([1, 0, 0]))])",
    "World": f"{REACH}\nworld = rrtik.World(robot)\nworld.valid([0, 0, 0])\nworld.clearance([0, 0, 0])",
    "Robot": f"{REACH}\nrobot.fk([0, 0, 0])",
    "JointGoal": "rrtik.JointGoal([0.0, 0.0])",
    "PoseGoal": "rrtik.PoseGoal(rrtik.pose([1, 0, 0]))",
    "PositionGoal": "rrtik.PositionGoal([1, 0, 0])",
    "GoalSet": "rrtik.GoalSet([rrtik.PositionGoal([1, 0, 0]), rrtik.PositionGoal([0, 1, 0])])",
    "ik.IkResult": f"{REACH}\nrrtik.solve_ik(robot, rrtik.PositionGoal(robot.fk([0, 1, 0]).translation))",
    "ik.IkTrajectory": f"{REACH}\nrrtik.ik.solve_trajectory(robot, [robot.fk([0, 1, 0]), robot.fk([0, 1.01, 0])])",
    "JointPath": f"{REACH}\nrrtik.JointPath.of(robot, [[0, 0, 0], [0, 1, 0]]).length",
    "ompl.BenchmarkNotes": "from ompl import tools\n"
    "setup = rrtik.ompl.simple_setup(rrtik.load_problem('planar3_boxes'))\n"
    "rrtik.ompl.BenchmarkNotes(tools.Benchmark(setup))",
    "Stage": "rrtik.MoveTo('ready')",
    "ompl.MotionChecker": "rrtik.plan(rrtik.load_problem('planar3_boxes'), 'fastrrtconnect', seed=1)",
    "ompl.SearchResult": "rrtik.ompl.SearchResult(np.zeros((2, 3)))",
    "sensing.Camera": CAMERA,
    "sensing.MarkerMap": f"{CAMERA}\n{MARKER_MAP}",
    "sensing.Rig": f"{CAMERA}\nrrtik.sensing.Rig([camera, camera], [rrtik.pose(), rrtik.pose([0.1, 0, 0])])",
    "sensing.Sensor": f"{CAMERA}\n{MARKER_MAP}\nrrtik.sensing.Sensor(camera, marker_map)",
    "Trajectory": f"{REACH}\npath = rrtik.JointPath.of(robot, [[0, 0, 0], [0, 1, 0]])\n"
    "rrtik.time_parameterize(path, rrtik.RateLimits(1.0, 2.0, 20.0))",
}


def example(name):
    """The statements of a public name's example."""
    text = inspect.getdoc(PUBLIC[name]) or ""
    shown = doctest.DocTestParser().get_examples(text)
    run = (each.source for each in shown if not each.options.get(doctest.SKIP) and each.exc_msg is None)
    return "".join(run) or SHORT_OF_AN_EXAMPLE.get(name, "")


@pytest.fixture(scope="module", autouse=True)
def only_what_is_made_here():
    """Nothing but what these tests make is counted and looked at by the collector, in which other tests leave much."""
    for _ in range(ROBOTS_KEPT):  # caches keep robots of these tests alone
        use_a_robot()
    gc.collect()
    gc.freeze()


def use_a_robot():
    robot = rrtik.load_robot("planar3")
    rrtik.World(robot).valid([0.0, 0.0, 0.0])
    rrtik.solve_ik(robot, rrtik.PositionGoal([1.0, 0.0, 0.0]))


TYPES = [name for name, value in PUBLIC.items() if inspect.isclass(value)]


def living():
    """Instances of our types, counted by their names."""
    gc.collect()
    kinds = (type(each) for each in gc.get_objects())
    return Counter(kind.__name__ for kind in kinds if str(kind.__module__).split(".")[0] in OURS)


def run(code):
    exec(code, {"np": np, "rrtik": rrtik, "__name__": "example"})


def test_every_public_type_has_an_example_to_be_counted_with():
    errors = {name for name in TYPES if issubclass(PUBLIC[name], BaseException)}
    assert {name for name in TYPES if not example(name)} <= errors


@pytest.mark.parametrize("name", [name for name in TYPES if example(name) and name not in KEPT_WITH_CLASSES])
def test_what_an_example_makes_is_gone_when_it_has_ended(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = compile(example(name), name, "exec")
    run(code)
    before = living()
    run(code)
    grown = {kind: count - before[kind] for kind, count in living().items() if count > before[kind]}
    assert grown.keys() <= KEPT_WITH_ROBOTS, grown


def scans(count, alive):
    """Worlds of one scan after another, as a camera's loop makes them; adds weak references to the clouds' solids."""
    robot = rrtik.load_robot("planar3")
    rng = np.random.default_rng(0)
    for _ in range(count):
        cloud = rrtik.PointCloud(rng.normal(size=(50, 3)) * 0.1 + [1.5, 0, 0], radius=0.01)
        world = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("scan", cloud)]))
        world.motion_valid([0.0, 0.0, 0.0], [0.1, 0.0, 0.0])
        world.moved("scan", [0.0, 0.1, 0.0]).valid([0.0, 0.0, 0.0])
        world.prove([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
        world.clearance([0.0, 0.0, 0.0])
        alive.append(weakref.ref(world.bodies[-1].geometry))


def test_a_scan_is_gone_when_nobody_holds_it():
    alive = []
    before = living()["PointCloud"]
    scans(how_many(1000, 60), alive)
    assert living()["PointCloud"] == before
    assert not any(solid() for solid in alive)  # no collector can count objects of coal's


def test_the_robots_that_caches_keep_have_a_bound():
    for _ in range(80):
        use_a_robot()
    assert living()["Robot"] <= ROBOTS_KEPT + 2
