"""Path constraints on generated problems, judged densely by Pinocchio and coal alone."""
