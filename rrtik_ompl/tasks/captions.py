"""Names of the motions of a task's plan, as people say them: "carry cup"."""

from __future__ import annotations

from rrtik_ompl.tasks import TaskPlan
from rrtik_ompl.tasks.stages import Straight


def motion_names(plan: TaskPlan) -> tuple[str, ...]:
    """Return a name for each motion of a plan, made from its stage and from what is held before and after it.

    Args:
        plan: A plan.
    """
    worlds = [*plan.worlds, plan.end or plan.worlds[-1]] if plan.worlds else []
    held = [[item.name for item in world.scene.attached] for world in worlds]
    names = []
    for k, stage in enumerate(plan.stages):
        straight = isinstance(stage, Straight)
        before = held[max(k - 1, 0)]
        now = held[k]
        after = held[k + 1]
        took = _new(now, before)
        takes = _new(after, now)
        gave = _new(before, now)
        gives = _new(now, after)
        later = next((new for one, two in zip(held[k:], held[k + 1 :], strict=False) if (new := _new(two, one))), "")

        if takes:
            names.append(f"reach for {takes}" if straight else f"move to {takes}")
        elif gives:
            names.append(f"put {gives} down")
        elif took and straight:
            names.append(f"lift {took}")
        elif own := _new(now, _always(held)):
            names.append(f"carry {own}")
        elif gave and straight:
            names.append(f"leave {gave}")
        elif later and not straight:
            names.append(f"move to {later}")
        else:
            goal = getattr(stage, "goal", None)
            names.append(f"move to {goal}" if isinstance(goal, str) else "move straight" if straight else "move")
    return tuple(names)


def _new(names: list[str], known: list[str]) -> str:
    """Return the names that are not known, as a list in words."""
    return ", ".join(name for name in names if name not in known)


def _always(held: list[list[str]]) -> list[str]:
    """Return the names of objects that are held in all motions, such as a camera on the hand."""
    return [name for name in held[0] if all(name in names for names in held)]
