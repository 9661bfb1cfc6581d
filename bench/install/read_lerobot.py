"""Read a dataset by LeRobot's own loader, and compute its statistics by LeRobot's own writer: a script for its Python.

    python read_lerobot.py FOLDER

Prints JSON: LeRobot's version, episodes, frames, the shapes of a batch, and for each statistic by how much at most the
dataset's own differ from those that LeRobot computes of its rows, as a share of the column's range.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np


def read(root: str) -> dict[str, Any]:
    """Read the dataset in a folder; what is printed."""
    import lerobot
    from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from torch.utils.data import DataLoader

    dataset = LeRobotDataset("local/demos", root=root)
    rows = dataset.hf_dataset.with_format("numpy")[:]
    columns = {name: np.array(rows[name]) for name in dataset.features}
    episodes = columns["episode_index"]
    parts = [
        compute_episode_stats({name: each[episodes == k] for name, each in columns.items()}, dataset.features)
        for k in np.unique(episodes)
    ]

    differences: dict[str, float] = {}
    for name, own in aggregate_stats(parts).items():
        span = np.maximum(np.asarray(own["max"], float) - np.asarray(own["min"], float), 1e-9)
        for word, value in own.items():
            gap = np.abs(np.asarray(value, float) - np.asarray(dataset.meta.stats[name][word], float))
            share = float((gap if word == "count" else gap / span).max())
            differences[word] = max(differences.get(word, 0.0), share)

    batch = next(iter(DataLoader(dataset, batch_size=8, shuffle=True)))
    shapes = {name: list(batch[name].shape) for name in ("observation.state", "action")}
    return {
        "version": lerobot.__version__,
        "episodes": dataset.meta.total_episodes,
        "frames": len(dataset),
        "batch": shapes,
        "differences": differences,
    }


if __name__ == "__main__":
    print(json.dumps(read(sys.argv[1])))
