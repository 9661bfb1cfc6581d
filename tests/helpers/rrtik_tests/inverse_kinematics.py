"""What tests of inverse kinematics share."""

import numpy as np

from rrtik_ompl.ik.analytic.analytic_solver import wrapped


def random_rows(robot, count, seed=0):
    """Configurations inside the limits, shape (count, dof) [rad or m]."""
    return np.random.default_rng(seed).uniform(*robot.finite_range(), (count, robot.dof))


def distance_to_branches(found, Q):
    """Largest joint error of the nearest real branch, shape (m,) [rad]."""
    errors = np.abs(wrapped(found.branches - Q[:, None])).max(axis=2)
    return np.where(found.real, errors, np.inf).min(axis=1)
