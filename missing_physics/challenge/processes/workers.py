"""Many cases at once: by threads of this process, or through dask by the workers of a scheduler.

Each step is a process of its own anyhow, which is what a worker that dies must not cost more than. So threads
start these processes here: nothing that is hidden goes through a socket, or to the disk when memory is short.
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

#: Seconds within which a scheduler has to answer.
PATIENCE = 20
#: Cases that wait at a scheduler for each thread of its workers, the one under way included.
AHEAD = 2


class Work:
    """Cases of one step.

    Attributes:
        step: which.
        hidden: folders that a diagnosis must not see.
        workers, scheduler: as in `Settings`.
        tag: of this challenge, so that two on one scheduler have nothing in common.
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
    """Outcomes of `cases` (name and files) as they come; files are read only when their turn is near."""
    return _on_cluster(work, cases) if work.scheduler else _here(work, cases)


def _here(work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]) -> Iterator[tuple[str, Outcome]]:
    begin(work.tag)
    pool = ThreadPoolExecutor(work.workers)
    under_way: dict[Future[Outcome], str] = {}
    try:
        for name, files in cases:
            under_way[pool.submit(carry_out, work.step, files, hidden=work.hidden, tag=work.tag)] = name
            if len(under_way) > work.workers:
                yield from _finished(under_way)
        while under_way:
            yield from _finished(under_way)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if under_way:
            end_all(work.tag)
            pool.shutdown(wait=True)


def _finished(under_way: dict[Future[Outcome], str]) -> Iterator[tuple[str, Outcome]]:
    done, _ = wait(under_way, return_when=FIRST_COMPLETED)
    for future in done:
        yield under_way.pop(future), future.result()


def _on_cluster(
    work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
) -> Iterator[tuple[str, Outcome]]:
    names: dict[Any, str] = {}
    with _remote(work) as client:
        from distributed import as_completed

        room = AHEAD * max(1, sum(client.nthreads().values()))
        queue = as_completed([])

        def submit(name: str, files: Mapping[str, bytes]) -> None:
            # No `retries`: what ends by itself would end like this again. How many workers may die of a case
            # is the scheduler's own `allowed-failures`, three unless it was started otherwise.
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
            _left(client, names, work.tag)


def _left(client: Any, names: Mapping[Any, str], tag: str) -> None:
    """Nothing of this challenge stays at work, whatever ended it, unless the scheduler itself is gone."""
    with suppress(Exception):
        if names:
            client.cancel(list(names), force=True)
            client.run(end_all, tag)


def _result(future: Any) -> Outcome:
    """The outcome; a case whose workers died again and again has failed, and no other.

    Whatever else goes wrong on a cluster says nothing about the case.
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
    """A client of the scheduler that somebody else started."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs dask: install it with `pip install 'missing-physics[cluster]'`."
        ) from None
    try:
        client = Client(work.scheduler, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no dask scheduler answers at {work.scheduler} ({error}); check --scheduler."
        ) from None
    with client:
        yield client
