"""Single-joint moves and ways to shorten a path."""
