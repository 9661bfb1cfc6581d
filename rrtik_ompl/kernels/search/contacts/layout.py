"""The table of a route that is pulled taut along its contacts."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Wholes
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration
from rrtik_ompl.kernels.search.shortcut_layout import ShortcutTable

KERNELS = "search.contacts.kernels"  # their library


class PullTable(ShortcutTable):
    """A route that is cut by random shortcuts and pulled taut along its contacts.

    A contact is a pair of solids at a place of a motion, whose gap is linear in the two waypoints of the motion. Gaps
    are what the solids have beyond the clearance that they must keep [m].
    """

    lower: Doubles  # the box of configurations
    upper: Doubles
    candidate: Configuration  # where the waypoints are to go
    arcs: Doubles  # length of the candidate up to each waypoint

    contacts: int
    contact_room: int
    edges: Wholes  # of each contact the motion of the route that it is on
    shares: Doubles  # and its place there, from 0 to 1
    pairs: Wholes  # its solids
    ways: Doubles  # unit normal between them, towards the first one
    points: Doubles  # of a cloud the point, or the lowest corner of the cube, that is touched
    gaps: Doubles  # on the route [m]
    gradients: Configuration  # of the gap
    bounds: Doubles  # what a step may add to the gap at least [m]
    pushes: Doubles  # forces that keep the bounds, 0 where a contact does not press
    lacks: Doubles  # by how much the straight line breaks each bound [m]
    products: Doubles  # of the gradients
    couplings: Doubles  # what a unit push at one contact adds to the gap of another one
    measured: Wholes  # whether the gap on the candidate is known
    next_gaps: Doubles  # on the candidate
    next_gradients: Configuration

    stage: int  # what has been done
    jumped: int  # waypoint from which the next jump goes
    unproven: int  # motions of the route that are not proven
    work: float  # so far, in proofs of free motions
    max_work: float
    least_gain: float  # of a step, as a share of the length; less lets the route settle
    idle: int  # steps in a row that gained less
    refused: int  # motion of the candidate that was refused last
    found_pair: int  # by which solids, -1 if these make no contact
    found_place: float  # and where on the motion


GIVEN, JUMPED, CUT, SETTLED = range(4)  # stages
DONE, RUNNING, UNPROVEN = range(3)  # what pull() returns; unproven: a motion of the given route cannot be proven here
MAX_BENDS = 8  # of a route that gets new ones
