"""Blocks of frames on a Ray cluster: what is handed to workers, what they do, and what is done where one is lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import ray
from numpy.typing import NDArray
from ray.exceptions import (
    LocalRayletDiedError,
    NodeDiedError,
    ObjectLostError,
    OutOfMemoryError,
    WorkerCrashedError,
)

from ._prehend import Rig
from .datasets import Bop

__all__ = ["Job", "Source", "blocks_of", "open_dataset", "outcomes"]

AHEAD = 1000
"""Blocks handed to the cluster and not yet done, at most: enough for all its cores, and for an autoscaler to see that more are wanted."""

LOST = (WorkerCrashedError, NodeDiedError, OutOfMemoryError, LocalRayletDiedError, ObjectLostError)
"""What Ray raises for a block whose process or node, or whose result with it, is gone."""


class Source(NamedTuple):
    """Where frames come from, and how they are refined: the same for all of a run."""

    dataset: str
    split: str | None
    rig: str | None
    seed: int
    method: str
    iterations: int | None
    threads: int
    run: int
    """Tells calls apart: a worker serves many, and files may change between them."""


class Job(NamedTuple):
    """A row to be refined."""

    row: int
    """Its place in the results file."""
    ids: tuple[int, int, int, int]
    pose: NDArray[np.float64]
    """4 × 4, or hypotheses of n × 4 × 4."""


class Block(NamedTuple):
    """Rows of one scene that a worker does in one go."""

    jobs: list[Job]
    losses: int = 0
    """How often a worker was lost that did just this."""


def blocks_of(jobs: list[Job], size: int) -> Iterator[Block]:
    """Scene by scene, because a worker that changes from one to another has to open it."""

    def scene(job: Job) -> int:
        return job.ids[0]

    for _, group in groupby(sorted(jobs, key=scene), key=scene):
        together = list(group)
        for k in range(0, len(together), size):
            yield Block(together[k : k + size])


def outcomes(
    source: Source, blocks: Iterator[Block], tries: int
) -> Generator[list[dict[str, Any]], None, None]:
    """The journal's entries of blocks as they are done: exactly one for each row, however many workers are lost.

    Tasks and not actors: they wait for no particular process or node to come back. And not retried by Ray, which knows nothing of the frames of a block, and by default tries
    for ever what runs out of memory.
    """
    remote = ray.remote(_refine_block).options(
        name="refine",
        num_cpus=source.threads,
        max_retries=0,
        # As many threads as cores; without it each worker would have a thread for every core of its node.
        runtime_env={"env_vars": {"RAYON_NUM_THREADS": str(source.threads)}},
    )
    again: deque[Block] = deque()
    pending: dict[ray.ObjectRef[list[dict[str, Any]]], Block] = {}
    try:
        while True:
            while len(pending) < AHEAD:
                block = again.popleft() if again else next(blocks, None)
                if block is None:
                    break
                pending[remote.remote(source, block.jobs)] = block
            if not pending:
                return
            [ref], _ = ray.wait(list(pending))
            block = pending.pop(ref)
            try:
                entries = ray.get(ref)
            except LOST as error:
                losses = block.losses + 1
                if len(block.jobs) > 1:
                    again.extend(Block([job]) for job in block.jobs)
                elif losses < tries:
                    again.append(Block(block.jobs, losses))
                else:
                    reason = str(error).strip().splitlines()[0]
                    text = f"given up after {losses} lost workers; of the last: {reason}"
                    yield [{"index": block.jobs[0].row, "error": text}]
            else:
                yield entries
    finally:
        for ref in pending:
            ray.cancel(ref, force=True)


@lru_cache(maxsize=1)
def _scene(source: Source, scene: int) -> Bop:
    """The dataset for frames of one scene. It keeps what it has read, tens of megabytes for each thousand frames, and so is opened anew for the next scene."""
    return open_dataset(source)


def open_dataset(source: Source) -> Bop:
    """The dataset, corrected by the rig."""
    rig = None if source.rig is None else Rig.load(source.rig)
    return Bop(source.dataset, source.split, rig=rig, seed=source.seed)


def _refine_block(source: Source, jobs: list[Job]) -> list[dict[str, Any]]:
    """What a worker does: the journal's entries of some rows of one scene."""
    dataset = _scene(source, jobs[0].ids[0])
    with ThreadPoolExecutor(source.threads) as threads:
        return list(threads.map(partial(_refine, source, dataset), jobs))


def _refine(source: Source, dataset: Bop, job: Job) -> dict[str, Any]:
    try:
        frame = dataset.frame(*job.ids)
        estimate = frame.refine(job.pose, method=source.method, iterations=source.iterations)
    except (KeyboardInterrupt, SystemExit):
        raise
    # A panic of the extension is no Exception.
    except BaseException as error:
        return {"index": job.row, "error": str(error) or repr(error)}
    return {
        "index": job.row,
        "pose": estimate.pose[:3].ravel().tolist(),
        "score": estimate.probability,
        "warnings": estimate.warnings,
    }
