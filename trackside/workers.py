"""Where jobs run: here one after the other, on all cores, or on a cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

from dialogue import TracksideError, UsageError


@dataclass(frozen=True)
class Failure:
    """Why a job gave no result."""

    why: str


Job = TypeVar("Job")
Outcome = TypeVar("Outcome")
Work = Callable[[Job], Outcome | Failure]
"""Does a job and raises nothing; both can be sent to another process."""
Done = Iterator[tuple[Job, Outcome | Failure]]
Runner = Callable[[Sequence[Job]], Done[Job, Outcome]]
"""Runs jobs and gives each with its outcome, in the order in which they are done."""

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL", "NUMBA")}
"""Environment of a process that is one of many on a machine."""
CONNECT_S = 10
ENDED = 130
"""Exit code of a process that was asked to end."""


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def chosen_runner(
    work: Work[Job, Outcome], workers: int | None, scheduler: str | None, flag: str
) -> Runner[Job, Outcome]:
    """The runner that a command's words ask for; `flag` names the one that gives `workers`.

    None for both: all cores of this machine. Raises `UsageError` where both are given.
    """
    if scheduler is not None:
        if workers is not None:
            raise UsageError(f"{flag} is for this machine; the workers of --scheduler are its own")
        return lambda jobs: on_cluster(jobs, scheduler, work)
    count = workers or cores()
    if count == 1:
        return lambda jobs: one_after_the_other(jobs, work)
    return lambda jobs: on_cores(jobs, count, work)


def one_after_the_other(jobs: Sequence[Job], work: Work[Job, Outcome]) -> Done[Job, Outcome]:
    """All in this process."""
    for job in jobs:
        yield job, work(job)


def on_cores(jobs: Sequence[Job], workers: int, work: Work[Job, Outcome]) -> Done[Job, Outcome]:
    """In processes of their own, which each use one thread.

    A job that ends its process (out of memory, a crash in a library) is a failure of its own: what
    was at hand then is run again, one job at a time.
    """
    waiting = list(jobs)
    with _one_thread_each():
        while waiting:
            unfinished = []
            with _pool(min(workers, len(waiting))) as pool:
                futures: dict[Future[Outcome | Failure], Job] = {}
                for job in waiting:
                    futures[pool.submit(_one, work, job)] = job
                for future in as_completed(futures):
                    try:
                        yield futures[future], future.result()
                    except BrokenProcessPool:
                        unfinished.append(futures[future])
            # Jobs are begun in their order; a pool holds some more than it has processes.
            left = [job for job in waiting if any(job is one for one in unfinished)]
            at_hand = left[: 2 * workers + 1]
            waiting = left[len(at_hand) :]
            yield from ((job, _alone(job, work)) for job in at_hand)


def on_cluster(jobs: Sequence[Job], address: str, work: Work[Job, Outcome]) -> Done[Job, Outcome]:
    """On the workers of a dask scheduler; they must see the sessions under the same paths.

    Raises `UsageError` without the extra `cluster`, `TracksideError` when no scheduler answers.
    """
    try:
        from distributed import Client
        from distributed import as_completed as as_dask_completes
    except ImportError as err:
        raise UsageError(
            "--scheduler needs dask: pip install 'trackside[cluster]', here and on the workers"
        ) from err
    try:
        client = Client(address, timeout=CONNECT_S)  # type: ignore[no-untyped-call]  # dask's
    except (OSError, ValueError, TimeoutError) as err:
        raise TracksideError(
            f"--scheduler {address}: no scheduler answered in {CONNECT_S} s ({err}); expected an "
            "address as tcp://10.0.0.5:8786 that dask scheduler prints"
        ) from err
    with client:
        futures = {client.submit(work, job, pure=False): job for job in jobs}
        for future in as_dask_completes(futures):  # type: ignore[no-untyped-call]  # dask's
            error = future.exception()
            told = Failure(f"the worker: {type(error).__name__}: {error}") if error else None
            yield futures[future], told or future.result()


def _alone(job: Job, work: Work[Job, Outcome]) -> Outcome | Failure:
    with _pool(1) as pool:
        try:
            future: Future[Outcome | Failure] = pool.submit(_one, work, job)
            return future.result()
        except BrokenProcessPool:
            return Failure("its process died (out of memory, or a crash in a library)")


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that are told to end when the block is left before its time, as by Ctrl-C."""
    before = multiprocessing.active_children()
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_end_when_told)
    try:
        yield pool
    except BaseException:
        for process in multiprocessing.active_children():
            if process not in before:
                process.terminate()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


_AT_WORK = threading.Event()
"""Set in a process of a pool while it does a job."""


def _end_when_told() -> None:
    """Ctrl-C and the parent's word end this process; what is at hand clears up before."""
    told = threading.Event()

    def end(*_: object) -> None:
        if not _AT_WORK.is_set():
            # The pool's own code would take an exception for the outcome of a job, and go on.
            os._exit(ENDED)
        if not told.is_set():
            told.set()
            raise SystemExit(ENDED)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)


def _one(work: Work[Job, Outcome], job: Job) -> Outcome | Failure:
    try:
        _AT_WORK.set()
        return work(job)
    except SystemExit:
        os._exit(ENDED)
    finally:
        _AT_WORK.clear()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that start within use one thread each, as all cores are taken."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
