"""Figures of the sources, drawn from our measurements: by the name of the table that they belong to."""
