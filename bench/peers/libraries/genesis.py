"""RRT-Connect of Genesis World on the processor, in single precision, with meshes taken apart into convex pieces.

It does not read which pairs of links may touch: it leaves out neighbours, and those that touch when all joints are at
zero. A path that it calls valid is handed back as it is, without smoothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bench.peers.serve import serve
from bench.peers.task import Rows, Search, Solid, Task

RESOLUTION = 0.05  # [rad], its default
MOST_NODES = 4000
POINTS = 300  # of a path, its default


def search(task: Task) -> Search:
    """From a seed to a path."""
    import genesis as gs
    import torch

    if not gs._initialized:
        gs.init(backend=gs.cpu, logging_level="error", seed=0)
    scene = gs.Scene(show_viewer=False, rigid_options=gs.options.RigidOptions(enable_self_collision=True))
    for item in task.obstacles:
        scene.add_entity(_morph(gs.morphs, item))
    arm = scene.add_entity(gs.morphs.URDF(file=str(Path(task.urdf)), fixed=True, merge_fixed_links=False))
    scene.build()
    order = [arm.get_joint(name).qs_idx_local[0] for name in task.joints]
    ends = {"qpos_start": np.array(task.start), "qpos_goal": np.array(task.goal)}
    placed = {name: _placed(q, order) for name, q in ends.items()}

    def solve(seed: int) -> Rows | None:
        torch.manual_seed(seed)
        path, valid = arm.plan_path(
            **placed,
            max_nodes=MOST_NODES,
            resolution=RESOLUTION,
            timeout=task.seconds,
            smooth_path=False,
            num_waypoints=POINTS,
            return_valid_mask=True,
        )
        return None if not bool(valid.all()) else path.cpu().numpy().astype(np.float64)[:, order]

    solve(0)  # its kernels are compiled
    return solve


def _placed(q: Rows, order: list[int]) -> Rows:
    placed = np.zeros(len(q))
    placed[order] = q
    return placed


def _morph(morphs: Any, item: Solid) -> Any:
    pose = np.array(item.pose)
    place = {"pos": tuple(pose[:3, 3]), "quat": tuple(_quaternion(pose[:3, :3])), "fixed": True}
    if item.kind == "box":
        return morphs.Box(size=tuple(item.size), **place)
    if item.kind == "sphere":
        return morphs.Sphere(radius=item.size[0], **place)
    return morphs.Cylinder(radius=item.size[0], height=item.size[1], **place)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """The quaternion w, x, y, z: the eigenvector with the largest eigenvalue of a matrix linear in the rotation."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array(
        [
            [a + e + i, h - f, c - g, d - b],
            [h - f, a - e - i, b + d, c + g],
            [c - g, b + d, e - a - i, f + h],
            [d - b, c + g, f + h, i - a - e],
        ]
    )
    return np.linalg.eigh(k)[1][:, -1]


if __name__ == "__main__":
    serve(("genesis-world", "torch"), search, module="genesis")
