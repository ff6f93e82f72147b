"""Drive many jobs, in processes of their own, each at most once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed

from motionserver.evaluate.tune.cache import ResultCache, key_of
from motionserver.evaluate.tune.outcome import Job, Outcome, run
from motionserver.evaluate.worker_pool import worker_pool

Progress = Callable[[str, int, int], None]
"""Called with what is being done, drives done, drives in all."""


def drive_all(
    jobs: Sequence[Job],
    cache: ResultCache,
    processes: int,
    label: str,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Outcomes of all jobs in their order; what is in the cache is not driven again.

    The result depends neither on the number of processes nor on what finishes first.

    Args:
        jobs: What to drive.
        cache: What is known already; new outcomes are put there at once.
        processes: That drive at the same time; 0 drives in this one.
        label: Of this part of the work.
        progress: Called at the beginning and after every drive.
    """
    keys = [key_of(job) for job in jobs]
    missing = {k: job for k, job in zip(keys, jobs, strict=True) if cache.get(k) is None}
    done = len(jobs) - len(missing)
    if progress is not None:
        progress(label, done, len(jobs))
    for key, outcome in _run(missing, processes):
        cache.put(key, outcome, f"{missing[key].tuning.algorithm} {missing[key].stretch.name}")
        done += 1
        if progress is not None:
            progress(label, done, len(jobs))
    found = [cache.get(key) for key in keys]
    return [outcome for outcome in found if outcome is not None]


def _run(jobs: dict[str, Job], processes: int) -> Iterator[tuple[str, Outcome]]:
    if processes == 0 or not jobs:
        for key, job in jobs.items():
            yield key, run(job)
        return
    with worker_pool(min(processes, len(jobs))) as pool:
        keys = {pool.submit(run, job): key for key, job in jobs.items()}
        for future in as_completed(keys):
            yield keys[future], future.result()
