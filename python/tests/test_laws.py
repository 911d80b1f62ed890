"""Contact laws written in Python."""

import numpy as np
import prehend
import pytest
from prehend.laws import Dual, regularized_coulomb

from scenes import leaves, thrown_ball


class Penalty:
    """The law `penalty` of Rust once more."""

    parameters = ["stiffness", "damping", "friction"]

    def law(self, p, contact):
        stiffness, damping, friction = p
        force = -(stiffness * contact.gap + damping * contact.normal_speed) * contact.area
        normal = force if force > 0.0 else 0.0 * force
        return normal, regularized_coulomb(friction, normal, contact.slip, 2e-2)


def test_a_law_in_python_is_the_same_law():
    model, state, _, contact = thrown_ball()
    own = prehend.Model()
    floor = own.add_body("floor", prehend.Shape.half_space(), fixed=True)
    ball = own.add_body("ball", prehend.Shape.ball(0.03), mass=0.1)
    with pytest.warns(UserWarning, match="slow"):
        names = own.add_contact(
            ball, floor, Penalty(), smoothing=1e-5, stiffness=2e6, damping=1e3, friction=0.4
        )
    assert names == contact
    options = {"parameters": list(names.values()), "integrator": "semi_implicit_euler"}
    fast, slow = (w.rollout(2e-4, 200, **options) for w in (model, own))
    np.testing.assert_allclose(slow(state).bodies, fast(state).bodies, rtol=1e-9, atol=1e-12)
    weights = prehend.Run(bodies=np.cos(np.arange(26.0)).reshape(2, 13))
    gradients = [leaves(prehend.vjp(f, state)[1](weights)) for f in (fast, slow)]
    for a, b in zip(*gradients, strict=True):
        np.testing.assert_allclose(b, a, rtol=1e-8, atol=1e-8 * np.abs(a).max(initial=0.0))


def test_dual_numbers_have_their_derivatives():
    functions = [
        lambda x, y: x * y - x / y + 2.0 / x - 3.0 * y + 1.0,
        lambda x, y: np.sqrt(x) * np.exp(-y) + np.log(x * y),
        lambda x, y: np.sin(x) * np.cos(y) + np.tan(x) + np.tanh(y) + np.arctan(x * y),
        lambda x, y: x**3 + x**y + 2.0**y + abs(-x) - (+y) + (1.0 - x) + x**0,
    ]
    for function in functions:
        x, y = 0.7, 1.3
        slopes = np.eye(2)
        dual = function(Dual(x, slopes[0]), Dual(y, slopes[1]))
        assert dual.value == pytest.approx(function(x, y))
        h = 1e-6
        differences = [
            (function(x + h, y) - function(x - h, y)) / (2 * h),
            (function(x, y + h) - function(x, y - h)) / (2 * h),
        ]
        assert dual.slopes == pytest.approx(differences, rel=1e-8)
    with pytest.raises(TypeError, match="lose the derivatives"):
        float(dual)


@pytest.mark.filterwarnings("ignore:a contact law in Python")
def test_what_is_wrong_with_a_law_is_said():
    model, state, _, _ = thrown_ball()
    with pytest.raises(prehend.Error, match="a contact law is a name, or an object"):
        model.add_contact("ball", "floor", object())
    with pytest.raises(prehend.Error, match="parameter 'stiffness' is missing"):
        model.add_contact("ball", "floor", Penalty())

    class Broken:
        def law(self, p, contact):
            raise RuntimeError("this law is broken")

    model.add_contact("ball", "floor", Broken())
    state.q[2] = 0.029
    rollout = model.rollout(1e-3, 1, integrator="semi_implicit_euler")
    with pytest.raises(RuntimeError, match="this law is broken"):
        rollout(state)
    # A batch has more threads than one, and the next call knows nothing of it.
    with pytest.raises(RuntimeError, match="this law is broken"):
        rollout(state._replace(q=np.repeat(state.q[None], 4, 0)))
    state.q[2] = 1.0
    rollout(state)
