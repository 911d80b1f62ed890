"""Scenes of the tests."""

import numpy as np
import prehend


def thrown_ball(smoothing=1e-5):
    """A ball that is thrown at a floor: the model, its states, the ball's row, and the names of the contact's parameters."""
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
    states = model.neutral_states()
    model.set_pose(states, ball, [0.0, 0.0, 0.04], velocity=[0.5, 0.1, -0.3])
    return model, states, ball, contact


def bounce(**options):
    """The rollout of that throw over the bounce, by friction and mass, with a push at each step, and its inputs."""
    model, states, _, contact = thrown_ball()
    names = [contact["friction"], "ball.mass"]
    rollout = model.rollout(5e-4, 120, parameters=names, controls=["ball.force_y"], **options)
    controls = 0.01 * np.sin(np.arange(120.0))[:, None]
    return rollout, (states, np.array([0.4, 0.1]), controls)


def batch(inputs, worlds=4):
    """The same inputs for several worlds that differ a little."""
    scale = 1.0 + 0.01 * np.arange(worlds)
    states, parameters, controls = inputs
    many = np.repeat(states[None], worlds, 0)
    many[:, 1, 7:10] *= scale[:, None]
    return many, parameters * scale[:, None], controls * scale[:, None, None]
