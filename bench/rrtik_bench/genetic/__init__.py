"""The genetic algorithm for trajectories [2]: what was published, and the runs that are compared with it."""
