"""Path constraints: regions that a frame of the arm must not leave, and bounds on how far motions do."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.constraints.shorthands import inside as inside
    from rrtik_ompl.constraints.shorthands import on_line as on_line
    from rrtik_ompl.constraints.shorthands import on_plane as on_plane
    from rrtik_ompl.constraints.shorthands import orientation_of as orientation_of
    from rrtik_ompl.constraints.shorthands import upright as upright
else:
    _HOMES = {
        "constraints.shorthands": (
            "inside",
            "on_line",
            "on_plane",
            "orientation_of",
            "upright",
        ),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
