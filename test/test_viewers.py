"""The displays in RViz, Foxglove and PlotJuggler must have the fields, the frames and the QoS that they need.

No display may mislead its user.
"""

import importlib
import json
import math
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import Point32, WrenchStamped
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_bench import TIMEOUT, RosBench
from sensor_msgs.msg import Image
from visualization_msgs.msg import Marker, MarkerArray

from examples.demo.topics import frame_topics
from tactile_node.colour_map import NO_VALUE, RGB_TABLE, SATURATED, ColourScale
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.nodes import view_topics
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.pose.pipeline import FoundContact
from tactile_node.ros.contact_messages import PadContact, pad_frame_of
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.view_messages import (
    ContactMarkers,
    MarkerLifetime,
    colour_image,
    value_image,
    wrench_message,
)
from tactile_node.taxel_frame import TaxelStatus
from tactile_skin.msg import ContactShape, TaxelArray

pytestmark = pytest.mark.ros
PITCH = 0.002
CONFIG = Path(__file__).resolve().parents[1] / 'config'
VIEWS = {'image': Image, 'image_colour': Image, 'wrench': WrenchStamped, 'markers': MarkerArray}
NAN = math.nan
NAMESPACES = ['taxels', 'outline', 'axes', 'centre_of_pressure', 'name']
PRESSED = 50e3  # Pressure in Pa.


def taxels(values, saturated=(), unmapped=(), unit='Pa', sec=1_700_000_000) -> TaxelArray:
    """Return a TaxelArray as any driver may publish it.

    ``saturated`` and ``unmapped`` are lists of (row, col).
    """
    values = np.array(values, np.float32)
    status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
    for row, col in saturated:
        status[row, col] = TaxelStatus.SATURATED
    for row, col in unmapped:
        status[row, col], values[row, col] = TaxelStatus.UNMAPPED, NAN
    message = TaxelArray(sequence=7, rows=values.shape[0], cols=values.shape[1], pitch=PITCH, unit=unit)
    message.values = values.reshape(-1).tolist()
    message.status = status.reshape(-1).tolist()
    message.header.frame_id = 'left_pad'
    message.header.stamp.sec, message.header.stamp.nanosec = sec, 250_000_000
    return message


def pressed(*blocks, hidden=(), value=PRESSED) -> np.ndarray:
    """Return the values of a 16x16 pad with pressed ``blocks`` and ``hidden`` rectangles (row, col, rows, cols)."""
    values = np.zeros((16, 16))
    for row, col, rows, cols in blocks:
        values[row:row + rows, col:col + cols] = value
    for row, col, rows, cols in hidden:
        values[row:row + rows, col:col + cols] = NAN
    return values


def contact_of(message: TaxelArray) -> PadContact:
    def having(code):
        return np.array(message.status).reshape(message.rows, message.cols) == code
    pattern = PatternExtractor(unit=message.unit).extract(
        np.array(message.values).reshape(message.rows, message.cols), saturated=having(TaxelStatus.SATURATED),
        unmapped=having(TaxelStatus.UNMAPPED))
    frame = pad_frame_of(message)
    return PadContact(frame, FoundContact.of(pattern, frame.taxels))


# --- Images

def test_an_image_is_the_taxels_row_by_row_with_frame_and_stamp_unchanged():
    message = taxels([[0, 1, 2], [3, NAN, 5]], saturated=[(1, 2)])
    image = value_image(pad_frame_of(message))
    assert (image.height, image.width, image.encoding, image.step, image.is_bigendian) == (2, 3, '32FC1', 12, 0)
    assert len(image.data) == image.height * image.step
    found = struct.unpack('<6f', bytes(image.data))
    assert found[:4] == (0, 1, 2, 3) and math.isnan(found[4]) and found[5] == 5
    assert image.header == message.header


def test_a_coloured_image_has_three_bytes_for_each_pixel_from_0_to_full_scale():
    message = taxels([[0, 100e3, NAN], [200e3, -5, 90e3]], saturated=[(1, 2)])
    image = colour_image(pad_frame_of(message), ColourScale(100e3))
    assert (image.height, image.width, image.encoding, image.step) == (2, 3, 'rgb8', 9)
    nothing, full, grey, green = [0, 0, 4], [252, 255, 164], [128, 128, 128], [60, 210, 80]
    assert np.array(image.data).reshape(2, 3, 3).tolist() == [[nothing, full, grey], [full, nothing, green]]
    assert image.header == message.header


@pytest.mark.parametrize('number', [NO_VALUE, SATURATED])
def test_a_taxel_without_a_plain_value_has_a_colour_that_no_value_has(number):
    table = RGB_TABLE.astype(float)
    others = np.delete(table, number, axis=0)
    assert np.linalg.norm(others - table[number], axis=1).min() > 50


def test_noise_is_dark_and_a_scale_holds_its_peak_for_ten_seconds():
    scale, whole = ColourScale(), np.zeros((1, 2), bool)
    # The press threshold of 30 kPa is rounded up to 50 kPa, of which 600 Pa is level 3 of 255.
    assert scale.numbers(np.array([[0.0, 600.0]]), whole, 'Pa', 0.0).max() <= 6
    assert scale.numbers(np.array([[0.0, 100e3]]), whole, 'Pa', 1.0).tolist() == [[0, 255]]
    assert scale.numbers(np.array([[NAN, 50e3]]), whole, 'Pa', 10.9).tolist() == [[NO_VALUE, 128]]
    assert scale.numbers(np.array([[NAN, 50e3]]), whole, 'Pa', 11.1).tolist() == [[NO_VALUE, 255]]
    assert ColourScale().numbers(np.array([[0.0, 1.0]]), whole, '1', 0.0).tolist() == [[0, 255]]


def test_the_scale_is_rounded_up_and_follows_the_largest_reading():
    scale = ColourScale()
    assert scale.full_scale(np.array([1e3, NAN]), 'Pa', 0.0) == 50e3
    assert scale.full_scale(np.array([130e3, np.inf]), 'Pa', 1.0) == 200e3
    assert scale.full_scale(np.array([1e3]), 'Pa', 5.0) == 200e3
    assert scale.full_scale(np.array([1e3]), 'Pa', 12.0) == 50e3
    assert scale.full_scale(np.array([NAN]), 'Pa', 3.0) == 50e3  # A recording was moved back.
    assert ColourScale(80e3).full_scale(np.array([130e3]), 'Pa', 0.0) == 80e3


# --- Wrench

def six(message: WrenchStamped) -> list[float]:
    force, torque = message.wrench.force, message.wrench.torque
    return [force.x, force.y, force.z, torque.x, torque.y, torque.z]


def wrench(message: TaxelArray) -> list[float]:
    found = wrench_message(contact_of(message))
    assert found.header == message.header
    return six(found)


def test_a_contact_pushes_into_the_skin_with_torques_about_taxel_0_0():
    # For 3x5 taxels of 2 mm at 50 kPa, the force is 15 * 4e-6 m^2 * 50e3 Pa = 3 N at x = 9 * 2 mm, y = 4 * 2 mm.
    assert wrench(taxels(pressed((3, 7, 3, 5)))) == pytest.approx([0, 0, -3.0, -3.0 * 0.008, 3.0 * 0.018, 0])


def test_all_contacts_count():
    # 4x4 taxels carry 3.2 N at x = 1.5, y = 2.5 taxels. 3x3 taxels carry 1.8 N at x = 12, y = 11 taxels.
    message = taxels(pressed((1, 0, 4, 4), (10, 11, 3, 3)))
    message.finger_ends = message.FIRST_COL
    assert wrench(message) == pytest.approx([0, 0, -5.0, -(3.2 * 0.005 + 1.8 * 0.022), 3.2 * 0.003 + 1.8 * 0.024, 0])


def test_a_taxel_between_two_contacts_counts_once():
    values = pressed((2, 2, 4, 4), (2, 7, 4, 4))
    values[2:6, 6] = 0.1 * PRESSED  # next to both contacts, and part of neither
    values[6, 2:11] = 0.1 * PRESSED  # below both contacts
    message = taxels(values)
    assert contact_of(message).found.pattern.contacts == 2
    assert wrench(message)[2] == pytest.approx(-values.sum() * 4e-6)


def test_an_empty_pad_that_was_seen_has_no_force():
    assert wrench(taxels(pressed())) == [0.0] * 6


@pytest.mark.parametrize('message', [
    taxels(pressed(hidden=[(0, 0, 3, 3)])),  # An unseen object may press on the hidden taxels.
    taxels(np.full((16, 16), NAN)),
    taxels(pressed((3, 7, 4, 4), hidden=[(12, 0, 3, 3)])),  # A second object may press on the hidden taxels.
    taxels(pressed((3, 7, 4, 4), hidden=[(4, 11, 2, 1)])),  # The contact may extend to the hidden taxels.
    taxels(pressed((3, 7, 4, 4)), saturated=[(4, 8)]),  # The force on the saturated taxel may exceed its reading.
    taxels(pressed((3, 7, 4, 4), value=1.0), unit='1'),
    taxels(pressed(), unit='1')], ids=['room', 'silent', 'elsewhere', 'beside', 'saturated', 'on_off', 'on_off_empty'])
def test_an_unknown_force_is_nan(message):
    assert all(map(math.isnan, wrench(message)))


# --- Markers

def shape_of(contact: PadContact, **fields) -> ContactShape:
    """Return the shape message for a square of 4 taxels at row 3, column 7, with a matching fit."""
    message = ContactShape(
        header=contact.header, sequence=contact.sequence, shape=ContactShape.SQUARE, class_name='square',
        unknown_reason=ContactShape.NOT_UNKNOWN, confidence=0.93, fit_valid=True, symmetry=4,
        dimension_names=['side'], dimensions=[0.008])
    message.pose.pose.position.x, message.pose.pose.position.y = 0.017, 0.009
    # The quaternion is a quarter turn from x to y.
    message.pose.pose.orientation.z = message.pose.pose.orientation.w = math.sqrt(0.5)
    message.centre_of_pressure.x, message.centre_of_pressure.y = 0.0171, 0.0092
    message.outline.points = [Point32(x=x, y=y) for x, y in
                              ((0.013, 0.005), (0.021, 0.005), (0.021, 0.013), (0.013, 0.013))]
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def without_fit(contact: PadContact, **fields) -> ContactShape:
    """Return the classifier's message for UNKNOWN or NONE, which has no outline and a pose of NaN."""
    message = ContactShape(header=contact.header, **fields)
    for part in (message.pose.pose.position, message.centre_of_pressure):
        part.x = part.y = NAN
    return message


def square(**fields) -> tuple[PadContact, ContactShape]:
    contact = contact_of(taxels(pressed((3, 7, 4, 4))))
    return contact, shape_of(contact, **fields)


def drawn(contact: PadContact, shape: ContactShape, lifetime=0.5) -> dict[str, Marker]:
    """Return the added markers by namespace, after checking that RViz can draw each of them."""
    found = ContactMarkers(ColourScale(100e3)).message(contact, shape, lifetime).markers
    assert [marker.ns for marker in found] == NAMESPACES and {marker.id for marker in found} == {0}
    assert {marker.action for marker in found} <= {Marker.ADD, Marker.DELETE}
    for marker in found:
        assert marker.header == contact.header and marker.header.frame_id
        if marker.action == Marker.ADD:
            check_as_rviz_does(marker)
    return {marker.ns: marker for marker in found if marker.action == Marker.ADD}


def check_as_rviz_does(marker: Marker) -> None:
    """Check that RViz would draw the marker without an error or a warning.

    The rules in this function are those of rviz_default_plugins/displays/marker.
    """
    turn, place, scale = marker.pose.orientation, marker.pose.position, marker.scale
    assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1)
    points = [(point.x, point.y, point.z) for point in (place, *marker.points)]
    assert np.isfinite(points).all()
    needed = {Marker.CUBE_LIST: 'xyz', Marker.SPHERE: 'xyz', Marker.LINE_STRIP: 'x', Marker.LINE_LIST: 'x',
              Marker.TEXT_VIEW_FACING: 'z'}[marker.type]
    for axis in 'xyz':  # RViz would use a text's x scale as the width of a space.
        assert getattr(scale, axis) > 0 if axis in needed else getattr(scale, axis) == 0
    assert all(colour.a == 1 for colour in (marker.color, *marker.colors))
    if marker.type in (Marker.CUBE_LIST, Marker.LINE_STRIP, Marker.LINE_LIST):
        assert marker.points and len(marker.colors) in (0, len(marker.points))
    if marker.type == Marker.LINE_LIST:
        assert len(marker.points) % 2 == 0
    assert not marker.frame_locked  # The marker stays at the position that the pad had at the time of the frame.
    assert marker.lifetime.sec or marker.lifetime.nanosec  # A marker with a lifetime of 0 would never expire.


def flat(points) -> list[tuple[float, float]]:
    return [(pytest.approx(point.x), pytest.approx(point.y)) for point in points]


def test_every_taxel_is_where_it_is_in_the_colour_of_its_value():
    contact = contact_of(taxels([[0, 0, 0], [0, 0, NAN]], unmapped=[(0, 1)]))
    marker = drawn(contact, without_fit(contact, class_name='none', shape=ContactShape.NONE))['taxels']
    # The marker contains no point for the UNMAPPED taxel.
    assert flat(marker.points) == [(0, 0), (0.004, 0), (0, 0.002), (0.002, 0.002), (0.004, 0.002)]
    # The tops of the taxels lie on the surface of the skin, with gaps between neighbours.
    assert [point.z + marker.scale.z / 2 for point in marker.points] == [pytest.approx(0.0)] * 5
    assert marker.scale.x < PITCH and marker.scale.y < PITCH
    rgb = [[round(255 * part) for part in (colour.r, colour.g, colour.b)] for colour in marker.colors]
    assert rgb == [[0, 0, 4]] * 4 + [[128, 128, 128]]


def test_a_square_has_outline_axes_centre_and_name_and_a_circle_no_axes():
    assert 'axes' not in drawn(*square(symmetry=0))
    found = drawn(*square())
    assert list(found) == NAMESPACES
    assert flat(found['outline'].points) == [(0.013, 0.005), (0.021, 0.005), (0.021, 0.013), (0.013, 0.013),
                                             (0.013, 0.005)]
    # Each axis is half as long as the side. The shape's x axis points along y of the pad, and its y axis points along
    # -x.
    assert flat(found['axes'].points) == [(0.017, 0.009), (0.017, 0.013), (0.017, 0.009), (0.013, 0.009)]
    x, _, y, _ = found['axes'].colors
    assert x.r > 2 * max(x.g, x.b) and y.b > y.r
    assert flat([found['centre_of_pressure'].pose.position]) == [(0.0171, 0.0092)]
    assert found['name'].text == 'square 93%'
    place = found['name'].pose.position
    assert place.x == pytest.approx(7.5 * PITCH) and place.y > 15.5 * PITCH  # The name is placed beyond the last row.


def test_a_bound_is_not_drawn_as_the_whole():
    whole, bound = drawn(*square()), drawn(*square(size_is_bound=True, centre_of_pressure_is_bound=True))
    for name in ('outline', 'centre_of_pressure'):
        assert whole[name].color.g > whole[name].color.r and bound[name].color.r > bound[name].color.g


@pytest.mark.parametrize(('fields', 'text'), [
    ({'shape': ContactShape.UNKNOWN, 'class_name': 'unknown', 'unknown_reason': ContactShape.UNFAMILIAR,
      'confidence': 0.8}, 'unknown (unfamiliar) 80%'),
    ({'shape': ContactShape.UNKNOWN, 'class_name': 'unknown', 'unknown_reason': ContactShape.NOT_SEEN,
      'confidence': 1.0}, 'unknown (not seen) 100%'),
    ({'shape': ContactShape.NONE, 'class_name': 'none', 'unknown_reason': ContactShape.NOT_UNKNOWN,
      'confidence': 1.0}, 'none 100%')])
def test_without_a_shape_only_taxels_and_name_are_left_of_one_drawn_before(fields, text):
    """RViz and Foxglove keep markers by namespace and id until they are deleted or expire."""
    screen = {}
    contact = contact_of(taxels(pressed((3, 7, 4, 4))))
    for shape in (shape_of(contact), without_fit(contact, **fields)):
        for marker in ContactMarkers(ColourScale()).message(contact, shape, 0.5).markers:
            screen.pop((marker.ns, marker.id), None)
            if marker.action == Marker.ADD:
                screen[marker.ns, marker.id] = marker
    assert {name for name, _ in screen} == {'taxels', 'name'} and screen['name', 0].text == text


@pytest.mark.parametrize(('arrivals', 'stamps', 'lifetimes'), [
    ((0.0, 0.02, 0.04), (0.0, 0.02, 0.04), [0.5, 0.5, 0.5]),
    # The skin is slow and becomes slower.
    ((0.0, 2.0, 4.0, 1e6, 2e6), (0.0, 2.0, 4.0, 1e6, 2e6), [0.5, 6.0, 6.0, 6.0, 30.0]),
    ((0.0, 1.0, 2.0), (0.0, 0.02, 0.04), [0.5, 3.0, 3.0]),  # A 50 Hz log is played at 1/50 of its speed.
    ((0.0, 0.02, 0.04), (0.0, 1.0, 2.0), [0.5, 3.0, 3.0]),  # A 1 Hz log is played at 50 times its speed.
    ((0.0, 0.02, 10.0, 10.02), (0.0, 0.02, 10.0, 10.02), [0.5, 0.5, 0.5, 0.5])])  # The skin fails for almost 10 s.
def test_markers_last_from_one_frame_to_the_next_and_expire_when_a_skin_is_silent(arrivals, stamps, lifetimes):
    lifetime = MarkerLifetime()
    assert [lifetime.after(*times) for times in zip(arrivals, stamps)] == lifetimes
    duration = drawn(*square(), lifetime=0.5)['outline'].lifetime
    assert (duration.sec, duration.nanosec) == (0, 500_000_000)


# --- On topics

class Pad(RosBench):
    """Both nodes of a pad, and a peer node that publishes the taxels and subscribes to the topics of the displays."""

    def __init__(self, stack, lossless: bool = False):
        super().__init__(stack)
        self.peer = self.add(rclpy.create_node('viewer', namespace='left'))
        options = {'namespace': 'left', 'parameter_overrides': [Parameter('lossless', value=lossless)]}
        self.nodes = self.add(ProcessorNode(**options)), self.add(ClassifierNode(**options))
        qos = frames_qos(10, lossless)
        self._taxels = self.peer.create_publisher(TaxelArray, 'taxels', qos)
        self.shapes: list[ContactShape] = []
        self.peer.create_subscription(ContactShape, 'shape', self.shapes.append, qos)
        self.until(self._taxels.get_subscription_count)
        self.until(lambda: self.peer.count_publishers('shape'))

    def send(self, message: TaxelArray) -> None:
        """Publish ``message`` and wait for the shape with its stamp."""
        self._taxels.publish(message)
        self.until(lambda: self.shapes and self.shapes[-1].header.stamp == message.header.stamp)


@pytest.fixture
def made(monkeypatch) -> list[str]:
    """Return a list that records the name of each computed message."""
    found: list[str] = []

    def noting(name, make):
        return lambda *arguments: (found.append(name), make(*arguments))[1]
    for name in ('value_image', 'colour_image', 'wrench_message'):
        monkeypatch.setattr(view_topics, name, noting(name, getattr(view_topics, name)))
    monkeypatch.setattr(view_topics.ContactMarkers, 'message', noting('markers', ContactMarkers.message))
    return found


@pytest.mark.parametrize('lossless', [False, True])
def test_nothing_is_computed_until_something_subscribes(ros, made, lossless):
    pad = Pad(ros, lossless)
    pad.send(taxels(pressed((3, 7, 4, 4)), sec=100))
    for node in pad.nodes:  # Messages for viewers come after the shape.
        assert node._stages.chain.wait_until_idle(TIMEOUT)
    assert not made
    heard = {topic: [] for topic in VIEWS}
    for topic, kind in VIEWS.items():
        pad.peer.create_subscription(kind, topic, heard[topic].append, frames_qos(10))
    for topic in VIEWS:
        publisher, = (each for node in pad.nodes for each in node.publishers if each.topic_name == f'/left/{topic}')
        pad.until(publisher.get_subscription_count)
    pad.send(taxels(pressed((3, 7, 4, 4)), sec=101))
    pad.until(lambda: all(heard.values()))
    assert sorted(made) == ['colour_image', 'markers', 'value_image', 'wrench_message']
    for topic, messages in heard.items():
        header, = ((each.markers[0] if topic == 'markers' else each).header for each in messages)
        assert (header.frame_id, header.stamp.sec, header.stamp.nanosec) == ('left_pad', 101, 250_000_000)


@pytest.mark.parametrize('reliability', [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_reliable_and_best_effort_viewers_are_served_and_an_old_picture_is_not_latched(ros, reliability):
    pad = Pad(ros, lossless=True)
    for topic, kind in VIEWS.items():
        offered, = pad.peer.get_publishers_info_by_topic(f'/left/{topic}')
        assert offered.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert offered.qos_profile.durability == DurabilityPolicy.VOLATILE
        heard = []
        subscription = pad.peer.create_subscription(kind, topic, heard.append,
                                                    QoSProfile(depth=5, reliability=reliability))
        publisher, = (each for node in pad.nodes for each in node.publishers if each.topic_name == f'/left/{topic}')
        pad.until(publisher.get_subscription_count)
        pad.send(taxels(pressed((3, 7, 4, 4)), sec=200 + len(pad.shapes)))
        pad.until(lambda: heard)  # noqa: B023
        pad.peer.destroy_subscription(subscription)


# --- Files that users load

TOPICS = frame_topics(('left', 'right')) | {'/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
RVIZ_TYPES = {'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray',
              'rviz_default_plugins/Image': 'sensor_msgs/msg/Image'}


def field_type(kind: str, path: list[str]) -> str:
    """Return the type of a field in messages of ``kind``, where ``path`` lists the field names from the outside in."""
    for name in path:
        package, *_, message = kind.split('/')
        kind = getattr(importlib.import_module(f'{package}.msg'), message).get_fields_and_field_types()[name]
    return kind


def test_the_rviz_configuration_shows_topics_of_the_types_that_its_displays_take():
    view = yaml.safe_load((CONFIG / 'two_pads.rviz').read_text(encoding='utf-8'))['Visualization Manager']
    shown = {display['Topic']['Value']: display for display in view['Displays'] if 'Topic' in display}
    assert set(shown) == {f'/{pad}/{topic}' for pad in ('left', 'right') for topic in ('markers', 'image_colour')}
    for topic, display in shown.items():
        assert TOPICS[topic] == RVIZ_TYPES[display['Class']] and display['Enabled'] and display['Value']
        # A volatile publisher would send no earlier message even to a transient-local subscriber.
        assert display['Topic']['Durability Policy'] == 'Volatile'
    assert len({display['Name'] for display in view['Displays']}) == len(view['Displays'])
    assert view['Global Options']['Fixed Frame'] == 'gripper'


def test_the_foxglove_layout_shows_topics_and_fields_that_exist():
    layout = json.loads((CONFIG / 'two_pads_foxglove.json').read_text(encoding='utf-8'))
    panels, placed = layout['configById'], re.findall(r'"(\w+!\w+)"', json.dumps(layout['layout']))
    assert sorted(placed) == sorted(panels)
    for name, panel in panels.items():
        kind = name.split('!')[0]
        if kind == 'Plot':
            for path in panel['paths']:
                topic, *fields = path['value'].split('.')
                assert field_type(TOPICS[topic], fields) in ('double', 'float') and path['enabled']
                assert field_type(TOPICS[topic], ['header', 'stamp'])  # The plot uses the stamp in the header.
        elif kind == 'Image':
            assert TOPICS[panel['imageMode']['imageTopic']] == 'sensor_msgs/msg/Image'
        elif kind == '3D':
            # The topic belongs to one pad and uses its frame. Foxglove can therefore draw the topic without a known
            # transform.
            topic, = panel['topics']
            assert TOPICS[topic] == 'visualization_msgs/msg/MarkerArray' and panel['topics'][topic]['visible']
            assert panel['followTf'] == f'{topic.split("/")[1]}_pad'
        else:
            assert kind == 'DiagnosticSummary' and panel['topicToRender'] == '/diagnostics'
