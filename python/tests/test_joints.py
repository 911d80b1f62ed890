"""Articulations and robots."""

import os
from pathlib import Path

import numpy as np
import prehend
import pytest

DATA = os.environ.get("PREHEND_DATA")
needs_data = pytest.mark.skipif(DATA is None, reason="PREHEND_DATA is not set")


def pendulum():
    model = prehend.Model()
    rod = prehend.Link("rod", "revolute", axis=[0, 1, 0], mass=1.0, com=[0, 0, -1], inertia=3 * [4e-3])
    [rod] = model.add_articulation([rod])
    return model, rod


def test_a_pendulum_has_its_period():
    model, rod = pendulum()
    states = model.neutral_states()
    angle = 0.3
    model.set_joint(states, rod, [angle])
    # 4 K(sin(θ/2)) √(I / m g l) by the arithmetic-geometric mean.
    a, b = 1.0, np.cos(0.5 * angle)
    for _ in range(20):
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    period = 2 * np.pi / a * np.sqrt(1.004 / 9.81)
    end = model.rollout(period, 1)(states, end=True)
    assert model.joint(end, rod)[0][0] == pytest.approx(angle, abs=1e-4)
    assert end[model.joint_row(rod), 0] == model.joint(end, rod)[0][0]


def test_a_motor_is_a_control_with_its_derivative():
    model, rod = pendulum()
    motor = model.add_joint_force(rod, "motor", effort=0.0)
    model.add_joint_force("rod", "damper", damping=0.1)
    assert motor == {"effort": "rod.joint.effort"}
    rollout = model.rollout(0.02, 50, controls=[motor["effort"]])
    controls = np.sin(np.arange(50.0))[:, None]
    run, pullback = prehend.vjp(rollout, model.neutral_states(), None, controls)
    row = model.joint_row(rod)
    weights = np.zeros_like(run[-1])
    weights[row, 0] = 1.0
    slopes = pullback(weights).controls
    step = 1e-4
    for k in [0, 20, 49]:
        ends = [
            rollout(model.neutral_states(), None, controls + sign * step * np.eye(50)[:, [k]], end=True)
            for sign in (1, -1)
        ]
        difference = (ends[0][row, 0] - ends[1][row, 0]) / (2 * step)
        assert slopes[k, 0] == pytest.approx(difference, rel=1e-4, abs=1e-8)


def test_a_servo_holds_a_two_link_arm():
    model = prehend.Model()
    bar = prehend.Shape.capsule(0.1, 0.02)
    links = [
        prehend.Link("upper", axis=[0, 0, 1], at=[0, 0, 1], shape=bar, mass=0.5),
        prehend.Link("lower", axis=[0, 0, 1], parent=0, at=[0, 0.25, 0], shape=bar, mass=0.5),
    ]
    upper, lower = model.add_articulation(links)
    for link, target in [(upper, 0.5), (lower, -0.8)]:
        model.add_joint_force(
            link, "position_servo", target=target, stiffness=20.0, damping=1.0, max_effort=50.0
        )
    end = model.rollout(1.0, 5)(model.neutral_states(), end=True)
    assert model.joint(end, upper)[0][0] == pytest.approx(0.5, abs=1e-2)
    assert model.joint(end, lower)[0][0] == pytest.approx(-0.8, abs=1e-2)
    # The pose of a link is where its joints put it.
    turn = model.pose(end, lower)[:2, 0]
    assert np.arctan2(turn[1], turn[0]) == pytest.approx(-0.3, abs=1e-2)


def test_tendons_couple_joints_and_bushings_close_loops():
    model = prehend.Model(gravity=[0, 0, 0])
    inertia = 3 * [1e-2]
    links = [
        prehend.Link(name, axis=[0, 0, 1], at=[x, 0, 0], mass=1.0, com=[0.1, 0, 0], inertia=inertia)
        for name, x in [("left", 0.0), ("right", 1.0)]
    ]
    left, right = model.add_articulation(links)
    # They are of one articulation, and a spring holds the sum of their angles.
    model.add_joint_force([(left, 1.0), ((right, 0), 1.0)], "spring", stiffness=50.0, rest=0.4)
    for link in (left, right):
        model.add_joint_force(link, "damper", damping=1.0)
    end = model.rollout(2.0, 1)(model.neutral_states(), end=True)
    angles = [model.joint(end, link)[0][0] for link in (left, right)]
    assert sum(angles) == pytest.approx(0.4, abs=1e-3) and angles[0] == pytest.approx(angles[1], abs=1e-6)
    names = model.add_bushing(left, right, mass=0.1, frame_a=[0.5, 0, 0], frame_b=[-0.5, 0, 0])
    assert names["linear_stiffness"] == "left-right.linear_stiffness"


def test_mjcf_and_urdf_become_robots(tmp_path):
    mjcf = tmp_path / "arm.xml"
    mjcf.write_text(
        """<mujoco><worldbody><body name="arm"><joint name="hinge" axis="0 1 0" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.4"/></body></worldbody>
        <actuator><motor name="drive" joint="hinge"/></actuator></mujoco>"""
    )
    model = prehend.Model()
    robot = model.add_mjcf(mjcf)
    assert list(robot.bodies) == ["arm"] and list(robot.joints) == ["hinge"]
    states = model.neutral_states()
    robot.set_positions(model, states, [0.4])
    assert model.joint(states, "arm")[0] == [0.4]
    rollout = model.rollout(0.1, 2, controls=[robot.actuators["drive"]])
    pushed, free = (rollout(states, None, np.full((2, 1), push), end=True) for push in (0.1, 0.0))
    row = model.joint_row("arm")
    assert pushed[row, 0] > free[row, 0]

    urdf = tmp_path / "arm.urdf"
    inertial = """<inertial><origin xyz="0 0 -0.1"/><mass value="0.4"/>
        <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-4"/></inertial>"""
    urdf.write_text(
        f"""<robot name="arm"><link name="base"/><link name="arm">{inertial}</link>
        <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    )
    robot = model.add_urdf(urdf, pose=[1, 0, 0], shapes=False)
    assert set(robot.bodies) == {"base", "arm"} and list(robot.joints) == ["hinge"]
    with pytest.raises(prehend.Error, match="missing.xml"):
        model.add_mjcf(tmp_path / "missing.xml")


def test_robots_are_read_as_told(tmp_path):
    model = prehend.Model()
    mjcf = tmp_path / "arm.xml"
    mjcf.write_text(
        """<mujoco><worldbody><body name="arm"><joint name="hinge"/><geom size="0.1"/></body></worldbody>
        <actuator><dcmotor name="drive" joint="hinge"/></actuator></mujoco>"""
    )
    with pytest.raises(prehend.Error, match="drive"):
        model.add_mjcf(mjcf)
    robot = model.add_mjcf(mjcf, partial=True)
    assert not robot.actuators and "drive" in robot.warnings[0]
    with pytest.raises(prehend.Error, match="partly"):
        model.add_mjcf(mjcf, partly=True)

    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.stl").write_text(
        "solid a\n"
        + "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {p}\n" for p in face)
            + "endloop\nendfacet\n"
            for corners in [("0 0 0", "1 0 0", "0 1 0", "0 0 1")]
            for face in [[corners[i] for i in f] for f in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))]
        )
        + "endsolid a\n"
    )
    urdf = tmp_path / "robot" / "arm.urdf"
    urdf.parent.mkdir()
    mesh = '<geometry><mesh filename="package://arm_description/a.stl"/></geometry>'
    urdf.write_text(f"""<robot name="arm"><link name="base"><collision>{mesh}</collision></link></robot>""")
    with pytest.raises(prehend.Error, match="a.stl"):
        model.add_urdf(urdf, shapes=False)
    packages = {"arm_description": tmp_path / "meshes"}
    assert "base" in model.add_urdf(urdf, shapes=False, packages=packages).bodies
    assert prehend.Hand(urdf, packages=packages).joints == []


def test_sensors_and_mocap_bodies(tmp_path):
    path = tmp_path / "hand.xml"
    path.write_text(
        """<mujoco><worldbody><body name="hand" mocap="true"><site name="tip" pos="0.1 0 0"/></body>
        <body name="arm"><joint name="hinge" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/></body></worldbody>
        <sensor><jointpos name="angle" joint="hinge"/><framepos name="tip" objtype="site" objname="tip"/></sensor></mujoco>"""
    )
    model = prehend.Model()
    robot = model.add_mjcf(path)
    states = model.neutral_states()
    robot.set_positions(model, states, [0.3])
    robot.set_mocap(model, states, "hand", [1, 2, 3])
    assert robot.sensors == ["angle", "tip"]
    np.testing.assert_allclose(robot.sensor(model, states, "angle"), [0.3])
    np.testing.assert_allclose(robot.sensor(model, states, "tip"), [1.1, 2, 3])
    with pytest.raises(prehend.Error, match="gyro"):
        robot.sensor(model, states, "gyro")
    with pytest.raises(prehend.Error, match="arm"):
        robot.set_mocap(model, states, "arm", [0, 0, 0])


@needs_data
def test_a_gripper_of_the_data_closes():
    path = next(Path(DATA, "robots").rglob("2f85.xml"))
    model = prehend.Model()
    robot = model.add_mjcf(path)
    states = model.neutral_states()
    robot.set_positions(model, states)
    [control] = robot.actuators.values()
    rollout = model.rollout(1e-4, 2000, controls=[control], integrator="semi_implicit_euler")
    end = rollout(states, None, np.full((2000, 1), 200.0), end=True)
    driver = robot.joints["right_driver_joint"][0]
    assert model.joint(end, driver)[0][0] > 0.1
