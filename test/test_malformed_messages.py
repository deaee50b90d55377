"""No message stops a node: a malformed one is dropped and counted by its reason, and the next good one is processed."""

import copy
import logging
import math
import subprocess
import sys
import threading
import time
from array import array
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from tactile_node.contact.pattern import ContactPattern  # noqa: E402
from tactile_node.errors import InputError  # noqa: E402
from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus  # noqa: E402
from tactile_node.fusion.recognitions import FusedRecognition, RecognitionFusion  # noqa: E402
from tactile_node.grasp.tracker import GraspTracker, SideResult  # noqa: E402
from tactile_node.helmholtz.features import Group, compute_features  # noqa: E402
from tactile_node.nodes.classifier_node import ClassifierNode  # noqa: E402
from tactile_node.nodes.grasp_node import GraspNode  # noqa: E402
from tactile_node.nodes.guarded_subscription import GuardedSubscription  # noqa: E402
from tactile_node.nodes.processor_node import ProcessorNode  # noqa: E402
from tactile_node.nodes.replay_gate import ReplayGate  # noqa: E402
from tactile_node.pose.fit import fit_shape  # noqa: E402
from tactile_node.pose.moments import contact_moments  # noqa: E402
from tactile_node.ros.feature_messages import features_message  # noqa: E402
from tactile_node.ros.grasp_messages import grasp_message, side_result  # noqa: E402
from tactile_node.ros.message_checks import (  # noqa: E402
    RejectReason,
    check_contact_features,
    check_contact_shape,
    check_grasp,
    check_taxel_array,
)
from tactile_node.ros.message_health import MessageCounts, health_status  # noqa: E402
from tactile_node.ros.qos import frames_qos  # noqa: E402
from tactile_node.ros.shape_messages import Findings, shape_message  # noqa: E402
from tactile_node.ros.taxel_messages import taxel_array_message, taxel_values  # noqa: E402
from tactile_node.shape.recognition import Recognition, Shape  # noqa: E402
from tactile_skin.msg import ContactFeatures, ContactShape, FeatureRange, Grasp, TaxelArray  # noqa: E402

pytestmark = pytest.mark.ros

ROOT = Path(__file__).resolve().parents[1]
STAMP, PITCH = 1_700_000_000.25, 0.002
TIMEOUT = 30.0  # s, for a busy machine
DEPTH = 500
NAN, INF, HUGE = math.nan, math.inf, 4_000_000_000
WARN, STALE, OK = DiagnosticStatus.WARN, DiagnosticStatus.STALE, DiagnosticStatus.OK


def good_taxels(sequence=0) -> TaxelArray:
    values = np.zeros((16, 16), np.float32)
    values[4:10, 3:9] = 50e3
    values[0, 0] = np.nan
    status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
    frame = TaxelFrame(STAMP + 0.02 * sequence, sequence, values, status, missing_can_frames=0)
    return taxel_array_message(frame, PITCH, 'Pa', 'left_pad')


def good_features(sequence=0) -> ContactFeatures:
    taxels = good_taxels(sequence)
    mask = taxel_values(taxels) > 0
    return features_message(taxels, ContactPattern(mask, taxel_values(taxels), 1),
                            compute_features(mask, Group.CLASSIFIER))


def good_shape(sequence=0) -> ContactShape:
    features = good_features(sequence)
    values = taxel_values(features)
    mask = values > 0
    frame = Recognition.of({Shape.SQUARE: 0.75, Shape.UNKNOWN: 0.25})
    found = Findings(frame, FusedRecognition(frame, STAMP, 1.5, 30), fit_shape(values, mask, Shape.SQUARE, PITCH),
                     contact_moments(values, mask, PITCH, 'Pa'))
    return shape_message(features, found, 'learned', 0.0)


def good_grasp(sequence=0) -> Grasp:
    tracker, side = GraspTracker(), good_shape(sequence)
    tracker.update('left', side_result(side))
    return grasp_message(tracker.update('right', side_result(side)), [side, side], 0.04, 'gripper')


def changed(**fields):
    """Return what sets these fields of a message; '__' stands for a dot."""
    def change(message):
        for path, value in fields.items():
            *outer, name = path.split('__')
            target = message
            for part in outer:
                target = target[int(part)] if part.isdigit() else getattr(target, part)
            setattr(target, name, value)
    return change


def element(field, index, value):
    def change(message):
        values = copy.copy(getattr(message, field))
        values[index] = value
        setattr(message, field, values)
    return change


R = RejectReason
GRID = [
    ('rows that do not match', changed(rows=15), R.WRONG_LENGTH),
    ('0x0, with values', changed(rows=0, cols=0), R.NO_TAXELS),
    ('0x16', changed(rows=0), R.NO_TAXELS),
    ('4e9 x 4e9', changed(rows=HUGE, cols=HUGE), R.TOO_LARGE),
    ('a product that is 0 in 32 bits', changed(rows=1 << 16, cols=1 << 16), R.TOO_LARGE),
    ('too few values', changed(values=array('f', [1.0] * 255)), R.WRONG_LENGTH),
    ('no values', changed(values=array('f')), R.WRONG_LENGTH),
    ('unknown unit', changed(unit='psi'), R.UNKNOWN_UNIT),
    ('no unit', changed(unit=''), R.UNKNOWN_UNIT),
    *((f'pitch {pitch}', changed(pitch=pitch), R.WRONG_PITCH) for pitch in (NAN, 0.0, -0.002, INF, -INF)),
    ('an infinite value', element('values', 7, INF), R.NOT_FINITE),
    ('10^9 ns', changed(header__stamp__nanosec=10**9), R.WRONG_STAMP),
    ('before 1970', changed(header__stamp__sec=-1), R.WRONG_STAMP),
    ('at the end of time', changed(header__stamp__sec=2**31 - 1), R.WRONG_STAMP)]
TAXELS = [
    *GRID,
    ('too few codes', changed(status=array('B', [0] * 255)), R.WRONG_LENGTH),
    ('no codes', changed(status=array('B')), R.WRONG_LENGTH),
    ('unknown code', element('status', 3, 6), R.UNKNOWN_CODE)]
FEATURES = [
    *GRID,
    ('too short a pattern', changed(pattern=array('B', [1] * 255)), R.WRONG_LENGTH),
    ('a pattern of 2', element('pattern', 3, 2), R.UNKNOWN_CODE),
    ('a contact without taxels', changed(pattern=array('B', [0] * 256)), R.INCONSISTENT),
    ('taxels without a contact', changed(contacts=0), R.INCONSISTENT),
    ('a contact without features', changed(features=[]), R.INCONSISTENT),
    ('an infinite angle', element('features', 1, FeatureRange(name='P05', max_angle=INF)), R.NOT_FINITE),
    ('too many features', changed(features=[FeatureRange()] * 1001), R.TOO_LARGE)]
SHAPES = [
    ('unknown shape', changed(shape=7), R.UNKNOWN_CODE),
    ('unknown shape of the frame', changed(frame_shape=255), R.UNKNOWN_CODE),
    ('NaN among the probabilities', element('probabilities', 3, NAN), R.NOT_FINITE),
    ('infinite probability of the frame', element('frame_probabilities', 3, INF), R.NOT_FINITE),
    ('no probabilities', changed(probabilities=np.zeros(7, np.float32)), R.WRONG_PROBABILITIES),
    ('a sum of 2', element('probabilities', 3, 1.75), R.WRONG_PROBABILITIES),
    ('a negative probability', changed(frame_probabilities=np.array([-1, 2, 0, 0, 0, 0, 0], np.float32)),
     R.WRONG_PROBABILITIES),
    ('NaN confidence', changed(confidence=NAN), R.NOT_FINITE),
    ('the confidence of another shape', changed(confidence=0.1), R.INCONSISTENT),
    ('NaN centre', changed(centre_of_pressure__x=NAN), R.NOT_FINITE),
    ('infinite centre of the fit', changed(pose__pose__position__y=INF), R.NOT_FINITE),
    ('NaN orientation', changed(pose__pose__orientation__z=NAN), R.NOT_FINITE),
    ('NaN dimension', changed(dimensions=array('d', [NAN])), R.NOT_FINITE),
    ('dimensions without names', changed(dimension_names=[]), R.WRONG_LENGTH),
    ('too small a covariance', changed(covariance=array('d', [0.0])), R.WRONG_LENGTH),
    ('a fit without taxels', changed(taxels=0), R.INCONSISTENT),
    ('an empty pad with taxels', changed(shape=0, probabilities=np.eye(7, dtype=np.float32)[0], confidence=1.0,
                                         fit_valid=False), R.INCONSISTENT),
    ('10^9 ns', changed(header__stamp__nanosec=10**9), R.WRONG_STAMP),
    ('before 1970', changed(header__stamp__sec=-1), R.WRONG_STAMP),
    ('held for less than nothing', changed(held__sec=-1), R.WRONG_STAMP)]
GRASPS = [
    ('unknown contact', changed(contact=3), R.UNKNOWN_CODE),
    ('NaN gap', changed(gap=NAN), R.NOT_FINITE),
    ('NaN offset', changed(offset=NAN), R.NOT_FINITE),
    ('stable without contact', changed(stable=True, contact=0), R.INCONSISTENT),
    ('no sides', changed(sides=[ContactShape(), ContactShape()]), R.INCONSISTENT),
    ('fresh with one side', lambda grasp: changed(sides=[grasp.sides[0], ContactShape()])(grasp), R.INCONSISTENT),
    ('a malformed side', changed(sides__1__shape=9), R.UNKNOWN_CODE)]
DEFAULTS = {TaxelArray: R.NO_TAXELS, ContactFeatures: R.NO_TAXELS, ContactShape: R.WRONG_PROBABILITIES,
            Grasp: R.INCONSISTENT}
TABLE = [(check, good, [*cases, ('default-constructed', None, DEFAULTS[type(good())])]) for check, good, cases in (
    (check_taxel_array, good_taxels, TAXELS), (check_contact_features, good_features, FEATURES),
    (check_contact_shape, good_shape, SHAPES), (check_grasp, good_grasp, GRASPS))]
CASES = [pytest.param(check, good, change, reason, id=f'{check.__name__}: {name}')
         for check, good, cases in TABLE for name, change, reason in cases]


def malformed(good, change, sequence=0):
    message = good(sequence)
    if change is None:
        return type(message)()
    message = copy.deepcopy(message)
    change(message)
    return message


@pytest.mark.parametrize(('check', 'good', 'change', 'reason'), CASES)
def test_each_malformed_message_is_rejected_for_its_reason(check, good, change, reason):
    assert check(malformed(good, change)) is reason


@pytest.mark.parametrize(('check', 'good'), [row[:2] for row in TABLE])
def test_a_good_message_is_accepted(check, good):
    assert check(good()) is None


def test_an_empty_pad_and_a_pad_without_valid_taxels_are_accepted():
    for value in (0.0, NAN):
        taxels = good_taxels()
        taxels.values = array('f', [value] * 256)
        assert check_taxel_array(taxels) is None
        mask = np.zeros((16, 16), bool)
        features = features_message(taxels, ContactPattern(mask, taxel_values(taxels), 0),
                                    compute_features(mask, Group.CLASSIFIER))
        assert check_contact_features(features) is None


@pytest.mark.parametrize('method', ['learned', 'volf'])
@pytest.mark.parametrize('fuse', [True, False])
def test_whatever_our_own_nodes_make_is_accepted(chain, method, fuse):
    """Random contacts with noise, with few, half and all taxels invalid."""
    node = chain.add(ClassifierNode(namespace='/left', parameter_overrides=[
        Parameter('method', value=method), Parameter('fuse', value=fuse)]))
    chain.add(ProcessorNode(namespace='/left'))
    features, shapes = chain.listen(ContactFeatures, '/left/features'), chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(TaxelArray, '/left/taxels')
    chain.wait(lambda: node.count_publishers('/left/features') > 0)
    rng, frames = np.random.default_rng(1), 60
    for sequence in range(frames):
        values = rng.normal(0, 1e4, (16, 16)).astype(np.float32)
        row, col, height, width = rng.integers(0, 10, 4)
        values[row:row + height, col:col + width] += rng.uniform(1e4, 1e5)
        values[rng.random(values.shape) < (0, 0, 0.03, 0.5, 1)[sequence % 5]] = np.nan
        message = good_taxels(sequence)
        message.values = array('f', values.tobytes())
        assert check_taxel_array(message) is None
        publisher.publish(message)
        chain.wait_for(shapes, sequence + 1)
    assert [check_contact_features(message) for message in features] == [None] * frames
    assert [check_contact_shape(message) for message in shapes] == [None] * frames
    assert any(not shape.taxels and shape.shape != ContactShape.NONE for shape in shapes)  # not seen


def test_a_check_costs_nothing_by_the_size_that_a_message_names():
    messages = [malformed(good, changed(rows=HUGE, cols=HUGE)) for good in (good_taxels, good_features)]
    began = time.perf_counter()
    for _ in range(100):
        check_taxel_array(messages[0])
        check_contact_features(messages[1])
    assert time.perf_counter() - began < 1.0


def test_codes_are_stable():
    assert {reason.name: reason.value for reason in RejectReason} == {
        'NOT_KNOWN': 0, 'UNKNOWN_UNIT': 1, 'NO_TAXELS': 2, 'TOO_LARGE': 3, 'WRONG_LENGTH': 4, 'WRONG_PITCH': 5,
        'UNKNOWN_CODE': 6, 'NOT_FINITE': 7, 'WRONG_PROBABILITIES': 8, 'WRONG_STAMP': 9, 'INCONSISTENT': 10,
        'PROCESSING_FAILED': 11}


class Chain:
    """Nodes of ours, spun by the test, and a peer that publishes to them and listens."""

    def __init__(self, stack: ExitStack):
        self._stack = stack
        self._executor = SingleThreadedExecutor()
        self.diagnostics: list[DiagnosticStatus] = []
        self.peer = self.add(rclpy.create_node('peer'))
        self.peer.create_subscription(DiagnosticArray, '/diagnostics',
                                      lambda message: self.diagnostics.extend(message.status), 100)

    def add(self, node):
        self._executor.add_node(node)
        self._stack.callback(node.destroy_node)
        return node

    def listen(self, kind, topic) -> list:
        heard: list = []
        self.peer.create_subscription(kind, topic, heard.append, frames_qos(DEPTH))
        return heard

    def publisher(self, kind, topic, readers=1):
        publisher = self.peer.create_publisher(kind, topic, frames_qos(DEPTH))
        self.wait(lambda: publisher.get_subscription_count() >= readers)
        return publisher

    def wait(self, condition, seconds=TIMEOUT) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, 'timeout'
            self._executor.spin_once(timeout_sec=0.1)

    def wait_for(self, messages: list, count: int) -> None:
        self.wait(lambda: len(messages) >= count)

    def dropped(self, node: str, total: int) -> dict[str, int]:
        """Wait until /diagnostics counts ``total`` dropped messages of a node; return the counts above 0 by reason."""
        self.wait(lambda: sum(self._dropped(node).values()) >= total)
        return self._dropped(node)

    def _dropped(self, node: str) -> dict[str, int]:
        values = next((status.values for status in reversed(self.diagnostics) if status.name == node), ())
        return {pair.key.removeprefix('dropped_'): int(pair.value) for pair in values
                if pair.key.startswith('dropped_') and pair.value != '0'}


@pytest.fixture
def chain():
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        yield Chain(stack)


def send_all(chain, publisher, good, cases, results) -> dict[str, int]:
    """After each malformed message send a good one, whose result must arrive; return the reasons, counted."""
    expected: dict[str, int] = {}
    for sequence, (_, change, reason) in enumerate(cases, start=1):
        publisher.publish(malformed(good, change, sequence))
        publisher.publish(good(sequence))
        chain.wait_for(results, sequence)
        expected[reason.key] = expected.get(reason.key, 0) + 1
    return expected


def test_no_taxel_array_stops_a_processor_and_the_other_pad_continues(chain):
    for pad in ('left', 'right'):
        chain.add(ProcessorNode(namespace=f'/{pad}'))
    left, right = (chain.listen(ContactFeatures, f'/{pad}/features') for pad in ('left', 'right'))
    bad, other = (chain.publisher(TaxelArray, f'/{pad}/taxels') for pad in ('left', 'right'))
    cases = TABLE[0][2]
    expected = send_all(chain, bad, good_taxels, cases, left)
    other.publish(good_taxels(5))
    chain.wait(lambda: right)
    assert [message.sequence for message in left] == list(range(1, len(cases) + 1))
    assert all(message.contacts == 1 and sum(message.pattern) == 36 for message in left)
    assert chain.dropped('/left/processor', len(cases)) == expected


def test_no_contact_features_stop_a_classifier_nor_enter_its_fusion(chain):
    chain.add(ClassifierNode(namespace='/left'))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(ContactFeatures, '/left/features')
    cases = TABLE[1][2]
    expected = send_all(chain, publisher, good_features, cases, shapes)
    assert [shape.sequence for shape in shapes] == list(range(1, len(cases) + 1))
    assert [shape.fused_frames for shape in shapes] == list(range(1, len(cases) + 1))  # no malformed one counts
    assert all(np.isfinite(shape.probabilities).all() and shape.shape == ContactShape.SQUARE for shape in shapes)
    assert chain.dropped('/left/classifier', len(cases)) == expected


def test_values_at_the_end_of_float32_leave_no_nan_in_the_fusion(chain):
    chain.add(ClassifierNode(namespace='/left'))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(ContactFeatures, '/left/features')
    extreme = good_features(1)
    extreme.values = array('f', [3.4e38 if value > 0 else -3.4e38 for value in extreme.values])
    publisher.publish(extreme)
    publisher.publish(good_features(2))
    chain.wait(lambda: shapes and shapes[-1].sequence == 2)
    assert check_contact_shape(shapes[-1]) is None and np.isfinite(shapes[-1].probabilities).all()


def test_features_that_a_method_lacks_are_counted_as_a_failure(chain):
    chain.add(ClassifierNode(namespace='/left', parameter_overrides=[Parameter('method', value='volf')]))
    shapes = chain.listen(ContactShape, '/left/shape')
    publisher = chain.publisher(ContactFeatures, '/left/features')
    lacking = good_features(1)
    lacking.features = lacking.features[:1]
    publisher.publish(lacking)
    publisher.publish(good_features(2))
    chain.wait(lambda: shapes)
    assert [shape.sequence for shape in shapes] == [2]
    assert chain.dropped('/left/classifier', 1) == {'processing_failed': 1}


@pytest.mark.parametrize('bad_side', ['left', 'right'])
def test_no_contact_shape_stops_a_grasp_nor_breaks_its_hold(chain, bad_side):
    chain.add(GraspNode())
    grasps = chain.listen(Grasp, '/grasp')
    publishers = {side: chain.publisher(ContactShape, f'/{side}/shape') for side in ('left', 'right')}
    cases = TABLE[2][2]
    good_side = 'left' if bad_side == 'right' else 'right'
    for sequence, (_, change, _) in enumerate(cases, start=1):
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


def test_no_contact_shape_stops_a_replay_gate(chain):
    gate = ReplayGate(chain.peer, ['left', 'right'], frames_qos(DEPTH))
    for side in ('left', 'right'):
        publisher = chain.publisher(ContactShape, f'/{side}/shape')
        for _, change, _ in TABLE[2][2]:
            publisher.publish(malformed(good_shape, change))
        publisher.publish(good_shape(600))
    chain.wait(lambda: min(gate._seen.values()) == 600)
    gate.wait('left', 1000)  # returns at once
    gate.destroy()


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
        chain.wait(lambda: subscription.counts.received == 20)
    assert subscription.counts == MessageCounts(20, 0, {R.PROCESSING_FAILED: 10, R.NO_TAXELS: 10})
    logged = {record.args[2]: record for record in caplog.records if record.name.endswith('guarded_subscription')}
    assert sorted(logged) == ['no_taxels', 'processing_failed']
    assert len([record for record in caplog.records if record.name.endswith('guarded_subscription')]) == 2
    assert logged['processing_failed'].exc_info[0] is ZeroDivisionError and not logged['no_taxels'].exc_info


def test_health_continues_with_simulated_time_and_no_clock(chain):
    chain.add(ProcessorNode(namespace='/gripper_a/left', parameter_overrides=[Parameter('use_sim_time', value=True)]))
    publisher = chain.publisher(TaxelArray, '/gripper_a/left/taxels')

    chain.wait_for(chain.diagnostics, 1)  # just after a status: a whole second until the next
    for count, message in enumerate((good_taxels(), TaxelArray(), None), start=2):
        if message is not None:
            publisher.publish(message)
        chain.wait_for(chain.diagnostics, count)
    assert [status.level for status in chain.diagnostics] == [STALE, OK, WARN, STALE]
    assert {status.name for status in chain.diagnostics} == {'/gripper_a/left/processor'}
    values = {pair.key: pair.value for pair in chain.diagnostics[-1].values}
    assert (values['received'], values['processed'], values['dropped_no_taxels']) == ('2', '1', '1')
    assert set(values) == {'received', 'processed', *(f'dropped_{reason.key}' for reason in RejectReason if reason)}


def test_health_names_the_topic_that_is_silent_and_counts_all():
    before = {'/left/shape': MessageCounts(5, 5, {}), '/right/shape': MessageCounts(4, 3, {R.NOT_FINITE: 1})}
    now = before | {'/left/shape': MessageCounts(7, 7, {})}
    status = health_status('/gripper/grasp', now, before)
    assert status.level == STALE and '/right/shape' in status.message and '/left' not in status.message
    values = {pair.key: pair.value for pair in status.values}
    assert (values['received'], values['processed'], values['dropped_not_finite']) == ('11', '10', '1')


@pytest.mark.parametrize('probabilities', [{Shape.CIRCLE: NAN}, {Shape.CIRCLE: INF, Shape.NONE: 0.0}])
def test_fusion_refuses_what_is_not_finite_and_keeps_its_state(probabilities):
    fusion = RecognitionFusion()
    fusion.update(0.0, {Shape.CIRCLE: 1.0})
    with pytest.raises(InputError):
        fusion.update(0.02, probabilities)
    with pytest.raises(InputError):
        fusion.update(NAN, {Shape.CIRCLE: 1.0})
    after = fusion.update(0.04, {Shape.CIRCLE: 1.0})
    assert after.recognition.shape is Shape.CIRCLE and after.frames == 2
    assert np.isfinite(list(after.recognition.probabilities.values())).all()


def test_the_tracker_refuses_what_is_not_finite_and_keeps_its_state():
    tracker = GraspTracker()
    for side in ('left', 'right'):
        tracker.update(side, SideResult(0.0, Shape.CIRCLE, (0.01, 0.01)))
    for result in (SideResult(0.02, Shape.CIRCLE, (NAN, 0.0)), SideResult(NAN, Shape.CIRCLE, (0.01, 0.01)),
                   SideResult(INF, Shape.NONE, None)):
        with pytest.raises(InputError):
            tracker.update('left', result)
    state = tracker.update('left', SideResult(0.02, Shape.CIRCLE, (0.01, 0.01)))
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
        # Best effort may lose any of them, so all are sent until one of either kind has arrived
        while not (any('grasp dropped' in line for line in lines) and any('rotate' in line for line in lines)):
            assert process.poll() is None and time.monotonic() < deadline, lines
            for _, change, _ in TABLE[3][2]:
                publisher.publish(malformed(good_grasp, change))
                time.sleep(0.01)
            publisher.publish(good_grasp())
            time.sleep(0.1)
        assert process.poll() is None
    finally:
        process.terminate()
        process.wait(20)


def test_every_reason_is_in_the_table():
    page = (ROOT / 'docs/hardware.md').read_text(encoding='utf-8')
    for reason in RejectReason:
        assert (f'| `dropped_{reason.key}` |' in page) == bool(reason), reason
