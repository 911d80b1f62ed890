"""How a long run goes, on standard error."""

from __future__ import annotations

import sys
import time

__all__ = ["Progress"]


class Progress:
    """A line on standard error: on a terminal one that changes, elsewhere a new one each minute."""

    def __init__(self, total: int, before: int) -> None:
        """Of a run of `total` rows, of which so many were done `before`."""
        self._total, self._before = total, before
        self._start = time.monotonic()
        self._terminal = sys.stderr.isatty()
        self._next = 0.0

    def show(self, done: int, failed: int) -> None:
        """Says how many rows are refined and have failed, if it is time to, or if they are all."""
        now = time.monotonic()
        last = done + failed == self._total
        if now < self._next and not last:
            return
        self._next = now + (0.5 if self._terminal else 60.0)
        rate = (done + failed - self._before) / max(now - self._start, 1e-9)
        left = (self._total - done - failed) / max(rate, 1e-9)
        text = f"{done} of {self._total} refined, {failed} failed, {rate:.1f}/s, {left / 60:.0f} min left"
        if self._terminal:
            print(f"\r{text:79}", end="\n" if last else "", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)
