"""The picture of the genetic algorithm's distances."""

import numpy as np
import pytest

from rrtik_ompl import PositionGoal, load_robot
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.ik.genetic.options import STANDARD
from rrtik_ompl.ik.genetic.search import follow_targets
from rrtik_ompl.viewer.plots.genetic import plot_distances


def test_the_distance_of_the_best_is_drawn_for_every_run(tmp_path):
    robot = load_robot("puma560_3dof")
    goals = [
        PositionGoal(point, 1e-4)
        for point in robot.fk_batch(robot.posture("start") + np.array([[0.0], [0.01]]))[:, :3, 3]
    ]
    runs = {name: follow_targets(robot, goals, STANDARD, np.random.default_rng(k)) for k, name in enumerate("ab")}
    plot_distances(runs, tmp_path / "ga.svg", tolerance=1e-4)
    text = (tmp_path / "ga.svg").read_text()
    for name, run in runs.items():
        assert f"{name}: 2 points in {run.generations} generations" in text
    assert "tolerance" in text
    with pytest.raises(InputError, match="there is none"):
        plot_distances({}, tmp_path / "ga.svg")
