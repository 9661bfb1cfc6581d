"""From what was asked for to an engine: problem, camera, marker map, arm, record."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rrtik_ompl.errors import InputError
from rrtik_ompl.overlay.virtual_camera import eye_at
from rrtik_ompl.pilot.devices.arm import Arm, SimulatedArm
from rrtik_ompl.pilot.devices.camera_feed import Feed
from rrtik_ompl.pilot.devices.line_arm import LineArm
from rrtik_ompl.pilot.devices.perception import LiveEyes, SimulatedSource
from rrtik_ompl.pilot.devices.simulated_vehicle import Scenario, find_scenario, load_scenario
from rrtik_ompl.pilot.devices.simulation import SimulatedCamera
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.record import Record
from rrtik_ompl.pilot.replay import RecordedArm, RecordedEyes, entries_for, start_of
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.problem import Problem
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.camera_file import load_camera
from rrtik_ompl.sensing.cameras.pictures import Picture, pictures_from
from rrtik_ompl.sensing.markers.marker_map_file import load_marker_map
from rrtik_ompl.sensing.scene_from_view import SIGMAS
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.sensing.sight import check_size

LAST_PORT = 65535
FROM_ASIDE = 2.5, np.radians(125.0), np.radians(30.0)  # [m], [rad]: where a camera is imagined that moved with its base


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a person asked for; see `rrtik pilot --help`. Without a source the camera is simulated."""

    problem: str
    source: int | Path | None = None
    scenario: Path | None = None
    camera_file: Path | None = None
    map_file: Path | None = None
    record: Path | None = None
    replay: Path | None = None
    arm: str | None = None
    seed: int = 0
    sigmas: float = SIGMAS


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A session with everything that it holds open."""

    engine: Engine
    closing: tuple[Callable[[], None], ...]

    def close(self) -> None:
        """Let the arm stand still, and let go of arm, camera and record."""
        self.engine.session.arm.stop()
        for close in self.closing:
            close()


def open_session(wanted: Wanted) -> Opened:
    """Make what was asked for.

    Raises:
        InputError: If a file, the camera or the arm cannot be used.
    """
    problem = load_problem(wanted.problem)
    if wanted.replay is not None:
        return _replay(wanted, problem, wanted.replay)
    arm: Arm = SimulatedArm(problem.robot, problem.start) if wanted.arm is None else _line_arm(problem, wanted.arm)
    eyes = _eyes(wanted, problem, arm)
    record = Record(wanted.record)
    record.write("begin", 0.0, problem=problem.name, seed=wanted.seed, q=arm.read().tolist())
    session = Session(problem, arm, record=record, seed=wanted.seed)
    simulated = arm if isinstance(arm, SimulatedArm) else None
    closing = [eyes.close, record.close]
    if isinstance(arm, LineArm):
        closing.insert(0, arm.close)
    return Opened(Engine(session, eyes, simulated=simulated), tuple(closing))


def _eyes(wanted: Wanted, problem: Problem, arm: Arm) -> LiveEyes:
    if wanted.source is None:
        scenario = _scenario(wanted, problem)
        sensor = Sensor(scenario.camera, scenario.marker_map, sigmas=wanted.sigmas)
        return LiveEyes(sensor, SimulatedSource(_simulated(scenario, problem), arm), arm_in_picture=True)
    for name, file in (("--camera-file", wanted.camera_file), ("--map", wanted.map_file)):
        if file is None:
            raise InputError(f"pictures need {name} FILE (see: rrtik markers --help)")
    camera, marker_map = load_camera(str(wanted.camera_file)), load_marker_map(str(wanted.map_file))
    sensor = Sensor(camera, marker_map, sigmas=wanted.sigmas)
    source = wanted.source
    return LiveEyes(sensor, Feed(lambda: _fitting(pictures_from(source), camera), paced=not isinstance(source, int)))


def _fitting(pictures: Iterator[Picture], camera: Camera) -> Iterator[Picture]:
    """The same pictures; the first that the camera cannot have taken ends them with an error."""
    for picture in pictures:
        check_size(picture.pixels, camera)
        yield picture


def _scenario(wanted: Wanted, problem: Problem) -> Scenario:
    scenario = load_scenario(wanted.scenario or find_scenario(problem.name))
    if wanted.camera_file is None and wanted.map_file is None:
        return scenario
    raise InputError("--simulated takes camera and map from its scenario: leave out --camera-file and --map")


def _recorded(wanted: Wanted, problem: Problem) -> Scenario:
    """What a record is shown with: a scenario, or the camera and map that it was made with."""
    if wanted.camera_file is None or wanted.map_file is None:
        return _scenario(wanted, problem)
    camera, marker_map = load_camera(wanted.camera_file), load_marker_map(wanted.map_file)
    return Scenario(camera, marker_map, {}, marker_map.T_base_camera or eye_at(np.zeros(3), *FROM_ASIDE))


def _simulated(scenario: Scenario, problem: Problem) -> SimulatedCamera:
    return SimulatedCamera(
        scenario.camera, scenario.marker_map, problem.robot, problem.world.scene, scenario.places,
        scenario.T_base_camera,
    )  # fmt: skip


def _line_arm(problem: Problem, address: str) -> LineArm:
    host, colon, port = address.rpartition(":")
    if not colon or not host or not port.isdecimal() or not 0 < int(port) <= LAST_PORT:
        raise InputError(f"--arm {address}: expected HOST:PORT, for example 127.0.0.1:5600")
    return LineArm(problem.robot, host.strip("[]"), int(port))


def _replay(wanted: Wanted, problem: Problem, file: Path) -> Opened:
    scenario = _recorded(wanted, problem)
    entries = entries_for(file, problem.name, problem.robot, scenario.marker_map)
    start, seed = start_of(entries, problem.start)
    arm = RecordedArm(problem.robot, start)
    eyes = RecordedEyes(entries, arm, _simulated(scenario, problem))
    return Opened(Engine(Session(problem, arm, seed=seed), eyes), (eyes.close,))
