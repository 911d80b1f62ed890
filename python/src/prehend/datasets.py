"""Datasets in BOP's format, and poses in its results files.

>>> from prehend.datasets import Bop, read_results
>>> dataset = Bop("path/to/dataset")                                  # doctest: +SKIP
>>> poses = read_results("init.csv")                                  # doctest: +SKIP
>>> frames = [dataset.frame(*row.ids) for row in poses]               # doctest: +SKIP
>>> prehend.refine_batch(frames, [row.pose for row in poses])         # doctest: +SKIP
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._prehend import Dataset, Error, Frame

__all__ = ["Bop", "Result", "read_results", "read_hypotheses", "write_results"]


class Bop(Dataset):
    """A split of a BOP dataset, `test` or the only one if none is named: its images, and beside them hand, touch and truth where it has them.

    Iterating yields a `Frame` for each of `targets`, with its mask empty where there is no file of one. Objects and hands are prepared once, and corrected
    by `rig`, if one is given. `detections` is a file of BOP's detections that masks come from, in place of `mask_visib/`. Files are read when they are needed.
    """

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(*target) for target in self.targets())

    def __len__(self) -> int:
        return len(self.targets())

    def targets(self) -> list[tuple[int, int, int, int]]:
        """What is to be found, by the numbers of scene, image, object and mask: what the dataset lists (test_targets_bop19.json), or the only object
        in all images, or else all that `scene_gt.json` says is there.
        """
        try:
            listed: list[tuple[int, int, int, int]] = self._listed()
            return listed
        except Error as error:
            found: list[tuple[int, int, int, int]] = []
            for scene in self.scenes:
                for image in self.images(scene):
                    try:
                        truth = self.truth(scene, image)
                    except Error:
                        raise error from None
                    found += [(scene, image, truth[k][0], k) for k in range(len(truth))]
            return found

    def true_pose(self, frame: Frame) -> NDArray[np.float64]:
        """The true pose of the object of a frame of this dataset, 4 × 4, camera ← object [m]; the first, if an image shows several of it."""
        if frame.ids is None:
            raise Error("the frame is of no dataset")
        scene, image, wanted = frame.ids
        truth: list[tuple[int, NDArray[np.float64]]] = self.truth(scene, image)
        poses = [pose for number, pose in truth if number == wanted]
        if not poses:
            raise Error(f"scene {scene} image {image}: there is no object {wanted}")
        return poses[0]


class Result(NamedTuple):
    """A row of a results file: the pose of an object in an image."""

    scene: int
    image: int
    object: int
    pose: NDArray[np.float64]
    """4 × 4, camera ← object [m]."""
    score: float = 1.0
    """The higher, the better."""
    time: float = -1.0
    """Spent on the whole image [s]; -1 if unknown."""
    instance: int = 0
    """Which of the image's rows it is: the number of its mask, where the image has several. Not part of the file."""

    @property
    def ids(self) -> tuple[int, int, int, int]:
        """The numbers of scene, image, object and mask, as `Bop.frame` takes them."""
        return self.scene, self.image, self.object, self.instance


COLUMNS = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"]


def read_results(path: str | os.PathLike[str]) -> list[Result]:
    """The rows of a results file (scene_id,im_id,obj_id,score,R,t,time; R row-major, t in mm; with a header or without). A row that
    cannot be read is an error that names its line."""
    results: list[Result] = []
    seen: dict[tuple[int, int], int] = {}
    with open(path, newline="", encoding="utf-8-sig") as file:
        for line, row in enumerate(csv.reader(file, quoting=csv.QUOTE_NONE), start=1):
            cells = [cell.strip() for cell in row]
            if not cells or (line == 1 and cells[0] == COLUMNS[0]):
                continue
            try:
                scene, image, number = (int(cell) for cell in cells[:3])
                score, time = float(cells[3]), float(cells[6])
                pose = np.eye(4)
                pose[:3, :3] = np.array(cells[4].split(), dtype=float).reshape(3, 3)
                pose[:3, 3] = np.array(cells[5].split(), dtype=float).reshape(3) / 1000.0
            except (IndexError, ValueError) as error:
                raise Error(f"{os.fspath(path)}: line {line}: {error}") from None
            instance = seen.get((scene, image), 0)
            seen[scene, image] = instance + 1
            results.append(Result(scene, image, number, pose, score, time, instance))
    return results


def read_hypotheses(path: str | os.PathLike[str], poses: Sequence[Result]) -> list[NDArray[np.float64]]:
    """Hypotheses of each pose, camera ← object [m], as `prehend initial --search` writes them: n × 4 × 4, the pose itself first, or 4 × 4 for a pose that
    comes from no search. `Frame.refine` takes either.

    A file of hypotheses is a results file in which the rows of a pose follow each other: first the pose itself. A row that is neither a pose nor after one of the same object
    and image is an error.
    """

    def key(row: Result) -> tuple[int, int, int, bytes]:
        return row.scene, row.image, row.object, row.pose.tobytes()

    places: dict[tuple[int, int, int, bytes], list[int]] = {}
    for place, pose in enumerate(poses):
        places.setdefault(key(pose), []).append(place)
    found: dict[int, list[NDArray[np.float64]]] = {}
    current: int | None = None
    for row in read_results(path):
        if free := places.get(key(row)):
            current = free.pop(0)
            found[current] = [row.pose]
        elif current is not None and poses[current].ids[:3] == row.ids[:3]:
            found[current].append(row.pose)
        else:
            target = f"scene {row.scene} image {row.image} object {row.object}"
            raise Error(f"{os.fspath(path)}: {target}: neither a pose to be refined nor after such a one")
    return [np.stack(found[k]) if k in found else pose.pose for k, pose in enumerate(poses)]


def write_results(path: str | os.PathLike[str], results: Iterable[Result]) -> None:
    """Writes rows to a results file, with every digit."""
    lines = [",".join(COLUMNS)]
    for row in results:
        pose = np.asarray(row.pose, dtype=float)
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise Error(f"scene {row.scene} image {row.image}: the pose is no finite matrix of 4 × 4")
        rotation = " ".join(repr(float(x)) for x in pose[:3, :3].ravel())
        place = " ".join(repr(float(x)) for x in pose[:3, 3] * 1000.0)
        ids = f"{row.scene},{row.image},{row.object}"
        lines.append(f"{ids},{float(row.score)!r},{rotation},{place},{float(row.time)!r}")
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    beside.replace(target)
