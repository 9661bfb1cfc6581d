"""Environments of Gymnasium: importing this registers ``rrtik/Reach-v0`` and ``rrtik/PickPlace-v0``."""

try:
    import gymnasium
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    from rrtik_ompl.base.floors import DependencyError

    raise DependencyError(
        "rrtik_ompl.gym: needs gymnasium, which is not installed: pip install 'rrtik-ompl[gym]'"
    ) from None

from rrtik_ompl.base.lazy import guided
from rrtik_ompl.gym.arm import expert as expert
from rrtik_ompl.gym.pick_place import PickPlace as PickPlace
from rrtik_ompl.gym.reach import Reach as Reach

__all__ = ["PickPlace", "Reach", "expert"]

guided(PickPlace)
guided(Reach)
gymnasium.register("rrtik/Reach-v0", entry_point=Reach, max_episode_steps=300)
gymnasium.register("rrtik/PickPlace-v0", entry_point=PickPlace, max_episode_steps=600)
