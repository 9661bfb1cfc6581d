"""A table that is declared as a class: what stands where, and that Python and kernels see the same."""

import gc
import weakref

import numpy as np
import pytest

from rrtik_ompl.kernels.record import Doubles, Floats, Ints, Record, Tables, Wholes
from rrtik_ompl.kernels.simd.compiled import entry, kernel
from rrtik_ompl.kernels.simd.records import exists, row_at, same_place, table_reader
from rrtik_ompl.kernels.tables.memory import PlannedTable, aligned, packed, sizes_of


class Inner(Record):
    """A table that another one points to."""

    number: int
    row: Doubles


class Outer(Record):
    """A field of each kind."""

    count: int
    share: float
    inner: Inner
    doubles: Doubles
    floats: Floats
    ints: Ints
    wholes: Wholes
    absent: Doubles
    inners: Tables


inner_at = table_reader(Inner)


@entry
def work(table: Outer, number: int) -> int:
    table.count += number
    table.share *= 0.5
    table.inner.number = table.count
    for k in range(2):
        table.doubles[k] += 0.25
        table.floats[k] = table.floats[k] * 2.0
        table.ints[k] -= 7
        table.wholes[k] = table.wholes[k] + table.inner.number
    row_at(table.inner.row, 2, 1)[0] = table.share
    return (1 if exists(table.absent) else 0) + (2 if same_place(table.doubles, table.inner.row) else 0)


@kernel
def second(table: Outer) -> float:
    return inner_at(table.wholes, 1).row[0]


@kernel
def last(table: Outer) -> float:
    return inner_at(table.inners, 1).row[0]


class Wider(Inner):
    """A table that begins as another one does."""

    width: float


@kernel
def doubled(table: Inner) -> float:
    return 2.0 * table.row[table.number]


@kernel
def doubled_of_wider(table: Wider) -> float:
    table.width = doubled(table)
    return table.width


def outer(**fields):
    inner = packed(Inner, number=3, row=np.arange(4.0))
    arrays = {
        "doubles": np.array([1.0, 2.0]),
        "floats": np.array([1.5, 2.5], dtype=np.float32),
        "ints": np.array([1, 2], dtype=np.int32),
        "wholes": np.array([10, 20]),
    }
    return packed(Outer, count=5, share=0.5, inner=inner, **(arrays | fields))


def test_fields_stand_in_the_order_of_the_class_a_word_each():
    table = outer()
    assert list(Outer.places) == ["count", "share", "inner", "doubles", "floats", "ints", "wholes", "absent", "inners"]
    words = table.memory.header
    assert words[0] == 5
    assert words[1:2].view(np.float64)[0] == 0.5
    assert words[2] == table.inner.address
    assert words[3] == table.doubles.ctypes.data
    assert words[7] == 0


@pytest.mark.kernels
def test_python_and_kernels_see_the_same():
    table = outer()
    assert work(table, 4) == 0
    assert (table.count, table.share, table.inner.number) == (9, 0.25, 9)
    assert table.doubles.tolist() == [1.25, 2.25]
    assert table.floats.tolist() == [3.0, 5.0]
    assert table.ints.tolist() == [-6, -5]
    assert table.wholes.tolist() == [19, 29]
    assert table.inner.row.tolist() == [0.0, 1.0, 0.25, 3.0]
    assert table.intact()
    assert table.inner.intact()


@pytest.mark.kernels
def test_arrays_may_be_one_and_be_absent_no_more():
    table = outer()
    table.put(absent=table.doubles, doubles=table.inner.row)
    assert work(table, 0) == 3


@pytest.mark.kernels
def test_addresses_of_tables_in_an_array_lead_to_them():
    inner = packed(Inner, row=np.array([8.0]))
    assert second(outer(wholes=np.array([0, inner.address]))) == 8.0


@pytest.mark.kernels
def test_a_list_of_tables_is_kept_and_leads_to_each():
    table = outer(inners=[packed(Inner), packed(Inner, row=np.array([9.0]))])
    assert last(table) == 9.0
    assert [len(inner.row) for inner in table.inners[1:]] == [1]
    assert outer().inners == ()


def test_a_table_in_one_piece_has_the_numbers_and_arrays_that_were_asked_for():
    table = Outer(PlannedTable(sizes_of(Outer, doubles=3, absent=0, count=7, share=0.125)))
    table.doubles[:] = 1.0
    assert (table.count, table.share, table.inner, len(table.doubles)) == (7, 0.125, None, 3)
    assert table.memory.header[Outer.places["absent"]] == 0
    assert table.intact()


def test_what_a_table_points_to_lives_as_long_as_it_does():
    table = outer()
    kept = weakref.ref(table.inner)
    gc.collect()
    assert kept() is not None
    table.inner = packed(Inner)
    gc.collect()
    assert kept() is None


def test_an_array_that_takes_the_place_of_another_is_guarded_too():
    table = outer()
    larger = aligned(np.zeros(10))
    table.put(doubles=larger)
    assert table.intact()
    np.asarray(larger.base)[-1] = 0
    assert not table.intact()


@pytest.mark.parametrize("make", [lambda: packed(Inner, numbr=1), lambda: sizes_of(Inner, rows=3)])
def test_a_field_that_is_not_declared_is_refused(make):
    with pytest.raises((AttributeError, KeyError), match=r"numbr|rows"):
        make()


def test_a_table_that_inherits_has_the_inherited_fields_first_and_goes_where_those_are_read():
    wider = packed(Wider, number=2, row=np.arange(4.0), width=0.5)
    assert [*Wider.places] == ["number", "row", "width"]
    assert [*Inner.places] == ["number", "row"]
    assert (wider.number, wider.width) == (2, 0.5)
    assert doubled_of_wider(wider) == doubled(wider) == wider.width == 4.0
