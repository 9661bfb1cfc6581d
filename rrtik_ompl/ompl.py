"""OMPL with this library's robots and worlds: its SimpleSetup, spaces and objectives, and what planners need."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.ompl_bridge import objectives as objectives
    from rrtik_ompl.ompl_bridge.benchmark_notes import BenchmarkNotes as BenchmarkNotes
    from rrtik_ompl.ompl_bridge.contract import check_planner as check_planner
    from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler as GoalSampler
    from rrtik_ompl.ompl_bridge.motion_checker import MotionChecker as MotionChecker
    from rrtik_ompl.ompl_bridge.region_constraint import RegionConstraint as RegionConstraint
    from rrtik_ompl.ompl_bridge.results import SearchResult as SearchResult
    from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner as SafePlanner
    from rrtik_ompl.ompl_bridge.simple_setup import simple_setup as simple_setup
    from rrtik_ompl.ompl_bridge.simple_setup import space_information as space_information
else:
    _HOMES = {
        "ompl_bridge.simple_setup": (
            "simple_setup",
            "space_information",
        ),
        "ompl_bridge": ("objectives",),
        "ompl_bridge.benchmark_notes": ("BenchmarkNotes",),
        "ompl_bridge.contract": ("check_planner",),
        "ompl_bridge.goal_sampler": ("GoalSampler",),
        "ompl_bridge.motion_checker": ("MotionChecker",),
        "ompl_bridge.region_constraint": ("RegionConstraint",),
        "ompl_bridge.results": ("SearchResult",),
        "ompl_bridge.safe_planner": ("SafePlanner",),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
