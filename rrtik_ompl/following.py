"""Drive an arm: along a trajectory, by the velocity of its tip, or towards what a camera sees."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.motion.following.follower import Followed as Followed
    from rrtik_ompl.motion.following.follower import Follower as Follower
    from rrtik_ompl.motion.following.follower import RobotLink as RobotLink
    from rrtik_ompl.motion.following.follower import SimulatedLink as SimulatedLink
    from rrtik_ompl.motion.following.servo import Servo as Servo
    from rrtik_ompl.motion.following.visual_servo import VisualServo as VisualServo
else:
    _HOMES = {
        "motion.following.follower": (
            "Followed",
            "Follower",
            "RobotLink",
            "SimulatedLink",
        ),
        "motion.following.servo": ("Servo",),
        "motion.following.visual_servo": ("VisualServo",),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
