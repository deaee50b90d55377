"""All parameters of all nodes, with name, type, default, range and meaning.

This module does not import ROS, because the launch file, `tactile bringup` and the documentation also read the tables.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tactile_node.bus.bus_settings import (
    DEFAULT_BITRATE,
    DEFAULT_CHANNEL,
    DEFAULT_INTERFACE,
    DEFAULT_LAYOUT,
    DEFAULT_NODE_ID,
    BusSettings,
)
from tactile_node.conditioning.tare import TARE_LIMIT_BY_UNIT
from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.grasp.tracker import GraspSettings
from tactile_node.parameter import parameter
from tactile_node.pose.motion import SHIFT_PER_LOAD
from tactile_node.shape.recognition import DEFAULT_METHOD
from tactile_node.taxel_frame import LEAST_BY_UNIT, PRESS_BY_UNIT, RELEASE_RATIO

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

BUS = BusSettings(DEFAULT_INTERFACE, DEFAULT_CHANNEL)  #: source of the defaults of the driver's bus
GRASP = GraspSettings()  #: source of the defaults of the grasp node

FRAME_PREFIX = 'prefix of every frame, such as robot1/, as for robot_state_publisher'
FULL_SCALE = 'reading with the brightest colour of {} [unit of the taxels]; 0: the highest so far, at least ' + (
    f'{PRESS_BY_UNIT["Pa"] / 1e3:g} kPa, {PRESS_BY_UNIT["N"]:g} N')


@dataclass(frozen=True)
class NodeSettings:
    """Parameters that every node has, for the queues of the topics with one message per frame."""

    queue_depth: int = parameter(10, 'number of messages that a publisher or subscription keeps; the oldest is '
                                 'discarded first. Except in a lossless replay, at most 2 frames and 1 contact of a '
                                 'pad wait for their stage', 1, 100_000)
    lossless: bool = parameter(False, 'true: lossless replay. Publishers keep 5000 messages, also for late '
                               'subscribers, and the driver waits until each frame is processed; all nodes must share '
                               'its process')

    @property
    def qos(self) -> 'QoSProfile':
        from tactile_node.ros.qos import frames_qos
        return frames_qos(self.queue_depth, self.lossless)


@dataclass(frozen=True)
class ReceiverSettings(NodeSettings):
    """Parameters of a node that receives messages of the processing chain."""

    best_effort: bool = parameter(False, 'true: messages lost on the way to this node are counted as skipped and not '
                                  'sent again, so that later messages do not wait; for a link that loses packets')
    max_clock_offset: float = parameter(0.05, 'offset between stamps and the clock of this host above which the '
                                        'diagnostics warn, because tf lookups at these stamps would fail [s]; for '
                                        'stamps behind the clock, the limit is at least 0.5 s, because messages take '
                                        'time; ages need no common clock', 0, 1e9)

    @property
    def input_qos(self) -> 'QoSProfile':
        """QoS of the subscriptions. In a lossless replay, ``best_effort`` has no effect."""
        from tactile_node.ros.qos import frames_qos
        return frames_qos(self.queue_depth, self.lossless, self.best_effort)


@dataclass(frozen=True)
class DriverSettings(NodeSettings):
    interface: str = parameter(DEFAULT_INTERFACE, 'python-can interface: socketcan, slcan, virtual, pcan, ...')
    channel: str = parameter(DEFAULT_CHANNEL, 'channel of the interface: can0, /dev/ttyACM0, PCAN_USBBUS1, ...')
    bitrate: int = parameter(DEFAULT_BITRATE, 'bit rate of the bus [bit/s]', 10_000, 1_000_000)
    replay: str = parameter('', 'recorded CAN log to play instead of using the bus; empty: use the bus')
    replay_pace: float = parameter(1.0, 'speed of the replay: 1 as recorded, 0 as fast as possible', 0, 1000)
    replay_channel: str = parameter('', 'name of the bus to play if the log contains several buses; for a bag, the '
                                    'topic')
    publish_clock: bool = parameter(False, 'true: in a replay, publish the time of the log on /clock, for nodes with '
                                    'use_sim_time')
    record: str = parameter('', 'file to which the bus is recorded; its suffix selects the format. If the file exists, '
                            'the new file gets a number; empty: do not record')
    record_rotate_mb: float = parameter(0.0, 'file size at which the recording continues in the next file, '
                                        '<name>_part2 and so on [MB]; 0: a single file', 0, 1e6)
    pads: tuple[str, ...] = parameter(('pad',), 'names of the pads on this bus; topics are <name>/taxels')
    node_ids: tuple[int, ...] = parameter((DEFAULT_NODE_ID,), 'CANopen node-ID of each pad; a pad whose layout has '
                                          'several nodes needs one for each node')
    layouts: tuple[str, ...] = parameter((DEFAULT_LAYOUT,), 'skin layout of each pad, or one layout for all pads: a '
                                         'file, or a name in config/')
    eds: tuple[str, ...] = parameter(('',), 'EDS of each pad, or one EDS for all pads; empty: the name of the layout '
                                     'with the suffix .eds')
    mirrored_pads: tuple[str, ...] = parameter(('',), 'names of the pads whose columns run in the other direction than '
                                               'in their layout; for these pads, gain files and '
                                               'faulty_taxels_file count the mirrored columns; empty: none')
    frame_ids: tuple[str, ...] = parameter(('',), 'frame of each pad (origin at taxel (0, 0), x along columns, z '
                                           'outwards); empty: <name>_pad')
    frame_prefix: str = parameter('', FRAME_PREFIX)
    sync_period: float = parameter(BUS.sync_period, 'time between two SYNCs, and therefore between two taxel frames '
                                   '[s]', 0.001, 10)
    allow_full_bus: bool = parameter(BUS.allow_full_bus, 'true: the pads may keep the bus busy for more than 95 % of '
                                     'the time, although a few foreign frames then cause lost sweeps; false: '
                                     'refuse such a bus load at configure')
    produce_sync: bool = parameter(BUS.produce_sync, 'true: the driver sends SYNC; false: another node on the bus '
                                   'sends it')
    boot_timeout: float = parameter(BUS.boot_timeout, 'time allowed for each device to answer at configure [s]', 0.1,
                                    3600)
    sdo_timeout: float = parameter(BUS.sdo_timeout, 'time allowed for each SDO response of a device [s]', 0.02, 60)
    sdo_retries: int = parameter(BUS.sdo_retries, 'number of repeated SDO requests if a device does not respond', 0,
                                 100)
    heartbeat_period: float = parameter(BUS.heartbeat_ms / 1000, 'time between two heartbeats of a device, written to '
                                        'its 0x1017 [s]', 0.01, 30)
    heartbeat_timeout: float = parameter(0.5, 'time without a heartbeat after which a node is reported as lost [s]; '
                                         'nodes send a heartbeat every heartbeat_period', 0.3, 60, live=True)
    recover: bool = parameter(True, 'true: reopen a failed bus, and configure and start restarted devices; false: only '
                              'report faults')
    tare_limit: float = parameter(0.0, 'reading at which a taxel starts to count as pressed when a tare is requested '
                                  f'[unit of the taxels]; 0: by the unit ({TARE_LIMIT_BY_UNIT["Pa"] / 1e3:g} kPa, '
                                  f'{TARE_LIMIT_BY_UNIT["N"]:g} N). A tare under a contact is refused at any limit', 0,
                                  1e9, live=True)
    follow_drift: bool = parameter(False, 'true: the zero of the taxels follows slow drift while no taxel reads half '
                                   "of tare_limit, or half of the unit's own limit if that is lower; it never follows "
                                   'a grasp', live=True)
    faulty_taxels: str = parameter('report', 'handling of taxels detected as dead, stuck or flickering: report (only '
                                   'report them) or mask (also set their values to NaN); taxels in faulty_taxels_file '
                                   'are always NaN', live=True)
    faulty_taxels_file: str = parameter('', 'YAML file with taxels that are faulty from the start; '
                                        '`~/save_faulty_taxels` writes the detected faulty taxels to this file; empty: '
                                        'none')
    frozen_after: float = parameter(0.0, 'time after which a pad is reported as frozen and its taxels become NaN, if '
                                    'no taxel has changed by a count [s]; only for skins whose readings always vary; '
                                    '0: never', 0, 3600, live=True)
    gain_files: tuple[str, ...] = parameter(('',), 'per-taxel gains of each pad, or one file for all: text with one '
                                            'line for each row of the pad, or .npy; empty: none')
    response_files: tuple[str, ...] = parameter(('',), "response of each pad's skin, or one response for all pads, "
                                                'from `tactile calibrate`: the driver converts readings to pressures '
                                                'with the curve in the file, and fits use the depth of the taxels; '
                                                'empty: not known')
    drop_incomplete: bool = parameter(BUS.drop_incomplete, 'true: withhold and count a sweep that lacks CAN frames; '
                                      'false: publish it with NaN and status STALE', live=True)
    wait_at_start: bool = parameter(True, 'true: with autostart, wait for a missing bus or device; false: exit instead')
    autostart: bool = parameter(True, 'true: configure and activate at start; false: leave both to a lifecycle '
                                'manager')


@dataclass(frozen=True)
class ProcessorSettings(ReceiverSettings):
    press_threshold: float = parameter(0.0, 'reading at which a taxel becomes pressed [unit of the taxels]; 0: a taxel '
                                       'is pressed if it stands out from the noise (at least '
                                       f'{LEAST_BY_UNIT["Pa"] / 1e3:g} kPa, {LEAST_BY_UNIT["N"]:g} N) and reads half '
                                       f"of its contact's level; on/off taxels are pressed from {PRESS_BY_UNIT['1']:g} "
                                       'on', 0, 1e9, live=True)
    release_ratio: float = parameter(RELEASE_RATIO, 'fraction of press_threshold, if one is given, below which a '
                                     'pressed taxel is released', 0.01, 1.0, live=True)
    smallest_contact: int = parameter(SMALLEST_CONTACT, 'number of taxels in the smallest contact that is reported; a '
                                      'pad is not seen while hidden taxels could hold such a contact', 1, 10_000,
                                      live=True)
    features: tuple[str, ...] = parameter(('classifier',), 'groups of features to compute besides those that the '
                                          'classifier needs: information, gravity, eigenvalues, border, rotated, all',
                                          live=True)
    full_scale: float = parameter(0.0, FULL_SCALE.format('image_colour'), 0, 1e9)


@dataclass(frozen=True)
class ClassifierSettings(ReceiverSettings):
    method: str = parameter(DEFAULT_METHOD, 'recognition method: learned, or volf (the three planes of Volf, Dvořák '
                            'and Vlček)')
    model: str = parameter('', 'file with the weights or curves of the method, or a name in config/; empty: the '
                           'default file of the method')
    fuse: bool = parameter(True, 'true: decide the shape from successive frames; false: from each frame alone')
    fit: bool = parameter(True, 'true: fit pose and size; false: do not fit')
    solid_height: float = parameter(0.0, 'height of the solid that is added to each shape [m]; 0: none', 0, 10)
    full_scale: float = parameter(0.0, FULL_SCALE.format('markers'), 0, 1e9)
    shift_per_load: float = parameter(SHIFT_PER_LOAD, 'largest shift of a contact that does not slide, divided by the '
                                      'load along the pad as a share of the normal force [m]; up to half of this '
                                      'value, a movement is reported as a shift', 1e-4, 1)


@dataclass(frozen=True)
class GraspNodeSettings(ReceiverSettings):
    left_pad: str = parameter('left', 'name of the left pad')
    right_pad: str = parameter('right', 'name of the right pad, which faces the left one')
    frame_id: str = parameter('gripper', 'frame of the gripper, in which the grasp is published')
    frame_prefix: str = parameter('', FRAME_PREFIX)
    left_xyz: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), 'position of taxel (0, 0) of the left pad in the gripper frame, with the gripper closed [m]')
    left_rpy: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), 'roll, pitch, yaw of the left pad in the gripper frame [rad]')
    right_xyz: tuple[float, float, float] = parameter(
        (0.0, 0.03, 0.0), 'position of taxel (0, 0) of the right pad in the gripper frame, with the gripper closed [m]')
    right_rpy: tuple[float, float, float] = parameter(
        (math.pi, 0.0, 0.0), 'roll, pitch, yaw of the right pad in the gripper frame [rad]')
    gap_source: str = parameter('parameter', 'source of the opening of the gripper: parameter (gap), joint_states, tf '
                                'or none; while the opening is not known, values that depend on it are NaN')
    gap: float = parameter(-1.0, 'opening of the gripper with gap_source parameter [m]; below 0: not known', -1,
                           HIGHEST_GAP, live=True)
    gap_joints: tuple[str, ...] = parameter(('',), 'joints whose positions add up to the opening (gap_source '
                                            'joint_states)')
    joint_states_topic: str = parameter('/joint_states', 'topic of the joints (gap_source joint_states)')
    gap_frames: tuple[str, ...] = parameter(('', ''), 'frames on the left and the right finger whose distance along '
                                            'the closing direction gives the opening (gap_source tf)')
    gap_scale: float = parameter(1.0, 'change of the opening per metre or radian of the joints, or per metre of the '
                                 'distance: opening = gap_offset + gap_scale * reading; below 0 if the gripper closes '
                                 'as the reading rises (gap_source joint_states, tf)', -1000, 1000)
    gap_offset: float = parameter(0.0, 'opening when the reading is 0 [m] (gap_source joint_states, tf)', -10, 10)
    publish_pad_frames: bool = parameter(False, 'true: publish the poses of both pads in frame_id on tf while the '
                                         'opening is known; for a robot whose URDF does not define these frames')
    pad_frames: tuple[str, ...] = parameter(('', ''), 'frames of the left and the right pad for publish_pad_frames, '
                                            "equal to the driver's frame_ids; empty: <name>_pad")
    max_gap_age: float = parameter(0.3, 'age above which an opening from joint_states or tf is no longer known [s]',
                                   0.01, 3600)
    max_creep: float = parameter(GRASP.steadiness.max_creep, "speed of a contact's centre above which a grasp is never "
                                 'stable; a stable grasp stays stable up to a tenth of it [m/s]', 1e-6, 1)
    centre_tolerance: float = parameter(GRASP.steadiness.slip, "sudden displacement of a contact's centre that "
                                        'immediately ends a stable grasp [m]', 1e-6, 1)
    min_hold: float = parameter(GRASP.min_hold, 'time for which the shapes and centres of both contacts must stay the '
                                'same for a stable grasp [s]', 0, 3600)
    max_skew: float = parameter(GRASP.max_skew, 'largest time between the acquisitions of the two pads for a fresh '
                                'grasp [s]', 1e-3, 3600)
    max_age: float = parameter(GRASP.max_age, "age of a pad's result above which the pad counts as unseen; if the "
                               'results of a pad are further apart, its grasp is never stable [s]', 1e-3, 3600)

    @property
    def frame(self) -> str:
        return self.frame_prefix + self.frame_id

    @property
    def fingers(self) -> tuple[str, ...]:
        """tf frames on the left and on the right finger, including ``frame_prefix``."""
        return tuple(self.frame_prefix + name.lstrip('/') for name in self.gap_frames)

    @property
    def frames_of_pads(self) -> tuple[str, ...]:
        """Frames of the left and the right pad. A frame that is not given has the driver's default name."""
        return tuple(self.frame_prefix + (name or f'{pad.rsplit("/", 1)[-1]}_pad')
                     for name, pad in zip(self.pad_frames, (self.left_pad, self.right_pad)))
