"""What the pilot's tool is measured on: TITAN-4 before the panel, and the valve that its camera sees."""

from __future__ import annotations

from typing import Any

import numpy as np

import rrtik_ompl as rrtik
from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle, load_vehicle
from rrtik_ompl.pilot.routes.lamps import GREEN
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.sensing.scene_from_view import SeenObject

NAME = "titan4_sdu"
PROBLEM = rrtik.load_problem(NAME)
ROBOT, WORLD = PROBLEM.robot, PROBLEM.world
SCENARIO = load_vehicle(find_vehicle(NAME))
VALVE, PLACE = SCENARIO.marker_map.named("valve"), SCENARIO.places["valve"]


def seen_at(T: Any) -> SeenObject:
    """The valve, seen at a place."""
    return SeenObject(VALVE, T, 1e-8 * np.eye(6), None)


def green_grasps(session: Session) -> list[tuple[str, int]]:
    """Type and level of the grasps that can be reached."""
    return [(lamp.type, lamp.level) for lamp in session.lamps() if lamp.color == GREEN]
