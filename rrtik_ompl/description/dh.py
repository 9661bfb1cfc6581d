"""Make robots from Denavit-Hartenberg tables, standard [32] or modified [33]; the caller says which."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from rrtik_ompl.base.arrays import Vector, bounded_array, dimensions, finite_array
from rrtik_ompl.base.choices import DhConvention
from rrtik_ompl.base.errors import InputError, UnknownNameError, at_most
from rrtik_ompl.base.poses import PoseLike, rigid, turned_z
from rrtik_ompl.description.robot_build import JointLimits, build_robot
from rrtik_ompl.description.tree import JOINT_KINDS, MOST_JOINTS, Joint, Link, Solid, Tree
from rrtik_ompl.model.robot import Robot
from rrtik_ompl.model.shapes import Capsule

if TYPE_CHECKING:
    from rrtik_ompl.description.robot_source import BasePose


CONVENTIONS: tuple[DhConvention, ...] = get_args(DhConvention)
ROW_KINDS = tuple(name for name, kind in JOINT_KINDS.items() if kind.moves)
SMALLEST_RADIUS = 1e-4  # [m] replaces a radius of 0


@dataclass(frozen=True, slots=True)
class DhRow:
    """One joint of a Denavit-Hartenberg table. The joint's value is added to theta (or to d, if prismatic).

    With ``Rz, Rx`` rotations and ``Tz, Tx`` translations, the transform of a row is

        standard: Rz(theta) Tz(d) Tx(a) Rx(alpha)          modified: Rx(alpha) Tx(a) Rz(theta) Tz(d)

    where a and alpha of a modified row are those often printed as a_(i-1), alpha_(i-1).

    Attributes:
        a, d: Lengths [m].
        alpha, theta: Angles [rad].
        joint: Name of the joint; joint1, joint2, ... if empty.
        kind: One of ``ROW_KINDS``.
        limits: Lower and upper position limit [rad or m]; without meaning for continuous joints.
        velocity, acceleration, jerk: Limits [rad or m per s, s^2, s^3], inf if unknown.
    """

    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    joint: str = ""
    kind: str = "revolute"
    limits: tuple[float, float] = (-np.pi, np.pi)
    velocity: float = np.inf
    acceleration: float = np.inf
    jerk: float = np.inf


def robot_from_dh(
    name: str,
    rows: Iterable[DhRow],
    *,
    convention: DhConvention,
    radius: float | Sequence[float] = 0.05,
    floor_gap: float = 0.0,
    tool: PoseLike | None = None,
    tip: str = "tip",
    base_pose: BasePose = None,
    postures: Mapping[str, ArrayLike] | None = None,
    self_collision: bool = True,
    planar: bool = False,
    colour: tuple[float, float, float, float] = (0.75, 0.75, 0.78, 1.0),
    **options: Any,
) -> Robot:
    """Make a robot from a Denavit-Hartenberg table.

    Links are named ``base, link1, link2, ...``, the tip frame ``tip``. Each link is drawn and checked as capsules along
    its d and a; consecutive links with solids are not checked against each other.

    Args:
        name: Name used in messages.
        rows: The table.
        convention: ``"standard"`` or ``"modified"``; there is no default because the two give different arms.
        radius: Radius of the capsules [m], one number or one per row; 0 is replaced by 1e-4.
        floor_gap: Distance along its d at which the first link's capsule begins [m]; with its radius, the cap stays
            above a floor at the height of the base.
        tool: Pose of the tip in the frame of the last row, ``pinocchio.SE3``; identity if None.
        tip: Link that goals refer to.
        base_pose: ``pinocchio.SE3`` T_world_base.
        postures: Named configurations, each with one number per row [rad or m].
        self_collision: Whether links are checked against each other.
        planar: Whether the arm moves in the xy-plane.
        colour: Colour of the links: red, green, blue, opacity.
        **options: Passed to `build_robot` (``closed_form``, ``source``, ``allowed_collisions``).

    Raises:
        InputError: If the table is empty, or a number, kind or limit in it is not valid.
    """
    table = _checked(name, rows)
    if convention not in CONVENTIONS:
        raise UnknownNameError("DH convention", convention, CONVENTIONS, where=f"robot '{name}'")

    radii = _radii(name, radius, len(table))
    T_last_tip = pin.SE3.Identity() if tool is None else rigid(tool, f"robot '{name}': tool")
    before, after = _fixed_parts(table, convention, T_last_tip)

    names = ["base", *(f"link{k}" for k in range(1, len(table) + 1))]
    joints = [
        Joint(row.joint, row.kind, parent, child, placement, (0, 0, 1), **_bounds(row), velocity=row.velocity)
        for row, placement, (parent, child) in zip(table, before, pairwise(names), strict=True)
    ]
    joints.append(Joint("tip_joint", "fixed", names[-1], "tip", after))

    corners = _corners(table, convention, T_last_tip)
    corners[1][0] = np.array([0.0, 0.0, np.clip(floor_gap, 0.0, abs(table[0].d)) * np.sign(table[0].d)])
    solids = [_capsules(points, r, colour) for points, r in zip(corners, [radii[0], *radii], strict=True)]
    links = [Link(link, solid, solid) for link, solid in zip(names, solids, strict=True)]

    allowed = {frozenset(pair) for pair in options.pop("allowed_collisions", ())} | _touching(links)
    return build_robot(
        name,
        Tree(f"robot '{name}'", [*links, Link("tip")], joints),
        joints=[row.joint for row in table],
        tip=tip,
        base_pose=base_pose,
        limits={row.joint: JointLimits(acceleration=row.acceleration, jerk=row.jerk) for row in table},
        postures={key: _posture(name, key, value, table) for key, value in (postures or {}).items()},
        allowed_collisions=allowed,
        self_collision=self_collision,
        planar=planar,
        **options,
    )


def _checked(name: str, rows: Iterable[DhRow]) -> list[DhRow]:
    """Check the rows of a table and return them with names for all joints."""
    given = list(rows)
    at_most(len(given) + 1, MOST_JOINTS, f"robot '{name}': joints")

    table = [
        DhRow(**{f: getattr(row, f) for f in DhRow.__slots__} | {"joint": row.joint or f"joint{k}"})
        for k, row in enumerate(given, start=1)
    ]
    if not table:
        raise InputError(f"robot '{name}': the DH table has no rows; give one per joint")

    for row in table:
        where = f"robot '{name}': DH row '{row.joint}'"
        if row.kind not in ROW_KINDS:
            raise UnknownNameError("joint type", row.kind, ROW_KINDS, where=where)
        for key in ("a", "alpha", "d", "theta"):
            bounded_array(getattr(row, key), (), f"{where}: {key}")
    return table


def _radii(name: str, radius: float | Sequence[float], count: int) -> list[float]:
    what = f"robot '{name}': radius"
    one_for_all = dimensions(radius) == 0
    values = np.full(count, bounded_array(radius, (), what)) if one_for_all else bounded_array(radius, (count,), what)
    if (values < 0.0).any():
        raise InputError(f"robot '{name}': radius must not be negative, got {values.min():g}")
    return [max(float(value), SMALLEST_RADIUS) for value in values]


def _fixed_parts(table: Sequence[DhRow], convention: DhConvention, tool: pin.SE3) -> tuple[list[pin.SE3], pin.SE3]:
    """Return the fixed transforms between the joints' own motions (a rotation about z or a translation along it).

    Returns:
        For each joint the transform from the joint before (or the base), and the transform from the last joint to the
        tip.
    """
    before = []
    after = pin.SE3.Identity()
    for row in table:
        before.append(after * _x_part(row) if convention == "modified" else after)
        after = _z_part(row) if convention == "modified" else _z_part(row) * _x_part(row)
    return before, after * tool


def _z_part(row: DhRow) -> pin.SE3:
    """Return Rz(theta) Tz(d)."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, row.theta), np.array([0.0, 0.0, row.d]))


def _x_part(row: DhRow) -> pin.SE3:
    """Return Tx(a) Rx(alpha), which equals Rx(alpha) Tx(a)."""
    return pin.SE3(pin.rpy.rpyToMatrix(row.alpha, 0.0, 0.0), np.array([row.a, 0.0, 0.0]))


def _bounds(row: DhRow) -> dict[str, float]:
    lower, upper = (-np.inf, np.inf) if JOINT_KINDS[row.kind].endless else row.limits
    return {"lower": lower, "upper": upper}


def _posture(name: str, key: str, values: ArrayLike, table: Sequence[DhRow]) -> dict[str, float]:
    numbers = finite_array(values, (len(table),), f"robot '{name}': posture '{key}'")
    return {row.joint: float(value) for row, value in zip(table, numbers, strict=True)}


def _corners(table: Sequence[DhRow], convention: DhConvention, tool: pin.SE3) -> list[list[Vector]]:
    """Return the corner points of each link, base first, in its joint's frame: along d, then along the next a."""
    shift = 0 if convention == "standard" else 1
    corners = [[np.zeros(3)] + ([_x_part(table[0]).translation] if shift else [])]

    for k, row in enumerate(table):
        place = _z_part(row)
        points = [np.zeros(3), np.array([0.0, 0.0, row.d])]
        if k + shift < len(table):
            place = place * _x_part(table[k + shift])
            points.append(place.translation)
        if k == len(table) - 1:
            points.append((place * tool).translation)
        corners.append(points)

    return corners


def _capsules(points: Sequence[Vector], radius: float, colour: tuple[float, float, float, float]) -> tuple[Solid, ...]:
    """Return capsules along the segments between successive points; segments of no length are left out."""
    solids = []
    for start, end in pairwise(points):
        length = float(np.linalg.norm(end - start))
        if length > 1e-9:
            turn = turned_z((end - start) / length)
            solids.append(Solid(Capsule(radius, length), pin.SE3(turn, (start + end) / 2), colour))
    return tuple(solids)


def _touching(links: Sequence[Link]) -> set[frozenset[str]]:
    """Return the pairs of consecutive links with solids, which always meet in one point."""
    solid = [link for link in links if link.collision]
    return {frozenset((a.name, b.name)) for a, b in pairwise(solid)}
