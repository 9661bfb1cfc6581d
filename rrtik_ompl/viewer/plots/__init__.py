"""Plots of joint values, of the genetic algorithm, of reachability maps and of the tree of MB-RRT (matplotlib)."""
