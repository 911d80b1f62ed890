"""Reverse mode through rollouts, with NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._prehend import Rollout


class Gradient(NamedTuple):
    """Derivatives by the inputs of a rollout, each in the shape of its input."""

    states: NDArray[np.float64]
    parameters: NDArray[np.float64]
    controls: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pullback:
    """A run of a rollout, which carries derivatives by its states back to its inputs. Call it as often as wanted."""

    rollout: Rollout
    run: NDArray[np.float64]
    states: ArrayLike
    parameters: ArrayLike | None
    controls: ArrayLike | None

    def __call__(self, adjoints: ArrayLike) -> Gradient:
        """The derivatives of a number by the inputs, from those by the run, or by the states at its end."""
        gradient = self.rollout.pullback(
            self.run, adjoints, self.states, self.parameters, self.controls
        )
        return Gradient(*gradient)


def vjp(
    rollout: Rollout,
    states: ArrayLike,
    parameters: ArrayLike | None = None,
    controls: ArrayLike | None = None,
) -> tuple[NDArray[np.float64], Pullback]:
    """The run of a rollout, of shape (steps + 1, rows, 13), and its pullback.

    >>> import numpy as np, prehend
    >>> model = prehend.Model()
    >>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
    >>> throw = model.rollout(0.1, 5, parameters=["gravity.z"])
    >>> run, pullback = prehend.vjp(throw, model.neutral_states())
    >>> by_height = np.zeros_like(run[-1])
    >>> by_height[ball, 2] = 1.0
    >>> round(float(pullback(by_height).parameters[0]), 6)
    0.125
    """
    inputs = [None if x is None else np.array(x, dtype=np.float64) for x in (states, parameters, controls)]
    own, *others = inputs
    assert own is not None
    run = rollout(own, *others)
    # Copies: whoever changes inputs or the run in place changes no derivative.
    return run, Pullback(rollout, run.copy(), own, *others)
