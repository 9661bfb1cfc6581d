"""Numbers of planning again and shortening each path: what work a path is worth, and when nothing more is gained."""

from __future__ import annotations

PATIENCE = 60  # plans of which nothing is gained, after which the search has converged
GAIN = 1e-4  # of the cost, below which nothing is gained
QUICK_CHECKS = 120  # motions that are checked to see what a path is worth; some 3 ms
WORTH = 1.2  # times the cost of the best path, above which one is not shortened further
SETTLED = 1e-2  # of the cost, gained less than which a path is not shortened again
BOUND = 1.5  # times the length of the best path are further ones to stay below, before they are shortened
BOUNDED_SAMPLES = 3000  # that are drawn to find one
