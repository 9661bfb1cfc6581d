"""The kernel that shortens a route by random shortcuts: the whole loop, left only to ask or to report.

A try is one of two. A shortcut takes two random places on the route, on its edges or at its waypoints, and goes
straight from one to the other. A pull moves some joints of one waypoint towards the straight line between its
neighbours, so that a corner can slide along what it touches (after the partial shortcuts of [9]). Pieces of edges that
remain beside a shortcut are checked again, for their configurations are not the ones that were checked when they were
part of longer edges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.kernels.layout import COLLIDING, FREE, UNDECIDED
from rrtik_ompl.kernels.search import shortcut_layout
from rrtik_ompl.kernels.search.motions.proven_kernels import judge_motion
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, row_at
from rrtik_ompl.kernels.search.shortcut_layout import FIRST_INSIDE, SECOND_INSIDE, ShortcutTable
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.random_kernels import next_share
from rrtik_ompl.kernels.simd.records import exists, same_place

PULL_PROBABILITY = 0.5  # of each joint in a pull
MIN_GAIN = 1e-6  # of the length of the route, or a shortcut is not worth its checks
WAYPOINT_TOLERANCE = 1e-9  # of the length of an edge: nearer to a waypoint is at the waypoint


@inlined
def dof_in(search: ShortcutTable) -> int:
    """How many numbers a configuration has."""
    return search.motions.dof


@inlined
def waypoint(search: ShortcutTable, number: int) -> Configuration:
    """Address of a waypoint."""
    return row_at(search.route, dof_in(search), number)


@inlined
def end(search: ShortcutTable, number: int) -> Configuration:
    """Address of an end of the shortcut, 0 or 1."""
    return row_at(search.ends, dof_in(search), number)


@kernel
def metric_distance(search: ShortcutTable, a: Configuration, b: Configuration) -> float:
    """Length of the straight motion between two configurations."""
    total = 0.0
    for k in range(dof_in(search)):
        gap = b[k] - a[k]
        total += search.metric[k] * gap * gap
    return np.sqrt(total)  # type: ignore[no-any-return]


@kernel
def measure_route(search: ShortcutTable, start: int) -> None:
    """Length of the route up to each waypoint after ``start``."""
    places = search.arc_lengths
    for k in range(start + 1, search.count):
        length = metric_distance(search, waypoint(search, k - 1), waypoint(search, k))
        places[k] = places[k - 1] + length


@kernel
def edge_of(search: ShortcutTable, place: float) -> int:
    """Number of the edge on which a place of the route lies, by bisection."""
    low = 0
    high = search.count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if search.arc_lengths[middle] <= place:
            low = middle
        else:
            high = middle
    return low


@kernel
def random_place(search: ShortcutTable) -> Any:
    """A random place on the route: its waypoint or edge, how much of the edge lies before it, and where that is."""
    places = search.arc_lengths
    if next_share(search) < search.waypoint_share:
        chosen = int(next_share(search) * search.count)
        return chosen, 0.0, places[chosen]

    place = next_share(search) * places[search.count - 1]
    edge = edge_of(search, place)
    length = places[edge + 1] - places[edge]
    share = (place - places[edge]) / length if length > 0.0 else 0.0
    if share < WAYPOINT_TOLERANCE:
        return edge, 0.0, places[edge]
    if share > 1.0 - WAYPOINT_TOLERANCE:
        return edge + 1, 0.0, places[edge + 1]
    return edge, share, place


@kernel
def set_end(search: ShortcutTable, number: int, edge: int, share: float) -> None:
    """Place an end of the shortcut, never outside the box between the waypoints around it."""
    target = end(search, number)
    a = waypoint(search, edge)
    if share == 0.0:
        copy_row(dof_in(search), a, target)
        return
    b = waypoint(search, edge + 1)
    for k in range(dof_in(search)):
        target[k] = between(a[k], b[k], share)


@inlined
def between(a: float, b: float, share: float) -> float:
    """A share of the way from a to b, which rounding leads beyond neither."""
    value = (1.0 - share) * a + share * b
    return min(max(value, min(a, b)), max(a, b))


@kernel
def propose_pull(search: ShortcutTable) -> bool:
    """Draw a pull; whether it would gain something."""
    chosen = 1 + int(next_share(search) * (search.count - 2))
    before = waypoint(search, chosen - 1)
    here = waypoint(search, chosen)
    after = waypoint(search, chosen + 1)
    length = metric_distance(search, before, here)
    share = length
    length += metric_distance(search, here, after)
    if length <= 0.0:
        return False

    share /= length  # of the straight line, beside which the waypoint lies
    strength = next_share(search)
    target = end(search, 0)
    for k in range(dof_in(search)):
        straight = between(before[k], after[k], share)
        pulled = strength if next_share(search) < PULL_PROBABILITY else 0.0
        target[k] = between(here[k], straight, pulled)
    search.first = chosen
    search.cuts = shortcut_layout.PULL

    total = search.arc_lengths[search.count - 1]
    new_length = metric_distance(search, before, target) + metric_distance(search, target, after)
    return bool(length - new_length > MIN_GAIN * total)


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
    if second == first + 1 and cuts == FIRST_INSIDE + SECOND_INSIDE and search.count == search.capacity:
        return False
    search.first = first
    search.second = second
    search.cuts = cuts
    set_end(search, 0, first, share)
    set_end(search, 1, second, other_share)

    total = search.arc_lengths[search.count - 1]
    return bool(other_place - place - metric_distance(search, end(search, 0), end(search, 1)) > MIN_GAIN * total)


@kernel
def check_edge(search: ShortcutTable, a: Configuration, b: Configuration) -> int:
    """Check a straight motion; one that is left undecided becomes a question. The same from both sides."""
    resolve = search.resolve != 0
    answer: int = judge_motion(search.motions, a, b, resolve)
    if answer == UNDECIDED:
        dof = dof_in(search)
        number = search.questions
        copy_row(dof, a, row_at(search.question_starts, dof, number))
        copy_row(dof, b, row_at(search.question_ends, dof, number))
        search.questions = number + 1
    return answer


@inlined
def ends_of_part(search: ShortcutTable, part: int) -> Any:
    """Both ends of a motion to be checked: of a pull 0 and 1, else 0 for the shortcut, 1 and 2 for what is beside it.

    A part that does not exist has two ends that are the same.
    """
    first = search.first
    cuts = search.cuts
    near = end(search, 0)
    far = end(search, 1)
    if cuts == shortcut_layout.PULL:
        return near, (waypoint(search, first + 2 * part - 1) if part < 2 else near)
    if part == 0:
        return near, far
    if part == 1:
        return near, (waypoint(search, first) if cuts & FIRST_INSIDE else near)
    return far, (waypoint(search, search.second + 1) if cuts & SECOND_INSIDE else far)


@kernel
def check_parts(search: ShortcutTable) -> int:
    """Check all motions that a shortcut or a pull would bring; what remains of a proven motion is proven."""
    search.questions = 0
    worst = FREE
    pulled = search.cuts == shortcut_layout.PULL
    proven = exists(search.motions.proof)
    for part in range(1 if proven and not pulled else shortcut_layout.MAX_QUESTIONS):
        a, b = ends_of_part(search, part)
        if not same_place(a, b):
            worst = max(worst, check_edge(search, a, b))
        if worst == COLLIDING or (worst == UNDECIDED and search.resolve == 0):
            break
    return worst


@kernel
def take_shortcut(search: ShortcutTable) -> None:
    """Put the shortcut in place of what it cuts off."""
    dof = dof_in(search)
    cuts = search.cuts
    first = search.first
    second = search.second
    kept_from = second + 1 if cuts & SECOND_INSIDE else second  # the second end is that waypoint or lies before it
    put = first + 1
    tail = put + (1 if cuts & FIRST_INSIDE else 0) + (1 if cuts & SECOND_INSIDE else 0)
    moved = search.count - kept_from
    source = waypoint(search, kept_from)
    sink = waypoint(search, tail)
    if tail <= kept_from:
        copy_row(moved * dof, source, sink)
    else:  # it grows: from behind, so that nothing is overwritten before it is moved
        for k in range(moved * dof - 1, -1, -1):
            sink[k] = source[k]

    if cuts & FIRST_INSIDE:
        copy_row(dof, end(search, 0), waypoint(search, put))
        put += 1
    if cuts & SECOND_INSIDE:
        copy_row(dof, end(search, 1), waypoint(search, put))
    search.count = tail + moved
    measure_route(search, first)


@kernel
def accept_or_reject(search: ShortcutTable, free: bool) -> None:
    """Take the shortcut or the pull, or count a failure."""
    if not free:
        search.failures += 1
        return
    if search.cuts == shortcut_layout.PULL:
        chosen = search.first
        copy_row(dof_in(search), end(search, 0), waypoint(search, chosen))
        measure_route(search, chosen - 1)
    else:
        take_shortcut(search)
    search.gains += 1
    search.failures = 0


@inlined
def is_done(search: ShortcutTable) -> Any:
    """Whether no further try is to be made."""
    spent = search.tries >= search.max_tries
    stuck = search.failures >= search.patience
    return spent or stuck or search.count < 3


@entry
def resume(search: ShortcutTable, budget: int) -> int:
    """Go on for at most ``budget`` tries. Returns DONE, RUNNING or ASKING."""
    if search.tries == 0:
        measure_route(search, 0)
    if search.questions > 0:
        if search.answered == shortcut_layout.NO_ANSWER:
            return shortcut_layout.ASKING
        search.questions = 0
        accept_or_reject(search, search.answered == shortcut_layout.ANSWER_YES)
    for _ in range(budget):
        if is_done(search):
            return shortcut_layout.DONE
        search.tries += 1
        pulling = next_share(search) < search.pull_share
        if not (propose_pull(search) if pulling else propose_shortcut(search)):
            accept_or_reject(search, False)
            continue
        answer = check_parts(search)
        if answer == UNDECIDED and search.resolve != 0:
            search.answered = shortcut_layout.NO_ANSWER
            return shortcut_layout.ASKING
        search.questions = 0
        accept_or_reject(search, answer == FREE)
    return shortcut_layout.RUNNING
