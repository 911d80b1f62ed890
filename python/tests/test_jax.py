"""Rollouts in JAX."""

import os
import subprocess
import sys

import numpy as np
import prehend
import pytest

from scenes import assert_equal, batch, bounce, leaves, thrown_ball

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp  # noqa: E402
import prehend.jax  # noqa: E402
from prehend import Run, State  # noqa: E402

WEIGHTS = np.cos(np.arange(26.0)).reshape(2, 13)


def loss_of(rollout, end):
    function = prehend.jax.rollout(rollout, end=end)

    def loss(state, parameters, controls):
        bodies = function(state, parameters, controls).bodies
        return (WEIGHTS * (bodies if end else bodies[-1])).sum()

    return loss


@pytest.mark.parametrize("end", [False, True])
def test_gradients_are_those_of_numpy_to_the_bit(end):
    rollout, inputs = bounce()
    run, pullback = prehend.vjp(rollout, *inputs)
    expected = pullback(Run(bodies=WEIGHTS))
    loss = loss_of(rollout, end)
    for gradient in (jax.grad(loss, (0, 1, 2)), jax.jit(jax.grad(loss, (0, 1, 2)))):
        assert_equal(gradient(*inputs), expected)
    found = jax.jit(prehend.jax.rollout(rollout))(*inputs)
    assert isinstance(found, Run) and isinstance(found.state, State)
    assert_equal(found, run)


@pytest.mark.parametrize("end", [False, True])
def test_vmap_is_a_batch(end):
    rollout, inputs = bounce()
    many = batch(inputs)
    _, pullback = prehend.vjp(rollout, *many)
    expected = pullback(Run(bodies=np.repeat(WEIGHTS[None], 4, 0)))
    gradient = jax.vmap(jax.grad(loss_of(rollout, end), (0, 1, 2)))
    for compiled in (gradient, jax.jit(gradient)):
        assert_equal(compiled(*many), expected)


@pytest.mark.parametrize("end", [False, True])
def test_states_and_named_parameters_are_pytrees(end):
    """All arrays of a run count, some of the state's are batched, parameters are a dict."""
    rollout, (state, parameters, controls) = bounce(integrator="semi_implicit_euler")
    speeds = batch((state, parameters, controls))[0].v
    named = dict(zip(rollout.parameters, parameters, strict=True))
    function = prehend.jax.rollout(rollout, end=end)

    def loss(state, named, controls):
        run = function(state, named, controls)
        last = jax.tree.map(lambda x: x if end else x[-1], run)
        return sum(jnp.sum(jnp.cos(jnp.arange(x.size)).reshape(x.shape) * x) for x in jax.tree.leaves(last))

    axes = (State(None, 0, None, None), None, None)
    total = jax.jit(lambda *inputs: jax.vmap(loss, axes)(*inputs).sum())
    by_state, by_named, by_controls = jax.grad(total, (0, 1, 2))(state._replace(v=speeds), named, controls)
    assert by_state.v.shape == (4, 6) and by_state.fixed.shape == (1, 13) and set(by_named) == set(named)
    runs, pullback = prehend.vjp(rollout, state._replace(v=speeds), named, controls)
    ends = [x[:, -1] for x in leaves(runs)]
    weights = [np.repeat(np.cos(np.arange(x[0].size)).reshape(x[:1].shape), 4, 0) for x in ends]
    expected = pullback(Run(State(*weights[:4]), weights[4]))
    for found, own in zip(by_state, expected.state, strict=True):
        np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-12)
    for name, slope in by_named.items():
        np.testing.assert_allclose(slope, expected.parameters[name], rtol=1e-12)
    np.testing.assert_allclose(by_controls, expected.controls, rtol=1e-12)


def test_steps_follow_each_other_in_a_scan():
    """A state that a run ends with is where the next begins."""
    rollout, (state, parameters, controls) = bounce(integrator="semi_implicit_euler")
    half = thrown_ball()[0].rollout(5e-4, 60, integrator="semi_implicit_euler")
    step = prehend.jax.rollout(half, end=True)
    state = jax.tree.map(jnp.asarray, state)
    last, _ = jax.lax.scan(lambda state, _: (step(state).state, None), state, length=2)
    expected = rollout(state, parameters, 0.0 * controls, end=True).state
    for found, own in zip(last, expected, strict=True):
        np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-15)


def test_what_is_not_mapped_is_summed():
    rollout, (state, parameters, controls) = bounce()
    many = batch((state, parameters, controls))[0]
    loss = loss_of(rollout, True)

    def total(parameters):
        return jax.vmap(loss, (0, None, None))(many, parameters, controls).sum()

    _, pullback = prehend.vjp(rollout, many, parameters, controls)
    expected = pullback(Run(bodies=np.repeat(WEIGHTS[None], 4, 0))).parameters
    np.testing.assert_allclose(jax.grad(total)(jnp.asarray(parameters)), expected, rtol=1e-12)


def test_nested_vmap_and_defaults():
    rollout, (state, parameters, controls) = bounce()
    function = prehend.jax.rollout(rollout, end=True)
    nested = jax.vmap(jax.vmap(function, (0, None, None)), (None, 0, None))
    states = State(*(np.repeat(x[None], 3, 0) for x in state))
    parameters = np.stack([parameters, 1.1 * parameters])
    result = nested(states, parameters, controls).bodies
    assert result.shape == (2, 3, 2, 13)
    np.testing.assert_array_equal(result[1, 2], rollout(state, parameters[1], controls, end=True).bodies)
    with pytest.raises(ValueError, match="controls are missing: ball.force_y"):
        function(state)
    some = State(state.q, state.v)
    np.testing.assert_array_equal(function(some, controls=controls).bodies, result[0, 0])


def test_arrays_of_numpy_are_constants_under_jit_and_vmap():
    rollout, inputs = bounce()
    many = batch(inputs)
    function = jax.vmap(prehend.jax.rollout(rollout, end=True), (0, None, None))
    gradient = jax.jit(jax.grad(lambda parameters: function(many[0], parameters, inputs[2]).bodies.sum()))
    _, pullback = prehend.vjp(rollout, many[0], *inputs[1:])
    expected = pullback(Run(bodies=np.ones((4, 2, 13)))).parameters
    np.testing.assert_allclose(gradient(inputs[1]), expected, rtol=1e-12)


def test_whole_numbers_are_states_too():
    model = prehend.Model()
    model.add_body("stone", prehend.Shape.ball(0.1))
    function = prehend.jax.rollout(model.rollout(0.1, 2), end=True)
    assert function(State([0] * 6 + [1], [0] * 6)).state.v[2] == pytest.approx(-1.962)


ONE_CORE = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import numpy as np, prehend, jax
jax.config.update("jax_enable_x64", True)
import prehend.jax
model = prehend.Model()
model.add_body("ball", prehend.Shape.ball(0.03), density=1000.0)
throw = prehend.jax.rollout(model.rollout(1e-3, 2), end=True)
many = prehend.State(*(np.repeat(x[None], 4000, 0) for x in model.neutral_state()))
loss = lambda state: throw(state).bodies[0, :3].sum()
ends, slopes = jax.jit(jax.vmap(throw))(many), jax.jit(jax.vmap(jax.grad(loss)))(many)
print(np.asarray(ends.bodies).shape, np.asarray(slopes.q).shape)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no choice of cores")
@pytest.mark.parametrize("dispatch", ["true", "false"])
def test_large_batches_do_not_wait_for_another_core(dispatch):
    """With arrays of 400 kB, which ``jax.pure_callback`` waits for without end."""
    environment = {**os.environ, "JAX_CPU_ENABLE_ASYNC_DISPATCH": dispatch}
    done = subprocess.run(
        [sys.executable, "-c", ONE_CORE], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "(4000, 1, 13) (4000, 7)\n", done.stderr


def test_errors_of_a_world_are_those_of_jax():
    rollout, (state, parameters, controls) = bounce()
    with pytest.raises(Exception, match="not finite"):
        jax.jit(prehend.jax.rollout(rollout))(state._replace(v=state.v * np.nan), parameters, controls)
    many = batch((state, parameters, controls))
    many[1][2, 0] = -1.0
    with pytest.raises(Exception, match="world 2: .*friction"):
        jax.jit(jax.vmap(prehend.jax.rollout(rollout)))(*many)


def test_a_law_that_raises_is_an_error_whatever_it_raises():
    """Also one without a text, and one whose text is no UTF-8."""
    from prehend._callback import callback

    class Mute(Exception):
        def __str__(self):
            raise RuntimeError

    number = jax.ShapeDtypeStruct((2, 3), np.float64)
    for error in (ValueError("told"), ValueError("\udcff"), Mute(), KeyboardInterrupt()):

        def failing(x, error=error):
            raise error

        with pytest.raises(Exception, match="INTERNAL"):
            jax.jit(lambda x: callback(failing, number, x, vmap_method="sequential"))(np.ones(2))

    def scalar(x):
        return 1.0

    with pytest.raises(Exception, match="shape"):
        jax.jit(lambda x: callback(scalar, number, x, vmap_method="sequential"))(np.ones(2))
