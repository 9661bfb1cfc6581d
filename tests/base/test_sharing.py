"""Parts are made once of the same values, and live as long as somebody holds them."""

import gc
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.sharing import Shared


class Part:
    def __init__(self, *values):
        self.values = values


class OwnPart(Part):
    def for_thread(self):
        return OwnPart(*self.values, "own")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((1, "a"), (1, "a"), True),
        ((1,), (1.0,), False),
        ((1,), (True,), False),
        ((None,), (0,), False),
        (((1, 2), 3), ((1, 2), 3), True),
        ((1, 2, 3), ((1, 2), 3), False),
    ],
)
def test_numbers_texts_and_tuples_are_the_same_where_they_are_equal(one, other, same):
    parts = Shared(Part)
    first = parts.of(*one)
    assert (parts.of(*other) is first) == same


def test_objects_are_the_same_where_they_are_one():
    parts = Shared(Part)
    row = np.zeros(3)
    first = parts.of((row, 1))
    assert parts.of((row, 1)) is first
    assert parts.of((np.zeros(3), 1)) is not first


def test_a_part_ends_when_nobody_holds_it_and_its_values_with_it():
    made = []
    parts = Shared(lambda value: made.append(id(value)) or Part())
    for _ in range(100):  # their addresses are used again and again
        parts.of(np.zeros(3))
    gc.collect()
    assert len(made) == 100


def test_each_thread_has_a_part_of_its_own_where_that_is_needed():
    own, common = Shared(OwnPart), Shared(Part)
    here = own.of("a"), common.of("a")
    with ThreadPoolExecutor(1) as pool:
        there = pool.submit(lambda: (own.of("a"), own.of("a"), common.of("a"))).result()
    assert here[0].values == ("a",)
    assert there[0].values == ("a", "own")
    assert there[1] is there[0]
    assert there[2] is here[1]
    assert own.of("a") is here[0]


@pytest.mark.parametrize("kind", [Part, OwnPart])
def test_threads_that_want_the_same_part_make_it_once(kind):
    made = []

    def make(value):
        made.append(value)
        if len(made) == 1:
            raise InterruptedError  # what could not be made is made by whoever waits for it
        time.sleep(0.01)
        return kind(value)

    parts = Shared(make)
    together = Barrier(4)

    def ask(_):
        together.wait()
        try:
            return parts.of("a")
        except InterruptedError:
            return None

    with ThreadPoolExecutor(4) as pool:
        found = [part for part in pool.map(ask, range(4)) if part is not None]
    assert made == ["a", "a"]
    assert len(found) == 3
    assert len({id(part) for part in found}) == (1 if kind is Part else 3)


def test_what_is_kept_is_found():
    parts = Shared(Part)
    kept = parts.keep(Part("moved"), "b")
    assert parts.of("b") is kept


@pytest.mark.kernels
def test_worlds_of_the_same_values_share_what_depends_on_them():
    robot = rrtik.load_robot("planar3")
    scene = rrtik.Scene((rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([0.9, 0.0, 0.0])),))
    world = rrtik.World(robot, scene)
    wide = world.with_clearance(0.02)
    assert rrtik.World(robot, scene).fast is world.fast
    assert rrtik.World(robot, scene, clearance=0.02).fast is wide.fast
    assert world.proving().prover is world.prover
    assert world.with_clearance(0.03).with_clearance(0.0).fast is world.fast
    assert rrtik.World(robot, rrtik.Scene(scene.obstacles)).fast is world.fast
    other = rrtik.Scene(scene.obstacles, allowed_collisions=[("link1", "ball")])
    assert rrtik.World(robot, other).fast is not world.fast


@pytest.mark.parametrize("first", ["exact", "conservative"])
def test_both_accuracies_share_tables_in_either_order_also_when_moved(first):
    robot = rrtik.load_robot("planar3")
    ball = rrtik.Obstacle("ball", rrtik.Sphere(0.1), rrtik.pose([0.9, 0.0, 0.0]))
    other = {"exact": "conservative", "conservative": "exact"}[first]
    world = rrtik.World(robot, rrtik.Scene((ball,)), accuracy=first)
    for each in (world, world.moved("ball", [0.8, 0.1, 0.0])):
        assert each.accuracy == first
        assert each.with_accuracy(other).fast is each.fast
