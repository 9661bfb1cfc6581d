"""Inverse kinematics: all of a trajectory, reachability, results; algorithms on arrays, each in its own module.

:func:`rrtik_ompl.solve_ik` solves one pose, :func:`rrtik_ompl.solve_ik_many` thousands.
"""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.ik.batch import IkBatch as IkBatch
    from rrtik_ompl.ik.reach import ReachMap as ReachMap
    from rrtik_ompl.ik.reach import reach_map as reach_map
    from rrtik_ompl.ik.solve import IkResult as IkResult
    from rrtik_ompl.ik.solve import list_methods as list_methods
    from rrtik_ompl.ik.trajectory import IkTrajectory as IkTrajectory
    from rrtik_ompl.ik.trajectory import solve_trajectory as solve_trajectory
else:
    _HOMES = {
        "ik.solve": (
            "IkResult",
            "list_methods",
        ),
        "ik.batch": ("IkBatch",),
        "ik.trajectory": (
            "IkTrajectory",
            "solve_trajectory",
        ),
        "ik.reach": (
            "ReachMap",
            "reach_map",
        ),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
