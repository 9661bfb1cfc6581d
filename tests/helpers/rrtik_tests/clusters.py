"""A Dask cluster on this machine, for tests."""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

DASK = (sys.executable, "-m", "dask")
OWN = ("--host", "127.0.0.1", "--no-dashboard")


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a scheduler and workers, whose working directory is a folder, and kill all of them at the end.

    Yields:
        The address of the scheduler, and the processes of the workers.
    """
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    scheduler = _started(folder, "scheduler", "--port", str(port))
    started = [_started(folder, "worker", address, "--nthreads", "1", "--no-nanny") for _ in range(workers)]
    try:
        _wait_for_workers(address, workers)
        yield address, started
    finally:
        for process in (scheduler, *started):
            process.kill()
            process.wait()


def _started(folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    command = [*DASK, *arguments, *OWN]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)


def _wait_for_workers(address: str, count: int) -> None:
    from distributed import Client

    with Client(address, timeout=60) as client:
        client.wait_for_workers(count, timeout=60)
