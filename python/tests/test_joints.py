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
    state = model.neutral_state()
    angle = 0.3
    model.set_joint(state, rod, [angle])
    # 4 K(sin(θ/2)) √(I / m g l) by the arithmetic-geometric mean.
    a, b = 1.0, np.cos(0.5 * angle)
    for _ in range(20):
        a, b = 0.5 * (a + b), np.sqrt(a * b)
    period = 2 * np.pi / a * np.sqrt(1.004 / 9.81)
    end = model.rollout(period, 1)(state, end=True).state
    assert model.joint(end, rod)[0][0] == pytest.approx(angle, abs=1e-4)
    assert end.q[model.q_slice(rod)] == model.joint(end, rod)[0] == end.q
    assert end.v[model.v_slice(rod)] == model.joint(end, rod)[1] == end.v


def test_a_motor_is_a_control_with_its_derivative():
    model, rod = pendulum()
    motor = model.add_joint_force(rod, "motor", effort=0.0)
    model.add_joint_force("rod", "damper", damping=0.1)
    assert motor == {"effort": "rod.joint.effort"}
    rollout = model.rollout(0.02, 50, controls=[motor["effort"]])
    controls = np.sin(np.arange(50.0))[:, None]
    _, pullback = prehend.vjp(rollout, model.neutral_state(), None, controls)
    slopes = pullback(prehend.Run(prehend.State(q=[1.0]))).controls
    step = 1e-4
    for k in [0, 20, 49]:
        ends = [
            rollout(model.neutral_state(), None, controls + sign * step * np.eye(50)[:, [k]], end=True)
            for sign in (1, -1)
        ]
        difference = (ends[0].state.q[0] - ends[1].state.q[0]) / (2 * step)
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
    end = model.rollout(1.0, 5)(model.neutral_state(), end=True).state
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
    end = model.rollout(2.0, 1)(model.neutral_state(), end=True).state
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
    state = model.neutral_state()
    robot.set_positions(model, state, [0.4])
    assert model.joint(state, "arm")[0] == [0.4]
    rollout = model.rollout(0.1, 2, controls=[robot.actuators["drive"]])
    pushed, free = (rollout(state, None, np.full((2, 1), push), end=True) for push in (0.1, 0.0))
    assert pushed.state.q[0] > free.state.q[0]

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
    assert model.robots[1] is robot and len(model.copy().robots) == 2

    # A model of a file alone.
    alone = prehend.Model.from_urdf(urdf, shapes=False)
    assert alone["gravity.z"] == -9.81 and (alone.nq, alone.nv) == (1, 1)
    assert list(alone.robots[0].joints) == ["hinge"]
    scene = tmp_path / "moon.xml"
    scene.write_text(mjcf.read_text().replace("<mujoco>", '<mujoco><option gravity="0 0 -1.62"/>'))
    moon = prehend.Model.from_mjcf(scene)
    assert moon["gravity.z"] == -1.62 and moon.robots[0].actuators == {"drive": "arm.joint.control"}
    state = moon.neutral_state()
    moon.robots[0].set_positions(moon, state, [0.4])
    assert moon.rollout(0.1, 1)(state, end=True).state.q[0] < 0.4
    keyed = tmp_path / "keyed.xml"
    keyed.write_text(scene.read_text().replace("</mujoco>", '<keyframe><key name="up" qpos="1" ctrl="2"/></keyframe></mujoco>'))
    model = prehend.Model.from_mjcf(keyed)
    state, robot = model.neutral_state(), model.robots[0]
    robot.reset(model, state, "up")
    assert robot.keyframes == ["up"] and state.q == [1.0] and model["arm.joint.control"] == 2.0
    robot.reset(model, state)
    assert state.q == [0.0] and model["arm.joint.control"] == 0.0
    with pytest.raises(prehend.Error, match="no keyframe 'down'"):
        robot.reset(model, state, "down")
    turned = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    turned = prehend.Model.from_mjcf(scene, pose=turned)
    heap = tmp_path / "heap.xml"
    heap.write_text(
        """<mujoco><default><geom type="box" size=".05 .05 .05"/></default><worldbody>
        <geom type="plane" size="1 1 1"/><body name="box" pos="0 0 .05"><freejoint/><geom/></body>
        <body name="ghost" pos="0 0 .2"><freejoint/><geom contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
    )
    heap = prehend.Model.from_mjcf(heap)
    state = heap.neutral_state()
    heap.robots[0].set_positions(heap, state)
    bodies = heap.rollout(0.2, 1)(state, end=True).bodies
    assert bodies[heap.body("box"), 2] == pytest.approx(0.05, abs=1e-3)
    assert bodies[heap.body("ghost"), 2] < 0.1
    assert turned["gravity.y"] == pytest.approx(1.62) and turned["gravity.z"] == pytest.approx(0.0)
    with pytest.raises(prehend.Error, match="missing.xml"):
        prehend.Model.from_mjcf(tmp_path / "missing.xml")
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
    state = model.neutral_state()
    robot.set_positions(model, state, [0.3])
    before = model.parameters, [model[name] for name in model]
    robot.set_mocap(model, state, "hand", [1, 2, 3])
    # Only the state has changed.
    assert before == (model.parameters, [model[name] for name in model])
    assert robot.sensors == ["angle", "tip"]
    np.testing.assert_allclose(robot.sensor(model, state, "angle"), [0.3])
    np.testing.assert_allclose(robot.sensor(model, state, "tip"), [1.1, 2, 3])
    with pytest.raises(prehend.Error, match="gyro"):
        robot.sensor(model, state, "gyro")
    with pytest.raises(prehend.Error, match="arm"):
        robot.set_mocap(model, state, "arm", [0, 0, 0])
    with pytest.raises(prehend.Error, match="joints have velocities"):
        model.set_pose(state, "hand", [0, 0, 0], velocity=[1, 0, 0])


LED = """<mujoco><worldbody>
    <body name="hand" mocap="true" pos="0.1 0 1"><geom size="0.1" contype="0" conaffinity="0"/>
        <body name="finger" pos="0 0 -0.1"><joint name="hinge" axis="0 1 0" damping="0.1"/>
            <geom size="0.02" pos="0.1 0 0"/></body></body>
    <body name="thing" pos="0.1 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body></worldbody>
    <contact><exclude body1="finger" body2="thing"/></contact>
    <equality><weld body1="hand" body2="thing"/></equality></mujoco>"""


def test_a_mocap_body_is_a_fixed_body_of_the_state(tmp_path):
    """It leads what is welded to it and what hangs on it, to the derivatives by its pose."""
    path = tmp_path / "led.xml"
    path.write_text(LED)
    model = prehend.Model.from_mjcf(path)
    [robot] = model.robots
    state = model.neutral_state()
    robot.set_positions(model, state)
    row = model.fixed_row("hand")
    np.testing.assert_array_equal(state.fixed[row, :7], [0.1, 0, 1, 0, 0, 0, 1])
    assert (model.nq, model.nv, state.fixed.shape) == (8, 7, (1, 13))
    with pytest.raises(prehend.Error, match="'hand' has no coordinates"):
        model.q_slice("hand")
    robot.set_mocap(model, state, "hand", [0.15, 0.02, 1.1])
    np.testing.assert_allclose(model.pose(state, "hand")[:3, 3], [0.15, 0.02, 1.1])
    np.testing.assert_allclose(model.pose(state, "finger")[:3, 3], [0.15, 0.02, 1.0])
    model.set_pose(state, "hand", [0.15, 0.02, 1.05])
    rollout = model.rollout(5e-3, 100)
    run, pullback = prehend.vjp(rollout, state)
    thing, finger = model.body("thing"), model.body("finger")
    np.testing.assert_allclose(run.bodies[-1, thing, :3], [0.15, 0.02, 1.05], atol=1e-2)
    np.testing.assert_array_equal(run.state.fixed[-1], state.fixed)
    weights = np.zeros_like(run.bodies[-1])
    weights[[thing, finger], :3] = [[1.0, 2.0, 3.0], [-1.0, 0.5, 2.0]]
    slopes = pullback(prehend.Run(bodies=weights)).state.fixed[row]

    def at(shift, tilt):
        fixed = state.fixed.copy()
        fixed[row, 0] += shift
        fixed[row, 3:7] = [0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)]
        return (weights * rollout(state._replace(fixed=fixed), end=True).bodies).sum()

    h = 1e-4
    assert slopes[0] == pytest.approx((at(h, 0) - at(-h, 0)) / (2 * h), rel=1e-3)
    assert 0.5 * slopes[4] == pytest.approx((at(0, h) - at(0, -h)) / (2 * h), rel=1e-3, abs=1e-4)


@needs_data
def test_a_gripper_of_the_data_closes():
    path = next(Path(DATA, "robots").rglob("2f85.xml"))
    model = prehend.Model()
    robot = model.add_mjcf(path)
    state = model.neutral_state()
    robot.set_positions(model, state)
    [control] = robot.actuators.values()
    rollout = model.rollout(1e-4, 2000, controls=[control], integrator="semi_implicit_euler")
    end = rollout(state, None, np.full((2000, 1), 200.0), end=True).state
    driver = robot.joints["right_driver_joint"][0]
    assert model.joint(end, driver)[0][0] > 0.1
