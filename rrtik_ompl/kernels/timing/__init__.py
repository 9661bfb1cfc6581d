"""Motions along curves in the shortest time, in kernels: the curve and the search along it."""
