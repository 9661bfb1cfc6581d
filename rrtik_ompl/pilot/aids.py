"""Aids for the depth that one picture lacks: what is nearest, how far edges are from each other, the axes of insertion.

Source: [1, ch. 4.6.2] (approach and insertion).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.geometry.collision.contacts import measured
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.surroundings import gripper_links
from rrtik_ompl.sensing.cameras.camera import Camera

AXIS = 0.25  # length of the axes that are drawn [m]
SHOWN = 0.15  # nearer pairs are drawn [m]
NEAREST_SHOWN = 0.05  # from the camera [m]

# Colours: blue, green, red.
WHITE = (255, 255, 255)
BLACK = (0, 0, 0)
DOWN = (200, 200, 80)
NEAR_COLOR = (80, 90, 255)
TOOL_AXIS = (233, 180, 86)
GRASP_AXIS = (80, 200, 60)


class Distances(NamedTuple):
    """Of a posture.

    Attributes:
        nearest: The link, or thing held, and the obstacle that are nearest to each other.
        to_target: The same of the gripper, with what it holds, and the target.
    """

    nearest: Contact | None
    to_target: Contact | None


class Aids:
    """Measures for a session, anew only when something has moved."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._measured_key: Any = None
        self._distances = Distances(None, None)

    def distances(self) -> Distances:
        """Of the arm where it is."""
        session = self._session
        surroundings = session.surroundings
        key = (session.q.tobytes(), surroundings.version, session.target)

        if key != self._measured_key:
            world = surroundings.world
            frames = world.robot.joint_frames(session.q[None])[0]
            obstacle_names = {obstacle.name for obstacle in world.scene.obstacles}
            to_obstacles = [
                contact
                for contact in measured(world.bodies, world.pairs, frames, near_only=False)
                if {contact.first, contact.second} & obstacle_names
            ]

            held_names = {solid.name for solid in surroundings.held_solids(pin.SE3.Identity())}
            tool = {*gripper_links(session.robot), *held_names}
            target_seen = None if session.target is None else surroundings.named(session.target)
            target_solids = set() if target_seen is None else set(target_seen.object.solid_names)
            tool_to_target = [
                contact
                for contact in to_obstacles
                if {contact.first, contact.second} & tool and {contact.first, contact.second} & target_solids
            ]

            self._measured_key = key
            self._distances = Distances(
                nearest=min(to_obstacles, key=lambda contact: contact.distance, default=None),
                to_target=min(tool_to_target, key=lambda contact: contact.distance, default=None),
            )
        return self._distances

    def document(self) -> dict[str, Any]:
        """The distances as plain values [mm]."""
        return {name: _plain(contact) for name, contact in self.distances()._asdict().items()}


def _plain(contact: Contact | None) -> dict[str, Any] | None:
    if contact is None:
        return None
    return {"first": contact.first, "second": contact.second, "mm": round(1e3 * contact.distance, 1)}


def draw_aids(
    drawn: NDArray[np.uint8], camera: Camera, T_base_camera: pin.SE3, session: Session, distances: Distances
) -> None:
    """The axis of the tool and that of the grasp, the line between them with its length, one straight down, the gap."""
    view = _View(drawn, camera, T_base_camera)
    if distances.nearest is not None and 0.0 < distances.nearest.distance < SHOWN:
        nearest = distances.nearest
        view.line(nearest.point_first, nearest.point_second, NEAR_COLOR, f"{1e3 * nearest.distance:.0f} mm")

    target_seen = None if session.target is None else session.surroundings.named(session.target)
    if target_seen is None:
        return

    tip = session.robot.fk(session.q)
    tip_point = tip.translation
    if session.state.choice is not None:
        goal = target_seen.grasp_pose(*session.state.choice)
        view.line(tip_point, tip_point + AXIS * tip.rotation[:, 2], TOOL_AXIS)
        view.line(goal.translation - AXIS * goal.rotation[:, 2], goal.translation, GRASP_AXIS)
    else:
        goal = target_seen.T_base_object

    goal_point = goal.translation
    view.line(tip_point, np.array([tip_point[0], tip_point[1], goal_point[2]]), DOWN)
    view.line(tip_point, goal_point, WHITE, f"{float(np.linalg.norm(goal_point - tip_point)):.3f} m")


class _View:
    """A picture that lines are drawn into."""

    def __init__(self, drawn: NDArray[np.uint8], camera: Camera, T_base_camera: pin.SE3) -> None:
        self._drawn = drawn
        self._camera = camera
        self._T = T_base_camera

    def line(self, begin: Vector, end: Vector, color: tuple[int, int, int], text: str = "") -> None:
        """A line with a dark outline, and a text beside its middle; nothing if it comes behind the camera."""
        points = np.stack([begin, end]) @ self._T.rotation - self._T.rotation.T @ self._T.translation
        if (points[:, 2] < NEAREST_SHOWN).any():
            return

        a, b = (tuple(int(v) for v in np.clip(pixel, -4000, 4000)) for pixel in self._camera.project(points))
        cv2.line(self._drawn, a, b, BLACK, 4, cv2.LINE_AA)
        cv2.line(self._drawn, a, b, color, 2, cv2.LINE_AA)

        if text:
            self._write(text, ((a[0] + b[0]) // 2 - 30, (a[1] + b[1]) // 2 + 26))

    def _write(self, text: str, left_foot: tuple[int, int]) -> None:
        """Light text on a dark plate: legible on any background."""
        font = (cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        x, y = left_foot
        (width, height), below = cv2.getTextSize(text, *font)
        cv2.rectangle(self._drawn, (x - 4, y - height - 4), (x + width + 4, y + below), (28, 21, 15), cv2.FILLED)
        cv2.putText(self._drawn, text, left_foot, font[0], font[1], WHITE, font[2], cv2.LINE_AA)
