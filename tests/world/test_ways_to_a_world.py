"""All shapes, by all ways to a world: none answers by what stood there before.

A world may take over the tables of another one. Here each shape takes the place of each, each way to another world
follows, and the answers are those of a world made from nothing, and coal's.
"""

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from inspect import get_annotations, isfunction
from itertools import combinations, pairwise, product

import coal
import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.checks.fast_world import FastWorld
from rrtik_ompl.kernels.proof.layout import ProofTable
from rrtik_ompl.kernels.proof.packing import COMPUTED, PLACED
from rrtik_ompl.kernels.record import holds_array
from rrtik_ompl.model.scene import Touching
from rrtik_ompl.model.shapes.shape import Shape
from rrtik_ompl.world import proof
from rrtik_ompl.world.arm_cache import ArmCache, arm_cache
from rrtik_ompl.world.world import held_elsewhere
from rrtik_tests.sizes import how_many

UR5 = rrtik.load_robot("ur5")
RNG = np.random.default_rng(5)
ROWS = RNG.uniform(*UR5.finite_range(), (24, 6))
ENDS = ROWS + RNG.normal(scale=0.1, size=ROWS.shape)
POST = rrtik.Obstacle("post", rrtik.Box([0.1, 0.1, 0.1]), rrtik.pose([0.5, -0.6, 0.2]))
FAR = rrtik.Obstacle("far", rrtik.Box([0.1, 0.1, 0.1]), rrtik.pose([5.0, 5.0, 5.0]))
TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.1, 0.1, 0.3]])
DENT = [0.1, 0.1, 0.05]
FACES = [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
DENTED = [[0, 2, 4], [2, 1, 4], [1, 0, 4]]
CUBES = 0.02 * np.array(list(product(range(-6, 6), repeat=3)))  # more than an octree has as boxes


def shapes(size, seed):
    """One shape of each kind, of some size."""
    rng = np.random.default_rng(seed)
    return {
        "box": rrtik.Box([0.2 * size, 0.1, 0.3 * size]),
        "ball": rrtik.Sphere(0.1 * size),
        "cylinder": rrtik.Cylinder(0.08 * size, 0.2),
        "capsule": rrtik.Capsule(0.05, 0.3 * size),
        "floor": rrtik.HalfSpace([0.0, 0.0, 1.0], -0.6 * size),
        "prism": rrtik.Prism([[0.0, 0.0], [0.2 * size, 0.0], [0.0, 0.2]], 0.2),
        "hull": rrtik.Mesh(size * TETRAHEDRON, [*FACES, [0, 2, 1]]),
        "bent": rrtik.Mesh(size * np.vstack([TETRAHEDRON, DENT]), [*FACES, *DENTED]),
        "cloud": rrtik.PointCloud(rng.uniform(-0.1 * size, 0.1 * size, (int(100 * size), 3)), 0.01 * size),
        "heights": rrtik.HeightField([[0.1 * size, 0.2], [0.2, 0.1 * size]], 0.15),
        "octree": rrtik.Octree(CUBES[rng.random(len(CUBES)) < 0.6 * size], 0.02),
    }


SHAPES = shapes(1.0, 1)
OTHERS = shapes(1.4, 2)
PAIRS = [(one, one) for one in SHAPES] + [(one, other) for one, other in product(SHAPES, SHAPES) if one != other]
FIRST = ["cloud", "box", "bent", "octree", "floor", "heights", "hull", "prism", "ball", "cylinder", "capsule"]
WAYS = {
    "with_scene": lambda world: world.with_scene(
        replace(world.scene, contacts=[Touching("wrist_3_link", "far", -1e-3)])
    ),
    "with_accuracy": lambda world: world.with_accuracy("conservative"),
    "with_resolution": lambda world: world.with_resolution(0.02),
    "with_clearance": lambda world: world.with_clearance(0.02),
    "proving": lambda world: world.proving(0.01),
    "moved": lambda world: world.moved("post", rrtik.pose([0.3, 0.5, 0.4])),
    "with_obstacle": lambda world: world.with_obstacle(replace(POST, shape=rrtik.Box([0.2, 0.2, 0.1]))),
    "of": lambda world: rrtik.World.of(replace(world.settings, self_margin=0.001)),
    "unheld": lambda world: replace_constraints(world).unheld,
    "__reduce__": lambda world: pickle.loads(pickle.dumps(world)),
}


def replace_constraints(world):
    return rrtik.World.of(replace(world.settings, constraints=[rrtik.constraints.inside(UR5.fk(ROWS[0]), [9.0] * 3)]))


def thing(shape, seed):
    """An obstacle where the arm's tip is at one of the configurations, or one that is half of the room."""
    rng = np.random.default_rng(seed)
    if isinstance(shape, rrtik.HalfSpace):
        return rrtik.Obstacle("thing", shape, rrtik.pose([0.0, 0.0, rng.uniform(-0.2, 0.2)]))
    there = UR5.fk(ROWS[seed]).translation
    return rrtik.Obstacle("thing", shape, rrtik.pose([*there, *rng.uniform(-3.0, 3.0, 3)]))


def asked(world):
    """What a world says."""
    nearest = world.distances(ROWS[:1], nearest=2)
    free = [world.valid_batch(ROWS), world.certify(ROWS), world.motion_valid_batch(ROWS, ENDS)]
    proven = [world.motions_proven(ROWS, ENDS), world.prove(ROWS).proven, world.prover.digest]
    told = [world.contacts(ROWS[0]), world.violations([ROWS[0], ENDS[0]])]
    return [*free, *proven, *told, nearest.values, nearest.names, world.prover.margin]


def from_nothing(world):
    """The same world, of which nothing is known."""
    settings = world.settings
    arm_cache(settings.robot)._proofs = {}  # of which it would copy a table
    scene = replace(settings.scene, obstacles=[replace(each) for each in settings.scene.obstacles])
    return rrtik.World.of(replace(settings, scene=scene))


def alike(one, other):
    both = zip(one, other, strict=True)
    return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else str(a) == str(b) for a, b in both)


def touching_by_coal(shape, pose):
    """At which configurations a link touches a shape that stands somewhere, by coal and one solid at a time."""
    solids = solids_of(shape)
    data = UR5.model.createData()
    placed = UR5.collision.createData()
    touching = []
    for q in UR5.pinocchio_configuration(ROWS):
        pin.updateGeometryPlacements(UR5.model, data, UR5.collision, placed, q)
        links = [
            (link.geometry, placed.oMg[k]) for k, link in enumerate(UR5.collision.geometryObjects) if link.parentJoint
        ]
        asked = product(links, solids)
        touching.append(any(collides(link, at, solid, pose * own) for (link, at), (solid, own) in asked))
    return np.array(touching)


def solids_of(shape):
    if isinstance(shape, rrtik.PointCloud):
        return [(coal.Sphere(shape.radius), rrtik.pose(point.tolist())) for point in shape.points.astype(float)]
    if isinstance(shape, rrtik.Box):
        return [(coal.Box(*shape.size), rrtik.pose([0.0, 0.0, 0.0]))]
    return [(coal.Sphere(shape.radius), rrtik.pose([0.0, 0.0, 0.0]))]


def collides(one, at, other, there):
    poses = (coal.Transform3s(each.rotation, each.translation) for each in (at, there))
    first, second = poses
    return bool(coal.collide(one, first, other, second, coal.CollisionRequest(), coal.CollisionResult()))


def with_tables(shape):
    """A world of which everything is made that a later one may take over."""
    world = rrtik.World(UR5, rrtik.Scene([thing(shape, 1), POST, FAR]))
    asked(world)
    return world


@pytest.mark.parametrize(("before", "after"), PAIRS[: how_many(len(PAIRS), 14)])
def test_a_shape_in_the_place_of_another_is_as_if_it_had_always_been_there(before, after):
    world = with_tables(SHAPES[before])
    first = world.with_obstacle(thing(OTHERS[after], 2))
    second = first.with_obstacle(thing(SHAPES[after], 3)).moved("thing", thing(SHAPES[after], 4).pose)
    third = second.with_obstacle(thing(SHAPES[before], 5))
    for made in (third, first, world):  # what was taken over is made anew where it is asked for again
        assert alike(asked(made), asked(from_nothing(made)))


@pytest.mark.parametrize("name", ["box", "ball", "cloud"])
def test_coal_says_the_same(name):
    world = with_tables(SHAPES[name])
    for seed in range(2, 5):
        shape = (SHAPES if seed % 2 else OTHERS)[name]
        other = thing(shape, seed)
        world = world.with_obstacle(other)
        touching = touching_by_coal(shape, other.pose)
        alone = rrtik.World(UR5, rrtik.Scene([POST, FAR])).valid_batch(ROWS)
        assert touching.any()
        assert (world.valid_batch(ROWS) == (alone & ~touching)).all()
        assert (world.certify(ROWS) == (alone & ~touching)).all()
        assert not world.motions_proven(ROWS, ROWS)[touching].any()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", sorted(SHAPES, key=FIRST.index)[: how_many(len(SHAPES), 3)])
def test_every_way_on_from_there_knows_what_is_there_now(name, way):
    world = with_tables(SHAPES[name]).with_obstacle(thing(OTHERS[name], 2))
    world = world.moved("thing", thing(OTHERS[name], 3).pose)
    other = WAYS[way](world)
    assert alike(asked(other), asked(from_nothing(other)))
    assert alike(asked(world), asked(from_nothing(world)))


def test_each_way_and_each_shape_is_looked_at():
    ways = {name for name, member in vars(rrtik.World).items() if returns_a_world(member)}
    assert ways | {"__reduce__"} == set(WAYS)
    kinds = {kind for kind in vars(rrtik).values() if isinstance(kind, type) and issubclass(kind, Shape)}
    assert kinds - {Shape} == {type(shape) for shape in SHAPES.values()}


def returns_a_world(member):
    function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
    return isfunction(function) and get_annotations(function).get("return") == "World"


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["box", "ball", "cylinder", "capsule", "floor", "cloud", "octree"])
def test_nothing_is_packed_where_one_of_its_kind_was(name, monkeypatch):
    world = with_tables(SHAPES[name])
    monkeypatch.setattr(FastWorld, "__init__", None)
    monkeypatch.setattr(proof, "proof_pairs", None)
    for shape, seed in ((OTHERS[name], 2), (SHAPES[name], 3)):
        world = world.with_obstacle(thing(shape, seed))
        assert not world.valid_batch(ROWS).all()
        assert world.motions_proven(ROWS, ENDS).any()
        assert world.fast is None or world.fast.intact()


@pytest.mark.kernels
def test_what_a_proof_has_left_in_the_table_of_a_cloud_is_no_part_of_the_next_one():
    for one, other in pairwise([400, 3, 50, 1, 400]):
        clouds = [rrtik.PointCloud(RNG.uniform(-0.3, 0.3, (count, 3)), 0.02) for count in (one, other)]
        world = with_tables(clouds[0]).with_obstacle(thing(clouds[1], 2))
        assert alike(asked(world), asked(from_nothing(world)))


HELD = [name for name, shape in SHAPES.items() if shape.movable]


def holding(shape, seed):
    """A world with an obstacle, in which the arm holds a shape, somehow turned."""
    rng = np.random.default_rng(seed)
    pose = rrtik.pose([*rng.uniform(-0.1, 0.1, 3), *rng.uniform(-3.0, 3.0, 3)])
    held = rrtik.AttachedObject("held", "wrist_3_link", shape, pose, allow=["ee_link"])
    return rrtik.World(UR5, rrtik.Scene([thing(SHAPES["cloud"], seed), thing_of("box", seed)], [held]))


def thing_of(name, seed):
    return replace(thing(SHAPES[name], seed + 1), name=name)


def table_of(world):
    """The table of proofs of a world: all but what kernels compute in."""
    packed = world.prover._packed_for(0.01, 0.0)
    fields = [name for name in ProofTable.places if holds_array(ProofTable.kinds[name]) and name not in COMPUTED]
    arrays = {name: getattr(packed.table, name).copy() for name in fields if name not in ("clouds", "log", "log_ways")}
    own = {name: np.asarray(getattr(packed, name)) for name in ("bodies", "sides", "margins", "clear", "firsts")}
    return arrays | own | {"reaches": packed.sweeps.lanes().ravel(), "cloud": packed.clouds[0].blocks}


@pytest.mark.kernels
@pytest.mark.parametrize("name", HELD)
def test_the_table_of_what_is_held_elsewhere_is_the_one_that_packing_makes(name, monkeypatch):
    for seed, shape in enumerate((SHAPES[name], SHAPES[name], OTHERS[name])):
        world = holding(shape, seed)
        if seed == 1:  # after the first one, bodies are only put into a copy of its table
            monkeypatch.setattr(proof, "proof_pairs", forbidden_for(name))
        put = table_of(world)
        monkeypatch.undo()
        monkeypatch.setattr(ArmCache, "proof_table", lambda *_: None)
        made = table_of(holding(shape, seed))
        monkeypatch.undo()
        assert put.keys() == made.keys()
        for field in put:
            np.testing.assert_array_equal(put[field], made[field], err_msg=field)


@pytest.mark.kernels
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SHAPES)
def test_the_table_of_what_stands_elsewhere_is_the_one_that_packing_makes(name, way, monkeypatch):
    copied = 0
    copy_of_kept = ArmCache.proof_table

    def counted(*given):
        nonlocal copied
        table = copy_of_kept(*given)
        copied += table is not None
        return table

    def standing(seed):
        obstacles = [POST, FAR, thing(SHAPES["cloud"], seed), thing_of(name, seed)]
        return WAYS[way](rrtik.World(UR5, rrtik.Scene(obstacles)))

    for seed in range(2):
        monkeypatch.setattr(ArmCache, "proof_table", counted)
        put = table_of(standing(seed))
        monkeypatch.setattr(ArmCache, "proof_table", lambda *_: None)
        made = table_of(standing(seed))
        assert put.keys() == made.keys()
        for field in put:
            np.testing.assert_array_equal(put[field], made[field], err_msg=field)
    assert copied or way == "__reduce__"  # which has a robot of its own


@pytest.mark.kernels
def test_tables_that_are_copied_share_nothing_that_proofs_write_or_bodies_stand_in():
    arm_cache(UR5)._proofs = {}
    tables = [holding(SHAPES["box"], seed).prover._packed_for(0.0, 0.0).table for seed in range(3)]
    (_, kept), *_ = arm_cache(UR5)._proofs.values()
    for one, other in combinations([kept.table, *tables], 2):
        for name in (*COMPUTED, *PLACED, "solids"):
            assert not np.shares_memory(getattr(one, name), getattr(other, name)), name


@pytest.mark.kernels
def test_threads_that_remake_worlds_with_what_is_held_are_told_what_fresh_worlds_tell():
    arm_cache(UR5)._proofs = {}
    seeds = [(number % 6, name) for number in range(how_many(400, 5)) for name in ("box", "hull")]

    def told(seed, name):
        return holding(SHAPES[name], seed).motions_proven(ROWS, ENDS)

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda each: told(*each), seeds))
    for (seed, name), answer in zip(seeds, answers, strict=True):
        arm_cache(UR5)._proofs = {}
        np.testing.assert_array_equal(answer, told(seed, name))


@pytest.mark.parametrize("name", HELD)
def test_a_world_whose_arm_holds_a_thing_elsewhere_is_as_one_made_anew(name):
    world = holding(SHAPES[name], 0)
    asked(world)
    before = world
    for seed in range(1, 4):
        (item,) = holding(SHAPES[name], seed).scene.attached
        world = held_elsewhere(world, replace(item, shape=SHAPES[name]))
        assert alike(asked(world), asked(from_nothing(world)))
        post = thing(SHAPES["cloud"], seed)
        world = world.moved("thing", post.pose)
        assert alike(asked(world), asked(from_nothing(world)))
    assert alike(asked(before), asked(from_nothing(before)))


@pytest.mark.kernels
@pytest.mark.parametrize("name", HELD)
def test_the_table_that_another_hold_takes_over_is_the_one_that_packing_makes(name, monkeypatch):
    world = holding(SHAPES[name], 0)
    table_of(world)
    for seed in range(1, 4):
        (item,) = holding(SHAPES[name], seed).scene.attached
        taken = world.prover.tables.packed
        world = held_elsewhere(world, item)
        put = table_of(world)
        assert world.prover.tables.packed is taken or name not in PUT
        monkeypatch.setattr(ArmCache, "proof_table", lambda *_: None)
        made = table_of(from_nothing(world))
        monkeypatch.undo()
        for field in put:
            np.testing.assert_array_equal(put[field], made[field], err_msg=field)


@pytest.mark.kernels
def test_what_coal_has_measured_of_a_thing_is_not_said_of_it_where_it_is_held_elsewhere():
    world = holding(SHAPES["hull"], 0)
    measures = world.prover._coal_proof(world.prover.packed())
    (item,) = holding(SHAPES["hull"], 1).scene.attached
    world = held_elsewhere(world, item)
    assert world.prover._coal_proof(world.prover.packed()) is not measures


PUT = ("box", "ball", "cylinder", "capsule", "hull")  # put into tables where they are others


def forbidden_for(name):
    """What packs a table, for shapes that are packed anew where they are others; nothing for all others."""
    return None if name in PUT else proof.proof_pairs


@pytest.mark.kernels
def test_proofs_with_what_is_held_elsewhere_are_those_of_coal():
    count = 0
    for seed in range(6):
        shape = SHAPES[HELD[seed % len(HELD)]]
        world = holding(shape, seed)
        touching = [any("held" in (each.first, each.second) for each in world.contacts(q)) for q in ROWS]
        assert not world.motions_proven(ROWS, ROWS)[touching].any()
        count += sum(touching)
    assert count > 0
