"""Straight motions in kernels: the motion table of a world, the rule of steps, and checks of one motion."""
