"""Rollouts as functions: derivatives, batches, threads and arrays of other kinds."""

import multiprocessing
import subprocess
import sys
import threading
import time

import numpy as np
import prehend
import pytest

from scenes import batch, bounce, thrown_ball


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "runge_kutta_4", "backward_euler", "adaptive"])
def test_gradients_are_those_of_differences(integrator):
    rollout, inputs = bounce(integrator=integrator)
    run, pullback = prehend.vjp(rollout, *inputs)
    weights = np.cos(np.arange(26.0)).reshape(2, 13)
    gradient = pullback(weights)
    random = np.random.default_rng(1)
    for part, slope in enumerate(gradient):
        along = random.normal(size=slope.shape) * (1e-2 if part == 1 else 1.0)
        if part == 0:
            along[:, 3:7] = 0.0
            along[0] = 0.0

        def at(step, part=part, along=along):
            moved = [x + step * along if k == part else x for k, x in enumerate(inputs)]
            return (weights * rollout(*moved, end=True)).sum()

        # Steps that are chosen are others where inputs are, to their tolerance.
        h = 1e-4 if integrator == "adaptive" else 1e-7
        difference = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
        found = (slope * along).sum()
        assert found == pytest.approx(difference, rel=1e-4, abs=1e-5)
    tangents = tuple(random.normal(size=x.shape) for x in inputs)
    tangents[0][:, 3:7] = 0.0
    _, along_run = rollout.jvp(inputs, tangents)
    along_inputs = sum((g * t).sum() for g, t in zip(gradient, tangents, strict=True))
    assert (along_run[-1] * weights).sum() == pytest.approx(along_inputs, rel=1e-4)


def test_a_pullback_of_the_end_is_that_of_the_run():
    rollout, inputs = bounce(integrator="semi_implicit_euler")
    run, pullback = prehend.vjp(rollout, *inputs)
    assert run.shape == (121, 2, 13)
    np.testing.assert_array_equal(rollout(*inputs, end=True), run[-1])
    weights = np.ones((2, 13))
    whole = np.zeros_like(run)
    whole[-1] = weights
    for a, b in zip(pullback(weights), pullback(whole), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_batch_is_each_world_alone():
    rollout, inputs = bounce()
    many = batch(inputs)
    runs, pullback = prehend.vjp(rollout, *many)
    weights = np.cos(np.arange(4 * 26.0)).reshape(4, 2, 13)
    gradients = pullback(weights)
    for world in range(4):
        own = [x[world] for x in many]
        run, back = prehend.vjp(rollout, *own)
        np.testing.assert_array_equal(runs[world], run)
        for all_worlds, alone in zip(gradients, back(weights[world]), strict=True):
            np.testing.assert_array_equal(all_worlds[world], alone)


def test_what_is_the_same_for_all_worlds_gets_the_sum():
    rollout, (states, parameters, controls) = bounce()
    many = batch((states, parameters, controls))[0]
    _, pullback = prehend.vjp(rollout, many, parameters, controls)
    weights = np.ones((4, 2, 13))
    gradient = pullback(weights)
    assert [g.shape for g in gradient] == [many.shape, parameters.shape, controls.shape]
    each = [prehend.vjp(rollout, own, parameters, controls)[1](weights[0]) for own in many]
    np.testing.assert_allclose(gradient.parameters, sum(g.parameters for g in each), rtol=1e-12)


def test_values_of_the_world_are_used_where_none_are_given():
    model, states, _, contact = thrown_ball()
    rollout = model.rollout(1e-3, 20, parameters=[contact["friction"]])
    np.testing.assert_array_equal(rollout.values, [0.4])
    np.testing.assert_array_equal(rollout(states), rollout(states, [0.4]))
    assert (rollout.steps, rollout.dt, rollout.rows) == (20, 1e-3, 2)
    assert rollout.parameters == ["ball/floor.friction"] and rollout.controls == []


def test_lists_other_types_and_orders_are_arrays_too():
    rollout, (states, parameters, controls) = bounce()
    expected = rollout(states, parameters, controls)
    others = [
        (states.tolist(), tuple(parameters), controls.tolist()),
        (np.asfortranarray(states), parameters[::1], np.repeat(controls, 2, 1)[:, ::2]),
    ]
    for inputs in others:
        np.testing.assert_array_equal(rollout(*inputs), expected)


def test_inputs_stay_as_they_are_and_results_are_new():
    rollout, inputs = bounce()
    before = [x.copy() for x in inputs]
    run = rollout(*inputs)
    run[:] = 0.0
    for x, old in zip(inputs, before, strict=True):
        np.testing.assert_array_equal(x, old)
    assert rollout(*inputs)[0, 1, 2] == 0.04


def test_shapes_that_do_not_fit_are_refused():
    rollout, (states, parameters, controls) = bounce()
    for text, inputs in {
        "parameters: an array of 2": (states, parameters[:1], controls),
        "controls: an array of 120 × 1": (states, parameters, controls[1:]),
        "controls are missing: ball.force_y": (states, parameters),
        "a batch of 3, but others are of 4": (
            np.repeat(states[None], 4, 0),
            np.repeat(parameters[None], 3, 0),
            controls,
        ),
    }.items():
        with pytest.raises(prehend.Error, match=text):
            rollout(*inputs)
    run = rollout(states, parameters, controls)
    with pytest.raises(prehend.Error, match="adjoints"):
        rollout.pullback(run, run[:-1], states, parameters, controls)


def test_the_world_that_fails_is_named():
    rollout, inputs = bounce()
    states, parameters, controls = batch(inputs)
    parameters[2, 0] = -1.0
    with pytest.raises(prehend.Error, match="world 2: .*friction"):
        rollout(states, parameters, controls)


def test_changes_in_place_change_no_derivative():
    rollout, (states, parameters, controls) = bounce()
    weights = np.ones((2, 13))
    expected = prehend.vjp(rollout, states, parameters, controls)[1](weights)
    run, pullback = prehend.vjp(rollout, states, parameters, controls)
    run[:] = 0.0
    states[1, 7], parameters[0], controls[:] = 9.0, 0.1, 7.0
    for found, own in zip(pullback(weights), expected, strict=True):
        np.testing.assert_array_equal(found, own)


def forked(rollout, states, parameters, controls, queue):
    queue.put(rollout(states, parameters, controls, end=True))


INTERRUPTED = """
import os, signal, threading, time, prehend
model = prehend.Model()
model.add_body("ball", prehend.Shape.ball(0.03), density=1000.0)
rollout = model.rollout(1e-3, 20_000_000, integrator="semi_implicit_euler")
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
began = time.monotonic()
try:
    rollout(model.neutral_states(), end=True)
except KeyboardInterrupt:
    print(time.monotonic() - began < 20)
print(prehend.Model().rollout(1e-3, 1).steps)
"""


def test_an_interrupt_ends_a_long_rollout():
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=300
    )
    assert done.stdout == "True\n1\n", done.stderr


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning", "ignore:.*fork:RuntimeWarning")
def test_a_forked_process_has_threads_of_its_own():
    rollout, inputs = bounce()
    many = batch(inputs)
    expected = rollout(*many, end=True)
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    process = fork.Process(target=forked, args=(rollout, *many, queue))
    process.start()
    np.testing.assert_array_equal(queue.get(timeout=60), expected)
    process.join(60)
    assert process.exitcode == 0


def test_other_threads_run_meanwhile():
    model, states, _, _ = thrown_ball()
    rollout = model.rollout(1e-6, 200_000, integrator="semi_implicit_euler")
    ticks, running = [], True

    def tick():
        while running:
            ticks.append(time.perf_counter())
            time.sleep(1e-3)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    rollout(states, end=True)
    took = time.perf_counter() - start
    running = False
    thread.join()
    during = [t for t in ticks if start < t < start + took]
    # Were the lock held, there would be none.
    assert len(during) > 5
