"""MuJoCo model of a table, a stand, an item on the stand, and a movable hand with two fingers and pads.

In the world frame, z points up and y points along the closing direction of an unturned hand. The origin of the world
frame is on the table below the hand. The surface of each pad is exactly the area of its taxels. The sites `left_pad`
and `right_pad` have the frames of the pads.
"""

from bench.planner_world import PITCH, ROWS
from examples.simulated_gripper.items import PAD_HEIGHT, Item

MAX_GAP = 0.09          #: largest gap [m]
STEP = 0.001            #: time step of the physics [s]
HALF_PAD = ROWS * PITCH / 2
#: half of the stand's width [m], chosen so that an item displaced by 8 mm does not tip over
HALF_STAND = 0.0095
#: Contact parameters that let the skins yield by some tenths of a millimetre, like 4 mm of silicone.
SKIN = 'solref="0.009 1" solimp="0.8 0.8 0.001"'

_HAND = """
    <body name="hand" pos="0 0 {height}" gravcomp="1">
      <joint name="x" type="slide" axis="1 0 0"/> <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="lift" type="slide" axis="0 0 1"/> <joint name="yaw" type="hinge" axis="0 0 1"/>
      <geom name="palm" type="box" size="0.03 0.07 0.015" pos="0 0 0.085" mass="1" rgba=".25 .27 .3 1"/>
      {fingers}
    </body>"""

_FINGER = """
      <body name="{name}_finger" gravcomp="1">
        <joint name="{name}" type="slide" axis="0 {way} 0" range="0 {range}" limited="true"/>
        <geom type="box" size="{half} 0.005 0.043" pos="0 {behind} 0.027" mass="0.1" rgba=".5 .52 .55 1"/>
        <geom name="{name}_skin" type="box" size="{half} 0.002 {half}" pos="0 {surface} 0" mass="0.01"
              rgba=".1 .1 .12 1" {skin}/>
        <site name="{name}_pad" pos="-{edge} 0 {top}" xyaxes="1 0 0 0 0 {down}" size="0.001"/>
      </body>"""

_MODEL = """
<mujoco model="simulated_gripper">
  <option timestep="{step}" integrator="implicitfast" cone="elliptic" impratio="20" noslip_iterations="3"/>
  <visual><headlight ambient=".4 .4 .4"/> <map znear="0.02"/> <global offwidth="960" offheight="720"/></visual>
  <asset>{mesh}
    <texture type="skybox" builtin="gradient" rgb1=".9 .93 .96" rgb2=".6 .65 .7" width="64" height="64"/>
    <texture name="wood" type="2d" builtin="checker" rgb1=".75 .68 .58" rgb2=".7 .63 .53" width="64" height="64"/>
    <material name="table" texture="wood" texrepeat="8 8"/>
  </asset>
  <worldbody>
    <light pos="0.3 -0.4 0.8" dir="-0.3 0.4 -0.8"/>
    <camera name="front" pos="0.3 -0.2 0.17" xyaxes="0.55 0.83 0 -0.2 0.13 0.97" fovy="40"/>
    <geom name="table" type="box" size="0.3 0.3 0.02" pos="0 0 -0.02" material="table"/>
    {stand}{hand}
    <body name="item" pos="0 0 {height}">
      <freejoint name="item"/>
      <geom name="item" {geom} mass="{mass}" friction="{friction} 0.003 0.0005" condim="6" priority="1"
            {skin} rgba=".85 .45 .15 1"/>
    </body>
  </worldbody>
  <equality><joint joint1="left" joint2="right" solref="0.002 1"/></equality>
  <actuator>
    <motor name="left" joint="left"/> <motor name="right" joint="right"/>
    <position name="x" joint="x" kp="1e5" dampratio="1"/> <position name="y" joint="y" kp="1e5" dampratio="1"/>
    <position name="lift" joint="lift" kp="1e5" dampratio="1"/>
    <position name="yaw" joint="yaw" kp="300" dampratio="1"/>
  </actuator>
</mujoco>"""


def model_of(item: Item) -> str:
    """Return the model of the bench with an item, as MJCF."""
    top = PAD_HEIGHT - item.below
    stand = '' if item.upright else (f'<geom name="stand" type="box" size="{HALF_STAND} {HALF_STAND} {top / 2}" '
                                     f'pos="0 0 {top / 2}" rgba=".6 .6 .62 1"/>')
    fingers = ''.join(_finger(name, way) for name, way in (('left', -1), ('right', 1)))
    mesh, geom = _geom(item)
    return _MODEL.format(step=STEP, mesh=mesh, geom=geom, stand=stand, height=PAD_HEIGHT, mass=item.mass,
                         hand=_HAND.format(height=PAD_HEIGHT, fingers=fingers), friction=item.friction, skin=SKIN)


def _finger(name: str, way: int) -> str:
    """Return one finger, which lies in the direction ``way`` from the item along y.

    The rows of the left pad run downwards, and the rows of the right pad run upwards.
    """
    edge = HALF_PAD - PITCH / 2
    return _FINGER.format(name=name, way=way, range=MAX_GAP / 2, half=HALF_PAD, behind=0.009 * way, surface=0.002 * way,
                          skin=SKIN, edge=edge, top=-way * edge, down=way)


def _geom(item: Item) -> tuple[str, str]:
    """Return the asset and the geom for the shape of an item."""
    if not item.length:
        return '', f'type="sphere" size="{item.face.reach}"'
    if item.face.shape == 'circle':
        return '', f'type="cylinder" size="{item.face.reach} {item.length / 2}"'
    corners = [f'{x} {y} {z}' for z in (-item.length / 2, item.length / 2) for x, y in item.face.outline()]
    return f'<mesh name="item" vertex="{" ".join(corners)}"/>', 'type="mesh" mesh="item"'
