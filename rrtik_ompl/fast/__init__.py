"""Collision checks in compiled kernels, many configurations at a time.

What stands here is loaded when it is first used: kernels are compiled where no collision library is installed.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rrtik_ompl.fast.checks.clearance import Clearance as Clearance
    from rrtik_ompl.fast.checks.fast_world import FastWorld as FastWorld
    from rrtik_ompl.fast.tables.layout import COLLIDING as COLLIDING
    from rrtik_ompl.fast.tables.layout import FREE as FREE
    from rrtik_ompl.fast.tables.layout import UNDECIDED as UNDECIDED
    from rrtik_ompl.fast.tables.scene_tables import needs_covers as needs_covers
    from rrtik_ompl.fast.warming import warm_up as warm_up
else:
    _HOME_OF = {
        **dict.fromkeys(("COLLIDING", "FREE", "UNDECIDED"), "tables.layout"),
        "Clearance": "checks.clearance",
        "FastWorld": "checks.fast_world",
        "needs_covers": "tables.scene_tables",
        "warm_up": "warming",
    }
    __all__ = sorted(_HOME_OF)

    def __getattr__(name: str) -> Any:
        if name not in _HOME_OF:
            raise AttributeError(f"module 'rrtik_ompl.fast' has no attribute '{name}'")
        value = getattr(import_module(f"rrtik_ompl.fast.{_HOME_OF[name]}"), name)
        globals()[name] = value
        return value
