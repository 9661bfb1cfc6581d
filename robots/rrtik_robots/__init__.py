"""Robots and problems that ship with the toolkit; ``rrtik_ompl.description.catalog`` finds them by entry points."""
