"""Reverse mode through rollouts, with NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._prehend import Rollout
from .state import Gradient, Run, State


@dataclass(frozen=True, eq=False)
class Pullback:
    """A run of a rollout, which carries derivatives by it back to its inputs. Call it as often as wanted."""

    rollout: Rollout
    run: Run
    state: State
    parameters: ArrayLike | dict[str, Any] | None
    controls: ArrayLike | None

    def __call__(self, adjoints: Run) -> Gradient:
        """The derivatives of a number by the inputs, from those by the arrays of the run, or by those at its end; None is zero."""
        return self.rollout.pullback(
            self.run, adjoints, self.state, self.parameters, self.controls
        )


def vjp(
    rollout: Rollout,
    state: State,
    parameters: ArrayLike | dict[str, Any] | None = None,
    controls: ArrayLike | None = None,
) -> tuple[Run, Pullback]:
    """The run of a rollout, with steps + 1 in front of its arrays, and its pullback.

    >>> import numpy as np, prehend
    >>> model = prehend.Model()
    >>> ball = model.add_body("ball", prehend.Shape.ball(0.1))
    >>> throw = model.rollout(0.1, 5, parameters=["gravity.z"])
    >>> run, pullback = prehend.vjp(throw, model.neutral_state())
    >>> by_height = np.zeros_like(run.bodies[-1])
    >>> by_height[ball, 2] = 1.0
    >>> round(float(pullback(prehend.Run(bodies=by_height)).parameters[0]), 6)
    0.125
    """
    # Copies: whoever changes inputs or the run in place changes no derivative.
    own = State(*map(_copy, state))
    others = _copy(parameters), _copy(controls)
    run = rollout(own, *others)
    kept = Run(State(*map(_copy, run.state)), _copy(run.bodies))
    return run, Pullback(rollout, kept, own, *others)


def _copy(given: Any) -> Any:
    if isinstance(given, dict):
        return {name: _copy(own) for name, own in given.items()}
    return None if given is None else np.array(given, dtype=np.float64)
