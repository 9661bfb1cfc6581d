"""Demonstrations of tasks for robot learning: drawn, planned, proven, timed, and written as datasets."""

from typing import TYPE_CHECKING

from rrtik_ompl.base.lazy import lazy_names

if TYPE_CHECKING:
    from rrtik_ompl.demos.recording import Recording as Recording
    from rrtik_ompl.demos.recording import record as record
    from rrtik_ompl.pilot.overlay.demo_pictures import DemoPictures as DemoPictures
    from rrtik_ompl.tasks.randomness import Displacement as Displacement
    from rrtik_ompl.tasks.randomness import Randomness as Randomness
else:
    _HOMES = {
        "demos.recording": (
            "Recording",
            "record",
        ),
        "pilot.overlay.demo_pictures": ("DemoPictures",),
        "tasks.randomness": (
            "Displacement",
            "Randomness",
        ),
    }
    __getattr__, __dir__, __all__ = lazy_names(__name__, _HOMES)
