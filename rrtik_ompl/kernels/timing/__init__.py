"""Motions along curves in the shortest time, in kernels: the curve, the search along it, and their twins in numpy."""
