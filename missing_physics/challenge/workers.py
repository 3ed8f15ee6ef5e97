"""Many cases at once: processes of this machine, or the workers of a dask scheduler."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any

from missing_physics.challenge.stage import ATTEMPTS, Outcome, Step, begin, carry_out, end_all
from robot_model import InputError

__all__ = ["Work", "carried_out"]

#: Seconds within which a scheduler has to answer.
PATIENCE = 20


class Work:
    """Cases of one step.

    Attributes:
        step: which.
        hidden: folders that a diagnosis must not see.
    """

    def __init__(self, step: Step, *, hidden: Sequence[str] = (), workers: int = 0, scheduler: str = ""):
        self.step: Step = step
        self.hidden = tuple(hidden)
        self.workers = workers or os.cpu_count() or 1
        self.scheduler = scheduler


def carried_out(
    work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
) -> Iterator[tuple[str, Outcome]]:
    """Outcomes of `cases` (name and files) as they come; files are read only when their turn is near."""
    return _on_cluster(work, cases) if work.scheduler else _here(work, cases)


def _here(work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]) -> Iterator[tuple[str, Outcome]]:
    begin()
    pool = ThreadPoolExecutor(work.workers)
    under_way: dict[Future[Outcome], str] = {}
    try:
        for name, files in cases:
            under_way[pool.submit(carry_out, work.step, files, hidden=work.hidden)] = name
            if len(under_way) > work.workers:
                yield from _finished(under_way)
        while under_way:
            yield from _finished(under_way)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if under_way:
            end_all()
            pool.shutdown(wait=True)


def _finished(under_way: dict[Future[Outcome], str]) -> Iterator[tuple[str, Outcome]]:
    done, _ = wait(under_way, return_when=FIRST_COMPLETED)
    for future in done:
        yield under_way.pop(future), future.result()


def _on_cluster(
    work: Work, cases: Iterator[tuple[str, Mapping[str, bytes]]]
) -> Iterator[tuple[str, Outcome]]:
    client = _client(work.scheduler)
    try:
        from distributed import as_completed

        def submitted(name: str, files: Mapping[str, bytes]) -> Any:
            # `retries` is for workers that die; the names keep equal inputs apart.
            return client.submit(
                *(carry_out, work.step, files),
                hidden=work.hidden,
                key=f"{work.step}-{name}",
                pure=False,
                retries=ATTEMPTS,
            )

        names: dict[str, str] = {}
        queue = as_completed([])
        for name, files in cases:
            future = submitted(name, files)
            names[future.key] = name
            queue.add(future)
        for future in queue:
            yield names[future.key], _result(future)
            future.release()
    finally:
        client.close()


def _result(future: Any) -> Outcome:
    """The outcome; a case whose workers died again and again has failed, and no other."""
    try:
        found: Outcome = future.result()
        return found
    except Exception as error:
        return Outcome("failed", {}, f"{type(error).__name__}: {error}", ATTEMPTS, 0.0)


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs dask: install it with `pip install 'missing-physics[cluster]'`."
        ) from None
    try:
        return Client(address, timeout=PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"no dask scheduler answers at {address} ({error}); check --scheduler.") from None
