"""A record of what is finished, so that a run may be interrupted at any moment."""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ._prehend import Error

__all__ = ["Journal"]


class Journal:
    """An append-only file of finished entries, open for writing by one process alone.

    Its first line holds the facts that decide the results of the run, every other one an entry with the number `index`. A line counts once it is whole: what a
    killed process left of its last line is cut off when the journal is opened again.
    """

    entries: dict[int, dict[str, Any]]
    """What was there when it was opened, by `index`; the last entry of each counts."""

    def __init__(self, path: str | os.PathLike[str], facts: Mapping[str, Any], *, restart: bool = False) -> None:
        """Opens the journal of a run, made if absent. With `restart` it is emptied first, whatever it holds.

        Raises:
            Error: If it is of a run with other facts, which are named; no journal; damaged; or being written by another process.
            OSError: If it cannot be read or written.
        """
        self._path = Path(path)
        self._file: BinaryIO = open(self._path, "a+b")
        try:
            self._lock()
            if restart:
                self._file.truncate(0)
            self.entries = self._read(dict(facts))
        except BaseException:
            self._file.close()
            raise

    def append(self, entries: Iterable[Mapping[str, Any]]) -> None:
        """Adds entries, each a JSON object with its `index`, and returns when they are on disk.

        Raises:
            OSError: If they cannot be written.
        """
        text = "".join(json.dumps(entry) + "\n" for entry in entries)
        self._file.write(text.encode())
        self._file.flush()
        os.fsync(self._file.fileno())

    def discard(self) -> None:
        """Removes the journal of a run whose output is complete."""
        self._path.unlink()

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Error(f"{self._path}: another process is at work on it") from None
        except OSError as error:
            # Some network file systems have no locks.
            if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):
                raise

    def _read(self, facts: dict[str, Any]) -> dict[int, dict[str, Any]]:
        """What is whole in the file, the rest of which is cut off; a file without a whole line begins with the facts."""
        entries: dict[int, dict[str, Any]] = {}
        self._file.seek(0)
        end = 0
        for number, line in enumerate(self._file, start=1):
            if not line.endswith(b"\n"):
                break
            record = self._record(number, line)
            if number == 1:
                self._compare(record, facts)
            else:
                entries[record["index"]] = record
            end += len(line)
        self._file.truncate(end)
        if end == 0:
            self.append([facts])
        return entries

    def _record(self, number: int, line: bytes) -> dict[str, Any]:
        try:
            record = json.loads(line)
        except ValueError:
            record = None
        if not isinstance(record, dict) or (number > 1 and not isinstance(record.get("index"), int)):
            raise Error(f"{self._path}: line {number} is of no journal")
        return record

    def _compare(self, there: dict[str, Any], here: dict[str, Any]) -> None:
        names = sorted(there.keys() | here.keys())
        other = [f"{n}: {there.get(n)} | {here.get(n)}" for n in names if there.get(n) != here.get(n)]
        if other:
            listed = "\n  ".join(other)
            raise Error(
                f"{self._path}: is of another run, which is not finished (there | here):\n  {listed}\n(restart discards it)"
            )
