from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .refinement import Estimate, Tracked
from .render import Image, LinearizedLoss, RenderGradient
from .state import Gradient, PointContacts, Run, State

_Array = NDArray[np.float64]
_Body = int | str
_Settings = Mapping[str, Any] | str | PathLike[str]
_Parameters = ArrayLike | dict[str, Any]
_Axis = _Body | tuple[_Body, int]
_Law = tuple[str, list[tuple[str, str, str]]]

class Error(ValueError): ...

def contact_laws() -> dict[str, _Law]: ...
def joint_laws() -> dict[str, _Law]: ...

class Shape:
    @staticmethod
    def ball(radius: float) -> Shape: ...
    @staticmethod
    def cuboid(
        half_extents: ArrayLike, *, rounding: float | None = None, spacing: float | None = None
    ) -> Shape: ...
    @staticmethod
    def capsule(half_height: float, radius: float, *, spacing: float | None = None) -> Shape: ...
    @staticmethod
    def cylinder(
        half_height: float,
        radius: float,
        *,
        rounding: float | None = None,
        spacing: float | None = None,
    ) -> Shape: ...
    @staticmethod
    def cone(
        half_height: float,
        radius: float,
        *,
        rounding: float | None = None,
        spacing: float | None = None,
    ) -> Shape: ...
    @staticmethod
    def convex_hull(
        points: ArrayLike, *, rounding: float | None = None, spacing: float | None = None
    ) -> Shape: ...
    @staticmethod
    def mesh(
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        spacing: float | None = None,
        cell: float | None = None,
    ) -> Shape: ...
    @staticmethod
    def mesh_file(
        path: str | PathLike[str],
        *,
        scale: float = 1.0,
        spacing: float | None = None,
        cell: float | None = None,
    ) -> Shape: ...
    @staticmethod
    def half_space(normal: ArrayLike | None = None) -> Shape: ...
    @staticmethod
    def height_field(heights: ArrayLike, scale: ArrayLike) -> Shape: ...
    @staticmethod
    def compound(
        parts: Sequence[tuple[Shape, ArrayLike]],
        *,
        rounding: float | None = None,
        spacing: float | None = None,
        cell: float | None = None,
    ) -> Shape: ...
    @property
    def dimensions(self) -> dict[str, float]: ...
    @property
    def volume(self) -> float | None: ...

class Link:
    def __new__(
        cls,
        name: str,
        joint: str = "revolute",
        *,
        axis: ArrayLike | None = None,
        parent: int | None = None,
        at: ArrayLike | None = None,
        mass: float | None = None,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        shape: Shape | None = None,
        density: float | None = None,
        armature: float = 0.0,
    ) -> Self: ...

class Robot:
    @property
    def bodies(self) -> dict[str, int]: ...
    @property
    def joints(self) -> dict[str, tuple[int, int]]: ...
    @property
    def actuators(self) -> dict[str, str]: ...
    @property
    def warnings(self) -> list[str]: ...
    def set_positions(
        self, model: Model, state: State, positions: ArrayLike | None = None
    ) -> None: ...
    @property
    def keyframes(self) -> list[str]: ...
    def reset(self, model: Model, state: State, keyframe: str | None = None) -> None: ...
    @property
    def sensors(self) -> list[str]: ...
    def sensor(self, model: Model, state: State, name: str) -> _Array: ...
    def set_mocap(self, model: Model, state: State, name: str, pose: ArrayLike) -> None: ...

class Rollout:
    @property
    def parameters(self) -> list[str]: ...
    @property
    def controls(self) -> list[str]: ...
    @property
    def neutral_state(self) -> State: ...
    @property
    def values(self) -> _Array: ...
    @property
    def steps(self) -> int: ...
    @property
    def dt(self) -> float: ...
    @property
    def bodies(self) -> list[str]: ...
    def __call__(
        self,
        state: State,
        parameters: _Parameters | None = None,
        controls: ArrayLike | None = None,
        *,
        end: bool = False,
    ) -> Run: ...
    def pullback(
        self,
        run: Run,
        adjoints: Run,
        state: State,
        parameters: _Parameters | None = None,
        controls: ArrayLike | None = None,
    ) -> Gradient: ...
    def jvp(
        self,
        inputs: tuple[State, _Parameters | None, ArrayLike | None],
        tangents: tuple[State | None, _Parameters | None, ArrayLike | None],
    ) -> tuple[Run, Run]: ...

class Model:
    def __new__(cls, gravity: ArrayLike | None = None) -> Self: ...
    def add_body(
        self,
        name: str,
        shape: Shape | None = None,
        *,
        fixed: bool = False,
        mass: float | None = None,
        density: float | None = None,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
    ) -> int: ...
    def body(self, name: str) -> int: ...
    @property
    def bodies(self) -> list[str]: ...
    @property
    def parameters(self) -> list[str]: ...
    def __getitem__(self, name: str) -> float: ...
    def __setitem__(self, name: str, value: float) -> None: ...
    def __contains__(self, name: str) -> bool: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def __copy__(self) -> Model: ...
    def __deepcopy__(self, memo: Any) -> Model: ...
    def copy(self) -> Model: ...
    def add_contact(
        self,
        samples: _Body,
        field: _Body,
        law: Any,
        *,
        smoothing: float | str | None = None,
        both_ways: bool = False,
        **parameters: float,
    ) -> dict[str, str]: ...
    def add_contacts_between(
        self,
        a: Sequence[_Body],
        b: Sequence[_Body],
        law: Any,
        *,
        smoothing: float | str | None = None,
        **parameters: float,
    ) -> dict[str, str]: ...
    def add_contacts(self, *, friction: float = 0.5, restitution: float = 0.2) -> None: ...
    def add_bushing(
        self,
        a: _Body,
        b: _Body,
        *,
        mass: float,
        inertia: float = 0.0,
        time: float = 0.01,
        frame_a: ArrayLike | None = None,
        frame_b: ArrayLike | None = None,
    ) -> dict[str, str]: ...
    def add_articulation(self, links: Sequence[Link]) -> list[int]: ...
    def add_joint_force(
        self, joint: _Axis | Sequence[tuple[_Axis, float]], law: str, **parameters: float
    ) -> dict[str, str]: ...
    def add_mjcf(
        self,
        path: str | PathLike[str],
        *,
        pose: ArrayLike | None = None,
        floating: bool = False,
        shapes: bool = True,
        partial: bool = False,
        root: str | PathLike[str] | None = None,
        allow_outside: bool = False,
    ) -> Robot: ...
    @staticmethod
    def from_mjcf(
        path: str | PathLike[str],
        *,
        pose: ArrayLike | None = None,
        floating: bool = False,
        shapes: bool = True,
        partial: bool = False,
        root: str | PathLike[str] | None = None,
        allow_outside: bool = False,
    ) -> Model: ...
    def add_urdf(
        self,
        path: str | PathLike[str],
        *,
        pose: ArrayLike | None = None,
        floating: bool = False,
        shapes: bool = True,
        partial: bool = False,
        root: str | PathLike[str] | None = None,
        allow_outside: bool = False,
        packages: Mapping[str, str | PathLike[str]] | None = None,
        inertia_from_geometry: bool = False,
    ) -> Robot: ...
    @staticmethod
    def from_urdf(
        path: str | PathLike[str],
        *,
        pose: ArrayLike | None = None,
        floating: bool = False,
        shapes: bool = True,
        partial: bool = False,
        root: str | PathLike[str] | None = None,
        allow_outside: bool = False,
        packages: Mapping[str, str | PathLike[str]] | None = None,
        inertia_from_geometry: bool = False,
    ) -> Model: ...
    @property
    def robots(self) -> list[Robot]: ...
    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def na(self) -> int: ...
    def neutral_state(self) -> State: ...
    def q_slice(self, body: _Body) -> slice: ...
    def v_slice(self, body: _Body) -> slice: ...
    def fixed_row(self, body: _Body) -> int: ...
    def set_pose(
        self,
        state: State,
        body: _Body,
        pose: ArrayLike,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None: ...
    def pose(self, state: State, body: _Body) -> _Array: ...
    def forward_kinematics(self, state: State) -> _Array: ...
    def set_joint(
        self, state: State, link: _Body, q: ArrayLike, v: ArrayLike | None = None
    ) -> None: ...
    def joint(self, state: State, link: _Body) -> tuple[Any, Any]: ...
    def contact_wrench(self, state: State, body: _Body) -> _Array: ...
    def point_contacts(self, state: State) -> PointContacts: ...
    def accelerometer(self, state: State, body: _Body, point: ArrayLike) -> _Array: ...
    def longest_step(self, state: State, integrator: str = "semi_implicit_euler") -> float: ...
    def rollout(
        self,
        dt: float,
        steps: int,
        *,
        parameters: Sequence[str] = (),
        controls: Sequence[str] = (),
        integrator: str = "adaptive",
        tolerance: float | None = None,
    ) -> Rollout: ...

class Mesh:
    def __new__(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        colors: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        texture: ArrayLike | None = None,
    ) -> Mesh: ...
    @staticmethod
    def load(path: str | PathLike[str], scale: float = 1.0) -> Mesh: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> NDArray[np.int64]: ...

class Object:
    def __new__(
        cls,
        mesh: Mesh,
        *,
        mass: float | None = None,
        density: float | None = None,
        com: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        name: str = "object",
        seed: int = 0,
    ) -> Object: ...
    @property
    def mass(self) -> float: ...
    @property
    def mesh(self) -> Mesh: ...
    @property
    def center(self) -> list[float]: ...

class Hand:
    def __new__(
        cls,
        path: str | PathLike[str],
        taxels: str | PathLike[str] | None = None,
        *,
        partial: bool = False,
        root: str | PathLike[str] | None = None,
        allow_outside: bool = False,
        packages: Mapping[str, str | PathLike[str]] | None = None,
        inertia_from_geometry: bool = False,
    ) -> Hand: ...
    @property
    def joints(self) -> list[str]: ...
    @property
    def taxels(self) -> list[str]: ...

class PoseNetwork:
    def __new__(cls, file: str | PathLike[str], *, settings: _Settings | None = None) -> PoseNetwork: ...

class Frame:
    def __new__(
        cls,
        rgb: ArrayLike | None,
        depth: ArrayLike | None,
        K: ArrayLike,
        object: Object | Mesh,
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
    ) -> Frame: ...
    @staticmethod
    def load(path: str | PathLike[str], *, rig: Rig | None = None) -> tuple[Frame, NDArray[np.float64]]: ...
    def refine(
        self,
        pose: ArrayLike,
        *,
        method: str = "fused",
        iterations: int | None = None,
        noise: Mapping[str, str] | None = None,
        settings: _Settings | None = None,
    ) -> Estimate: ...
    def search(self, *, settings: _Settings | None = None, network: PoseNetwork | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def warnings(self, pose: ArrayLike) -> list[str]: ...
    def draw(self, pose: ArrayLike) -> NDArray[np.uint8]: ...
    @property
    def rgb(self) -> NDArray[np.uint8]: ...
    @property
    def depth(self) -> NDArray[np.float32]: ...
    @property
    def mask(self) -> NDArray[np.bool_]: ...
    @property
    def K(self) -> NDArray[np.float64]: ...
    @property
    def object(self) -> Object: ...
    @property
    def hand(self) -> Hand | None: ...
    @property
    def hand_pose(self) -> NDArray[np.float64] | None: ...
    @property
    def joints(self) -> dict[str, float] | None: ...
    @property
    def touch(self) -> NDArray[np.float64] | None: ...
    @property
    def gravity(self) -> NDArray[np.float64] | None: ...
    @property
    def ids(self) -> tuple[int, int, int] | None: ...

class Rig:
    @staticmethod
    def load(path: str | PathLike[str]) -> Rig: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def corrected(self, object: Object, object_id: int) -> Object: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def objects(self) -> list[int]: ...

class Tracker:
    def __new__(
        cls,
        object: Object | Mesh,
        *,
        pose: ArrayLike | None = None,
        rig: Rig | None = None,
        budget: float | None = None,
        recovery: Literal["off", "near", "anywhere"] | None = None,
        network: PoseNetwork | None = None,
        settings: _Settings | None = None,
    ) -> Tracker: ...
    def push(self, frame: Frame, time: float) -> Tracked: ...
    def start_from(self, pose: ArrayLike) -> None: ...

class Dataset:
    def __new__(
        cls,
        path: str | PathLike[str],
        split: str | None = None,
        *,
        rig: Rig | None = None,
        detections: str | PathLike[str] | None = None,
        seed: int = 0,
    ) -> Self: ...
    @property
    def scenes(self) -> list[int]: ...
    def images(self, scene: int) -> list[int]: ...
    @property
    def objects(self) -> list[int]: ...
    def object(self, object: int) -> Object: ...
    def _listed(self) -> list[tuple[int, int, int, int]]: ...
    def frame(self, scene: int, image: int, object: int, instance: int = 0) -> Frame: ...
    def truth(self, scene: int, image: int) -> list[tuple[int, NDArray[np.float64]]]: ...

def methods() -> dict[str, str]: ...
def refine_batch(
    frames: Sequence[Frame],
    poses: ArrayLike | Sequence[ArrayLike],
    *,
    method: str = "fused",
    iterations: int | None = None,
    noise: Mapping[str, str] | None = None,
    settings: _Settings | None = None,
    threads: int | None = None,
    report: str | PathLike[str] | None = None,
) -> list[Estimate | Error]: ...
def example_frame(seed: int = 0) -> tuple[Frame, NDArray[np.float64], NDArray[np.float64]]: ...
def example_sequence(
    seed: int = 0, count: int = 10
) -> tuple[NDArray[np.float64], list[tuple[Frame, float, NDArray[np.float64]]]]: ...
def _score(
    dataset: Dataset, ids: Sequence[tuple[int, int, int]], poses: ArrayLike
) -> tuple[
    list[str], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], list[tuple[int, str]]
]: ...
def _calibrate(
    dataset: Dataset,
    ids: Sequence[tuple[int, int, int, int]],
    poses: ArrayLike,
    passes: int = 6,
    window: int | None = None,
    settings: _Settings | None = None,
) -> tuple[Rig, list[str], list[str]]: ...

_Mesh = Mesh | str | PathLike[str] | tuple[ArrayLike, ArrayLike]

def ambient_light(strength: float = 1.0) -> _Array: ...
def headlight(ambient: float = 0.5, head: float = 0.5) -> _Array: ...
def perturb(pose: ArrayLike, twist: ArrayLike, center: ArrayLike | None = None) -> _Array: ...

class RenderPullback:
    def __call__(
        self,
        color: ArrayLike | None = None,
        coverage: ArrayLike | None = None,
        depth: ArrayLike | None = None,
        normal: ArrayLike | None = None,
        *,
        each: bool = False,
    ) -> RenderGradient: ...

class Renderer:
    def __init__(
        self,
        mesh: _Mesh,
        K: ArrayLike,
        size: tuple[int, int],
        *,
        colors: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        texture: ArrayLike | None = None,
        light: ArrayLike | None = None,
        background: ArrayLike | None = None,
        mode: str = "contour",
        **settings: float,
    ) -> None: ...
    def render(
        self,
        pose: ArrayLike,
        *,
        vertices: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        texels: ArrayLike | None = None,
        light: ArrayLike | None = None,
        background: ArrayLike | None = None,
        intrinsics: ArrayLike | None = None,
    ) -> Image: ...
    def vjp(
        self,
        pose: ArrayLike,
        *,
        vertices: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        texels: ArrayLike | None = None,
        light: ArrayLike | None = None,
        background: ArrayLike | None = None,
        intrinsics: ArrayLike | None = None,
    ) -> tuple[Image, RenderPullback]: ...
    @property
    def vertices(self) -> _Array: ...
    @property
    def faces(self) -> NDArray[np.int64]: ...
    @property
    def colors(self) -> _Array | None: ...
    @property
    def texels(self) -> _Array | None: ...
    @property
    def light(self) -> _Array: ...
    @property
    def background(self) -> _Array: ...
    @property
    def intrinsics(self) -> _Array: ...
    @property
    def center(self) -> _Array: ...
    @property
    def size(self) -> tuple[int, int]: ...

class PoseLoss:
    def __init__(
        self,
        mesh: _Mesh,
        K: ArrayLike,
        image: ArrayLike,
        mask: ArrayLike,
        *,
        depth: ArrayLike | None = None,
        occluder: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        texture: ArrayLike | None = None,
        light: ArrayLike | None = None,
        color_weight: float = 1.0,
        mask_weight: float = 0.0,
        depth_weight: float = 1.0,
        depth_scale: float = 0.02,
        depth_truncation: float = ...,
        kernel: str = "squared",
        kernel_scale: float = 0.1,
        penalize_occluded: bool = False,
        samples: int = 1,
        mode: str = "contour",
        **settings: float,
    ) -> None: ...
    def __call__(self, pose: ArrayLike, *, light: ArrayLike | None = None) -> Any: ...
    def linearize(self, pose: ArrayLike, *, light: ArrayLike | None = None) -> LinearizedLoss: ...
    def fit_light(self, pose: ArrayLike, *, margin: int = 1, most: int = 4096) -> _Array: ...
    @property
    def light(self) -> _Array: ...
    @property
    def center(self) -> _Array: ...
    @property
    def size(self) -> tuple[int, int]: ...
