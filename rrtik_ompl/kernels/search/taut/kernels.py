"""The kernel that pulls a route taut: every bend in turn steps towards the line between its neighbours, and aside.

A step has two parts of the same length: one straightens the bend, the other is random. So a bend slides along what it
touches, whatever way that lies. Its steps grow where they succeed and shrink where they fail, as in evolution
strategies: lengths fit each bend by themselves. A bend whose neighbours see each other is dropped.
"""

from __future__ import annotations

from math import sqrt

from rrtik_ompl.kernels.layout import FREE
from rrtik_ompl.kernels.record import Doubles
from rrtik_ompl.kernels.search.motions.proven_kernels import judge_near
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.search.taut import layout
from rrtik_ompl.kernels.search.taut.layout import HINT_SIZE, TightenTable
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share

DROP = 0.2  # probability that a bend is tried to be dropped
LONGER, SHORTER = 2.0, 0.84  # a step after one that succeeded, or failed
SHORTEST = 1e-3  # step that is not worth its checks
LEAST_BEND = 1e-4  # of the route's length: a bend that is less of a detour stays
LEAST_GAIN = 1e-6  # of the route's length: a step that gains less is none


@inlined
def dof_in(route: TightenTable) -> int:
    """How many numbers a configuration has."""
    return route.motions.dof


@inlined
def waypoint(route: TightenTable, number: int) -> Configuration:
    """Address of a waypoint."""
    return row_at(route.route, dof_in(route), number)


@kernel
def length_of(route: TightenTable) -> float:
    """Of the whole route."""
    total = 0.0
    for k in range(1, route.count):
        total += distance(dof_in(route), waypoint(route, k - 1), waypoint(route, k))
    return total


@inlined
def passes(route: TightenTable, start: Configuration, end: Configuration, hint: Doubles) -> bool:
    """Whether a motion is free; the hint says where one like it failed last."""
    route.checks += 1
    return bool(judge_near(route.motions, start, end, hint) == FREE)


@kernel
def drop_bend(route: TightenTable, bend: int) -> None:
    """Take a bend out of the route."""
    after = route.count - bend - 1
    size = 2 * HINT_SIZE
    copy_row(after * dof_in(route), waypoint(route, bend + 1), waypoint(route, bend))
    copy_row(after, row_at(route.steps, 1, bend + 1), row_at(route.steps, 1, bend))
    copy_row(after * size, row_at(route.hints, size, bend + 1), row_at(route.hints, size, bend))
    route.count -= 1


@kernel
def propose(route: TightenTable, bend: int, step: float) -> float:
    """Draw the new place of a bend; the length of its two motions then."""
    dof = dof_in(route)
    target = route.point
    before = waypoint(route, bend - 1)
    here = waypoint(route, bend)
    after = waypoint(route, bend + 1)
    share = distance(dof, before, here)
    share /= max(share + distance(dof, here, after), 1e-300)

    straight = 0.0  # squared lengths of both parts
    aside = 0.0
    for k in range(dof):
        way = (1.0 - share) * before[k] + share * after[k] - here[k]
        straight += way * way
        drawn = 2.0 * next_share(route) - 1.0
        aside += drawn * drawn
        target[k] = drawn

    size = sqrt(straight / max(aside, 1e-300))
    for k in range(dof):
        way = (1.0 - share) * before[k] + share * after[k] - here[k]
        low = min(before[k], here[k], after[k])
        high = max(before[k], here[k], after[k])
        value = here[k] + step * (way + size * target[k])
        target[k] = min(max(value, low), high)
    return distance(dof, before, target) + distance(dof, target, after)


@kernel
def fits(route: TightenTable, bend: int) -> bool:
    """Whether both motions by the new place of a bend are free; first the side that failed last."""
    point = route.point
    before = waypoint(route, bend - 1)
    after = waypoint(route, bend + 1)
    hint = row_at(route.hints, 2 * HINT_SIZE, bend)
    other = row_at(hint, HINT_SIZE, 1)
    if hint[0] < 0.0:
        return passes(route, point, after, other) and passes(route, before, point, hint)
    return passes(route, before, point, hint) and passes(route, point, after, other)


@kernel
def move_bend(route: TightenTable, bend: int, total: float) -> bool:
    """Give a bend its turn; whether it was dropped."""
    dof = dof_in(route)
    before = waypoint(route, bend - 1)
    here = waypoint(route, bend)
    after = waypoint(route, bend + 1)
    length = distance(dof, before, here) + distance(dof, here, after)
    step = route.steps[bend]
    if length - distance(dof, before, after) < LEAST_BEND * total or step < SHORTEST:
        return False

    route.moved = 1
    dropping = next_share(route) < DROP
    hint = row_at(route.hints, 2 * HINT_SIZE, 0)
    if dropping and passes(route, before, after, hint):
        drop_bend(route, bend)
        return True

    shorter = propose(route, bend, step) < length - LEAST_GAIN * total
    if shorter and fits(route, bend):
        copy_row(dof, route.point, here)
        route.steps[bend] = min(1.0, LONGER * step)
    else:
        route.steps[bend] = SHORTER * step
    return False


@entry
def tighten(route: TightenTable, checks: int) -> int:
    """Go on until ``checks`` motions have been checked since the beginning. Returns DONE or RUNNING."""
    while route.checks < checks:
        bend = route.bend
        if bend >= route.count - 1:
            if route.moved == 0:
                return layout.DONE
            route.moved = 0
            route.sweeps += 1
            route.bend = 1
            continue
        if not move_bend(route, bend, length_of(route)):
            route.bend += 1
    return layout.RUNNING
