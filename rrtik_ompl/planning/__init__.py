"""Planning: `plan()`, many queries together, attempts, the second check, improvement and generated problems."""
