"""The kernel that pulls a route taut: every bend in turn steps towards the line between its neighbours, and aside.

A step has two parts of the same length: one straightens the bend, the other is random. So a bend slides along what it
touches, whatever way that lies. Its steps grow where they succeed and shrink where they fail, as in evolution
strategies: lengths fit each bend by themselves. A bend whose neighbours see each other is dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

from rrtik_ompl.kernels.layout import FREE, DoubleArray
from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.proven_kernels import judge_near
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.taut import layout
from rrtik_ompl.kernels.search.taut.layout import HINT_SIZE, TightenTable
from rrtik_ompl.kernels.simd.access import count_up, double_row, field_reader
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_field
from rrtik_ompl.kernels.simd.random_kernels import next_share_at

DROP = 0.2  # probability that a bend is tried to be dropped
LONGER, SHORTER = 2.0, 0.84  # a step after one that succeeded, or failed
SHORTEST = 1e-3  # step that is not worth its checks
LEAST_BEND = 1e-4  # of the route's length: a bend that is less of a detour stays
LEAST_GAIN = 1e-6  # of the route's length: a step that gains less is none

motions_of: Callable[[TightenTable], MotionTable] = field_reader(layout.MOTIONS)
route_of: Callable[[TightenTable], Configuration] = field_reader(layout.ROUTE)
point_of: Callable[[TightenTable], Configuration] = field_reader(layout.POINT)
steps_of: Callable[[TightenTable], DoubleArray] = field_reader(layout.STEPS)
hints_of: Callable[[TightenTable], DoubleArray] = field_reader(layout.HINTS)
count_of: Callable[[TightenTable], int] = field_reader(layout.COUNT)


@inlined
def dof_in(route: TightenTable) -> int:
    """How many numbers a configuration has."""
    return dof_of(motions_of(route))


@inlined
def waypoint(route: TightenTable, number: int) -> Configuration:
    """Address of a waypoint."""
    return row_at(route_of(route), dof_in(route), number)


@kernel
def length_of(route: TightenTable) -> float:
    """Of the whole route."""
    total = 0.0
    for k in range(1, count_of(route)):
        total += distance(dof_in(route), waypoint(route, k - 1), waypoint(route, k))
    return total


@inlined
def passes(route: TightenTable, start: Configuration, end: Configuration, hint: DoubleArray) -> bool:
    """Whether a motion is free; the hint says where one like it failed last."""
    count_up(route, layout.CHECKS)
    return bool(judge_near(motions_of(route), start, end, hint) == FREE)


@kernel
def drop_bend(route: TightenTable, bend: int) -> None:
    """Take a bend out of the route."""
    dof, after = dof_in(route), count_of(route) - bend - 1
    copy_row(after * dof, waypoint(route, bend + 1), waypoint(route, bend))
    copy_row(after, steps_of(route) + 8 * (bend + 1), steps_of(route) + 8 * bend)
    size = 2 * HINT_SIZE
    copy_row(after * size, double_row(hints_of(route), size, bend + 1), double_row(hints_of(route), size, bend))
    set_field(route, layout.COUNT, count_of(route) - 1)


@kernel
def propose(route: TightenTable, bend: int, step: float) -> float:
    """Draw the new place of a bend; the length of its two motions then."""
    dof, target = dof_in(route), point_of(route)
    before, here, after = waypoint(route, bend - 1), waypoint(route, bend), waypoint(route, bend + 1)
    share = distance(dof, before, here)
    share /= max(share + distance(dof, here, after), 1e-300)
    straight = aside = 0.0
    for k in range(dof):
        way = (1.0 - share) * double_at(before, k) + share * double_at(after, k) - double_at(here, k)
        straight += way * way
        drawn = 2.0 * next_share_at(route, layout.RANDOM) - 1.0
        aside += drawn * drawn
        set_double(target, k, drawn)
    size = sqrt(straight / max(aside, 1e-300))
    for k in range(dof):
        way = (1.0 - share) * double_at(before, k) + share * double_at(after, k) - double_at(here, k)
        low = min(double_at(before, k), double_at(here, k), double_at(after, k))
        high = max(double_at(before, k), double_at(here, k), double_at(after, k))
        value = double_at(here, k) + step * (way + size * double_at(target, k))
        set_double(target, k, min(max(value, low), high))
    return distance(dof, before, target) + distance(dof, target, after)


@kernel
def fits(route: TightenTable, bend: int) -> bool:
    """Whether both motions by the new place of a bend are free; first the side that failed last."""
    before, point, after = waypoint(route, bend - 1), point_of(route), waypoint(route, bend + 1)
    hint = double_row(hints_of(route), 2 * HINT_SIZE, bend)
    other = double_row(hint, HINT_SIZE, 1)
    if double_at(hint, 0) < 0.0:
        return passes(route, point, after, other) and passes(route, before, point, hint)
    return passes(route, before, point, hint) and passes(route, point, after, other)


@kernel
def move_bend(route: TightenTable, bend: int, total: float) -> bool:
    """Give a bend its turn; whether it was dropped."""
    dof, steps = dof_in(route), steps_of(route)
    before, here, after = waypoint(route, bend - 1), waypoint(route, bend), waypoint(route, bend + 1)
    length, step = distance(dof, before, here) + distance(dof, here, after), double_at(steps, bend)
    if length - distance(dof, before, after) < LEAST_BEND * total or step < SHORTEST:
        return False
    set_field(route, layout.MOVED, 1)
    dropping, hint = next_share_at(route, layout.RANDOM) < DROP, double_row(hints_of(route), 2 * HINT_SIZE, 0)
    if dropping and passes(route, before, after, hint):
        drop_bend(route, bend)
        return True
    shorter = propose(route, bend, step) < length - LEAST_GAIN * total
    if shorter and fits(route, bend):
        copy_row(dof, point_of(route), here)
        set_double(steps, bend, min(1.0, LONGER * step))
    else:
        set_double(steps, bend, SHORTER * step)
    return False


@entry
def tighten(route: TightenTable, checks: int) -> int:
    """Go on until ``checks`` motions have been checked since the beginning. Returns DONE or RUNNING."""
    while field(route, layout.CHECKS) < checks:
        bend = field(route, layout.BEND)
        if bend >= count_of(route) - 1:
            if field(route, layout.MOVED) == 0:
                return layout.DONE
            set_field(route, layout.MOVED, 0)
            count_up(route, layout.SWEEPS)
            set_field(route, layout.BEND, 1)
            continue
        if not move_bend(route, bend, length_of(route)):
            set_field(route, layout.BEND, bend + 1)
    return layout.RUNNING
