"""The table of a route that is pulled taut in a kernel: what each field is."""

from __future__ import annotations

from typing import NewType

KERNELS = "search.taut.kernels"  # their library
TightenTable = NewType("TightenTable", int)  # of the table of a route

# MOTIONS: the motion table of the world · ROUTE: waypoints · POINT: where a bend is to go · STEPS: of each bend, the
# length of its next step as a share of what straightens it · HINTS: of the motions before and after each bend, where
# one of them failed last (float64, see below)
MOTIONS, ROUTE, POINT, STEPS, HINTS = range(5)
# Numbers. COUNT: waypoints · BEND: the next one to move · CHECKS: motions so far · SWEEPS: times that all bends had
# their turn · MOVED: whether a bend has moved or still has a step to make in this sweep
COUNT, RANDOM, BEND, CHECKS, SWEEPS, MOVED = range(5, 11)

HINT_SIZE = 2  # doubles: pair of the proof, or -1; place on the motion
DONE, RUNNING = range(2)  # what tighten() returns: nothing moves any more, the checks are spent
