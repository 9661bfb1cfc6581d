"""Single-joint moves: staircases of paths, the search for the fewest moves, its lower bounds, and moves as text."""
