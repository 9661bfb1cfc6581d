"""Replanning: a robot moves to a goal while obstacles move, by DRRT-Con or, to compare with, by two other planners."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.model.scene import ConstantVelocity as ConstantVelocity
    from rrtik_ompl.model.scene import TimedPoses as TimedPoses
    from rrtik_ompl.replanning.feed import Snapshot as Snapshot
    from rrtik_ompl.replanning.in_time import TimedPlan as TimedPlan
    from rrtik_ompl.replanning.in_time import plan_in_time as plan_in_time
    from rrtik_ompl.replanning.record import ReplanRun as ReplanRun
    from rrtik_ompl.replanning.scenario import Scenario as Scenario
else:
    _HOMES = {
        "model.scene": (
            "ConstantVelocity",
            "TimedPoses",
        ),
        "replanning.feed": ("Snapshot",),
        "replanning.in_time": (
            "TimedPlan",
            "plan_in_time",
        ),
        "replanning.record": ("ReplanRun",),
        "replanning.scenario": ("Scenario",),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
