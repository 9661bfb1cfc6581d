"""Routes of single-joint moves to a grasp: how they are searched for, rated and followed."""
