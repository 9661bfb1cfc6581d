"""Path constraints: regions that a frame of the arm must not leave, and bounds on how far motions do."""
