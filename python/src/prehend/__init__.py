"""Differentiable rigid-contact simulation and rendering, and pose refinement of objects held in a robot hand.

Lengths are in m, angles in rad, times in s, masses in kg; arrays are NumPy's, in double precision.
"""

from . import datasets
from ._prehend import Error, Link, Robot, Rollout, Shape, World, contact_laws, joint_laws
from ._prehend import (
    Frame,
    Hand,
    Mesh,
    Object,
    Rig,
    Tracker,
    example_frame,
    example_sequence,
    methods,
    refine_batch,
)
from ._version import __version__
from .columns import ANGULAR_VELOCITY, POSITION, QUATERNION, VELOCITY
from .evaluation import Scores, calibrate, evaluate
from .pullback import Pullback, vjp
from .refinement import Estimate, Tracked, refine

__all__ = [
    "ANGULAR_VELOCITY",
    "POSITION",
    "QUATERNION",
    "VELOCITY",
    "Error",
    "Estimate",
    "Frame",
    "Hand",
    "Link",
    "Mesh",
    "Object",
    "Pullback",
    "Rig",
    "Robot",
    "Rollout",
    "Scores",
    "Shape",
    "Tracked",
    "Tracker",
    "World",
    "__version__",
    "calibrate",
    "contact_laws",
    "datasets",
    "evaluate",
    "example_frame",
    "example_sequence",
    "joint_laws",
    "methods",
    "refine",
    "refine_batch",
    "vjp",
]
