"""Differentiable rigid-contact simulation and rendering, and pose refinement of objects held in a robot hand.

Lengths are in m, angles in rad, times in s, masses in kg; arrays are NumPy's, in double precision.
"""

from ._prehend import Error, Link, Robot, Rollout, Shape, World, contact_laws, joint_laws
from ._version import __version__
from .columns import ANGULAR_VELOCITY, POSITION, QUATERNION, VELOCITY
from .pullback import Pullback, vjp

__all__ = [
    "ANGULAR_VELOCITY",
    "POSITION",
    "QUATERNION",
    "VELOCITY",
    "Error",
    "Link",
    "Pullback",
    "Robot",
    "Rollout",
    "Shape",
    "World",
    "__version__",
    "contact_laws",
    "joint_laws",
    "vjp",
]
