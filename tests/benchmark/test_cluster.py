"""Campaigns on a cluster: workers that are killed, a scheduler that does not answer."""

import pytest

from rrtik_ompl.benchmark.campaign import run_campaign
from rrtik_ompl.benchmark.suite import load_suite
from rrtik_ompl.cli.app import run
from rrtik_tests.campaigns import found
from rrtik_tests.clusters import cluster

pytestmark = pytest.mark.slow


def test_a_scheduler_that_does_not_answer_is_one_line(suite, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    monkeypatch.setattr("rrtik_ompl.many.spread.CONNECT", 0.3)
    assert run(["bench", str(suite), "--out", str(tmp_path), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("rrtik: scheduler tcp://127.0.0.1:9: no Dask scheduler answers")


def test_a_worker_of_a_cluster_is_killed_and_no_run_is_lost(campaign, suite, tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install 'rrtik-ompl[cluster]'")
    with cluster(tmp_path) as (address, workers):
        done = []

        def kill_one(progress, record):
            done.append(record)
            if len(done) == 6:
                workers[0].kill()

        run_campaign(load_suite(suite), tmp_path / "out", scheduler=address, on_run=kill_one)
    assert found(tmp_path / "out") == found(campaign)
