"""Rollouts as functions: derivatives, batches, threads and arrays of other kinds."""

import multiprocessing
import subprocess
import sys
import threading
import time

import numpy as np
import prehend
import pytest
from prehend import Run, State

from scenes import assert_equal, batch, bounce, inputs_of, leaves, thrown_ball


def slope_along(rollout, inputs, weights, along, h):
    """The derivative of what the last bodies weigh along directions of all inputs, by differences."""

    def at(step):
        moved = [x + step * d for x, d in zip(leaves(inputs), along, strict=True)]
        return (weights * rollout(*inputs_of(moved), end=True).bodies).sum()

    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "runge_kutta_4", "backward_euler", "adaptive"])
def test_gradients_are_those_of_differences(integrator):
    rollout, inputs = bounce(integrator=integrator)
    _, pullback = prehend.vjp(rollout, *inputs)
    weights = np.cos(np.arange(26.0)).reshape(2, 13)
    gradient = pullback(Run(bodies=weights))
    random = np.random.default_rng(1)
    for part, slope in enumerate(leaves(gradient)):
        along = [np.zeros_like(x) for x in leaves(inputs)]
        along[part][...] = random.normal(size=slope.shape) * (1e-2 if part == 4 else 1.0)
        # Derivatives by quaternions mean something along their sphere alone.
        along[0][3:7] = 0.0
        along[3][:, 3:] = 0.0
        # Steps that are chosen are others where inputs are, to their tolerance.
        h = 1e-4 if integrator == "adaptive" else 1e-7
        difference = slope_along(rollout, inputs, weights, along, h)
        found = (slope * along[part]).sum()
        assert found == pytest.approx(difference, rel=1e-4, abs=1e-5), part
    tangents = [random.normal(size=x.shape) for x in leaves(inputs)]
    tangents[0][3:7] = 0.0
    tangents[3][:, 3:] = 0.0
    _, along_run = rollout.jvp(inputs, inputs_of(tangents))
    along_inputs = sum((g * t).sum() for g, t in zip(leaves(gradient), tangents, strict=True))
    assert (along_run.bodies[-1] * weights).sum() == pytest.approx(along_inputs, rel=1e-4)


def test_every_array_of_a_run_has_its_derivatives():
    rollout, inputs = bounce(integrator="semi_implicit_euler")
    run, pullback = prehend.vjp(rollout, *inputs)
    random = np.random.default_rng(2)
    weights = Run(*inputs_of([random.normal(size=x.shape) for x in leaves(run)]))
    weights.bodies[:, :, 3:7] = 0.0
    weights.state.q[:, 3:7] = 0.0
    weights.state.fixed[:, :, 3:7] = 0.0
    gradient = pullback(weights)
    tangents = [random.normal(size=x.shape) for x in leaves(inputs)]
    tangents[0][3:7] = 0.0
    tangents[3][:, 3:] = 0.0
    values, along = rollout.jvp(inputs, inputs_of(tangents))
    np.testing.assert_allclose(values.bodies, run.bodies, rtol=1e-12)
    by_run = sum((w * a).sum() for w, a in zip(leaves(weights), leaves(along), strict=True))
    by_inputs = sum((g * t).sum() for g, t in zip(leaves(gradient), tangents, strict=True))
    assert by_run == pytest.approx(by_inputs, rel=1e-6)
    # What is the same in two arrays is one number, whose adjoints are added.
    by_bodies, by_q = np.zeros_like(run.bodies), np.zeros_like(run.state.q)
    by_bodies[-1, 1, 0], by_q[-1, 0] = 1.0, 2.0
    both = pullback(Run(State(q=by_q), by_bodies))
    by_bodies[-1, 1, 0] = 3.0
    assert_equal(both, pullback(Run(bodies=by_bodies)))


def test_a_pullback_of_the_end_is_that_of_the_run():
    rollout, inputs = bounce(integrator="semi_implicit_euler")
    run, pullback = prehend.vjp(rollout, *inputs)
    shapes = [(121, 7), (121, 6), (121, 0), (121, 1, 13), (121, 2, 13)]
    assert [x.shape for x in leaves(run)] == shapes
    end = rollout(*inputs, end=True)
    assert_equal(end, Run(State(*(x[-1] for x in run.state)), run.bodies[-1]))
    weights = np.ones((2, 13))
    whole = np.zeros_like(run.bodies)
    whole[-1] = weights
    assert_equal(pullback(Run(bodies=weights)), pullback(Run(bodies=whole)))
    # An end is where another rollout begins.
    on = rollout(end.state, *inputs[1:])
    assert_equal(Run(State(*(x[0] for x in on.state)), on.bodies[0]), end)


def test_a_batch_is_each_world_alone():
    rollout, inputs = bounce()
    many = batch(inputs)
    runs, pullback = prehend.vjp(rollout, *many)
    weights = np.cos(np.arange(4 * 26.0)).reshape(4, 2, 13)
    gradients = leaves(pullback(Run(bodies=weights)))
    for world in range(4):
        own = inputs_of([x[world] for x in leaves(many)])
        run, back = prehend.vjp(rollout, *own)
        for all_worlds, alone in zip(leaves(runs), leaves(run), strict=True):
            np.testing.assert_array_equal(all_worlds[world], alone)
        gradient = leaves(back(Run(bodies=weights[world])))
        for all_worlds, alone in zip(gradients, gradient, strict=True):
            np.testing.assert_array_equal(all_worlds[world], alone)


def test_what_is_the_same_for_all_worlds_gets_the_sum():
    rollout, (state, parameters, controls) = bounce()
    speeds = batch((state, parameters, controls))[0].v
    _, pullback = prehend.vjp(rollout, state._replace(v=speeds), parameters, controls)
    weights = np.ones((4, 2, 13))
    gradient = pullback(Run(bodies=weights))
    assert gradient.state.v.shape == speeds.shape and gradient.state.q.shape == state.q.shape
    each = [
        prehend.vjp(rollout, state._replace(v=own), parameters, controls)[1](Run(bodies=weights[0]))
        for own in speeds
    ]
    np.testing.assert_allclose(gradient.parameters, sum(g.parameters for g in each), rtol=1e-12)
    np.testing.assert_allclose(gradient.state.q, sum(g.state.q for g in each), rtol=1e-12)
    np.testing.assert_allclose(gradient.controls, sum(g.controls for g in each), rtol=1e-12)


def test_what_is_left_out_is_that_of_the_model():
    model, state, _, contact = thrown_ball()
    rollout = model.rollout(1e-3, 20, parameters=[contact["friction"]])
    np.testing.assert_array_equal(rollout.values, [0.4])
    assert_equal(rollout(state), rollout(state, [0.4]))
    assert_equal(rollout(state), rollout(State(state.q, state.v)))
    assert_equal([rollout.neutral_state], [model.neutral_state()])
    gradient = prehend.vjp(rollout, State(state.q, state.v))[1](Run(bodies=np.ones((2, 13))))
    assert gradient.state.fixed.shape == (1, 13) and gradient.parameters.shape == (1,)
    assert (rollout.steps, rollout.dt, rollout.bodies) == (20, 1e-3, ["floor", "ball"])
    assert rollout.parameters == ["ball/floor.friction"] and rollout.controls == []


def test_parameters_may_be_named():
    rollout, (state, parameters, controls) = bounce()
    friction, mass = rollout.parameters
    weights = Run(bodies=np.cos(np.arange(26.0)).reshape(2, 13))
    run, pullback = prehend.vjp(rollout, state, parameters, controls)
    named, back = prehend.vjp(rollout, state, {mass: 0.1, friction: 0.4}, controls)
    assert_equal(named, run)
    expected, found = pullback(weights), back(weights)
    assert set(found.parameters) == {friction, mass}
    assert [found.parameters[name] for name in rollout.parameters] == expected.parameters.tolist()
    # Some, for each world or for all.
    many, one = prehend.vjp(rollout, state, {mass: np.array([0.1, 0.2])}, controls)
    assert many.bodies.shape == (2, 121, 2, 13)
    np.testing.assert_array_equal(many.bodies[0], run.bodies)
    gradient = one(Run(bodies=np.stack(2 * [weights.bodies])))
    assert list(gradient.parameters) == [mass] and gradient.parameters[mass].shape == (2,)
    assert gradient.parameters[mass][0] == expected.parameters[1]
    along = rollout.jvp((state, {mass: 0.1}, controls), (None, {mass: 1.0}, None))[1]
    assert (along.bodies[-1] * weights.bodies).sum() == pytest.approx(expected.parameters[1], rel=1e-4)
    still = rollout.jvp((state, {mass: 0.1}, controls), (prehend.State(), None, None))[1]
    assert not still.bodies.any()
    with pytest.raises(prehend.Error, match="tangents of parameters: a dict"):
        rollout.jvp((state, {mass: 0.1}, controls), (None, [1.0, 0.0], None))
    with pytest.raises(prehend.Error, match="no parameter 'ball.color'"):
        rollout(state, {"ball.color": 1.0}, controls)


def test_lists_other_types_and_orders_are_arrays_too():
    rollout, (state, parameters, controls) = bounce()
    expected = rollout(state, parameters, controls)
    lists = State(*(x.tolist() for x in state[:2]))
    ordered = State(*map(np.asfortranarray, state))
    others = [
        (lists, tuple(parameters), controls.tolist()),
        (ordered, parameters[::1], np.repeat(controls, 2, 1)[:, ::2]),
    ]
    for inputs in others:
        assert_equal(rollout(*inputs), expected)


def test_inputs_stay_as_they_are_and_results_are_new():
    rollout, inputs = bounce()
    before = [x.copy() for x in leaves(inputs)]
    run = rollout(*inputs)
    for x in leaves(run):
        x[...] = 0.0
    for x, old in zip(leaves(inputs), before, strict=True):
        np.testing.assert_array_equal(x, old)
    assert rollout(*inputs).state.q[0, 2] == 0.04


def test_shapes_that_do_not_fit_are_refused():
    rollout, (state, parameters, controls) = bounce()
    for text, inputs in {
        "state.q: an array of 7 is": (state._replace(q=state.q[1:]), parameters, controls),
        "state.fixed: an array of 1 × 13": (state._replace(fixed=state.fixed[0]), parameters, controls),
        "a prehend.State is expected, not of the type ndarray": (state.q, parameters, controls),
        "parameters: an array of 2": (state, parameters[:1], controls),
        "controls: an array of 120 × 1": (state, parameters, controls[1:]),
        "controls are missing: ball.force_y": (state, parameters),
        "a batch of 3, but others are of 4": (
            state._replace(q=np.repeat(state.q[None], 4, 0)),
            np.repeat(parameters[None], 3, 0),
            controls,
        ),
    }.items():
        with pytest.raises(prehend.Error, match=text):
            rollout(*inputs)
    run, pullback = prehend.vjp(rollout, state, parameters, controls)
    with pytest.raises(prehend.Error, match="adjoints, bodies: an array of"):
        pullback(Run(bodies=run.bodies[:-1]))
    with pytest.raises(prehend.Error, match="run, q: an array of"):
        rollout.pullback(Run(bodies=run.bodies), Run(), state, parameters, controls)
    with pytest.raises(prehend.Error, match="a prehend.Run is expected"):
        pullback(run.bodies)


def test_the_world_that_fails_is_named():
    rollout, inputs = bounce()
    state, parameters, controls = batch(inputs)
    parameters[2, 0] = -1.0
    with pytest.raises(prehend.Error, match="world 2: .*friction"):
        rollout(state, parameters, controls)


def test_changes_in_place_change_no_derivative():
    rollout, (state, parameters, controls) = bounce()
    weights = Run(bodies=np.ones((2, 13)))
    expected = prehend.vjp(rollout, state, parameters, controls)[1](weights)
    run, pullback = prehend.vjp(rollout, state, parameters, controls)
    for x in leaves(run):
        x[...] = 0.0
    state.v[0], parameters[0], controls[:] = 9.0, 0.1, 7.0
    assert_equal(pullback(weights), expected)


def test_a_chain_of_joints_has_its_derivatives():
    """Of positions, velocities and poses, by differences along coordinates."""
    model = prehend.Model()
    inertia, com = [2e-3, 3e-3, 4e-3], [0.02, 0.0, -0.1]
    links = [
        prehend.Link("slide", "prismatic", axis=[1, 0, 0], mass=0.5, com=com, inertia=inertia),
        prehend.Link("ball", "spherical", parent=0, at=[0, 0, -0.1], mass=0.4, com=com, inertia=inertia),
        prehend.Link("rod", axis=[0, 1, 0], parent=1, at=[0, 0.1, -0.2], mass=0.3, com=com, inertia=inertia),
    ]
    slide, ball, rod = model.add_articulation(links)
    assert (model.nq, model.nv, model.na) == (6, 5, 0)
    state = model.neutral_state()
    turn = np.array([0.1, -0.2, 0.3, 0.9])
    model.set_joint(state, slide, [0.1], [0.5])
    model.set_joint(state, ball, turn / np.linalg.norm(turn), [1.0, -0.5, 0.3])
    model.set_joint(state, rod, [0.4], [-0.7])
    rollout = model.rollout(2e-3, 100, integrator="runge_kutta_4")
    run, pullback = prehend.vjp(rollout, state)
    np.testing.assert_allclose(run.bodies[0], model.forward_kinematics(state), atol=1e-15)
    random = np.random.default_rng(5)
    weights = Run(State(random.normal(size=run.state.q[-1].shape)), random.normal(size=run.bodies[-1].shape))
    gradient = pullback(weights)

    def loss(state):
        end = rollout(state, end=True)
        return (weights.state.q * end.state.q).sum() + (weights.bodies * end.bodies).sum()

    quaternion = model.q_slice(ball)
    for name, size in (("q", 6), ("v", 5)):
        along = random.normal(size=size)
        if name == "q":
            at = state.q[quaternion]
            along[quaternion] -= at * (at @ along[quaternion])
        h = 1e-6
        moved = [state._replace(**{name: getattr(state, name) + s * h * along}) for s in (1, -1)]
        difference = (loss(moved[0]) - loss(moved[1])) / (2 * h)
        assert getattr(gradient.state, name) @ along == pytest.approx(difference, rel=1e-6)


def test_the_pose_of_a_fixed_body_has_its_derivative():
    rollout, (state, parameters, controls) = bounce(integrator="semi_implicit_euler")
    _, pullback = prehend.vjp(rollout, state, parameters, controls)
    weights = np.zeros((2, 13))
    weights[1] = np.cos(np.arange(13.0))
    slopes = pullback(Run(bodies=weights)).state.fixed[0]

    def at(height, tilt):
        fixed = state.fixed.copy()
        fixed[0, 2] += height
        fixed[0, 3:7] = [np.sin(tilt / 2), 0.0, 0.0, np.cos(tilt / 2)]
        return (weights * rollout(state._replace(fixed=fixed), parameters, controls, end=True).bodies).sum()

    h = 1e-7
    assert abs(slopes[2]) > 1e-3
    assert slopes[2] == pytest.approx((at(h, 0) - at(-h, 0)) / (2 * h), rel=1e-4)
    assert 0.5 * slopes[3] == pytest.approx((at(0, h) - at(0, -h)) / (2 * h), rel=1e-4)


def forked(rollout, state, parameters, controls, queue):
    queue.put(rollout(state, parameters, controls, end=True).bodies)


INTERRUPTED = """
import os, signal, threading, time, prehend
model = prehend.Model()
model.add_body("ball", prehend.Shape.ball(0.03), density=1000.0)
rollout = model.rollout(1e-3, 20_000_000, integrator="semi_implicit_euler")
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
began = time.monotonic()
try:
    rollout(model.neutral_state(), end=True)
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
    expected = rollout(*many, end=True).bodies
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    process = fork.Process(target=forked, args=(rollout, *many, queue))
    process.start()
    np.testing.assert_array_equal(queue.get(timeout=60), expected)
    process.join(60)
    assert process.exitcode == 0


def test_other_threads_run_meanwhile():
    model, state, _, _ = thrown_ball()
    rollout = model.rollout(1e-6, 200_000, integrator="semi_implicit_euler")
    ticks, running = [], True

    def tick():
        while running:
            ticks.append(time.perf_counter())
            time.sleep(1e-3)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    rollout(state, end=True)
    took = time.perf_counter() - start
    running = False
    thread.join()
    during = [t for t in ticks if start < t < start + took]
    # Were the lock held, there would be none.
    assert len(during) > 5
