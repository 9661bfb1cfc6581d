"""Manual driving: joints move while a command is held, and the gripper is opened and closed."""
