"""The arguments of the launch file, most of them options of `tactile bringup`, and the parameters that these set.

Imports no ROS, so that the command and the documents can read it where launch is not installed.
"""

from collections.abc import Mapping
from typing import NamedTuple

from tactile_node.node_graph import Role, Side, roles_of

#: option -> parameter of the nodes of a role
DRIVER = {'interface': 'interface', 'channel': 'channel', 'bitrate': 'bitrate', 'record': 'record', 'replay': 'replay',
          'replay_channel': 'replay_channel', 'publish_clock': 'publish_clock', 'replay_pace': 'replay_pace',
          'node_id': 'node_ids', 'layout': 'layouts', 'eds': 'eds', 'frame_ids': 'frame_ids',
          'frame_prefix': 'frame_prefix', 'autostart': 'autostart', 'wait_at_start': 'wait_at_start'}
CLASSIFIER = {'method': 'method', 'model': 'model'}
GRASP = {'grasp_frame': 'frame_id', 'frame_prefix': 'frame_prefix', 'frame_ids': 'pad_frames', 'gap': 'gap',
         'gap_source': 'gap_source', 'gap_joints': 'gap_joints', 'gap_frames': 'gap_frames', 'gap_scale': 'gap_scale',
         'gap_offset': 'gap_offset', 'publish_pad_frames': 'publish_pad_frames'}
EVERY = {'use_sim_time': 'use_sim_time'}
PARAMETERS: Mapping[Role, Mapping[str, str]] = {
    Role.DRIVER: DRIVER, Role.PROCESSOR: {}, Role.CLASSIFIER: CLASSIFIER, Role.GRASP: GRASP}
#: name: (default, description). Each is the option of `tactile bringup` of the same name; empty: not given.
OPTIONS = {
    'interface': ('', 'python-can interface: socketcan (default), slcan, pcan, kvaser, ...'),
    'channel': ('', 'channel of the interface (default can0)'),
    'bitrate': ('', 'bit rate of the bus [bit/s] (default 1000000)'),
    'pads': ('pad', 'names of the pads on this bus, comma-separated; topics are <name>/taxels, features, shape, pose'),
    'node_id': ('', 'CANopen node-ID of each pad (of each of its nodes), comma-separated'),
    'layout': ('', 'skin layout of each pad, comma-separated, or one for all (default sim16x16.yaml)'),
    'eds': ('', 'EDS of each pad, comma-separated, or one for all; empty: named as the layout'),
    'frame_ids': ('', 'frame of each pad, comma-separated (default <name>_pad)'),
    'frame_prefix': ('', 'put before every frame of pads and grasp, as robot1/'),
    'grasp_frame': ('', 'frame of the grasp (default gripper)'),
    'gap_source': ('', 'where the opening of the gripper comes from: parameter (default), joint_states, tf or none'),
    'gap': ('', 'opening of the gripper [m] with gap_source parameter; not known unless given'),
    'gap_joints': ('', 'with joint_states: joints whose positions add to the opening, comma-separated'),
    'gap_frames': ('', 'with tf: frames of the left and the right finger, comma-separated'),
    'gap_scale': ('', 'opening for a metre or a radian of the joints, or a metre between the frames (default 1)'),
    'gap_offset': ('', 'opening where these are 0 [m] (default 0)'),
    'publish_pad_frames': ('', 'true: publish the frames of the pads to tf, where no URDF has them'),
    'method': ('', 'how shapes are recognised: learned (default) or volf'),
    'model': ('', 'weights or curves of the method, as `tactile teach` writes them: a file, or a name in config/'),
    'params_file': ('', 'ROS 2 parameter file for all nodes; arguments given here win over it'),
    'use_sim_time': ('', 'true: take the time from /clock'),
    'side': ('', 'only the nodes of this side: bus: the driver, on the host with the CAN adapter; perception: those '
             'that make shapes and grasps of taxels, on any host (default: all nodes)'),
    'simulate': ('', 'true: a simulated skin in place of the bus, in the process of the driver'),
    'replay': ('', 'recorded CAN log to play in place of the bus; the process ends with the log, with code 1 when '
               'frames did not come out as shapes'),
    'replay_channel': ('', 'bus to play from a log of several buses, as the log names it; for a bag, the topic'),
    'replay_pace': ('', 'speed of the replay: 1 as recorded (default), 0 as fast as possible'),
    'publish_clock': ('', 'true: the replay publishes the time of the log on /clock, for use_sim_time'),
    'record': ('', 'file to record the bus to'),
    'wait_at_start': ('', 'true (default): wait for a missing bus or device; false: exit'),
    'autostart': ('', 'true (default): configure and activate at start; false: leave both to a lifecycle manager'),
}


class Argument(NamedTuple):
    """One of the launch file."""

    default: str
    description: str
    choices: list[str] | None = None


ARGUMENTS = {
    **{name: Argument(*row) for name, row in OPTIONS.items()},
    'side': Argument('', OPTIONS['side'][1], ['', *(side.value for side in Side)]),
    'namespace': Argument('', 'namespace of all nodes and topics, below that of PushRosNamespace'),
    'on_exit': Argument('keep', 'when the process ends: keep: nothing more; respawn: start it again; shutdown: end the '
                        'whole launch, with code 1 where the process has failed', ['keep', 'respawn', 'shutdown'])}


def is_of(side: Side, option: str) -> bool:
    """Whether a node of this side reads an option that is not for every node."""
    return any(option in PARAMETERS[role] or (role is Role.DRIVER and option == 'simulate') for role in roles_of(side))
