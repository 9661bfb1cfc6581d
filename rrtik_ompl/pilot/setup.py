"""Build an engine from the options of a session: problem, camera, marker map, arm, record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.version import __version__
from rrtik_ompl.pilot.devices.arm import Arm, SimulatedArm, joint_rates
from rrtik_ompl.pilot.devices.camera_feed import Feed, FurtherCamera, LiveCamera
from rrtik_ompl.pilot.devices.line_arm import LineArm
from rrtik_ompl.pilot.devices.simulated_vehicle import SimulatedVehicle, find_vehicle, load_vehicle
from rrtik_ompl.pilot.devices.simulation import SimulatedCamera, SimulatedFurtherCamera, SimulatedSource
from rrtik_ompl.pilot.devices.watchdog import Report
from rrtik_ompl.pilot.devices.wrong_arm import WrongArm
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.overlay.virtual_camera import orbit_pose
from rrtik_ompl.pilot.perception import CameraOfRig, LivePerception
from rrtik_ompl.pilot.record import RECORD_VERSION, PictureRecord, Record, RecordedPictures, beside
from rrtik_ompl.pilot.replay import RecordedArm, RecordedPerception, entries_for, start_of
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.surroundings import Structure
from rrtik_ompl.problem_files.problem import load_problem
from rrtik_ompl.sensing.cameras.camera import Camera
from rrtik_ompl.sensing.cameras.pictures import Picture, pictures_from
from rrtik_ompl.sensing.markers.marker_map import MarkerMap
from rrtik_ompl.sensing.rig import Rig
from rrtik_ompl.sensing.rig_file import pictures_together
from rrtik_ompl.sensing.scene_from_view import SIGMAS
from rrtik_ompl.sensing.sensor import Sensor
from rrtik_ompl.sensing.sight import check_size
from rrtik_ompl.world.problem import Problem

LAST_PORT = 65535
# Distance [m], azimuth and elevation [rad] of a camera whose pose is not known.
DEFAULT_CAMERA_POSE = 2.5, np.radians(125.0), np.radians(30.0)


@dataclass(frozen=True, slots=True)
class SessionOptions:
    """Options of a session; see `rrtik pilot --help`. Without a source the camera is simulated."""

    problem: str
    source: int | Path | None = None
    vehicle: Path | None = None
    camera_file: Path | None = None
    map_file: Path | None = None
    record: Path | None = None
    record_pictures: bool = False
    second: int | Path | None = None
    rig: Path | None = None
    replay: Path | None = None
    arm: str | None = None
    master: str | None = None
    seed: int = 0
    sigmas: float = SIGMAS


@dataclass(frozen=True, slots=True, eq=False)
class OpenSession:
    """An engine with the resources that it holds open.

    Attributes:
        engine: The engine.
        closing: Functions that release the resources, in this order.
        reports: By name, functions that give the time of the last report of the threads of arm and camera.
        record: The record of the session.
    """

    engine: Engine
    closing: tuple[Callable[[], None], ...]
    reports: Mapping[str, Report] = field(default_factory=dict)
    record: Record = field(default_factory=lambda: Record(None))

    def close(self) -> None:
        """Stop the arm, and release arm, camera and record."""
        self.engine.session.arm.stop()
        self.record.write("end", self.engine.session.time)
        for close in self.closing:
            close()


def open_session(options: SessionOptions) -> OpenSession:
    """Open a session with the given options.

    Raises:
        InputError: If a file, the camera or the arm cannot be used.
    """
    problem = load_problem(options.problem)
    if options.rig is not None and options.source is None:
        raise InputError("--rig: needs pictures of cameras, films or folders, not simulated or recorded ones")
    if options.replay is not None:
        return _replay(options, problem, options.replay)
    if options.arm is not None and isinstance(options.source, Path):
        raise InputError("--arm: an arm is moved by a camera's pictures, not by photographs or a film: leave one out")

    vehicle = None if options.source is not None else _vehicle(options, problem)
    arm: Arm = _simulated_arm(vehicle, problem) if options.arm is None else _line_arm(problem, options.arm)
    source = None if vehicle is None else SimulatedSource(_simulated(vehicle, problem), arm, vehicle.base_motion)

    perception = _perception(options, vehicle, source)
    record = Record(options.record)
    record.write("begin", 0.0, **_begin(options, problem, arm))

    past = isinstance(options.source, Path)
    master = None if options.master is None else _line_arm(problem, options.master, "--master")
    session = Session(
        problem, arm, rates=_rates(problem, arm), record=record, seed=options.seed, past=past,
        structure=_structure(vehicle), master=master, patience=_patience(vehicle),
    )  # fmt: skip
    simulated = [each for each in (arm, source) if isinstance(each, SimulatedArm | SimulatedSource)]

    closing = [perception.close, record.close]
    reports = perception.reports()
    if master is not None:
        closing.append(master.close)

    if isinstance(arm, LineArm):
        closing.insert(0, arm.close)
        reports["the line to the arm"] = lambda: arm.reported

    pictures = _picture_record(options, record)
    further = _further(options, vehicle, problem, perception)

    engine = Engine(session, perception, simulated=simulated, further=further, pictures=pictures)
    return OpenSession(engine, (*closing, engine.close), reports, record)


def _begin(options: SessionOptions, problem: Problem, arm: Arm) -> dict[str, object]:
    """Return the first line of a record: when, of what, with which devices, and where the arm is."""
    behind_line = f"at {options.arm}, protocol {arm.greeting.version}" if isinstance(arm, LineArm) else "simulated"
    return {
        "record": RECORD_VERSION,
        "date": datetime.now(timezone.utc).isoformat(timespec="milliseconds"),
        "version": __version__,
        "problem": problem.name,
        "arm": behind_line,
        "camera": "simulated" if options.source is None else str(options.source),
        "seed": options.seed,
        "joints": list(problem.robot.joint_names),
        "sliding": problem.robot.prismatic.tolist(),
        "q": arm.read().tolist(),
    }


def _picture_record(options: SessionOptions, record: Record) -> PictureRecord | None:
    """Open the record of pictures beside the record, if the options ask for it; None otherwise."""
    if not options.record_pictures:
        return None
    if options.record is None:
        raise InputError("--record-pictures: needs --record FILE, beside which the pictures are written")
    return PictureRecord(record, options.record)


def _further(
    options: SessionOptions, vehicle: SimulatedVehicle | None, problem: Problem, perception: LivePerception
) -> dict[str, FurtherCamera]:
    """Open the cameras in addition to the first one, by name."""
    found: dict[str, FurtherCamera] = {}
    source = perception.source
    second = options.second
    if vehicle is not None and isinstance(source, SimulatedSource):
        for mount in vehicle.further:
            found[mount.name] = SimulatedFurtherCamera(mount, _simulated(vehicle, problem), source.camera, source.arm)

    if second is not None and options.rig is not None:
        found["second"] = CameraOfRig(perception)
    elif second is not None:
        feed = Feed(lambda: pictures_from(second), paced=not isinstance(second, int))
        found["second"] = LiveCamera(feed)
    return found


def _simulated_arm(vehicle: SimulatedVehicle | None, problem: Problem) -> SimulatedArm:
    """Return a simulated arm, with the faults of the simulated vehicle if it has any."""
    if vehicle is None or vehicle.faults is None:
        return SimulatedArm(problem.robot, problem.start)
    return WrongArm(problem.robot, problem.start, vehicle.faults)


def _rates(problem: Problem, arm: Arm) -> Vector | None:
    """Return the rates at which an arm behind a line is driven: its own, and no more than the default rates."""
    rates = arm.greeting.rates if isinstance(arm, LineArm) else None
    return None if rates is None else np.minimum(rates, joint_rates(problem.robot))


def _structure(vehicle: SimulatedVehicle | None) -> Structure | None:
    """Return the object to which the problem's obstacles are fixed, with its nominal pose; None for no such object."""
    if vehicle is None or vehicle.structure is None:
        return None
    return Structure(vehicle.structure, vehicle.places[vehicle.structure])


def _patience(vehicle: SimulatedVehicle | None) -> float | None:
    """Return how long routes may depend on objects out of view [s]; None for the default of the session."""
    return None if vehicle is None else vehicle.patience


def _perception(
    options: SessionOptions, vehicle: SimulatedVehicle | None, simulated: SimulatedSource | None
) -> LivePerception:
    """Open the camera and its sensor: simulated, a single camera, or a rig of two."""
    if vehicle is not None and simulated is not None:
        sensor = Sensor(vehicle.camera, vehicle.marker_map, sigmas=options.sigmas)
        return LivePerception(sensor, simulated, arm_in_picture=True)

    eye = None if options.rig is None else Rig.load(options.rig)
    for name, file in (("--camera-file", options.rig or options.camera_file), ("--map", options.map_file)):
        if file is None:
            raise InputError(f"pictures need {name} FILE (see: rrtik markers --help)")

    source = options.source
    second = options.second
    if source is None:
        raise InputError("there is no source of pictures")
    marker_map = MarkerMap.load(str(options.map_file))
    paced = not isinstance(source, int)

    if eye is None:
        camera = Camera.load(str(options.camera_file))
        sensor = Sensor(camera, marker_map, sigmas=options.sigmas)
        return LivePerception(sensor, Feed(lambda: _fitting(pictures_from(source), (camera,)), paced=paced))

    if options.camera_file is not None or second is None or len(eye.cameras) != len((source, second)):
        raise InputError(
            f"--rig {options.rig}: needs two cameras, the pictures of the second by --second, and no --camera-file"
        )

    both = [str(source), str(second)]
    feed = Feed(lambda: _fitting(_together(both), eye.cameras), paced=paced)
    return LivePerception(Sensor(eye, marker_map, sigmas=options.sigmas), feed)


def _together(sources: Sequence[str]) -> Iterator[Picture]:
    """Yield the pictures of the first source, each with those that the others took at the same time."""
    for first, *others in pictures_together(sources):
        yield replace(first, others=tuple(others))


def _fitting(pictures: Iterator[Picture], cameras: Sequence[Camera]) -> Iterator[Picture]:
    """Yield the pictures; raise an error at the first one whose size does not fit its camera."""
    for picture in pictures:
        for each, camera in zip((picture, *picture.others), cameras, strict=True):
            check_size(each.pixels, camera, each.name)
        yield picture


def _vehicle(options: SessionOptions, problem: Problem) -> SimulatedVehicle:
    vehicle = load_vehicle(options.vehicle or find_vehicle(problem.name))
    if options.camera_file is None and options.map_file is None:
        return vehicle
    raise InputError(
        "--simulated takes camera and map from its file (see --vehicle): leave out --camera-file and --map"
    )


def _recorded(options: SessionOptions, problem: Problem) -> SimulatedVehicle:
    """Return the vehicle with which a record is shown: a simulated one, or the camera and map given in the options."""
    if options.camera_file is None or options.map_file is None:
        return _vehicle(options, problem)

    camera = Camera.load(options.camera_file)
    marker_map = MarkerMap.load(options.map_file)
    return SimulatedVehicle(
        camera, marker_map, {}, marker_map.T_base_camera or orbit_pose(np.zeros(3), *DEFAULT_CAMERA_POSE)
    )


def _simulated(vehicle: SimulatedVehicle, problem: Problem) -> SimulatedCamera:
    return SimulatedCamera(
        vehicle.camera, vehicle.marker_map, problem.robot, problem.world.scene, vehicle.places,
        vehicle.T_base_camera, fixed=vehicle.structure is not None,
    )  # fmt: skip


def _line_arm(problem: Problem, address: str, option: str = "--arm") -> LineArm:
    return LineArm(problem.robot, *address_of(address, option))


def address_of(text: str, option: str) -> tuple[str, int]:
    """Return host and port of an address.

    Raises:
        InputError: If it is none.
    """
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdecimal() or not 0 < int(port) <= LAST_PORT:
        raise InputError(f"{option} {text}: expected HOST:PORT, for example 127.0.0.1:5600")
    return host.strip("[]"), int(port)


def _replay(options: SessionOptions, problem: Problem, file: Path) -> OpenSession:
    """Open the replay of a record, with its own pictures if they were recorded."""
    vehicle = _recorded(options, problem)
    entries = entries_for(file, problem.name, problem.robot, vehicle.marker_map)

    start, seed = start_of(entries, problem.start)
    arm = RecordedArm(problem.robot, start)
    structure = _structure(vehicle)
    pictures = RecordedPictures(beside(file)) if beside(file).exists() else None

    perception = RecordedPerception(entries, arm, _simulated(vehicle, problem), structure, pictures)
    session = Session(problem, arm, seed=seed, past=True, recorded=True, structure=structure)
    return OpenSession(Engine(session, perception), (perception.close,))
