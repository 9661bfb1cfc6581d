"""The values: what an arm is, what surrounds it, what it has to reach."""
