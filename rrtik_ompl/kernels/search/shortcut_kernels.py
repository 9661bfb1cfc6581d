"""The kernel that shortens a route by random shortcuts: the whole loop, left only to ask or to report.

A try is one of two. A shortcut takes two random places on the route, on its edges or at its waypoints, and goes
straight from one to the other. A pull moves some joints of one waypoint towards the straight line between its
neighbours, so that a corner can slide along what it touches (after the partial shortcuts of [9]). Pieces of edges that
remain beside a shortcut are checked again, for their configurations are not the ones that were checked when they were
part of longer edges.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED, DoubleArray
from rrtik_ompl.kernels.search import shortcut_layout
from rrtik_ompl.kernels.search.motions.motion_kernels import dof_of
from rrtik_ompl.kernels.search.motions.motion_layout import MotionTable
from rrtik_ompl.kernels.search.motions.proven_kernels import judge_motion, proof_of
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, row_at
from rrtik_ompl.kernels.search.shortcut_layout import FIRST_INSIDE, SECOND_INSIDE, ShortcutTable
from rrtik_ompl.kernels.simd.access import count_up, field_reader
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import double_at, field, set_double, set_field
from rrtik_ompl.kernels.simd.random_kernels import next_share

PULL_PROBABILITY = 0.5  # of each joint in a pull
MIN_GAIN = 1e-6  # of the length of the route, or a shortcut is not worth its checks
WAYPOINT_TOLERANCE = 1e-9  # of the length of an edge: nearer to a waypoint is at the waypoint


motions_of: Callable[[ShortcutTable], MotionTable] = field_reader(shortcut_layout.MOTIONS)
route_of: Callable[[ShortcutTable], Configuration] = field_reader(shortcut_layout.ROUTE)
ends_of: Callable[[ShortcutTable], Configuration] = field_reader(shortcut_layout.ENDS)
arc_lengths_of: Callable[[ShortcutTable], DoubleArray] = field_reader(shortcut_layout.ARC_LENGTHS)
count_of: Callable[[ShortcutTable], int] = field_reader(shortcut_layout.COUNT)  # waypoints


@inlined
def dof_in(search: ShortcutTable) -> int:
    """How many numbers a configuration has."""
    return dof_of(motions_of(search))


@inlined
def waypoint(search: ShortcutTable, number: int) -> Configuration:
    """Address of a waypoint."""
    return row_at(route_of(search), dof_in(search), number)


@inlined
def end(search: ShortcutTable, number: int) -> Configuration:
    """Address of an end of the shortcut, 0 or 1."""
    return row_at(ends_of(search), dof_in(search), number)


@inlined
def probability(search: ShortcutTable, place: int) -> Any:
    """WAYPOINT_END or PULL_TRY."""
    return double_at(field(search, shortcut_layout.PROBABILITIES), place)


@kernel
def metric_distance(search: ShortcutTable, a: Configuration, b: Configuration) -> float:
    """Length of the straight motion between two configurations."""
    total = 0.0
    for k in range(dof_in(search)):
        gap = double_at(b, k) - double_at(a, k)
        total += double_at(field(search, shortcut_layout.METRIC), k) * gap * gap
    return np.sqrt(total)  # type: ignore[no-any-return]


@kernel
def measure_route(search: ShortcutTable, start: int) -> None:
    """Length of the route up to each waypoint after ``start``."""
    places = arc_lengths_of(search)
    for k in range(start + 1, count_of(search)):
        length = metric_distance(search, waypoint(search, k - 1), waypoint(search, k))
        set_double(places, k, double_at(places, k - 1) + length)


@kernel
def edge_of(search: ShortcutTable, place: float) -> int:
    """Number of the edge on which a place of the route lies, by bisection."""
    places, low, high = arc_lengths_of(search), 0, count_of(search) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if double_at(places, middle) <= place:
            low = middle
        else:
            high = middle
    return low


@kernel
def random_place(search: ShortcutTable) -> Any:
    """A random place on the route: its waypoint or edge, how much of the edge lies before it, and where that is."""
    places, count = arc_lengths_of(search), count_of(search)
    if next_share(search, shortcut_layout.RANDOM) < probability(search, shortcut_layout.WAYPOINT_END):
        chosen = int(next_share(search, shortcut_layout.RANDOM) * count)
        return chosen, 0.0, double_at(places, chosen)
    place = next_share(search, shortcut_layout.RANDOM) * double_at(places, count - 1)
    edge = edge_of(search, place)
    length = double_at(places, edge + 1) - double_at(places, edge)
    share = (place - double_at(places, edge)) / length if length > 0.0 else 0.0
    if share < WAYPOINT_TOLERANCE:
        return edge, 0.0, double_at(places, edge)
    if share > 1.0 - WAYPOINT_TOLERANCE:
        return edge + 1, 0.0, double_at(places, edge + 1)
    return edge, share, place


@kernel
def set_end(search: ShortcutTable, number: int, edge: int, share: float) -> None:
    """Place an end of the shortcut, never outside the box between the waypoints around it."""
    a, target = waypoint(search, edge), end(search, number)
    if share == 0.0:
        copy_row(dof_in(search), a, target)
        return
    b = waypoint(search, edge + 1)
    for k in range(dof_in(search)):
        low, high = min(double_at(a, k), double_at(b, k)), max(double_at(a, k), double_at(b, k))
        value = (1.0 - share) * double_at(a, k) + share * double_at(b, k)
        set_double(target, k, min(max(value, low), high))


@kernel
def propose_pull(search: ShortcutTable) -> bool:
    """Draw a pull; whether it would gain something."""
    chosen = 1 + int(next_share(search, shortcut_layout.RANDOM) * (count_of(search) - 2))
    before, here, after = (waypoint(search, chosen - 1), waypoint(search, chosen), waypoint(search, chosen + 1))
    first, second = metric_distance(search, before, here), metric_distance(search, here, after)
    if first + second <= 0.0:
        return False
    share, strength, target = first / (first + second), next_share(search, shortcut_layout.RANDOM), end(search, 0)
    for k in range(dof_in(search)):
        low, high = min(double_at(before, k), double_at(after, k)), max(double_at(before, k), double_at(after, k))
        straight = min(max((1.0 - share) * double_at(before, k) + share * double_at(after, k), low), high)
        pulled = strength if next_share(search, shortcut_layout.RANDOM) < PULL_PROBABILITY else 0.0
        low, high = min(double_at(here, k), straight), max(double_at(here, k), straight)
        set_double(target, k, min(max((1.0 - pulled) * double_at(here, k) + pulled * straight, low), high))
    set_field(search, shortcut_layout.FIRST, chosen)
    set_field(search, shortcut_layout.CUTS, shortcut_layout.PULL)
    total = double_at(arc_lengths_of(search), count_of(search) - 1)
    new_length = metric_distance(search, before, target) + metric_distance(search, target, after)
    return bool(first + second - new_length > MIN_GAIN * total)


@kernel
def propose_shortcut(search: ShortcutTable) -> bool:
    """Draw a shortcut; whether it would gain something."""
    first, share, place = random_place(search)
    second, other_share, other_place = random_place(search)
    if second < first or (second == first and other_share < share):
        first, share, place, second, other_share, other_place = second, other_share, other_place, first, share, place
    if first == second or (second == first + 1 and other_share == 0.0):  # both on one edge
        return False
    cuts = (FIRST_INSIDE if share > 0.0 else 0) + (SECOND_INSIDE if other_share > 0.0 else 0)
    if (
        second == first + 1
        and cuts == FIRST_INSIDE + SECOND_INSIDE
        and count_of(search) == field(search, shortcut_layout.CAPACITY)
    ):
        return False
    set_field(search, shortcut_layout.FIRST, first)
    set_field(search, shortcut_layout.SECOND, second)
    set_field(search, shortcut_layout.CUTS, cuts)
    set_end(search, 0, first, share)
    set_end(search, 1, second, other_share)
    total = double_at(arc_lengths_of(search), count_of(search) - 1)
    return bool(other_place - place - metric_distance(search, end(search, 0), end(search, 1)) > MIN_GAIN * total)


@kernel
def check_edge(search: ShortcutTable, a: Configuration, b: Configuration) -> int:
    """Check a straight motion; one that is left undecided becomes a question. The same from both sides."""
    resolve = field(search, shortcut_layout.RESOLVE) != 0
    answer: int = judge_motion(motions_of(search), a, b, resolve)
    if answer == UNDECIDED:
        number, dof = field(search, shortcut_layout.QUESTIONS), dof_in(search)
        copy_row(dof, a, row_at(field(search, shortcut_layout.QUESTION_STARTS), dof, number))
        copy_row(dof, b, row_at(field(search, shortcut_layout.QUESTION_ENDS), dof, number))
        set_field(search, shortcut_layout.QUESTIONS, number + 1)
    return answer


@inlined
def ends_of_part(search: ShortcutTable, part: int) -> Any:
    """Both ends of a motion to be checked: of a pull 0 and 1, else 0 for the shortcut, 1 and 2 for what is beside it.

    A part that does not exist has two ends that are the same.
    """
    first, cuts = field(search, shortcut_layout.FIRST), field(search, shortcut_layout.CUTS)
    near, far = end(search, 0), end(search, 1)
    if cuts == shortcut_layout.PULL:
        return near, (waypoint(search, first + 2 * part - 1) if part < 2 else near)
    if part == 0:
        return near, far
    if part == 1:
        return near, (waypoint(search, first) if cuts & FIRST_INSIDE else near)
    return far, (waypoint(search, field(search, shortcut_layout.SECOND) + 1) if cuts & SECOND_INSIDE else far)


@kernel
def check_parts(search: ShortcutTable) -> int:
    """Check all motions that a shortcut or a pull would bring; what remains of a proven motion is proven."""
    set_field(search, shortcut_layout.QUESTIONS, 0)
    worst = FREE
    pulled = field(search, shortcut_layout.CUTS) == shortcut_layout.PULL
    proven = proof_of(motions_of(search)) != 0
    for part in range(1 if proven and not pulled else shortcut_layout.MAX_QUESTIONS):
        a, b = ends_of_part(search, part)
        if a != b:
            worst = max(worst, check_edge(search, a, b))
        if worst == COLLIDING or (worst == UNDECIDED and field(search, shortcut_layout.RESOLVE) == 0):
            break
    return worst


@kernel
def take_shortcut(search: ShortcutTable) -> None:
    """Put the shortcut in place of what it cuts off."""
    dof, count = dof_in(search), count_of(search)
    first, second = field(search, shortcut_layout.FIRST), field(search, shortcut_layout.SECOND)
    cuts = field(search, shortcut_layout.CUTS)
    kept_from = second + 1 if cuts & SECOND_INSIDE else second  # the second end is that waypoint or lies before it
    put = first + 1
    tail = put + (1 if cuts & FIRST_INSIDE else 0) + (1 if cuts & SECOND_INSIDE else 0)
    moved = count - kept_from
    source, sink = waypoint(search, kept_from), waypoint(search, tail)
    if tail <= kept_from:
        copy_row(moved * dof, source, sink)
    else:  # it grows: from behind, so that nothing is overwritten before it is moved
        for k in range(moved * dof - 1, -1, -1):
            set_double(sink, k, double_at(source, k))
    if cuts & FIRST_INSIDE:
        copy_row(dof, end(search, 0), waypoint(search, put))
        put += 1
    if cuts & SECOND_INSIDE:
        copy_row(dof, end(search, 1), waypoint(search, put))
    set_field(search, shortcut_layout.COUNT, tail + moved)
    measure_route(search, first)


@kernel
def accept_or_reject(search: ShortcutTable, free: bool) -> None:
    """Take the shortcut or the pull, or count a failure."""
    if not free:
        count_up(search, shortcut_layout.FAILURES)
        return
    if field(search, shortcut_layout.CUTS) == shortcut_layout.PULL:
        chosen = field(search, shortcut_layout.FIRST)
        copy_row(dof_in(search), end(search, 0), waypoint(search, chosen))
        measure_route(search, chosen - 1)
    else:
        take_shortcut(search)
    count_up(search, shortcut_layout.GAINS)
    set_field(search, shortcut_layout.FAILURES, 0)


@inlined
def is_done(search: ShortcutTable) -> Any:
    """Whether no further try is to be made."""
    spent = field(search, shortcut_layout.TRIES) >= field(search, shortcut_layout.MAX_TRIES)
    stuck = field(search, shortcut_layout.FAILURES) >= field(search, shortcut_layout.PATIENCE)
    return spent or stuck or count_of(search) < 3


@entry
def resume(search: ShortcutTable, budget: int) -> int:
    """Go on for at most ``budget`` tries. Returns DONE, RUNNING or ASKING."""
    if field(search, shortcut_layout.TRIES) == 0:
        measure_route(search, 0)
    if field(search, shortcut_layout.QUESTIONS) > 0:
        if field(search, shortcut_layout.ANSWERED) == shortcut_layout.NO_ANSWER:
            return shortcut_layout.ASKING
        set_field(search, shortcut_layout.QUESTIONS, 0)
        accept_or_reject(search, field(search, shortcut_layout.ANSWERED) == shortcut_layout.ANSWER_YES)
    for _ in range(budget):
        if is_done(search):
            return shortcut_layout.DONE
        count_up(search, shortcut_layout.TRIES)
        pulling = next_share(search, shortcut_layout.RANDOM) < probability(search, shortcut_layout.PULL_TRY)
        if not (propose_pull(search) if pulling else propose_shortcut(search)):
            accept_or_reject(search, False)
            continue
        answer = check_parts(search)
        if answer == UNDECIDED and field(search, shortcut_layout.RESOLVE) != 0:
            set_field(search, shortcut_layout.ANSWERED, shortcut_layout.NO_ANSWER)
            return shortcut_layout.ASKING
        set_field(search, shortcut_layout.QUESTIONS, 0)
        accept_or_reject(search, answer == FREE)
    return shortcut_layout.RUNNING
