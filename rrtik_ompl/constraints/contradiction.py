"""Whether path constraints contradict each other, for the message about a start or a goal that breaks one."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.constraints.residuals import projected_rows
from rrtik_ompl.model.robot import Robot

DRAWN = 64  # configurations that are moved towards the regions


def contradiction(robot: Robot, constraints: HeldRegions) -> str:
    """A line that names two path constraints of which no configuration was found to keep both; "" for none.

    One that no configuration was found to keep at all is named alone. This is a finding of a search, no proof.
    """
    rows = np.random.default_rng(0).uniform(*robot.finite_range(), (DRAWN, robot.dof))
    kept = [HeldRegions((region,)) for region in constraints.regions]

    for one in kept:
        if not projected_rows(robot, one, rows)[1].any():
            return f"no configuration was found that keeps {one.regions[0].label}: is its region in reach?"

    for one, other in combinations(kept, 2):
        both = HeldRegions((*one.regions, *other.regions))
        moved, there = projected_rows(robot, both, rows)
        if there.any():
            continue

        near, _ = projected_rows(robot, one, moved)
        left = [other.regions[0].outside(q) for q in near[one.held(near)]]
        if left:
            metres, angle = min(left, key=lambda each: each[0] + each[1])
            amounts = [(1e3 * metres, "mm"), (np.degrees(angle), "degrees")]
            away = " and ".join(f"{amount:.3g} {unit}" for amount, unit in amounts if amount > 0.0)
            first, second = (each.regions[0].label for each in (one, other))
            return (
                f"no configuration was found that keeps both {first} and {second}: where the first is kept, the other "
                f"is missed by {away} at least; do they contradict each other?"
            )

    return ""
