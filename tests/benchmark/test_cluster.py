"""Campaigns on a cluster: workers that are killed, a scheduler that does not answer."""

import socket
import subprocess
import sys
from contextlib import closing

import pytest

from rrtik_ompl.benchmark.campaign import run_campaign
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.cli.app import run
from rrtik_tests.campaigns import found

pytestmark = pytest.mark.slow


def test_a_scheduler_that_does_not_answer_is_one_line(suite, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    monkeypatch.setattr("rrtik_ompl.benchmark.spread.CONNECT", 0.3)
    assert run(["bench", str(suite), "--out", str(tmp_path), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("rrtik: scheduler tcp://127.0.0.1:9: no Dask scheduler answers")


def test_a_worker_of_a_cluster_is_killed_and_no_run_is_lost(campaign, suite, tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    started = [
        subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet)
    ]
    worker = [*dask, "worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    started += [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        _wait_for_workers(address, 2)
        done = []

        def kill_one(progress, record):
            done.append(record)
            if len(done) == 6:
                started[1].kill()

        run_campaign(load_suite(suite), tmp_path / "out", scheduler=address, on_run=kill_one)
    finally:
        for process in started:
            process.kill()
            process.wait()
    assert found(tmp_path / "out") == found(campaign)


def _wait_for_workers(address, count):
    from distributed import Client

    with Client(address, timeout=60) as client:
        client.wait_for_workers(count, timeout=60)
