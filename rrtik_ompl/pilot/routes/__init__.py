"""Routes of single-joint moves to a grasp: how they are searched for, judged and followed."""
