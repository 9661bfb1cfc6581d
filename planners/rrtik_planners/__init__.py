"""Our motion planners, each an ``ompl.base.Planner``, one idea per file."""

from rrtik_planners.bicrdt import BiCRDT
from rrtik_planners.crdt import CRDT
from rrtik_planners.drrt_con import DRRTCon
from rrtik_planners.fast_rrt_connect import FastRRTConnect
from rrtik_planners.fewest_moves import FewestMoves
from rrtik_planners.ikurt import IKURT
from rrtik_planners.ikurt_published import IKURTPublished
from rrtik_planners.mbrrt import MBRRT

__all__ = ["CRDT", "IKURT", "MBRRT", "BiCRDT", "DRRTCon", "FastRRTConnect", "FewestMoves", "IKURTPublished"]
