"""Published methods to compare with: CCD, FABRIK, damped least squares, particle swarms."""
