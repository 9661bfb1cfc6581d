"""Plots of joint values, the genetic algorithm, reachability maps and the tree of MB-RRT, with matplotlib."""
