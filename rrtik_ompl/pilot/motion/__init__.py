"""What a pilot's hand does: joints are driven while a command is held, and the gripper is closed and opened."""
