"""What MoveIt says of a robot: SRDF, joint limits, configuration folders."""
