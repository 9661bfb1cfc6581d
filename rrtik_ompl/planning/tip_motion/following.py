"""Joints that follow a rail as far as they can: in kernels, or in numpy where there are none."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.ik.numeric.kernel_call import KernelCall
from rrtik_ompl.ik.serial_chain import limb_of
from rrtik_ompl.kernels.ik import rail_layout
from rrtik_ompl.kernels.ik.ik_layout import AIM_FLOATS, CHORD_TOLERANCE, FREE_TURN, NO_TURN, POSITION_TOLERANCE
from rrtik_ompl.kernels.ik.rail_layout import RailTable
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import PlannedTable, TablePlan, sizes_of
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.planning.tip_motion.freedom import levers_of, redundant
from rrtik_ompl.planning.tip_motion.rails import Rail
from rrtik_ompl.planning.tip_motion.reference_follow import follow_plainly
from rrtik_ompl.planning.tip_motion.values import FIRST_STEP, MOST_ROWS, SMALLEST_STEP, Followed, Leaning, Tolerance


def follow(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> Followed:
    """Follow a rail from a configuration at its beginning, shape (dof,), until its end or as far as possible."""
    kernels = library(rail_layout.KERNELS)
    limb = limb_of(robot)
    if kernels is None or limb is None:
        return follow_plainly(robot, rail, q, tolerance, leaning)

    aim = np.zeros((1, AIM_FLOATS))
    aim[0, POSITION_TOLERANCE] = rail_layout.ARRIVED * tolerance.deviation
    aim[0, CHORD_TOLERANCE] = rail_layout.ARRIVED * tolerance.chord
    aim[0, FREE_TURN] = NO_TURN
    call = KernelCall(limb, aim, robot.clamp(q)[None], rail_layout.NEWTON_STEPS, rail_layout.NEWTON_STEPS + 1)
    table = packed_rail(robot, rail, q, tolerance, leaning)

    kernels.follow(limb.address, call.address, table.address)
    count = table.count
    return Followed(table.q.reshape(-1, robot.dof)[:count].copy(), table.shares[:count].copy())


def packed_rail(robot: Robot, rail: Rail, q: Vector, tolerance: Tolerance, leaning: Leaning) -> RailTable:
    """The table of one call, see :mod:`rrtik_ompl.kernels.ik.rail_layout`."""
    levers = levers_of(robot)
    table = RailTable(PlannedTable(_plan(robot.dof, len(levers))))
    table.rail[:] = rail.numbers()
    table.q[: robot.dof] = robot.clamp(q)
    table.shares[0] = 0.0
    table.levers[:] = levers
    table.reference[:] = leaning.reference
    table.pull[:] = leaning.pull
    table.deviation = tolerance.deviation
    table.chord = tolerance.chord
    table.smallest = SMALLEST_STEP
    table.first_step = FIRST_STEP
    table.homing = int(leaning.homing)
    table.momentum = int(not redundant(robot))
    return table


@lru_cache(maxsize=64)
def _plan(dof: int, joints: int) -> TablePlan:
    return sizes_of(
        RailTable,
        rail=rail_layout.RAIL_NUMBERS,
        q=MOST_ROWS * dof,
        shares=MOST_ROWS,
        levers=joints,
        reference=dof,
        pull=dof,
        trial=dof,
        middle=dof,
        capacity=MOST_ROWS,
        count=1,
    )
