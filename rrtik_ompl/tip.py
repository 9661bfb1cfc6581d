"""Motions of the tip: straight lines, arcs, screw motions, and sequences of lines that it follows."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.planning.tip_motion import TipMotion as TipMotion
    from rrtik_ompl.planning.tip_motion import arc as arc
    from rrtik_ompl.planning.tip_motion import follow as follow
    from rrtik_ompl.planning.tip_motion import screw as screw
    from rrtik_ompl.planning.tip_motion import straight as straight
else:
    _HOMES = {
        "planning.tip_motion": (
            "TipMotion",
            "arc",
            "follow",
            "screw",
            "straight",
        ),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
