"""The two pictures of the page: the camera's with the arm and the chosen grasp drawn in, and the view from outside.

The camera's picture gets aids for the depth that it lacks: the nearest pair, distances, and the axes of insertion.

Source: [1, ch. 6 and 4.6.2].
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.geometry.collision.distances import measured
from rrtik_ompl.model.judgement import Contact
from rrtik_ompl.pilot.interlock import FOLLOWING, PROPOSED
from rrtik_ompl.pilot.overlay.augment import Augmenter, Ghost
from rrtik_ompl.pilot.overlay.virtual_camera import background, orbit_pose, pinhole_camera
from rrtik_ompl.pilot.routes.lamps import AMBER, GREEN, RED
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.surroundings import gripper_links
from rrtik_ompl.sensing.cameras.camera import Camera

LAMP_COLORS = {GREEN: "#1b9e3a", AMBER: "#e6a100", RED: "#c62828"}
NEXT_MOVE = "#56b4e9"
OUTLINE = "#ffffff"
# The colour of the drawn arm; it must not be mistaken for the real one.
VIRTUAL_ARM = "#e4ebf5"
VIRTUAL_OPACITY = 0.6
SKY = 0.22  # brightness of the outside view's background, which lies beside a dark page
TRAIL_POINTS = 60  # points of a trail
OUTSIDE_TRIANGLES = 8_000
PRESETS = {"side": (90.0, 10.0), "top": (-90.0, 89.0), "behind": (180.0, 25.0), "corner": (125.0, 30.0)}  # degrees

AXIS = 0.25  # length of the axes that are drawn [m]
SHOWN = 0.15  # pairs nearer than this are drawn [m]
NEAREST_SHOWN = 0.05  # least distance from the camera [m]

# Colours: blue, green, red.
WHITE = (255, 255, 255)
BLACK = (0, 0, 0)
DOWN = (200, 200, 80)
NEAR_COLOR = (80, 90, 255)
TOOL_AXIS = (233, 180, 86)
GRASP_AXIS = (80, 200, 60)


class CameraView:
    """The camera's picture with the virtual arm drawn in.

    Attributes:
        aids: The distances that are shown.
    """

    def __init__(self, camera: Camera, session: Session) -> None:
        """Prepare the arm's triangles once."""
        self._session = session
        self._arm = Augmenter(session.robot, camera)
        self._camera = camera
        self.aids = Aids(session)

    def draw(
        self, picture: NDArray[np.uint8], T_base_camera: pin.SE3, arm_in_picture: bool = False
    ) -> NDArray[np.uint8]:
        """Return the augmented picture, shape (height, width, 3), blue, green, red.

        Args:
            picture: Picture of the camera.
            T_base_camera: Pose of the camera.
            arm_in_picture: Whether the picture shows the real or simulated arm: then only the planned motion is drawn.
        """
        session = self._session

        # All known obstacles hide the drawn arm, whether they were seen or given.
        real = session.surroundings.world.scene.obstacles
        drawn = self._arm.draw(
            picture, T_base_camera, None if arm_in_picture else session.q,
            ghosts=ghosts(session), real=real, trail=trail(session),
            frames=[session.robot.fk(session.q), *_chosen(session)], opacity=VIRTUAL_OPACITY, color=VIRTUAL_ARM,
        )  # fmt: skip
        draw_aids(drawn, self._camera, T_base_camera, session, self.aids.distances())
        return drawn


class OutsideView:
    """The arm and its surroundings from a viewpoint chosen by the pilot."""

    def __init__(self, session: Session, width: int = 640, height: int = 480) -> None:
        """Begin with the view from a corner."""
        self._session = session
        self._camera = pinhole_camera(width, height)
        self._arm = Augmenter(session.robot, self._camera, OUTSIDE_TRIANGLES)
        self._sky = np.rint(SKY * background(self._camera)).astype(np.uint8)
        reach = float(np.linalg.norm(session.robot.fk(session.q).translation))
        self.centre: Vector = np.array([0.6 * reach, 0.0, 0.0])
        self.distance, self.azimuth, self.elevation = 1.9 * max(reach, 0.3), *np.radians(PRESETS["corner"])
        self.share: float | None = None  # share of the route in a preview; None shows the arm as it is

    def turn(self, right: float, up: float) -> None:
        """Turn the view by two angles [rad]."""
        self.azimuth -= right
        self.elevation = float(np.clip(self.elevation + up, -1.5, 1.5533))

    def zoom(self, factor: float) -> None:
        """Multiply the distance by a factor; below 1 the view comes nearer."""
        self.distance = float(np.clip(self.distance * factor, 0.2, 50.0))

    def preset(self, name: str) -> None:
        """Look from one of the standard viewpoints; other names have no effect."""
        if name in PRESETS:
            self.azimuth, self.elevation = np.radians(PRESETS[name])

    def key(self) -> tuple[Hashable, ...]:
        """Return a key that is equal for equal pictures."""
        session = self._session
        shown = session.q.tobytes() if self.share is None else along(session, self.share).tobytes()
        moves = None if session.follower is None else (session.follower.path, session.follower.current)
        chosen = (session.mode, session.target, session.state.choice, session.surroundings.version)
        return shown, moves, chosen, self.distance, self.azimuth, self.elevation

    def draw(self) -> NDArray[np.uint8]:
        """Return the picture, shape (height, width, 3), blue, green, red."""
        session = self._session
        T_base_camera = orbit_pose(self.centre, self.distance, self.azimuth, self.elevation)
        configuration = session.q if self.share is None else along(session, self.share)
        surroundings = session.surroundings

        obstacles = (*surroundings.world.scene.obstacles, *surroundings.held_solids(session.robot.fk(configuration)))
        return self._arm.draw(
            self._sky, T_base_camera, configuration, ghosts=ghosts(session), obstacles=obstacles,
            trail=trail(session), frames=[session.robot.fk(configuration), *_objects(session)], opacity=1.0,
        )  # fmt: skip


# --- what both draw --------------------------------------------------------------------------------------------------


def ghosts(session: Session) -> list[Ghost]:
    """Return the end of the current move of a route, or the chosen grasp in the colour of its lamp."""
    if session.follower is not None and session.mode in (PROPOSED, FOLLOWING):
        return [Ghost(session.follower.target, NEXT_MOVE, 0.4, outline=OUTLINE)]

    lamp = session.lamp()
    if lamp is None:
        return []

    if np.isnan(lamp.q[1]).any():  # no configuration reaches the grasp: show only the gripper there
        return [Ghost(None, LAMP_COLORS[lamp.color], 0.55, at, OUTLINE) for at in _chosen(session)]
    return [Ghost(lamp.q[1], LAMP_COLORS[lamp.color], 0.45, outline=OUTLINE)]


def trail(session: Session) -> Matrix | None:
    """Return positions of the tip along the route, shape (k, 3) [m]; None without a route."""
    if session.follower is None:
        return None

    path = session.follower.path
    rows = path.resample(max(path.length / TRAIL_POINTS, 1e-3)).waypoints
    return np.asarray(session.robot.fk_batch(rows)[:, :3, 3])


def along(session: Session, share: float) -> Vector:
    """Return the configuration at a share of the route's travel, shape (dof,)."""
    if session.follower is None:
        return session.q

    rows = session.follower.path.waypoints
    lengths = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(rows, axis=0)).sum(axis=1))])
    travel = float(np.clip(share, 0.0, 1.0)) * lengths[-1]
    return np.array([np.interp(travel, lengths, column) for column in rows.T])


def _chosen(session: Session) -> list[pin.SE3]:
    """Return ``T_base_tip`` of the chosen grasp, reachable or not; an empty list if none is chosen."""
    target_seen = None if session.target is None else session.surroundings.named(session.target)
    if target_seen is None or session.state.choice is None:
        return []
    return [target_seen.grasp_pose(*session.state.choice)]


def _objects(session: Session) -> Sequence[pin.SE3]:
    return [pin.SE3(seen.T_base_object) for seen in session.surroundings.seen]


# --- aids ------------------------------------------------------------------------------------------------------------


class Distances(NamedTuple):
    """The least distances of a configuration.

    Attributes:
        nearest: The nearest pair of a link, or held object, and an obstacle; None if there is none.
        to_target: The nearest pair of the gripper, or held object, and the target; None if there is none.
    """

    nearest: Contact | None
    to_target: Contact | None


class Aids:
    """Measure the distances of a session; they are computed again only when something has moved."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._measured_key: Any = None
        self._distances = Distances(None, None)

    def distances(self) -> Distances:
        """Return the distances at the present configuration."""
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
        """Return the distances as plain values [mm]."""
        return {name: _plain(contact) for name, contact in self.distances()._asdict().items()}


def _plain(contact: Contact | None) -> dict[str, Any] | None:
    if contact is None:
        return None
    return {"first": contact.first, "second": contact.second, "mm": round(1e3 * contact.distance, 1)}


def draw_aids(
    drawn: NDArray[np.uint8], camera: Camera, T_base_camera: pin.SE3, session: Session, distances: Distances
) -> None:
    """Draw the depth aids into a picture in place.

    These are the nearest pair with its distance, the axes of the tool and of the chosen grasp, a vertical line from the
    tip to the height of the goal, and the line from the tip to the goal with its length.

    Args:
        drawn: The picture, blue, green, red, shape (height, width, 3).
        camera: Its camera.
        T_base_camera: Pose of the camera.
        session: The session.
        distances: The least distances.
    """
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
    """A picture into which lines in space are drawn."""

    def __init__(self, drawn: NDArray[np.uint8], camera: Camera, T_base_camera: pin.SE3) -> None:
        self._drawn = drawn
        self._camera = camera
        self._T = T_base_camera

    def line(self, begin: Vector, end: Vector, color: tuple[int, int, int], text: str = "") -> None:
        """Draw a line in space with a dark outline and a text at its middle, unless it extends behind the camera."""
        points = np.stack([begin, end]) @ self._T.rotation - self._T.rotation.T @ self._T.translation
        if (points[:, 2] < NEAREST_SHOWN).any():
            return

        a, b = (tuple(int(v) for v in np.clip(pixel, -4000, 4000)) for pixel in self._camera.project(points))
        cv2.line(self._drawn, a, b, BLACK, 4, cv2.LINE_AA)
        cv2.line(self._drawn, a, b, color, 2, cv2.LINE_AA)

        if text:
            self._write(text, ((a[0] + b[0]) // 2 - 30, (a[1] + b[1]) // 2 + 26))

    def _write(self, text: str, left_foot: tuple[int, int]) -> None:
        """Write light text on a dark plate, legible on any background."""
        font = (cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        x, y = left_foot
        (width, height), below = cv2.getTextSize(text, *font)
        cv2.rectangle(self._drawn, (x - 4, y - height - 4), (x + width + 4, y + below), (28, 21, 15), cv2.FILLED)
        cv2.putText(self._drawn, text, left_foot, font[0], font[1], WHITE, font[2], cv2.LINE_AA)
