"""The short name of :mod:`rrtik_ompl`: ``import rrtik``; everything is loaded when it is first used."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rrtik_ompl import *  # noqa: F403
else:
    from rrtik_ompl import __all__, __dir__, __getattr__, __version__  # noqa: F401
