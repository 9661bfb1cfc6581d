"""Steps of a route that is pulled taut: the shortest one whose contacts, linear near the present one, keep their gaps.

Think of the motions as springs, each the softer the longer it is: their line of rest is straight, and reweighted thus
they make the route's length, not its square, as small as can be. A contact pushes the route aside. What a push at one
place moves at another one is known in closed form, as in a row of resistors, so a step costs some microseconds.
"""

from __future__ import annotations

from rrtik_ompl.kernels.search.contacts.layout import PullTable
from rrtik_ompl.kernels.search.motions.row_kernels import Configuration, copy_row, distance, row_at
from rrtik_ompl.kernels.simd.compiled import inlined, kernel

ROUNDS = 3  # in which springs are measured anew
SWEEPS = 40  # through all pushes, at most
SHORTEST = 1e-3  # of the route's length: springs are no shorter
SMALLEST_PUSH = 1e-6  # [m] that the last sweep may change gaps by
SMALLEST_COUPLING = 1e-12  # of a contact that can be pushed at


@inlined
def dof_in(route: PullTable) -> int:
    """How many numbers a configuration has."""
    return route.motions.dof


@inlined
def waypoint(route: PullTable, number: int) -> Configuration:
    """Address of a waypoint."""
    return row_at(route.route, dof_in(route), number)


@inlined
def moved(route: PullTable, number: int) -> Configuration:
    """Address of the place that a waypoint is to go to."""
    return row_at(route.candidate, dof_in(route), number)


@inlined
def gradient(route: PullTable, contact: int) -> Configuration:
    """Address of the gradient of a contact's gap."""
    return row_at(route.gradients, dof_in(route), contact)


@kernel
def length_of(dof: int, rows: Configuration, count: int) -> float:
    """Of some configurations in a row."""
    total = 0.0
    for k in range(1, count):
        total += distance(dof, row_at(rows, dof, k - 1), row_at(rows, dof, k))
    return total


@kernel
def lay_shortest(route: PullTable, total: float) -> None:
    """Lay the candidate along the shortest line that keeps the bounds of all contacts and stays in the box.

    Args:
        route: ``total`` long.
        total: See above.
    """
    dof = dof_in(route)
    copy_row(dof * route.count, route.route, route.candidate)
    multiply_gradients(route)
    for _ in range(ROUNDS):
        measure_springs(route, total)
        lay_straight(route)
        couple(route)
        push(route)
        give_way(route)


@kernel
def multiply_gradients(route: PullTable) -> None:
    """Scalar products of the gradients of all contacts."""
    dof = dof_in(route)
    for one in range(route.contacts):
        row = row_at(route.products, route.contact_room, one)
        for other in range(one + 1):
            total = 0.0
            for k in range(dof):
                total += gradient(route, one)[k] * gradient(route, other)[k]
            row[other] = total
            row_at(route.products, route.contact_room, other)[one] = total


@kernel
def measure_springs(route: PullTable, total: float) -> None:
    """Length of the candidate up to each waypoint."""
    arcs = route.arcs
    arcs[0] = 0.0
    for k in range(1, route.count):
        length = distance(dof_in(route), moved(route, k - 1), moved(route, k))
        arcs[k] = arcs[k - 1] + max(length, SHORTEST * total)


@kernel
def lay_straight(route: PullTable) -> None:
    """Lay the bends of the candidate where the springs are at rest, on the straight line."""
    last = route.count - 1
    start = waypoint(route, 0)
    end = waypoint(route, last)
    for bend in range(1, last):
        share = route.arcs[bend] / route.arcs[last]
        row = moved(route, bend)
        for k in range(dof_in(route)):
            row[k] = start[k] + share * (end[k] - start[k])


@inlined
def response(route: PullTable, bend: int, contact: int) -> float:
    """How far a waypoint goes if a unit force pushes at the place of a contact."""
    arcs = route.arcs
    edge = route.edges[contact]
    place = arcs[edge] + route.shares[contact] * (arcs[edge + 1] - arcs[edge])
    whole = arcs[route.count - 1]
    near = min(place, arcs[bend])
    far = max(place, arcs[bend])
    answer: float = near * (whole - far) / whole
    return answer


@kernel
def couple(route: PullTable) -> None:
    """What a unit push at one contact adds to the gap of another one."""
    for one in range(route.contacts):
        edge = route.edges[one]
        share = route.shares[one]
        sink = row_at(route.couplings, route.contact_room, one)
        products = row_at(route.products, route.contact_room, one)
        for other in range(route.contacts):
            way = (1.0 - share) * response(route, edge, other) + share * response(route, edge + 1, other)
            sink[other] = way * products[other]


@kernel
def push(route: PullTable) -> None:
    """Find the least pushes that make up for what the straight line breaks, by Hildreth's ascent [74]."""
    dof = dof_in(route)
    for contact in range(route.contacts):
        edge = route.edges[contact]
        share = route.shares[contact]
        slope = gradient(route, contact)
        lack = route.bounds[contact]
        for k in range(dof):
            step = (1.0 - share) * (moved(route, edge)[k] - waypoint(route, edge)[k])
            step += share * (moved(route, edge + 1)[k] - waypoint(route, edge + 1)[k])
            lack -= slope[k] * step
        route.lacks[contact] = lack

    for _ in range(SWEEPS):
        largest = 0.0
        for contact in range(route.contacts):
            couplings = row_at(route.couplings, route.contact_room, contact)
            own = couplings[contact]
            if own < SMALLEST_COUPLING:
                continue
            lack = route.lacks[contact]
            for other in range(route.contacts):
                lack -= couplings[other] * route.pushes[other]
            stronger = max(0.0, route.pushes[contact] + lack / own)
            largest = max(largest, own * abs(stronger - route.pushes[contact]))
            route.pushes[contact] = stronger
        if largest < SMALLEST_PUSH:
            break


@kernel
def give_way(route: PullTable) -> None:
    """Move the bends of the candidate by the pushes, not beyond the box."""
    dof = dof_in(route)
    for contact in range(route.contacts):
        if route.pushes[contact] == 0.0:
            continue
        slope = gradient(route, contact)
        for bend in range(1, route.count - 1):
            row = moved(route, bend)
            way = route.pushes[contact] * response(route, bend, contact)
            for k in range(dof):
                row[k] += way * slope[k]
    for bend in range(1, route.count - 1):
        row = moved(route, bend)
        for k in range(dof):
            row[k] = min(max(row[k], route.lower[k]), route.upper[k])


@kernel
def go_less_far(route: PullTable, share: float) -> None:
    """Move the candidate a share of its way from the route."""
    for k in range(dof_in(route) * route.count):
        here = route.route[k]
        route.candidate[k] = here + share * (route.candidate[k] - here)
