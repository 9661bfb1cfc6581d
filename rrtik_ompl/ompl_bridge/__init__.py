"""The one package where arrays become OMPL states and back: validity, motions, ownership rules, base of planners."""

from rrtik_ompl.base.budget import Stop
from rrtik_ompl.ompl_bridge import objectives
from rrtik_ompl.ompl_bridge.contract import check_planner
from rrtik_ompl.ompl_bridge.goal_sampler import GoalSampler
from rrtik_ompl.ompl_bridge.motion_checker import MotionChecker, SpaceChecker, WorldChecker
from rrtik_ompl.ompl_bridge.results import SearchResult
from rrtik_ompl.ompl_bridge.safe_planner import SafePlanner
from rrtik_ompl.ompl_bridge.states import StateIO, space_bounds
from rrtik_ompl.world.motion_queries import MotionQueries

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
