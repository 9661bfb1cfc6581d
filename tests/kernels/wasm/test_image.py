"""Tables as an image of another memory."""

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.kernels.tables.memory import table
from rrtik_ompl.kernels.wasm.image import MemoryImage

BASE = 1 << 20


def test_fields_that_point_move_along_and_numbers_stay():
    inner = table({0: 7, 1: np.arange(3.0)})
    outer = table({0: inner.address, 1: 5, 2: np.array([1, 2], dtype=np.int32), 3: 0})
    image = MemoryImage(BASE)
    image.add(inner)
    place = image.add(outer, links={0: inner}, same={3: 2})
    memory = image.bytes()
    header = np.frombuffer(memory, dtype=np.int64, count=4, offset=place - BASE)
    assert header[0] == image.place(inner)
    assert header[1] == 5
    assert header[3] == header[2]
    numbers = np.frombuffer(memory, dtype=np.int32, count=2, offset=int(header[2]) - BASE)
    np.testing.assert_array_equal(numbers, [1, 2])
    first = np.frombuffer(memory, dtype=np.int64, count=2, offset=image.place(inner) - BASE)
    assert first[0] == 7
    np.testing.assert_array_equal(np.frombuffer(memory, count=3, offset=int(first[1]) - BASE), [0.0, 1.0, 2.0])
    assert len(memory) == image.end - BASE


def test_what_is_there_already_is_not_added_again_and_what_is_not_cannot_be_pointed_to():
    shared, image = np.zeros(4), MemoryImage(BASE)
    assert image.add(shared) == image.add(shared)
    with pytest.raises(KeyError):
        image.add(table({0: 0}), links={0: table({0: 1})})


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
