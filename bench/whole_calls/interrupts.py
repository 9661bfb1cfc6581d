"""How soon Ctrl-C ends what a user waits for: calls of the library, and commands.

Each is interrupted at random moments. What counts is the processor time from the signal to the exception, or to the end
of the command: the wall's clock would count what else the machine does.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from bench.shared.clocks import of_process
from bench.shared.run import Run
from bench.speed.machine import machine
from rrtik_bench.report.page import Report
from rrtik_ompl import Roadmap, load_problem, plan, shorten

WANTED = 50.0  # [ms]
TIMES = 20  # that each call is interrupted
TIMES_OF_COMMANDS = 6
INTERRUPTED = 130  # exit code
TRIES = 10  # to catch a call that ends by itself
CLOSED = """version: 1
robot: {point2d: {radius: 0.1, bounds: [[0, 10], [0, 10]]}}
scene: {obstacles: [{name: wall, box: [1, 30, 1], pose: {xyz: [5, 5, 0]}}]}
start: {joints: [1, 1]}
goal: {joints: [9, 9]}
"""


def calls(closed: Path) -> dict[str, tuple[Callable[[], object], float]]:
    """What to interrupt, and up to when [s]."""
    walled, arm = load_problem(closed), load_problem("titan4_sdu")
    several = plan(arm, "fastrrtconnect", seed=1).path
    moves = plan(arm, "bicrdt", seed=1).path
    assert several is not None
    assert moves is not None
    found: dict[str, tuple[Callable[[], object], float]] = {
        f"plan(problem, '{name}')": (partial(plan, walled, name, seconds=60.0, seed=1), 0.3)
        for name in ("auto", "fastrrtconnect", "bicrdt", "roadmap", "RRTConnect", "RRTstar")
    }
    found["shorten(path)"] = (partial(shorten, several, arm), 0.02)
    found["shorten(path), single-joint moves"] = (partial(shorten, moves, arm), 0.2)
    found["Roadmap.grow()"] = (partial(Roadmap(arm.world).grow, 10**6, seconds=60.0), 0.3)
    return found


def seconds_to_end(call: Callable[[], object], delay: float) -> float | None:
    """Processor time from Ctrl-C to the exception [s]; None if the call had ended by itself."""
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(delay, interrupt)
    ended = False
    try:
        timer.start()
        call()
        ended = True
        timer.join()
        time.sleep(0.01)
    except KeyboardInterrupt:
        taken = time.process_time() - sent[0]
        timer.join()
        return None if ended else taken
    return None


def of_calls(report: Report, closed: Path) -> None:
    """Calls in this process."""
    rng, rows = np.random.default_rng(1), []
    for name, (call, longest) in calls(closed).items():
        caught: list[float] = []
        for _ in range(TRIES * TIMES):
            taken = seconds_to_end(call, rng.uniform(0.0, longest))
            caught += [] if taken is None else [1e3 * taken]
            if len(caught) == TIMES:
                break
        rows.append([name, str(len(caught)), f"{np.median(caught):.1f}", f"{max(caught):.1f}"])
        report.bar(f"Ctrl-C in {name}: most", f"{WANTED:g} ms", f"{max(caught):.1f} ms", max(caught) <= WANTED)
    report.table("Calls", ["", "interrupted", "median [ms]", "most [ms]"], rows)


def of_commands(report: Report, closed: Path, folder: Path) -> None:
    """Commands, from the signal to the end of the process; of `rrtik bench` the process that keeps the books."""
    commands = {
        "rrtik plan": ["plan", str(closed), "--seconds", "60"],
        "rrtik bench": ["bench", "quick", "--runs", "1000"],
    }
    rng, rows = np.random.default_rng(2), []
    for name, words in commands.items():
        taken, codes = [], set()
        for number in range(TIMES_OF_COMMANDS):
            own = words if name == "rrtik plan" else [*words, "--out", str(folder / f"runs{number}")]
            script = [sys.executable, "-c", "from rrtik_ompl.cli.entry import main; main()", *own]
            process = subprocess.Popen(script, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(rng.uniform(3.0, 9.0))
            before = of_process(process.pid)
            os.kill(process.pid, signal.SIGINT)  # send_signal would first take away one that ended by itself
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
            taken.append(1e3 * (of_process(process.pid) - before))
            codes.add(process.wait())
        rows.append([name, str(len(taken)), ", ".join(map(str, sorted(codes))), *(f"{f(taken):.1f}" for f in _BOTH)])
        held = max(taken) <= WANTED and codes == {INTERRUPTED}
        report.bar(f"Ctrl-C in {name}: most", f"{WANTED:g} ms", f"{max(taken):.1f} ms", held)
    report.table("Commands", ["", "interrupted", "exit code", "median [ms]", "most [ms]"], rows)


_BOTH = (np.median, max)


def main(run: Run) -> Report:
    """Interrupt."""
    warnings.simplefilter("ignore")
    report = run.report("Interruptions")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        closed = folder / "closed.yaml"
        closed.write_text(CLOSED, encoding="utf-8")
        of_calls(report, closed)
        of_commands(report, closed, folder)
    report.note("Where", machine())
    return report
