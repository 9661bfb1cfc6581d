"""Configurations judged by coal alone: what proofs and the checks of planners are compared with."""

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.geometry.collision.certificate import Certificate
from rrtik_ompl.world.world import World


def free_by_coal(world: World, Q: Matrix) -> Mask:
    """Which rows of Q, shape (m, dof), are inside the limits and free by coal. Shape (m,)."""
    inside = world.robot.within_limits(Q)
    inside[inside] = Certificate(world.robot, world.bodies, world.pairs).free(Q[inside])
    return inside
