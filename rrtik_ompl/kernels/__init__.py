"""Collision checks in compiled kernels, many configurations at a time.

What stands here is loaded when it is first used: kernels are compiled where no collision library is installed.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rrtik_ompl.kernels.checks.clearance import Clearance as Clearance
    from rrtik_ompl.kernels.checks.fast_world import FastWorld as FastWorld
    from rrtik_ompl.kernels.layout import COLLIDING as COLLIDING
    from rrtik_ompl.kernels.layout import FREE as FREE
    from rrtik_ompl.kernels.layout import UNDECIDED as UNDECIDED
    from rrtik_ompl.kernels.tables.scene_tables import needs_covers as needs_covers
    from rrtik_ompl.kernels.warming import warm_up as warm_up
else:
    _HOME_OF = {
        **dict.fromkeys(("COLLIDING", "FREE", "UNDECIDED"), "layout"),
        "Clearance": "checks.clearance",
        "FastWorld": "checks.fast_world",
        "needs_covers": "tables.scene_tables",
        "warm_up": "warming",
    }
    __all__ = sorted(_HOME_OF)

    def __getattr__(name: str) -> Any:
        if name not in _HOME_OF:
            raise AttributeError(f"module 'rrtik_ompl.kernels' has no attribute '{name}'")
        value = getattr(import_module(f"rrtik_ompl.kernels.{_HOME_OF[name]}"), name)
        globals()[name] = value
        return value
