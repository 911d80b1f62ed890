"""Poses of a dataset against its truth, and rigs learnt from its frames."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._prehend import Rig, _calibrate, _score
from .datasets import Bop, Result, read_results

Poses = Iterable[Result] | str | os.PathLike[str]
"""Rows of a results file, or its path."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Metrics of poses: errors of position (PE) and orientation (OE, and up to symmetries), ADD, ADI, BOP's MSSD, MSPD, VSD and average recall (AR), and
    contact area (CA) and intersection volume (IV) with the hand and how far they are from those of the true pose."""

    columns: list[str]
    """Names of the metrics, with units."""
    values: NDArray[np.float64]
    """Poses × metrics; NaN where there is none, for want of a hand or of depth, or of a score at all."""
    mean: dict[str, float]
    """Over the poses that have it."""
    median: dict[str, float]
    """Over the poses that have it."""
    rows: list[Result] = field(default_factory=list)
    """The poses."""
    failures: dict[int, str] = field(default_factory=dict)
    """What is wrong with those that could not be scored, by their places."""

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """One metric of all poses."""
        return self.values[:, self.columns.index(column)]

    def __str__(self) -> str:
        shown = [c for c in self.columns if not np.isnan(self.mean[c])]
        width = max(map(len, shown), default=6)
        lines = [f"{'':{width}}  {'mean':>10}  {'median':>10}"]
        lines += [f"{c:{width}}  {self.mean[c]:10.3f}  {self.median[c]:10.3f}" for c in shown]
        return "\n".join(lines)


def _rows(poses: Poses) -> tuple[list[Result], NDArray[np.float64]]:
    rows = read_results(poses) if isinstance(poses, str | os.PathLike) else list(poses)
    stacked = np.array([row.pose for row in rows], dtype=float).reshape(-1, 4, 4)
    return rows, stacked


def evaluate(dataset: Bop, poses: Poses) -> Scores:
    """Scores poses against the truth of a dataset, as `prehend eval` does. A pose that cannot be scored is in `failures`."""
    rows, stacked = _rows(poses)
    ids = [row.ids[:3] for row in rows]
    columns, values, mean, median, failures = _score(dataset, ids, stacked)
    means = dict(zip(columns, mean.tolist(), strict=True))
    medians = dict(zip(columns, median.tolist(), strict=True))
    return Scores(columns, values, means, medians, rows, dict(failures))


def calibrate(
    dataset: Bop,
    poses: Poses,
    *,
    passes: int = 6,
    window: int | None = None,
    settings: Mapping[str, Any] | str | os.PathLike[str] | None = None,
) -> Rig:
    """Learns a rig from frames of a dataset in which the poses of objects are roughly known: what camera, hand and models get wrong in all of them. As
    `prehend calibrate` has it, with up to 6 `passes` over all frames, or over each `window` of so many; `settings` are as `refine` has them.

    What is to be said of frames that disagree with the others, and were left out, or that could not be read, is a warning.
    """
    rows, stacked = _rows(poses)
    ids = [row.ids for row in rows]
    rig, left_out, failed = _calibrate(dataset, ids, stacked, passes, window, settings)
    for text in [*left_out, *failed]:
        warnings.warn(text, stacklevel=2)
    found: Rig = rig
    return found
