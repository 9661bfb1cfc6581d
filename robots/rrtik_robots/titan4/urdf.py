"""The URDF of the TITAN 4, generated from its lengths. Run as a module to write ``titan4.urdf`` again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rrtik_robots.titan4.geometry import LIMITS_PLANNING_DEG, TitanGeometry
from rrtik_robots.titan4.look import link_visuals
from rrtik_robots.urdf_parts import Part, Point, link_text, materials_text, tube, upright

SPEED_DEG = {"wrist_rotate": 60.0}  # [deg/s], assumed; all other joints move at 20

COLOURS = {
    "titanium": (0.62, 0.64, 0.66),
    "dark": (0.13, 0.14, 0.16),
    "orange": (0.96, 0.49, 0.06),
    "chrome": (0.88, 0.90, 0.93),
}


def titan4_urdf(geometry: TitanGeometry | None = None) -> str:
    """Return the URDF text of the arm.

    With all joints at zero, link frames are parallel to the world, x forward. The base frame is on the azimuth axis at
    the height of the shoulder. The columns (u, v, w) of the frame ``grip_point`` are along (z, -y, x).

    Args:
        geometry: Lengths of the arm; the defaults if None.
    """
    g = TitanGeometry() if geometry is None else geometry
    looks = link_visuals(g)
    lines = ['<?xml version="1.0"?>', "<!-- Written by rrtik_robots.titan4.urdf: change that, not this. -->"]
    lines += ['<robot name="titan4">', materials_text(COLOURS)]
    lines += [link_text(link, link_capsules(g).get(link, []), looks[link]) for link in looks]
    lines += ['  <link name="grip_point"/>']
    lines += [_joint(*row) for row in _joints(g)]
    lines += [
        '  <joint name="grip_point_joint" type="fixed">',
        '    <parent link="gripper"/>',
        '    <child link="grip_point"/>',
        f'    <origin xyz="{g.d6!r} 0 0" rpy="0 {-np.pi / 2!r} {np.pi!r}"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def link_capsules(g: TitanGeometry) -> dict[str, list[Part]]:
    """Return the collision bodies of each link, capsules and the base cylinder, each in its link's frame."""
    knee = (g.knee_along, 0.0, g.knee_above)
    bottom = -g.shoulder_height
    return {
        "base": [upright((0.0, 0.0, bottom), (0.0, 0.0, bottom + g.base_height), g.base_radius)],
        "shoulder": [_capsule((0.0, 0.0, 0.0), (g.a1, 0.0, 0.0), g.shoulder_radius)],
        "upper_arm": [
            _capsule((0.0, 0.0, 0.0), knee, g.upper_arm_radius),
            _capsule(knee, (g.a2, 0.0, 0.0), g.knee_radius),
        ],
        "forearm": [_capsule((0.0, 0.0, 0.0), (g.a3, 0.0, 0.0), g.forearm_radius)],
        "wrist": [_capsule((0.0, 0.0, 0.0), (g.a4, 0.0, 0.0), g.wrist_radius)],
        "gripper": [_capsule((0.0, 0.0, 0.0), (g.d6, 0.0, 0.0), g.gripper_radius)],
    }


def _capsule(start: Point, end: Point, radius: float) -> Part:
    return tube(start, end, radius, capsule=True)


def _joints(g: TitanGeometry) -> list[tuple[str, str, str, float, str]]:
    """Return for each joint its name, parent, child, distance along the parent's x [m], and axis as URDF text."""
    return [
        ("azimuth", "base", "shoulder", 0.0, "0 0 1"),
        ("shoulder_pitch", "shoulder", "upper_arm", g.a1, "0 -1 0"),
        ("elbow_pitch", "upper_arm", "forearm", g.a2, "0 -1 0"),
        ("wrist_pitch", "forearm", "wrist", g.a3, "0 -1 0"),
        ("wrist_yaw", "wrist", "yaw_housing", g.a4, "0 0 1"),
        ("wrist_rotate", "yaw_housing", "gripper", 0.0, "1 0 0"),
    ]


def _joint(name: str, parent: str, child: str, along: float, axis: str) -> str:
    low, high = (float(np.radians(limit)) for limit in LIMITS_PLANNING_DEG[name])
    speed = float(np.radians(SPEED_DEG.get(name, 20.0)))
    return (
        f'  <joint name="{name}" type="revolute">\n'
        f'    <parent link="{parent}"/>\n'
        f'    <child link="{child}"/>\n'
        f'    <origin xyz="{along!r} 0 0"/>\n'
        f'    <axis xyz="{axis}"/>\n'
        f'    <limit lower="{low!r}" upper="{high!r}" velocity="{speed!r}" effort="0"/>\n'
        "  </joint>"
    )


if __name__ == "__main__":
    Path(__file__).with_name("titan4.urdf").write_text(titan4_urdf(), encoding="utf-8")
