from collections.abc import Sequence
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]
_Body = int | str
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
        path: str | PathLike[str], *, spacing: float | None = None, cell: float | None = None
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
        self, world: World, states: _Array, positions: ArrayLike | None = None
    ) -> None: ...

class Rollout:
    @property
    def parameters(self) -> list[str]: ...
    @property
    def controls(self) -> list[str]: ...
    @property
    def values(self) -> _Array: ...
    @property
    def steps(self) -> int: ...
    @property
    def dt(self) -> float: ...
    @property
    def rows(self) -> int: ...
    def __call__(
        self,
        states: ArrayLike,
        parameters: ArrayLike | None = None,
        controls: ArrayLike | None = None,
        *,
        end: bool = False,
    ) -> _Array: ...
    def pullback(
        self,
        run: ArrayLike,
        adjoints: ArrayLike,
        states: ArrayLike,
        parameters: ArrayLike | None = None,
        controls: ArrayLike | None = None,
    ) -> tuple[_Array, _Array, _Array]: ...
    def jvp(
        self,
        inputs: tuple[ArrayLike, ArrayLike | None, ArrayLike | None],
        tangents: tuple[ArrayLike | None, ArrayLike | None, ArrayLike | None],
    ) -> tuple[_Array, _Array]: ...

class World:
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
    def copy(self) -> World: ...
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
    def add_weld(
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
    ) -> Robot: ...
    def add_urdf(
        self,
        path: str | PathLike[str],
        *,
        pose: ArrayLike | None = None,
        floating: bool = False,
        shapes: bool = True,
    ) -> Robot: ...
    def joint_row(self, link: _Body) -> int: ...
    def neutral_states(self) -> _Array: ...
    def set_pose(
        self,
        states: _Array,
        body: _Body,
        pose: ArrayLike,
        *,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None: ...
    def pose(self, states: ArrayLike, body: _Body) -> _Array: ...
    def set_joint(
        self,
        states: _Array,
        link: _Body,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
    ) -> None: ...
    def joint(self, states: ArrayLike, link: _Body) -> tuple[list[float], list[float]]: ...
    def contact_wrench(self, states: ArrayLike, body: _Body) -> _Array: ...
    def accelerometer(self, states: ArrayLike, body: _Body, point: ArrayLike) -> _Array: ...
    def longest_step(self, states: ArrayLike, integrator: str = "semi_implicit_euler") -> float: ...
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
