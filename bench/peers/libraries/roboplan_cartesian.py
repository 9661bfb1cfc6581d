"""Cartesian planner of roboplan (C++, Pinocchio): the tip in a straight line from the start to the goal's pose.

With ``fine`` it is to stay within 0.1 mm and 0.1 degrees, otherwise within its own default of 5 mm and 0.01 rad. It
looks at no obstacles.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.peers.serve import serve
from bench.peers.task import BASE, GROUP, TIP, Rows, Search, Task

FINE = {"max_position_error": 1e-4, "max_orientation_error": np.radians(0.1)}
SPEED = {"max_linear_speed": 1.0, "max_angular_speed": 3.0}  # [m/s, rad/s] fast, so that it makes few points


def search(task: Task, *, fine: bool = False) -> Search:
    """From a seed, which it does not use, to the joints along the line; an error of its own where it cannot go on."""
    from roboplan import cartesian_planning, core

    urdf = Path(task.urdf)
    scene = core.Scene("arm", core.loadUrdfSceneDescriptionFromXml(urdf.read_text(), [str(urdf.parent)]))
    scene.importSrdf(Path(task.srdf).read_text())
    options: dict[str, Any] = {"group_name": GROUP, **SPEED, **(FINE if fine else {})}
    planner = cartesian_planning.CartesianPathPlanner(scene, cartesian_planning.CartesianPlannerOptions(**options))
    ends = [np.asfortranarray(scene.forwardKinematics(np.array(q), TIP)) for q in (task.start, task.goal)]
    start = core.JointConfiguration(task.joints, np.array(task.start))

    def solve(_: int) -> Rows:
        path = core.CartesianPath([BASE], [TIP], [ends])
        return np.array(planner.plan(path, start).positions)

    return solve


if __name__ == "__main__":
    serve(("roboplan", "pin"), partial(search, fine="fine" in sys.argv))
