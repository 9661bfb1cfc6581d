"""The genetic algorithm for trajectories: what was published, and the runs that are compared with it."""
