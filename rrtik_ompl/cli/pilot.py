"""The command `rrtik pilot`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli import FOUND, NOT_FOUND
from rrtik_ompl.cli.terminal import ProblemName, Seed, note, progress, say

if TYPE_CHECKING:
    from rrtik_ompl.pilot.setup import OpenSession
    from rrtik_ompl.pilot.web.server import PilotServer

SOURCES = ("--camera", "--video", "--images", "--simulated", "--replay")


def pilot(
    problem: ProblemName = "",
    camera: Annotated[int | None, typer.Option(help="Number of a camera device.", min=0)] = None,
    video: Annotated[Path | None, typer.Option(help="A video file in place of a camera.")] = None,
    images: Annotated[Path | None, typer.Option(help="A folder of images, one a second.")] = None,
    simulated: Annotated[bool, typer.Option("--simulated", help="A simulated vehicle and camera.")] = False,
    vehicle: Annotated[
        Path | None, typer.Option(help="File of the simulated vehicle; a shipped one if left out.")
    ] = None,
    camera_file: Annotated[Path | None, typer.Option(help="Camera file (see: rrtik markers calibrate).")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Marker map: which marker is on which object: .yaml.")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Write the session to this file, line by line.")] = None,
    record_pictures: Annotated[
        bool, typer.Option("--record-pictures", help="Keep the pictures too, beside the record.")
    ] = False,
    second: Annotated[str | None, typer.Option(help="Camera number or film that is shown beside the first.")] = None,
    rig: Annotated[
        Path | None, typer.Option(help="File of a rig, in place of --camera-file, to use both cameras together: .yaml.")
    ] = None,
    replay: Annotated[Path | None, typer.Option(help="Play a recorded session.")] = None,
    arm: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="An arm; a simulated one if left out.")] = None,
    master: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="A master arm, whose joints the arm follows while K is held."),
    ] = None,
    conform: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Check the server of an arm, and move it a little; opens no page."),
    ] = None,
    explain: Annotated[Path | None, typer.Option(help="Tell in words what happened in a recorded session.")] = None,
    port: Annotated[int, typer.Option(help="Port of the page; 0 takes a free one.", min=0, max=65535)] = 0,
    host: Annotated[str, typer.Option(help="Address for other machines; needs --token.")] = "127.0.0.1",
    token: Annotated[str, typer.Option(help="Secret word for --host, at least 16 letters.")] = "",
    certificate: Annotated[Path | None, typer.Option(help="Serve the page by TLS with this certificate (PEM).")] = None,
    key: Annotated[Path | None, typer.Option(help="Private key of the certificate, if it is not in its file.")] = None,
    sigmas: Annotated[float, typer.Option(help="Margin of detected objects, in standard deviations; 0: none.")] = 3.0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open a browser.")] = False,
    seed: Seed = 0,
) -> int:
    """Open a page that helps a pilot drive an arm.

    It shows the camera with the arm drawn in, grasps, routes and moves. Ctrl-C ends it.
    """
    if explain is not None:
        return _explain(explain)
    if not problem:
        raise InputError("name a problem, for example: rrtik pilot titan4_sdu --simulated")
    if conform is not None:
        return _conform(problem, conform)

    given = (camera is not None, video is not None, images is not None, simulated or bool(vehicle), replay is not None)
    if sum(given) != 1 and not (sum(given) == 2 and given[3] and given[4]):
        named = [name for name, there in zip(SOURCES, given, strict=True) if there]
        raise InputError(f"one of {', '.join(SOURCES)} says where pictures come from; got {', '.join(named) or 'none'}")
    if replay is not None and (record is not None or arm is not None or master is not None):
        raise InputError("--replay shows what has happened: leave out --record, --arm and --master")

    from rrtik_ompl.pilot.setup import SessionOptions, open_session
    from rrtik_ompl.pilot.web.server import PilotServer

    source = next((each for each in (camera, video, images) if each is not None), None)
    options = SessionOptions(
        problem,
        source=source,
        vehicle=vehicle,
        camera_file=camera_file,
        map_file=map_file,
        record=record,
        record_pictures=record_pictures,
        second=_second(second),
        rig=rig,
        replay=replay,
        arm=arm,
        master=master,
        seed=seed,
        sigmas=sigmas,
    )

    server = PilotServer(port, host, token, f"rrtik pilot · {problem}", certificate=certificate, key=key)
    with progress("preparing"):
        opened = open_session(options)

    try:
        _serve(server, opened, browser=not no_browser)
    finally:
        opened.close()

    if opened.record.fault:
        raise InputError(opened.record.fault)
    if record is not None:
        say(f"wrote {record}")
    return FOUND


def _explain(record: Path) -> int:
    """Print the story of a record."""
    from rrtik_ompl.pilot.explain import explain

    for line in explain(record):
        say(line)
    return FOUND


def _conform(name: str, address: str) -> int:
    """Check the server of an arm, and print a line for each finding."""
    from rrtik_ompl.pilot.devices.conformance import Conformance
    from rrtik_ompl.pilot.setup import address_of
    from rrtik_ompl.problem_files.problem import load_problem

    checks = Conformance(load_problem(name), *address_of(address, "--conform"))
    note("the arm is moved: each joint by a degree or 2 mm, one of them for up to a second at a time")
    failed = 0
    for finding in checks.run():
        failed += not finding.held
        verdict = "held  " if finding.held else "FAILED"
        measured = f": {finding.measured}" if finding.measured else ""
        say(f"{verdict}  {finding.what}{measured}")
    say("all held" if not failed else f"{failed} failed")
    return NOT_FOUND if failed else FOUND


def _second(given: str | None) -> int | Path | None:
    """Return the number of a camera, or a file."""
    if given is None:
        return None
    return int(given) if given.isdecimal() else Path(given)


def _serve(server: PilotServer, opened: OpenSession, *, browser: bool) -> None:
    """Serve the page and run the session until Ctrl-C, watched by a watchdog."""
    from rrtik_ompl.pilot.devices.watchdog import Watchdog
    from rrtik_ompl.pilot.run import Loop

    with server:
        say(f"open {server.url} in a browser; Ctrl-C ends")
        if browser:
            import webbrowser

            webbrowser.open(server.url)

        loop = Loop(opened.engine, server)
        reports = {"the page's server": lambda: server.reported, "the session": lambda: loop.reported, **opened.reports}
        watched = Watchdog(opened.engine.session.arm, reports, tell=note)

        with suppress(KeyboardInterrupt), watched as watchdog:
            loop.fault = lambda: watchdog.fault
            loop.run()
