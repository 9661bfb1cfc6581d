"""A robot in a scene: which configurations and motions are free, and why."""
