"""RRT-Connect of pyroboplan (Python, Pinocchio and coal)."""

from __future__ import annotations

import numpy as np

from bench.peers.libraries.pinocchio_model import model_and_geometry
from bench.peers.serve import serve
from bench.peers.task import PER_RADIAN, RANGE, Rows, Search, Task


def search(task: Task) -> Search:
    """From a seed to a path."""
    from pyroboplan.planning.rrt import RRTPlanner, RRTPlannerOptions

    model, geometry = model_and_geometry(task)
    options = RRTPlannerOptions(
        max_step_size=1.0 / PER_RADIAN,
        max_connection_dist=RANGE,
        rrt_connect=True,
        bidirectional_rrt=True,
        max_planning_time=task.seconds,
    )
    planner = RRTPlanner(model, geometry, options)

    def solve(seed: int) -> Rows | None:
        options.rng_seed = seed
        path = planner.plan(np.array(task.start), np.array(task.goal))
        return np.array(path) if path else None

    return solve


if __name__ == "__main__":
    serve(("pyroboplan", "pin", "coal"), search)
