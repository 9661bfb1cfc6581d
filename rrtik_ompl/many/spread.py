"""Distribute jobs with joblib: over guarded processes of this machine, or over the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.many.guard import PARCEL, Closed, Guards

if TYPE_CHECKING:
    from distributed import Client


CONNECT = 10  # [s]; time limit for reaching a scheduler
# The guards of a worker of a cluster, global because a worker keeps no other state between jobs.
_here = Guards()

Job = Mapping[str, Any]
Done = dict[str, Any]


def local(jobs: Iterable[Job], count: int) -> Generator[Done, None, None]:
    """Run jobs in guarded processes of this machine, and yield their records as they are finished.

    Args:
        jobs: The jobs.
        count: Number of concurrent jobs.
    """
    from joblib import Parallel, delayed

    guards = Guards()

    def one(job: Job) -> Done | None:
        try:
            return {**job["run"], **guards.run(job)}
        except Closed:
            return None

    try:
        # Few jobs are dispatched ahead, so that a long list does not fill the memory.
        done = Parallel(n_jobs=count, backend="threading", return_as="generator_unordered", pre_dispatch="2*n_jobs",
                        batch_size=1)(delayed(one)(job) for job in jobs)  # fmt: skip
        yield from (record for record in done if record is not None)
    finally:
        guards.close()


def cluster(jobs: Iterable[Job], address: str) -> Generator[Done, None, None]:
    """Run jobs on the workers of a Dask scheduler; jobs of a lost worker are repeated by others.

    Raises:
        InputError: If Dask is not installed, the scheduler does not answer or has no workers, or a worker cannot run
            this version.
    """
    try:
        import distributed
    except ImportError:
        raise InputError("scheduler: needs Dask, which is not installed: pip install 'rrtik-ompl[cluster]'") from None

    from joblib import Parallel, delayed, parallel_config

    try:
        client: Any = distributed.Client(address, timeout=CONNECT)
    except (OSError, ValueError, TypeError) as error:
        said = str(error) or type(error).__name__
        raise InputError(f"scheduler {address}: no Dask scheduler answers: {said}") from None

    with client, _one_line(address):
        _check_workers(client, address)
        with parallel_config(backend="dask", client=client):
            # joblib sends an array that many calls have as an argument to each worker only once.
            apart = (({**job, PARCEL: None}, job.get(PARCEL)) for job in jobs)
            yield from Parallel(return_as="generator_unordered", batch_size=1)(
                delayed(_remote)(*each) for each in apart
            )


def _check_workers(client: Client, address: str) -> None:
    here = _version()
    versions = client.run(_version)
    if not versions:
        raise InputError(f"scheduler {address}: the scheduler has no workers; start some with: dask worker {address}")
    for worker, version in versions.items():
        if version != here:
            raise InputError(f"scheduler {address}: worker {worker} has rrtik-ompl {version}, here is {here}")


def _version() -> str:
    from rrtik_ompl.base.version import __version__

    return __version__


@contextmanager
def _one_line(address: str) -> Iterator[None]:
    """Convert exceptions of Dask to our own, with a message of one line."""
    try:
        yield
    except RrtikError:
        raise
    except Exception as error:
        raise InputError(f"scheduler {address}: {type(error).__name__}: {error}") from error


def _remote(job: Job, parcel: object) -> Done:
    return {**job["run"], **_here.run({**job, PARCEL: parcel})}
