"""Differentiable rigid-contact simulation and rendering, and pose refinement of objects held in a robot hand.

Lengths are in m, angles in rad, times in s, masses in kg; arrays are NumPy's, in double precision.
"""

from . import datasets, laws
from ._prehend import (
    Error,
    Frame,
    Hand,
    Link,
    Mesh,
    Model,
    Object,
    PoseLoss,
    PoseNetwork,
    Renderer,
    RenderPullback,
    Rig,
    Robot,
    Rollout,
    Shape,
    Tracker,
    ambient_light,
    contact_laws,
    example_frame,
    example_sequence,
    headlight,
    joint_laws,
    methods,
    perturb,
    refine_batch,
)
from ._version import __version__
from .columns import ANGULAR_VELOCITY, POSITION, QUATERNION, VELOCITY
from .evaluation import Scores, calibrate, evaluate
from .pullback import Pullback, vjp
from .refinement import Estimate, Tracked, refine, search
from .render import Image, LinearizedLoss, RenderGradient
from .state import Gradient, PointContacts, Run, State

__all__ = [
    "ANGULAR_VELOCITY",
    "POSITION",
    "QUATERNION",
    "VELOCITY",
    "Error",
    "Estimate",
    "Frame",
    "Gradient",
    "Hand",
    "Image",
    "LinearizedLoss",
    "Link",
    "Mesh",
    "Model",
    "Object",
    "PointContacts",
    "PoseLoss",
    "PoseNetwork",
    "Pullback",
    "RenderGradient",
    "RenderPullback",
    "Renderer",
    "Rig",
    "Robot",
    "Rollout",
    "Run",
    "Scores",
    "Shape",
    "State",
    "Tracked",
    "Tracker",
    "__version__",
    "ambient_light",
    "calibrate",
    "contact_laws",
    "datasets",
    "evaluate",
    "example_frame",
    "example_sequence",
    "headlight",
    "joint_laws",
    "laws",
    "methods",
    "perturb",
    "refine",
    "refine_batch",
    "search",
    "vjp",
]
