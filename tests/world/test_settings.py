"""Settings of a world: refused in one place, replaced by the next, named by messages and by the repr."""

from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError, ProblemError
from rrtik_ompl.world.moving_world import MovingWorld

BALL = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([3.4, 0.0, 0.0]))
Q = np.zeros(3)


@pytest.fixture
def world():
    return rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([BALL]))


def test_a_second_clearance_takes_the_place_of_the_first_and_0_takes_it_away(world):
    wide = world.with_clearance(0.5)
    assert not wide.valid(Q)
    assert wide.with_clearance(0.1).valid(Q)
    assert wide.with_clearance(0.0).valid(Q)
    assert wide.with_clearance(0.0).settings.clearance == 0.0
    assert wide.proving(0.1).proving(None).settings.proving is None


@pytest.mark.parametrize("size", [1e-9, 0.0, -1.0, float("nan"), float("inf"), "fine"])
def test_a_resolution_is_refused_by_every_form_as_by_the_constructor(world, size):
    said = []
    for make in (lambda: rrtik.World(world.robot, motion_resolution=size), lambda: world.with_resolution(size)):
        with pytest.raises(InputError) as error:
            make()
        said.append(str(error.value))
    assert said[0] == said[1]


def test_the_finest_resolution_can_be_planned_with(world):
    fine = world.with_resolution(1e-5)
    assert rrtik.plan(rrtik.Problem(fine, Q, [0.02, 0.0, 0.0]), seed=1).found


def test_what_is_nearer_than_the_clearance_is_named_so(world):
    wide = world.with_clearance(0.5)
    line = "'link3' and 'ball' are 299.9 mm apart, nearer than the clearance of 500 mm asked for"
    assert wide.explain(Q) == line
    (near,) = wide.too_near(Q)
    assert (near.first, near.second, near.margin) == ("link3", "ball", 0.5)
    assert wide.contacts(Q) == ()
    with pytest.raises(ProblemError) as error:
        rrtik.Problem(wide, Q, [1.0, 0.0, 0.0])
    assert str(error.value).startswith(f"start is too near: {line}; ")
    assert "lower the clearance" in str(error.value)
    assert error.value.contacts == (("link3", "ball"),)


@pytest.mark.kernels
def test_whatever_is_not_valid_has_an_explanation():
    robot, rng = rrtik.load_robot("ur5"), np.random.default_rng(4)
    floor = rrtik.Obstacle("floor", rrtik.HalfSpace([0.0, 0.0, 1.0], -0.1))
    post = rrtik.Obstacle("post", rrtik.Cylinder(0.1, 1.0), rrtik.pose([0.5, 0.2, 0.3]), margin=0.01)
    world = rrtik.World(robot, rrtik.Scene([floor, post]), clearance=0.05, self_margin=0.005)
    rows = rng.uniform(*robot.finite_range(), (150, 6))
    for form in (world, world.with_accuracy("conservative"), world.with_clearance(0.0)):
        valid = form.valid_batch(rows)
        assert [bool(form.explain(q)) for q in rows] == (~valid).tolist()
        assert 0.1 < valid.mean() < 0.9


def test_the_repr_shows_what_is_not_the_default(world):
    assert repr(world) == "World(planar3, Scene(ball))"
    form = world.with_clearance(0.05).proving().with_accuracy("conservative").with_resolution(0.02)
    shown = "accuracy=conservative, motion_resolution=0.02 m, clearance=0.05 m, proving=0 m"
    assert repr(form) == f"World(planar3, Scene(ball), {shown})"


@pytest.mark.kernels
def test_a_plan_in_a_world_with_a_clearance_keeps_it():
    post = rrtik.Obstacle("post", rrtik.Cylinder(0.2, 1.0), rrtik.pose([2.0, 1.2, 0.0]))
    world = rrtik.World(rrtik.load_robot("planar3"), rrtik.Scene([post]), clearance=0.05)
    found = rrtik.plan(rrtik.Problem(world, Q, [1.2, 0.0, 0.0]), seed=1)
    assert found.found
    rows = found.path.resample(0.01).waypoints
    assert world.valid_batch(rows).all()
    assert found.path.proof.clearance >= 0.05


def test_a_moving_world_keeps_what_its_world_keeps_or_refuses_it(world):
    q = np.array(Q, dtype=np.float64)
    assert MovingWorld(world).valid(q)
    wide = MovingWorld(world.with_clearance(0.5))
    assert not wide.valid(q)
    wide.move(world.scene)
    assert not wide.valid(q)
    region = rrtik.TaskRegion(rrtik.pose([0.0, 0.0, 0.0]), np.tile([-9.0, 9.0], (6, 1)))
    with pytest.raises(InputError, match="path constraints"):
        MovingWorld(rrtik.World.of(replace(world.settings, constraints=[region])))


@pytest.mark.kernels
def test_a_roadmap_is_checked_again_in_a_world_that_keeps_more(world, tmp_path):
    near = world.with_scene(rrtik.Scene([rrtik.Obstacle("ball", rrtik.Sphere(0.3), rrtik.pose([1.5, 1.0, 0.0]))]))
    rrtik.Roadmap(near, vertices=60, seed=1).save(tmp_path / "map.npz")
    wide = near.with_clearance(0.4)
    roadmap = rrtik.Roadmap.load(tmp_path / "map.npz", wide)
    ends = roadmap.vertices[roadmap.edges]
    assert wide.valid_batch(ends.reshape(-1, 3)).all()
    known = rrtik.Roadmap.load(tmp_path / "map.npz", near)
    assert not wide.valid_batch(known.vertices[known.edges].reshape(-1, 3)).all()
