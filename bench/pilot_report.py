"""Measure the acceptance rows of the pilot's tool without a page, and write them as Markdown.

Usage: ``python bench/pilot_report.py [--quick] [--out bench/reports/pilot.md]``
"""

from __future__ import annotations

import argparse
import asyncio
import json
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pinocchio as pin
import tornado.websocket
from acceptance import Report

import rrtik_ompl as rrtik
from rrtik_ompl.collision.solids import hull, is_mesh
from rrtik_ompl.ik.closed_form import solutions
from rrtik_ompl.overlay.augment import Augmenter
from rrtik_ompl.overlay.gods_eye import eye_at
from rrtik_ompl.path import JointPath
from rrtik_ompl.pilot.arm import SimulatedArm, joint_rates
from rrtik_ompl.pilot.clearance import executions, free_rows
from rrtik_ompl.pilot.lamps import AMBER, GREEN, RED, lamps, stage_poses
from rrtik_ompl.pilot.manoeuvre import judge_move
from rrtik_ompl.pilot.route import STEADY, Route, route_to
from rrtik_ompl.pilot.run import Loop
from rrtik_ompl.pilot.scenario import find_scenario, load_scenario
from rrtik_ompl.pilot.server import PilotServer
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.setup import Wanted, open_session
from rrtik_ompl.pilot.surroundings import Surroundings
from rrtik_ompl.poses import pose
from rrtik_ompl.scene import Obstacle
from rrtik_ompl.sensing.scene_from_view import SeenObject
from rrtik_ompl.sensing.synthetic_camera import published_camera
from rrtik_ompl.shapes import Box

PROBLEM = rrtik.load_problem("titan4_sdu")
ROBOT, WORLD = PROBLEM.robot, PROBLEM.world
VALVE = load_scenario(find_scenario("titan4_sdu")).marker_map.named("valve")
PLACE = load_scenario(find_scenario("titan4_sdu")).places["valve"]
REACTION, OVERSHOOT, REPLANNING = 0.3, np.deg2rad(1.0), 2.0


def seen_at(T: Any) -> SeenObject:
    return SeenObject(VALVE, T, 1e-8 * np.eye(6), None)


# --- the session -------------------------------------------------------------------------------------------------


def scripted_scenario(report: Report) -> None:
    """From the first picture to the grasp by commands alone, then the record once more."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "session.jsonl"
        first, modes = _drive(file)
        again = open_session(Wanted("titan4_sdu", replay=file)).engine
        again.look(1e6)
        same = np.array_equal(again.session.q, first) and again.session.mode == "manoeuvre"
    report.bar("scripted scenario without a page, all states", "visited", ", ".join(modes), len(modes) == 4)
    report.bar("its record, replayed", "same end", "same end" if same else "another end", same)


def _drive(record: Path) -> tuple[Any, list[str]]:
    opened = open_session(Wanted("titan4_sdu", record=record))
    engine, now, modes = opened.engine, 0.0, ["manoeuvre"]
    session = engine.session
    engine.look(now)
    for command in ({"name": "grasp", "type": "aslant", "level": 1}, {"name": "plan"}, {"name": "accept"}):
        now += 0.1
        engine.obey(command, now)
        modes.append(session.mode)
    while session.mode == "following" and now < 600.0:
        if session.arm.moving is None:
            engine.obey({"name": "next"}, now)
        now += 0.5
        engine.look(now)
    q = session.q
    opened.close()
    return q, list(dict.fromkeys(modes))


def color_logic(report: Report, count: int) -> None:
    """Every lamp against all branches of the closed form, looked at one by one."""
    rng, wrong, colors = np.random.default_rng(0), 0, {GREEN: 0, AMBER: 0, RED: 0}
    surroundings = Surroundings(WORLD)
    for _ in range(count):
        turn = pin.exp3(rng.normal(0.0, 0.5, 3))
        T = pin.SE3(turn @ PLACE.rotation, rng.uniform([0.9, -0.6, -0.2], [1.6, 0.8, 0.8]))
        surroundings.see([seen_at(T)])
        world, holding = surroundings.world, surroundings.holding("valve")
        for lamp in lamps(world, VALVE, T, PROBLEM.start, holding=holding):
            stages = stage_poses(T, VALVE.grasp(lamp.type), lamp.level)
            wrong += lamp.color != _exhaustive(stages, (world, holding, holding))
            colors[lamp.color] += 1
    text = f"{wrong} wrong of {sum(colors.values())} ({', '.join(f'{n} {c}' for c, n in colors.items())})"
    report.bar(f"colours of {count} random object poses against exhaustive IK", "0 wrong", text, wrong == 0)


def _exhaustive(stages: Any, worlds: Any) -> str:
    color = GREEN
    for stage, world in zip(stages, worlds, strict=True):
        found = solutions(ROBOT, stage.homogeneous[None])
        rows = [row for row in found.branches[0][found.valid[0]] if ROBOT.within_limits(row[None]).all()]
        if not rows:
            return RED
        if not any(world.valid(row) for row in rows):
            color = AMBER
    return color


# --- routes ------------------------------------------------------------------------------------------------------


def routes(report: Report, count: int) -> list[Route]:
    """Routes of the panel scene, from where the session starts, and how long each takes."""
    engine = open_session(Wanted("titan4_sdu")).engine
    for k in range(5):
        engine.look(k / 30.0)
    session, found, seconds = engine.session, [], []
    green = [(lamp.type, lamp.level) for lamp in session.lamps() if lamp.color == GREEN]
    for number in range(count + 1):
        kind, level = green[number % len(green)]
        session.seed = number
        session.command("grasp", 1.0, type=kind, level=level)
        begin = time.perf_counter()
        session.command("plan", 1.0)
        seconds.append(time.perf_counter() - begin)
        if session.route is not None:
            found.append(session.route)
    median, late = np.quantile(seconds[1:], [0.5, 0.95])
    text = f"median {median:.3f} s, 95 % {late:.3f} s, {len(found)} of {count + 1} found"
    report.bar("plan to list of moves, two attempts and clearance included", "<= 0.2 s median", text, median <= 0.2)
    report.bar("the same against the published 1.08 s", "<= 1.08 s median", f"{median:.3f} s", median <= 1.08)
    one = all(route.path.one_joint_at_a_time for route in found)
    report.bar("every move turns one joint", "always", "always" if one else "not always", one)
    return found


def small_errors(report: Report, count: int) -> None:
    """Routes between random free postures, executed with errors: those without a warning must stay free."""
    rng, steady, warned, free = np.random.default_rng(1), 0, 0, []
    while steady + warned < count:
        ends = rng.uniform(ROBOT.lower, ROBOT.upper, (2, ROBOT.dof))
        if not WORLD.valid_batch(ends).all():
            continue
        route = route_to(WORLD, ends[0], ends[1], joint_rates(ROBOT), seed=steady + warned)
        if isinstance(route, str):
            continue
        if route.steady < STEADY:
            warned += 1
            continue
        steady += 1
        made = executions(route.path, np.full(ROBOT.dof, OVERSHOOT), 1000, rng)
        free.append(float(free_rows(WORLD, made).mean()))
    mean = float(np.mean(free))
    text = f"{100 * mean:.2f} % on the mean, {100 * min(free):.1f} % the worst of {steady} routes; {warned} warned of"
    report.bar("executions with +-1 deg a move that stay free, 1000 of each route not warned of", ">= 99 %", text,
               mean >= 0.99)  # fmt: skip


def preventive_checks(report: Report, count: int) -> None:
    """Random commands of one joint from random free postures; what is accepted is looked at a second time."""
    rng = np.random.default_rng(2)
    starts = rng.uniform(ROBOT.lower, ROBOT.upper, (4 * count, ROBOT.dof))
    starts = starts[WORLD.valid_batch(starts)][:count]
    ends, joints = starts.copy(), rng.integers(ROBOT.dof, size=len(starts))
    width = 1.2 * (ROBOT.upper - ROBOT.lower)
    middle = 0.5 * (ROBOT.upper + ROBOT.lower)
    ends[np.arange(len(ends)), joints] = (middle + rng.uniform(-0.5, 0.5, ends.shape) * width)[
        np.arange(len(ends)), joints
    ]
    accepted = ROBOT.within_limits(ends)
    accepted[accepted] = WORLD.motion_valid_batch(starts[accepted], ends[accepted])
    some = rng.choice(len(starts), size=min(1000, len(starts)), replace=False)
    verdicts = [judge_move(WORLD, starts[k], int(joints[k]), float(ends[k, joints[k]])).allowed for k in some]
    agree = bool((np.array(verdicts) == accepted[some]).all())
    beyond = int((~ROBOT.within_limits(ends[accepted])).sum())
    fine = WORLD.refined(4.0).motion_valid_batch(starts[accepted], ends[accepted])
    chosen = rng.choice(np.flatnonzero(accepted), size=min(500, int(accepted.sum())), replace=False)
    share = np.linspace(0.0, 1.0, 25)[:, None, None]
    looks = (starts[chosen] + share * (ends[chosen] - starts[chosen])).reshape(-1, ROBOT.dof)
    apart = WORLD.certify(looks)
    bad = beyond + int((~fine).sum()) + int((~apart).sum())
    text = (
        f"{bad} ({accepted.sum()} of {len(starts)} accepted; {len(some)} through judge_move "
        f"{'agree' if agree else 'DISAGREE'}; {len(looks)} looks by the independent check)"
    )
    report.bar("accepted beyond limits or into collision, random commands", "0", text, bad == 0 and agree)


def simulated_pilot(report: Report, count: int) -> None:
    """The same hands following the list, and a multi-joint route joint by joint in their order."""
    rng, rates, rows = np.random.default_rng(3), joint_rates(ROBOT), []
    for seed in range(count):
        route = route_to(WORLD, np.array(PROBLEM.start), np.array(PROBLEM.goal.q), rates, seed)
        several = rrtik.plan(PROBLEM, "RRTConnect", seconds=5.0, seed=seed).path
        if isinstance(route, str) or several is None:
            continue
        rows.append([*_piloted(route.path, rates, rng), *_piloted(_naive(several), rates, rng)])
    list_time, list_hits, naive_time, naive_hits = np.mean(rows, axis=0)
    guided = np.array([_guided(seed, rates, rng) for seed in range(2 * count)])
    tool_time, tool_hits, plans = guided.mean(axis=0)
    moves = f"{tool_time:.0f} s, of {len(guided)} executions, against {naive_time:.0f} s, of {len(rows)} routes"
    report.bar("simulated pilot: time with the tool", "<= 50 % of naive order",
               f"{100 * tool_time / naive_time:.0f} % ({moves})", tool_time <= 0.5 * naive_time)  # fmt: skip
    text = f"{100 * tool_hits:.1f} % of executions touch something, {100 * naive_hits:.1f} % in naive order"
    report.bar("simulated pilot: collisions with the tool", "<= 10 % of naive order", text,
               tool_hits <= 0.1 * naive_hits)  # fmt: skip
    report.note(
        "Simulated pilot",
        f"From the bay to the button. Reaction {REACTION} s a move, overshoot N(0, 1 deg) at its end, usual rates. "
        "With the tool the pilot makes the next move of the list, corrects it while it is short of its end, and plans "
        f"anew where the tool says that the arm is off the route or the rest of it blocked: {plans:.1f} times "
        f"on the mean, {REPLANNING:g} s each. The bare list, never checked on the way, takes {list_time:.0f} s, and "
        f"{100 * list_hits:.0f} % of its executions touch something.",
    )


def _guided(seed: int, rates: Any, rng: np.random.Generator) -> tuple[float, float, float]:
    """One execution with the tool: seconds, whether something was touched, and how often a route was planned anew."""
    arm = SimulatedArm(ROBOT, PROBLEM.start, rates)
    session = Session(PROBLEM, arm, seed=seed)
    session.command("plan", 0.0)
    session.command("accept", 0.0)
    seconds, touched, plans = 0.0, False, 0
    for _ in range(200):
        if session.mode == "manoeuvre" and session.message == "all moves are done":
            break
        if "replan" in session.message:
            plans, seconds = plans + 1, seconds + REPLANNING
            session.command("replan", seconds)
            session.command("accept", seconds)
        session.command("next", seconds)
        if arm.moving is None:
            continue
        before, after = arm.read(), session.desired.copy()
        joint = arm.moving
        after[joint] += rng.normal(0.0, OVERSHOOT)
        after = ROBOT.clamp(after)
        touched |= not WORLD.motion_valid(before, after)
        seconds += REACTION + abs(after[joint] - before[joint]) / rates[joint]
        arm.move(joint, float(after[joint]))
        arm.advance(1e3)
        session.tick(seconds)
    return seconds, float(touched), float(plans)


def _naive(path: JointPath) -> JointPath:
    """Each edge of a multi-joint route as moves of joint 1, joint 2, and so on."""
    rows = [path.waypoints[0]]
    for goal in path.waypoints[1:]:
        for joint in range(path.waypoints.shape[1]):
            row = rows[-1].copy()
            row[joint] = goal[joint]
            if abs(row[joint] - rows[-1][joint]) > 1e-9:
                rows.append(row)
    return path.with_waypoints(np.array(rows))


def _piloted(path: JointPath, rates: Any, rng: np.random.Generator) -> tuple[float, float]:
    """Seconds that an execution takes, and the share of executions that touch something."""
    names, moves = list(path.joint_names), path.moves()
    seconds = sum(REACTION + abs(move.change) / rates[names.index(move.joint)] for move in moves)
    made = np.tile(path.start, (100, len(moves) + 1, 1))
    for number, move in enumerate(moves, start=1):
        made[:, number:, names.index(move.joint)] = move.end + rng.normal(0.0, OVERSHOOT, (100, 1))
    return seconds, 1.0 - float(free_rows(WORLD, made).mean())


# --- pictures and time -------------------------------------------------------------------------------------------


def frame_loop(report: Report) -> None:
    """States with all lamps worked out anew for an object that moves in every picture; then whole steps."""
    engine = open_session(Wanted("titan4_sdu")).engine
    engine.look(0.0)
    times = []
    for k in range(60):
        place = PLACE * pose([0.004 * (k % 2), 0.0, 0.0])
        begin = time.perf_counter()
        engine.session.see([seen_at(place)], 0.1 + k / 30.0)
        engine.state()
        times.append(time.perf_counter() - begin)
    rate = 1.0 / float(np.median(times[1:]))
    report.bar("state, lamps anew, the object moving in every picture", ">= 30 Hz", f"{rate:.0f} Hz", rate >= 30.0)
    rows = []
    for name, act in (
        ("simulate, detect, pose, world", lambda k: engine.look(10.0 + k / 30.0)),
        ("state", lambda _: engine.state()),
        ("camera picture, JPEG", lambda _: engine.camera_picture()),
        ("outside picture, JPEG", lambda _: engine.outside_picture(anew=True)),
    ):
        begin, cpu = time.perf_counter(), time.process_time()
        for k in range(40):
            act(k)
        rows.append([name, f"{25 * (time.process_time() - cpu):.1f}", f"{25 * (time.perf_counter() - begin):.1f}"])
    report.table("One step of the loop [ms]", ["stage", "processor", "clock"], rows)


def click_to_color(report: Report, count: int) -> None:
    """From a command at the WebSocket until the state that answers it has come back."""
    ready, ended, server = threading.Event(), threading.Event(), PilotServer()

    def serve() -> None:
        opened = open_session(Wanted("titan4_sdu"))
        with server:
            ready.set()
            Loop(opened.engine, server).run(ended.is_set)
        opened.close()

    thread = threading.Thread(target=serve)
    thread.start()
    ready.wait(60)
    delays, states = asyncio.run(_clicks(server, count))
    ended.set()
    thread.join()
    median, late = np.quantile(1e3 * np.array(delays), [0.5, 0.95])
    report.bar("from a click on a lamp to its state, over the WebSocket", "< 50 ms median",
               f"median {median:.0f} ms, 95 % {late:.0f} ms of {count}", median < 50.0)  # fmt: skip
    report.bar("states a second meanwhile, with a page that is served", ">= 30", f"{states:.0f}", states >= 30.0)


async def _clicks(server: PilotServer, count: int) -> tuple[list[float], float]:
    socket = await tornado.websocket.websocket_connect(f"ws://127.0.0.1:{server.port}/ws?page=bench")
    rng, delays, states, begin = np.random.default_rng(4), [], 0, time.perf_counter()
    sent, number, pause = 0.0, 0, time.perf_counter() + 1.0
    while len(delays) < count:
        if time.perf_counter() > pause and not sent:
            number, sent = number + 1, time.perf_counter()
            words = {"name": "grasp", "type": "aslant", "level": number % 3, "seq": number}
            await socket.write_message(json.dumps(words))
        message = await socket.read_message()
        if isinstance(message, bytes):
            await socket.write_message('{"shown": "frame"}')
            continue
        said = json.loads(message)
        if said["kind"] != "state":
            continue
        await socket.write_message('{"shown": "state"}')
        states += 1
        if sent and number in said["answered"].values():
            delays.append(time.perf_counter() - sent)
            sent, pause = 0.0, time.perf_counter() + rng.uniform(0.05, 0.1)
    rate = states / (time.perf_counter() - begin)
    socket.close()
    return delays, rate


def registration(report: Report, count: int) -> None:
    """Small boxes drawn into the picture, against the outline of their corners projected one by one."""
    camera, rng, away = published_camera(), np.random.default_rng(5), []
    augmenter = Augmenter(ROBOT, camera)
    T = eye_at([1.2, 0.2, 0.1], 1.3, np.deg2rad(-150), np.deg2rad(25))
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
    text = f"mean {np.mean(away):.3f} px, worst {max(away):.3f} px of {count} boxes"
    report.bar("drawn against projected directly", "< 1 px", text, max(away) < 1.0)


def hulls(report: Report) -> None:
    """Links of UR5 as given and as convex hulls."""
    robot, rows, fewer, outside = rrtik.load_robot("ur5"), [], [], 0.0
    import coal

    for body in robot.visual.geometryObjects:
        mesh = body.geometry
        if not is_mesh(mesh):
            continue
        points = np.array(mesh.vertices())
        convex = hull(points)
        kept = np.array([convex.point(k) for k in range(convex.num_points)]) if hasattr(convex, "point") else np.array(
            convex.points()
        )  # fmt: skip
        outside = max(outside, _outside(kept, points))
        fewer.append(1.0 - len(kept) / len(np.unique(points, axis=0)))
        ratio = _time(coal, mesh, points) / _time(coal, convex, points)
        rows.append([body.name, str(len(np.unique(points, axis=0))), str(len(kept)), f"{ratio:.1f}"])
    report.table("Hulls of the links of UR5", ["link", "vertices", "of the hull", "collision checks faster by"], rows)
    text = f"{100 * min(fewer):.0f} to {100 * max(fewer):.0f} % fewer"
    report.bar("hulls: vertices", ">= 80 % fewer", text, min(fewer) >= 0.8)
    report.bar("hulls: original vertices outside", "<= 1e-9 m", f"{outside:.1e} m", outside <= 1e-9)


def _outside(kept: Any, points: Any) -> float:
    from scipy.spatial import ConvexHull

    equations = ConvexHull(kept).equations
    return float(max((points @ equations[:, :3].T + equations[:, 3]).max(), 0.0))


def _time(coal: Any, geometry: Any, points: Any) -> float:
    rng, box, here = np.random.default_rng(6), coal.Box(0.05, 0.05, 0.05), coal.Transform3s()
    size = 2.0 * np.ptp(points, axis=0)
    places = [coal.Transform3s(np.eye(3), points.mean(axis=0) + rng.uniform(-0.5, 0.5, 3) * size) for _ in range(300)]
    begin = time.process_time()
    for place in places:
        coal.collide(geometry, here, box, place, coal.CollisionRequest(), coal.CollisionResult())
    return time.process_time() - begin


def main() -> None:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of every count")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "pilot.md")
    options = parser.parse_args()
    part = 10 if options.quick else 1
    report = Report("The pilot's tool, measured without a page", "python bench/pilot_report.py")
    scripted_scenario(report)
    color_logic(report, 1000 // part)
    found = routes(report, 60 // part)
    head = f"{np.mean([len(r.path.moves()) for r in found]):.1f} moves, {np.mean([r.seconds for r in found]):.0f} s"
    warned = f"{sum(r.steady < STEADY for r in found)} of {len(found)} are warned of"
    text = f"On the mean {head}; {warned}: with errors of 1 deg a move more than 1 of 100 executions touches something."
    report.note("Routes on the panel", text)
    small_errors(report, 60 // part)
    preventive_checks(report, 100_000 // part)
    simulated_pilot(report, 40 // part)
    frame_loop(report)
    click_to_color(report, 100 // part)
    registration(report, 200 // part)
    hulls(report)
    options.out.write_text(report.markdown(), encoding="utf-8")
    print(report.markdown())


if __name__ == "__main__":
    main()
