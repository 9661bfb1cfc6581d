"""FABRIK and CCD for planar chains in a few lines of numpy, many goals at a time: yardsticks of the MB-RRT report."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def fabrik(
    lengths: np.ndarray, goals: np.ndarray, joints: np.ndarray, tolerance: float, most: int = 1000
) -> tuple[np.ndarray, np.ndarray]:
    """Chains of nodes, shape (m, n + 1, 2), and sweeps taken by each, shape (m,)."""

    def sweep(x: np.ndarray, goals: np.ndarray) -> None:
        x[:, -1] = goals
        for i in range(len(lengths) - 1, -1, -1):
            x[:, i] = x[:, i + 1] + lengths[i] * unit(x[:, i] - x[:, i + 1])
        x[:, 0] = 0.0
        for i in range(len(lengths)):
            x[:, i + 1] = x[:, i] + lengths[i] * unit(x[:, i + 1] - x[:, i])

    return swept(sweep, chain(lengths, joints), goals, tolerance, most)


def ccd(
    lengths: np.ndarray, goals: np.ndarray, joints: np.ndarray, tolerance: float, most: int = 1000
) -> tuple[np.ndarray, np.ndarray]:
    """As `fabrik`, each joint from the last to the first turned so that the end points at the goal."""

    def sweep(x: np.ndarray, goals: np.ndarray) -> None:
        for i in range(len(lengths) - 1, -1, -1):
            end, goal = x[:, -1] - x[:, i], goals - x[:, i]
            turn = np.arctan2(end[:, 0] * goal[:, 1] - end[:, 1] * goal[:, 0], (end * goal).sum(axis=1))
            c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
            off = x[:, i + 1 :] - x[:, i : i + 1]
            turned = np.stack([c * off[..., 0] - s * off[..., 1], s * off[..., 0] + c * off[..., 1]], axis=-1)
            x[:, i + 1 :] = x[:, i : i + 1] + turned

    return swept(sweep, chain(lengths, joints), goals, tolerance, most)


def swept(
    sweep: Callable[[np.ndarray, np.ndarray], None], nodes: np.ndarray, goals: np.ndarray, tolerance: float, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sweep over chains, in place, each until its end is at its goal."""
    sweeps, open_ = np.zeros(len(goals), dtype=int), np.arange(len(goals))
    for _ in range(most):
        open_ = open_[np.linalg.norm(nodes[open_, -1] - goals[open_], axis=1) >= tolerance]
        if len(open_) == 0:
            break
        x = nodes[open_]
        sweep(x, goals[open_])
        nodes[open_] = x
        sweeps[open_] += 1
    return nodes, sweeps


def chain(lengths: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Nodes for joint angles, shape (m, n): (m, n + 1, 2)."""
    heading = np.cumsum(joints, axis=1)
    edges = lengths[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.concatenate([np.zeros((len(joints), 1, 2)), np.cumsum(edges, axis=1)], axis=1)


def unit(vectors: np.ndarray) -> np.ndarray:
    ends: np.ndarray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return ends
