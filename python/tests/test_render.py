"""Pictures and the loss of a pose, with their derivatives, in NumPy, PyTorch and JAX."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import prehend

SIZE = (24, 32)
K = [[60.0, 0.0, 15.5], [0.0, 60.0, 11.5], [0.0, 0.0, 1.0]]
RNG = np.random.default_rng(7)


def box() -> tuple[np.ndarray, np.ndarray]:
    """A box of 8, 10 and 12 cm."""
    signs = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - 0.5
    faces = []
    for axis in range(3):
        a, b = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        for side in (0, 1 << axis):
            corners = [side, side + a, side + a + b, side + b]
            if side == 0:
                corners.reverse()
            faces += [corners[:3], [corners[0], *corners[2:]]]
    return signs * [0.08, 0.10, 0.12], np.array(faces)


VERTICES, FACES = box()
COLORS = RNG.uniform(0.2, 0.9, VERTICES.shape)
LIGHT = prehend.headlight(0.4, 0.6)


def pose(x: float = 0.012, turn: float = 0.37) -> np.ndarray:
    """A pose at which no edge runs within the steps of differences by a pixel's center, where colors jump."""
    start = np.eye(4)
    start[:3, 3] = [x, -0.005, 0.4]
    return prehend.perturb(start, [0, 0, 0, turn, -0.3, 0.2], start[:3, 3])


def renderer(**options: Any) -> prehend.Renderer:
    return prehend.Renderer((VERTICES, FACES), K, SIZE, **{"colors": COLORS, "light": LIGHT, **options})


def textured() -> prehend.Renderer:
    uvs = VERTICES[:, :2] / [0.08, 0.10] * 0.8 + 0.5
    texture = RNG.uniform(0.2, 0.8, (6, 5, 3))
    return renderer(colors=None, uvs=uvs, texture=texture)


def adjoints(batch: tuple[int, ...] = ()) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(3)
    sizes = ((*SIZE, 3), SIZE, SIZE, (*SIZE, 3))
    return tuple(rng.normal(size=(*batch, *size)) for size in sizes)


def weighted(image: prehend.Image) -> float:
    return sum(float((a * x).sum()) for a, x in zip(adjoints(), image, strict=True))


def difference(function: Any, x: np.ndarray, step: float) -> np.ndarray:
    """Central differences."""
    out = np.zeros(x.size)
    for k in range(x.size):
        move = np.zeros(x.size)
        move[k] = step
        move = move.reshape(x.shape)
        out[k] = (function(x + move) - function(x - move)) / (2 * step)
    return out.reshape(x.shape)


def test_a_picture_shows_the_box_where_it_is() -> None:
    at = np.eye(4)
    at[2, 3] = 0.46
    image = renderer(colors=None, light=prehend.ambient_light(0.8), background=[0.0, 0.0, 1.0]).render(at)
    assert [x.shape for x in image] == [(24, 32, 3), (24, 32), (24, 32), (24, 32, 3)]
    # The front face is 0.4 m away: 12 by 15 px, in the gray of a mesh without colors.
    assert image.coverage.sum() == pytest.approx(12 * 15, rel=0.03)
    assert image.depth[12, 16] == pytest.approx(0.4, abs=1e-7)
    np.testing.assert_allclose(image.normal[12, 16], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(image.color[12, 16], 0.5 * 0.8, atol=1e-6)
    np.testing.assert_array_equal(image.color[0, 0], [0, 0, 1])
    assert image.depth[0, 0] == image.coverage[0, 0] == 0.0


def test_the_renderer_says_what_it_has() -> None:
    own = renderer()
    np.testing.assert_allclose(own.vertices, VERTICES, atol=1e-8)
    np.testing.assert_array_equal(own.faces, FACES)
    np.testing.assert_allclose(own.colors, COLORS, atol=1e-7)
    np.testing.assert_array_equal(own.light, LIGHT)
    assert own.size == SIZE and own.texels is None
    assert textured().texels.shape == (6, 5, 3)
    assert repr(own) == "Renderer(12 faces, size=(24, 32))"


def test_vertices_at_one_place_are_one() -> None:
    twice = np.concatenate([VERTICES, VERTICES])
    faces = np.where(np.arange(12)[:, None] % 2 == 0, FACES, FACES + 8)
    own = prehend.Renderer((twice, faces), K, SIZE)
    assert own.vertices.shape == (8, 3)
    np.testing.assert_array_equal(own.faces, FACES)


@pytest.mark.parametrize("mode", ["contour", "softras"])
def test_derivatives_by_the_pose_match_differences(mode: str) -> None:
    own = renderer(mode=mode)
    at = pose()
    center = at[:3, :3] @ own.center + at[:3, 3]
    image, pullback = own.vjp(at)
    for x, y in zip(image, own.render(at), strict=True):
        np.testing.assert_array_equal(x, y)
    gradient = pullback(*adjoints())
    by_twist = difference(lambda t: weighted(own.render(prehend.perturb(at, t, center))), np.zeros(6), 1e-6)
    np.testing.assert_allclose(gradient.twist, by_twist, rtol=1e-4, atol=1e-3)
    by_matrix = difference(lambda m: weighted(own.render(m)), at, 1e-6)
    np.testing.assert_allclose(gradient.pose, by_matrix, rtol=1e-4, atol=1e-3)
    assert gradient.vertices is None and gradient.colors is None and gradient.texels is None


@pytest.mark.parametrize(
    ("name", "step"),
    [("vertices", 1e-5), ("colors", 1e-2), ("light", 1e-4), ("background", 1e-4), ("intrinsics", 1e-5)],
)
def test_derivatives_by_all_else_match_differences(name: str, step: float) -> None:
    own, at = renderer(), pose()
    given = getattr(own, name)
    gradient = getattr(own.vjp(at, **{name: given})[1](*adjoints()), name)
    # Shapes and colors are kept in single precision: steps are long.
    expected = difference(lambda x: weighted(own.render(at, **{name: x})), given, step)
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=2e-4 * np.abs(expected).max())


def test_derivatives_by_texels_match_differences() -> None:
    own, at = textured(), pose()
    gradient = own.vjp(at, texels=own.texels)[1](*adjoints())
    expected = difference(lambda x: weighted(own.render(at, texels=x)), own.texels, 1e-2)
    np.testing.assert_allclose(gradient.texels, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_a_batch_is_its_pictures() -> None:
    own = renderer()
    poses = np.stack([pose(), pose(-0.02, 0.1), pose(0.03, 0.7)])
    colors = np.stack([COLORS, COLORS[::-1], 0.5 * COLORS])
    shift = VERTICES * 1.01
    image, pullback = own.vjp(poses, colors=colors, vertices=shift)
    by = adjoints((3,))
    gradient, each = pullback(*by), pullback(*by, each=True)
    alone = []
    for k in range(3):
        one, back = own.vjp(poses[k], colors=colors[k], vertices=shift)
        for x, y in zip(image, one, strict=True):
            np.testing.assert_array_equal(x[k], y)
        alone.append(back(*(x[k] for x in by)))
        for name in ("pose", "twist", "colors"):
            np.testing.assert_array_equal(getattr(gradient, name)[k], getattr(alone[k], name))
        np.testing.assert_array_equal(each.vertices[k], alone[k].vertices)
        np.testing.assert_array_equal(each.light[k], alone[k].light)
    np.testing.assert_allclose(gradient.vertices, sum(x.vertices for x in alone), rtol=1e-12, atol=1e-12)
    assert gradient.light.shape == (3, 5)


def test_errors_say_what_is_wrong() -> None:
    own = renderer()
    with pytest.raises(prehend.Error, match="no rotation and translation"):
        own.render(2 * np.eye(4))
    with pytest.raises(prehend.Error, match="no rotation and translation"):
        own.render(np.full((4, 4), np.nan))
    with pytest.raises(prehend.Error, match=r"pose: an array of 4 × 4 is expected, or a batch of them, not \[3\]"):
        own.render([0, 0, 1])
    with pytest.raises(prehend.Error, match="light: a batch of 3, but others are of 2"):
        own.render(np.stack([pose()] * 2), light=np.stack([LIGHT] * 3))
    with pytest.raises(prehend.Error, match="pose: the batch is empty"):
        own.render(np.zeros((0, 4, 4)))
    with pytest.raises(prehend.Error, match="the mesh has no texture"):
        own.render(pose(), texels=np.zeros((2, 2, 3)))
    with pytest.raises(prehend.Error, match="focal length fx is -1 px"):
        own.render(pose(), intrinsics=[-1, 60, 15, 11])
    with pytest.raises(prehend.Error, match="vertex 0 has a position"):
        own.render(pose(), vertices=np.full((8, 3), np.inf))
    with pytest.raises(prehend.Error, match="color: an array of"):
        own.vjp(pose())[1](np.zeros((2, 2, 3)))
    with pytest.raises(prehend.Error, match="there is no vertex 9"):
        prehend.Renderer((VERTICES, [[0, 1, 9]]), K, SIZE)
    with pytest.raises(prehend.Error, match="a Mesh is expected, a path"):
        prehend.Renderer(3.0, K, SIZE)
    with pytest.raises(prehend.Error, match="absent.obj"):
        prehend.Renderer("absent.obj", K, SIZE)
    with pytest.raises(prehend.Error, match="7 colors given, expected 8"):
        renderer(colors=COLORS[:7])
    with pytest.raises(prehend.Error, match="no texture coordinates"):
        renderer(texture=np.zeros((2, 2, 3)))
    with pytest.raises(prehend.Error, match="K: a matrix of 3 × 3"):
        prehend.Renderer((VERTICES, FACES), np.eye(2), SIZE)
    with pytest.raises(prehend.Error, match="mode: "):
        renderer(mode="hard")
    with pytest.raises(prehend.Error, match='has no setting "sigma"'):
        renderer(sigma=1.0)
    with pytest.raises(prehend.Error, match="half_width is 0, expected 0.05 to 64 px"):
        renderer(half_width=0)


# The loss of a pose


def observed(**options: Any) -> prehend.PoseLoss:
    image = renderer().render(pose())
    given = {"colors": COLORS, "light": LIGHT, "mask_weight": 1.0, "depth": image.depth, **options}
    return prehend.PoseLoss((VERTICES, FACES), K, image.color, image.coverage, **given)


def test_the_loss_is_least_at_the_truth() -> None:
    loss = observed()
    assert 0 <= loss(pose()) < 1e-8
    assert loss(pose(0.015)) > 1e-4
    at = pose(0.015)
    for _ in range(6):
        step = loss.linearize(at)
        at = prehend.perturb(at, -np.linalg.solve(step.hessian, step.gradient), step.center)
    np.testing.assert_allclose(at, pose(), atol=1e-5)


def test_derivatives_of_the_loss_match_differences() -> None:
    loss = observed()
    at = pose(0.0132, 0.37)
    own = loss.linearize(at)
    assert own.value == loss(at)
    np.testing.assert_allclose(own.center, at[:3, 3], atol=1e-9)
    by_twist = difference(lambda t: loss(prehend.perturb(at, t, own.center)), np.zeros(6), 3e-5)
    np.testing.assert_allclose(own.gradient, by_twist, rtol=0, atol=1e-3 * np.abs(by_twist).max())
    np.testing.assert_array_equal(own.hessian, own.hessian.T)
    tangent = (prehend.perturb(at, 1e-6 * np.eye(6)[4], own.center) - at) / 1e-6
    assert (tangent * own.pose).sum() == pytest.approx(own.gradient[4], rel=1e-4)


def test_a_batch_of_losses_is_each() -> None:
    loss = observed()
    poses = np.stack([pose(), pose(0.02), pose(0.0, 0.2)])
    at = loss.linearize(poses)
    np.testing.assert_array_equal(loss(poses), [loss(x) for x in poses])
    for k, x in enumerate(poses):
        alone = loss.linearize(x)
        for many, one in zip(at, alone, strict=True):
            np.testing.assert_array_equal(many[k], one)


def test_the_light_is_found() -> None:
    image = renderer().render(pose())
    loss = prehend.PoseLoss((VERTICES, FACES), K, image.color, image.coverage, colors=COLORS)
    # Three faces leave the light open; they do not leave open how they look.
    fitted = loss.fit_light(pose())
    assert loss(pose(), light=fitted) < 0.1 * loss(pose())
    assert loss.light.shape == (3, 5)


def test_bytes_are_colors() -> None:
    picture = (renderer().render(pose()).color.clip(0, 1) * 255).round()
    mask = np.ones(SIZE, dtype=bool)
    losses = [
        prehend.PoseLoss((VERTICES, FACES), K, image, mask)(pose())
        for image in (picture.astype(np.uint8), picture / 255)
    ]
    assert losses[0] == pytest.approx(losses[1], rel=1e-6)


def test_errors_of_the_loss_say_what_is_wrong() -> None:
    image = np.zeros((*SIZE, 3))
    with pytest.raises(prehend.Error, match="mask is 2 x 2, the camera 32 x 24"):
        prehend.PoseLoss((VERTICES, FACES), K, image, np.ones((2, 2)))
    with pytest.raises(prehend.Error, match="mask has no pixel set"):
        prehend.PoseLoss((VERTICES, FACES), K, image, np.zeros(SIZE, dtype=bool))
    with pytest.raises(prehend.Error, match=r"image: an array of H × W × 3"):
        prehend.PoseLoss((VERTICES, FACES), K, image[0], np.zeros(SIZE))
    with pytest.raises(prehend.Error, match="depth.scale is 0"):
        observed(depth_scale=0.0)
    with pytest.raises(prehend.Error, match="kernel: "):
        observed(kernel="l1")
    with pytest.raises(prehend.Error, match="one pose is expected"):
        observed().fit_light(np.stack([pose()] * 2))


# PyTorch


def test_torch_passes_gradcheck() -> None:
    torch = pytest.importorskip("torch")
    from prehend import torch_render

    own = renderer()
    at = torch.tensor(pose(), requires_grad=True)
    light = torch.tensor(LIGHT, requires_grad=True)
    intrinsics = torch.tensor(own.intrinsics, requires_grad=True)

    def picture(at: Any, light: Any, intrinsics: Any) -> Any:
        image = torch_render.render(own, at, light=light, intrinsics=intrinsics)
        return tuple(torch.stack([(torch.tensor(a) * x).sum() for a, x in zip(adjoints(), image, strict=True)]))

    assert torch.autograd.gradcheck(picture, (at, light, intrinsics), eps=1e-6, atol=1e-3, rtol=1e-4)
    twist = torch.zeros(6, dtype=torch.float64, requires_grad=True)
    center = torch.tensor(pose()[:3, 3])
    assert torch.autograd.gradcheck(lambda t, c: torch_render.perturb(at.detach(), t, c), (twist, center.requires_grad_()))

    def silhouette(t: Any) -> Any:
        return torch_render.render(own, torch_render.perturb(at.detach(), t, center.detach())).coverage

    assert torch.autograd.gradcheck(silhouette, (twist,), atol=1e-4)
    # Colors are kept in single precision.
    colors = torch.tensor(COLORS, requires_grad=True)
    shaded = lambda c: torch_render.render(own, at.detach(), colors=c).color  # noqa: E731
    assert torch.autograd.gradcheck(shaded, (colors,), eps=1e-2, atol=1e-4)


def test_torch_is_numpy() -> None:
    torch = pytest.importorskip("torch")
    from prehend import torch_render

    own = renderer()
    poses = np.stack([pose(), pose(-0.02, 0.1)])
    at = torch.tensor(poses, requires_grad=True)
    vertices = torch.tensor(VERTICES, requires_grad=True)
    image = torch_render.render(own, at, vertices=vertices)
    expected, pullback = own.vjp(poses, vertices=VERTICES)
    for x, y in zip(image, expected, strict=True):
        np.testing.assert_array_equal(x.detach().numpy(), y)
    by = adjoints((2,))[0]
    (image.color * torch.tensor(by)).sum().backward()
    gradient = pullback(color=by)
    np.testing.assert_array_equal(at.grad.numpy(), gradient.pose)
    np.testing.assert_array_equal(vertices.grad.numpy(), gradient.vertices)
    single = torch_render.render(own, torch.tensor(poses[0], dtype=torch.float32))
    assert single.color.dtype == torch.float32 and not single.color.requires_grad
    whole = torch_render.render(own, np.eye(4, dtype=int), light=LIGHT)
    assert whole.color.dtype == torch.float64
    np.testing.assert_allclose(
        torch_render.perturb(at[0], torch.full((6,), 0.1, dtype=torch.float64), at[0, :3, 3]).detach().numpy(),
        prehend.perturb(poses[0], np.full(6, 0.1), poses[0, :3, 3]),
        atol=1e-14,
    )


def test_torch_has_the_loss() -> None:
    torch = pytest.importorskip("torch")
    from prehend import torch_render

    loss = observed()
    poses = np.stack([pose(0.0132), pose(-0.02, 0.1)])
    at = torch.tensor(poses, requires_grad=True)
    values = torch_render.pose_loss(loss, at)
    np.testing.assert_array_equal(values.detach().numpy(), loss(poses))
    (2 * values[0] + values[1]).backward()
    by = loss.linearize(poses).pose
    np.testing.assert_array_equal(at.grad.numpy(), np.stack([2 * by[0], by[1]]))
    one = torch.tensor(poses[0], requires_grad=True)
    # Pixels are computed in single precision: steps are long.
    assert torch.autograd.gradcheck(lambda x: torch_render.pose_loss(loss, x), (one,), eps=3e-5, atol=2e-2, rtol=3e-2)


# JAX


def jax_and_render() -> tuple[Any, Any]:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    from prehend import jax_render

    return jax, jax_render


def test_jax_is_numpy() -> None:
    jax, jax_render = jax_and_render()
    own = renderer()
    function = jax_render.render(own)
    at, by = pose(), adjoints()

    def total(at: Any, light: Any) -> Any:
        return sum((a * x).sum() for a, x in zip(by, function(at, light=light), strict=True))

    expected, pullback = own.vjp(at, light=LIGHT)
    for x, y in zip(jax.jit(function)(at, light=LIGHT), expected, strict=True):
        np.testing.assert_array_equal(x, y)
    gradient = pullback(*by)
    for compiled in (jax.grad(total, (0, 1)), jax.jit(jax.grad(total, (0, 1)))):
        by_pose, by_light = compiled(at, LIGHT)
        np.testing.assert_array_equal(by_pose, gradient.pose)
        np.testing.assert_array_equal(by_light, gradient.light)
    with pytest.raises(TypeError, match="no function of 'colour'"):
        function(at, colour=COLORS)


def test_jax_maps_over_batches() -> None:
    jax, jax_render = jax_and_render()
    own = renderer()
    function = jax_render.render(own)
    poses = np.stack([pose(), pose(-0.02, 0.1), pose(0.03, 0.7)])
    by = adjoints((3,))
    expected, pullback = own.vjp(poses, vertices=VERTICES)
    images = jax.jit(jax.vmap(lambda x: function(x, vertices=VERTICES)))(poses)
    for x, y in zip(images, expected, strict=True):
        np.testing.assert_array_equal(x, y)

    def one(at: Any, vertices: Any, *by: Any) -> Any:
        return sum((a * x).sum() for a, x in zip(by, function(at, vertices=vertices), strict=True))

    each = jax.vmap(jax.grad(one, (0, 1)), (0, None, 0, 0, 0, 0))(poses, VERTICES, *by)
    gradient = pullback(*by, each=True)
    np.testing.assert_array_equal(each[0], gradient.pose)
    np.testing.assert_array_equal(each[1], gradient.vertices)
    # Of the sum over the batch.
    by_vertices = jax.grad(lambda v: jax.vmap(one, (0, None, 0, 0, 0, 0))(poses, v, *by).sum())(VERTICES)
    np.testing.assert_allclose(by_vertices, pullback(*by).vertices, rtol=1e-12, atol=1e-12)
    # The same picture for several adjoints, and maps within maps.
    same = jax.vmap(jax.grad(one), (None, None, 0, 0, 0, 0))(poses[0], VERTICES, *by)
    np.testing.assert_array_equal(same[0], jax.grad(one)(poses[0], VERTICES, *(x[0] for x in by)))
    nested = jax.vmap(lambda p: jax.vmap(lambda l: function(p, light=l).color)(np.stack([LIGHT, 2 * LIGHT])))(poses)
    np.testing.assert_array_equal(nested[2, 1], own.render(poses[2], light=2 * LIGHT).color)


def test_jax_has_the_loss() -> None:
    jax, jax_render = jax_and_render()
    loss = observed()
    function = jax_render.pose_loss(loss)
    poses = np.stack([pose(0.0132), pose(-0.02, 0.1)])
    at = loss.linearize(poses)
    np.testing.assert_array_equal(jax.jit(function)(poses[0]), at.value[0])
    values, by = jax.jit(jax.vmap(jax.value_and_grad(function)))(poses)
    np.testing.assert_array_equal(values, at.value)
    np.testing.assert_array_equal(by, at.pose)
    center = at.center[0]
    by_twist = jax.grad(lambda t: function(jax_render.perturb(poses[0], t, center)))(np.zeros(6))
    np.testing.assert_allclose(by_twist, at.gradient[0], rtol=1e-9, atol=1e-12)
    moved = jax_render.perturb(poses[0], np.full(6, 0.1), center)
    np.testing.assert_allclose(moved, prehend.perturb(poses[0], np.full(6, 0.1), center), atol=1e-14)
