"""Path constraints as tables for kernels, and the projection of configurations onto path constraints."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Mask, Matrix
from rrtik_ompl.base.kept import kept_with
from rrtik_ompl.constraints.held_region import HeldRegion
from rrtik_ompl.constraints.held_regions import HeldRegions
from rrtik_ompl.constraints.residuals import DAMPING, LARGEST_STEP, STEPS, projected_rows
from rrtik_ompl.ik.kernel_tables import limb_table, pose_numbers
from rrtik_ompl.ik.tip_columns import frame_columns
from rrtik_ompl.kernels.ik import ik_layout
from rrtik_ompl.kernels.ik.ik_layout import CallTable, LimbTable
from rrtik_ompl.kernels.search.constrained import layout
from rrtik_ompl.kernels.search.constrained.layout import HeldTable, RegionTable
from rrtik_ompl.kernels.simd.library import library
from rrtik_ompl.kernels.tables.memory import aligned, packed, record
from rrtik_ompl.model.robot import PER_RADIAN, Robot, reach_of

SHORTEST_STEP = 0.01  # shortest step of a search [unit of the configurations], unless tolerances need shorter ones


class HeldTables:
    """The tables of path constraints for a robot.

    Attributes:
        regions: The regions of the path constraints.
        held: The table of all regions.
        address: Address of the table in memory; valid as long as this object lives.
        shortest: Shortest step of searches along the regions [unit of the configurations]; it is shorter where
            tolerances are small.

    Args:
        robot: The arm.
        constraints: The regions.
        limbs: For each region the table of the joints that move its frame.
    """

    def __init__(self, robot: Robot, constraints: HeldRegions, limbs: list[LimbTable]) -> None:
        self.regions = constraints.regions
        self._limbs = limbs
        dof = robot.dof
        tables = [_region_table(*pair) for pair in zip(constraints.regions, limbs, strict=True)]
        self.held = packed(
            HeldTable,
            count=len(tables),
            regions=tables,
            dof=dof,
            lower=np.asarray(robot.lower),
            upper=np.asarray(robot.upper),
            per_metre=1.0 / reach_of(robot),
            per_radian=PER_RADIAN,
            damping=DAMPING,
            largest_step=LARGEST_STEP,
            columns=np.zeros(ik_layout.TWIST_NUMBERS * dof),
            square=np.zeros(dof * dof),
            change=np.zeros(dof),
            error=np.zeros(ik_layout.TWIST_NUMBERS),
            weights=np.zeros(ik_layout.TWIST_NUMBERS),
            node=np.zeros(dof),
        )

        self.address = self.held.address
        self.shortest = shortest_step(constraints)

    def project(self, rows: Matrix, steps: int = STEPS) -> tuple[Matrix, Mask]:
        """Project configurations onto all regions.

        Args:
            rows: Configurations, shape (m, dof).
            steps: Largest number of steps for each.

        Returns:
            The moved configurations, shape (m, dof), and which of them are in all regions, shape (m,).
        """
        kernels = library(layout.KERNELS)
        moved = aligned(np.asarray(rows))
        reached = aligned(np.zeros(len(rows), dtype=np.int32))
        if kernels is not None:
            kernels.project_rows(self.address, moved.ctypes.data, len(rows), steps, reached.ctypes.data)
        return moved.reshape(rows.shape).copy(), reached != 0

    def intact(self) -> bool:
        """Check that no kernel has written beyond an array."""
        regions = self.held.regions
        parts = self.held, *regions, *(region.call for region in regions), *self._limbs
        return all(part.intact() for part in parts)


def _region_table(region: HeldRegion, limb: LimbTable) -> RegionTable:
    """Return the table of a region, which keeps the memory for its frames.

    Args:
        region: The region.
        limb: The table of the joints that move its frame.
    """
    fixed = limb.fixed.reshape(-1, ik_layout.POSE_NUMBERS)[0]
    first = np.eye(4)
    first[:3, :3] = fixed[:9].reshape(3, 3)
    first[:3, 3] = fixed[9:]

    call = packed(
        CallTable,
        first=pose_numbers((region.T_w_world @ first)[None]).ravel(),
        frames=np.zeros(ik_layout.POSE_NUMBERS * (limb.joints + 1)),
    )

    return packed(RegionTable, limb=limb, call=call, turning=int(region.turning), record=_record(region))


def _record(region: HeldRegion) -> Matrix:
    """Return the numbers of a region in the layout that kernels read."""
    bounds = region.region.bounds
    levers = region.levers[region.rows]
    return record(
        layout.LEVERS + len(levers),
        {
            layout.LOW: bounds[:3, 0],
            layout.HIGH: bounds[:3, 1],
            layout.ANGLES_LOW: bounds[3:, 0],
            layout.ANGLES_HIGH: bounds[3:, 1],
            layout.DIRECTION: region.direction,
            layout.KEPT: region.accepted,
            layout.AIMED: region.aimed,
            layout.MOST: region.limits(between=True),
            layout.CURVATURE: region.curvature,
            layout.LEVERS: levers,
        },
    )


def shortest_step(constraints: HeldRegions) -> float:
    """Return the shortest step of searches along regions [unit of the configurations]."""
    return min((_shortest_step(region) for region in constraints.regions), default=SHORTEST_STEP)


def _shortest_step(region: HeldRegion) -> float:
    """Return a step so short that a straight motion between two points of a region stays inside its tolerances.

    It is half the step whose largest deviation fills the space between the accepted and the allowed error, and at most
    `SHORTEST_STEP`.
    """
    dof = region.robot.dof
    step = np.full((1, dof), SHORTEST_STEP / np.sqrt(dof))
    space_left = region.limits(between=True) - region.accepted
    bent = region.deviations(np.zeros((1, dof)), step)[0]
    # The deviation of a chord from its curve grows with the square of its length, hence the square root.
    share = float(np.sqrt((space_left[bent > 0.0] / bent[bent > 0.0]).min(initial=4.0)))
    return SHORTEST_STEP * min(0.5 * share, 1.0)


def projected_onto(robot: Robot, constraints: HeldRegions, rows: Matrix) -> Matrix:
    """Project configurations, shape (m, dof), onto all regions inside the limits; return those that get there.

    Configurations that are there already are not moved. Shape (k, dof).
    """
    tables = held_tables(robot, constraints)
    rows = robot.clamp(rows)
    moved, reached = projected_rows(robot, constraints, rows) if tables is None else tables.project(rows)
    in_all_regions: Matrix = moved[reached & constraints.held(moved)]
    return in_all_regions


def held_tables(robot: Robot, constraints: HeldRegions) -> HeldTables | None:
    """Return the tables of path constraints; None without kernels, or if a joint depends on several entries of q."""
    if library(layout.KERNELS) is None:
        return None
    limbs = [_limb_of(robot, each.joint, each.T_joint_d.tobytes()) for each in constraints.regions]
    known = [limb for limb in limbs if limb is not None]
    return HeldTables(robot, constraints, known) if len(known) == len(limbs) else None


@kept_with
def _limb_of(robot: Robot, joint: int, placement: bytes) -> LimbTable | None:
    """Return the table of the joints that move a frame, see `limb_table`.

    Args:
        robot: The arm.
        joint: Number of the joint that carries the frame.
        placement: Pose of the frame in that of the joint, the bytes of a matrix of shape (4, 4).
    """
    return limb_table(robot, frame_columns(robot, joint, np.frombuffer(placement).reshape(4, 4)))
