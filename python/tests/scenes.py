"""Scenes of the tests."""

import numpy as np
import prehend
from prehend import State


def thrown_ball(smoothing=1e-5):
    """A ball that is thrown at a floor: the model, its state, the ball's number, and the names of the contact's parameters."""
    model = prehend.Model()
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    ball = model.add_body("ball", prehend.Shape.ball(0.03), mass=0.1)
    contact = model.add_contact(
        ball,
        floor,
        "penalty",
        smoothing=smoothing,
        stiffness=2e6,
        damping=1e3,
        friction=0.4,
        slip_scale=2e-2,
    )
    state = model.neutral_state()
    model.set_pose(state, ball, [0.0, 0.0, 0.04], velocity=[0.5, 0.1, -0.3])
    return model, state, ball, contact


def bounce(**options):
    """The rollout of that throw over the bounce, by friction and mass, with a push at each step, and its inputs."""
    model, state, _, contact = thrown_ball()
    names = [contact["friction"], "ball.mass"]
    rollout = model.rollout(5e-4, 120, parameters=names, controls=["ball.force_y"], **options)
    controls = 0.01 * np.sin(np.arange(120.0))[:, None]
    return rollout, (state, np.array([0.4, 0.1]), controls)


def batch(inputs, worlds=4):
    """The same inputs for several worlds that differ a little."""
    scale = 1.0 + 0.01 * np.arange(worlds)
    state, parameters, controls = inputs
    many = State(*(np.repeat(x[None], worlds, 0) for x in state))
    many.v[:, :3] *= scale[:, None]
    return many, parameters * scale[:, None], controls * scale[:, None, None]


def leaves(inputs):
    """The arrays of state, parameters and controls, or of a run."""
    state, *others = inputs
    return [*state, *others]


def inputs_of(arrays):
    return State(*arrays[:4]), *arrays[4:]


def assert_equal(found, expected):
    """Arrays of two runs, or of two gradients, are the same to the bit."""
    for a, b in zip(leaves(found), leaves(expected), strict=True):
        np.testing.assert_array_equal(a, b)
