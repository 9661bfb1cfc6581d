"""The bridge to OMPL: conversion between arrays and states, checks, ownership of states, and the base of planners."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rrtik_ompl.base.budget import Stop
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.motion_checker import MotionChecker, SpaceChecker, WorldChecker
from rrtik_ompl.ompl_bridge.results import SearchResult
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.states import StateIO, space_bounds
from rrtik_ompl.world.motion_queries import MotionQueries

if TYPE_CHECKING:
    from rrtik_ompl.ompl_bridge import objectives as objectives
    from rrtik_ompl.ompl_bridge.contract import check_planner as check_planner

__all__ = [
    "GoalSampler",
    "MotionChecker",
    "MotionQueries",
    "SafePlanner",
    "SearchResult",
    "SpaceChecker",
    "StateIO",
    "Stop",
    "WorldChecker",
    "check_planner",
    "objectives",
    "space_bounds",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever has that name
    if name == "objectives":  # loaded late, because no planner needs it
        return import_module("rrtik_ompl.ompl_bridge.objectives")
    if name == "check_planner":
        return import_module("rrtik_ompl.ompl_bridge.contract").check_planner
    raise AttributeError(f"module 'rrtik_ompl.ompl_bridge' has no attribute '{name}'")
