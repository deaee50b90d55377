"""Every parameter of every node, in one place: name, default, range, meaning."""

import math
from difflib import get_close_matches
from types import SimpleNamespace
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Group
from tactile_node.shape.methods import DEFAULT

ALIKE = 0.8  # of two names: one may be the other, misspelt


class Parameter(NamedTuple):
    """One row; ``low`` and ``high`` bound a number, ``live`` says that a change takes effect at once."""

    name: str
    default: Any
    description: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False


QUEUE = (
    Parameter('queue_depth', 10, 'messages a publisher or subscription keeps; the oldest goes first', 1, 100_000),
    Parameter('lossless', False, 'for replays: publishers keep 5000 messages, also for subscribers that come late'),
)

DRIVER = (
    Parameter('interface', 'socketcan', 'python-can interface: socketcan, slcan, virtual, pcan, kvaser, ...'),
    Parameter('channel', 'can0', 'channel of the interface: can0, /dev/ttyACM0, PCAN_USBBUS1, ...'),
    Parameter('bitrate', 1_000_000, 'bit rate of the bus [bit/s]', 10_000, 1_000_000),
    Parameter('replay', '', 'a recorded CAN log to play in place of the bus; empty: use the bus'),
    Parameter('replay_pace', 1.0, 'speed of the replay, 1 = as recorded, 0 = as fast as possible', 0, 1000),
    Parameter('replay_channel', '', 'of a log of several buses the one to play, as the log calls it; of a bag, '
              'the topic'),
    Parameter('replay_loop', False, 'begin the log again at its end, stamps going on'),
    Parameter('record', '', 'a file to record the bus to, numbered when it exists; the suffix chooses the format; '
              'empty: do not'),
    Parameter('pads', ['pad'], 'names of the pads on this bus; topics are <name>/taxels'),
    Parameter('node_ids', [32], 'CANopen node-ID of each pad, of each of its nodes where its layout has several'),
    Parameter('layouts', ['sim16x16.yaml'], 'skin layout of each pad, or one for all: a file, or a name in config/'),
    Parameter('eds', [''], 'EDS of each pad, or one for all; empty: named as the layout, suffix .eds'),
    Parameter('frame_ids', [''], 'frame of each pad (taxel (0, 0), x along columns, z outwards); empty: <name>_pad'),
    Parameter('sync_period', 0.02, 'time between two SYNCs, that is two frames [s]', 0.001, 10),
    Parameter('produce_sync', True, 'send SYNC ourselves; false: another node on the bus does'),
    Parameter('boot_timeout', 5.0, 'how long to wait for each device to answer at configure [s]', 0.1, 3600),
    Parameter('heartbeat_timeout', 0.5, 'a node not heard for so long is told as gone [s]; it sends every 0.1 s', 0.3,
              60, live=True),
    Parameter('recover', True, 'mend a failed bus and devices that start anew; false: only tell of them'),
    Parameter('tare_limit', 0.0, 'a taxel that reads so much counts as pressed when a tare is asked for '
              '[unit of the taxels]; 0: by the unit (10 kPa, 0.03 N)', 0, 1e9, live=True),
    Parameter('follow_drift', False, 'the zero of the taxels follows slow drift while none reads half of tare_limit; '
              'a grasp is never followed', live=True),
    Parameter('faulty_taxels', 'report', 'taxels found dead, stuck or flickering by what they send: report (told only) '
              'or mask (NaN too); those of faulty_taxels_file are always NaN', live=True),
    Parameter('faulty_taxels_file', '', 'YAML file of taxels that are faulty from the start; `~/save_faulty_taxels` '
              'writes those found to it; empty: none'),
    Parameter('frozen_after', 0.0, 'a pad whose taxels do not change by one count for so long has stopped sampling: it '
              'is told and its taxels are NaN [s]; for skins that are never quite still; 0: never', 0, 3600, live=True),
    Parameter('gain_files', [''], 'per-taxel gains of each pad, or one file for all: text, a row of the pad a line, or '
              '.npy; empty: none'),
    Parameter('drop_incomplete', False, 'true: a sweep that lacks CAN frames is dropped and counted; false: it is '
              'published with NaN, status STALE', live=True),
    Parameter('wait_at_start', True, 'with autostart: wait for a bus or device that is not there, rather than end'),
    Parameter('autostart', True, 'configure and activate at start; false: leave it to a lifecycle manager'),
    *QUEUE,
)

PROCESSOR = (
    Parameter('press_threshold', 0.0, 'a taxel is pressed from here on [unit of the taxels]; '
              '0: by the unit (30 kPa, 0.1 N, 0.5 for on/off)', 0, 1e9, live=True),
    Parameter('release_ratio', 0.8, 'a pressed taxel is released below this part of press_threshold',
              0.01, 1.0, live=True),
    Parameter('features', ['classifier'], 'groups of features to compute beside those the classifier needs: '
              'information, gravity, eigenvalues, border, rotated, all', live=True),
    *QUEUE,
)

CLASSIFIER = (
    Parameter('method', DEFAULT, 'learned, or volf: the three planes of Volf, Dvořák and Vlček'),
    Parameter('model', '', 'weights or curves of the method: a file, or a name in config/; empty: its own'),
    Parameter('fuse', True, 'successive frames together say the shape; false: each frame alone'),
    Parameter('fit', True, 'fit pose and size; false: leave them out'),
    Parameter('solid_height', 0.0, 'height of the solid added to each shape [m]; 0: none', 0, 10),
    *QUEUE,
)

GRASP = (
    Parameter('left_pad', 'left', 'name of the left pad'),
    Parameter('right_pad', 'right', 'name of the right pad, facing the left one'),
    Parameter('frame_id', 'gripper', 'frame of the gripper, in which the grasp is told'),
    Parameter('left_xyz', [0.0, 0.0, 0.0], 'taxel (0, 0) of the left pad in the gripper frame, gripper closed [m]'),
    Parameter('left_rpy', [0.0, 0.0, 0.0], 'roll, pitch, yaw of the left pad in the gripper frame [rad]'),
    Parameter('right_xyz', [0.0, 0.03, 0.0], 'taxel (0, 0) of the right pad in the gripper frame, gripper closed [m]'),
    Parameter('right_rpy', [math.pi, 0.0, 0.0], 'roll, pitch, yaw of the right pad in the gripper frame [rad]'),
    Parameter('gap', 0.0, 'opening of the gripper [m]', 0, 1),
    Parameter('centre_tolerance', 0.001, 'how far a held contact\'s centre may move [m]', 1e-6, 1),
    Parameter('min_hold', 0.2, 'how long shapes and centres must hold for a stable grasp [s]', 0, 3600),
    Parameter('max_skew', 0.1, 'how far the two pads\' stamps may be apart [s]', 1e-3, 3600),
    *QUEUE,
)


def declare(node: Node, table: tuple[Parameter, ...]) -> None:
    """Declare the rows of ``table`` on ``node``; what is not live is read-only once declared."""
    for row in table:
        descriptor = ParameterDescriptor(name=row.name, description=row.description, read_only=not row.live)
        if math.isfinite(row.high):
            _bound(descriptor, row)
        node.declare_parameter(row.name, row.default, descriptor)
    _warn_of_misspelt(node, [row.name for row in table])


def values(node: Node, table: tuple[Parameter, ...]) -> SimpleNamespace:
    """Return the present values of the rows of ``table`` as attributes."""
    return SimpleNamespace(**{row.name: node.get_parameter(row.name).value for row in table})


def _warn_of_misspelt(node: Node, known: list[str]) -> None:
    """ROS takes a parameter file with any names, since one file may serve several nodes."""
    for name in set(getattr(node, '_parameter_overrides', {})) - set(known):
        for near in get_close_matches(name, known, 1, ALIKE):
            node.get_logger().warning(f'parameter {name!r} is not known: is {near!r} meant?')


def _bound(descriptor: ParameterDescriptor, row: Parameter) -> None:
    if isinstance(row.default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(row.low), to_value=float(row.high))]
    else:
        descriptor.integer_range = [IntegerRange(from_value=int(row.low), to_value=int(row.high), step=1)]


#: A taxel is pressed from here on, by the unit of the taxels, unless press_threshold says otherwise.
PRESSED_BY_UNIT = {'Pa': 30e3, 'N': 0.1, '1': 0.5}


def pressed_thresholds(settings: SimpleNamespace, unit: str) -> tuple[float, float]:
    """Return the press and release thresholds [``unit``]. Raises ConfigurationError for an unknown unit."""
    press = settings.press_threshold or PRESSED_BY_UNIT.get(unit)
    if press is None:
        raise ConfigurationError('parameter press_threshold', expected=f'a threshold for taxels in {unit!r}', got='0',
                                 remedy=f'Only for {", ".join(PRESSED_BY_UNIT)} there is a default; set one.')
    return press, press * settings.release_ratio


#: A taxel that reads so much is pressed when a tare is asked for: less than a contact worth the name.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}
FAULTY_TAXELS = ('mask', 'report')
ON_OFF_LIMIT = 0.5


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or the limit for ``unit``. Raises ConfigurationError where there is none."""
    limit = None if unit == '1' else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """As `tare_limit`, for on/off taxels too: below it a taxel is not pressed."""
    return ON_OFF_LIMIT if unit == '1' else tare_limit(given, unit)


def masks_faulty(given: str) -> bool:
    """Whether faulty taxels are masked. Raises ConfigurationError for what `faulty_taxels` may not be."""
    if given not in FAULTY_TAXELS:
        raise ConfigurationError('parameter faulty_taxels', expected=' or '.join(FAULTY_TAXELS), got=repr(given),
                                 remedy='Choose one of these.')
    return given == 'mask'


def feature_groups(names: list[str]) -> Group:
    """Return the named groups and the classifier's. Raises ConfigurationError for a name that is none."""
    groups = Group.CLASSIFIER
    for name in names:
        if name.upper() not in Group.__members__:
            raise ConfigurationError('parameter features', expected='names of ' + ', '.join(Group.__members__).lower(),
                                     got=repr(name), remedy='See `tactile features --help` for what each computes.')
        groups |= Group[name.upper()]
    return groups
