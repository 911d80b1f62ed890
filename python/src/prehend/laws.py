"""Contact laws written in Python, for trying them out.

A law is an object with a method ``law(p, contact)`` that returns the force along the normal [N], positive where it pushes the body out, and
the three components of the force across it. ``p`` are its parameters, in the order of its list ``parameters`` of names; ``contact`` has ``gap`` [m],
``normal_speed`` [m/s], ``slip`` and ``normal`` (three numbers each) and ``area`` [m²], by which forces are multiplied:

>>> class Quadratic:
...     parameters = ["stiffness", "friction"]
...
...     def law(self, p, contact):
...         normal = p[0] * contact.gap * contact.gap * contact.area
...         return normal, regularized_coulomb(p[1], normal, contact.slip, 1e-2)

Numbers may be :class:`Dual`: what carries derivatives. Write the law with arithmetic and NumPy's ``sqrt``, ``exp``, ``log``, ``sin``, ``cos``, ``tan``,
``tanh`` and ``arctan``, and its derivatives are exact. Python is called at each point of contact in each step, which takes some hundred times as
long as a law in Rust: :func:`prehend.Model.add_contact` warns of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Number = Any
"""A float or a :class:`Dual`."""


class Dual:
    """A number with its derivatives by the inputs of a law."""

    __slots__ = ("slopes", "value")

    def __init__(self, value: float, slopes: NDArray[np.float64]) -> None:
        self.value = float(value)
        self.slopes = slopes

    def _with(self, value: float, slope: float) -> Dual:
        return Dual(value, slope * self.slopes)

    def __add__(self, other: Number) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.slopes + other.slopes)
        return Dual(self.value + other, self.slopes)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slopes)

    def __pos__(self) -> Dual:
        return self

    def __sub__(self, other: Number) -> Dual:
        return self.__add__(-other)

    def __rsub__(self, other: Number) -> Dual:
        return (-self).__add__(other)

    def __mul__(self, other: Number) -> Dual:
        if isinstance(other, Dual):
            slopes = self.value * other.slopes + other.value * self.slopes
            return Dual(self.value * other.value, slopes)
        return Dual(self.value * other, other * self.slopes)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Dual:
        if isinstance(other, Dual):
            value = self.value / other.value
            return Dual(value, (self.slopes - value * other.slopes) / other.value)
        return Dual(self.value / other, self.slopes / other)

    def __rtruediv__(self, other: Number) -> Dual:
        value = other / self.value
        return self._with(value, -value / self.value)

    def __pow__(self, exponent: Number) -> Dual:
        if isinstance(exponent, Dual):
            return (self.log() * exponent).exp()
        if exponent == 0:
            return Dual(1.0, 0.0 * self.slopes)
        return self._with(self.value**exponent, exponent * self.value ** (exponent - 1))

    def __rpow__(self, base: float) -> Dual:
        return (self * float(np.log(base))).exp()

    def __abs__(self) -> Dual:
        return -self if self.value < 0 else self

    def __lt__(self, other: Number) -> bool:
        return self.value < value(other)

    def __le__(self, other: Number) -> bool:
        return self.value <= value(other)

    def __gt__(self, other: Number) -> bool:
        return self.value > value(other)

    def __ge__(self, other: Number) -> bool:
        return self.value >= value(other)

    def __float__(self) -> float:
        raise TypeError("a float would lose the derivatives of a Dual: use its value")

    def __repr__(self) -> str:
        return f"Dual({self.value}, {self.slopes})"

    def sqrt(self) -> Dual:
        """Square root."""
        root = float(np.sqrt(self.value))
        return self._with(root, 0.5 / root)

    def exp(self) -> Dual:
        """Exponential."""
        power = float(np.exp(self.value))
        return self._with(power, power)

    def log(self) -> Dual:
        """Natural logarithm."""
        return self._with(float(np.log(self.value)), 1.0 / self.value)

    def sin(self) -> Dual:
        """Sine."""
        return self._with(float(np.sin(self.value)), float(np.cos(self.value)))

    def cos(self) -> Dual:
        """Cosine."""
        return self._with(float(np.cos(self.value)), -float(np.sin(self.value)))

    def tan(self) -> Dual:
        """Tangent."""
        tangent = float(np.tan(self.value))
        return self._with(tangent, 1.0 + tangent * tangent)

    def tanh(self) -> Dual:
        """Hyperbolic tangent."""
        tangent = float(np.tanh(self.value))
        return self._with(tangent, 1.0 - tangent * tangent)

    def arctan(self) -> Dual:
        """Arc tangent."""
        return self._with(float(np.arctan(self.value)), 1.0 / (1.0 + self.value**2))


def value(number: Number) -> float:
    """The value of a number, with derivatives or without."""
    return number.value if isinstance(number, Dual) else float(number)


def sqrt(number: Number) -> Number:
    """Square root of a number, with derivatives or without."""
    return number.sqrt() if isinstance(number, Dual) else float(np.sqrt(number))


@dataclass(frozen=True)
class Contact:
    """A contact point as a law sees it. Vectors are along the axes of the body with the field."""

    gap: Number
    """Effective gap [m], negative in penetration."""
    normal_speed: Number
    """Rate of the gap [m/s], negative while approaching."""
    slip: Sequence[Number]
    """Velocity of the sample across the normal [m/s]."""
    normal: Sequence[Number]
    """Unit normal, out of the body with the field."""
    area: Number
    """Surface area that the sample stands for [m²]."""


def regularized_coulomb(
    friction: Number, normal: Number, slip: Sequence[Number], slip_scale: float
) -> list[Number]:
    """Coulomb's friction against the slip, which grows from nothing as slip / √(slip² + slip_scale²)."""
    speed = sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2] + slip_scale**2)
    return [-friction * normal * s / speed for s in slip]


def _respond(
    law: Any, numbers: tuple[float, ...], differentiate: bool
) -> list[tuple[float, NDArray[np.float64] | list[float]]]:
    """The four numbers of a law's response, with their derivatives by ``numbers`` if asked for: Rust calls this."""
    inputs: Sequence[Number] = numbers
    if differentiate:
        slopes = np.eye(len(numbers))
        inputs = [Dual(x, row) for x, row in zip(numbers, slopes, strict=True)]
    contact = Contact(inputs[0], inputs[1], inputs[2:5], inputs[5:8], inputs[8])
    normal, tangential = law.law(list(inputs[9:]), contact)
    response = [normal, *tangential]
    return [
        (x.value, x.slopes.tolist()) if isinstance(x, Dual) else (float(x), []) for x in response
    ]
