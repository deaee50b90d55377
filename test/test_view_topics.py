"""`tactile view` for running nodes: the topics to which it subscribes, and the frame on which it shows each shape."""

import time

import numpy as np
import pytest
import rclpy
from viewed import NAN
from waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture
def nodes():
    from tactile_node.nodes.spinner import Spinner
    from tactile_node.nodes.topic_source import TopicSource
    source = TopicSource(['left'])
    node = rclpy.create_node('by_hand')
    spinner = Spinner([node])
    yield source, node
    source.stop()
    spinner.stop()
    node.destroy_node()
    source.close()


def taxels(node, sequence, value):
    from tactile_skin.msg import TaxelArray
    message = TaxelArray(sequence=sequence, rows=2, cols=2, pitch=0.004, unit='Pa', values=[value, value, NAN, value],
                         status=[1, 1, 2, 1])
    message.header.stamp = node.get_clock().now().to_msg()
    return message


def shape(of, name='square', number=4):
    from tactile_skin.msg import ContactShape
    message = ContactShape(sequence=of.sequence, shape=number, class_name=name, confidence=0.9, force=1.5, taxels=4,
                           pad_seen=True, class_names=['none', 'unknown', name], probabilities=[0.05, 0.05, 0.9],
                           unknown_reason=1, frame_shape=number, frame_class_name=name, contacts=1,
                           frame_probabilities=[0.05, 0.05, 0.9], contact_areas=[6.4e-5])
    message.header = of.header
    return message


def test_topics_are_subscribed_only_while_somebody_looks(nodes):
    source, node = nodes
    assert node.count_subscribers('/left/taxels') == 0
    source.start()
    until(lambda: node.count_subscribers('/left/taxels') == 1 and node.count_subscribers('/left/shape') == 1)
    source.stop()
    until(lambda: node.count_subscribers('/left/taxels') == 0 and node.count_subscribers('/left/shape') == 0)


def test_topics_that_cannot_be_read_any_more_say_why(nodes, monkeypatch, caplog):
    from tactile_node.ros.qos import STATUS_QOS
    from tactile_skin.msg import SkinStatus
    source, node = nodes
    monkeypatch.setattr(source.store, 'put_bus', lambda message: 1 / 0)
    publisher = node.create_publisher(SkinStatus, '/skin_driver/status', STATUS_QOS)
    source.start()
    until(publisher.get_subscription_count, 60)
    publisher.publish(SkinStatus())
    until(lambda: source.store.shown().problem == 'internal error: ZeroDivisionError: division by zero', 60)
    assert 'Traceback' in caplog.text
    source.stop()
    monkeypatch.undo()  # The publisher sends its last status again for the new subscription.
    source.start()  # The source is started for the next browser.
    assert source.store.shown().problem == ''


def publishers(source, node):
    """Return publishers for the taxels and the shapes of the left pad, after ``source`` has subscribed to both."""
    from tactile_node.ros.qos import frames_qos
    from tactile_skin.msg import ContactShape, TaxelArray
    of_taxels = node.create_publisher(TaxelArray, '/left/taxels', frames_qos(10))
    of_shapes = node.create_publisher(ContactShape, '/left/shape', frames_qos(10))
    source.start()
    until(lambda: of_taxels.get_subscription_count() and of_shapes.get_subscription_count())
    return of_taxels, of_shapes


def test_a_shape_of_a_driver_before_is_not_shown_on_the_taxels_of_this_one(nodes):
    """The sequence numbers of both drivers start at 1.

    A shape without its own taxels must not delay the display of new taxels.
    """
    source, node = nodes
    of_taxels, of_shapes = publishers(source, node)
    before = taxels(node, 1, 10e3)
    time.sleep(0.06)
    of_taxels.publish(taxels(node, 1, 20e3))
    until(lambda: source.store.shown().pads['left'] is not None)
    time.sleep(0.1)
    of_shapes.publish(shape(before))
    time.sleep(0.2)
    assert source.store.shown().pads['left'].contact is None
    of_taxels.publish(taxels(node, 2, 30e3))
    until(lambda: source.store.shown().pads['left'].values[0, 0] == 30e3)


@pytest.mark.parametrize(('name', 'number'), [('square', 4), ('plug', 8)], ids=['square', 'taught'])
def test_a_shape_is_shown_on_the_taxels_that_it_was_recognised_from(nodes, name, number):
    source, node = nodes
    of_taxels, of_shapes = publishers(source, node)
    first, second = taxels(node, 1, 10e3), taxels(node, 2, 99e3)
    of_taxels.publish(first)
    until(lambda: source.store.shown().pads['left'] is not None)
    assert source.store.shown().pads['left'].contact is None  # No shape has arrived for these taxels yet.
    of_taxels.publish(second)
    time.sleep(0.1)
    of_shapes.publish(shape(first, name, number))  # The shape is late, because the second frame has already arrived.
    until(lambda: source.store.shown().pads['left'].contact is not None)
    seen = source.store.shown().pads['left']
    np.testing.assert_array_equal(seen.values, [[10e3, 10e3], [NAN, 10e3]])
    assert (seen.contact.shape, seen.contact.confidence) == (name, pytest.approx(0.9))
    assert seen.contact.outline is None  # The page draws no outline, because fit_valid is false.


def grasp(header, **changed):
    """Return a grasp in which both pads are touched, but the position and the class of the object are unknown."""
    from tactile_skin.msg import Grasp
    message = Grasp(header=header, side_states=2 * [Grasp.SIDE_TOUCHED], contact=Grasp.TWO_SIDED, shape=2,
                    class_name='unknown', centre=[NAN, NAN], **changed)
    for point in (message.left_centre, message.right_centre, message.midpoint, message.axis):
        point.x = point.y = point.z = NAN
    message.gap = message.width = message.offset = message.misalignment = message.creep = message.centre_sd = NAN
    message.lean = [NAN, NAN]
    message.yaw = message.yaw_sd = message.grip_force = message.grip_force_sd = message.force_imbalance = NAN
    return message


def test_a_grasp_has_its_own_age_and_one_that_contradicts_itself_is_not_shown(nodes):
    from tactile_node.ros.qos import frames_qos
    from tactile_skin.msg import Grasp
    source, node = nodes
    publisher = node.create_publisher(Grasp, '/grasp', frames_qos(10))
    source.start()
    until(publisher.get_subscription_count)
    # This message claims to be stable although it is not fresh.
    publisher.publish(grasp(taxels(node, 1, 10e3).header, stable=True))
    publisher.publish(grasp(taxels(node, 1, 10e3).header))
    until(lambda: source.store.shown().grasp is not None)
    seen = source.store.shown().grasp
    assert (seen.contact, seen.is_fresh, seen.is_stable, seen.acquired) == ('two_sided', False, False, -np.inf)

    def is_age_known():
        publisher.publish(grasp(taxels(node, 1, 10e3).header, fresh=True))
        return np.isfinite(source.store.shown().grasp.acquired)
    until(is_age_known)
    assert source.store.shown().grasp.is_fresh
    assert time.monotonic() - source.store.shown().grasp.acquired < 1
    source.stop()
    assert source.store.shown().grasp is None
