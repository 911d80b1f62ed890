"""Refinement of datasets on a Ray cluster, https://docs.ray.io.

>>> import prehend.ray
>>> done = prehend.ray.refine_dataset("dataset", "init.csv", "refined.csv")    # doctest: +SKIP
>>> print(done)                                                                # doctest: +SKIP

Dataset, and rig if there is one, are read by all nodes and so have the same path on all of them; poses and results are files of the machine that calls.
"""

from __future__ import annotations

import hashlib
import os
import time
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import _prehend
from ._prehend import Error, refine_batch
from ._version import __version__
from .datasets import Result, read_hypotheses, read_results, write_results
from .journal import Journal
from .progress import Progress
from .ray_blocks import Job, Source, blocks_of, open_dataset, outcomes

__all__ = ["Refined", "refine_dataset"]

File = str | os.PathLike[str]


@dataclass(frozen=True)
class Refined:
    """What became of the rows of a results file."""

    count: int
    """Rows with a refined pose."""
    failures: dict[int, str] = field(default_factory=dict)
    """What is wrong with the others, by their places in the file."""
    warnings: dict[int, list[str]] = field(default_factory=dict)
    """What looks wrong with objects, frames and initial poses, by the places of their rows."""

    def __str__(self) -> str:
        return "\n".join([f"{self.count} poses refined, {len(self.failures)} failed", *self.failures.values()])


def refine_dataset(
    dataset: File,
    poses: File,
    out: File,
    *,
    split: str | None = None,
    rig: File | None = None,
    hypotheses: File | None = None,
    method: str = "fused",
    iterations: int | None = None,
    seed: int = 0,
    block_size: int = 32,
    num_cpus: int = 1,
    tries: int = 3,
    restart: bool = False,
    progress: bool = True,
) -> Refined:
    """Refines all rows of a results file over the cluster that `ray.init` has connected to, or else over one that it starts here or finds by RAY_ADDRESS.

    `out` gets the refined rows, in the order of `poses`, with the same numbers as `Frame.refine` and `prehend refine` find on one machine, whatever the cluster; scores are
    probabilities, or −1 where the method knows none, and times −1. It appears whole or not at all, once all rows are done. Until then `out` with .journal added records
    what is done: after an interruption the same call goes on from there, and ends with the same file. A row of `poses` that cannot be read ends the call before any work.

    A frame that fails is a failure of its own and the others go on. A block whose worker dies, or is on a node that is lost, is done again, each frame of it by itself;
    a frame that has lost `tries` workers by itself is a failure, too. The journal names failures, and stays where there are any: the same call then tries these alone.

    Args:
        dataset: A dataset in BOP's format.
        poses: Where to begin: a results file.
        out: The results file to write.
        split: As of `Bop`.
        rig: The file of a rig, which corrects frames and objects.
        hypotheses: The file of all poses that a search ended with; what is beside `poses`, with .hypotheses.csv added to its name, if it is there.
        method: One of `methods()`.
        iterations: At most so many in each stage.
        seed: Of the points sampled on surfaces of objects.
        block_size: Frames that a worker does in one go, all of one scene: what a lost worker costs at most. For each block a scene may have to be opened, which
            takes 0.1 to 0.3 s.
        num_cpus: Cores of a worker, which does as many frames at a time. Workers share nothing: with more cores to each, less memory is needed.
        tries: How many workers a frame may lose by itself.
        restart: Whether to discard what an interrupted call with other settings left, instead of refusing.
        progress: Whether to say on standard error how it goes.

    Raises:
        Error: What is wrong with the input, or with the dataset as a node sees it.
        OSError: If a file cannot be read or written.
    """
    for name, number in {"block_size": block_size, "num_cpus": num_cpus, "tries": tries}.items():
        if number < 1:
            raise Error(f"{name}: at least 1 is expected")
    # Of no frames, for what is wrong with method and iterations.
    refine_batch([], [], method=method, iterations=iterations)
    source = Source(
        str(Path(dataset).resolve()),
        split,
        None if rig is None else str(Path(rig).resolve()),
        seed,
        method,
        iterations,
        num_cpus,
        time.time_ns(),
    )
    open_dataset(source)
    rows = read_results(poses)
    if not rows:
        raise Error(f"{os.fspath(poses)}: no poses")
    beside = Path(f"{os.fspath(poses)}.hypotheses.csv")
    if hypotheses is None and beside.exists():
        hypotheses = beside
    starts = [row.pose for row in rows] if hypotheses is None else read_hypotheses(hypotheses, rows)
    facts = _facts(source, poses, hypotheses)
    with Journal(f"{os.fspath(out)}.journal", facts, restart=restart) as journal:
        # Failures are tried again.
        entries = {k: entry for k, entry in journal.entries.items() if "error" not in entry}
        jobs = [Job(k, row.ids, starts[k]) for k, row in enumerate(rows) if k not in entries]
        shown = Progress(len(rows), len(entries)) if progress else None
        failed = 0
        # Closed, that is, blocks that are under way are called off, whatever ends the loop.
        with closing(outcomes(source, blocks_of(jobs, block_size), tries)) as found:
            for block in found:
                journal.append(block)
                entries |= {entry["index"]: entry for entry in block}
                failed += sum("error" in entry for entry in block)
                if shown is not None:
                    shown.show(len(entries) - failed, failed)
        count = len(entries) - failed
        if count > 0:
            write_results(out, (_refined(row, entries[k]) for k, row in enumerate(rows) if "pose" in entries[k]))
        if not failed:
            journal.discard()
    of_rows = sorted(entries.items())
    failures = {k: f"{_target(rows[k])}: {entry['error']}" for k, entry in of_rows if "error" in entry}
    warnings = {k: entry["warnings"] for k, entry in of_rows if entry.get("warnings")}
    return Refined(count, failures, warnings)


def _target(row: Result) -> str:
    return f"scene {row.scene} image {row.image} object {row.object}"


def _refined(row: Result, entry: dict[str, Any]) -> Result:
    """The row with what the journal's entry says was found."""
    pose = np.eye(4)
    pose[:3] = np.reshape(entry["pose"], (3, 4))
    # A method that knows no probability keeps the score of the initial pose.
    score = row.score if entry["score"] is None else entry["score"]
    return row._replace(pose=pose, score=score, time=-1.0)


def _facts(source: Source, poses: File, hypotheses: File | None) -> dict[str, Any]:
    """What decides the results. Threads do not, and the dataset is known by its path alone: to read all of it would take too long."""

    def digest(path: File | None) -> str | None:
        if path is None:
            return None
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    facts = source._asdict()
    del facts["threads"], facts["run"]
    program = f"prehend.ray {__version__} {digest(_prehend.__file__)}"
    return facts | {"program": program, "poses": digest(poses), "hypotheses": digest(hypotheses), "rig": digest(source.rig)}
