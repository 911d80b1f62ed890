"""Small models of each kind that is read, with what MuJoCo makes of them, for crates/sim/tests/it/robots/kinds.rs.

    pip install mujoco pin
    python kinds.py > ../../../crates/sim/tests/it/golden/mjcf_kinds.json
    python kinds.py --urdf > ../../../crates/sim/tests/it/golden/urdf_kinds.json

For each model: masses, centers of mass and inertias of its bodies; in some random states the poses of all bodies and the accelerations, with
limits, equalities, dry friction and contacts off. Robots are simulated for a second, too. With `--urdf`, the mass matrix and what holds a robot
in URDF still, by Pinocchio.
"""

import json
import pathlib
import sys
import tempfile

import mujoco
import numpy as np

L = 'vertex="0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0 2 0 0 0 1 2 0 1 2 1 1 1 1 1 1 2 1 0 2 1"'
L += ' face="0 2 1 0 3 2 0 5 3 5 4 3 6 7 8 6 8 9 6 9 11 11 9 10 0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 3 4 10 3 10 9 4 5 11 4 11 10 5 0 6 5 6 11"'
ARM = """<body name="upper" pos="0 0 1"><joint name="a" axis="0 1 0" damping="0.1"/>
  <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4"/><site name="u" pos=".05 0 -.2"/><site name="u2" pos="0 .03 -.35"/>
  <body name="lower" pos="0 0 -.4"><joint name="b" axis="0 1 0.2"/><geom type="capsule" size=".02" fromto="0 0 0 .1 0 -.3"/>
  <site name="l" pos=".06 .01 -.1"/><site name="l2" pos=".05 0 -.25" euler="20 30 0"/></body></body><site name="w" pos=".2 .1 .8" euler="0 40 10"/>"""


def arm(more="", world="", compiler=""):
    return f"<mujoco>{compiler}<worldbody>{ARM}{world}</worldbody>{more}</mujoco>"


def mesh(attributes):
    return f"""<mujoco><asset><mesh name="m" {attributes}/></asset><worldbody><body name="m"><joint axis="1 2 3"/>
      <geom type="mesh" mesh="m" pos=".1 .2 .3" euler="10 20 30"/></body></worldbody></mujoco>"""


def spatial(parts, attributes="stiffness='20' damping='0.3'"):
    return arm(f"<tendon><spatial name='t' {attributes}>{parts}</spatial></tendon><actuator><motor tendon='t' gear='3'/></actuator>",
               """<body name="pin" pos=".07 0 .6" euler="80 0 0"><joint type="slide" axis="0 0 1"/><geom name="cylinder" type="cylinder" size=".05 .1"/>
               <geom name="sphere" pos="0 0 .02" size=".06"/><site name="side" pos="-.2 .1 0"/><site name="inside" pos=".01 0 .02"/></body>""")


def site(name):
    return f'<site site="{name}"/>'


CHILD = """<mujoco model="child"><compiler angle="radian"/><default><geom density="300"/><default class="c"><joint damping=".2"/></default></default>
  <asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3"/></asset><worldbody><geom name="floor" type="plane" size="1 1 1"/>
  <body name="arm" pos="0 0 .5" euler="0 0 .5"><joint name="j" class="c" axis="0 1 0" range="-1 1"/><geom type="mesh" mesh="m"/>
  <body name="tip" pos=".2 0 0"><joint name="k"/><geom type="box" size=".1 .05 .05" pos=".1 0 0"/><site name="s"/></body></body></worldbody>
  <actuator><position name="p" joint="j" kp="5"/></actuator></mujoco>"""

QUADROTOR = """<mujoco model="quadrotor"><option timestep="0.001"/><default><default class="rotor"><geom type="ellipsoid" size=".09 .09 .01" mass=".06"/></default>
  </default><worldbody><body name="frame" pos="0 0 1"><freejoint/><geom type="box" size=".06 .05 .03" mass=".5"/>""" + "".join(
    f"""<geom class="rotor" pos="{x} {y} .02"/><site name="r{k}" pos="{x} {y} .03"/>""" for k, (x, y) in
    enumerate([(.14, .14), (-.14, .14), (-.14, -.14), (.14, -.14)])) + """</body></worldbody><actuator>""" + "".join(
    f'<motor name="r{k}" site="r{k}" gear="0 0 1 0 0 {(-1) ** k * .02}" ctrlrange="0 4"/>' for k in range(4)) + "</actuator></mujoco>"

HAND = """<mujoco model="hand"><option timestep="0.001"/><default><joint axis="0 1 0" damping=".01" armature="1e-4"/><geom type="capsule" size=".008" density="1500"/></default>
  <worldbody><body name="palm" pos="0 0 .3"><geom type="box" size=".04 .05 .015"/><replicate count="3" offset="0 .03 0"><frame pos="0 -.03 0">
  <site name="root" pos=".02 0 .016"/><body name="proximal" pos=".045 0 0"><joint name="j0"/><geom fromto="0 0 0 .04 0 0"/>
  <geom name="pulley" type="cylinder" size=".006 .01" euler="90 0 0" mass=".001"/><site name="above" pos="0 0 .02"/><site name="p" pos=".02 0 .01"/>
  <body name="distal" pos=".04 0 0"><joint name="j1"/><geom fromto="0 0 0 .03 0 0"/><site name="d" pos=".015 0 .008"/></body></body></frame></replicate></body></worldbody>
  <tendon><spatial name="flexor" stiffness="5" damping=".5" springlength="0.02"><site site="root"/><geom geom="pulley" sidesite="above"/><site site="p"/><site site="d"/></spatial></tendon>
  <actuator><general name="pull" tendon="flexor" dyntype="filter" dynprm=".05" gainprm="2" ctrlrange="-1 0"/></actuator></mujoco>"""


def leg(name, x, y):
    return f"""<body name="{name}_hip" pos="{x} {y} 0"><joint name="{name}_x" axis="1 0 0"/><geom type="capsule" size=".03" fromto="0 0 0 0 {y / 4} 0"/>
      <body name="{name}_thigh" pos="0 {y / 2} 0"><joint name="{name}_y" axis="0 1 0"/><geom type="capsule" size=".025" fromto="0 0 0 -.05 0 -.2"/>
      <body name="{name}_shin" pos="-.05 0 -.2"><joint name="{name}_knee" axis="0 1 0" stiffness="2" springref="-40"/><geom type="capsule" size=".015" fromto="0 0 0 .05 0 -.2"/></body></body></body>"""


LEGS = [("fl", .2, .1), ("fr", .2, -.1), ("rl", -.2, .1), ("rr", -.2, -.1)]
QUADRUPED = """<mujoco model="quadruped"><option timestep="0.001"/><default><joint damping=".5" armature=".01"/><position kp="20" dampratio="1"/></default>
  <worldbody><body name="trunk" pos="0 0 .6"><freejoint/><geom type="box" size=".22 .08 .05" mass="6"/>""" + "".join(
    leg(*own) for own in LEGS) + "</body></worldbody><actuator>" + "".join(
    f'<position joint="{n}_{j}"/>' for n, _, _ in LEGS for j in ("x", "y", "knee")) + "</actuator></mujoco>"

HUMANOID = """<mujoco model="humanoid"><option timestep="0.001"/><default><joint damping="1" armature=".02" stiffness="5"/><geom type="capsule" size=".05"/></default>
  <worldbody><body name="torso" pos="0 0 1.4"><freejoint/><geom fromto="0 -.07 0 0 .07 0" size=".07"/><geom name="head" type="sphere" size=".09" pos="0 0 .19"/>
  <body name="waist" pos="0 0 -.26"><joint axis="0 0 1"/><joint axis="0 1 0" pos="0 0 .06"/><geom fromto="0 -.06 0 0 .06 0" size=".06"/>""" + "".join(
    f"""<body name="thigh_{s}" pos="0 {y} -.1"><joint type="ball" damping="2"/><geom fromto="0 0 0 0 {-y / 10} -.34"/>
    <body name="shin_{s}" pos="0 {-y / 10} -.4"><joint axis="0 -1 0" pos="0 0 .02"/><geom fromto="0 0 0 0 0 -.3" size=".045"/>
    <body name="foot_{s}" pos="0 0 -.39"><joint axis="0 1 0" pos="0 0 .04"/><geom fromto="-.07 0 0 .14 0 0" size=".027"/></body></body></body>"""
    for s, y in (("left", .1), ("right", -.1))) + "</body>" + "".join(
    f"""<body name="arm_{s}" pos="0 {y} .06"><joint name="s1_{s}" axis="2 {y / abs(y)} 1"/><joint name="s2_{s}" axis="0 -1 {y / abs(y)}"/><geom fromto="0 0 0 .16 {y} -.16" size=".04"/>
    <body name="hand_{s}" pos=".18 {y} -.18"><joint name="e_{s}" axis="0 -1 {-y / abs(y)}"/><geom fromto=".01 0 .01 .17 {-y} .17" size=".031"/></body></body>"""
    for s, y in (("left", .17), ("right", -.17))) + """</body></worldbody><tendon><fixed name="arms"><joint joint="s1_left" coef="1"/><joint joint="s1_right" coef="-1"/></fixed></tendon>
  <actuator><motor joint="e_left" gear="4"/><motor joint="e_right" gear="4"/><motor tendon="arms" gear="2"/></actuator></mujoco>"""

MODELS = {
    "nested replicate": """<mujoco><worldbody><replicate count="2" offset="0 0 1" euler="0 90 0" sep="-"><replicate count="11" offset=".3 0 0" euler="0 0 20"><body name="b" pos=".1 0 0">
      <joint name="j" axis="0 1 0"/><geom type="box" size=".1 .05 .02"/></body></replicate></replicate></worldbody></mujoco>""",
    "replicate": """<mujoco><worldbody><site name="w" pos="0 0 2"/><body name="z"><joint name="z"/><geom size=".1" pos=".1 0 0"/></body><replicate count="3" offset=".3 0 .1" euler="0 0 20"><body name="b" pos=".1 0 0"><joint name="j" axis="0 1 0"/>
      <geom type="box" size=".1 .05 .02"/><site name="s" pos="0 0 .1"/></body><geom type="box" size=".1 .1 .1"/></replicate></worldbody>
      <tendon><spatial name="t" stiffness="3"><site site="w"/><site site="s"/></spatial></tendon><actuator><motor name="m" joint="j"/><motor joint="z"/><motor name="n" tendon="t"/></actuator></mujoco>""",
    "attach": {"child.xml": CHILD, "": """<mujoco><default><geom density="2000"/></default><asset><model name="kid" file="child.xml"/></asset><worldbody>
      <body name="x" pos="1 0 0"><joint name="x"/><geom size=".1"/><attach model="kid" body="arm" prefix="p-"/></body>
      <frame pos="0 0 2" euler="0 0 90"><attach model="kid" prefix="q-"/></frame><replicate count="2" offset="0 0 5"><attach model="kid" body="tip" prefix="t-"/></replicate></worldbody>
      <actuator><motor joint="p-k" gear="2"/></actuator></mujoco>"""},
    "attach of its own": """<mujoco><worldbody><body name="x" pos="1 0 0"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body><frame name="f" pos="0 0 1">
      <body name="y" pos="0 1 0"><joint name="k"/><geom type="box" size=".1 .2 .1" pos=".1 0 0"/></body></frame><attach body="x" prefix="r-"/><frame pos="0 0 3"><attach frame="f" prefix="t-"/></frame></worldbody>
      <actuator><motor name="m" joint="j"/></actuator></mujoco>""",
    "frames and classes": """<mujoco><compiler angle="radian" eulerseq="ZYX"/><default><joint armature=".1"/><default class="a"><joint damping=".5" axis="1 0 0"/><geom type="box" size=".1 .1 .2"/>
      <default class="b"><geom size=".2 .1 .1" density="500"/></default></default></default><worldbody><frame pos="0 0 1" xyaxes="0 1 0 0 0 1"><body childclass="a"><joint/><geom/>
      <frame euler=".3 .2 .1" childclass="b"><body pos=".3 0 0" axisangle="0 1 0 .4"><joint class="a"/><geom zaxis="1 0 1"/></body></frame><body quat="1 2 3 4"><joint axis="0 1 1"/><geom class="b"/></body></body></frame></worldbody></mujoco>""",
    "mesh of vertices": mesh('vertex="0 0 0 1 0 0 0 1 0 0 0 1 .2 .2 .2 .5 .5 0"'),
    **{f"mesh with inertia {kind}": mesh(f'{L} scale=".3 .2 -.1" inertia="{kind}" refpos=".1 .2 0" refquat="1 0 1 0"') for kind in ("legacy", "exact", "convex", "shell")},
    **{f"built-in {kind}": mesh(f'builtin="{kind}" params="{params}" scale=".2 .3 .1"') for kind, params in
       (("sphere", "2"), ("hemisphere", "2"), ("cone", "5 .4"), ("supersphere", "8 .5 .7"), ("supertorus", "9 .3 .6 1.4"))},
    "shapes": """<mujoco><asset><hfield name="h" nrow="2" ncol="3" size=".4 .3 .2 .1" elevation="0 1 2 3 4 5"/></asset><worldbody><body><joint axis="1 1 0"/>
      <geom type="hfield" hfield="h" contype="0" conaffinity="0"/><geom type="ellipsoid" size=".1 .2 .3" pos="1 0 0"/><geom type="cylinder" size=".1 .2" pos="0 1 0" shellinertia="true"/></body></worldbody></mujoco>""",
    "site": arm('<actuator><motor site="l2" gear="1 2 3 .1 .2 .3"/></actuator>'),
    "reference site": arm('<actuator><position site="l2" refsite="w" gear="1 .5 0 0 0 0" kp="30" dampratio=".7"/><position site="l2" refsite="u" gear="0 0 0 0 1 0" kp="3"/></actuator>'),
    "slider-crank": arm('<actuator><motor cranksite="l" slidersite="w" cranklength=".9" gear="2"/><motor cranksite="l" slidersite="w" cranklength=".01"/></actuator>'),
    "cable": spatial(site("w") + site("u") + site("l")),
    "cable with armature": spatial(site("w") + site("u") + site("l"), "armature='.7' springlength='.1 .3' stiffness='9'"),
    "cable and pulleys": spatial(site("w") + site("u") + '<pulley divisor="2"/>' + site("u") + site("l") + '<pulley divisor="4"/>' + site("u2") + site("l2")),
    "cable around a sphere": spatial(site("w") + '<geom geom="sphere"/>' + site("l")),
    "cable around a cylinder": spatial(site("w") + '<geom geom="cylinder"/>' + site("l")),
    "cable on a side": spatial(site("w") + '<geom geom="cylinder" sidesite="side"/>' + site("l")),
    "cable through the inside": spatial(site("w") + '<geom geom="sphere" sidesite="inside"/>' + site("l")),
    "polynomials": spatial(site("w") + site("l"), "stiffness='5 -4 9' damping='.1 .2 .3' springlength='0 .2'").replace('name="a" axis="0 1 0" damping="0.1"', 'name="a" axis="0 1 0" damping="0.1 .2 .3" stiffness="1 2 3" springref="10"'),
    "activations": arm("""<actuator><intvelocity joint="a" kp="7" kv=".3" actrange="-2 2"/><cylinder joint="b" timeconst=".1" area=".3" bias=".1 .2 -.3"/>
      <general joint="a" dyntype="filterexact" dynprm=".2" gainprm="2" actearly="true"/><general joint="b" dyntype="integrator" gear="4"/></actuator>"""),
    "muscles": arm("""<actuator><muscle joint="a" lengthrange="-1 2"/><muscle joint="b" gear="-.5" lengthrange="-2 1" force="30" timeconst=".02 .05" tausmooth=".4" range=".6 1.1" lmin=".4" lmax="1.7" vmax="2" fpmax="1.5" fvmax="1.3"/>
      <general joint="b" dyntype="muscle" gaintype="muscle" biastype="muscle" dynprm=".01 .04 0" gainprm=".7 1 20 100 .5 1.6 1.5 1.3 1.2" biasprm=".7 1 20 100 .5 1.6 1.5 1.3 1.2" lengthrange="-3 3"/></actuator>"""),
    "ranges and gears": arm("""<actuator><motor joint="a" gear="-3" ctrlrange="-.1 .1"/><position joint="b" kp="50" kv="2" forcerange="-1 2"/><damper joint="a" kv="3" ctrlrange="0 1"/>
      <velocity joint="b" kv="4" group="3"/></actuator>""", compiler='<option actuatorgroupdisable="3"/>'),
    "bounded actuators": """<mujoco><default><joint actuatorfrcrange="-.5 .5" actuatorgravcomp="true" axis="0 1 0"/></default><worldbody><body gravcomp="1"><joint name="a"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/>
      <body pos=".5 0 0" gravcomp=".5"><joint name="b"/><geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/></body></body></worldbody><tendon><fixed name="t" actuatorfrcrange="-.2 .3"><joint joint="a" coef="1"/><joint joint="b" coef=".5"/></fixed></tendon>
      <actuator><motor joint="a" gear="2"/><motor tendon="t"/><motor tendon="t" gear="3"/></actuator></mujoco>""",
    "ball and free": """<mujoco><worldbody><body name="ball" pos="0 0 1" euler="10 20 30"><joint name="ball" type="ball" stiffness="3" damping=".2" pos=".1 0 0"/><geom type="box" size=".1 .2 .3"/></body>
      <body name="free" pos="1 0 0" euler="0 30 0"><joint name="free" type="free" stiffness="5" damping=".4"/><geom type="box" size=".2 .1 .1" pos=".1 0 0"/></body></worldbody>
      <actuator><position joint="ball" gear="0 1 .5" kp="2"/><motor jointinparent="ball" gear="1 0 2"/><motor joint="free" gear="1 2 3 4 5 6"/><motor jointinparent="free" gear="0 0 1 1 0 0"/></actuator></mujoco>""",
    "spring and damper by time": """<mujoco><worldbody><body><joint name="a" axis="0 1 0" springdamper=".1 .5" springref="20"/><geom type="box" size=".1 .2 .3"/><site name="a" pos=".1 0 .2"/><body pos=".5 0 0">
      <joint type="ball" springdamper=".2 .7"/><geom type="box" size=".1 .2 .1"/></body></body><site name="w" pos="1 0 1"/></worldbody><tendon><spatial armature="2"><site site="a"/><site site="w"/></spatial></tendon></mujoco>""",
    "polynomials of a ball": """<mujoco><worldbody><body euler="10 20 30"><joint type="ball" stiffness="5 -4 9" damping=".1 .2 .3"/><geom type="box" size=".1 .2 .3" pos="0 .1 0"/></body>
      <body pos="1 0 0"><freejoint/><geom type="box" size=".1 .2 .3"/></body></worldbody></mujoco>""",
    "sensors": """<mujoco><worldbody><site name="w" pos="0 0 2" euler="20 30 40"/><geom name="g" type="box" size=".1 .1 .1" pos="1 1 0" euler="0 0 30"/>
      <body name="a" pos="0 0 1" euler="5 10 15"><joint name="a" axis="0 1 0" ref="10" pos="0 0 .05"/><geom name="a" type="capsule" size=".03" fromto="0 0 0 .4 .1 0"/><site name="a" pos=".2 0 .1" euler="40 10 -30"/>
      <body name="b" pos=".4 0 0"><joint name="b" type="ball" pos="0 .02 0"/><geom name="b" type="box" size=".1 .05 .02" pos=".1 0 0" euler="0 20 0"/><site name="b" pos=".1 .1 0" euler="0 -20 50"/></body>
      <body name="c" pos="0 .3 0"><joint name="c" type="slide" axis="1 0 1"/><geom size=".05"/></body></body>
      <body name="free" pos="1 0 1"><freejoint name="free"/><geom type="box" size=".1 .2 .05"/><site name="free" pos=".1 0 0" euler="0 60 0"/></body></worldbody>
      <tendon><fixed name="sum"><joint joint="a" coef="2"/><joint joint="c" coef="-1"/></fixed><spatial name="cable"><site site="w"/><site site="b"/></spatial></tendon>
      <actuator><motor name="motor" joint="a" gear="-3"/><motor name="pull" tendon="cable" gear="2"/><motor name="place" site="b" refsite="w" gear="1 2 3 .1 .2 .3"/></actuator>
      <sensor><jointpos name="jointpos" joint="a"/><jointvel name="jointvel" joint="c"/><jointpos name="cut" joint="a" cutoff=".05"/><ballquat name="ballquat" joint="b"/><ballangvel name="ballangvel" joint="b"/>
      <tendonpos name="tendonpos" tendon="cable"/><tendonvel name="tendonvel" tendon="cable"/><tendonpos name="sum" tendon="sum"/><actuatorpos name="actuatorpos" actuator="motor"/><actuatorvel name="actuatorvel" actuator="pull"/>
      <actuatorpos name="place" actuator="place"/><framepos name="framepos" objtype="site" objname="b"/><framepos name="com" objtype="body" objname="a"/><framepos name="relative" objtype="geom" objname="b" reftype="site" refname="free"/>
      <framequat name="framequat" objtype="xbody" objname="b" reftype="geom" refname="g"/><framexaxis name="framexaxis" objtype="site" objname="b"/><framezaxis name="framezaxis" objtype="geom" objname="b" reftype="site" refname="a"/>
      <framelinvel name="framelinvel" objtype="site" objname="b"/><framelinvel name="rellinvel" objtype="site" objname="b" reftype="xbody" refname="free"/><frameangvel name="frameangvel" objtype="xbody" objname="b"/>
      <frameangvel name="relangvel" objtype="site" objname="b" reftype="site" refname="free"/><framelinvel name="comvel" objtype="body" objname="c"/><velocimeter name="velocimeter" site="b"/><gyro name="gyro" site="b"/>
      <accelerometer name="accelerometer" site="b"/><accelerometer name="of the world" site="w"/><accelerometer name="falling" site="free"/><subtreecom name="subtreecom" body="a"/><subtreelinvel name="subtreelinvel" body="a"/>
      <subtreeangmom name="subtreeangmom" body="a"/><subtreecom name="all" body="world"/></sensor></mujoco>""",
    "mocap": """<mujoco><option gravity="1 2 3"><flag gravity="disable"/></option><worldbody><body name="hand" mocap="true" pos="1 2 3"><geom size=".1"/><site name="hand"/></body><body name="thing"><freejoint/><geom type="box" size=".1 .2 .3"/>
      <site name="thing"/></body></worldbody><tendon><spatial stiffness="4"><site site="hand"/><site site="thing"/></spatial></tendon></mujoco>""",
}
ROBOTS = {"quadrotor": QUADROTOR, "tendon-driven hand": HAND, "quadruped": QUADRUPED, "humanoid": HUMANOID}
OFF = ("CONTACT", "LIMIT", "EQUALITY", "FRICTIONLOSS")


def load(source):
    files = source if isinstance(source, dict) else {"": source}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (pathlib.Path(folder) / (name or "model.xml")).write_text(text)
        model = mujoco.MjModel.from_xml_path(f"{folder}/model.xml")
    for flag in OFF:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))
    return files, model


def positions(model, random):
    q = model.qpos0 + random.normal(size=model.nq) * 0.4
    for i in range(model.njnt):
        if model.jnt_type[i] <= 1:
            at = model.jnt_qposadr[i] + (3 if model.jnt_type[i] == 0 else 0)
            q[at : at + 4] /= np.linalg.norm(q[at : at + 4])
    return q


def bodies(model):
    for i in range(1, model.nbody):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[i])
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[i]) @ turn.T
        yield [model.body_mass[i], *model.body_ipos[i], *inertia.flatten()]


def inertial(xyz, rpy, mass, more="ixy='.001' ixz='-.002' iyz='.0005'"):
    return f"<inertial><origin xyz='{xyz}' rpy='{rpy}'/><mass value='{mass}'/><inertia ixx='.02' {more} iyy='.03' izz='.04'/></inertial>"


def joint(name, kind, parent, child, more):
    return f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>{more}</joint>"


URDF = {
    "strict": ("<robot name='r'><link name='a'/>" + "".join(f"<link name='{n}'>{inertial(x, r, m)}</link>" for n, x, r, m in [
        ("b", ".1 0 .2", "0 0 0", 2), ("c", "0 .3 .1", ".1 .2 .3", 1), ("d", ".2 0 0", "1 0 -1", .5), ("e", "0 0 .1", "0 2 0", .3)])
        + joint("p", "revolute", "a", "b", "<origin xyz='0 0 1' rpy='.3 .2 .1'/><axis xyz='0 1 0'/><limit lower='-1' upper='2' effort='1' velocity='1'/>")
        + joint("q", "prismatic", "b", "c", "<origin xyz='.4 0 0' rpy='0 1 0'/><axis xyz='1 2 0'/><limit lower='-1' upper='2' effort='1' velocity='1'/>")
        + joint("r", "fixed", "c", "d", "<origin xyz='.1 .2 .3' rpy='.3 .2 .1'/>")
        + joint("s", "revolute", "d", "e", "<origin xyz='.1 0 0'/><limit lower='-1' upper='2' effort='1' velocity='1'/>") + "</robot>"),
}
# The same with faults that are put right.
URDF["lenient"] = (URDF["strict"].replace("<axis xyz='0 1 0'/>", "<axis xyz='0 1 0'/><axis xyz='1 0 0'/>").replace("xyz='0 0 1'", "xyz='0 0 1 5'")
                   .replace("rpy='0 2 0'/>", "rpy='0 2 0'/><material name='gone'/>"))


def urdf():
    import pinocchio

    result = {}
    model = pinocchio.buildModelFromXML(URDF["strict"])
    data, random = model.createData(), np.random.default_rng(5)
    states = []
    for _ in range(3):
        q = random.normal(size=model.nq)
        mass = pinocchio.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        states.append({"q": q.tolist(), "mass": mass.flatten().tolist(), "effort": pinocchio.computeGeneralizedGravity(model, data, q).tolist()})
    for name, text in URDF.items():
        result[name] = {"urdf": text, "joints": list(model.names)[1:], "states": states}
    json.dump(result, sys.stdout, separators=(",", ":"))


def main():
    if sys.argv[1:] == ["--urdf"]:
        return urdf()
    result = {}
    for name, source in {**MODELS, **ROBOTS}.items():
        files, model = load(source)
        data = mujoco.MjData(model)
        random = np.random.default_rng(5)
        states = []
        for _ in range(1 if name in ROBOTS else 3):
            data.qpos[:], data.qvel[:] = positions(model, random), random.normal(size=model.nv)
            if name in ROBOTS:
                data.qpos[:], data.qvel[:] = model.qpos0, 0.1 * data.qvel
            data.ctrl[:], data.act[:] = random.normal(size=model.nu), 0.5 * random.normal(size=model.na)
            state = {k: getattr(data, k).tolist() for k in ("qpos", "qvel", "ctrl", "act")}
            mujoco.mj_forward(model, data)
            state["qacc"] = data.qacc.tolist()
            state["xpos"] = data.xpos[1:].flatten().tolist()
            state["sensors"] = {model.sensor(i).name: data.sensor(i).data.tolist() for i in range(model.nsensor)}
            if name in ROBOTS:
                model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
                for _ in range(1000):
                    mujoco.mj_step(model, data)
                state["end"] = {"xpos": data.xpos[1:].flatten().tolist(), "qvel": data.qvel.tolist()}
            states.append(state)
        result[name] = {"files": files, "bodies": list(bodies(model)), "states": states}
    json.dump(result, sys.stdout, separators=(",", ":"))


if __name__ == "__main__":
    main()
