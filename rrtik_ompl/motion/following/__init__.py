"""Drive an arm: along a trajectory, or by the velocity of its tip."""
