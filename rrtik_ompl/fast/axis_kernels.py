"""Kernels that grow trees whose every edge moves one coordinate. Source: the C-RDT paper, algorithms 9 to 11.

The rules are those of the planners' own ``AxisTree``, and the random stream is the same, so that a search in kernels
and one in Python find the same path to the bit. A search stops and goes on where it was: all that it remembers is in
its table, and how far it runs at a time changes nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rrtik_ompl.fast import kernels
from rrtik_ompl.fast import robot_tables as robot
from rrtik_ompl.fast.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.fast.lanes import (
    choose,
    double_at,
    field,
    int_at,
    lane_numbers,
    rounded_sum,
    set_double,
    set_field,
    set_int,
    set_wide_lanes,
    spread_wide,
    wide_lanes_at,
)

ROOT = -1

# Statuses of a search.
RUNNING, ASKING, FULL, SOLVED, EXHAUSTED = range(5)
# What an extension achieved: nothing, a part of the way, its target exactly.
TRAPPED, ADVANCED, REACHED = range(3)
# What a search does next.
BEGIN, GROW, MEET, CHOOSE_GOAL, REACH_GOAL = range(5)

# Tree: coordinates are runs of CAPACITY float64, one run for each coordinate; parents int32.
SIZE, CAPACITY, COORDINATES, PARENTS = range(4)

# Search, the motions: joint values = GAIN q + OFFSET, limits of a valid configuration, WEIGHTS of its travel. NUMBERS
# are float64: see below. ASKS: whether the world is asked about what is undecided; otherwise it counts as colliding.
WORLD, DOF, GAIN, OFFSET, WEIGHTS, LEAST, MOST, NUMBERS, VALUES, ASKS = range(10)
# Its rules, see AxisRules, and its progress.
LOWER, UPPER, SCALE, SMALLEST_MOVE, CHANCE, AXES, AXIS_COUNT = range(10, 17)
RANDOM, ITERATIONS, ITERATION_LIMIT, NEXT, MOTIONS = range(17, 22)
# Its trees: the addresses of two, which of them grows; where they met.
TREES, GROWING, MET = range(22, 25)
# Its extension: the edges are rows of STARTS and ENDS; the first FIRST_EDGES of them belong to the first leg.
TARGET, NEAR, ORDER, CURRENT, TURN, FIRST_EDGES, EDGE_COUNT, COMPLETE, STARTS, ENDS, VERDICTS, LAST = range(25, 37)
# Work of the search for the nearest vertex. Goals of a single tree, and which vertex is to try which of them next.
DISTANCES, GOALS, GOAL_COUNT, VERTEX, VERTEX_END, GOAL = range(37, 43)
FIELDS = 43

RESOLUTION, TOLERANCE_SQUARED = range(2)

# The first leg: a new direction; back into the last edge, beyond its beginning, exactly to its beginning.
ONWARD, BETWEEN, BEYOND, BACK = range(4)

FARTHEST = 1e300
WHOLE_STEP = 1e-9  # a motion this little longer than a number of steps is checked in that number of steps

# splitmix64. Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators, 2014.
GOLDEN, FIRST_FACTOR, SECOND_FACTOR = (
    np.uint64(x) for x in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
SHIFT_30, SHIFT_27, SHIFT_31, SHIFT_11 = (np.uint64(x) for x in (30, 27, 31, 11))
UNIT = 2.0**-53


@inlined
def draw(search: int) -> Any:
    """The next 64 bits of the stream."""
    state = np.uint64(field(search, RANDOM)) + GOLDEN
    set_field(search, RANDOM, np.int64(state))
    z = (state ^ (state >> SHIFT_30)) * FIRST_FACTOR
    z = (z ^ (z >> SHIFT_27)) * SECOND_FACTOR
    return z ^ (z >> SHIFT_31)


@inlined
def draw_unit(search: int) -> Any:
    """A number from 0 to 1, less than 1."""
    return float(np.int64(draw(search) >> SHIFT_11)) * UNIT


@inlined
def sample(search: int) -> None:
    """Draw a target within the bounds."""
    for axis in range(field(search, DOF)):
        low, high = double_at(field(search, LOWER), axis), double_at(field(search, UPPER), axis)
        share = draw_unit(search)
        set_double(field(search, TARGET), axis, min(low + share * (high - low), high))


@kernel
def shuffle(search: int) -> None:
    """The axes that may move, in random order."""
    order, count = field(search, ORDER), field(search, AXIS_COUNT)
    for k in range(count):
        set_int(order, k, int_at(field(search, AXES), k))
    for k in range(count - 1, 0, -1):
        other = np.int64(draw(search) % np.uint64(k + 1))
        axis = int_at(order, k)
        set_int(order, k, int_at(order, other))
        set_int(order, other, axis)


@inlined
def to_front(search: int, axis: int) -> None:
    """Let an axis go first and the others keep their order."""
    order, k = field(search, ORDER), 0
    while int_at(order, k) != axis:
        k += 1
    for place in range(k, 0, -1):
        set_int(order, place, int_at(order, place - 1))
    set_int(order, 0, axis)


@inlined
def coordinate(tree: int, vertex: int, axis: int) -> Any:
    """A coordinate of a vertex."""
    return double_at(field(tree, COORDINATES), axis * field(tree, CAPACITY) + vertex)


@inlined
def copy_row(dof: int, source: int, sink: int) -> None:
    """Copy the coordinates at an address to another."""
    for axis in range(dof):
        set_double(sink, axis, double_at(source, axis))


@inlined
def read_vertex(search: int, tree: int, vertex: int, sink: int) -> None:
    """Copy the coordinates of a vertex to an address."""
    for axis in range(field(search, DOF)):
        set_double(sink, axis, coordinate(tree, vertex, axis))


@inlined
def add_vertex(search: int, tree: int, row: int, parent: int) -> Any:
    """Add the coordinates at an address to a tree that has room; returns the number of the vertex."""
    vertex = field(tree, SIZE)
    for axis in range(field(search, DOF)):
        set_double(field(tree, COORDINATES), axis * field(tree, CAPACITY) + vertex, double_at(row, axis))
    set_int(field(tree, PARENTS), vertex, parent)
    set_field(tree, SIZE, vertex + 1)
    return vertex


@kernel
def nearest_vertex(search: int, tree: int) -> int:
    """The vertex nearest to the target in the scaled metric; among equals the oldest."""
    target, scale, coordinates = field(search, TARGET), field(search, SCALE), field(tree, COORDINATES)
    count, run = field(tree, SIZE), field(tree, CAPACITY) // WIDTH
    lowest, holder = spread_wide(FARTHEST), spread_wide(0.0)
    for block in range((count + WIDTH - 1) // WIDTH):
        total = spread_wide(0.0)
        for axis in range(field(search, DOF)):
            way = (wide_lanes_at(coordinates, axis * run + block) - double_at(target, axis)) * double_at(scale, axis)
            total = rounded_sum(total, way * way)
        numbers = lane_numbers() + float(block * WIDTH)
        total = choose(numbers < float(count), total, spread_wide(FARTHEST))
        nearer = total < lowest
        lowest, holder = choose(nearer, total, lowest), choose(nearer, numbers, holder)
    distances = field(search, DISTANCES)
    set_wide_lanes(distances, 0, lowest)
    set_wide_lanes(distances, 1, holder)
    best = 0
    for lane in range(1, WIDTH):
        a, b = double_at(distances, lane), double_at(distances, best)
        if a < b or (a == b and double_at(distances, WIDTH + lane) < double_at(distances, WIDTH + best)):
            best = lane
    return int(double_at(distances, WIDTH + best))


@inlined
def hold(search: int, tree: int, near: int) -> None:
    """Let each coordinate of the target stay as it is at a vertex if it does not take part this time."""
    for axis in range(field(search, DOF)):
        chance = double_at(field(search, CHANCE), axis)
        if chance < 1.0 and draw_unit(search) >= chance:
            set_double(field(search, TARGET), axis, coordinate(tree, near, axis))


@inlined
def remembered_axis(search: int, tree: int, vertex: int, parent: int) -> int:
    """The axis of the edge that leads to a vertex."""
    axis = 0
    while axis < field(search, DOF) - 1 and coordinate(tree, vertex, axis) == coordinate(tree, parent, axis):
        axis += 1
    return axis


@kernel
def add_edge(search: int, axis: int, start: Any, end: Any) -> None:
    """Put an edge along an axis through the current row on the list."""
    count, dof, current = field(search, EDGE_COUNT), field(search, DOF), field(search, CURRENT)
    first, second = field(search, STARTS) + 8 * dof * count, field(search, ENDS) + 8 * dof * count
    copy_row(dof, current, first)
    copy_row(dof, current, second)
    set_double(first, axis, start)
    set_double(second, axis, end)
    set_field(search, EDGE_COUNT, count + 1)


@inlined
def turning(came_from: Any, here: Any, there: Any) -> int:
    """How a leg from ``here`` to ``there`` goes on after a move that came from ``came_from``."""
    if here == came_from or (here - came_from) * (there - here) > 0.0:
        return ONWARD
    beyond = there - came_from
    if beyond == 0.0:
        return BACK
    return BETWEEN if (here - came_from) * beyond > 0.0 else BEYOND


@inlined
def shortest_piece(turn: int, came_from: Any, here: Any, there: Any) -> Any:
    """Length of the shortest edge that a leg would leave in the tree."""
    length = abs(there - here)
    return min(length, abs(there - came_from)) if turn in (BETWEEN, BEYOND) else length


@kernel
def aim(search: int, tree: int, near: int, exactly: bool) -> None:
    """Lay out the way from a vertex to the target, one axis after the other: the axis that led to the vertex first.

    A leg shorter than the smallest move ends the way; towards a target that need not be met exactly it is left out.
    """
    parent, current = int_at(field(tree, PARENTS), near), field(search, CURRENT)
    if not exactly:
        hold(search, tree, near)
    shuffle(search)
    if parent != ROOT:  # a root has no direction to remember
        to_front(search, remembered_axis(search, tree, near, parent))
    read_vertex(search, tree, near, current)
    set_field(search, NEAR, near)
    set_field(search, TURN, ONWARD)
    set_field(search, FIRST_EDGES, 0)
    set_field(search, EDGE_COUNT, 0)
    set_field(search, COMPLETE, 1)
    legs = 0
    for k in range(field(search, AXIS_COUNT)):
        axis = int_at(field(search, ORDER), k)
        here, there = double_at(current, axis), double_at(field(search, TARGET), axis)
        came_from = here if legs > 0 or parent == ROOT else coordinate(tree, parent, axis)
        turn = turning(came_from, here, there)
        if here == there:
            continue
        if shortest_piece(turn, came_from, here, there) < double_at(field(search, SMALLEST_MOVE), axis):
            if exactly:
                set_field(search, COMPLETE, 0)
                break
            continue
        if turn in (ONWARD, BETWEEN):
            add_edge(search, axis, here, there)
        if turn in (BETWEEN, BEYOND):  # the edge to the vertex is split, or left out: the way has no turn
            add_edge(search, axis, came_from, there)
        if legs == 0:
            set_field(search, TURN, turn)
            set_field(search, FIRST_EDGES, field(search, EDGE_COUNT))
        set_double(current, axis, there)
        legs += 1


@inlined
def load_values(search: int, row: int, sink: int) -> None:
    """Joint values of a configuration."""
    dof = field(search, DOF)
    for joint in range(field(field(field(search, WORLD), kernels.ARM), robot.JOINT_COUNT)):
        value = 0.0
        for axis in range(dof):
            value += double_at(field(search, GAIN), joint * dof + axis) * double_at(row, axis)
        set_double(sink, joint, value + double_at(field(search, OFFSET), joint))


@kernel
def judge(search: int, start: int, end: int) -> int:
    """Judge the motion between two configurations by the same configurations as the world, whatever its direction."""
    travel, order = 0.0, 0
    for axis in range(field(search, DOF)):
        a, b = double_at(start, axis), double_at(end, axis)
        least, most = double_at(field(search, LEAST), axis), double_at(field(search, MOST), axis)
        if min(a, b) < least or max(a, b) > most:
            return kernels.COLLIDING
        if order == 0 and a != b:
            order = 1 if a < b else -1
        travel += double_at(field(search, WEIGHTS), axis) * abs(b - a)
    steps = max(1, int(np.ceil(travel / double_at(field(search, NUMBERS), RESOLUTION) - WHOLE_STEP)))
    first = field(search, VALUES)
    second = first + 8 * field(field(field(search, WORLD), kernels.ARM), robot.JOINT_COUNT)
    load_values(search, start if order >= 0 else end, first)
    load_values(search, end if order >= 0 else start, second)
    return kernels.judge_edge(field(search, WORLD), first, second, steps, field(search, ASKS) != 0)


@kernel
def open_edges(search: int) -> int:
    """Judge the edges of the extension up to the first that is not free; returns how many want an answer."""
    stride, count, open_ = 8 * field(search, DOF), field(search, EDGE_COUNT), 0
    for edge in range(count):
        verdict = judge(search, field(search, STARTS) + edge * stride, field(search, ENDS) + edge * stride)
        if verdict == kernels.UNDECIDED:
            verdict = kernels.UNDECIDED if field(search, ASKS) != 0 else kernels.COLLIDING
            open_ += 1 if field(search, ASKS) != 0 else 0
        set_int(field(search, VERDICTS), edge, verdict)
        if verdict == kernels.COLLIDING:
            set_field(search, EDGE_COUNT, edge + 1)
            break
    return open_


@kernel
def keep(search: int, tree: int) -> int:
    """Add the free leading part of the extension to the tree; returns what was achieved."""
    count, first, near = field(search, EDGE_COUNT), field(search, FIRST_EDGES), field(search, NEAR)
    stride, turn, known = 8 * field(search, DOF), field(search, TURN), field(tree, SIZE)
    free = 0
    while free < count and int_at(field(search, VERDICTS), free) == kernels.FREE:
        free += 1
    set_field(search, MOTIONS, field(search, MOTIONS) + min(free + 1, count))
    vertex = near
    if free >= first:
        parent = int_at(field(tree, PARENTS), near)
        if turn == BACK:
            vertex = parent
        elif first > 0:
            row = field(search, ENDS)
            vertex = add_vertex(search, tree, row, near if turn == ONWARD else parent)
            if turn == BETWEEN:
                set_int(field(tree, PARENTS), near, vertex)
        for edge in range(first, free):
            vertex = add_vertex(search, tree, field(search, ENDS) + edge * stride, vertex)
    set_field(search, LAST, vertex)
    if free == count and field(search, COMPLETE) != 0:
        return REACHED
    return TRAPPED if field(tree, SIZE) == known else ADVANCED


@inlined
def has_room(search: int, tree: int) -> Any:
    """Whether a tree can take a whole extension."""
    return field(tree, SIZE) + field(search, DOF) <= field(tree, CAPACITY)


@inlined
def swap(search: int) -> None:
    """Let the other tree grow."""
    set_field(search, GROWING, 1 - field(search, GROWING))
    set_field(search, NEXT, BEGIN)


@entry
def resume_pair(search: int, budget: int) -> int:
    """Go on with two trees that grow in turn, for at most ``budget`` iterations. Returns a status.

    ASKING: the edges whose verdict is UNDECIDED want an answer. FULL: both trees want more room.
    """
    done = 0
    while True:
        growing = field(field(search, TREES), field(search, GROWING))
        other = field(field(search, TREES), 1 - field(search, GROWING))
        step = field(search, NEXT)
        if step == BEGIN:
            if field(search, ITERATIONS) >= field(search, ITERATION_LIMIT):
                return EXHAUSTED
            if done >= budget:
                return RUNNING
            if not (has_room(search, growing) and has_room(search, other)):
                return FULL
            done += 1
            set_field(search, ITERATIONS, field(search, ITERATIONS) + 1)
            sample(search)
            tree, exactly, step = growing, False, GROW
        elif step == GROW:
            if keep(search, growing) == TRAPPED:
                swap(search)
                continue
            set_field(search, MET, field(search, LAST))
            read_vertex(search, growing, field(search, LAST), field(search, TARGET))
            tree, exactly, step = other, True, MEET
        else:
            outcome = keep(search, other)
            swap(search)
            if outcome == REACHED:
                return SOLVED
            continue
        aim(search, tree, nearest_vertex(search, tree), exactly)
        set_field(search, NEXT, step)
        if open_edges(search) > 0:
            return ASKING


@inlined
def goal_in_reach(search: int, tree: int, vertex: int, goal: int) -> Any:
    """Whether a goal lies within the tolerance around a vertex."""
    total = 0.0
    for axis in range(field(search, DOF)):
        way = double_at(field(search, GOALS), goal * field(search, DOF) + axis) - coordinate(tree, vertex, axis)
        total += way * way
    return total <= double_at(field(search, NUMBERS), TOLERANCE_SQUARED)


@inlined
def choose_goal(search: int, tree: int) -> bool:
    """Go on to the next vertex and goal that are near each other; False if there are none."""
    while field(search, VERTEX) < field(search, VERTEX_END):
        while field(search, GOAL) < field(search, GOAL_COUNT):
            if goal_in_reach(search, tree, field(search, VERTEX), field(search, GOAL)):
                return True
            set_field(search, GOAL, field(search, GOAL) + 1)
        set_field(search, VERTEX, field(search, VERTEX) + 1)
        set_field(search, GOAL, 0)
    return False


@entry
def resume_single(search: int, budget: int) -> int:
    """Go on with one tree whose vertices near a goal try to reach it; else as :func:`resume_pair`."""
    tree, done = field(field(search, TREES), 0), 0
    while True:
        step = field(search, NEXT)
        if step == GROW:
            keep(search, tree)
            set_field(search, VERTEX_END, field(tree, SIZE))
            set_field(search, NEXT, CHOOSE_GOAL)
            continue
        if step == REACH_GOAL:
            set_field(search, NEXT, CHOOSE_GOAL)
            set_field(search, GOAL, field(search, GOAL) + 1)
            if keep(search, tree) == REACHED:
                return SOLVED
            continue
        if step == CHOOSE_GOAL and not choose_goal(search, tree):
            set_field(search, NEXT, BEGIN)
            continue
        if step == BEGIN and field(search, ITERATIONS) >= field(search, ITERATION_LIMIT):
            return EXHAUSTED
        if step == BEGIN and done >= budget:
            return RUNNING
        if not has_room(search, tree):
            return FULL
        if step == BEGIN:
            done += 1
            set_field(search, ITERATIONS, field(search, ITERATIONS) + 1)
            set_field(search, VERTEX, field(tree, SIZE))
            set_field(search, GOAL, 0)
            sample(search)
            near, next_step = nearest_vertex(search, tree), GROW
        else:
            dof = field(search, DOF)
            copy_row(dof, field(search, GOALS) + 8 * dof * field(search, GOAL), field(search, TARGET))
            near, next_step = field(search, VERTEX), REACH_GOAL
        aim(search, tree, near, next_step == REACH_GOAL)
        set_field(search, NEXT, next_step)
        if open_edges(search) > 0:
            return ASKING
