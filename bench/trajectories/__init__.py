"""Timed motions: limits, durations beside toppra and ruckig, torques, the steered tip."""
