"""Measurements of the pilot's loop: what a step costs, how often a page is told anew, and where pictures are drawn."""

from __future__ import annotations

import asyncio
import itertools
import json
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np
import pinocchio as pin
import tornado.websocket

from bench.pilot.scene import NAME, PLACE, ROBOT, seen_at
from rrtik_bench.sensing.synthetic_camera import published_camera
from rrtik_ompl.base.poses import pose
from rrtik_ompl.model.scene import Obstacle
from rrtik_ompl.model.shapes import Box
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.overlay.augment import Augmenter
from rrtik_ompl.pilot.overlay.virtual_camera import orbit_pose
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.setup import SessionOptions, open_session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_ompl.sensing.cameras.pictures import Picture

PICTURES, SWAY = 30, 0.03  # of the object that moves; [m]
QUIET = 4.0  # [s] without a click, in which states are counted


class Moving:
    """Pictures of the valve swaying before the camera, made beforehand: a camera does not cost the tool anything."""

    def __init__(self, engine: Engine) -> None:
        """Take the pictures."""
        camera, q = engine.perception.source.camera, engine.session.q  # type: ignore[attr-defined]
        pictures = []
        for k in range(PICTURES):
            aside = SWAY * np.sin(2.0 * np.pi * k / PICTURES)
            camera.places["valve"] = pin.SE3(PLACE.rotation, PLACE.translation + np.array([0.0, aside, 0.0]))
            pictures.append(camera.picture(q, k / 30.0).pixels)
        self._pictures, self._count = itertools.cycle(pictures), itertools.count()

    def latest(self) -> Picture:
        """The next one."""
        return Picture(next(self._pictures), "swaying valve", next(self._count) / 30.0)

    def close(self) -> None:
        """Nothing to let go."""


def state_rate() -> float:
    """States a second of processor time, all lamps worked out anew, for an object that is elsewhere every time."""
    engine = open_session(SessionOptions(NAME)).engine
    engine.update(0.0)
    times = []
    for k in range(60):
        begin = time.process_time()
        engine.session.see([seen_at(PLACE * pose([0.004 * (k % 2), 0.0, 0.0]))], 0.1 + k / 30.0)
        engine.state()
        times.append(time.process_time() - begin)
    return 1.0 / float(np.median(times[1:]))


def stages(count: int = 60) -> list[tuple[str, float, float]]:
    """Stages of the loop while the object moves: name, processor time, clock time [s]."""
    engine = open_session(SessionOptions(NAME)).engine
    engine.perception.source = Moving(engine)  # type: ignore[attr-defined]
    acts: list[tuple[str, Callable[[int], Any]]] = [
        ("detect, pose, world", lambda k: engine.update(10.0 + k / 30.0)),
        ("state with its lamps", lambda _: engine.state()),
        ("camera picture, JPEG", lambda _: engine.camera_picture()),
        ("outside picture, JPEG", lambda _: engine.outside_picture()),
    ]
    spent = np.zeros((len(acts), 2))
    for k in range(count + 5):
        for row, (_, act) in enumerate(acts):
            processor, clock = time.process_time(), time.perf_counter()
            act(k)
            if k >= 5:
                spent[row] += time.process_time() - processor, time.perf_counter() - clock
    return [(name, float(row[0]), float(row[1])) for (name, _), row in zip(acts, spent / count, strict=True)]


class Served(NamedTuple):
    """With a page that is served while the object moves: states a second, processor seconds a state, delays [s]."""

    rate: float
    processor: float
    delays: list[float]


def served(clicks: int) -> Served:
    """A session at its server; a client that shows everything at once counts states, then clicks on lamps."""
    ready, ended, server = threading.Event(), threading.Event(), PilotServer()

    def serve() -> None:
        opened = open_session(SessionOptions(NAME))
        opened.engine.perception.source = Moving(opened.engine)  # type: ignore[attr-defined]
        with server:
            ready.set()
            Loop(opened.engine, server).run(ended.is_set)
        opened.close()

    thread = threading.Thread(target=serve)
    thread.start()
    ready.wait(60)
    found = asyncio.run(_watched(server, clicks))
    ended.set()
    thread.join()
    return found


async def _watched(server: PilotServer, clicks: int) -> Served:
    socket = await tornado.websocket.websocket_connect(f"ws://127.0.0.1:{server.port}/ws?page=bench")
    for _ in range(30):
        await _next_state(socket)
    states, begin, processor = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() < begin + QUIET:
        await _next_state(socket)
        states += 1
    rate, processor = states / (time.perf_counter() - begin), time.process_time() - processor
    delays = [await _click(socket, number) for number in range(1, clicks + 1)]
    socket.close()
    return Served(rate, processor / states, delays)


async def _next_state(socket: Any) -> dict[str, Any]:
    while True:
        message = await socket.read_message()
        if isinstance(message, bytes):
            await socket.write_message('{"shown": "frame"}')
            continue
        said: dict[str, Any] = json.loads(message)
        if said["kind"] == "state":
            await socket.write_message('{"shown": "state"}')
            return said


async def _click(socket: Any, number: int) -> float:
    """Seconds from a click on a lamp to the state that answers it, after a pause of random length."""
    end = time.perf_counter() + np.random.default_rng(number).uniform(0.05, 0.1)
    while time.perf_counter() < end:
        await _next_state(socket)
    begin = time.perf_counter()
    await socket.write_message(json.dumps({"name": "grasp", "type": "aslant", "level": number % 3, "seq": number}))
    while number not in (await _next_state(socket))["answered"].values():
        pass
    return time.perf_counter() - begin


def registration(count: int) -> list[float]:
    """How far small boxes in the picture are from the outline of their corners, projected one by one [px]."""
    away: list[float] = []
    camera, rng = published_camera(), np.random.default_rng(5)
    augmenter = Augmenter(ROBOT, camera)
    T = orbit_pose([1.2, 0.2, 0.1], 1.3, np.deg2rad(-150), np.deg2rad(25))
    black = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
    while len(away) < count:
        place = pin.SE3(pin.exp3(rng.normal(0, 1, 3)), np.array([1.2, 0.2, 0.1]) + rng.uniform(-0.25, 0.25, 3))
        corners = 0.02 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) @ place.rotation.T
        seen = T.inverse().homogeneous
        pixels = camera.project((corners + place.translation) @ seen[:3, :3].T + seen[:3, 3])
        if (pixels < 2).any() or (pixels > np.array([camera.width, camera.height]) - 3).any():
            continue
        drawn = augmenter.draw(black, T, obstacles=[Obstacle("box", Box([0.04] * 3), place)], opacity=1.0)
        moments = cv2.moments(cv2.convexHull(pixels.astype(np.float32)))
        centre = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
        rows, columns = np.nonzero(drawn.any(axis=2))
        away.append(float(np.linalg.norm([columns.mean() - centre[0], rows.mean() - centre[1]])))
    return away
