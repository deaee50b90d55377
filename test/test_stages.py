"""The processor and the classifier on real topics.

The tests show what a subscriber receives from pads that are hidden, saturated or touched twice.
"""

import time
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from captured_log import CapturedLog
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, RosBench, features_fit, shapes_fit
from taught_cross import cross, rng_of, write_taught_cross

from tactile_node.errors import InputError
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.pose.pipeline import Taxels
from tactile_node.pose.profiles import Layer
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.ros.message_age import age_seconds
from tactile_node.ros.message_checks import check_contact, check_contact_shape
from tactile_node.ros.qos import frames_qos
from tactile_node.taxel_frame import NO_SIDE, SkinSide, TaxelFrame, TaxelStatus
from tactile_skin.msg import Contact, ContactFeatures, ContactShape, ContactShapes, TaxelArray

pytestmark = pytest.mark.ros
PITCH = 0.002
TOPICS = {'contact': (Contact, lambda message: check_contact(message) is None),
          'shape': (ContactShape, lambda message: check_contact_shape(message) is None),
          'shapes': (ContactShapes, shapes_fit), 'features': (ContactFeatures, features_fit)}


class Pad(RosBench):
    """Both nodes of a pad, and a peer node that publishes the taxels and subscribes to the results."""

    def __init__(self, stack, **classifier):
        super().__init__(stack)
        self.peer, self.processor = self.add('peer'), self.add(ProcessorNode())
        self.classifier = self.add(ClassifierNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in classifier.items()]))
        self._taxels = self.peer.create_publisher(TaxelArray, 'taxels', frames_qos(50))
        self._subscriptions, self.heard, self._sequence = {}, {topic: [] for topic in TOPICS}, 0
        for topic in ('contact', 'shape'):
            self.subscribe(topic)

    def subscribe(self, topic: str) -> None:
        self._subscriptions[topic] = self.peer.create_subscription(TOPICS[topic][0], topic, self.heard[topic].append,
                                                                   frames_qos(50))
        self.until(lambda: self.peer.count_publishers(topic) and all(
            publisher.get_subscription_count() for publisher in self._publishers(topic)))

    def unsubscribe(self, topic: str) -> None:
        self.peer.destroy_subscription(self._subscriptions.pop(topic))
        self.until(lambda: not any(each.get_subscription_count() for each in self._publishers(topic)))

    def _publishers(self, topic):
        return [each for node in (self.processor, self.classifier) for each in node.publishers
                if each.topic_name == f'/{topic}']

    def send(self, frame, saturated=False, unmapped=False, layer=None, ends=NO_SIDE) -> SimpleNamespace:
        """Publish the frame ``frame`` [Pa] and return the resulting messages by topic.

        Each message is checked, and None marks a missing message.
        """
        self.until(lambda: self._taxels.get_subscription_count())
        values = np.asarray(frame, np.float32)
        status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
        status[np.broadcast_to(saturated, status.shape)] = TaxelStatus.SATURATED
        status[np.broadcast_to(unmapped, status.shape)] = TaxelStatus.UNMAPPED
        frame = TaxelFrame(time.time(), self._sequence, values, status, 0)
        taxels = taxel_array_message(PadFrame.of(frame, Taxels(PITCH, 'Pa', layer, ends), 'left_pad'))
        self._taxels.publish(taxels)
        self.until(lambda: all(heard and heard[-1].sequence == taxels.sequence
                                     for topic, heard in self.heard.items() if topic in self._subscriptions))
        self._sequence += 1
        made = {topic: heard[-1] if topic in self._subscriptions else None for topic, heard in self.heard.items()}
        for topic, message in made.items():
            assert message is None or TOPICS[topic][1](message)
        return SimpleNamespace(**made)


@pytest.fixture
def pad(ros):
    return Pad(ros)


def block(rows=slice(4, 11), cols=slice(4, 11), level=50e3):
    frame = np.zeros((16, 16))
    frame[rows, cols] = level
    return frame


def test_the_layer_of_a_calibrated_skin_makes_its_fits_surer(pad):
    rows, cols = np.indices((16, 16))
    noise = np.random.default_rng(0).normal(0, 400, (16, 16))
    disc = 50e3 / (1 + np.exp(3 * (np.hypot(cols - 7.6, rows - 7.3) - 3.2))) + noise
    free, known = (pad.send(disc, layer=layer) for layer in (None, Layer(0.5 * PITCH, 0.05)))
    assert (known.contact.layer_depth, known.contact.layer_deviation) == pytest.approx((0.5 * PITCH, 0.05))
    assert free.contact.layer_depth == 0.0 and free.shape.shape == known.shape.shape == ContactShape.CIRCLE
    deviations = [found.shape.covariance[-1] for found in (free, known)]
    assert 0 < deviations[1] < deviations[0]


def test_an_object_under_seven_hidden_rows_is_not_reported_as_none(pad):
    hidden = np.zeros((16, 16))
    hidden[4:11] = np.nan
    empty = pad.send(np.zeros((16, 16)))
    assert (empty.contact.state, empty.shape.shape, empty.shape.force) == (Contact.EMPTY, ContactShape.NONE, 0.0)
    assert empty.shape.pad_seen and empty.shape.unknown_reason == ContactShape.NOT_UNKNOWN
    found = pad.send(hidden)
    assert (found.contact.state, found.contact.pad_seen) == (Contact.NOT_SEEN, False)
    assert (found.shape.shape, found.shape.unknown_reason) == (ContactShape.UNKNOWN, ContactShape.NOT_SEEN)
    assert not found.shape.pad_seen and np.isnan([found.shape.force, found.shape.contact_area]).all()


def test_places_without_a_taxel_hide_nothing(pad):
    unmapped = np.zeros((16, 16), bool)
    unmapped[:6, :6] = True
    found = pad.send(np.where(unmapped, np.nan, 0.0), unmapped=unmapped)
    assert (found.contact.state, found.shape.shape) == (Contact.EMPTY, ContactShape.NONE)


def test_hidden_and_saturated_taxels_are_counted_and_make_force_and_size_bounds(pad):
    frame = block()
    frame[11:13] = frame[6, 6] = np.nan
    found = pad.send(frame).shape
    assert (found.taxels, found.hidden_taxels, found.ring_taxels, found.hidden_ring_taxels) == (49, 1, 32, 9)
    assert found.force_is_bound and found.centre_of_pressure_is_bound and found.size_is_bound
    assert found.confidence < 0.9 and not found.at_edge
    whole = pad.send(block()).shape
    assert not (whole.force_is_bound or whole.centre_of_pressure_is_bound or whole.size_is_bound)
    found = pad.send(block(), saturated=block() > 0).shape
    assert (found.saturated_taxels, found.saturated_ring_taxels, found.force_is_bound) == (49, 0, True)


def test_force_has_a_standard_deviation_where_noise_is_seen(pad):
    assert np.isnan(pad.send(block()).shape.force_sd)
    noise = 500 * np.random.default_rng(5).standard_normal((16, 16))
    found = pad.send(block() + noise).shape
    assert found.force_sd == pytest.approx(500 * 7 * PITCH**2, rel=0.3)
    assert 0 < found.centre_of_pressure_sd < 1e-4
    np.testing.assert_allclose(np.square(found.standard_deviations), np.diag(
        np.reshape(found.covariance, (len(found.parameter_names),) * 2)))


def test_all_contacts_are_counted_and_the_four_largest_have_shapes(pad):
    pad.subscribe('shapes')
    frame = block(slice(0, 7), slice(1, 8))
    frame[1:5, 11:15] = frame[10:15, 1:5] = 60e3
    frame[10:13, 11:14] = frame[15, 15] = frame[15, 9] = 70e3
    found = pad.send(frame, ends=SkinSide(15))
    assert (found.contact.contacts, list(found.contact.contact_taxels)) == (6, [49, 20, 16, 9, 1, 1])
    assert found.shape.contacts == 6 and found.shape.others_present
    np.testing.assert_allclose(found.shape.contact_areas, np.array([49, 20, 16, 9, 1, 1]) * PITCH**2)
    assert [shape.taxels for shape in found.shapes.shapes] == [49, 20, 16, 9] and found.shapes.contacts == 6
    assert found.shapes.shapes[0].shape == ContactShape.SQUARE
    for shape in (found.shape, *found.shapes.shapes):
        assert shape.pad_force == pytest.approx(frame.sum() * PITCH**2)
        assert not (shape.force_is_bound or shape.pad_force_is_bound)
    centres = [(round(shape.centre_of_pressure.x / PITCH, 3), round(shape.centre_of_pressure.y / PITCH, 3))
               for shape in found.shapes.shapes]
    assert centres == [(4, 3), (2.5, 12), (12.5, 2.5), (12, 11)]
    assert [shape.force for shape in found.shapes.shapes] == pytest.approx(
        [49 * 0.2, 20 * 0.24, 16 * 0.24, 9 * 0.28])
    alone = pad.send(block())
    assert (alone.shape.contacts, alone.shape.others_present, len(alone.shapes.shapes)) == (1, False, 1)
    nothing = pad.send(np.full((16, 16), np.nan)).shapes
    assert (nothing.state, nothing.contacts, len(nothing.shapes)) == (ContactShapes.NOT_SEEN, 0, 0)


def test_a_contact_torn_by_rows_is_one_in_count_force_and_fit(pad):
    """Rows that are NaN are a hidden part of the contact.

    For silent rows at 0 Pa, the recogniser decides whether both parts belong to one contact.
    """
    pad.subscribe('shapes')
    for silent in (np.nan, 0.0):
        frame = block(slice(3, 12), slice(3, 12))
        frame[8:10] = silent
        found = pad.send(frame)
        assert found.contact.contacts == (1 if np.isnan(silent) else 2), 'the processor counts visible parts'
        assert found.shape.contacts == len(found.shapes.shapes) == 1 and found.shape.taxels == 63
        assert found.shape.force == pytest.approx(63 * 0.2) and list(found.shape.contact_areas) == [
            pytest.approx(63 * PITCH**2)]
        assert found.shape.fit_valid and found.shape.pose.pose.position.y == pytest.approx(7 * PITCH, abs=PITCH / 2)


def test_features_and_shapes_are_computed_while_something_subscribes(pad):
    pad.send(block())
    assert not pad.heard['features'] and not pad.heard['shapes']
    pad.subscribe('features')
    pad.subscribe('shapes')
    found = pad.send(block())
    assert found.features.features and found.features.hidden_taxels == 0 and len(found.shapes.shapes) == 1
    hidden = block()
    hidden[11] = hidden[6, 6] = np.nan
    assert pad.send(hidden).features.hidden_taxels == 1 + 9
    unseen = pad.send(np.full((16, 16), np.nan)).features
    assert unseen.state == ContactFeatures.NOT_SEEN and not unseen.features
    for topic in ('features', 'shapes'):
        pad.unsubscribe(topic)
    counts = len(pad.heard['features']), len(pad.heard['shapes'])
    pad.send(block())
    assert counts == (len(pad.heard['features']), len(pad.heard['shapes']))


def test_every_stage_adds_to_the_age(pad):
    for topic in ('features', 'shapes'):
        pad.subscribe(topic)
    ages, end = {'shapes': inf}, time.monotonic() + TIMEOUT
    while not ages['shapes'] < 0.5:  # The age is unknown in the first messages.
        assert time.monotonic() < end, ages
        found = pad.send(block())
        ages = {topic: age_seconds(getattr(found, topic).age) for topic in TOPICS}
        time.sleep(0.02)
    assert 0 < ages['contact'] < ages['features'] < inf and ages['contact'] < ages['shape'] < ages['shapes']


def test_a_taught_shape_is_on_the_topic_by_its_name_with_a_place_and_without_a_pose(ros, tmp_path):
    write_taught_cross(tmp_path / 'own.npz')
    pad = Pad(ros, model=str(tmp_path / 'own.npz'))
    empty, pressed = pad.send(np.zeros((16, 16))), pad.send(50e3 * cross(rng_of(40)))
    assert empty.shape.shape == ContactShape.NONE and 'cross' in empty.shape.class_names
    assert (pressed.shape.shape, pressed.shape.class_name) == (ContactShape.OTHER, 'cross')
    assert not pressed.shape.fit_valid and np.isnan(pressed.shape.pose.pose.position.x)
    assert pressed.shape.centre_of_pressure.x == pytest.approx(7.5 * PITCH, abs=PITCH)


def test_counts_that_a_layout_takes_for_pascal_are_reported_once(pad):
    counts, touch = (np.pad(peak + np.arange(49.0).reshape(7, 7), 4) for peak in (100, 20e3))
    with CapturedLog() as log:
        for frame in (np.zeros_like(counts), counts, counts):
            assert pad.send(frame).contact.state == Contact.EMPTY
        facts = log.error_facts
        assert pad.send(touch).contact.state == Contact.TOUCHED
    assert len(facts) == 1 and isinstance(facts[0], InputError) and 'layout' in facts[0].remedy


LIVE = {'use_sim_time': False, 'features': ['all'], 'smallest_contact': 3, 'release_ratio': 0.5,
        'press_threshold': 10e3}


def test_setting_a_parameter_keeps_what_the_pad_has_learned(pad):
    """Left-over taxels must not become a contact on a pad that is reported as seen.

    The node must remember the noise of a noisy taxel.
    """
    rng, noise = np.random.default_rng(3), np.full((16, 16), 100.0)
    noise[2, 2] = 350.0
    left_over = np.zeros((16, 16))
    left_over[(4, 5, 6, 8, 9, 10), (4, 7, 9, 5, 10, 8)] = 50e3

    def send(frame):
        found = pad.send(frame + noise * rng.standard_normal((16, 16))).contact
        return (found.state, found.pad_seen), found.noise_floor[2 * 16 + 2]
    for frame in [np.zeros((16, 16))] * 40 + [block()] * 3 + [left_over] * 3:
        state, learned = send(frame)
    assert state == (Contact.NOT_SEEN, False)
    assert learned > 150, 'the noise of all other taxels is 100'
    for name, value in LIVE.items():
        assert pad.processor.set_parameters([Parameter(name, value=value)])[0].successful
        for _ in range(3):
            state, known = send(left_over)
            assert state == (Contact.NOT_SEEN, False), name
            assert known == pytest.approx(learned, rel=0.3), name


def test_a_changed_threshold_finds_the_contact_in_progress_again(pad):
    """If the threshold changes, the outline of the contact changes with it.

    The outer part of the hill must not be treated as left over from a larger contact.
    """
    hill = np.zeros((16, 16))
    hill[2:14, 2:14] = 20e3
    hill[5:10, 5:10] = 50e3
    for _ in range(3):
        assert pad.send(hill).contact.contact_taxels[0] == 144
    assert pad.processor.set_parameters([Parameter('press_threshold', value=30e3)])[0].successful
    for _ in range(20):
        found = pad.send(hill).contact
        assert (found.state, list(found.contact_taxels), found.pad_seen) == (Contact.TOUCHED, [25], True)
    assert pad.processor.set_parameters([Parameter('press_threshold', value=0.0)])[0].successful
    assert pad.send(hill).contact.contact_taxels[0] == 144
