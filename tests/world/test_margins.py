"""The distance that the arm keeps from obstacles."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.description.catalog import load_robot
from rrtik_ompl.geometry.collision.bodies import link_bodies
from rrtik_ompl.model.path import JointPath
from rrtik_ompl.model.scene import AttachedObject, ConstantVelocity, Obstacle, Scene
from rrtik_ompl.model.shapes import Box, Capsule, Cylinder, HalfSpace, Prism, Sphere
from rrtik_ompl.planning.plan import plan
from rrtik_ompl.problem_files.scene import load_scene
from rrtik_ompl.world.moving_world import MovingWorld
from rrtik_ompl.world.problem import Problem
from rrtik_ompl.world.world import World
from rrtik_tests.by_coal import free_by_coal

NEARLY = 1e-5  # [m]; what coal's distances and the kernels' rounding may differ by
GROOVED = Prism([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)], 0.2)


def shapes(dented_cube):
    simple = (Box([0.3, 0.2, 0.1]), Sphere(0.12), Cylinder(0.08, 0.3), Capsule(0.05, 0.3), GROOVED)
    return (*simple, dented_cube(0.15, -0.14), HalfSpace([0.3, 0.2, 1.0], -0.3))


def crowd(solids, seed, nearest, farthest, margin):
    """Solids around the arm's base, none of them in it."""
    rng, found = np.random.default_rng(seed), []
    for k, solid in enumerate(solids):
        way = rng.normal(size=3)
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(nearest, farthest) * way / np.linalg.norm(way))
        place = pin.SE3.Identity() if isinstance(solid, HalfSpace) else place
        found.append(Obstacle(f"o{k}", solid, place, margin=margin))
    return Scene(found)


def true_gaps(world, Q):
    """Coal's distances of what moves of the arm from the obstacles, shape (m,)."""
    arm = [b for b in link_bodies(world.robot) if b.joint > 0]
    allowed = {frozenset(pair) for pair in world.scene.allowed_collisions}
    gaps = np.full(len(Q), np.inf)
    for k, frames in enumerate(world.robot.joint_frames(Q)):
        for other in (b for b in world.bodies if b.kind == "obstacle"):
            for link in (b for b in arm if frozenset((b.name, other.name)) not in allowed):
                poses = [pin.SE3(frames[b.joint]) * b.placement for b in (link, other)]
                ends = [coal.Transform3s(p.rotation, p.translation) for p in poses]
                asked = (link.geometry, ends[0], other.geometry, ends[1], coal.DistanceRequest(), coal.DistanceResult())
                gaps[k] = min(gaps[k], coal.distance(*asked))
    return gaps


@pytest.mark.parametrize(("name", "reach"), [("panda", 0.9), ("ur5", 0.9)])
@pytest.mark.parametrize("margin", [0.004, 0.05])
def test_what_is_valid_keeps_the_margin_and_what_keeps_it_is_valid(name, reach, margin, dented_cube):
    robot = load_robot(name)
    scene = crowd(shapes(dented_cube), 4, 0.5, reach, margin)
    world, bare = World(robot, scene), World(robot, Scene([]))
    Q = np.random.default_rng(0).uniform(*robot.finite_range(), (150, robot.dof))
    Q = Q[bare.valid_batch(Q)]
    valid, gaps = world.valid_batch(Q), true_gaps(world, Q)
    assert 0.05 < valid.mean() < 0.95
    assert (gaps[valid] > margin - NEARLY).all()
    assert valid[gaps > margin + NEARLY].all()
    assert (free_by_coal(world, Q) == valid).all()
    between = (gaps > 0.0) & (gaps <= margin)
    assert between.any()
    assert [world.clearance(q) for q in Q[between][:5]] == pytest.approx(gaps[between][:5] - margin, abs=NEARLY)


sizes = st.floats(0.05, 1.0)
solids = st.one_of(
    st.builds(Sphere, sizes),
    st.builds(Cylinder, sizes, sizes),
    st.builds(Capsule, sizes, sizes),
    st.builds(Box, st.tuples(sizes, sizes, sizes)),
    st.builds(lambda k: Prism(3.0 * k * np.array(GROOVED.polygon), k), sizes),
    st.builds(HalfSpace, st.tuples(sizes, sizes, sizes), st.floats(-1.0, 1.0)),
)


@given(solids, st.floats(0.0, 0.5), st.integers(0, 2**32 - 1))
def test_a_disc_is_free_where_it_is_farther_than_the_margin(shape, margin, seed):
    robot = load_robot("point2d", parameters={"radius": 0.2, "bounds": [[-3, 3], [-3, 3]]})
    rng = np.random.default_rng(seed)
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-0.3, 0.3)]))
    world = World(robot, Scene([Obstacle("it", shape, pose, margin=margin)]))
    Q = rng.uniform(-2.0, 2.0, (40, 2))
    gaps, valid, careful = true_gaps(world, Q), world.valid_batch(Q), world.with_accuracy("conservative")
    assert (gaps[valid] > margin - NEARLY).all()
    assert valid[gaps > margin + NEARLY].all()
    assert (gaps[careful.valid_batch(Q)] > margin).all()
    assert (free_by_coal(world, Q) == valid).all()


def disc_and_wall(margin, **options):
    robot = load_robot("point2d", parameters={"radius": 0.5, "bounds": [[0, 10], [0, 10]]})
    wall = Obstacle("wall", Box([2, 4, 2]), pin.SE3(np.eye(3), np.array([5.0, 5.0, 0.0])), margin=margin)
    return World(robot, Scene([wall]), **options)


def test_what_is_too_near_is_named_with_its_distance_and_the_margin():
    world = disc_and_wall(0.3)
    (near,) = world.contacts([3.3, 5.0])
    assert (near.distance, near.clearance) == (pytest.approx(0.2), pytest.approx(-0.1))
    assert world.explain([3.3, 5.0]).endswith("are 200 mm apart, within the margin of 300 mm")
    assert "overlap by 200 mm" in world.explain([3.7, 5.0])
    assert world.explain([3.1, 5.0]) == ""
    with pytest.raises(ProblemError, match=r"start is too near.*300 mm.*lower the margin"):
        Problem(world, [3.3, 5.0], [9.0, 5.0])


def test_a_path_keeps_the_margin():
    world = disc_and_wall(1.0, motion_resolution=0.01)
    found = plan(Problem(world, [1.0, 5.0], [9.0, 5.0]), seconds=5.0, seed=1)
    rows = found.path.resample(0.01).waypoints
    assert true_gaps(world, rows).min() > 1.0 - 0.5 * 0.01
    past = JointPath.of(world.robot, [[1.0, 8.6], [9.0, 8.6]])  # 1.1 m beside the wall
    assert past.violations(world) == ()
    assert "within the margin" in past.violations(disc_and_wall(1.2))[0].reason


def test_what_stands_still_of_the_arm_must_not_touch_but_needs_no_margin():
    robot = load_robot("panda")
    table = Obstacle("table", HalfSpace([0, 0, 1], -0.005), margin=0.05)
    low = Obstacle("table", HalfSpace([0, 0, 1], 0.02), margin=0.05)
    q = robot.clamp([0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8])
    assert World(robot, Scene([table])).valid(q)
    assert "overlap" in World(robot, Scene([low])).explain(q)


def test_what_the_arm_holds_keeps_the_margin_too():
    robot = load_robot("panda")
    q = robot.clamp([0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8])
    tip = robot.fk(q)
    rod = AttachedObject("rod", "panda_hand", Capsule(0.01, 0.2), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.25])))
    ball = Obstacle("ball", Sphere(0.05), pin.SE3(np.eye(3), tip.act(np.array([0.0, 0.0, 0.4]))))
    near = Obstacle("ball", Sphere(0.05), ball.pose, margin=0.3)
    assert World(robot, Scene([ball], [rod])).valid(q)
    assert "'rod'" in World(robot, Scene([near], [rod])).explain(q)


def test_a_moving_world_keeps_the_margins_and_follows_when_they_change():
    world = disc_and_wall(0.3)
    moving = MovingWorld(world)
    rows = np.column_stack([np.linspace(2.0, 4.0, 41), np.full(41, 5.0)])
    assert (moving.valid_batch(rows) == world.valid_batch(rows)).all()
    for margin, room in ((0.6, 0.0), (0.0, 0.0), (0.1, 0.3)):
        moving.move(disc_and_wall(margin).scene, inflation={"wall": room})
        assert (moving.valid_batch(rows) == (3.5 - rows[:, 0] > margin + room + 1e-3)).all()


def test_files_state_margins_for_one_obstacle_or_for_all(tmp_path):
    file = tmp_path / "scene.yaml"
    obstacles = "[{name: a, sphere: 0.1}, {name: b, sphere: 0.1, margin: 0}, {name: c, sphere: 0.1, margin: 0.5}]"
    file.write_text(f"version: 1\nscene:\n  margin: 0.02\n  obstacles: {obstacles}\n")
    assert [o.margin for o in load_scene(file).obstacles] == [0.02, 0.0, 0.5]
    load_scene(file).save(tmp_path / "copy.yaml")
    assert [o.margin for o in load_scene(tmp_path / "copy.yaml").obstacles] == [0.02, 0.0, 0.5]


@pytest.mark.parametrize(
    ("where", "text", "line"),
    [
        ("scene", "-0.01", "scene.margin"),
        ("scene", ".nan", "scene.margin"),
        ("scene", "wide", "scene.margin"),
        ("obstacle", "-1", "margin"),
        ("obstacle", ".inf", "margin"),
        ("attached", "-0.1", "margin"),
    ],
)
def test_a_file_with_a_margin_that_makes_no_sense_is_refused_in_one_line(tmp_path, where, text, line):
    keys = {name: f"margin: {text}" if name == where else "" for name in ("scene", "obstacle", "attached")}
    file = tmp_path / "scene.yaml"
    obstacle = f"{{name: a, sphere: 0.1, {keys['obstacle']}}}"
    attached = f"{{name: t, link: hand, sphere: 0.1, {keys['attached']}}}"
    entries = f"  obstacles: [{obstacle}]\n  attached: [{attached}]\n  {keys['scene']}\n"
    file.write_text(f"version: 1\nscene:\n{entries.replace(', }', '}')}")
    with pytest.raises(InputError) as error:
        load_scene(file)
    assert line in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("margin", [-1e-3, float("nan"), float("inf"), "wide", None, [0.1]])
def test_an_obstacle_with_a_margin_that_makes_no_sense_is_refused(margin):
    with pytest.raises(InputError, match="margin of 'ball'"):
        Obstacle("ball", Sphere(0.1), margin=margin)


def test_a_scene_in_time_keeps_its_margins():
    ball = Obstacle("ball", Sphere(0.1), motion=ConstantVelocity([1, 0, 0]), margin=0.2)
    assert Scene([ball]).at(2.0).obstacle("ball").margin == 0.2


def on_a_table(name, top, **options):
    """An arm upright whose base, the lowest 3 mm below 0 at most, is above a small table."""
    robot = load_robot(name)
    table = Obstacle("table", Box([0.2, 0.2, 0.1]), [0.0, 0.0, top - 0.05], **options)
    return World(robot, Scene([table])), robot.posture({"ur5": "up", "panda": "ready"}[name])


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_base_that_stands_within_a_margin_is_free_by_every_check_and_proof(name):
    """Base plates stand on tables: no posture would give the arm more room, so that its base must only not touch."""
    world, q = on_a_table(name, -0.005, margin=0.02)
    nearest = world.closest(q)
    assert nearest.first in ("base_link", "panda_link0")
    assert nearest.margin == 0.0 < nearest.distance < 0.02
    assert str(nearest).endswith("mm apart")  # within no margin
    assert world.valid(q)
    for opinion in (world.certify(q[None]), world.motions_proven(q[None], q[None]), free_by_coal(world, q[None])):
        assert opinion.all()


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_base_that_touches_is_said_to_be_nothing_that_a_posture_can_mend(name):
    world, q = on_a_table(name, 0.01)
    assert not world.valid(q)
    with pytest.raises(ProblemError, match=r"'table'.*mm.*move the obstacle"):
        Problem(world, q, q)


def test_only_true_leaves_out_the_check_for_contacts():
    """An array, which has no truth value, raised an error of numpy."""
    world, q = on_a_table("ur5", 0.01)
    assert str(world.closest(q, known_free=np.zeros(2))) == str(world.closest(q))
