"""A shipped arm as a file of MuJoCo, so that a simulator and the planner have the same one."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import rrtik_ompl as rrtik


def write_mjcf(robot: rrtik.Robot, file: str, thickness: float = 0.04) -> None:
    """The joints of a serial arm as an MJCF file of MuJoCo, with a capsule from each joint to the next one."""
    chain, lines = robot.chain, [f'<mujoco model="{robot.name}"><compiler angle="radian"/><worldbody>']
    tip = robot.model.frames[robot.model.getFrameId(robot.tip)].placement
    ends = [*(place[:3, 3] for place in chain.placement[1:]), tip.translation]
    for k, (place, end) in enumerate(zip(chain.placement, ends, strict=True)):
        x, y, z, w = pin.Quaternion(place[:3, :3]).coeffs()
        numbers = {"pos": place[:3, 3], "quat": [w, x, y, z], "axis": chain.axis[k], "to": end}
        text = {name: " ".join(f"{value:.9g}" for value in row) for name, row in numbers.items()}
        lines.append(f'<body name="link{k}" pos="{text["pos"]}" quat="{text["quat"]}">')
        limits = f'range="{robot.lower[k]:.9g} {robot.upper[k]:.9g}"'
        lines.append(f'<joint name="{robot.joint_names[k]}" type="hinge" axis="{text["axis"]}" {limits}/>')
        if np.linalg.norm(end) > 2.0 * thickness:
            lines.append(f'<geom type="capsule" size="{thickness}" fromto="0 0 0 {text["to"]}"/>')
    x, y, z = tip.translation
    lines.append(f'<site name="tip" pos="{x:.9g} {y:.9g} {z:.9g}"/>' + "</body>" * len(ends) + "</worldbody></mujoco>")
    Path(file).write_text("\n".join(lines))


write_mjcf(rrtik.load_robot("ur5"), "ur5.xml")
robot = rrtik.load_robot("ur5.xml")
apart = [rrtik.load_robot("ur5").fk(q).translation - robot.fk(q).translation for q in np.eye(6)]
print(f"tip of the MJCF file within {1e3 * np.abs(apart).max():.3g} mm of the shipped arm's")
