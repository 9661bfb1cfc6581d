"""Routes of single-joint moves to a grasp: search, rating, and following."""
