"""Every parameter of every node, in one place: name, type, default, range, meaning.

Imports no ROS: launch file, `tactile bringup` and the documents read the tables too.
"""

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from tactile_node.bus.bus_settings import DEFAULT_BITRATE, DEFAULT_CHANNEL, DEFAULT_INTERFACE
from tactile_node.conditioning.tare import TARE_LIMIT_BY_UNIT
from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.shape.recognition import DEFAULT_METHOD
from tactile_node.taxel_frame import LEAST_BY_UNIT, PRESS_BY_UNIT, RELEASE_RATIO

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

METADATA = 'parameter'  # key of a field's metadata
MOST_WAITING = 2  #: frames: ten at 50 Hz are 0.2 s, and a gripper does not close by what is older than 0.15 s

Value = bool | int | float | str | tuple[str, ...] | tuple[int, ...] | tuple[float, ...]
Default = TypeVar('Default', bound=Value)
FRAME_PREFIX = 'put before every frame, as robot_state_publisher does: robot1/'
FULL_SCALE = 'reading of the brightest colour of {} [unit of the taxels]; 0: the highest so far, at least ' + (
    f'{PRESS_BY_UNIT["Pa"] / 1e3:g} kPa, {PRESS_BY_UNIT["N"]:g} N')


class Properties(NamedTuple):
    """What a parameter has beside name and default; ``low`` and ``high`` bound a number."""

    description: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False  #: a change takes effect at once; otherwise the parameter is read-only


class Parameter(NamedTuple):
    """One row of a node's table of parameters."""

    name: str
    default: object
    properties: Properties


def parameter(default: Default, description: str, low: float = -math.inf, high: float = math.inf, *,
              live: bool = False) -> Default:
    """Return a dataclass field that is a ROS parameter."""
    return field(default=default, metadata={METADATA: Properties(description, low, high, live)})


@dataclass(frozen=True)
class NodeSettings:
    """The parameters that every node has: how the topics that come frame by frame are queued."""

    queue_depth: int = parameter(10, 'number of messages a publisher or subscription keeps; the oldest is discarded '
                                 'first. Except in a lossless replay, at most 2 frames wait for a stage', 1, 100_000)
    lossless: bool = parameter(False, 'for replays: publishers keep 5000 messages, also for late subscribers, and the '
                               'driver waits until each frame is answered; all nodes share its process')

    @property
    def qos(self) -> 'QoSProfile':
        from tactile_node.ros.qos import frames_qos
        return frames_qos(self.queue_depth, self.lossless)


@dataclass(frozen=True)
class ReceiverSettings(NodeSettings):
    """The parameters of a node that receives messages of the chain."""

    best_effort: bool = parameter(False, 'true: what is lost on the way to this node is not sent again but counted as '
                                  'skipped, so that what follows need not wait for it; for a link that loses packets')
    max_clock_offset: float = parameter(0.05, 'how far stamps may be ahead of the clock of this host, or behind it '
                                        '(0.5 s at least, for the way takes time), before the diagnostics warn of it '
                                        '(tf lookups at them would fail here) [s]; ages need no common clock', 0, 1e9)

    @property
    def input_qos(self) -> 'QoSProfile':
        """QoS of the subscriptions; a lossless replay loses nothing, whatever ``best_effort`` says."""
        from tactile_node.ros.qos import frames_qos
        return frames_qos(self.queue_depth, self.lossless, self.best_effort)

    @property
    def most_waiting(self) -> int:
        """Frames that may wait for a stage that works on each: a stage that is too slow lags by all that wait."""
        return self.queue_depth if self.lossless else min(self.queue_depth, MOST_WAITING)


def table(settings: type[NodeSettings]) -> tuple[Parameter, ...]:
    """Return the parameters of a node, a row for each field of its settings."""
    return tuple(Parameter(each.name, each.default, each.metadata[METADATA]) for each in fields(settings))


@dataclass(frozen=True)
class DriverSettings(NodeSettings):
    interface: str = parameter(DEFAULT_INTERFACE, 'python-can interface: socketcan, slcan, virtual, pcan, ...')
    channel: str = parameter(DEFAULT_CHANNEL, 'channel of the interface: can0, /dev/ttyACM0, PCAN_USBBUS1, ...')
    bitrate: int = parameter(DEFAULT_BITRATE, 'bit rate of the bus [bit/s]', 10_000, 1_000_000)
    replay: str = parameter('', 'recorded CAN log to play in place of the bus; empty: use the bus')
    replay_pace: float = parameter(1.0, 'speed of the replay: 1 as recorded, 0 as fast as possible', 0, 1000)
    replay_channel: str = parameter('', 'bus to play from a log of several buses, as the log names it; for a bag, the '
                                    'topic')
    replay_loop: bool = parameter(False, 'start the log again at its end; the stamps continue')
    publish_clock: bool = parameter(False, 'of a replay: true: publish the time of the log on /clock, for nodes with '
                                    'use_sim_time')
    record: str = parameter('', 'file to record the bus to; its suffix chooses the format; an existing file is kept '
                            'and the new one numbered; empty: do not record')
    record_rotate_mb: float = parameter(0.0, 'size from which on the recording continues in its next file, '
                                        '<name>_part2 and so on [MB]; 0: one file', 0, 1e6)
    pads: tuple[str, ...] = parameter(('pad',), 'names of the pads on this bus; topics are <name>/taxels')
    node_ids: tuple[int, ...] = parameter((32,), 'CANopen node-ID of each pad; a pad whose layout has several nodes '
                                          'needs one for each of them')
    layouts: tuple[str, ...] = parameter(('sim16x16.yaml',), 'skin layout of each pad, or one for all: a file, or a '
                                         'name in config/')
    eds: tuple[str, ...] = parameter(('',), 'EDS of each pad, or one for all; empty: named as the layout, suffix .eds')
    frame_ids: tuple[str, ...] = parameter(('',), 'frame of each pad (origin at taxel (0, 0), x along columns, z '
                                           'outwards); empty: <name>_pad')
    frame_prefix: str = parameter('', FRAME_PREFIX)
    sync_period: float = parameter(0.02, 'time between two SYNCs, which is the time between two frames [s]', 0.001, 10)
    allow_full_bus: bool = parameter(False, 'true: pads may keep the bus busy for more than 95 % of the time, where a '
                                     'few foreign frames cost sweeps; false: refused at configure')
    produce_sync: bool = parameter(True, 'true: the driver sends SYNC; false: another node on the bus sends it')
    boot_timeout: float = parameter(5.0, 'time for each device to answer at configure [s]', 0.1, 3600)
    sdo_timeout: float = parameter(0.3, 'time for each answer of a device by SDO [s]', 0.02, 60)
    sdo_retries: int = parameter(3, 'further SDO requests where a device does not answer', 0, 100)
    heartbeat_period: float = parameter(0.1, 'time between two heartbeats of a device, written to its 0x1017 [s]',
                                        0.01, 30)
    heartbeat_timeout: float = parameter(0.5, 'time without a heartbeat after which a node is reported as lost [s]; '
                                         'nodes send one every heartbeat_period', 0.3, 60, live=True)
    recover: bool = parameter(True, 'true: reopen a failed bus, configure and start devices that have restarted; '
                              'false: report faults only')
    tare_limit: float = parameter(0.0, 'reading from which on a taxel counts as pressed when a tare is requested '
                                  f'[unit of the taxels]; 0: by the unit ({TARE_LIMIT_BY_UNIT["Pa"] / 1e3:g} kPa, '
                                  f'{TARE_LIMIT_BY_UNIT["N"]:g} N); a contact is refused whatever the limit', 0, 1e9,
                                  live=True)
    follow_drift: bool = parameter(False, 'true: the zero of the taxels follows slow drift while none reads half of '
                                   "tare_limit, or of the unit's own limit where that is lower; it never follows a "
                                   'grasp', live=True)
    faulty_taxels: str = parameter('report', 'handling of taxels detected as dead, stuck or flickering: report (they '
                                   'are reported only) or mask (their values are also NaN); those of '
                                   'faulty_taxels_file are always NaN', live=True)
    faulty_taxels_file: str = parameter('', 'YAML file of taxels that are faulty from the start; '
                                        '`~/save_faulty_taxels` writes the detected ones to it; empty: none')
    frozen_after: float = parameter(0.0, 'time without a change of one count in any taxel after which a pad is '
                                    'reported as frozen and its taxels are NaN [s]; for skins whose readings always '
                                    'vary; 0: never', 0, 3600, live=True)
    gain_files: tuple[str, ...] = parameter(('',), 'per-taxel gains of each pad, or one file for all: text with one '
                                            'line for each row of the pad, or .npy; empty: none')
    response_files: tuple[str, ...] = parameter(('',), "response of each pad's skin, or one for all, as written by "
                                                '`tactile calibrate`: readings become pressures by its curve, fits '
                                                'know the depth of the taxels; empty: not known')
    drop_incomplete: bool = parameter(False, 'true: a sweep that lacks CAN frames is withheld and counted; false: it '
                                      'is published with NaN and status STALE', live=True)
    wait_at_start: bool = parameter(True, 'with autostart: true: wait for a missing bus or device; false: exit')
    autostart: bool = parameter(True, 'true: configure and activate at start; false: leave both to a lifecycle '
                                'manager')


@dataclass(frozen=True)
class ProcessorSettings(ReceiverSettings):
    press_threshold: float = parameter(0.0, 'reading from which on a taxel is pressed [unit of the taxels]; 0: what '
                                       'stands out of the noise (at least '
                                       f'{LEAST_BY_UNIT["Pa"] / 1e3:g} kPa, {LEAST_BY_UNIT["N"]:g} N) and reads half '
                                       f'of its contact; on/off taxels from {PRESS_BY_UNIT["1"]:g} on', 0, 1e9,
                                       live=True)
    release_ratio: float = parameter(RELEASE_RATIO, 'fraction of press_threshold, if one is given, below which a '
                                     'pressed taxel is released', 0.01, 1.0, live=True)
    smallest_contact: int = parameter(SMALLEST_CONTACT, 'taxels of the smallest contact that is looked for: a pad is '
                                      'not seen while hidden taxels could hold one', 1, 10_000, live=True)
    features: tuple[str, ...] = parameter(('classifier',), 'groups of features to compute beside those the classifier '
                                          'needs: information, gravity, eigenvalues, border, rotated, all', live=True)
    full_scale: float = parameter(0.0, FULL_SCALE.format('image_colour'), 0, 1e9)


@dataclass(frozen=True)
class ClassifierSettings(ReceiverSettings):
    method: str = parameter(DEFAULT_METHOD, 'recognition method: learned, or volf (the three planes of Volf, Dvořák '
                            'and Vlček)')
    model: str = parameter('', 'weights or curves of the method: a file, or a name in config/; empty: its own')
    fuse: bool = parameter(True, 'true: the shape is decided from successive frames; false: from each frame alone')
    fit: bool = parameter(True, 'true: fit pose and size; false: leave them out')
    solid_height: float = parameter(0.0, 'height of the solid added to each shape [m]; 0: none', 0, 10)
    full_scale: float = parameter(0.0, FULL_SCALE.format('markers'), 0, 1e9)


@dataclass(frozen=True)
class GraspNodeSettings(ReceiverSettings):
    left_pad: str = parameter('left', 'name of the left pad')
    right_pad: str = parameter('right', 'name of the right pad, which faces the left one')
    frame_id: str = parameter('gripper', 'frame of the gripper, in which the grasp is published')
    frame_prefix: str = parameter('', FRAME_PREFIX)
    left_xyz: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), 'taxel (0, 0) of the left pad in the gripper frame, gripper closed [m]')
    left_rpy: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), 'roll, pitch, yaw of the left pad in the gripper frame [rad]')
    right_xyz: tuple[float, float, float] = parameter(
        (0.0, 0.03, 0.0), 'taxel (0, 0) of the right pad in the gripper frame, gripper closed [m]')
    right_rpy: tuple[float, float, float] = parameter(
        (math.pi, 0.0, 0.0), 'roll, pitch, yaw of the right pad in the gripper frame [rad]')
    gap_source: str = parameter('parameter', 'where the opening of the gripper comes from: parameter (gap), '
                                'joint_states, tf or none; while it is not known, what depends on it is NaN')
    gap: float = parameter(-1.0, 'opening of the gripper with gap_source parameter [m]; below 0: not known', -1,
                           HIGHEST_GAP, live=True)
    gap_joints: tuple[str, ...] = parameter(('',), 'joints whose positions, added, give the opening (gap_source '
                                            'joint_states)')
    joint_states_topic: str = parameter('/joint_states', 'topic of the joints (gap_source joint_states)')
    gap_frames: tuple[str, ...] = parameter(('', ''), 'frames on the left and the right finger whose distance along '
                                            'the closing direction gives the opening (gap_source tf)')
    gap_scale: float = parameter(1.0, 'opening for a metre or a radian of the joints, or a metre of the distance: '
                                 'opening = gap_offset + gap_scale * reading; < 0: it closes as they rise (gap_source '
                                 'joint_states, tf)', -1000, 1000)
    gap_offset: float = parameter(0.0, 'opening at reading 0 [m] (gap_source joint_states, tf)', -10, 10)
    publish_pad_frames: bool = parameter(False, 'true: publish where both pads are in frame_id to tf, as long as the '
                                         'opening is known; for a robot whose URDF does not have these frames')
    pad_frames: tuple[str, ...] = parameter(('', ''), 'frames of the left and the right pad for publish_pad_frames, '
                                            'as frame_ids of the driver; empty: <name>_pad')
    max_gap_age: float = parameter(0.3, 'age from which on an opening of joint_states or tf is not known any more '
                                   '[s]', 0.01, 3600)
    max_creep: float = parameter(0.0005, "speed of a contact's centre from which on a grasp is never stable; at a "
                                 'tenth of it, it stays so [m/s]', 1e-6, 1)
    centre_tolerance: float = parameter(0.001, "distance of a sudden move of a contact's centre that ends a stable "
                                        'grasp at once [m]', 1e-6, 1)
    min_hold: float = parameter(0.2, 'time shapes and centres must hold for a stable grasp [s]', 0, 3600)
    max_skew: float = parameter(0.1, 'largest time between the acquisitions of the two pads for a fresh grasp [s]',
                                1e-3, 3600)
    max_age: float = parameter(0.25, "age of a pad's result from which on the pad counts as unseen [s]", 1e-3, 3600)

    @property
    def frame(self) -> str:
        return self.frame_prefix + self.frame_id

    @property
    def fingers(self) -> tuple[str, ...]:
        """The frames on the left and on the right finger."""
        return tuple(self.frame_prefix + name.lstrip('/') for name in self.gap_frames)

    @property
    def frames_of_pads(self) -> tuple[str, ...]:
        """The frames of the left and the right pad: those given, else as the driver's defaults."""
        return tuple(self.frame_prefix + (name or f'{pad.rsplit("/", 1)[-1]}_pad')
                     for name, pad in zip(self.pad_frames, (self.left_pad, self.right_pad)))
