"""Rollouts in JAX."""

import os
import subprocess
import sys

import numpy as np
import prehend
import pytest

from scenes import batch, bounce

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp  # noqa: E402
import prehend.jax  # noqa: E402

WEIGHTS = np.cos(np.arange(26.0)).reshape(2, 13)


def loss_of(rollout, end):
    function = prehend.jax.rollout(rollout, end=end)

    def loss(states, parameters, controls):
        run = function(states, parameters, controls)
        return (WEIGHTS * (run if end else run[-1])).sum()

    return loss


@pytest.mark.parametrize("end", [False, True])
def test_gradients_are_those_of_numpy_to_the_bit(end):
    rollout, inputs = bounce()
    run, pullback = prehend.vjp(rollout, *inputs)
    expected = pullback(WEIGHTS)
    loss = loss_of(rollout, end)
    for gradient in (jax.grad(loss, (0, 1, 2)), jax.jit(jax.grad(loss, (0, 1, 2)))):
        for found, own in zip(gradient(*inputs), expected, strict=True):
            np.testing.assert_array_equal(found, own)
    np.testing.assert_array_equal(jax.jit(prehend.jax.rollout(rollout))(*inputs), run)


@pytest.mark.parametrize("end", [False, True])
def test_vmap_is_a_batch(end):
    rollout, inputs = bounce()
    many = batch(inputs)
    _, pullback = prehend.vjp(rollout, *many)
    expected = pullback(np.repeat(WEIGHTS[None], 4, 0))
    gradient = jax.vmap(jax.grad(loss_of(rollout, end), (0, 1, 2)))
    for compiled in (gradient, jax.jit(gradient)):
        for found, own in zip(compiled(*many), expected, strict=True):
            np.testing.assert_array_equal(found, own)


def test_what_is_not_mapped_is_summed():
    rollout, (states, parameters, controls) = bounce()
    many = batch((states, parameters, controls))[0]
    loss = loss_of(rollout, True)

    def total(parameters):
        return jax.vmap(loss, (0, None, None))(many, parameters, controls).sum()

    _, pullback = prehend.vjp(rollout, many, parameters, controls)
    expected = pullback(np.repeat(WEIGHTS[None], 4, 0)).parameters
    np.testing.assert_allclose(jax.grad(total)(jnp.asarray(parameters)), expected, rtol=1e-12)


def test_nested_vmap_and_defaults():
    rollout, (states, parameters, controls) = bounce()
    function = prehend.jax.rollout(rollout, end=True)
    nested = jax.vmap(jax.vmap(function, (0, None, None)), (None, 0, None))
    states = np.repeat(states[None], 3, 0)
    parameters = np.stack([parameters, 1.1 * parameters])
    result = nested(states, parameters, controls)
    assert result.shape == (2, 3, 2, 13)
    np.testing.assert_array_equal(result[1, 2], rollout(states[2], parameters[1], controls, end=True))
    with pytest.raises(ValueError, match="controls are missing: ball.force_y"):
        function(states[0])
    np.testing.assert_array_equal(function(states[0], controls=controls), result[0, 0])


def test_arrays_of_numpy_are_constants_under_jit_and_vmap():
    rollout, inputs = bounce()
    many = batch(inputs)
    function = jax.vmap(prehend.jax.rollout(rollout, end=True), (0, None, None))
    gradient = jax.jit(jax.grad(lambda parameters: function(many[0], parameters, inputs[2]).sum()))
    _, pullback = prehend.vjp(rollout, many[0], *inputs[1:])
    expected = pullback(np.ones((4, 2, 13))).parameters
    np.testing.assert_allclose(gradient(inputs[1]), expected, rtol=1e-12)


def test_whole_numbers_are_states_too():
    model = prehend.Model()
    model.add_body("stone", prehend.Shape.ball(0.1))
    function = prehend.jax.rollout(model.rollout(0.1, 2), end=True)
    assert function([[0] * 6 + [1] + [0] * 6])[0, 9] == pytest.approx(-1.962)


ONE_CORE = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import numpy as np, prehend, jax
jax.config.update("jax_enable_x64", True)
import prehend.jax
model = prehend.Model()
model.add_body("ball", prehend.Shape.ball(0.03), density=1000.0)
throw = prehend.jax.rollout(model.rollout(1e-3, 2), end=True)
many = np.repeat(model.neutral_states()[None], 4000, 0)
loss = lambda states: throw(states)[0, :3].sum()
ends, slopes = jax.jit(jax.vmap(throw))(many), jax.jit(jax.vmap(jax.grad(loss)))(many)
print(np.asarray(ends).shape, np.asarray(slopes).shape)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no choice of cores")
@pytest.mark.parametrize("dispatch", ["true", "false"])
def test_large_batches_do_not_wait_for_another_core(dispatch):
    """With arrays of 400 kB, which ``jax.pure_callback`` waits for without end."""
    environment = {**os.environ, "JAX_CPU_ENABLE_ASYNC_DISPATCH": dispatch}
    done = subprocess.run(
        [sys.executable, "-c", ONE_CORE], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "(4000, 1, 13) (4000, 1, 13)\n", done.stderr


def test_errors_of_a_world_are_those_of_jax():
    rollout, (states, parameters, controls) = bounce()
    with pytest.raises(Exception, match="not finite"):
        jax.jit(prehend.jax.rollout(rollout))(states * np.nan, parameters, controls)


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
