"""Rollouts in PyTorch."""

import numpy as np
import prehend
import pytest

from scenes import batch, bounce

torch = pytest.importorskip("torch")
import prehend.torch  # noqa: E402


def tensors(inputs, **options):
    return [torch.tensor(x, dtype=torch.float64, **options) for x in inputs]


@pytest.mark.parametrize("end", [False, True])
def test_gradcheck_in_double_precision(end):
    model, states, ball = two_bodies()
    rollout = model.rollout(
        1e-3, 6, parameters=["ball/floor.friction", "ball.mass"], controls=["ball.force_y"],
        integrator="semi_implicit_euler",
    )

    def function(linear, parameters, controls):
        # Derivatives by quaternions mean something along their sphere alone.
        rows = torch.from_numpy(states).clone()
        rows[ball, 7:13] = linear
        rows[ball, 0:3] = rows[ball, 0:3] + 1e-3 * linear[:3]
        return prehend.torch.rollout(rollout, rows, parameters, controls, end=end)

    linear = torch.tensor([0.3, -0.1, -0.2, 1.0, 2.0, 3.0], dtype=torch.float64, requires_grad=True)
    parameters = torch.tensor([0.4, 0.1], dtype=torch.float64, requires_grad=True)
    controls = torch.zeros((6, 1), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(function, (linear, parameters, controls), eps=1e-6, atol=1e-5, rtol=1e-4)


def two_bodies():
    model = prehend.Model()
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    ball = model.add_body("ball", prehend.Shape.ball(0.03), mass=0.1)
    model.add_contact(
        ball, floor, "penalty", smoothing=1e-3, stiffness=2e4, damping=1e2, friction=0.4, slip_scale=0.1
    )
    states = model.neutral_states()
    model.set_pose(states, ball, [0.0, 0.0, 0.0295])
    return model, states, ball


def test_gradients_are_those_of_numpy_to_the_bit():
    rollout, inputs = bounce()
    for own in (inputs, batch(inputs)):
        run, pullback = prehend.vjp(rollout, *own)
        weights = np.cos(np.arange(run[..., -1, :, :].size)).reshape(run[..., -1, :, :].shape)
        expected = pullback(weights)
        leaves = tensors(own, requires_grad=True)
        end = prehend.torch.rollout(rollout, *leaves, end=True)
        np.testing.assert_array_equal(end.detach().numpy(), run[..., -1, :, :])
        (end * torch.from_numpy(weights)).sum().backward()
        for leaf, gradient in zip(leaves, expected, strict=True):
            np.testing.assert_array_equal(leaf.grad.numpy(), gradient)


def test_single_precision_comes_back_as_such():
    rollout, inputs = bounce()
    states, parameters, controls = (x.float() for x in tensors(inputs))
    parameters.requires_grad_()
    end = prehend.torch.rollout(rollout, states, parameters, controls, end=True)
    assert end.dtype == torch.float32
    end[1, 0].backward()
    assert parameters.grad.dtype == torch.float32 and parameters.grad.abs().max() > 0


def test_adam_finds_the_friction_of_a_throw():
    model, states, ball = two_bodies()
    rollout = model.rollout(0.05, 1, parameters=["ball/floor.friction"])
    rows = torch.from_numpy(states)
    rows[ball, 7] = 1.0
    target = prehend.torch.rollout(rollout, rows, torch.tensor([0.25], dtype=torch.float64))
    friction = torch.tensor([0.5], dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([friction], lr=0.03)
    for _ in range(150):
        adam.zero_grad()
        loss = ((prehend.torch.rollout(rollout, rows, friction) - target)[..., ball, 7:10] ** 2).sum()
        loss.backward()
        adam.step()
    assert friction.item() == pytest.approx(0.25, abs=1e-3)


def test_what_is_changed_before_going_back_is_noticed():
    rollout, inputs = bounce()
    states, parameters, controls = tensors(inputs)
    parameters.requires_grad_()
    end = prehend.torch.rollout(rollout, states, parameters, controls, end=True)
    with torch.no_grad():
        parameters.mul_(2.0)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        end.sum().backward()
    # Of the result nothing is needed.
    parameters = tensors(inputs, requires_grad=True)[1]
    run = prehend.torch.rollout(rollout, states, parameters, controls)
    expected = prehend.vjp(rollout, *inputs)[1](np.ones((2, 13))).parameters
    run[:, 1, 2] += 0.02
    run[-1].sum().backward()
    np.testing.assert_array_equal(parameters.grad.numpy(), expected)


def test_whole_numbers_are_states_too():
    model = prehend.Model()
    model.add_body("stone", prehend.Shape.ball(0.1))
    rollout = model.rollout(0.1, 2)
    row = torch.tensor([[0] * 6 + [1] + [0] * 6])
    assert prehend.torch.rollout(rollout, row)[-1, 0, 9].item() == pytest.approx(-1.962)
    assert prehend.torch.rollout(rollout, model.neutral_states(), end=True).dtype == torch.float64
