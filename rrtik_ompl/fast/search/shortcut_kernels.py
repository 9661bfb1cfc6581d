"""The kernel that shortens a route by random shortcuts: the whole loop, left only to ask or to let others look on.

A try is one of two. A shortcut takes two random places on the route, on its edges or at its waypoints, and goes
straight from one to the other. A pull moves some joints of one waypoint towards the straight line between its
neighbours, so that a corner can slide along what it touches (after the partial shortcuts of Geraerts and Overmars
2007). Pieces of edges that remain beside a shortcut are checked again, for their configurations are not the ones that
were checked when they were part of longer edges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast.checks.motion_kernels import check_motion, copy_row, travel, whole_steps
from rrtik_ompl.fast.search import shortcut_layout as table
from rrtik_ompl.fast.simd.compiled import entry, inlined, kernel
from rrtik_ompl.fast.simd.lanes import double_at, field, set_double, set_field
from rrtik_ompl.fast.simd.random_kernels import next_share
from rrtik_ompl.fast.tables.layout import COLLIDING, FREE, UNDECIDED

PULLED_JOINTS = 0.5  # probability that a pull moves a joint
LEAST_GAIN = 1e-6  # of the length, or a shortcut is not worth its checks
TINY = 1e-9  # of an edge: nearer to a waypoint is at the waypoint


@inlined
def waypoint(search: int, number: int) -> int:
    """Address of a waypoint."""
    address: int = field(search, table.ROUTE) + 8 * field(search, table.DOF) * number
    return address


@inlined
def end(search: int, number: int) -> int:
    """Address of an end of the shortcut, 0 or 1."""
    address: int = field(search, table.ENDS) + 8 * field(search, table.DOF) * number
    return address


@kernel
def distance(search: int, a: int, b: int) -> float:
    """Length of the straight motion between two configurations."""
    total = 0.0
    for k in range(field(search, table.DOF)):
        way = double_at(b, k) - double_at(a, k)
        total += double_at(field(search, table.METRIC), k) * way * way
    length: float = np.sqrt(total)
    return length


@kernel
def measure_route(search: int, start: int) -> None:
    """Length of the route up to each waypoint after ``start``."""
    places = field(search, table.PLACES)
    for k in range(start + 1, field(search, table.COUNT)):
        way = distance(search, waypoint(search, k - 1), waypoint(search, k))
        set_double(places, k, double_at(places, k - 1) + way)


@kernel
def edge_of(search: int, place: float) -> int:
    """Number of the edge on which a place of the route lies, by bisection."""
    places, low, high = field(search, table.PLACES), 0, field(search, table.COUNT) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if double_at(places, middle) <= place:
            low = middle
        else:
            high = middle
    return low


@kernel
def random_place(search: int) -> Any:
    """A random place on the route: its waypoint or edge, how much of the edge lies before it, and where that is."""
    places, count = field(search, table.PLACES), field(search, table.COUNT)
    if next_share(search, table.RANDOM) < double_at(field(search, table.SHARE), 0):
        chosen = int(next_share(search, table.RANDOM) * count)
        return chosen, 0.0, double_at(places, chosen)
    place = next_share(search, table.RANDOM) * double_at(places, count - 1)
    edge = edge_of(search, place)
    length = double_at(places, edge + 1) - double_at(places, edge)
    share = (place - double_at(places, edge)) / length if length > 0.0 else 0.0
    if share < TINY:
        return edge, 0.0, double_at(places, edge)
    if share > 1.0 - TINY:
        return edge + 1, 0.0, double_at(places, edge + 1)
    return edge, share, place


@kernel
def set_end(search: int, number: int, edge: int, share: float) -> None:
    """Place an end of the shortcut, never outside the box between the waypoints around it."""
    a, target = waypoint(search, edge), end(search, number)
    if share == 0.0:
        copy_row(field(search, table.DOF), a, target)
        return
    b = waypoint(search, edge + 1)
    for k in range(field(search, table.DOF)):
        low, high = min(double_at(a, k), double_at(b, k)), max(double_at(a, k), double_at(b, k))
        value = (1.0 - share) * double_at(a, k) + share * double_at(b, k)
        set_double(target, k, min(max(value, low), high))


@kernel
def propose_pull(search: int) -> bool:
    """Draw a pull; whether it would gain something."""
    chosen = 1 + int(next_share(search, table.RANDOM) * (field(search, table.COUNT) - 2))
    before, here, after = (waypoint(search, chosen - 1), waypoint(search, chosen), waypoint(search, chosen + 1))
    first, second = distance(search, before, here), distance(search, here, after)
    if first + second <= 0.0:
        return False
    share, strength, target = first / (first + second), next_share(search, table.RANDOM), end(search, 0)
    for k in range(field(search, table.DOF)):
        low, high = min(double_at(before, k), double_at(after, k)), max(double_at(before, k), double_at(after, k))
        straight = min(max((1.0 - share) * double_at(before, k) + share * double_at(after, k), low), high)
        pulled = strength if next_share(search, table.RANDOM) < PULLED_JOINTS else 0.0
        low, high = min(double_at(here, k), straight), max(double_at(here, k), straight)
        set_double(target, k, min(max((1.0 - pulled) * double_at(here, k) + pulled * straight, low), high))
    set_field(search, table.FIRST, chosen)
    set_field(search, table.CUTS, table.PULL)
    total = double_at(field(search, table.PLACES), field(search, table.COUNT) - 1)
    new_length = distance(search, before, target) + distance(search, target, after)
    gain: bool = first + second - new_length > LEAST_GAIN * total
    return gain


@kernel
def propose_shortcut(search: int) -> bool:
    """Draw a shortcut; whether it would gain something."""
    first, share, place = random_place(search)
    second, other_share, other_place = random_place(search)
    if second < first or (second == first and other_share < share):
        first, share, place, second, other_share, other_place = second, other_share, other_place, first, share, place
    if first == second or (second == first + 1 and other_share == 0.0):  # both on one edge
        return False
    cuts = (1 if share > 0.0 else 0) + (2 if other_share > 0.0 else 0)
    if second == first + 1 and cuts == 3 and field(search, table.COUNT) == field(search, table.CAPACITY):
        return False
    set_field(search, table.FIRST, first)
    set_field(search, table.SECOND, second)
    set_field(search, table.CUTS, cuts)
    set_end(search, 0, first, share)
    set_end(search, 1, second, other_share)
    total = double_at(field(search, table.PLACES), field(search, table.COUNT) - 1)
    gain: bool = other_place - place - distance(search, end(search, 0), end(search, 1)) > LEAST_GAIN * total
    return gain


@kernel
def check_edge(search: int, a: int, b: int) -> int:
    """Check a straight motion; one that is left undecided becomes a question. The same from both sides."""
    world, dof, reach = field(search, table.WORLD), field(search, table.DOF), field(search, table.REACH)
    gain, offset = field(search, table.GAIN), field(search, table.OFFSET)
    steps = whole_steps(travel(dof, reach, a, b) / double_at(reach, dof))
    resolve = field(search, table.ASKS) != 0
    answer: int = check_motion(world, dof, gain, offset, a, b, steps, field(search, table.VALUES), resolve)
    if answer == UNDECIDED:
        number = field(search, table.QUESTIONS)
        copy_row(dof, a, field(search, table.STARTS) + 8 * dof * number)
        copy_row(dof, b, field(search, table.GOALS) + 8 * dof * number)
        set_field(search, table.QUESTIONS, number + 1)
    return answer


@inlined
def ends_of_part(search: int, part: int) -> Any:
    """Both ends of a motion to be checked: of a pull 0 and 1, else 0 for the shortcut, 1 and 2 for what is beside it.

    A part that does not exist has two ends that are the same.
    """
    first, cuts = field(search, table.FIRST), field(search, table.CUTS)
    near, far = end(search, 0), end(search, 1)
    if cuts == table.PULL:
        return near, (waypoint(search, first + 2 * part - 1) if part < 2 else near)
    if part == 0:
        return near, far
    if part == 1:
        return near, (waypoint(search, first) if cuts & 1 else near)
    return far, (waypoint(search, field(search, table.SECOND) + 1) if cuts & 2 else far)


@kernel
def check_parts(search: int) -> int:
    """Check all motions that a shortcut or a pull would bring."""
    set_field(search, table.QUESTIONS, 0)
    worst = FREE
    for part in range(3):
        a, b = ends_of_part(search, part)
        if a != b:
            worst = max(worst, check_edge(search, a, b))
        if worst == COLLIDING or (worst == UNDECIDED and field(search, table.ASKS) == 0):
            break
    return worst


@kernel
def take_shortcut(search: int) -> None:
    """Put the shortcut in place of what it cuts off."""
    dof, count = field(search, table.DOF), field(search, table.COUNT)
    first, second, cuts = field(search, table.FIRST), field(search, table.SECOND), field(search, table.CUTS)
    kept_from = second + 1 if cuts & 2 else second  # the second end is that waypoint itself or lies before it
    put = first + 1
    tail = put + (cuts & 1) + (cuts >> 1)
    moved = count - kept_from
    size = 8 * dof
    route = field(search, table.ROUTE)
    if tail <= kept_from:
        copy_row(moved * dof, route + size * kept_from, route + size * tail)
    else:  # it grows: from behind, so that nothing is overwritten before it is moved
        for k in range(moved * dof - 1, -1, -1):
            set_double(route + size * tail, k, double_at(route + size * kept_from, k))
    if cuts & 1:
        copy_row(dof, end(search, 0), waypoint(search, put))
        put += 1
    if cuts & 2:
        copy_row(dof, end(search, 1), waypoint(search, put))
    set_field(search, table.COUNT, tail + moved)
    measure_route(search, first)


@kernel
def accept_or_reject(search: int, free: bool) -> None:
    """Take the shortcut or the pull, or count a failure."""
    if not free:
        set_field(search, table.FAILURES, field(search, table.FAILURES) + 1)
        return
    if field(search, table.CUTS) == table.PULL:
        chosen = field(search, table.FIRST)
        copy_row(field(search, table.DOF), end(search, 0), waypoint(search, chosen))
        measure_route(search, chosen - 1)
    else:
        take_shortcut(search)
    set_field(search, table.GAINS, field(search, table.GAINS) + 1)
    set_field(search, table.FAILURES, 0)


@entry
def resume(search: int, budget: int) -> int:
    """Go on for at most ``budget`` tries. Returns DONE, RUNNING or ASKING."""
    if field(search, table.TRIES) == 0:
        measure_route(search, 0)
    if field(search, table.QUESTIONS) > 0 and field(search, table.ANSWERED) == table.NO_ANSWER:
        return table.ASKING
    if field(search, table.QUESTIONS) > 0:
        set_field(search, table.QUESTIONS, 0)
        accept_or_reject(search, field(search, table.ANSWERED) == table.ANSWER_YES)
    for _ in range(budget):
        spent = field(search, table.TRIES) >= field(search, table.MOST_TRIES)
        if spent or field(search, table.FAILURES) >= field(search, table.PATIENCE) or field(search, table.COUNT) < 3:
            return table.DONE
        set_field(search, table.TRIES, field(search, table.TRIES) + 1)
        pulling = next_share(search, table.RANDOM) < double_at(field(search, table.SHARE), 1)
        if not (propose_pull(search) if pulling else propose_shortcut(search)):
            accept_or_reject(search, False)
            continue
        answer = check_parts(search)
        if answer == UNDECIDED and field(search, table.ASKS) != 0:
            set_field(search, table.ANSWERED, table.NO_ANSWER)
            return table.ASKING
        set_field(search, table.QUESTIONS, 0)
        accept_or_reject(search, answer == FREE)
    return table.RUNNING
