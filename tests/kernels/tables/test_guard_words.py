"""No kernel writes beyond its memory: the guard words around every array are as they were after each of them."""

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels import layout
from rrtik_ompl.kernels.record import Doubles, Record
from rrtik_ompl.kernels.simd.compiled import kernel
from rrtik_ompl.kernels.simd.lanes import set_double
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.simd.processor import WIDTH
from rrtik_ompl.kernels.tables import memory
from rrtik_ompl.kernels.tables.memory import PlannedTable, Table, TablePlan, aligned, is_intact, sizes_of, table
from rrtik_ompl.kernels.tables.scratch import probe_table
from rrtik_ompl.world.moving_world import MovingWorld

pytestmark = pytest.mark.kernels

ARMS = {"titan4": 1.8, "panda": 0.8, "puma560": 0.9, "point2d": 5.0}


@kernel
def write(address, place, number):
    set_double(address, place, number)


@pytest.fixture
def made(monkeypatch):
    """All tables that are made meanwhile."""
    tables = []
    for kind, name in ((Table, "__post_init__"), (PlannedTable, "__init__")):
        usual = getattr(kind, name)

        def recorded(self, *given, usual=usual):
            usual(self, *given)
            tables.append(self)

        monkeypatch.setattr(kind, name, recorded)
    return tables


def robot_of(name):
    parameters = {"radius": 0.3, "bounds": [[-5, 5], [-5, 5]]} if name == "point2d" else None
    return rrtik.load_robot(name, parameters=parameters)


def clutter(robot, reach, shell):
    """Obstacles of all kinds around an arm, most of them out of its way."""
    shapes = [
        rrtik.Box([0.2, 0.1, 0.15]),
        rrtik.Sphere(0.1),
        rrtik.Cylinder(0.06, 0.4),
        rrtik.Capsule(0.05, 0.3),
        rrtik.Prism([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)], 0.2),
        shell,
    ]
    rng, found = np.random.default_rng(2), []
    for k in range(18):
        place = rng.normal(size=3) * (1.0, 1.0, 0.02 if robot.dof == 2 else 1.0)
        pose = pin.SE3(pin.exp3(rng.normal(size=3)), 0.8 * reach * place / np.linalg.norm(place))
        found.append(rrtik.Obstacle(f"o{k}", shapes[k % len(shapes)], pose))
    ground = [] if robot.dof == 2 else [rrtik.Obstacle("ground", rrtik.HalfSpace([0, 0, 1], -0.9 * reach))]
    return rrtik.Scene(found + ground)


def configurations(robot, count):
    lower, upper = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    return np.random.default_rng(1).uniform(lower, upper, (count, robot.dof))


@pytest.mark.parametrize("place", [-1, 5])
def test_a_write_beside_an_array_is_seen(place):
    own = table({0: np.arange(5.0), 1: np.zeros(0), 2: 7})
    assert own.intact()
    write(own[0].ctypes.data, 2, 8.0)
    assert own.intact()
    assert own[0].tolist() == [0.0, 1.0, 8.0, 3.0, 4.0]
    write(own[0].ctypes.data, place, 8.0)
    assert not is_intact(own[0])
    assert not own.intact()


@pytest.mark.parametrize("place", [-1, 3])
def test_a_write_beside_the_fields_is_seen(place):
    own = table({0: np.arange(5.0), 1: np.zeros(0), 2: 7})
    write(own.address, place, 8.0)
    assert not own.intact()


@pytest.mark.parametrize("words", [3, memory.COPIED_WORDS])
def test_a_write_behind_an_array_of_a_planned_table_is_seen(words):
    for place in (0, 2):
        own = PlannedTable(TablePlan({0: words, 1: 0, 2: 2 * words}, {3: 9}))
        assert (own.header[1], own.header[3]) == (0, 9)
        own[0][:], own[2][:] = 1.0, 2.0
        assert own.intact()
        write(int(own.header[place]), len(own[place]), 8.0)
        assert not own.intact()
    own = PlannedTable(TablePlan({0: words}, {1: 9}))
    write(own.address, 1, 8.0)
    assert own.intact()
    write(own.address, 2, 8.0)
    assert not own.intact()


def test_arrays_of_a_planned_table_are_where_its_fields_say():
    own = PlannedTable(TablePlan({0: 5, 1: 0, 2: WIDTH}, {3: 9}))
    for place in (0, 2):
        assert own[place].ctypes.data == own.header[place]
        assert own.header[place] % layout.DOUBLE_BYTES == 0
    assert own[0].ctypes.data % layout.ALIGNMENT == 0
    assert own.address == own.header.ctypes.data


def test_an_array_of_a_planned_table_cannot_be_replaced():
    class Curve(Record):
        along: Doubles
        count: int

    own = Curve(PlannedTable(sizes_of(Curve, along=5, count=2)))
    before = own.memory.header.copy()
    with pytest.raises(TypeError):
        own.put(along=aligned(np.zeros(9)))
    assert (own.memory.header == before).all()
    own.put(count=3)
    assert own.count == 3


def test_a_write_beside_the_points_of_a_cloud_is_seen():
    robot = robot_of("panda")
    cloud = rrtik.PointCloud(np.random.default_rng(4).uniform(0.6, 0.9, (50, 3)), 0.01)
    fast = rrtik.World(robot, rrtik.Scene([rrtik.Obstacle("cloud", cloud)])).fast
    clouds = [each for primitives in fast._primitives for each in primitives.clouds]
    assert clouds
    assert fast.intact()
    write(clouds[0].address, -1, 8.0)
    assert not fast.intact()


@pytest.mark.parametrize(("name", "reach"), ARMS.items())
def test_checks_write_nothing_beyond_their_memory(name, reach, dented_cube, made):
    robot = robot_of(name)
    world = rrtik.World(robot, clutter(robot, reach, dented_cube(0.1, -0.09)))
    moving, Q = MovingWorld(world), configurations(robot, 5 * WIDTH + 3)
    others = np.roll(Q, 1, axis=0)
    for checks in (world.fast, moving._fast):
        V, ends = robot.joint_values(Q), robot.joint_values(others)
        for resolve in (True, False):
            checks.classify(V, resolve=resolve)
            checks.classify_edges(V, ends, np.full(len(V), 20), resolve=resolve)
            assert checks.intact()
        checks.clearance(V, upper=True)
        assert checks.intact()
        checks.undecided_pairs(V)
        assert checks.intact()
    moving.move(world.scene)
    moving.valid_batch(Q)
    assert moving._fast.intact()
    assert len(made) > 10
    assert all(each.intact() for each in made)


@pytest.mark.parametrize("count", [1, WIDTH, WIDTH + 1])
def test_answers_stay_inside_the_arrays_that_python_gives(count, dented_cube):
    robot = robot_of("panda")
    fast = rrtik.World(robot, clutter(robot, 0.8, dented_cube(0.1, -0.09))).fast
    rows = aligned(robot.joint_values(configurations(robot, count)))
    steps, answers = aligned(np.full(count, 9, dtype=np.int32)), aligned(np.zeros(count, dtype=np.int32))
    distances, pairs = aligned(np.zeros(count)), aligned(np.zeros(count, dtype=np.int32))
    checks, probe = library("checks.check_kernels"), probe_table(fast._primitives)
    places = [each.ctypes.data for each in (rows, steps, answers, distances, pairs)]
    checks.classify(fast.address, places[0], count, places[2], True)
    checks.classify_edges(fast.address, places[0], places[0], places[1], count, places[2], True)
    checks.mark_pairs(fast.address, places[0], min(count, WIDTH))
    tables = fast._arm.balls[0].address, fast._primitives[0].address
    measure = library("checks.distance_kernels").measure
    measure(fast.address, *tables, places[0], count, probe.address, *places[3:])
    assert all(is_intact(each) for each in (rows, steps, answers, distances, pairs))
    assert probe.intact()
    assert fast.intact()


@pytest.mark.parametrize("method", ["auto", "numeric"])
@pytest.mark.parametrize("name", ["titan4", "puma560", "kinova"])
def test_inverse_kinematics_writes_nothing_beyond_its_memory(name, method, made):
    robot = rrtik.load_robot(name)
    Q = configurations(robot, 2 * WIDTH + 1)
    poses = robot.fk_batch(Q)
    rrtik.solve_ik_many(robot, poses[:5], method=method, seconds=20.0)
    rrtik.solve_ik(robot, rrtik.PoseGoal(poses[0]), method=method, near=Q[0])
    rrtik.solve_ik_many(robot, poses, method=method, seconds=20.0)
    assert made
    assert all(each.intact() for each in made)


@pytest.mark.parametrize("planner", ["fastrrtconnect", "bicrdt", "crdt"])
def test_searches_write_nothing_beyond_their_memory(planner, made):
    problem = rrtik.load_problem("titan4_sdu")
    plan = rrtik.plan(problem, planner, seconds=5.0, seed=1)
    for method in ("shortcut", "random"):
        rrtik.shorten(plan.path, problem, method=method, seed=1, seconds=1.0)
    assert made
    assert all(each.intact() for each in made)
