"""Planning on a Dask cluster: measured with a few workers, and what a thousand would do, by a simulation of queues."""

from __future__ import annotations

import heapq
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np

from bench.shared.clocks import of_process

TASKS = 60
PROBLEM = "planar3_boxes"
START, SEND = 3.0, 1e9  # [s] that a worker takes to begin; [bit/s] of the line of the one who sends
FILE = 50_000  # bytes of a problem file, which is all that a worker needs; worlds are made there, once each
LOST = 1e-5  # [1/s]: a worker is lost about once a day


@dataclass(frozen=True)
class Measured:
    """So many tasks on so many workers: wall time [s], and processor time of the scheduler and of a task [s each]."""

    workers: int
    wall: float
    scheduler: float
    task: float
    solved: int


def on_workers(workers: int) -> Measured:
    """A batch on workers of this machine."""
    from distributed import Client

    from rrtik_ompl import plan_many

    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    address, dask = f"tcp://127.0.0.1:{port}", [sys.executable, "-m", "dask"]
    own = ["--host", "127.0.0.1", "--no-dashboard"]
    with tempfile.TemporaryDirectory() as folder:
        start = partial(subprocess.Popen, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)
        scheduler = start([*dask, "scheduler", "--port", str(port), *own])
        each = [*dask, "worker", address, "--nthreads", "1", "--no-nanny", *own]
        started = [scheduler, *(start(each) for _ in range(workers))]
        try:
            with Client(address, timeout=120) as client:
                client.wait_for_workers(workers, timeout=120)
            plan_many([PROBLEM] * workers, seed=1, scheduler=address)  # kernels are loaded
            before, begin = of_process(scheduler.pid), time.perf_counter()
            plans = plan_many([PROBLEM] * TASKS, seed=1, scheduler=address)
            wall = time.perf_counter() - begin
            booked = (of_process(scheduler.pid) - before) / TASKS
        finally:
            for process in started:
                process.kill()
                process.wait()
    plain = float(np.mean([plan.seconds for plan in plans]))
    return Measured(workers, wall, booked, plain, sum(plan.found for plan in plans))


@dataclass(frozen=True)
class Simulated:
    """What a cluster would do: wall time of all tasks [s], share of the workers' time that is planning, tasks again."""

    workers: int
    wall: float
    busy: float
    again: int


def simulated(workers: int, tasks: int, task: float, booked: float, seed: int = 0) -> Simulated:
    """Tasks of some length [s] on workers, each booked by one scheduler for so long [s].

    The scheduler serves one worker after the other. Each gets the files of its problems once, over one line, when it
    begins. Workers are lost at a constant rate; what one had in hand is given out again, and another takes its place.
    """
    rng = np.random.default_rng(seed)
    ready = [(START + 8.0 * FILE * (k + 1) / SEND, k) for k in range(workers)]
    heapq.heapify(ready)
    scheduler, done, again, worked, end = 0.0, 0, 0, 0.0, 0.0
    while done < tasks:
        at, worker = heapq.heappop(ready)
        scheduler = max(scheduler, at) + booked
        length = float(rng.lognormal(np.log(task) - 0.5, 1.0))
        if rng.random() < -np.expm1(-LOST * length):
            again += 1
            heapq.heappush(ready, (scheduler + 0.5 * length + START + 8.0 * FILE / SEND, worker))
            continue
        done, worked, end = done + 1, worked + length, max(end, scheduler + length)
        heapq.heappush(ready, (scheduler + length, worker))
    return Simulated(workers, end, worked / (workers * end), again)
