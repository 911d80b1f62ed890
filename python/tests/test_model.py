"""Worlds: bodies, shapes, contacts, parameters by name, and what is refused."""

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
    states = model.neutral_states()
    model.set_pose(states, "ball", [0.0, 0.0, 0.1])
    free = model.rollout(0.05, 1)(states, end=True)
    assert free[ball, 2] == pytest.approx(0.1 - 0.5 * 9.81 * 0.05**2, abs=1e-8)
    end = model.rollout(2.0, 1)(states, end=True)
    assert end[ball, 2] == pytest.approx(0.03, abs=3e-3)
    assert np.abs(end[ball, VELOCITY]).max() < 1e-2
    weight = model["ball.mass"] * 9.81
    assert model.contact_wrench(end, ball)[2] == pytest.approx(weight, rel=2e-2)
    # At rest an accelerometer shows what holds the body up.
    assert model.accelerometer(end, ball, [0, 0, 0])[2] == pytest.approx(9.81, rel=2e-2)


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
    states = model.neutral_states()
    model.set_pose(states, stone, pose)
    np.testing.assert_allclose(states[stone, POSITION], pose[:3, :3] @ [0.01, 0.02, 0.03] + pose[:3, 3])
    np.testing.assert_allclose(model.pose(states, stone), pose, atol=1e-15)


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
    model, states, ball, _ = thrown_ball()
    rollout = model.rollout(1e-3, 5)
    for text, call in {
        "no contact law called": lambda: model.add_contact("ball", "floor", "glue"),
        "stiffness is missing": lambda: model.add_contact("ball", "floor", "penalty"),
        "no parameter 'color', of stiffness": lambda: model.add_contact(
            "ball", "floor", "penalty", stiffness=1.0, damping=1.0, friction=0.0, slip_scale=1.0, color=2.0
        ),
        "there is no body 'wall'": lambda: model.pose(states, "wall"),
        "no mass": lambda: model.add_body("ghost"),
        "called 'ball.mas': do you mean 'ball.mass'": lambda: model.rollout(1e-3, 5, parameters=["ball.mas"]),
        "'ball.mass' is named twice": lambda: model.rollout(1e-3, 5, parameters=2 * ["ball.mass"]),
        "there is a body 'ball' already": lambda: model.add_body("ball", prehend.Shape.ball(0.1)),
        "in double precision": lambda: model.set_pose(states.astype(np.float32), ball, [0, 0, 0]),
        "no integrator called 'euler'": lambda: model.rollout(1e-3, 5, integrator="euler"),
        "an array of n × 13": lambda: rollout(states[:, :12]),
        "1 states for 2 bodies": lambda: rollout(states[:1]),
        "no rotation": lambda: model.set_pose(states, ball, np.diag([1.0, 1.0, -1.0, 1.0])),
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
    model, states, ball, _ = thrown_ball()
    with pytest.raises(prehend.Error, match="state 0: its quaternion has the length 0"):
        model.rollout(1e-3, 1)(np.zeros_like(states))
    with pytest.raises(prehend.Error, match="1 states for 2 bodies"):
        model.longest_step(states[:1])
    with pytest.raises(prehend.Error, match="no memory"):
        model.rollout(1e-3, 2**62)(states)
    rod = model.add_articulation([prehend.Link("rod", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1])])[0]
    with pytest.raises(prehend.Error, match="'rod' is a link"):
        model.set_pose(model.neutral_states(), rod, [0, 0, 1])


def test_generalized_coordinates_are_those_of_free_bodies_and_joints():
    model = prehend.Model()
    ball = model.add_body("ball", prehend.Shape.ball(0.03), mass=0.1)
    rod = model.add_articulation([prehend.Link("rod", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1])])[0]
    states = model.neutral_states()
    model.set_pose(states, ball, [1, 2, 3], velocity=[4, 5, 6], angular_velocity=[7, 8, 9])
    model.set_joint(states, rod, [0.5], [0.25])
    q, v = model.generalized_coordinates(states)
    np.testing.assert_allclose(q, [1, 2, 3, 0, 0, 0, 1, 0.5])
    np.testing.assert_allclose(v, [4, 5, 6, 7, 8, 9, 0.25])
    other = model.neutral_states()
    model.set_generalized_coordinates(other, q, v)
    np.testing.assert_allclose(other, states, atol=1e-15)
    model.set_generalized_coordinates(other, q)
    assert not other[ball, 7:].any()
    with pytest.raises(prehend.Error, match="7 positions and 7 velocities were given: the model has 8 and 7"):
        model.set_generalized_coordinates(other, q[1:])


def test_poses_may_be_views_of_the_states():
    model, states, ball, _ = thrown_ball()
    expected = states.copy()
    model.set_pose(states, ball, states[ball, :3], velocity=states[ball, 7:10])
    np.testing.assert_array_equal(states, expected)


def test_contacts_both_ways_have_one_set_of_parameters():
    model = prehend.Model(gravity=[0, 0, 0])
    a, b = (model.add_body(name, prehend.Shape.cuboid([0.05] * 3), mass=1.0) for name in "ab")
    names = model.add_contact(
        a, b, "penalty", both_ways=True, stiffness=1e8, damping=0.0, friction=0.0, slip_scale=0.1
    )
    assert len([name for name in model if name.endswith("stiffness")]) == 1
    states = model.neutral_states()
    model.set_pose(states, b, [0, 0, 0.0999])
    rollout = model.rollout(1e-4, 1, parameters=[names["stiffness"]], integrator="semi_implicit_euler")
    once, twice = (rollout(states, [k], end=True)[b, 9] for k in (1e8, 2e8))
    assert twice == pytest.approx(2 * once, rel=1e-9) and once > 0


def test_a_world_is_a_mapping_that_can_be_copied():
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
    states = model.neutral_states()
    for k, ball in enumerate(balls):
        model.set_pose(states, ball, [0.0, 0.0, 0.05 + 0.1001 * k])
    end = model.rollout(0.1, 2, parameters=[names["stiffness"]])(states, end=True)
    assert end[balls, 2] == pytest.approx([0.05, 0.15, 0.25], abs=2e-3)


def test_contacts_of_all_bodies_need_no_law():
    model = prehend.Model()
    model.add_body("floor", prehend.Shape.half_space(), fixed=True)
    cube = model.add_body("cube", prehend.Shape.cuboid([0.03, 0.03, 0.03]), density=500.0)
    model.add_contacts(friction=0.5)
    states = model.neutral_states()
    model.set_pose(states, "cube", [0.0, 0.0, 0.03], velocity=[1.0, 0.0, 0.0])
    rollout = model.rollout(0.5, 1)
    run, pullback = prehend.vjp(rollout, states)
    # It slides by v²/2µg, to its derivative v/µg.
    assert run[-1, cube, 0] == pytest.approx(0.102, abs=2e-3)
    end = np.zeros_like(run[-1])
    end[cube, 0] = 1.0
    assert pullback(end).states[cube, 7] == pytest.approx(0.204, abs=4e-3)
    with pytest.raises(ValueError, match="restitution"):
        model.copy().add_contacts(restitution=2.0)


def test_copies_of_what_never_changes_are_itself():
    shape = prehend.Shape.ball(0.1)
    assert copy.deepcopy(shape) is shape and copy.copy(shape) is shape
