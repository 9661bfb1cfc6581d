"""What the worlds of a task have in common is made once: the arm, the bodies, the tables of proofs."""

from dataclasses import replace

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.ik import goal_configurations
from rrtik_ompl.kernels import FastWorld
from rrtik_ompl.kernels.tables import packing
from rrtik_ompl.tasks.setting import Setting
from rrtik_ompl.world import proof

pytestmark = pytest.mark.kernels


def test_a_plan_packs_tables_only_where_something_is_checked_or_proven(monkeypatch):
    task = rrtik.Task.load("panda_pick_place")
    assert task.plan(seed=1).found  # the arm with open fingers is known from here on
    counts = dict.fromkeys(("worlds", "proofs", "arms", "reasons"), 0)

    def counted(name, function):
        def call(*args, **options):
            counts[name] += 1
            return function(*args, **options)

        return call

    monkeypatch.setattr(FastWorld, "__init__", counted("worlds", FastWorld.__init__))
    monkeypatch.setattr(proof, "proof_pairs", counted("proofs", proof.proof_pairs))
    monkeypatch.setattr(packing, "arm_table", counted("arms", packing.arm_table))
    monkeypatch.setattr(goal_configurations, "_explain_miss", counted("reasons", goal_configurations._explain_miss))
    plan = task.plan(seed=2)
    assert plan.found
    assert plan.proven
    plan.time_parameterize()

    # Ten worlds have contacts, things held and fingers of their own; one arm holds the cup as never before.
    assert counts["worlds"] <= 3
    assert counts["proofs"] <= 4
    assert counts["arms"] <= 1
    assert counts["reasons"] == 0  # one of the goals is out of reach, and nobody asks by how much


@pytest.fixture(scope="module")
def resting():
    """A cup on a table that a Panda's hand holds, with and without their contact."""
    task = rrtik.Task.load("panda_pick_place")
    plan = task.plan(seed=0)
    world = next(each for each in plan.worlds if each.scene.attached and each.scene.contacts)
    path = plan.paths[plan.worlds.index(world)]
    return world, path


def test_a_table_with_contacts_is_the_one_that_packing_makes(resting):
    world, path = resting
    assert world.prover.bare is not None
    fresh = rrtik.World.of(replace(world.settings, scene=replace(world.scene, obstacles=list(world.scene.obstacles))))
    other = replace(fresh.prover, bare=None)
    made, known = (each._packed_for(0.01, 0.0) for each in (other, world.prover))
    for name in ("bodies", "sides", "margins", "beside_obstacle", "clear", "touching"):
        np.testing.assert_array_equal(getattr(made, name), getattr(known, name))
    np.testing.assert_array_equal(made.table.margins, known.table.margins)
    np.testing.assert_array_equal(made.table.pairs, known.table.pairs)
    assert other.route(path.waypoints).proven == world.prover.route(path.waypoints).proven is True


def test_a_world_without_contacts_keeps_its_tables_where_another_one_has_some(resting):
    world, path = resting
    bare = world.with_scene(replace(world.scene, contacts=()))
    known = bare.prover._packed_for(0.0, 0.0)
    assert not known.touching
    assert not bare.prover.route(path.waypoints).proven  # the cup is on the table
    assert world.prover.route(path.waypoints).proven
    assert not bare.prover.route(path.waypoints).proven
    assert known.intact()


def test_a_scene_with_a_contact_is_moved_without_changing_the_tables_of_others(resting):
    world, path = resting
    assert world.prover.route(path.waypoints).proven
    moved = world.moved("wall", [5.0, 5.0, 5.0])
    assert moved.prover.route(path.waypoints).proven
    assert not world.moved("wall", world.robot.fk(path.end)).prover.route(path.waypoints).proven
    assert world.prover.route(path.waypoints).proven


def test_a_world_in_contact_stays_as_it_is_where_the_one_without_contacts_is_moved(resting):
    world, path = resting
    bare = world.with_scene(replace(world.scene, contacts=()))
    assert bare.prover is world.prover.bare
    assert world.prover.route(path.waypoints).proven
    table = bare.prover.tables.packed

    in_the_way = bare.moved("wall", world.robot.fk(path.end))
    blocked = in_the_way.with_scene(replace(in_the_way.scene, contacts=world.scene.contacts))
    assert blocked.prover.bare is in_the_way.prover
    assert not blocked.prover.route(path.waypoints).proven
    assert in_the_way.prover.tables.packed is table  # its rows were written where the world in contact had them
    assert world.prover.route(path.waypoints).proven

    aside = in_the_way.moved("wall", [5.0, 5.0, 5.0])
    assert not aside.prover.route(path.waypoints).proven  # the cup is on the table
    assert not blocked.prover.route(path.waypoints).proven
    assert world.prover.route(path.waypoints).proven


def test_where_bodies_are_is_asked_of_the_world_without_contacts(resting):
    world, _ = resting
    setting = Setting.of(world)
    assert setting.world is world
    bare = setting.bare
    assert bare.scene.contacts == ()
    assert bare.scene.obstacles == world.scene.obstacles
    assert bare.pairs == world.pairs
    for body, other in zip(world.bodies, bare.bodies, strict=True):
        assert (body.name, body.joint, body.placement) == (other.name, other.joint, other.placement)
        assert body.geometry is other.geometry
        assert not other.contacts
    assert setting.with_contacts_only(()).bare is bare
