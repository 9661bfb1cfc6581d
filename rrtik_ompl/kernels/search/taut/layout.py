"""The table of a route that is pulled taut in a kernel."""

from __future__ import annotations

from rrtik_ompl.kernels.record import Doubles, Record
from rrtik_ompl.kernels.search.motions.motion_layout import Configuration, MotionTable

KERNELS = "search.taut.kernels"  # their library


class TightenTable(Record):
    """A route that is pulled taut."""

    motions: MotionTable  # of the world
    route: Configuration  # waypoints
    point: Configuration  # where a bend is to go
    steps: Doubles  # length of each bend's next step, as a share of what straightens it
    hints: Doubles  # of the motions before and after each bend: where one of them failed last, see below
    count: int  # waypoints
    random: int  # state
    bend: int  # the next one to move
    checks: int  # motions so far
    sweeps: int  # times that all bends had their turn
    moved: int  # whether a bend has moved or still has a step to make in this sweep


HINT_SIZE = 2  # doubles: pair of the proof, or -1; place on the motion
DONE, RUNNING = range(2)  # what tighten() returns: nothing moves any more, the checks are spent
