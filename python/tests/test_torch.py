"""Rollouts in PyTorch."""

import numpy as np
import prehend
import pytest

from scenes import batch, bounce, leaves

torch = pytest.importorskip("torch")
import prehend.torch  # noqa: E402
from prehend import Run, State  # noqa: E402


def tensors(inputs, **options):
    """State, parameters and controls."""
    *state, parameters, controls = (torch.tensor(x, dtype=torch.float64, **options) for x in leaves(inputs))
    return State(*state), parameters, controls


@pytest.mark.parametrize("end", [False, True])
def test_gradcheck_in_double_precision(end):
    model, state, ball = two_bodies()
    rollout = model.rollout(
        1e-3, 6, parameters=["ball/floor.friction", "ball.mass"], controls=["ball.force_y"],
        integrator="semi_implicit_euler",
    )

    def function(linear, parameters, controls):
        # Derivatives by quaternions mean something along their sphere alone.
        q = torch.from_numpy(state.q).clone()
        q[:3] = q[:3] + 1e-3 * linear[:3]
        run = prehend.torch.rollout(rollout, State(q, linear), parameters, controls, end=end)
        return run.state.q, run.state.v, run.bodies

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
    state = model.neutral_state()
    model.set_pose(state, ball, [0.0, 0.0, 0.0295])
    return model, state, ball


def test_gradients_are_those_of_numpy_to_the_bit():
    rollout, inputs = bounce()
    for own in (inputs, batch(inputs)):
        run, pullback = prehend.vjp(rollout, *own)
        last = run.bodies[..., -1, :, :]
        weights = np.cos(np.arange(last.size)).reshape(last.shape)
        expected = pullback(Run(bodies=weights))
        given = tensors(own, requires_grad=True)
        end = prehend.torch.rollout(rollout, *given, end=True)
        np.testing.assert_array_equal(end.bodies.detach().numpy(), last)
        np.testing.assert_array_equal(end.state.q.detach().numpy(), run.state.q[..., -1, :])
        (end.bodies * torch.from_numpy(weights)).sum().backward()
        for leaf, gradient in zip(leaves(given), leaves(expected), strict=True):
            np.testing.assert_array_equal(leaf.grad.numpy(), gradient)


def test_parameters_may_be_named():
    rollout, inputs = bounce()
    state, parameters, controls = tensors(inputs)
    named = {name: x.clone().requires_grad_() for name, x in zip(rollout.parameters, parameters, strict=True)}
    run = prehend.torch.rollout(rollout, state, named, controls)
    (run.bodies[-1].sum() + run.state.v.sum()).backward()
    values, pullback = prehend.vjp(rollout, *inputs)
    by_bodies = np.zeros_like(values.bodies)
    by_bodies[-1] = 1.0
    expected = pullback(Run(State(v=np.ones_like(values.state.v)), by_bodies)).parameters
    assert [own.grad.item() for own in named.values()] == expected.tolist()


def test_single_precision_comes_back_as_such():
    rollout, inputs = bounce()
    state, parameters, controls = tensors(inputs)
    state, parameters = State(*(x.float() for x in state)), parameters.float().requires_grad_()
    end = prehend.torch.rollout(rollout, state, parameters, controls.float(), end=True)
    assert end.bodies.dtype == end.state.v.dtype == torch.float32
    end.bodies[1, 0].backward()
    assert parameters.grad.dtype == torch.float32 and parameters.grad.abs().max() > 0


def test_adam_finds_the_friction_of_a_throw():
    model, state, ball = two_bodies()
    rollout = model.rollout(0.05, 1, parameters=["ball/floor.friction"])
    state = State(*map(torch.from_numpy, state))
    state.v[0] = 1.0
    target = prehend.torch.rollout(rollout, state, torch.tensor([0.25], dtype=torch.float64)).state.v
    friction = torch.tensor([0.5], dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([friction], lr=0.03)
    for _ in range(150):
        adam.zero_grad()
        loss = ((prehend.torch.rollout(rollout, state, friction).state.v - target)[..., :3] ** 2).sum()
        loss.backward()
        adam.step()
    assert friction.item() == pytest.approx(0.25, abs=1e-3)


def test_what_is_changed_before_going_back_is_noticed():
    rollout, inputs = bounce()
    state, parameters, controls = tensors(inputs)
    parameters.requires_grad_()
    end = prehend.torch.rollout(rollout, state, parameters, controls, end=True)
    with torch.no_grad():
        parameters.mul_(2.0)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        end.bodies.sum().backward()
    # Of the result nothing is needed.
    parameters = tensors(inputs, requires_grad=True)[1]
    run = prehend.torch.rollout(rollout, state, parameters, controls).bodies
    expected = prehend.vjp(rollout, *inputs)[1](Run(bodies=np.ones((2, 13)))).parameters
    run[:, 1, 2] += 0.02
    run[-1].sum().backward()
    np.testing.assert_array_equal(parameters.grad.numpy(), expected)


def test_whole_numbers_are_states_too():
    model = prehend.Model()
    model.add_body("stone", prehend.Shape.ball(0.1))
    rollout = model.rollout(0.1, 2)
    state = State(torch.tensor([0] * 6 + [1]), torch.tensor([0] * 6))
    assert prehend.torch.rollout(rollout, state).state.v[-1, 2].item() == pytest.approx(-1.962)
    assert prehend.torch.rollout(rollout, model.neutral_state(), end=True).bodies.dtype == torch.float64
    assert prehend.torch.rollout(rollout, State(), end=True).bodies.dtype == torch.float64
