"""Projection onto regions in kernels, and whether straight motions keep them.

Sources: damped Gauss-Newton steps on all regions at once [22, 23]; the bound on motions is that of
:meth:`rrtik_ompl.constraints.held_regions.HeldRegions.motions_held`, with fewer halvings.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.ik.cholesky import solve_in_place
from rrtik_ompl.kernels.ik.ik_accessors import column_at
from rrtik_ompl.kernels.ik.ik_layout import TWIST_NUMBERS, Pose
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import HeldTable, RegionTable
from rrtik_ompl.kernels.search.constrained.region_kernels import (
    origin_measure,
    place_frame,
    region_at,
    set_columns,
    set_origin_residual,
    set_turn_residual,
    turn_measure,
)
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration
from rrtik_ompl.kernels.simd.compiled import inlined, kernel
from rrtik_ompl.kernels.simd.records import row_at

HALVINGS = 3  # of a motion, at most
PATIENCE, STALLED = 8, 0.5  # steps after which the squared residual must be down to this share
SHARE = 0.5  # of the squared residual, that is added to the damping


@kernel
def clear_sums(held: HeldTable) -> None:
    """Begin a step: no rows yet."""
    dof = held.dof
    for a in range(dof):
        held.change[a] = 0.0
        for b in range(a + 1):
            row_at(held.square, dof, a)[b] = 0.0


@kernel
def add_rows(held: HeldTable, region: RegionTable, tip: Pose) -> Any:
    """Add a region's rows to the sums J^T J and J^T e; returns |e|^2."""
    set_columns(held, region, tip)
    columns, error, change = held.columns, held.error, held.change
    total = 0.0
    for k in range(TWIST_NUMBERS):
        total += error[k] * error[k]
    for a in range(held.dof):
        column, row = column_at(columns, a), row_at(held.square, held.dof, a)
        pull = change[a]
        for k in range(TWIST_NUMBERS):
            pull += column[k] * error[k]
        change[a] = pull
        for b in range(a + 1):
            other, product = column_at(columns, b), row[b]
            for k in range(TWIST_NUMBERS):
                product += column[k] * other[k]
            row[b] = product
    return total


@kernel
def solve_sums(held: HeldTable, damping: float) -> None:
    """Replace J^T e by (J^T J + damping)^-1 J^T e."""
    for a in range(held.dof):
        row_at(held.square, held.dof, a)[a] += damping
    solve_in_place(held.square, held.dof, held.change, damping)


@kernel
def step_on(held: HeldTable, q: Configuration) -> None:
    """Move q by the change, no coordinate too far, none beyond a limit."""
    change, largest = held.change, held.largest_step
    lower, upper = held.lower, held.upper
    most = largest
    for k in range(held.dof):
        most = max(most, abs(change[k]))
    for k in range(held.dof):
        value = q[k] + change[k] * (largest / most)
        q[k] = min(max(value, lower[k]), upper[k])


@kernel
def project(held: HeldTable, q: Configuration, steps: int) -> bool:
    """Move q into all regions, in so many steps at most; whether it is there."""
    mark = 1e300
    for number in range(steps + 1):
        clear_sums(held)
        total = 0.0
        for k in range(held.count):
            region = region_at(held, k)
            tip = place_frame(region, q)
            set_origin_residual(held, region, tip)
            set_turn_residual(held, region, tip)
            total += add_rows(held, region, tip)
        if total == 0.0:
            return True
        if number == steps:
            return False
        if number % PATIENCE == 0:
            if total > STALLED * mark:
                return False
            mark = total
        solve_sums(held, held.damping + SHARE * total)
        step_on(held, q)
    return False


@kernel
def measures(held: HeldTable, number: int, q: Configuration) -> Any:
    """The measures of a configuration: of the origin and of the turn."""
    region = region_at(held, number)
    tip = place_frame(region, q)
    return origin_measure(region, tip), turn_measure(region, tip)


@inlined
def highest(first: float, last: float, bend: float) -> Any:
    """The largest that a measure can be on a motion, from those of its ends and the deviation in between."""
    way = abs(last - first)
    if way >= 4.0 * bend:
        return max(first, last)
    return 0.5 * (first + last) + bend + way * way / (16.0 * bend)


@kernel
def deviation(region: RegionTable, start: Configuration, end: Configuration) -> Any:
    """How far the measures of a straight motion exceed those of its ends, at most: of the origin and of the turn."""
    limb, record = region.limb, region.record
    origin, before = 0.0, 0.0
    for joint in range(limb.joints):
        k = limb.column[joint]
        way = abs(limb.gain[joint] * (end[k] - start[k]))
        turned = way if limb.sliding[joint] == 0 else 0.0
        origin += way * record[layout.LEVERS + joint] * (turned + 2.0 * before)
        before += turned
    return origin * 0.125, record[layout.CURVATURE] * before * before * 0.125


@kernel
def keeps_region(held: HeldTable, number: int, start: Configuration, end: Configuration) -> bool:
    """Whether a straight motion between configurations in a region keeps it: parts of it, ever smaller, are bounded."""
    region = region_at(held, number)
    node, (origin, turn) = held.node, deviation(region, start, end)
    most_origin = region.record[layout.MOST]
    most_turn = region.record[layout.MOST + 1]
    first, last = measures(held, number, start), measures(held, number, end)
    parts = 1
    for _ in range(HALVINGS + 1):
        kept, before = True, first
        for part in range(1, parts + 1):
            here = last
            if part < parts:
                share = float(part) / float(parts)
                for k in range(held.dof):
                    node[k] = (1.0 - share) * start[k] + share * end[k]
                here = measures(held, number, node)
            if here[0] > most_origin or here[1] > most_turn:
                return False
            kept = highest(before[0], here[0], origin) <= most_origin and highest(before[1], here[1], turn) <= most_turn
            if not kept:
                break
            before = here
        if kept:
            return True
        parts, origin, turn = 2 * parts, 0.25 * origin, 0.25 * turn
    return False


@kernel
def keeps(held: HeldTable, start: Configuration, end: Configuration) -> bool:
    """Whether a straight motion between configurations in all regions keeps them all."""
    kept = True
    for number in range(held.count):
        kept = kept and keeps_region(held, number, start, end)
    return kept
