"""Models: bodies, shapes, contacts, parameters by name, and what is refused."""

import copy

import numpy as np
import prehend
import pytest
from prehend import POSITION, VELOCITY

from scenes import thrown_ball


def test_a_ball_falls_and_comes_to_rest():
    model = prehend.Model()
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    ball = model.add_body("ball", prehend.Shape.ball(0.03), density=1000.0)
    model.add_contact(
        ball, floor, "hunt_crossley", smoothing=1e-5,
        stiffness=1e9, damping=1.0, exponent=1.5, friction=0.5, slip_scale=1e-2,
    )
    assert model.bodies == ["floor", "ball"] and model.body("ball") == ball == 1
    state = model.neutral_state()
    model.set_pose(state, "ball", [0.0, 0.0, 0.1])
    free = model.rollout(0.05, 1)(state, end=True)
    assert free.bodies[ball, 2] == pytest.approx(0.1 - 0.5 * 9.81 * 0.05**2, abs=1e-8)
    end = model.rollout(2.0, 1)(state, end=True)
    assert end.bodies[ball, 2] == pytest.approx(0.03, abs=3e-3)
    assert np.abs(end.bodies[ball, VELOCITY]).max() < 1e-2
    weight = model["ball.mass"] * 9.81
    assert model.contact_wrench(end.state, ball)[2] == pytest.approx(weight, rel=2e-2)
    points = model.point_contacts(end.state)
    assert points.bodies.tolist() == [[ball, floor]] and points.gap[0] < 0.0
    assert points.normal[0] == pytest.approx([0, 0, 1]) and points.position[0, 2] == pytest.approx(0.0, abs=3e-3)
    assert points.force.sum(0) == pytest.approx(model.contact_wrench(end.state, ball)[:3])
    # At rest an accelerometer shows what holds the body up.
    assert model.accelerometer(end.state, ball, [0, 0, 0])[2] == pytest.approx(9.81, rel=2e-2)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (prehend.Shape.ball(0.1), 4 / 3 * np.pi * 1e-3),
        (prehend.Shape.cuboid([0.1, 0.2, 0.3]), 0.048),
        (prehend.Shape.cylinder(0.2, 0.1), np.pi * 0.01 * 0.4),
        (prehend.Shape.cone(0.2, 0.1), np.pi * 0.01 * 0.4 / 3),
        (prehend.Shape.capsule(0.2, 0.1), np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 1e-3),
        (prehend.Shape.convex_hull(np.array(np.meshgrid(*3 * [[-0.1, 0.1]])).reshape(3, -1).T), 0.008),
        (
            prehend.Shape.compound(
                [(prehend.Shape.ball(0.1), [0, 0, 0]), (prehend.Shape.ball(0.1), [0.3, 0, 0])]
            ),
            8 / 3 * np.pi * 1e-3,
        ),
    ],
)
def test_shapes_have_their_volume(shape, volume):
    assert shape.volume == pytest.approx(volume, rel=1e-9)
    model = prehend.Model()
    model.add_body("body", shape, density=500.0)
    assert model["body.mass"] == pytest.approx(500 * volume, rel=1e-9)


def test_a_mesh_is_a_shape():
    corners = np.array(np.meshgrid(*3 * [[-0.1, 0.1]], indexing="ij")).reshape(3, -1).T
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
    assert prehend.Shape.mesh(corners, faces).volume == pytest.approx(0.008, rel=1e-9)
    with pytest.raises(prehend.Error, match="no vertex 8"):
        prehend.Shape.mesh(corners, [[0, 1, 8]])


def test_poses_are_those_of_a_bodys_frame():
    model = prehend.Model()
    inertia = np.diag([1e-3, 2e-3, 2.5e-3])
    stone = model.add_body("stone", mass=0.2, com=[0.01, 0.02, 0.03], inertia=inertia)
    pose = np.array([[0.0, -1, 0, 0.5], [1, 0, 0, 0.6], [0, 0, 1, 0.7], [0, 0, 0, 1]])
    state = model.neutral_state()
    model.set_pose(state, stone, pose)
    np.testing.assert_allclose(state.q[POSITION], pose[:3, :3] @ [0.01, 0.02, 0.03] + pose[:3, 3])
    np.testing.assert_allclose(model.pose(state, stone), pose, atol=1e-15)


def test_parameters_are_read_and_written_by_name():
    model, _, _, contact = thrown_ball()
    assert contact["friction"] == "ball/floor.friction" and contact["friction"] in model
    other = model.copy()
    other["ball/floor.friction"] = 0.7
    assert (model["ball/floor.friction"], other["ball/floor.friction"]) == (0.4, 0.7)
    assert other["gravity.z"] == -9.81
    with pytest.raises(KeyError, match="do you mean 'ball.mass'"):
        model["ball.masss"]
    with pytest.raises(prehend.Error, match="mass"):
        model["ball.mass"] = -1.0


def test_laws_are_described():
    summary, parameters = prehend.contact_laws()["penalty"]
    assert summary and ("stiffness", "N/m^3") in [(name, unit) for name, unit, _ in parameters]
    assert "position_servo" in prehend.joint_laws()


def test_what_cannot_be_is_refused():
    model, state, ball, _ = thrown_ball()
    rollout = model.rollout(1e-3, 5)
    for text, call in {
        "no contact law called": lambda: model.add_contact("ball", "floor", "glue"),
        "stiffness is missing": lambda: model.add_contact("ball", "floor", "penalty"),
        "no parameter 'color', of stiffness": lambda: model.add_contact(
            "ball", "floor", "penalty", stiffness=1.0, damping=1.0, friction=0.0, slip_scale=1.0, color=2.0
        ),
        "there is no body 'wall'": lambda: model.pose(state, "wall"),
        "no mass": lambda: model.add_body("ghost"),
        "called 'ball.mas': do you mean 'ball.mass'": lambda: model.rollout(1e-3, 5, parameters=["ball.mas"]),
        "'ball.mass' is named twice": lambda: model.rollout(1e-3, 5, parameters=2 * ["ball.mass"]),
        "there is a body 'ball' already": lambda: model.add_body("ball", prehend.Shape.ball(0.1)),
        "state.q: an array of NumPy in double precision": lambda: model.set_pose(
            state._replace(q=state.q.astype(np.float32)), ball, [0, 0, 0]
        ),
        "state.act: an array of NumPy": lambda: model.set_pose(state._replace(act=None), ball, [0, 0, 0]),
        "no integrator called 'euler'": lambda: model.rollout(1e-3, 5, integrator="euler"),
        "state.v: an array of 6 is expected": lambda: rollout(state._replace(v=state.v[:5])),
        "state.fixed: an array of 1 × 13": lambda: rollout(state._replace(fixed=state.fixed[:, :12])),
        "no rotation": lambda: model.set_pose(state, ball, np.diag([1.0, 1.0, -1.0, 1.0])),
        "time step": lambda: model.rollout(-1.0, 5),
    }.items():
        with pytest.raises(prehend.Error, match=text):
            call()
    # A refused contact leaves nothing behind.
    assert [name for name in model if "/" in name] == [f"ball/floor.{p}" for p in ("stiffness", "damping", "friction")]


@pytest.mark.parametrize(
    ("text", "make"),
    {
        "radius must be positive": lambda: prehend.Shape.cylinder(0.1, -1.0),
        "half_height must be positive": lambda: prehend.Shape.capsule(-1.0, 0.1),
        "2 × 2 at least": lambda: prehend.Shape.height_field(np.zeros((1, 5)), [1, 1, 1]),
        "a compound is among them": lambda: prehend.Shape.compound(
            [(prehend.Shape.compound([(prehend.Shape.ball(0.1), [0, 0, 0])]), [0, 0, 0])]
        ),
        "no vertex 0.6": lambda: prehend.Shape.mesh(np.eye(3), [[0.6, 1.2, 2.9]]),
        "symmetric": lambda: prehend.Link("rod", mass=1.0, com=[0, 0, 0], inertia=[-0.1, 1, 1]),
    }.items(),
)
def test_shapes_and_links_that_cannot_be_are_refused(text, make):
    with pytest.raises(prehend.Error, match=text):
        make()


def test_states_that_cannot_be_are_refused():
    model, state, ball, _ = thrown_ball()
    with pytest.raises(prehend.Error, match="quaternion of 'ball' has the length 0"):
        model.rollout(1e-3, 1)(state._replace(q=np.zeros(7)))
    with pytest.raises(prehend.Error, match="state.q: an array of 7"):
        model.longest_step(state._replace(q=state.q[:1]))
    with pytest.raises(prehend.Error, match="no memory"):
        model.rollout(1e-3, 2**62)(state)
    rod = model.add_articulation([prehend.Link("rod", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1])])[0]
    with pytest.raises(prehend.Error, match="'rod' is a link"):
        model.set_pose(model.neutral_state(), rod, [0, 0, 1])


def test_a_state_has_the_coordinates_of_free_bodies_and_joints():
    model = prehend.Model()
    ball = model.add_body("ball", prehend.Shape.ball(0.03), mass=0.1)
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    rod = model.add_articulation([prehend.Link("rod", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1])])[0]
    assert (model.nq, model.nv, model.na) == (8, 7, 0)
    assert (model.q_slice(rod), model.v_slice("rod")) == (slice(7, 8, 1), slice(6, 7, 1))
    assert model.q_slice(ball) == slice(0, 7, 1) and model.fixed_row(floor) == 0
    state = model.neutral_state()
    model.set_pose(state, ball, [1, 2, 3], velocity=[4, 5, 6], angular_velocity=[7, 8, 9])
    model.set_joint(state, rod, [0.5], [0.25])
    model.set_pose(state, floor, [0, 0, -1], [0.1, 0, 0])
    np.testing.assert_allclose(state.q, [1, 2, 3, 0, 0, 0, 1, 0.5])
    np.testing.assert_allclose(state.v, [4, 5, 6, 7, 8, 9, 0.25])
    np.testing.assert_allclose(state.fixed, [[0, 0, -1, 0, 0, 0, 1, 0.1, 0, 0, 0, 0, 0]])
    bodies = model.forward_kinematics(state)
    np.testing.assert_allclose(bodies[ball], [*state.q[:7], *state.v[:6]])
    np.testing.assert_allclose(bodies[rod, [4, 11]], [np.sin(0.25), 0.25])
    assert model.rollout(1e-3, 1)(state).bodies[0].tolist() == bodies.tolist()
    for body, text in {floor: "'floor' has no coordinates", "wall": "no body 'wall'"}.items():
        with pytest.raises(prehend.Error, match=text):
            model.q_slice(body)
    with pytest.raises(prehend.Error, match="forces move body 'ball'"):
        model.fixed_row(ball)


def test_states_of_a_batch_are_written_and_read():
    model, state, ball, _ = thrown_ball()
    rod = model.add_articulation([prehend.Link("rod", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1])])[0]
    state = prehend.State(*(np.repeat(x[None], 3, 0) for x in model.neutral_state()))
    model.set_pose(state, ball, [0, 0, 1], [1, 0, 0])
    model.set_joint(state, rod, [0.2])
    state.q[1, 0] = 5.0
    assert state.q[:, 2].tolist() == 3 * [1.0] and state.v[:, 0].tolist() == 3 * [1.0]
    assert model.pose(state, ball)[:, 0, 3].tolist() == [0.0, 5.0, 0.0]
    assert model.forward_kinematics(state).shape == (3, 3, 13)
    assert model.joint(state, rod)[0].tolist() == 3 * [[0.2]]
    assert model.contact_wrench(state, ball).shape == (3, 6) and model.longest_step(state) == np.inf


def test_contacts_with_bristles_have_activations():
    model = prehend.Model()
    model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    cube = model.add_body("cube", prehend.Shape.cuboid([0.03, 0.03, 0.03]), density=500.0)
    model.add_contacts(friction=0.5)
    state = model.neutral_state()
    assert model.na == state.act.size > 0 and model.na % 6 == 0
    model.set_pose(state, cube, [0.0, 0.0, 0.03], velocity=[0.2, 0.0, 0.0])
    rollout = model.rollout(0.02, 2)
    run, pullback = prehend.vjp(rollout, state)
    assert np.abs(run.state.act[-1]).max() > 0
    weights = np.zeros_like(run.bodies[-1])
    weights[cube, 0] = 1.0
    assert pullback(prehend.Run(bodies=weights)).state.act.shape == (model.na,)
    # A run goes on with its deflections.
    on = model.rollout(0.02, 1)(prehend.State(*(x[1] for x in run.state)), end=True)
    np.testing.assert_allclose(on.bodies, run.bodies[-1], atol=1e-6)


def test_poses_may_be_views_of_the_state():
    model, state, ball, _ = thrown_ball()
    expected = copy.deepcopy(state)
    model.set_pose(state, ball, state.q[:3], velocity=state.v[:3])
    np.testing.assert_array_equal(state.q, expected.q)
    np.testing.assert_array_equal(state.v, expected.v)


def test_contacts_both_ways_have_one_set_of_parameters():
    model = prehend.Model(gravity=[0, 0, 0])
    a, b = (model.add_body(name, prehend.Shape.cuboid([0.05] * 3), mass=1.0) for name in "ab")
    names = model.add_contact(
        a, b, "penalty", both_ways=True, stiffness=1e8, damping=0.0, friction=0.0, slip_scale=0.1
    )
    assert len([name for name in model if name.endswith("stiffness")]) == 1
    state = model.neutral_state()
    model.set_pose(state, b, [0, 0, 0.0999])
    rollout = model.rollout(1e-4, 1, parameters=[names["stiffness"]], integrator="semi_implicit_euler")
    once, twice = (rollout(state, [k], end=True).bodies[b, 9] for k in (1e8, 2e8))
    assert twice == pytest.approx(2 * once, rel=1e-9) and once > 0


def test_a_model_is_a_mapping_that_can_be_copied():
    model, _, _, _ = thrown_ball()
    assert list(model) == model.parameters and len(model) == len(model.parameters)
    assert copy.deepcopy(model).parameters == model.parameters


def test_many_balls_touch_by_groups():
    model = prehend.Model()
    floor = model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    balls = [model.add_body(f"ball {k}", prehend.Shape.ball(0.05), mass=0.1) for k in range(3)]
    names = model.add_contacts_between(
        [floor, *balls], balls, "penalty", smoothing=1e-5,
        stiffness=2e6, damping=1e4, friction=0.4, slip_scale=2e-2,
    )
    state = model.neutral_state()
    for k, ball in enumerate(balls):
        model.set_pose(state, ball, [0.0, 0.0, 0.05 + 0.1001 * k])
    end = model.rollout(0.1, 2, parameters=[names["stiffness"]])(state, end=True)
    assert end.bodies[balls, 2] == pytest.approx([0.05, 0.15, 0.25], abs=2e-3)


def test_contacts_of_all_bodies_need_no_law():
    model = prehend.Model()
    model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    cube = model.add_body("cube", prehend.Shape.cuboid([0.03, 0.03, 0.03]), density=500.0)
    model.add_contacts(friction=0.5)
    state = model.neutral_state()
    model.set_pose(state, "cube", [0.0, 0.0, 0.03], velocity=[1.0, 0.0, 0.0])
    rollout = model.rollout(0.5, 1)
    run, pullback = prehend.vjp(rollout, state)
    # It slides by v²/2µg, to its derivative v/µg.
    assert run.bodies[-1, cube, 0] == pytest.approx(0.102, abs=2e-3)
    by_x = np.zeros_like(run.state.q[-1])
    by_x[0] = 1.0
    assert pullback(prehend.Run(prehend.State(by_x))).state.v[0] == pytest.approx(0.204, abs=4e-3)
    with pytest.raises(ValueError, match="restitution"):
        model.copy().add_contacts(restitution=2.0)


def test_copies_of_what_never_changes_are_itself():
    shape = prehend.Shape.ball(0.1)
    assert copy.deepcopy(shape) is shape and copy.copy(shape) is shape
