"""Refinement of the pose of an object held in a robot hand, from RGB-D, touch and physics.

Poses are matrices of 4 × 4 that map coordinates of the object, or of the hand's base, into those of the camera [m]: x right, y down, z forward, as OpenCV
has it.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._prehend import Frame, Hand, Mesh, Object, PoseNetwork, Rig


@dataclass(frozen=True, eq=False)
class Estimate:
    """A refined pose, and what is known of how good it is. Only the fused methods know more than the pose.

    Attributes:
        pose: 4 × 4, camera ← object [m].
        covariance: 6 × 6, of the pose's error as a small motion in the axes of the camera: first the displacement of the object's center
            (`Object.center`) along x, y, z [m], then the rotation about x, y, z through that center [rad]. The true pose is the motion applied after `pose`.
        probability: That model, data and pose are right, the last within 5 mm and 5° of the true one.
        modes: The poses that the search came upon (4 × 4), each with its share of the posterior; the first is `pose`.
        warnings: What looks wrong with object, frame and initial pose.
        fit: Probability that model and data are right, where that was asked.
        misfits: Evidence that is more probably of something else (another object, another frame, a hand that is elsewhere) than not, and how probably.
        inconsistencies: Evidence that would rather have the pose elsewhere, and by how many standard deviations beyond chance.
        scales: Errors over their nominal sizes, by group: "hand", "joints", "camera", "surface".
        model_scale: Size of the object by that of its model, and its standard deviation, where that is estimated (`noise={"model.scale": "5%"}`).
        unobservable: Standard deviations of surface motion along directions that the evidence says hardly anything of [m].
        termination: Why the search ended.
        iterations: Iterations done.
    """

    pose: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None
    probability: float | None = None
    modes: list[tuple[NDArray[np.float64], float]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    fit: float | None = None
    misfits: list[tuple[str, float]] = field(default_factory=list)
    inconsistencies: list[tuple[str, float]] = field(default_factory=list)
    scales: list[tuple[str, float]] = field(default_factory=list)
    model_scale: tuple[float, float] | None = None
    unobservable: list[float] = field(default_factory=list)
    termination: str = ""
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class Tracked:
    """What became of a frame of a `Tracker`.

    Attributes:
        pose: 4 × 4, camera ← object [m].
        status: "tracked" (from the frame before), "relocalized" (found anew), "predicted" (no time to look), or "lost"; of the last two
            the pose is where the object should be.
        covariance: As of `Estimate`, unless the pose was only predicted.
        probability: That the pose is within 5 mm and 5° of the true one, unless it was only predicted.
        modes: As of `Estimate`.
        rejection: Why tracking was rejected, if it was tried.
        iterations: Steps that lowered the cost.
        seconds: Time that it took [s].
    """

    pose: NDArray[np.float64]
    status: str
    covariance: NDArray[np.float64] | None = None
    probability: float | None = None
    modes: list[tuple[NDArray[np.float64], float]] = field(default_factory=list)
    rejection: str | None = None
    iterations: int = 0
    seconds: float = 0.0


def refine(
    rgb: ArrayLike | None,
    depth: ArrayLike | None,
    K: ArrayLike,
    mesh: Mesh | Object,
    pose: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    hand: Hand | None = None,
    hand_pose: ArrayLike | None = None,
    joints: Mapping[str, float] | ArrayLike | None = None,
    touch: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    depth_scale: float | None = None,
    lens: tuple[str, Sequence[float]] | None = None,
    rig: Rig | None = None,
    method: str = "fused",
    iterations: int | None = None,
    noise: Mapping[str, str] | None = None,
    settings: Mapping[str, Any] | str | PathLike[str] | None = None,
) -> Estimate:
    """Refines the pose of an object in one frame: the same as `Frame(rgb, depth, K, mesh, …).refine(pose, …)`.

    Camera frame: OpenCV's, x right, y down, z forward; pixel centers at integers. Python's other threads run on meanwhile. What looks wrong with the input,
    such as degrees or millimeters, is a Python warning, and in `Estimate.warnings`; the probability knows nothing of it.

    Args:
        rgb: H × W × 3 of uint8; None for depth alone.
        depth: H × W, registered to rgb; in meters, or whole numbers in units of `depth_scale` meters; 0 or not finite where missing. None for color alone.
        K: 3 × 3 [px].
        mesh: The object. A mesh is prepared anew in each call, with a mass that is assumed; make an `Object` of it to do so once.
        pose: Initial pose, 4 × 4, camera ← object [m]; or the hypotheses of a search, n × 4 × 4, the best first.
        mask: H × W, not zero on the visible part of the object. Without it, pose, depth and colors tell the object.
        hand: The hand that holds the object; it needs `hand_pose` and `joints`.
        hand_pose: 4 × 4, camera ← base of the hand [m].
        joints: Positions by name, or in the order of `hand.joints` [rad; m of prismatic ones].
        touch: taxels × 3, the force of the object on each in the frame of its link [N]; NaN where nothing is known.
        gravity: In the camera frame [m/s²].
        lens: "brown_conrady" or "kannala_brandt" and coefficients in OpenCV's order: through which the images were taken.
        rig: What corrects the frame. The object is corrected by `rig.corrected`.
        method: One of `methods()`.
        iterations: At most so many in each stage.
        noise: Sizes of errors by name, as `prehend refine --noise` has them, such as `{"hand.translation": "5mm", "model.scale": "5%"}`.
        settings: Settings of the estimator: a dict such as `{"estimator.patches.sigma": 1.5e-3}`, or the path of a TOML file, which `prehend settings` prints.

    Raises:
        Error: What is wrong with the input, or why nothing was found.

    >>> import prehend
    >>> frame, initial, truth = prehend.example_frame(1)
    >>> estimate = prehend.refine(
    ...     frame.rgb, frame.depth, frame.K, frame.object, initial, mask=frame.mask, hand=frame.hand,
    ...     hand_pose=frame.hand_pose, joints=frame.joints, touch=frame.touch, gravity=frame.gravity)
    >>> bool(np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 1e-3)
    True
    """
    frame = Frame(
        rgb,
        depth,
        K,
        mesh,
        mask=mask,
        hand=hand,
        hand_pose=hand_pose,
        joints=joints,
        touch=touch,
        gravity=gravity,
        depth_scale=depth_scale,
        lens=lens,
        rig=rig,
    )
    estimate: Estimate = frame.refine(
        pose, method=method, iterations=iterations, noise=noise, settings=settings
    )
    for text in estimate.warnings:
        warnings.warn(text, stacklevel=2)
    return estimate


def search(
    rgb: ArrayLike | None,
    depth: ArrayLike,
    K: ArrayLike,
    mesh: Mesh | Object,
    *,
    mask: ArrayLike,
    hand: Hand | None = None,
    hand_pose: ArrayLike | None = None,
    joints: Mapping[str, float] | ArrayLike | None = None,
    touch: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    depth_scale: float | None = None,
    lens: tuple[str, Sequence[float]] | None = None,
    rig: Rig | None = None,
    network: PoseNetwork | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Searches an object without any pose to begin with: the same as `Frame(rgb, depth, K, mesh, …).search(network=network)`, with arguments as of `refine`.

    Args:
        network: Network of the object, which proposes poses in place of the search.

    Returns:
        Up to four poses, n × 4 × 4, camera ← object [m], the best first, and their weights, n, which sum to 1. `refine` takes them all.

    Raises:
        Error: What is wrong with the input, or why nothing was found.
    """
    frame = Frame(
        rgb,
        depth,
        K,
        mesh,
        mask=mask,
        hand=hand,
        hand_pose=hand_pose,
        joints=joints,
        touch=touch,
        gravity=gravity,
        depth_scale=depth_scale,
        lens=lens,
        rig=rig,
    )
    found: tuple[NDArray[np.float64], NDArray[np.float64]] = frame.search(network=network)
    return found
