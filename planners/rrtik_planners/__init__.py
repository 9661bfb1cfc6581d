"""Our motion planners, each an ``ompl.base.Planner``, one idea per file, imported when it is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rrtik_planners.bicrdt import BiCRDT as BiCRDT
    from rrtik_planners.cbirrt import CBiRRT as CBiRRT
    from rrtik_planners.crdt import CRDT as CRDT
    from rrtik_planners.drrt_con import DRRTCon as DRRTCon
    from rrtik_planners.fast_aorrtc import FastAORRTC as FastAORRTC
    from rrtik_planners.fast_rrt_connect import FastRRTConnect as FastRRTConnect
    from rrtik_planners.fewest_moves import FewestMoves as FewestMoves
    from rrtik_planners.ikurt import IKURT as IKURT
    from rrtik_planners.ikurt_published import IKURTPublished as IKURTPublished
    from rrtik_planners.mbrrt import MBRRT as MBRRT
    from rrtik_planners.restart_shorten import RestartShorten as RestartShorten
    from rrtik_planners.roadmap import RoadmapPlanner as RoadmapPlanner

__all__ = [
    "CRDT",
    "IKURT",
    "MBRRT",
    "BiCRDT",
    "CBiRRT",
    "DRRTCon",
    "FastAORRTC",
    "FastRRTConnect",
    "FewestMoves",
    "IKURTPublished",
    "RestartShorten",
    "RoadmapPlanner",
]

_MODULES = {
    "BiCRDT": "bicrdt",
    "CBiRRT": "cbirrt",
    "CRDT": "crdt",
    "DRRTCon": "drrt_con",
    "FastAORRTC": "fast_aorrtc",
    "FastRRTConnect": "fast_rrt_connect",
    "FewestMoves": "fewest_moves",
    "IKURT": "ikurt",
    "IKURTPublished": "ikurt_published",
    "MBRRT": "mbrrt",
    "RestartShorten": "restart_shorten",
    "RoadmapPlanner": "roadmap",
}

# The planners that "auto" lets search, in the order of their turns, and what each of them solves.
PORTFOLIO = {
    "fastrrtconnect": "any goal",
    "bicrdt": "any goal",
    "ikurt": "goal of the tip",
    "cbirrt": "path constraints",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever has that name
    if name not in _MODULES:
        raise AttributeError(f"module 'rrtik_planners' has no attribute '{name}'")
    return getattr(import_module(f"rrtik_planners.{_MODULES[name]}"), name)
