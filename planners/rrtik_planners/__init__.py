"""Our motion planners, each an ``ompl.base.Planner``, one idea per file."""

from rrtik_planners.bicrdt import BiCRDT
from rrtik_planners.crdt import CRDT
from rrtik_planners.fewest_moves import FewestMoves

__all__ = ["CRDT", "BiCRDT", "FewestMoves"]
