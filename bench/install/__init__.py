"""Installing: what resolvers say for other machines."""
