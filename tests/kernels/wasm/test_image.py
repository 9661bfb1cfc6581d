"""Tables as an image of another memory."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.record import Doubles, Ints, Record, Tables
from rrtik_ompl.kernels.tables.memory import packed
from rrtik_ompl.kernels.wasm.image import MemoryImage

BASE = 1 << 20


class Inner(Record):
    """A table that others point to."""

    number: int
    row: Doubles


class Outer(Record):
    """A field of each kind that points, and some that do not."""

    inner: Inner
    count: int
    ints: Ints
    inners: Tables
    none: Inner
    absent: Doubles


def words(memory, address, count, kind=np.int64):
    return np.frombuffer(memory, dtype=kind, count=count, offset=int(address) - BASE).tolist()


def test_fields_that_point_move_along_and_numbers_stay():
    inner = packed(Inner, number=7, row=np.arange(3.0))
    other = packed(Inner, number=8)
    outer = packed(Outer, inner=inner, count=5, ints=np.array([1, 2], dtype=np.int32), inners=[other, inner])
    image = MemoryImage(BASE)
    place = image.add(outer)
    memory = image.bytes()
    fields = words(memory, place, 6)
    assert fields[0] == image.place(inner)
    assert fields[1] == 5
    assert words(memory, fields[2], 2, np.int32) == [1, 2]
    assert words(memory, fields[3], 2) == [image.place(other), image.place(inner)]
    assert fields[4:] == [0, 0]
    number, row = words(memory, image.place(inner), 2)
    assert number == 7
    assert words(memory, row, 3, np.float64) == [0.0, 1.0, 2.0]
    assert len(memory) == image.end - BASE


def test_what_is_there_already_is_not_added_again_and_what_is_not_has_no_place():
    shared = np.zeros(4)
    image = MemoryImage(BASE)
    assert image.add(shared) == image.add(shared)
    with pytest.raises(KeyError):
        image.place(packed(Inner))


@pytest.mark.kernels
def test_no_address_of_this_process_is_left_in_the_image_of_a_world():
    from rrtik_ompl.viewer.page_planner import page_tables  # what a page is given

    problem = rrtik.load_problem("titan4_sdu")
    motions = problem.world.motions
    image, _ = page_tables(problem, problem.world, motions)
    words = np.frombuffer(image.bytes(), dtype=np.int64)
    here = set(image._places)  # of every table and array that was added
    assert len(here) > 100
    assert here.isdisjoint(words.tolist())
