"""A message with any content must not stop a node.

A node drops a malformed message, counts it by reason, and processes the next good message.
"""

import copy
import logging
import math
import os
import subprocess
import sys
import threading
import time
import tracemalloc
from array import array
from pathlib import Path

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter import Parameter
from rclpy.type_hash import TypeHash
from ros_bench import TIMEOUT, RosBench, VirtualTime, features_fit

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import InputError
from tactile_node.grasp.gripper import Gripper
from tactile_node.grasp.opening import GapSource, Opening
from tactile_node.grasp.tracker import GraspTracker, SideResult, SideState
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.pose.events import Event, EventKind, Motion, SeenBy
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.pipeline import FoundContact, StreamedContact, Taxels
from tactile_node.ros.contact_messages import (
    PadContact,
    PadFrame,
    contact_message,
    features_message,
    pad_contact_of,
    pad_frame_of,
    taxel_array_message,
    taxel_values,
)
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.grasp_messages import CurrentGrasp, grasp_message, side_result
from tactile_node.ros.message_checks import (
    RejectReason,
    check_contact,
    check_contact_shape,
    check_taxel_array,
)
from tactile_node.ros.message_health import MessageCounts, StreamFault, StreamHealth, health_status
from tactile_node.ros.motion_messages import check_contact_event, event_message
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.shape_messages import PadShape, pad_shape_of
from tactile_node.ros.source_guard import SOURCE_HOLD
from tactile_node.ros.time_messages import duration_message, time_message
from tactile_node.shape.fusion import FusedRecognition, RecognitionFusion
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_skin.msg import (
    Contact,
    ContactEvent,
    ContactFeatures,
    ContactMotion,
    ContactShape,
    Grasp,
    TaxelArray,
)

pytestmark = pytest.mark.ros

ROOT = Path(__file__).resolve().parents[1]
STAMP, PITCH = 1_700_000_000.25, 0.002
PAD = Taxels(PITCH, 'Pa')
DEPTH = 500
NAN, INF, HUGE = math.nan, math.inf, 4_000_000_000
WARN, STALE, OK = DiagnosticStatus.WARN, DiagnosticStatus.STALE, DiagnosticStatus.OK


def good_taxels(sequence=0) -> TaxelArray:
    values = np.zeros((16, 16), np.float32)
    values[4:10, 3:9] = 50e3
    values[0, 0] = np.nan
    status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
    frame = TaxelFrame(STAMP + 0.02 * sequence, sequence, values, status, missing_can_frames=0)
    return taxel_array_message(PadFrame.of(frame, PAD, 'left_pad'))


def pad_contact(taxels, pattern) -> PadContact:
    return PadContact(pad_frame_of(taxels), FoundContact.of(pattern, PAD))


def good_contact(sequence=0) -> Contact:
    taxels = good_taxels(sequence)
    pattern = ContactPattern.of(taxel_values(taxels) > 0, taxel_values(taxels))
    return contact_message(pad_contact(taxels, pattern))


def good_shape(sequence=0) -> ContactShape:
    contact = good_contact(sequence)
    frame = Recognition.of({Shape.SQUARE: 0.75, Shape.UNKNOWN: 0.25})
    received = pad_contact_of(contact)
    found = received.found
    fit = fit_shape(found.pattern.values, found.pattern.mask, Shape.SQUARE, PITCH)
    fused = FusedRecognition(frame, STAMP, 1.5, 30)
    result = StreamedContact(frame, fused, fit, found, found.moments, Motion())
    message = PadShape.of(received, result, 'learned', 0.0).message
    message.age = Duration()
    return message


def good_event(sequence=0) -> ContactEvent:
    event = Event(EventKind.SLIDING, STAMP, SeenBy.OUTLINE, 0.99, speed=0.01, direction=-3.0)
    shape = good_shape(sequence)
    return event_message(event, shape.header, sequence, shape.age)


def good_grasp(sequence=0) -> Grasp:
    tracker, side = GraspTracker(), pad_shape_of(good_shape(sequence))
    opening = Opening(0.04, GapSource.PARAMETER, 1.0)
    tracker.update('left', side_result(side, 5.0), now=5.0)
    tracker.update('right', side_result(side, 5.0), now=5.0)
    state = tracker.state(5.0, opening.gap)
    return grasp_message(CurrentGrasp(state, [side, side], opening, 'gripper', ages=(0.02, 0.01), gripper=Gripper()))


def labels(*numbers):
    """Return an array with the given labels for the first taxels, and no label for the others."""
    return array('B', [*numbers, *[0] * (256 - len(numbers))])


R = RejectReason
Change = dict[str, object]  # Maps a field to a bad value. A number in the path of a field is an index.
NO_CONTACT: Change = {'labels': labels(), 'contacts': 0, 'contact_taxels': array('I')}
NO_SHAPE: Change = {'shape': ContactShape.NONE, 'class_name': 'none', 'confidence': 1.0, 'fit_valid': False,
                    'taxels': 0, 'contacts': 0, 'contact_areas': array('d'),
                    'probabilities': array('f', [0, 0, 0, 0, 0, 1, 0])}
ONE_SIDE_UNSEEN: Change = {'side_states.0': Grasp.SIDE_UNSEEN, 'fresh': False}
TIMES: dict[R, list[Change]] = {
    R.WRONG_STAMP: [{'header.stamp.nanosec': 10**9}, {'header.stamp.sec': -1}, {'header.stamp.sec': 2**31 - 1},
                    {'age.sec': -1}, {'age.nanosec': 10**9}]}
GRID: dict[R, list[Change]] = {
    R.WRONG_LENGTH: [{'rows': 15}],
    R.NO_TAXELS: [{'rows': 0, 'cols': 0}, {'rows': 0}],
    # In 32-bit arithmetic, the product of these sizes is 0.
    R.TOO_LARGE: [{'rows': HUGE, 'cols': HUGE}, {'rows': 1 << 16, 'cols': 1 << 16}],
    R.WRONG_PITCH: [{'pitch': pitch} for pitch in (NAN, 0.0, -0.002, INF, -INF)]}
VALUES: dict[R, list[Change]] = {
    R.WRONG_LENGTH: [{'values': array('f', [1.0] * 255)}, {'values': array('f')}, {'status': array('B', [0] * 255)},
                     {'status': array('B')}],
    R.UNKNOWN_UNIT: [{'unit': 'psi'}, {'unit': ''}],
    R.NOT_FINITE: [{'values.7': INF}],
    R.INCONSISTENT: [{'values.7': NAN}, {'status.7': TaxelStatus.DEAD}, {'status': array('B', [0] * 256)}],
    R.UNKNOWN_CODE: [{'status.3': 7}, {'finger_ends': 16}]}
TPDOS: Change = {'taxel_tpdos': array('H', [0] * 256)}
TAXELS: dict[R, list[Change]] = {
    R.WRONG_LENGTH: [{'tpdo_ages': array('f', [0.1])}],
    R.UNKNOWN_CODE: [TPDOS, {'tpdo_ages': array('f', [0.1]), 'taxel_tpdos': array('H', [1] * 256)}],
    R.WRONG_STAMP: [TPDOS | {'tpdo_ages': array('f', [-0.1])}],
    R.NOT_FINITE: [TPDOS | {'tpdo_ages': array('f', [NAN])}]}
CONTACTS: dict[R, list[Change]] = {
    R.WRONG_LENGTH: [{'labels': array('B', [1] * 255)}, {'contacts': 2}, {'contacts': HUGE},
                     {'noise_floor': array('f', [1.0])}],
    R.INCONSISTENT: [{'labels': labels(1, 2)}, {'labels': labels()}, {'contact_taxels': array('I', [4])},
                     {'labels': labels(2), 'contact_taxels': array('I', [1])}, NO_CONTACT, {'state': Contact.EMPTY},
                     NO_CONTACT | {'state': Contact.EMPTY, 'pad_seen': False},
                     NO_CONTACT | {'state': Contact.NOT_SEEN, 'pad_seen': True}, {'smallest_contact': 0},
                     {'layer_depth': 0.001}, {'layer_depth': -0.001, 'layer_deviation': 0.1}],
    R.UNKNOWN_CODE: [{'state': 0}, {'state': 4}],
    R.NOT_FINITE: [{'noise_floor': array('f', [-1.0] * 256)}, {'layer_depth': NAN}]}
SHAPES: dict[R, list[Change]] = {
    R.UNKNOWN_CODE: [{'shape': 9}, {'shape': 0}, {'unknown_reason': 10}, {'frame_shape': 255}],
    R.INCONSISTENT: [{'unknown_reason': ContactShape.NOT_SEEN}, {'class_name': 'circle'}, {'class_names.0': 'square'},
                     {'shape': ContactShape.UNKNOWN, 'class_name': 'unknown'}, {'confidence': 0.1}, {'taxels': 0},
                     {'shape': ContactShape.OTHER, 'class_name': 'star'}, {'hidden_taxels': HUGE},
                     {'others_present': True}, NO_SHAPE | {'taxels': 36}, NO_SHAPE | {'pad_seen': False},
                     NO_SHAPE | {'contacts': 1, 'contact_areas': array('d', [1e-4])},
                     {'contact_areas': array('d', [0.0])}],
    R.WRONG_LENGTH: [{'class_names': ['square']}, {'contact_areas': array('d')}, {'standard_deviations': array('d')},
                     {'dimension_names': []}, {'covariance': array('d', [0.0])}],
    R.NOT_FINITE: [{'contact_areas': array('d', [INF])}, {'probabilities.3': NAN}, {'frame_probabilities.3': INF},
                   {'confidence': NAN}, {'centre_of_pressure.x': NAN}, {'pose.pose.position.y': INF},
                   {'pressure_slope.1': INF}, {'pose.pose.orientation.z': NAN}, {'dimensions': array('d', [NAN])}],
    R.WRONG_PROBABILITIES: [{'probabilities': array('f', [0.0] * 7)}, {'probabilities.3': 1.75},
                            {'frame_probabilities': array('f', [-1, 2, 0, 0, 0, 0, 0])}],
    R.WRONG_STAMP: [{'held.sec': -1}]}
SLIDING: Change = {'moving': ContactMotion.SLIDING, 'speed': 0.01, 'direction': 1.0}
MOTIONS: dict[R, list[Change]] = {
    R.UNKNOWN_CODE: [{'moving': 3}, {'moving': 10}, {'moving': 16}, {'observable': 8}, {'last_event': 9}],
    R.INCONSISTENT: [{'speed': 0.01}, {'direction': 1.0}, {'rate': 0.1}, SLIDING | {'speed': -0.01},
                     SLIDING | {'moving': ContactMotion.STILL}, SLIDING | {'moving': ContactMotion.TURNING}],
    R.NOT_FINITE: [SLIDING | {'speed': INF}, {'rate': -INF}],
    R.WRONG_STAMP: [{'last_event_age.sec': -1}]}
EVENTS: dict[R, list[Change]] = {
    R.UNKNOWN_CODE: [{'kind': 9}, {'kind': 0}, {'seen_by': 0}, {'seen_by': 5}],
    R.NOT_FINITE: [{'speed': INF}, {'probability': NAN}, {'force': -INF}],
    R.WRONG_PROBABILITIES: [{'probability': 1.5}], R.INCONSISTENT: [{'speed': -0.1}]}


def of_part(part: str, table: dict[R, list[Change]]) -> dict[R, list[Change]]:
    """Return the changes with ``part`` in front of each field name."""
    return {reason: [{f'{part}.{name}': value for name, value in change.items()} for change in changes]
            for reason, changes in table.items()}


WITHOUT_YAW: Change = {'yaw': NAN, 'yaw_sd': NAN}
WITHOUT_SIZE: Change = WITHOUT_YAW | {'symmetry': 0, 'dimension_names': [], 'dimensions': array('d'),
                                      'dimension_sds': array('d'), 'dimension_is_bound': []}
WITHOUT_GRIP: Change = {'grip_force': NAN, 'grip_force_sd': NAN, 'force_imbalance': NAN}
WITHOUT_LEAN: Change = {'lean': [NAN, NAN]}
NO_OBJECT: Change = WITHOUT_SIZE | WITHOUT_GRIP | WITHOUT_LEAN | {
    'shape': ContactShape.UNKNOWN, 'class_name': 'unknown', 'confidence': 0.0, 'centre': [NAN, NAN], 'centre_sd': NAN}
NO_LINE: Change = {'offset': NAN, 'width': NAN, 'misalignment': NAN, 'midpoint.x': NAN, 'midpoint.y': NAN,
                   'midpoint.z': NAN}
GRASPS: dict[R, list[Change]] = {
    R.UNKNOWN_CODE: [{'contact': 5}, {'side_states.0': 4}, {'gap_source': 4}, {'shape': 9}, {'shape': 0},
                     {'shape': ContactShape.NONE, 'class_name': 'none'}],
    R.INCONSISTENT: [{'contact': Grasp.NO_CONTACT}, {'gap_source': 0}, {'gap': NAN},
                     ONE_SIDE_UNSEEN | {'side_states.1': Grasp.SIDE_EMPTY, 'contact': Grasp.NO_CONTACT},
                     ONE_SIDE_UNSEEN | {'contact': Grasp.ONE_SIDED}, {'stable': True, 'fresh': False, 'width': NAN},
                     {'side_states': [0, 0]}, {'contact': 0, 'side_states.1': 0},
                     # The name of the object must match its code, the object must be held, and its confidence must
                     # match its class.
                     {'class_name': 'circle'}, {'shape': ContactShape.OTHER}, {'shape': ContactShape.UNKNOWN},
                     {'confidence': 0.4}, WITHOUT_SIZE | {'shape': ContactShape.UNKNOWN, 'class_name': 'unknown'},
                     {'fresh': False} | NO_LINE, {'fresh': False} | NO_LINE | NO_OBJECT | {'confidence': 0.3},
                     {'fresh': False} | NO_LINE | NO_OBJECT | {'centre': [0.0, 0.0]},
                     {'fresh': False} | NO_LINE | NO_OBJECT | {'centre_sd': 0.0},
                     {'fresh': False} | NO_LINE | NO_OBJECT | {'lean': [0.0, 0.0]},
                     {'fresh': False} | NO_LINE | NO_OBJECT | {'grip_force': 1.0, 'grip_force_sd': 0.1,
                                                               'force_imbalance': 0.0},
                     {'fresh': False, 'contact': Grasp.ONE_SIDED, 'side_states.1': Grasp.SIDE_EMPTY} | NO_LINE
                     | NO_OBJECT,  # Only one side has a shape, so the two sides cannot have the same shape.
                     {'dimensions.0': 0.0}, {'dimension_sds.0': 0.0}, {'dimensions.0': -0.01},
                     {'yaw': NAN}, {'yaw_sd': NAN}, {'yaw': 0.8}, {'symmetry': 0}, {'handedness': 1},
                     WITHOUT_SIZE | {'symmetry': 4}, {'side_states.0': 1, 'contact': 1} | NO_LINE | NO_OBJECT
                     | {'same_shape': False}, {'side_states.0': 1, 'contact': 1} | NO_LINE | NO_OBJECT
                     | {'same_shape': False, 'forces.0': NAN, 'motions.0.moving': ContactMotion.STILL},
                     {'grip_force': 1.0}, {'force_imbalance': 1.0},
                     {'force_is_bound.1': True}, {'forces.0': NAN}],
    R.WRONG_LENGTH: [{'dimension_names': []}, {'dimension_sds': array('d')}, {'dimension_is_bound': [False] * 2}],
    R.NOT_FINITE: [{'gap': INF}, {'offset': NAN}, {'centre.0': NAN}, {'centre_sd': INF}, {'confidence': NAN},
                   {'confidences.1': INF}, {'dimensions.0': INF}, {'dimension_sds.0': NAN}, {'yaw_sd': INF},
                   {'forces.1': INF}, {'grip_force_sd': INF}, {'lean.0': NAN}, {'lean.1': INF}],
    R.WRONG_PROBABILITIES: [{'confidence': -0.1}, {'confidences.0': 1.5}],
    R.WRONG_STAMP: [{'gap_age.sec': -1}]}
#: The check must accept an unknown object, an uncertain yaw, a force that is a lower bound, and a pad that is not seen.
FEWER: tuple[Change, ...] = (
    {'fresh': False} | NO_LINE | NO_OBJECT, NO_OBJECT | NO_LINE, WITHOUT_YAW, WITHOUT_LEAN, WITHOUT_SIZE, WITHOUT_GRIP,
    WITHOUT_GRIP | {'force_is_bound.0': True}, WITHOUT_GRIP | {'forces': [NAN, 1.0]},
    {'grip_force_sd': NAN}, {'centre_sd': NAN},
    {'side_states.0': 1, 'contact': 1, 'same_shape': False, 'forces.0': NAN} | NO_LINE | NO_OBJECT)
#: Maps each check to a good message, the reason for rejecting a default-constructed message, and the rejected changes
#: by reason.
TABLE = {
    check_taxel_array: (good_taxels, R.NO_TAXELS, [GRID, VALUES, TAXELS, TIMES]),
    check_contact: (good_contact, R.NO_TAXELS, [GRID, VALUES, CONTACTS, TIMES]),
    check_contact_shape: (good_shape, R.UNKNOWN_CODE, [SHAPES, of_part('motion', MOTIONS), TIMES]),
    check_contact_event: (good_event, R.UNKNOWN_CODE, [EVENTS, TIMES]),
    check_grasp: (good_grasp, R.INCONSISTENT, [GRASPS, of_part('motions.1', MOTIONS), TIMES])}


def cases_of(check) -> list[tuple[Change | None, R]]:
    """Return the changes to a good message, each with the reason for which the message is rejected.

    The change None represents a default-constructed message.
    """
    _, default, tables = TABLE[check]
    return [(None, default), *((change, reason) for table in tables for reason, changes in table.items()
                               for change in changes)]


def sent_cases(check) -> list[tuple[Change | None, R]]:
    """Return the first change of ``check`` for each reason, or all changes with TACTILE_LONG.

    A node drops a message for the reason that the check returns, and the check is tested with all changes.
    """
    cases = cases_of(check)
    return cases if os.environ.get('TACTILE_LONG') else [
        case for number, case in enumerate(cases) if case[1] not in {reason for _, reason in cases[:number]}]


def malformed(good, change, sequence=0):
    message = good(sequence)
    if change is None:
        return type(message)()
    message = copy.deepcopy(message)
    for path, value in change.items():
        *outer, name = path.split('.')
        target = message
        for part in outer:
            target = target[int(part)] if part.isdigit() else getattr(target, part)
        if name.isdigit():
            target[int(name)] = value
        else:
            setattr(target, name, value)
    return message


@pytest.mark.parametrize(('check', 'change', 'reason'), [
    pytest.param(check, *case, id=f'{check.__name__}: {", ".join(case[0] or ["default"])} {case[1].name}')
    for check in TABLE for case in cases_of(check)])
def test_each_malformed_message_is_rejected_for_its_reason(check, change, reason):
    assert check(malformed(TABLE[check][0], change)) is reason


@pytest.mark.parametrize('check', TABLE)
def test_a_good_message_is_accepted(check):
    assert check(TABLE[check][0]()) is None


@pytest.mark.parametrize('change', FEWER, ids=lambda change: ', '.join(change))
def test_a_grasp_that_says_less_is_accepted(change):
    assert check_grasp(malformed(good_grasp, change)) is None


def test_an_empty_pad_and_a_pad_without_valid_taxels_are_accepted():
    for value, status in ((0.0, TaxelStatus.VALID), (NAN, TaxelStatus.STALE)):
        taxels = good_taxels()
        taxels.values = array('f', [value] * 256)
        taxels.status = array('B', [status] * 256)
        assert check_taxel_array(taxels) is None
        pattern = ContactPattern.of(np.zeros((16, 16), bool), taxel_values(taxels))
        features = features_message(pad_contact(taxels, pattern), compute_features(pattern.mask, Group.CLASSIFIER))
        assert features_fit(features)


@pytest.mark.parametrize(('method', 'fuse'), [('learned', True), ('volf', False)])
def test_every_message_of_our_own_nodes_is_accepted(chain, method, fuse):
    """The test draws random contacts with noise, in which few, half or all taxels are invalid."""
    node = chain.add(ClassifierNode(namespace='/left', parameter_overrides=[
        Parameter('method', value=method), Parameter('fuse', value=fuse)]))
    chain.add(ProcessorNode(namespace='/left'))
    features, shapes = chain.listen(ContactFeatures, '/left/features'), chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(TaxelArray, '/left/taxels')
    chain.until(lambda: node.count_publishers('/left/features') > 0)
    rng, frames = np.random.default_rng(1), 60 if os.environ.get('TACTILE_LONG') else 30
    for sequence in range(frames):
        values = rng.normal(0, 1e4, (16, 16)).astype(np.float32)
        row, col, height, width = rng.integers(0, 10, 4)
        values[row:row + height, col:col + width] += rng.uniform(1e4, 1e5)
        values[rng.random(values.shape) < (0, 0, 0.03, 0.5, 1)[sequence % 5]] = np.nan
        message = good_taxels(sequence)
        message.values = array('f', values.tobytes())
        message.status = array('B', [TaxelStatus.STALE if invalid else TaxelStatus.VALID
                                     for invalid in np.isnan(values).flat])
        assert check_taxel_array(message) is None
        publisher.publish(message)
        chain.wait_for(shapes, sequence + 1)
        chain.wait_for(features, sequence + 1)  # published after the shape
    assert all(map(features_fit, features)) and len(features) == frames
    assert [check_contact_shape(message) for message in shapes] == [None] * frames
    # At least one contact is not seen.
    assert any(not shape.taxels and shape.shape != ContactShape.NONE for shape in shapes)


def test_a_check_costs_nothing_by_the_size_that_a_message_names():
    messages = [malformed(good, {'rows': HUGE, 'cols': HUGE}) for good in (good_taxels, good_contact)]
    for check, message in zip((check_taxel_array, check_contact), messages):
        tracemalloc.start()
        try:
            assert check(message) is not None
            assert tracemalloc.get_traced_memory()[1] < 100_000  # Peak memory of the check in bytes.
        finally:
            tracemalloc.stop()


def test_codes_are_stable():
    assert {reason.name: reason.value for reason in RejectReason} == {
        'NOT_KNOWN': 0, 'UNKNOWN_UNIT': 1, 'NO_TAXELS': 2, 'TOO_LARGE': 3, 'WRONG_LENGTH': 4, 'WRONG_PITCH': 5,
        'UNKNOWN_CODE': 6, 'NOT_FINITE': 7, 'WRONG_PROBABILITIES': 8, 'WRONG_STAMP': 9, 'INCONSISTENT': 10,
        'PROCESSING_FAILED': 11, 'MISSING_JOINT': 12, 'IMPLAUSIBLE_OPENING': 13,
        'STAMP_AHEAD': 14, 'WRONG_SEQUENCE': 15, 'OTHER_TYPE': 16, 'OTHER_SOURCE': 17}


class Chain(RosBench):
    """Our nodes, which the test spins, and a peer node that publishes to them and listens.

    The nodes report their health each second of virtual time, which passes only in `until_reported`.
    """

    def __init__(self, stack):
        super().__init__(stack)
        self.clock = VirtualTime()
        self.diagnostics: list[DiagnosticStatus] = []
        self.stamps: list[Time] = []  # Stamps of the received diagnostics.
        self.peer = self.add('peer')
        self.peer.create_subscription(DiagnosticArray, '/diagnostics',
                                      self._diagnosed, 100)

    def _diagnosed(self, message) -> None:
        self.stamps.append(message.header.stamp)
        self.diagnostics.extend(message.status)

    def listen(self, kind, topic) -> list:
        heard: list = []
        self.peer.create_subscription(kind, topic, heard.append, frames_qos(DEPTH))
        return heard

    def publisher(self, kind, topic, readers=1, lossless=False):
        publisher = self.peer.create_publisher(kind, topic, frames_qos(DEPTH, lossless))
        self.until(lambda: publisher.get_subscription_count() >= readers)
        return publisher

    def wait_for(self, messages: list, count: int) -> None:
        self.until(lambda: len(messages) >= count)

    def until_reported(self, condition) -> None:
        """Wait until a condition on the reports is true."""
        def is_met():
            self.clock.advance(1.0)
            self.settle()
            return condition()
        self.until(is_met)

    def dropped(self, node: str, total: int) -> dict[str, int]:
        """Wait until /diagnostics counts ``total`` dropped messages of a node, and return the counts by reason."""
        self.until_reported(lambda: sum(self._dropped(node).values()) >= total)
        return self._dropped(node)

    def _dropped(self, node: str) -> dict[str, int]:
        values = next((status.values for status in reversed(self.diagnostics) if status.name == node), ())
        return {pair.key.removeprefix('dropped_'): int(pair.value) for pair in values
                if pair.key.startswith('dropped_') and pair.value != '0'}


@pytest.fixture
def chain(ros):
    return Chain(ros)


def send_all(chain, publisher, good, cases, results) -> dict[str, int]:
    """After each malformed message, send a good message, whose result must arrive.

    Return the number of dropped messages by reason.
    """
    expected: dict[str, int] = {}
    for sequence, (change, reason) in enumerate(cases, start=1):
        publisher.publish(malformed(good, change, sequence))
        publisher.publish(good(sequence))
        chain.wait_for(results, sequence)
        expected[reason.key] = expected.get(reason.key, 0) + 1
    return expected


def test_no_taxel_array_stops_a_processor_and_the_other_pad_continues(chain):
    for pad in ('left', 'right'):
        chain.add(chain.clock.of(ProcessorNode)(namespace=f'/{pad}'))
    left, right = (chain.listen(ContactFeatures, f'/{pad}/features') for pad in ('left', 'right'))
    bad, other = (chain.publisher(TaxelArray, f'/{pad}/taxels') for pad in ('left', 'right'))
    cases = sent_cases(check_taxel_array)
    expected = send_all(chain, bad, good_taxels, cases, left)
    other.publish(good_taxels(5))
    chain.until(lambda: right)
    assert [message.sequence for message in left] == list(range(1, len(cases) + 1))
    assert all(message.contacts == 1 and sum(message.pattern) == 36 for message in left)
    assert chain.dropped('/left/processor', len(cases)) == expected


def test_no_malformed_contact_stops_a_classifier_or_enters_its_fusion(chain):
    chain.add(chain.clock.of(ClassifierNode)(namespace='/left'))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(Contact, '/left/contact')
    cases = sent_cases(check_contact)
    expected = send_all(chain, publisher, good_contact, cases, shapes)
    assert [shape.sequence for shape in shapes] == list(range(1, len(cases) + 1))
    # Fusion counts no malformed message.
    assert [shape.fused_frames for shape in shapes] == list(range(1, len(cases) + 1))
    assert all(np.isfinite(shape.probabilities).all() and shape.shape == ContactShape.SQUARE for shape in shapes)
    assert chain.dropped('/left/classifier', len(cases)) == expected


def test_values_at_the_end_of_float32_leave_no_nan_in_the_fusion(chain):
    chain.add(chain.clock.of(ClassifierNode)(namespace='/left'))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(Contact, '/left/contact')
    extreme = good_contact(1)
    extreme.values = array('f', [3.4e38 if value > 0 else -3.4e38 for value in extreme.values])
    publisher.publish(extreme)
    publisher.publish(good_contact(2))
    chain.until(lambda: shapes and shapes[-1].sequence == 2)
    assert check_contact_shape(shapes[-1]) is None and np.isfinite(shapes[-1].probabilities).all()


def test_no_malformed_shape_stops_a_grasp_or_breaks_its_hold(chain):
    """The node runs as in a lossless replay, because the stamps of the shapes do not follow real time."""
    chain.add(chain.clock.of(GraspNode)(parameter_overrides=[Parameter('lossless', value=True)]))
    grasps = chain.listen(Grasp, '/grasp')
    publishers = {side: chain.publisher(ContactShape, f'/{side}/shape', lossless=True) for side in ('left', 'right')}
    cases = cases_of(check_contact_shape)  # A grasp is stable only after so many shapes.
    for sequence, (change, _) in enumerate(cases, start=1):
        bad_side, good_side = ('left', 'right')[::1 if sequence % 2 else -1]
        publishers[bad_side].publish(malformed(good_shape, change, sequence))
        for side in (good_side, bad_side):
            publishers[side].publish(good_shape(sequence))
        chain.wait_for(grasps, 2 * sequence)
    last = grasps[-1]
    assert len(grasps) == 2 * len(cases)
    assert last.contact == Grasp.TWO_SIDED and last.fresh and last.stable and check_grasp(last) is None
    assert last.held.sec + last.held.nanosec * 1e-9 == pytest.approx(0.02 * (len(cases) - 1), abs=1e-3)
    assert all(check_grasp(grasp) is None for grasp in grasps)
    assert sum(chain.dropped('/grasp', len(cases)).values()) == len(cases)


def test_a_stamp_far_in_the_future_reaches_neither_fusion_nor_hold(chain):
    """If the stamp were accepted, the shape would be held for an hour, and later frames would lie in the past."""
    chain.add(chain.clock.of(ClassifierNode)(namespace='/left'))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(Contact, '/left/contact')
    for sequence in range(1, 21):
        publisher.publish(good_contact(sequence))
        if sequence % 5 == 0:
            false = good_contact(sequence)
            false.header.stamp.sec += 3600
            publisher.publish(false)
        chain.wait_for(shapes, sequence)
    assert [shape.sequence for shape in shapes] == list(range(1, 21))
    assert shapes[-1].fused_frames == 20 and shapes[-1].held.sec == 0
    assert chain.dropped('/left/classifier', 4) == {'stamp_ahead': 4}


def guarded(chain, topic='taxels', steady=time.monotonic):
    received: list = []
    return GuardedSubscription(chain.peer, TaxelArray, topic, received.append, frames_qos(DEPTH),
                               check=check_taxel_array, steady=steady), received


def test_frames_that_never_arrived_are_counted_and_a_false_sequence_is_not(chain):
    clock = VirtualTime()
    subscription, received = guarded(chain, steady=clock.now)
    publisher = chain.publisher(TaxelArray, 'taxels')
    for sequence in (7, 8, 11, 12, 2**64 - 1, 13, 14, 16, 0, 1, 1):
        publisher.publish(with_sequence(sequence))
    chain.until(lambda: subscription.counts.received == 11)
    # The messages 2^64 - 1, 0, 1 and 1 are dropped, because the earlier publisher may still continue.
    assert subscription.counts.dropped == {R.OTHER_SOURCE: 4}
    clock.advance(SOURCE_HOLD + 0.01)
    for sequence in (2, 3):
        publisher.publish(with_sequence(sequence))
    chain.until(lambda: len(received) == 9)
    # The messages 9, 10 and 15 are counted as skipped. A restart of the publisher causes no gap.
    assert subscription.counts.skipped == 2 + 1


def test_frames_missed_while_a_link_was_cut_for_an_hour_are_all_counted(chain):
    received: list[TaxelArray] = []
    qos = frames_qos(DEPTH, lossless=True)  # A lossless subscription takes the time from the stamps alone.
    subscription = GuardedSubscription(chain.peer, TaxelArray, 'taxels', received.append, qos, check=check_taxel_array,
                                       lossless=True)
    publisher = chain.peer.create_publisher(TaxelArray, 'taxels', qos)
    for sequence, stamp in ((100, 0.0), (100 + 180_000, 3600.0), (2**63, 3600.02)):
        message = with_sequence(sequence)
        message.header.stamp = time_message(STAMP + stamp)
        publisher.publish(message)
    chain.until(lambda: len(received) == 3)
    # At 50 Hz, an hour has 180,000 frames. The last sequence number starts a new count, so it adds no loss.
    assert subscription.counts.skipped == 180_000 - 1


def with_sequence(sequence):
    message = good_taxels()
    message.sequence = sequence
    return message


@pytest.mark.parametrize('lossless', [False, True])
def test_only_the_newest_waiting_message_is_processed_except_in_a_lossless_replay(chain, lossless):
    """If a slow callback got the oldest message first, it would lag by the whole queue for ever."""
    received: list[TaxelArray] = []
    subscription = GuardedSubscription(chain.peer, TaxelArray, 'taxels', received.append, frames_qos(DEPTH, lossless),
                                       check=check_taxel_array, newest_only=True, lossless=lossless)
    publisher = chain.publisher(TaxelArray, 'taxels', lossless=lossless)
    for sequence in range(10):
        publisher.publish(with_sequence(sequence))
    chain.until(lambda: subscription.counts.received == 10)
    assert [message.sequence for message in received] == (list(range(10)) if lossless else [9])
    assert subscription.counts == MessageCounts(10, len(received), {}, 0, 10 - len(received))


def test_frames_that_an_earlier_stage_left_out_do_not_count_as_lost(chain):
    """In an earlier version, the processor left out frames within its allowance of 5 %.

    The classifier then reported the omitted frames as lost.
    """
    subscription = GuardedSubscription(chain.peer, Contact, 'contact', lambda message: None, frames_qos(DEPTH),
                                       check=lambda message: None)
    publisher = chain.publisher(Contact, 'contact')
    # One message is lost between the last two messages.
    for sequence, before in ((1, 0), (2, 0), (5, 2), (9, 2)):
        message = Contact(sequence=sequence, left_out=before)
        message.header.stamp = time_message(STAMP + 0.02 * sequence)
        publisher.publish(message)
    chain.until(lambda: subscription.counts.received == 4)
    assert subscription.counts.skipped == 1


def test_the_age_of_the_newest_data_grows_while_nothing_comes(chain):
    clock = VirtualTime()
    subscription, received = guarded(chain, steady=clock.now)
    assert subscription.health.age == INF
    publisher = chain.publisher(TaxelArray, 'taxels')
    for number in range(1, 51):  # After a second, the subscription has found the smallest transport delay.
        clock.advance(0.02)
        message = good_taxels(number)
        message.age = duration_message(0.25)
        publisher.publish(message)
        chain.wait_for(received, number)
    assert subscription.health.age == pytest.approx(0.25)
    clock.advance(0.3)
    assert subscription.health.age == pytest.approx(0.55)


def test_two_publishers_for_one_pad_are_reported_and_logged_once(chain, caplog):
    """The arrays of both publishers alternate, so a consumer of the latest array would see two skins as one."""
    chain.add(chain.clock.of(ProcessorNode)(namespace='/left'))
    chain.publisher(TaxelArray, '/left/taxels')
    chain.until_reported(lambda: fact(chain, 'faults') == 'SILENT')
    with caplog.at_level(logging.WARNING, 'tactile_node'):
        other = chain.add(rclpy.create_node('other_driver', namespace='/gripper'))
        publisher = other.create_publisher(TaxelArray, '/left/taxels', frames_qos(DEPTH))
        chain.until_reported(lambda: 'SEVERAL_PUBLISHERS' in fact(chain, 'faults'))
        status = chain.diagnostics[-1]
        assert status.level == WARN and fact(chain, 'publishers') == '2'
        assert '/gripper/other_driver' in status.message and '/peer' in status.message
        reported = len(chain.diagnostics)
        chain.until_reported(lambda: len(chain.diagnostics) >= reported + 2)
        assert len([record for record in caplog.records
                    if getattr(record, 'fact', None) is StreamFault.SEVERAL_PUBLISHERS]) == 1
    other.destroy_publisher(publisher)
    chain.until_reported(lambda: fact(chain, 'faults') == 'SILENT')


def test_messages_of_another_version_are_dropped_and_reported(chain, monkeypatch):
    """The middleware matches the two versions by the name of the type.

    Only the hash of the type description differs (REP 2011).
    """
    subscription, received = guarded(chain)
    publisher = chain.publisher(TaxelArray, 'taxels')
    publisher.publish(with_sequence(7))
    chain.until(lambda: received)
    known = chain.peer.get_publishers_info_by_topic

    def of_another_version(topic):
        found = known(topic)
        for info in found:
            info.topic_type_hash = TypeHash(1, bytes(31) + b'x')
        return found
    monkeypatch.setattr(chain.peer, 'get_publishers_info_by_topic', of_another_version)
    publisher.publish(with_sequence(3))  # The publisher has been restarted.
    publisher.publish(with_sequence(4))
    chain.until(lambda: subscription.counts.received == 3)
    assert subscription.counts.dropped == {R.OTHER_TYPE: 2} and len(received) == 1
    assert subscription.health.other_types == (chain.peer.get_fully_qualified_name(),)
    monkeypatch.undo()
    publisher.publish(with_sequence(9))
    chain.until(lambda: len(received) == 2)
    assert not subscription.health.other_types


def fact(chain, key) -> str:
    """Return the value of ``key`` in the last diagnostic."""
    return next((pair.value for status in chain.diagnostics[-1:] for pair in status.values if pair.key == key), '')


def test_an_exception_is_counted_and_logged_once_with_its_traceback(chain, caplog):
    def fail(message):
        raise ZeroDivisionError('of the callback')
    subscription = GuardedSubscription(chain.peer, TaxelArray, 'taxels', fail, frames_qos(DEPTH),
                                       check=check_taxel_array)
    publisher = chain.publisher(TaxelArray, 'taxels')
    with caplog.at_level(logging.WARNING, 'tactile_node'):
        for sequence in range(10):
            publisher.publish(good_taxels(sequence))
            publisher.publish(TaxelArray())
        chain.until(lambda: subscription.counts.received == 20)
    assert subscription.counts == MessageCounts(20, 0, {R.PROCESSING_FAILED: 10, R.NO_TAXELS: 10})
    logged = {record.args[1]: record for record in caplog.records if record.name.endswith('guarded_input')}
    assert sorted(logged) == ['no_taxels', 'processing_failed']
    assert len([record for record in caplog.records if record.name.endswith('guarded_input')]) == 2
    assert logged['processing_failed'].exc_info[0] is ZeroDivisionError and not logged['no_taxels'].exc_info


def test_health_continues_with_simulated_time_and_no_clock(chain):
    chain.add(chain.clock.of(ProcessorNode)(namespace='/gripper_a/left', parameter_overrides=[
        Parameter('use_sim_time', value=True)]))
    publisher = chain.publisher(TaxelArray, '/gripper_a/left/taxels')

    for message, level in ((None, STALE), (good_taxels(), OK), (TaxelArray(), WARN), (None, STALE)):
        if message is not None:
            publisher.publish(message)
        chain.until_reported(lambda level=level: chain.diagnostics and chain.diagnostics[-1].level == level)
    assert {status.name for status in chain.diagnostics} == {'/gripper_a/left/processor'}
    values = {pair.key: pair.value for pair in chain.diagnostics[-1].values}
    assert (values['received'], values['processed'], values['dropped_no_taxels']) == ('2', '1', '1')
    assert set(values) == {'faults', 'received', 'processed', 'rate_hz', 'age_s', 'skipped', 'overtaken', 'publishers',
                           'stamps_offset_s', *(f'dropped_{reason.key}' for reason in RejectReason if reason)}
    # The simulated clock reads zero until the first /clock message.
    assert all(stamp == Time() for stamp in chain.stamps)


def status_of(**now):
    """Return the status one second after a stream received 4 messages, where ``now`` replaces fields of its state."""
    before = MessageCounts(received=4, processed=4, dropped={})
    fields = {'counts': MessageCounts(received=54, processed=54, dropped={}), 'age': 0.02, 'publishers': ('/driver',)}
    return health_status('/gripper/grasp', {'/left/shape': StreamHealth(**fields | now)}, {'/left/shape': before}, 1.0)


@pytest.mark.parametrize(('now', 'level', 'fault'), [
    ({}, OK, 'NONE'),
    ({'counts': MessageCounts(4, 4, {})}, STALE, 'SILENT'),
    ({'counts': MessageCounts(54, 53, {R.NOT_FINITE: 1})}, WARN, 'DROPPED'),
    ({'counts': MessageCounts(54, 54, {}, skipped=2)}, WARN, 'SKIPPED'),
    ({'counts': MessageCounts(54, 52, {}, overtaken=2)}, OK, 'NONE'),
    ({'counts': MessageCounts(54, 49, {}, overtaken=5)}, WARN, 'OVERLOADED'),
    ({'age': 1.5}, WARN, 'OLD'),
    ({'age': 1.5, 'counts': MessageCounts(4, 4, {})}, STALE, 'SILENT'),
    ({'publishers': ('/driver', '/rogue')}, WARN, 'SEVERAL_PUBLISHERS'),
    ({'other_types': ('/driver',), 'counts': MessageCounts(4, 4, {})}, WARN, 'OTHER_TYPE, SILENT'),
    ({'publishers': ('/driver', '/rogue'), 'counts': MessageCounts(4, 4, {})}, WARN, 'SEVERAL_PUBLISHERS, SILENT')])
def test_health_is_ok_only_while_each_frame_arrives_in_time_from_one_source(now, level, fault):
    status = status_of(**now)
    values = {pair.key: pair.value for pair in status.values}
    assert (status.level, values['faults'], status.name) == (level, fault, '/gripper/grasp')


def test_health_has_rate_and_age():
    values = {pair.key: pair.value for pair in status_of().values}
    assert (values['rate_hz'], values['age_s'], values['publishers']) == ('50.0', '0.020', '1')
    assert {pair.key: pair.value for pair in status_of(age=INF).values}['age_s'] == 'not known'


def test_health_names_the_topic_that_is_silent_and_counts_all():
    before = {'/left/shape': MessageCounts(5, 5, {}), '/right/shape': MessageCounts(4, 3, {R.NOT_FINITE: 1})}
    now = {'/left/shape': StreamHealth(MessageCounts(7, 7, {}), 0.5),
           '/right/shape': StreamHealth(before['/right/shape'], 0.75)}
    status = health_status('/gripper/grasp', now, before, 1.0)
    assert status.level == STALE and '/right/shape' in status.message and '/left' not in status.message
    values = {pair.key: pair.value for pair in status.values}
    assert (values['received'], values['processed'], values['dropped_not_finite']) == ('11', '10', '1')
    assert values['age_s'] == '0.750'  # The age of a grasp is the age of the older of its two sides.


@pytest.mark.parametrize('probabilities', [{Shape.CIRCLE: NAN}, {Shape.CIRCLE: INF, Shape.NONE: 0.0}])
def test_fusion_refuses_values_that_are_not_finite_and_keeps_its_state(probabilities):
    fusion = RecognitionFusion()
    fusion.update(0.0, Recognition.certain(Shape.CIRCLE))
    with pytest.raises(InputError):
        fusion.update(0.02, Recognition.of(probabilities))
    with pytest.raises(InputError):
        fusion.update(NAN, Recognition.certain(Shape.CIRCLE))
    after = fusion.update(0.04, Recognition.certain(Shape.CIRCLE))
    assert after.recognition.shape is Shape.CIRCLE and after.frames == 2
    assert np.isfinite(list(after.recognition.probabilities.values())).all()


def test_the_tracker_refuses_values_that_are_not_finite_and_keeps_its_state():
    tracker = GraspTracker()
    for side in ('left', 'right'):
        tracker.update(side, SideResult(0.0, SideState.TOUCHED, 'circle', (0.01, 0.01)), now=0.0)
    good = SideResult(0.02, SideState.TOUCHED, 'circle', (0.01, 0.01))
    for result in (good._replace(centre=(NAN, 0.0)), good._replace(time=NAN), SideResult(INF, SideState.EMPTY)):
        with pytest.raises(InputError):
            tracker.update('left', result, now=0.02)
    with pytest.raises(InputError):
        tracker.update('left', good, now=NAN)
    tracker.update('left', good, now=0.02)
    state = tracker.state(0.02)
    assert state.fresh and state.line is not None


def test_no_grasp_stops_the_planner_example(chain):
    process = subprocess.Popen([sys.executable, str(ROOT / 'examples/planner_client.py')], stderr=subprocess.PIPE,
                               text=True)
    lines: list[str] = []
    reader = threading.Thread(target=lambda: lines.extend(process.stderr), daemon=True)
    reader.start()
    try:
        publisher = chain.publisher(Grasp, '/grasp')
        deadline = time.monotonic() + TIMEOUT
        # Best-effort transport may lose any message, so the test sends messages until one of each kind has arrived.
        while not (any('grasp dropped' in line for line in lines) and any('rotate' in line for line in lines)):
            assert process.poll() is None and time.monotonic() < deadline, lines
            for change, _ in sent_cases(check_grasp):
                publisher.publish(malformed(good_grasp, change))
                good = good_grasp()
                good.header.stamp = time_message(time.time())  # The planner acts on current messages only.
                publisher.publish(good)
                time.sleep(0.02)
        assert process.poll() is None
    finally:
        process.terminate()
        process.wait(60)
