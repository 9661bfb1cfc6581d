"""OMPL's modules; or, where OMPL is not installed, as much of them as this library's own planners stand on.

These planners are OMPL planners too, but `plan()` hands them arrays: of OMPL they need a base class, a bounded space, a
status and a seed. Everything else of OMPL is then a class that says at its first use why it is not there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou
else:
    try:
        from ompl import base as ob
        from ompl import geometric as og
        from ompl import util as ou
    except ModuleNotFoundError:
        from rrtik_ompl.ompl_bridge.stand_in import ob, og, ou

__all__ = ["ob", "og", "ou"]
