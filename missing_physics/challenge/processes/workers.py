"""Cases in parallel: by threads of this process, or through dask by the workers of a scheduler.

Each step is a process of its own, so that the death of a worker affects only one case. Local threads
start these processes, so that the hidden physics passes neither through a socket nor to the disk.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from itertools import islice
from typing import Any

from missing_physics.challenge.processes.stage import ATTEMPTS, Outcome, Step, begin, carry_out, end_all
from robot_model import InputError

__all__ = ["Work", "carried_out"]

#: Time limit for the answer of a scheduler [s].
ANSWER_TIME = 20
#: Cases queued at a scheduler per thread of its workers, including the running one.
QUEUED = 2


class Work:
    """Cases of one step.

    Attributes:
        step: name of the step.
        hidden: folders that a diagnosis must not see.
        workers, scheduler: as in `Settings`.
        tag: identifies this challenge among others on one scheduler.
    """

    def __init__(
        self,
        step: Step,
        *,
        hidden: Sequence[str] = (),
        workers: int = 0,
        scheduler: str = "",
        tag: str = "",
    ):
        self.step: Step = step
        self.tag = tag
        self.hidden = tuple(hidden)
        self.workers = workers or os.cpu_count() or 1
        self.scheduler = scheduler


def carried_out(
    work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
) -> Iterator[tuple[str, Outcome]]:
    """Outcomes of `cases` (name and files) in the order of completion; files are read just in time."""
    return _on_cluster(work, cases) if work.scheduler else _local(work, cases)


def _local(work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]) -> Iterator[tuple[str, Outcome]]:
    begin(work.tag)
    pool = ThreadPoolExecutor(work.workers)
    running: dict[Future[Outcome], str] = {}
    try:
        for name, files in cases:
            running[pool.submit(carry_out, work.step, files, hidden=work.hidden, tag=work.tag)] = name
            if len(running) > work.workers:
                yield from _finished(running)
        while running:
            yield from _finished(running)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if running:
            end_all(work.tag)
            pool.shutdown(wait=True)


def _finished(running: dict[Future[Outcome], str]) -> Iterator[tuple[str, Outcome]]:
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    for future in done:
        yield running.pop(future), future.result()


def _on_cluster(
    work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
) -> Iterator[tuple[str, Outcome]]:
    names: dict[Any, str] = {}
    with _remote(work) as client:
        from distributed import as_completed

        room = QUEUED * max(1, sum(client.nthreads().values()))
        queue = as_completed([])

        def submit(name: str, files: Mapping[str, bytes]) -> None:
            # No `retries`: a step that ended by itself would end the same way again. How many workers may die
            # per case is set by the scheduler's `allowed-failures`, three by default.
            words = {"hidden": work.hidden, "tag": work.tag}
            key = f"{work.step}-{name}-{work.tag}"
            future = client.submit(carry_out, work.step, files, **words, key=key, pure=False)
            names[future] = name
            queue.add(future)

        try:
            for name, files in islice(cases, room):
                submit(name, files)
            for future in queue:
                name = names.pop(future)
                outcome = _result(future)
                future.release()
                for following in islice(cases, 1):
                    submit(*following)
                yield name, outcome
        finally:
            _cancel(client, names, work.tag)


def _cancel(client: Any, names: Mapping[Any, str], tag: str) -> None:
    """Cancel the remaining work of this challenge, if the scheduler still runs."""
    with suppress(Exception):
        if names:
            client.cancel(list(names), force=True)
            client.run(end_all, tag)


def _result(future: Any) -> Outcome:
    """The outcome; only a case whose workers died repeatedly has failed.

    Other errors of a cluster do not concern the case.
    """
    from distributed import KilledWorker

    try:
        found: Outcome = future.result()
        return found
    except KilledWorker as error:
        return Outcome("failed", {}, f"{type(error).__name__}: {error}", ATTEMPTS, 0.0)
    except Exception as error:
        return Outcome("stopped", {}, f"the cluster says {type(error).__name__}: {error}", 1, 0.0)


@contextmanager
def _remote(work: Work) -> Iterator[Any]:
    """A client of a running scheduler."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs dask: install it with `pip install 'missing-physics[cluster]'`."
        ) from None
    try:
        client = Client(work.scheduler, timeout=ANSWER_TIME)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no dask scheduler answers at {work.scheduler} ({error}); check --scheduler."
        ) from None
    with client:
        yield client
