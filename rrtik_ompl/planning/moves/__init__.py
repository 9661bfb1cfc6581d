"""Single-joint moves: the staircase of a path, the search for the fewest moves and its lower bounds, words."""
