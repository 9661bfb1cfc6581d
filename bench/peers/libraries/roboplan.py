"""RRT-Connect of roboplan (C++, Pinocchio and coal)."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from bench.peers.serve import serve
from bench.peers.task import GROUP, PER_RADIAN, RANGE, TIP, Region, Rows, Search, Solid, Task

MOST_NODES = 1_000_000


def search(task: Task) -> Search:
    """From a seed to a path."""
    from roboplan import core, rrt

    urdf = Path(task.urdf)
    scene = core.Scene("arm", core.loadUrdfSceneDescriptionFromXml(urdf.read_text(), [str(urdf.parent)]))
    scene.importSrdf(Path(task.srdf).read_text())
    for item in task.obstacles:
        _add(scene, core, item)
    # between each other obstacles touch, which would make every configuration collide
    scene.setCollisions(list(combinations([item.name for item in task.obstacles], 2)), False)
    options = rrt.RRTOptions(
        group_name=GROUP,
        max_nodes=MOST_NODES,
        max_connection_distance=RANGE,
        collision_check_step_size=1.0 / PER_RADIAN,
        max_planning_time=task.seconds,
        rrt_connect=True,
    )
    planner, held = rrt.RRT(scene, options), [_constraint(rrt, scene, region) for region in task.regions]
    ends = [core.JointConfiguration(task.joints, np.array(q)) for q in (task.start, task.goal)]

    def solve(seed: int) -> Rows | None:
        planner.setRngSeed(seed)
        try:
            return np.array(planner.plan(*ends, held).positions)
        except RuntimeError:  # its word for "not found"
            return None

    return solve


def _constraint(rrt: Any, scene: Any, region: Region) -> Any:
    """A path constraint of theirs; a bound that is None is infinite."""
    lower = np.array([-np.inf if bound is None else bound for bound in region.lower])
    upper = np.array([np.inf if bound is None else bound for bound in region.upper])
    pose = np.asfortranarray(region.pose)
    tolerances = {name: getattr(region, name) for name in ("position_tolerance", "orientation_tolerance")}
    return rrt.PoseConstraint(scene, GROUP, TIP, lower, upper, pose, **tolerances)


def _add(scene: Any, core: Any, item: Solid) -> None:
    add, shape = {
        "box": (scene.addBoxGeometry, core.Box),
        "sphere": (scene.addSphereGeometry, core.Sphere),
        "cylinder": (scene.addCylinderGeometry, core.Cylinder),
    }[item.kind]
    add(item.name, "universe", shape(*item.size), np.asfortranarray(item.pose), np.ones(4))


if __name__ == "__main__":
    serve(("roboplan", "pin", "coal"), search)
