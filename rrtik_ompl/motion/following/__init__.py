"""What drives an arm: a trajectory that it follows, and a tip that is steered by its velocity."""
