"""Kernels that measure distances between bodies, in float64, with nearest points and gradients.

Two convex solids that are apart are measured by GJK [35], two that overlap by the expanding polytope [77]. Both search
the direction along which the gap of two solids is largest, and every direction gives a lower bound. So two trees of
solids are descended from their roots, the nearer branches first, and whatever is not nearer than the best pair of
leaves so far is left out.
"""

from __future__ import annotations

from math import nan, sqrt
from typing import Any

from rrtik_ompl.kernels.checks.gjk import cross, depth_inside, dot, minus, scaled
from rrtik_ompl.kernels.distances import layout
from rrtik_ompl.kernels.distances.layout import (
    BEYOND,
    CROSSING,
    MEASURED,
    SURROUNDED,
    UNKNOWN,
    ColumnRows,
    DistanceTable,
    NodeRows,
)
from rrtik_ompl.kernels.layout import JointValues
from rrtik_ompl.kernels.proof.frames import (
    carried,
    frame_at,
    node_frames,
    origin_of,
    place_frames,
    turned,
    turned_back,
    vector_at,
)
from rrtik_ompl.kernels.proof.layout import (
    BALL_CENTRE,
    BALL_RADIUS,
    DISC,
    DISC_AXIS,
    END_BLOCK,
    FIRST_BLOCK,
    HALF_SPACE,
    JOINT_AXIS,
    JOINT_SIZE,
    ROUND,
    SOLID_FRAME,
    SOLID_KIND,
    Frame,
)
from rrtik_ompl.kernels.proof.planes import (
    ANY_WAY,
    LOWEST,
    UPRIGHT,
    ahead,
    corner_at,
    heights,
    highest_corner,
    put_vector,
    sizes_at,
    solid_at,
)
from rrtik_ompl.kernels.record import Doubles, Ints
from rrtik_ompl.kernels.simd.compiled import entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import bits, first_bit, larger
from rrtik_ompl.kernels.simd.records import row_at

MOST_STEPS = 100
CONVERGED = 1e-12  # [m] of upper and lower bound of a distance
ACCURATE = 1e-7  # [m] the same where rounding, or a disc, lets no more be found
SHORTEST = 1e-10  # [m] of a vector that has a direction
# [m] by which a pair has to be nearer to be looked at. A nearest point that is wrong by s changes a distance d by
# s^2 / 2 d only, and its gradient by s / d: what looks like rounding would cost the gradient half of its digits.
NEARER = 1e-14
SAME = 1e-10  # [m] depths that are not told apart
FLAT = 1e-12  # [m] height of a polytope without an inside
# [m^2] twice the area of a face without a normal. On the rim of a disc, corners so near each other that the depth is
# known to SAME span some 1e-16 m^2.
THIN = 1e-20
NO_WEIGHT = 1e-12
NOWHERE = (nan, nan, nan)
APART, OVERLAPPING, FAR, LOST = range(4)


@entry
def measure(
    table: DistanceTable,
    rows: JointValues,
    count: int,
    columns: ColumnRows,
    column_count: int,
    values: Doubles,
    points: Doubles,
    gradients: Doubles,
    told: Ints,
) -> int:
    """Measure the distances of pairs of objects at rows of joint values; returns how many the caller must look at.

    Args:
        table: The table.
        rows: Rows of joint values.
        count: How many.
        columns: The pairs.
        column_count: How many.
        values: Gets the signed distances, shape (count, columns).
        points: Gets the nearest points in the world, NaN where there are none, shape (count, columns, 2, 3).
        gradients: Gets the derivatives by the coordinates, shape (count, columns, dof).
        told: Gets what is told of each, shape (count, columns).
    """
    left = 0
    for k in range(count):
        row = row_at(rows, table.joint_count, k)
        place_frames(table, row, row, 0.0, 0)
        frames = node_frames(table, 0)
        put_twists(table, frames)
        for j in range(table.keep):
            table.smallest[j] = table.within
        for j in range(column_count):
            place = k * column_count + j
            column = row_at(columns, layout.COLUMN_SIZE, j)
            limit = table.within if table.keep == 0 else table.smallest[table.keep - 1]
            answer, value, way, p, q = distance(table, column, frames, limit)
            told[place] = answer
            values[place] = value
            seen = dot(way, way) > 0.0
            put_vector(points, 6 * place, p if seen else NOWHERE)
            put_vector(points, 6 * place + 3, q if seen else NOWHERE)
            put_gradient(table, column, way, p, q, row_at(gradients, table.dof, place))
            if answer >= SURROUNDED:
                left += 1
            elif answer != BEYOND and table.keep > 0:
                remember(table, value)
    return left


@inlined
def remember(table: DistanceTable, value: float) -> None:
    """Put a distance among the smallest ones, in order."""
    place = table.keep - 1
    while place > 0 and table.smallest[place - 1] > value:
        table.smallest[place] = table.smallest[place - 1]
        place -= 1
    table.smallest[place] = value


@inlined
def node_at(table: DistanceTable, number: int) -> NodeRows:
    """What is said of a node."""
    return row_at(table.nodes, layout.NODE_SIZE, number)


@inlined
def is_leaf(node: NodeRows) -> bool:
    """Whether a node has no branches."""
    return bool(node[layout.NODE_FIRST] < 0)


@inlined
def frame_of(table: DistanceTable, frames: Frame, node: NodeRows) -> Frame:
    """The frame that carries a node."""
    return frame_at(frames, solid_at(table, node[layout.NODE_SOLID])[SOLID_FRAME])


@kernel
def distance(table: DistanceTable, column: ColumnRows, frames: Frame, limit: float) -> Any:
    """Measure two objects: what is told of them, signed distance, direction, and the nearest point of each.

    Pairs of nodes wait on a stack, the one with the least bound on top.
    """
    nothing = (0.0, 0.0, 0.0)
    first = column[layout.COLUMN_ONE]
    second = column[layout.COLUMN_OTHER]
    if first < 0 or second < 0:
        return UNKNOWN, 0.0, nothing, nothing, nothing
    one_frame = frame_of(table, frames, node_at(table, first))
    other_frame = frame_of(table, frames, node_at(table, second))
    gap, start = between_balls(table, first, second, one_frame, other_frame)
    if gap >= limit:
        return BEYOND, limit, nothing, nothing, nothing

    best = limit
    answer = BEYOND
    best_way = p = q = nothing
    surrounded = False
    push(table, 0, first, second, LOWEST, LOWEST, start)
    height = 1
    while height > 0:
        height -= 1
        bounds = row_at(table.bounds, layout.BOUND_SIZE, height)
        if bounds[layout.BOUND] >= best - NEARER:
            continue
        pair = row_at(table.stack, layout.STACK_SIZE, height)
        one = node_at(table, pair[0])
        other = node_at(table, pair[1])
        way = vector_at(bounds, layout.BOUND_WAY)
        parent = bounds[layout.PARENT_BOUND]
        at_leaf = is_leaf(one) and is_leaf(other)
        if at_leaf or pays(table, one, other, bounds, best):
            state, low, value, way, a, b, exact = compared(table, one, other, one_frame, other_frame, way, best)
            if state == FAR or low >= best:
                continue
            if state == APART and exact:
                best = value
                best_way = way
                p = a
                q = b
                answer = MEASURED
                continue
            if state == OVERLAPPING and not surrounded and column[layout.COLUMN_HOLLOW] != 0:
                surrounded = may_surround(table, one, other, one_frame, other_frame)
            parent = low if state == APART else LOWEST
        if not at_leaf:
            height = split(table, height, pair[0], pair[1], one_frame, other_frame, way, parent)
            continue
        found, value, way, a, b = of_leaves(table, one, other, one_frame, other_frame, way, best)
        if found == MEASURED:
            best = value
            best_way = way
            p = a
            q = b
            answer = MEASURED
        elif found != BEYOND:
            return found, value, way, a, b
    if surrounded and best > 0.0:
        answer = SURROUNDED
    return answer, best, best_way, p, q


@inlined
def pays(table: DistanceTable, one: NodeRows, other: NodeRows, bounds: Doubles, best: float) -> bool:
    """Whether a pair of nodes, not both leaves, is compared before it is split.

    A mesh is, if its part is known to be farther away than the whole: else the part has the whole's nearest point. A
    box always is, unless its branches are leaves and there is nothing yet that these could be farther away than.
    """
    if one[layout.NODE_KIND] == layout.BOX_AROUND or other[layout.NODE_KIND] == layout.BOX_AROUND:
        box = one if one[layout.NODE_KIND] == layout.BOX_AROUND else other
        return bool(best < -LOWEST or not is_leaf(node_at(table, box[layout.NODE_FIRST])))
    return bool(bounds[layout.BOUND] > bounds[layout.PARENT_BOUND] + NEARER or bounds[layout.BOUND] == LOWEST)


@kernel
def of_leaves(
    table: DistanceTable, one: NodeRows, other: NodeRows, one_frame: Frame, other_frame: Frame, way: Any, limit: float
) -> Any:
    """Measure two leaves that are not known to be apart, point by point if one is of points.

    Returns:
        As :func:`distance`; BEYOND if it is not below the limit.
    """
    nothing = (0.0, 0.0, 0.0)
    one_kind = one[layout.NODE_KIND]
    other_kind = other[layout.NODE_KIND]
    if one_kind == layout.TRIANGLE and other_kind == layout.TRIANGLE:
        return CROSSING, 0.0, nothing, nothing, nothing
    if one_kind == layout.POINTS and other_kind == layout.POINTS:
        return UNKNOWN, 0.0, nothing, nothing, nothing
    if one_kind != layout.POINTS and other_kind != layout.POINTS:
        return of_solids(table, one[layout.NODE_SOLID], other[layout.NODE_SOLID], one_frame, other_frame, way, limit)

    cloud = one if one_kind == layout.POINTS else other
    centres = solid_at(table, cloud[layout.NODE_CENTRES])
    first = table.element if one_kind == layout.POINTS else one[layout.NODE_SOLID]
    second = table.element if other_kind == layout.POINTS else other[layout.NODE_SOLID]
    answer = BEYOND
    best = limit
    best_way = p = q = nothing
    for block in range(centres[FIRST_BLOCK], centres[END_BLOCK]):
        bounds = element_gaps(table, cloud, block, first, second, one_frame, other_frame, way)
        left = bits(bounds < best - NEARER)
        while left != 0:
            lane = first_bit(left)
            put_element(table, cloud[layout.NODE_PART], corner_at(table.corners, block, lane))
            found, value, toward, a, b = of_solids(table, first, second, one_frame, other_frame, way, best)
            if found == UNKNOWN:
                return UNKNOWN, 0.0, nothing, nothing, nothing
            if found == MEASURED:
                answer = MEASURED
                best = value
                best_way = toward
                p = a
                q = b
                way = toward
                bounds = larger(bounds, element_gaps(table, cloud, block, first, second, one_frame, other_frame, way))
            left = left & (left - 1) & bits(bounds < best - NEARER)
    return answer, best, best_way, p, q


@kernel
def element_gaps(
    table: DistanceTable,
    cloud: NodeRows,
    block: int,
    first: int,
    second: int,
    one_frame: Frame,
    other_frame: Frame,
    way: Any,
) -> Any:
    """As ``gap_along``, of each element of a block of a cloud, a lane each; ``table.element`` is one of the two solids.

    All elements are alike, so that their gaps differ as their centres do.
    """
    is_one = first == table.element
    outward = turned_back(one_frame, way) if is_one else turned_back(other_frame, scaled(way, -1.0))
    centre = corner_at(table.corners, block, 0)
    put_element(table, cloud[layout.NODE_PART], centre)
    gap = solids_gap(table, first, second, one_frame, other_frame, way)
    return heights(table.corners, block, outward) + (gap - dot(outward, centre))


@kernel
def of_solids(
    table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame, way: Any, limit: float
) -> Any:
    """Measure two convex solids; returns as :func:`of_leaves`."""
    nothing = (0.0, 0.0, 0.0)
    state, low, value, way, a, b, _, _ = solids_compared(
        table, first, second, one_frame, other_frame, way, limit, False
    )
    if state == FAR or low >= limit:
        return BEYOND, limit, nothing, nothing, nothing
    if state == APART:
        return (MEASURED if value < limit else BEYOND), value, way, a, b
    if state == LOST:
        return UNKNOWN, 0.0, nothing, nothing, nothing
    found, value, way, a, b = depth(table, first, second, one_frame, other_frame, way)
    if not found:
        return UNKNOWN, 0.0, nothing, nothing, nothing
    return (MEASURED if value < limit else BEYOND), value, way, a, b


@kernel
def put_element(table: DistanceTable, part: int, centre: Any) -> None:
    """Let what is around a point be the solid that is compared."""
    element = row_at(table.spans, layout.SPAN_SIZE, table.element)
    template = row_at(table.spans, layout.SPAN_SIZE, part)
    for place in range(layout.SPAN_EDGES, layout.SPAN_SIZE):
        element[place] = template[place]
    put_vector(element, layout.SPAN_MIDDLE, centre)
    sizes_at(table, table.element)[ROUND] = sizes_at(table, part)[ROUND]


@inlined
def may_surround(table: DistanceTable, one: NodeRows, other: NodeRows, one_frame: Frame, other_frame: Frame) -> bool:
    """Whether one of two nodes that overlap is the hull of a mesh, and what the other stands for may be inside it."""
    one_kind = one[layout.NODE_KIND]
    other_kind = other[layout.NODE_KIND]
    if one_kind != layout.HULL and other_kind != layout.HULL:
        return False
    if one_kind == layout.POINTS or other_kind == layout.POINTS:
        return True
    if one_kind == layout.BOX_AROUND or other_kind == layout.BOX_AROUND:
        return False
    return is_nested(table, one[layout.NODE_SOLID], other[layout.NODE_SOLID], one_frame, other_frame)


@inlined
def between_balls(table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame) -> Any:
    """A lower bound of the distance of two nodes by their balls, and the direction between these."""
    one = node_at(table, first)[layout.NODE_SOLID]
    other = node_at(table, second)[layout.NODE_SOLID]
    if solid_at(table, one)[SOLID_KIND] == HALF_SPACE:
        return LOWEST, scaled(turned(one_frame, vector_at(sizes_at(table, one), DISC_AXIS)), -1.0)
    if solid_at(table, other)[SOLID_KIND] == HALF_SPACE:
        return LOWEST, turned(other_frame, vector_at(sizes_at(table, other), DISC_AXIS))
    p = carried(one_frame, vector_at(sizes_at(table, one), BALL_CENTRE))
    q = carried(other_frame, vector_at(sizes_at(table, other), BALL_CENTRE))
    way = minus(p, q)
    length = sqrt(dot(way, way))
    gap = length - sizes_at(table, one)[BALL_RADIUS] - sizes_at(table, other)[BALL_RADIUS]
    return gap, (scaled(way, 1.0 / length) if length > SHORTEST else ANY_WAY)


@kernel
def is_nested(table: DistanceTable, one: int, other: int, one_frame: Frame, other_frame: Frame) -> bool:
    """Whether one solid may lie wholly inside the other: along each axis of the world it takes a part of its extent."""
    one_in_other = True
    other_in_one = True
    for axis in range(3):
        way = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
        back = scaled(way, -1.0)
        above = dot(minus(support(table, one, one_frame, way), support(table, other, other_frame, way)), way)
        below = dot(minus(support(table, one, one_frame, back), support(table, other, other_frame, back)), back)
        around = sizes_at(table, one)[ROUND] - sizes_at(table, other)[ROUND]
        one_in_other = one_in_other and above + around <= 0.0 and below + around <= 0.0
        other_in_one = other_in_one and above + around >= 0.0 and below + around >= 0.0
    return one_in_other or other_in_one


@inlined
def push(table: DistanceTable, height: int, first: int, second: int, bound: float, parent: float, way: Any) -> None:
    """Put a pair of nodes on the stack."""
    pair = row_at(table.stack, layout.STACK_SIZE, height)
    pair[0] = first
    pair[1] = second
    bounds = row_at(table.bounds, layout.BOUND_SIZE, height)
    bounds[layout.BOUND] = bound
    bounds[layout.PARENT_BOUND] = parent
    put_vector(bounds, layout.BOUND_WAY, way)


@kernel
def split(
    table: DistanceTable,
    height: int,
    first: int,
    second: int,
    one_frame: Frame,
    other_frame: Frame,
    way: Any,
    parent: float,
) -> int:
    """Put a pair of nodes on the stack with the branches of the larger one in its place; returns the stack's height."""
    one = node_at(table, first)
    other = node_at(table, second)
    one_size = size_of(table, one)
    other_size = size_of(table, other)
    splits_one = not is_leaf(one) and (is_leaf(other) or one_size >= other_size)
    a = one[layout.NODE_FIRST] if splits_one else first
    b = second if splits_one else other[layout.NODE_FIRST]
    c = one[layout.NODE_SECOND] if splits_one else first
    d = second if splits_one else other[layout.NODE_SECOND]
    gap = gap_along(table, a, b, one_frame, other_frame, way)
    other_gap = gap_along(table, c, d, one_frame, other_frame, way)
    if gap < other_gap:
        push(table, height, c, d, other_gap, parent, way)
        push(table, height + 1, a, b, gap, parent, way)
    else:
        push(table, height, a, b, gap, parent, way)
        push(table, height + 1, c, d, other_gap, parent, way)
    return height + 2


@inlined
def size_of(table: DistanceTable, node: NodeRows) -> float:
    """The radius of a node's ball; a box around solids counts as larger than meshes, so that each is held to these."""
    if node[layout.NODE_KIND] == layout.BOX_AROUND:
        return -LOWEST
    radius: float = sizes_at(table, node[layout.NODE_SOLID])[BALL_RADIUS]
    return radius


@inlined
def support(table: DistanceTable, number: int, frame: Frame, way: Any) -> Any:
    """The point of a solid's core, in its frame, that is farthest along a vector of the surroundings, of any length.

    Of a box, a segment or a point it is a sum; else it is one of the corners.
    """
    own = turned_back(frame, way)
    span = row_at(table.spans, layout.SPAN_SIZE, number)
    if span[layout.IS_SPAN] > 0.0:
        p = vector_at(span, layout.SPAN_MIDDLE)
        for axis in range(3):
            half = vector_at(span, layout.SPAN_EDGES + 3 * axis)
            p = ahead(p, scaled(half, 1.0 if dot(half, own) > 0.0 else -1.0))
    else:
        solid = solid_at(table, number)
        p = highest_corner(table.corners, solid[FIRST_BLOCK], solid[END_BLOCK], own)
    sizes = sizes_at(table, number)
    radius = sizes[DISC]
    if radius > 0.0:
        pole = vector_at(sizes, DISC_AXIS)
        across = minus(own, scaled(pole, dot(pole, own)))
        length = sqrt(dot(across, across))
        if length > UPRIGHT * sqrt(dot(own, own)):
            p = minus(p, scaled(across, -radius / length))
    return carried(frame, p)


@inlined
def gap_along(table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame, way: Any) -> Any:
    """The gap of two nodes along a unit vector: a lower bound of their signed distance."""
    one = node_at(table, first)[layout.NODE_SOLID]
    other = node_at(table, second)[layout.NODE_SOLID]
    return solids_gap(table, one, other, one_frame, other_frame, way)


@inlined
def solids_gap(table: DistanceTable, one: int, other: int, one_frame: Frame, other_frame: Frame, way: Any) -> float:
    """As ``gap_along``, of two solids."""
    if solid_at(table, one)[SOLID_KIND] == HALF_SPACE or solid_at(table, other)[SOLID_KIND] == HALF_SPACE:
        return LOWEST
    p = support(table, one, one_frame, scaled(way, -1.0))
    q = support(table, other, other_frame, way)
    gap: float = dot(minus(p, q), way) - sizes_at(table, one)[ROUND] - sizes_at(table, other)[ROUND]
    return gap


@inlined
def compared(
    table: DistanceTable,
    one: NodeRows,
    other: NodeRows,
    one_frame: Frame,
    other_frame: Frame,
    way: Any,
    limit: float,
) -> Any:
    """Compare two nodes.

    Returns:
        APART, OVERLAPPING, FAR (not below the limit) or LOST; a lower bound of the distance; the distance; its
        direction; the nearest points; whether these are of the objects.
    """
    first = one[layout.NODE_SOLID]
    second = other[layout.NODE_SOLID]
    asks = one[layout.NODE_KIND] > layout.TRIANGLE or other[layout.NODE_KIND] > layout.TRIANGLE
    state, low, value, way, a, b, single, other_single = solids_compared(
        table, first, second, one_frame, other_frame, way, limit, asks
    )
    exact = is_of_object(one, single) and is_of_object(other, other_single)
    return state, low, value, way, a, b, exact


@inlined
def solids_compared(
    table: DistanceTable,
    first: int,
    second: int,
    one_frame: Frame,
    other_frame: Frame,
    way: Any,
    limit: float,
    asks: bool,
) -> Any:
    """Compare two convex solids, or one and a half-space; returns as :func:`between`."""
    if solid_at(table, first)[SOLID_KIND] == HALF_SPACE:
        value, way, b, a = over_half_space(table, second, first, other_frame, one_frame)
        return APART, value, value, scaled(way, -1.0), a, b, True, True
    if solid_at(table, second)[SOLID_KIND] == HALF_SPACE:
        value, way, a, b = over_half_space(table, first, second, one_frame, other_frame)
        return APART, value, value, way, a, b, True, True
    return between(table, first, second, one_frame, other_frame, way, limit, asks)


@inlined
def is_of_object(node: NodeRows, single: bool) -> bool:
    """Whether the nearest point of a node, perhaps a single corner of it, is a point of the object."""
    kind = node[layout.NODE_KIND]
    return kind <= layout.TRIANGLE or (kind <= layout.AROUND and single)


@kernel
def over_half_space(table: DistanceTable, one: int, plane: int, frame: Frame, plane_frame: Frame) -> Any:
    """The height of a solid over a half-space, the direction, and the lowest point with its foot."""
    sizes = sizes_at(table, plane)
    normal = turned(plane_frame, vector_at(sizes, DISC_AXIS))
    low = support(table, one, frame, scaled(normal, -1.0))
    low = minus(low, scaled(normal, sizes_at(table, one)[ROUND]))
    height = dot(normal, minus(low, origin_of(plane_frame))) - sizes[DISC]
    return height, normal, low, minus(low, scaled(normal, height))


@kernel
def between(
    table: DistanceTable, one: int, other: int, one_frame: Frame, other_frame: Frame, way: Any, limit: float, asks: bool
) -> Any:
    """GJK on two convex solids, from a first direction on.

    Returns:
        As :func:`compared`, in place of the last: whether a single corner of the first solid's core made the nearest
        point, and whether one of the second.
    """
    around = sizes_at(table, one)[ROUND] + sizes_at(table, other)[ROUND]
    low = LOWEST
    length = -LOWEST
    a = b = c = way  # corners of a triangle in the difference of the solids
    u = v = w = way  # the points of the first solid that made them
    weights = (1.0, 0.0, 0.0)
    nearest = heading = way
    inverse = 1.0  # of the length of ``heading``; nothing waits for it
    inside = False
    for step in range(MOST_STEPS):
        x = support(table, one, one_frame, scaled(heading, -1.0))
        p = minus(x, support(table, other, other_frame, heading))
        height = dot(p, heading) * inverse
        low = max(low, height)
        if low - around >= limit:
            return FAR, low - around, limit, scaled(heading, inverse), x, x, False, False
        if length - low <= CONVERGED:
            break
        if step == 0:
            a = p
            b = p
            c = p
            u = x
            v = x
            w = x
            nearest = p
        else:
            if height <= 0.0 and depth_inside(a, b, c, p) >= 0.0:
                inside = True
                break
            place, share, point, square = with_corner(a, b, c, weights, p)
            if square >= length * length:  # rounding lets nothing better be found
                break
            weights = share
            nearest = point
            if place == 0:
                a = p
                u = x
            elif place == 1:
                b = p
                v = x
            else:
                c = p
                w = x
        length = sqrt(dot(nearest, nearest))
        if length < SHORTEST:
            inside = True
            break
        heading = nearest
        inverse = 1.0 / length

    way = scaled(heading, inverse)
    on_one = mean(weights, u, v, w)
    nearest = mean(weights, a, b, c)
    on_other = minus(on_one, nearest)
    single = asks and same_points(weights, u, v, w)
    other_single = asks and same_points(weights, minus(u, a), minus(v, b), minus(w, c))
    state = APART
    if inside or (length - low > ACCURATE and low <= 0.0):
        state = OVERLAPPING
    elif length - low > ACCURATE:
        state = LOST
    on_one = minus(on_one, scaled(way, sizes_at(table, one)[ROUND]))
    on_other = ahead(on_other, scaled(way, sizes_at(table, other)[ROUND]))
    return state, low - around, length - around, way, on_one, on_other, single, other_single


@inlined
def with_corner(a: Any, b: Any, c: Any, weights: Any, p: Any) -> Any:
    """Let a point take the place of a corner of a triangle: of one without weight, or else where that is best.

    Returns:
        The number of the corner, the new weights, the point of the new triangle that is nearest to the origin, and the
        square of its distance.
    """
    if weights[2] == 0.0:
        share = weights_on_triangle(a, b, p)
        nearest = mean(share, a, b, p)
        return 2, share, nearest, dot(nearest, nearest)
    if weights[1] == 0.0:
        share = weights_on_triangle(a, p, c)
        nearest = mean(share, a, p, c)
        return 1, share, nearest, dot(nearest, nearest)
    share = weights_on_triangle(p, b, c)
    nearest = mean(share, p, b, c)
    square = dot(nearest, nearest)
    if weights[0] == 0.0:
        return 0, share, nearest, square
    place = 0
    for turn in range(1, 3):
        own = weights_on_triangle(a, p, c) if turn == 1 else weights_on_triangle(a, b, p)
        point = mean(own, a, p, c) if turn == 1 else mean(own, a, b, p)
        if dot(point, point) < square:
            place = turn
            share = own
            nearest = point
            square = dot(point, point)
    return place, share, nearest, square


@inlined
def mean(weights: Any, a: Any, b: Any, c: Any) -> Any:
    """The mean of three points with weights."""
    return (
        weights[0] * a[0] + weights[1] * b[0] + weights[2] * c[0],
        weights[0] * a[1] + weights[1] * b[1] + weights[2] * c[1],
        weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2],
    )


@inlined
def same_points(weights: Any, u: Any, v: Any, w: Any) -> bool:
    """Whether those of three points that have a weight are one."""
    heaviest = u if weights[0] >= weights[1] and weights[0] >= weights[2] else (v if weights[1] >= weights[2] else w)
    return is_same(weights[0], u, heaviest) and is_same(weights[1], v, heaviest) and is_same(weights[2], w, heaviest)


@inlined
def is_same(weight: float, u: Any, v: Any) -> bool:
    """Whether two points are one, or one of them has no weight."""
    apart = minus(u, v)
    return weight <= NO_WEIGHT or dot(apart, apart) <= SHORTEST * SHORTEST


@kernel
def weights_on_triangle(a: Any, b: Any, c: Any) -> Any:
    """The weights of a triangle's corners whose mean is nearest to the origin [36, section 5.1.5].

    The corners may coincide.
    """
    ab = minus(b, a)
    ac = minus(c, a)
    d1 = -dot(ab, a)
    d2 = -dot(ac, a)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3 = -dot(ab, b)
    d4 = -dot(ac, b)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    d5 = -dot(ab, c)
    d6 = -dot(ac, c)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    of_c = d1 * d4 - d3 * d2
    if of_c <= 0.0 and d1 >= 0.0 >= d3 and d1 > d3:
        share = d1 / (d1 - d3)
        return 1.0 - share, share, 0.0
    of_b = d5 * d2 - d1 * d6
    if of_b <= 0.0 and d2 >= 0.0 >= d6 and d2 > d6:
        share = d2 / (d2 - d6)
        return 1.0 - share, 0.0, share
    of_a = d3 * d6 - d5 * d4
    if of_a <= 0.0 and d4 >= d3 and d5 >= d6 and (d4 - d3) + (d5 - d6) > 0.0:
        share = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - share, share
    # By cross products: of long thin triangles the products above leave few digits.
    normal = cross(ab, ac)
    whole = dot(normal, normal)
    v = dot(cross(ac, a), normal) / whole
    w = dot(cross(a, ab), normal) / whole
    if not (v >= 0.0 and w >= 0.0 and v + w <= 1.0):
        return 1.0, 0.0, 0.0
    return 1.0 - v - w, v, w


@kernel
def depth(table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame, way: Any) -> Any:
    """Measure two convex solids that overlap, by a polytope that grows in their difference around the origin.

    Returns:
        Whether that was possible; minus the least distance by which the first solid has to be moved to be apart; the
        unit vector along which; and the deepest point of each.
    """
    nothing = (0.0, 0.0, 0.0)
    count = begin_polytope(table, first, second, one_frame, other_frame, way)
    if count == 0:
        return False, 0.0, nothing, nothing, nothing
    faces = 4
    while True:
        nearest = 0
        for k in range(1, faces):
            if plane_at(table, k)[3] < plane_at(table, nearest)[3]:
                nearest = k
        plane = plane_at(table, nearest)
        normal = vector_at(plane, 0)
        put_support(table, first, second, one_frame, other_frame, normal, count)
        rise = dot(point_at(table, count), normal) - plane[3]
        if rise <= SAME or count + 1 == layout.MOST_POINTS:
            break
        faces = grown(table, faces, count)
        count += 1
        if faces == 0 or faces > layout.MOST_FACES - layout.MOST_POINTS // 2:
            return False, 0.0, nothing, nothing, nothing
    if rise > ACCURATE:
        return False, 0.0, nothing, nothing, nothing

    weights = (1.0, 0.0, 0.0)
    offset = plane[3]
    square = -LOWEST
    for k in range(faces):  # of faces in one plane, the one that the origin is above
        if plane_at(table, k)[3] <= offset + SAME:
            corners = row_at(table.faces, layout.FACE_SIZE, k)
            a = point_at(table, corners[0])
            b = point_at(table, corners[1])
            c = point_at(table, corners[2])
            own = weights_on_triangle(a, b, c)
            foot = mean(own, a, b, c)
            if dot(foot, foot) < square:
                square = dot(foot, foot)
                weights = own
                nearest = k
    face = row_at(table.faces, layout.FACE_SIZE, nearest)
    on_one = mean(
        weights, first_point_at(table, face[0]), first_point_at(table, face[1]), first_point_at(table, face[2])
    )
    on_other = minus(on_one, scaled(normal, offset))
    way = scaled(normal, -1.0)
    around = sizes_at(table, first)[ROUND]
    other_around = sizes_at(table, second)[ROUND]
    on_one = minus(on_one, scaled(way, around))
    on_other = ahead(on_other, scaled(way, other_around))
    return True, -offset - around - other_around, way, on_one, on_other


@inlined
def plane_at(table: DistanceTable, face: int) -> Any:
    """The plane of a face."""
    return row_at(table.planes, layout.PLANE_SIZE, face)


@inlined
def point_at(table: DistanceTable, number: int) -> Any:
    """A corner of the polytope."""
    return vector_at(row_at(table.points, layout.POINT_SIZE, number), 0)


@inlined
def first_point_at(table: DistanceTable, number: int) -> Any:
    """The point of the first solid that made a corner of the polytope."""
    return vector_at(row_at(table.points, layout.POINT_SIZE, number), 3)


@kernel
def put_support(
    table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame, way: Any, number: int
) -> None:
    """Write the point of the difference that is farthest along a vector as a corner of the polytope."""
    length = sqrt(dot(way, way))
    unit = scaled(way, 1.0 / length)
    x = support(table, first, one_frame, unit)
    row = row_at(table.points, layout.POINT_SIZE, number)
    put_vector(row, 0, minus(x, support(table, second, other_frame, scaled(unit, -1.0))))
    put_vector(row, 3, x)


@kernel
def begin_polytope(
    table: DistanceTable, first: int, second: int, one_frame: Frame, other_frame: Frame, way: Any
) -> int:
    """Make a tetrahedron of corners of the difference; returns 4, or 0 if the difference is flat."""
    put_support(table, first, second, one_frame, other_frame, way, 0)
    put_support(table, first, second, one_frame, other_frame, scaled(way, -1.0), 1)
    edge = minus(point_at(table, 1), point_at(table, 0))
    if dot(edge, edge) < FLAT:
        return 0
    least = (1.0, 0.0, 0.0)
    if abs(edge[1]) <= abs(edge[0]) and abs(edge[1]) <= abs(edge[2]):
        least = (0.0, 1.0, 0.0)
    elif abs(edge[2]) <= abs(edge[0]):
        least = (0.0, 0.0, 1.0)
    across = cross(edge, least)
    normal = across
    area = 0.0
    for turn in range(4):
        aside = across if turn < 2 else cross(edge, across)
        put_support(table, first, second, one_frame, other_frame, scaled(aside, 1.0 - 2.0 * (turn % 2)), 2)
        normal = cross(edge, minus(point_at(table, 2), point_at(table, 0)))
        area = dot(normal, normal)
        if area > FLAT * dot(edge, edge):
            break
    if area <= FLAT * dot(edge, edge):
        return 0
    for turn in range(2):
        put_support(table, first, second, one_frame, other_frame, scaled(normal, 1.0 - 2.0 * turn), 3)
        rise = dot(normal, minus(point_at(table, 3), point_at(table, 0)))
        if abs(rise) > SHORTEST * sqrt(area):
            up = rise > 0.0  # the fourth corner is on the side that the normal of the other three points to
            put_face(table, 0, 0, 2 if up else 1, 1 if up else 2)
            put_face(table, 1, 0, 1 if up else 3, 3 if up else 1)
            put_face(table, 2, 1, 2 if up else 3, 3 if up else 2)
            put_face(table, 3, 2, 0 if up else 3, 3 if up else 0)
            return 4
    return 0


@inlined
def put_face(table: DistanceTable, number: int, i: int, j: int, k: int) -> bool:
    """Write a face of three corners, counter-clockwise from outside; False if it is too thin to have a normal."""
    a = point_at(table, i)
    normal = cross(minus(point_at(table, j), a), minus(point_at(table, k), a))
    length = sqrt(dot(normal, normal))
    if length < THIN:
        return False
    normal = scaled(normal, 1.0 / length)
    face = row_at(table.faces, layout.FACE_SIZE, number)
    face[0] = i
    face[1] = j
    face[2] = k
    plane = plane_at(table, number)
    put_vector(plane, 0, normal)
    plane[3] = dot(normal, a)
    return True


@kernel
def grown(table: DistanceTable, faces: int, corner: int) -> int:
    """Take a corner into the polytope: faces that it is above give way; returns the number of faces, 0 if it fails."""
    p = point_at(table, corner)
    edges = 0
    k = 0
    while k < faces:
        plane = plane_at(table, k)
        if dot(vector_at(plane, 0), p) - plane[3] <= FLAT:
            k += 1
            continue
        face = row_at(table.faces, layout.FACE_SIZE, k)
        for side in range(3):
            edges = toggled(table, edges, face[side], face[(side + 1) % 3])
        faces -= 1
        moved = row_at(table.faces, layout.FACE_SIZE, faces)
        moved_plane = plane_at(table, faces)
        for place in range(layout.FACE_SIZE):
            face[place] = moved[place]
        for place in range(layout.PLANE_SIZE):
            plane[place] = moved_plane[place]

    if faces + edges > layout.MOST_FACES:
        return 0
    for edge in range(edges):
        if not put_face(table, faces, table.edges[2 * edge], table.edges[2 * edge + 1], corner):
            return 0
        faces += 1
    return faces


@inlined
def toggled(table: DistanceTable, edges: int, begin: int, end: int) -> int:
    """Add an edge to those around a hole, or take away the one that leads back; returns how many there are."""
    for k in range(edges):
        if table.edges[2 * k] == end and table.edges[2 * k + 1] == begin:
            table.edges[2 * k] = table.edges[2 * edges - 2]
            table.edges[2 * k + 1] = table.edges[2 * edges - 1]
            return edges - 1
    table.edges[2 * edges] = begin
    table.edges[2 * edges + 1] = end
    return edges + 1


@inlined
def put_twists(table: DistanceTable, frames: Frame) -> None:
    """Write how each joint moves what it carries, for a rate of 1: turning, and moving at the world's origin."""
    for joint in range(table.joint_count):
        own = frame_at(frames, joint + 1)
        axis = turned(own, vector_at(row_at(table.joints, JOINT_SIZE, joint), JOINT_AXIS))
        twist = row_at(table.twists, layout.TWIST_SIZE, joint)
        slides = table.sliding[joint] != 0
        put_vector(twist, 0, (0.0, 0.0, 0.0) if slides else axis)
        put_vector(twist, 3, axis if slides else cross(origin_of(own), axis))


@kernel
def put_gradient(table: DistanceTable, column: ColumnRows, way: Any, p: Any, q: Any, gradient: Doubles) -> None:
    """Write the derivatives of a distance: those of the gap along its direction, at points that bodies carry along.

    A joint that carries both changes nothing. Parents have smaller numbers.
    """
    for k in range(table.dof):
        gradient[k] = 0.0
    if dot(way, way) == 0.0:
        return
    frame = solid_at(table, node_at(table, column[layout.COLUMN_ONE])[layout.NODE_SOLID])[SOLID_FRAME]
    other = solid_at(table, node_at(table, column[layout.COLUMN_OTHER])[layout.NODE_SOLID])[SOLID_FRAME]
    moment = cross(p, way)
    other_moment = cross(q, way)
    while frame != other:
        of_first = frame > other
        joint = (frame if of_first else other) - 1
        coordinate = table.coordinates[joint]
        if coordinate >= 0:
            twist = row_at(table.twists, layout.TWIST_SIZE, joint)
            rate = dot(vector_at(twist, 0), moment if of_first else other_moment) + dot(vector_at(twist, 3), way)
            gradient[coordinate] += (table.gains[joint] if of_first else -table.gains[joint]) * rate
        if of_first:
            frame = table.parents[joint]
        else:
            other = table.parents[joint]
