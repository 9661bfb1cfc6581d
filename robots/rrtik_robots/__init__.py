"""Robots and problems that ship with the toolkit; found by name through entry points, see ``rrtik_ompl.description.catalog``."""
