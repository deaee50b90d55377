"""The results of the stages appear in the messages with the units and in the order that msg/ states."""

import math

import numpy as np
import pytest

from tactile_node.contact.pattern import ContactPattern
from tactile_node.grasp.gripper import Gripper
from tactile_node.grasp.opening import UNKNOWN_OPENING, GapSource, Opening
from tactile_node.grasp.tracker import GraspTracker, SideState
from tactile_node.helmholtz.features import Extremes, Features, Group, compute_features
from tactile_node.pose.events import Motion
from tactile_node.pose.pipeline import ContactPipeline, FoundContact, StreamedContact, Taxels
from tactile_node.ros import grasp_messages
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
from tactile_node.ros.grasp_messages import CurrentGrasp
from tactile_node.ros.message_age import InputAge, age_seconds
from tactile_node.ros.message_checks import check_contact_shape, check_taxel_array
from tactile_node.ros.shape_messages import PadShape, pad_shape_of, pose_message
from tactile_node.ros.time_messages import time_message
from tactile_node.shape.fusion import FusedRecognition
from tactile_node.shape.recognition import Recognition, Shape, TaughtShape
from tactile_node.skin.taxel_array import RejectReason
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, TpdoAges
from tactile_skin.msg import ContactShape, Grasp

pytestmark = pytest.mark.ros

PITCH = 0.002
TAXELS = Taxels(PITCH, 'Pa')
STAMP = 1_700_000_000.25


def taxels(values, missing=0):
    values = np.asarray(values, np.float32)
    status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
    frame = TaxelFrame(STAMP, 7, values, status, missing_can_frames=missing)
    return taxel_array_message(PadFrame.of(frame, TAXELS, 'left_pad'))


def test_ages_of_a_snapshot_arrive_in_the_order_of_its_tpdos():
    status = np.array([[1, 1], [2, 3]], np.uint8)
    ages = TpdoAges(np.array([0.25, 0.0, 1.5], np.float32), np.array([[1, 0], [2, 0]], np.uint16))
    frame = TaxelFrame(STAMP, 7, np.array([[1, 2], [np.nan, np.nan]], np.float32), status, 1, ages)
    message = taxel_array_message(PadFrame.of(frame, TAXELS, 'left_pad'))
    assert list(message.tpdo_ages) == [0.25, 0.0, 1.5] and list(message.taxel_tpdos) == [1, 0, 2, 0]
    assert check_taxel_array(message) is None
    assert list(taxels([[1.0]]).tpdo_ages) == list(taxels([[1.0]]).taxel_tpdos) == []


def block(rows, cols, value=50e3):
    """Return a pad of 16x16 taxels with a block of pressed taxels in the middle."""
    values = np.zeros((16, 16), np.float32)
    values[4:4 + rows, 3:3 + cols] = value
    return values


def features(values):
    message = taxels(values)
    pattern = ContactPattern.of(np.asarray(values) > 0, taxel_values(message))
    return features_message(PadContact(pad_frame_of(message), FoundContact.of(pattern, TAXELS)),
                            compute_features(pattern.mask, Group.ALL))


def contact(values):
    message = taxels(values)
    pattern = ContactPattern.of(np.asarray(values) > 0, taxel_values(message))
    return contact_message(PadContact(pad_frame_of(message), FoundContact.of(pattern, TAXELS)))


def shape(values, kind, solid_height=0.0):
    message = contact(values)
    received = pad_contact_of(message)
    found = received.found
    frame = Recognition.of({kind: 0.75, Shape.UNKNOWN: 0.25})
    fused = FusedRecognition(frame, STAMP - 1.5, 1.5, 30)
    result = StreamedContact(frame, fused, found.fit(kind), found, found.moments, Motion())
    return PadShape.of(received, result, 'learned', solid_height).message


def side_result(message, time):
    return grasp_messages.side_result(pad_shape_of(message), time)


def grasp_message(state, sides, *given):
    return grasp_messages.grasp_message(CurrentGrasp(state, [*map(pad_shape_of, sides)], *given))


def test_taxels_keep_values_nan_status_and_stamp():
    values = block(2, 3)
    values[0, 0] = np.nan
    message = taxels(values, missing=2)
    assert np.array_equal(taxel_values(message), values, equal_nan=True)
    assert message.status[0] == message.STALE and message.status[1] == message.VALID
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 250_000_000)
    assert (message.sequence, message.missing_can_frames, message.header.frame_id) == (7, 2, 'left_pad')


def features_of(message):
    """Return the features of ``message`` in the form of `compute_features`."""
    values, rotated = {'N': 0.0}, {}
    for feature in message.features:
        values[feature.name] = feature.value
        angles = [None if math.isnan(angle) else int(angle) for angle in (feature.min_angle, feature.max_angle)]
        rotated[feature.name] = Extremes(feature.min, feature.max, feature.dif, *angles)
    return Features(values, rotated)


def test_features_survive_the_message():
    values = block(3, 5)
    computed, received = compute_features(values > 0, Group.ALL), features_of(features(values))
    assert received.values == pytest.approx(dict(computed.values), nan_ok=True)
    for name, rotated in computed.rotated.items():
        assert received.rotated[name] == pytest.approx(rotated, nan_ok=True)


def test_an_empty_pad_has_no_features():
    message = features(np.zeros((16, 16), np.float32))
    assert not message.features and message.contacts == 0
    assert features_of(message).values['N'] == 0


@pytest.mark.parametrize('kind', (Shape.UNKNOWN, Shape.RECTANGLE))
def test_every_contact_has_its_least_rectangle_and_what_of_it_is_a_bound(kind):
    values = np.zeros((16, 16), np.float32)
    values[4:8, :9] = 50e3  # The contact reaches the edge of the pad.
    message = shape(values, kind)
    assert message.fit_valid == (kind is Shape.RECTANGLE) and not message.hollow
    assert list(message.dimension_is_bound) == ([True, False] if message.fit_valid else [])
    assert list(message.box_lengths) == pytest.approx([9 * PITCH, 4 * PITCH]) and message.box_angle == 0
    assert list(message.box_length_is_bound) == [True, False] and min(message.box_lengths_sd) > 0
    assert (message.box_centre.x, message.box_centre.y) == pytest.approx((4 * PITCH, 5.5 * PITCH))
    assert message.box_centre_sd > 0 and 0 < message.box_angle_sd < 0.46


def test_there_is_no_rectangle_without_a_contact():
    message = shape(np.zeros((16, 16), np.float32), Shape.NONE)
    assert np.isnan((*message.box_lengths, *message.box_lengths_sd, message.box_angle, message.box_centre.x)).all()


def test_no_solid_is_published_for_a_frame():
    values = np.zeros((16, 16), np.float32)
    values[3:12, 3:14] = 50e3
    assert shape(values, Shape.RECTANGLE, 0.02).solid.dimensions
    values[5:10, 5:12] = 0
    message = shape(values, Shape.RECTANGLE, 0.02)
    assert message.hollow and message.fit_valid and not message.solid.dimensions and not message.mesh.vertices


def test_shape_message_tells_a_rectangle_in_metres():
    message = shape(block(4, 9), Shape.RECTANGLE)
    assert message.shape == message.frame_shape == ContactShape.RECTANGLE
    assert message.class_name == message.frame_class_name == 'rectangle'
    assert message.confidence == pytest.approx(0.75)
    assert dict(zip(message.class_names, message.probabilities))['unknown'] == pytest.approx(0.25)
    assert (message.held.sec, message.held.nanosec, message.fused_frames) == (1, 500_000_000, 30)
    assert list(message.dimension_names) == ['long', 'short'] and message.symmetry == 2
    assert list(message.dimensions) == pytest.approx([9 * PITCH, 4 * PITCH], rel=0.02)
    # The contact covers columns 3 to 11 and rows 4 to 7. Its centre is the mean of these columns and rows.
    assert message.pose.pose.position.x == pytest.approx(7 * PITCH, abs=0.02 * PITCH)
    assert message.pose.pose.position.y == pytest.approx(5.5 * PITCH, abs=0.02 * PITCH)
    assert abs(message.pose.pose.orientation.z) < math.sin(math.radians(1) / 2)
    assert message.contact_area == pytest.approx(36 * PITCH**2)
    assert message.force == pytest.approx(36 * 50e3 * PITCH**2)
    assert message.centre_of_pressure.x == pytest.approx(7 * PITCH)
    assert message.principal_axis == pytest.approx(0)
    assert len(message.outline.points) == 4 and len(message.covariance) == 25
    assert pose_message(message).pose == message.pose


def test_solids_are_added_on_request():
    box = shape(block(4, 9), Shape.RECTANGLE, 0.01).solid
    assert box.type == box.BOX and list(box.dimensions) == pytest.approx([0.018, 0.008, 0.01], rel=0.02)
    assert not shape(block(4, 9), Shape.RECTANGLE).solid.dimensions
    values = np.zeros((16, 16), np.float32)
    for row in range(8):
        values[row + 3, 3:11 - row] = 50e3
    prism = shape(values, Shape.RIGHT_TRIANGLE, 0.01).mesh
    assert len(prism.vertices) == 6 and len(prism.triangles) == 8
    assert {vertex.z for vertex in prism.vertices} == {0.0, 0.01}


def test_without_a_shape_there_is_no_fit():
    message = shape(block(4, 9), Shape.UNKNOWN)
    assert not message.fit_valid and math.isnan(message.residual) and not message.dimensions


def test_a_taught_shape_is_other_with_its_name_and_has_no_pose():
    message = shape(block(4, 9), TaughtShape('plug'))
    assert message.shape == message.frame_shape == ContactShape.OTHER
    assert message.class_name == message.frame_class_name == 'plug'
    assert dict(zip(message.class_names, message.probabilities))['plug'] == pytest.approx(0.75)
    assert not message.fit_valid and math.isnan(message.pose.pose.position.x) and not message.dimensions
    assert message.centre_of_pressure.x == pytest.approx(7 * PITCH)
    assert check_contact_shape(message) is None


@pytest.mark.parametrize(('number', 'name'), [(ContactShape.OTHER, 'square'), (ContactShape.OTHER, 'unknown'),
                                              (ContactShape.SQUARE, 'plug')])
def test_a_number_and_a_name_that_contradict_each_other_are_rejected(number, name):
    message = shape(block(4, 9), TaughtShape('plug'))
    message.shape, message.class_name = number, name
    message.confidence = dict(zip(message.class_names, message.probabilities))[name]
    assert check_contact_shape(message) is RejectReason.INCONSISTENT


def grasp_of(left, right, opening=UNKNOWN_OPENING, ages=(0.1, 0.1)):
    """Return the grasp of two shapes that were acquired at the same time."""
    tracker = GraspTracker()
    tracker.update('left', side_result(left, 5.0), now=5.0)
    tracker.update('right', side_result(right, 5.0), now=5.0)
    return grasp_message(tracker.state(5.0, opening.gap), [left, right], opening, 'gripper', ages, Gripper())


@pytest.mark.parametrize(('right', 'same'), [('plug', True), ('socket', False)])
def test_two_taught_shapes_are_the_same_by_their_names_not_by_their_number(right, same):
    sides = [shape(block(6, 6), TaughtShape(name)) for name in ('plug', right)]
    grasp = grasp_of(*sides, Opening(0.04, GapSource.PARAMETER, 0.0))
    assert grasp.same_shape is same and check_grasp(grasp) is None
    named = (ContactShape.OTHER, 'plug') if same else (ContactShape.UNKNOWN, 'unknown')
    assert (grasp.shape, grasp.class_name) == named
    assert not grasp.dimensions and math.isnan(grasp.yaw)
    assert grasp.centre[0] == pytest.approx(sides[0].centre_of_pressure.x)


def test_two_pads_become_one_grasp():
    message = shape(block(6, 6), Shape.SQUARE)
    grasp = grasp_of(message, message, Opening(0.0, GapSource.JOINT_STATES, 0.25), (0.5, 0.4))
    assert grasp.age.nanosec == 500_000_000
    assert grasp.contact == Grasp.TWO_SIDED and grasp.fresh and grasp.same_shape and not grasp.stable
    assert grasp.header.frame_id == 'gripper' and grasp.header.stamp == message.header.stamp
    # By default, the right pad is rotated by pi about x, so the y of the right centre is mirrored.
    assert grasp.right_centre.x == pytest.approx(grasp.left_centre.x)
    assert grasp.right_centre.y == pytest.approx(-grasp.left_centre.y)
    assert grasp.width == pytest.approx(2 * grasp.left_centre.y)
    assert (grasp.gap, grasp.gap_source, grasp.gap_age.nanosec) == (0.0, Grasp.GAP_JOINT_STATES, 250_000_000)


def test_the_object_of_a_grasp_follows_from_both_pads():
    """Both pads see the same bar of 9 x 4 taxels, which the default pads mirror.

    Between the two pads, the object's y is 0.
    """
    side = shape(block(4, 9), Shape.RECTANGLE)
    side.force_sd, side.sequence, side.hidden_taxels, side.hidden_ring_taxels = 0.02, 7, 2, 3
    side.saturated_taxels, side.saturated_ring_taxels = 4, 1
    grasp = grasp_of(side, side)
    assert check_grasp(grasp) is None
    assert (grasp.shape, grasp.class_name) == (ContactShape.RECTANGLE, 'rectangle')
    # On each side, the probability that the shape is unknown is a quarter.
    assert grasp.confidence == pytest.approx(0.75 * 0.75)
    assert list(grasp.dimension_names) == ['long', 'short'] and not any(grasp.dimension_is_bound)
    assert list(grasp.dimensions) == pytest.approx([9 * PITCH, 4 * PITCH], rel=0.02)
    sds = dict(zip(side.parameter_names, side.standard_deviations))
    assert list(grasp.dimension_sds) == pytest.approx([sds['long'] / math.sqrt(2), sds['short'] / math.sqrt(2)])
    assert list(grasp.centre) == pytest.approx([7 * PITCH, 0.0], abs=0.02 * PITCH)
    assert grasp.centre_sd == pytest.approx(max(sds['x'], sds['y']) / math.sqrt(2))
    assert abs(grasp.yaw) < math.radians(1) and grasp.symmetry == 2
    assert grasp.yaw_sd == pytest.approx(sds['angle'] / math.sqrt(2))
    force = 36 * 50e3 * PITCH**2
    assert [*grasp.forces, grasp.grip_force, grasp.force_imbalance] == pytest.approx([force] * 3 + [0.0])
    assert grasp.grip_force_sd == pytest.approx(0.02 / math.sqrt(2))
    assert (list(grasp.sequences), list(grasp.confidences)) == ([7, 7], pytest.approx([0.75, 0.75]))
    assert (list(grasp.hidden_taxels), list(grasp.saturated_taxels)) == ([5, 5], [5, 5])
    assert list(grasp.pads_seen) == [True, True] and list(grasp.at_edge) == [False, False]


def test_the_deviation_of_the_grip_force_counts_all_contacts_of_a_pad():
    """Equally noisy taxels add their variances, so four times the area has twice the standard deviation."""
    left, right = shape(block(6, 6), Shape.SQUARE), shape(block(6, 6), Shape.SQUARE)
    left.force_sd = right.force_sd = 0.02
    left.contacts, left.others_present = 4, True
    left.contact_areas = 4 * list(left.contact_areas)
    grasp = grasp_of(left, right)
    assert check_contact_shape(left) is None
    assert grasp.grip_force_sd == pytest.approx(math.hypot(0.04, 0.02) / 2)


def test_every_contact_of_a_pad_has_the_pitch_of_the_pad():
    values = block(6, 6)
    values[13:16, 12:15] = 50e3
    values[14, 13] = np.nan
    pad_frame = pad_frame_of(taxels(values))
    pipeline = ContactPipeline()
    largest = pipeline.follow(values, TAXELS, STAMP)
    shapes = [PadShape.of(PadContact(pad_frame, largest.found), each, 'learned', 0.0)
              for each in pipeline.recognise_each(largest, STAMP, 2)]
    assert [each.taxels for each in shapes] == [36, 9]
    assert [each.pitch for each in shapes] == pytest.approx([PITCH, PITCH])


def test_the_sides_of_a_grasp_are_a_message_of_their_own():
    sides = [shape(block(4, 9), Shape.RECTANGLE), shape(block(6, 6), Shape.SQUARE)]
    sides[1].header.stamp.nanosec += 1
    state = GraspTracker().state(0.0)
    current = CurrentGrasp(state, [*map(pad_shape_of, sides)], UNKNOWN_OPENING, 'gripper', (0.3, 0.1), Gripper())
    message, grasp = grasp_messages.sides_message(current), grasp_messages.grasp_message(current)
    assert (message.header, message.age) == (grasp.header, grasp.age) and list(message.sides) == sides
    assert message.header.frame_id == 'gripper' and message.header.stamp == sides[0].header.stamp
    assert list(message.side_states) == list(grasp.side_states) == [Grasp.SIDE_NOT_KNOWN] * 2


@pytest.mark.parametrize('wrong', [{'standard_deviations': [0.0] * 5}, {'standard_deviations': [math.nan] * 5},
                                   {'parameter_names': ['a'] * 5}, {'dimension_names': [], 'dimensions': [],
                                                                    'dimension_is_bound': []}])
def test_a_fit_without_deviations_is_not_used_for_the_object(wrong):
    """The check of a shape message accepts these fits, but fits without standard deviations get no weight."""
    side = shape(block(4, 9), Shape.RECTANGLE)
    for name, value in wrong.items():
        setattr(side, name, value)
    assert check_contact_shape(side) is None and grasp_messages.face_of(pad_shape_of(side)).fit is None


@pytest.mark.parametrize('period', [0.02, 0.05, 0.2])
def test_a_receiver_of_grasps_knows_their_age_at_any_period(period):
    """The stamp and the age of a grasp must come from the same side.

    In an earlier version, the stamp and the age came from two sides that differed by a period, and a planner's estimate
    of the age never settled.
    """
    left, right = shape(block(6, 6), Shape.SQUARE), shape(block(6, 6), Shape.SQUARE)
    arrivals, now = {}, 50.0
    ages, tracker = InputAge(steady=lambda: now), GraspTracker()
    state = tracker.state(0.0)
    for k in range(100):
        for delay, pad in ((0.020, left), (0.023, right)):
            pad.header.stamp = time_message(1.7e9 + k * period)
            now = 50.0 + k * period + delay
            arrivals[id(pad)] = k * period
            if len(arrivals) == 2:
                since = [now - 50.0 - arrivals[id(side)] for side in (left, right)]
                found = ages.arrived(grasp_message(state, [left, right], UNKNOWN_OPENING, 'gripper', since, Gripper()))
    assert found.age_on_arrival == pytest.approx(0.023, abs=0.005)


def test_a_grasp_without_an_opening_has_no_width_and_marks_it_as_unknown():
    message = shape(block(6, 6), Shape.SQUARE)
    grasp = grasp_of(message, message, ages=(math.inf, math.inf))
    assert math.isinf(age_seconds(grasp.age))
    assert grasp.contact == Grasp.TWO_SIDED and grasp.fresh
    assert grasp.gap_source == Grasp.GAP_NOT_KNOWN and math.isinf(age_seconds(grasp.gap_age))
    places = [(place.x, place.y, place.z) for place in (grasp.left_centre, grasp.right_centre, grasp.midpoint)]
    assert np.isnan([grasp.gap, grasp.width, grasp.misalignment, grasp.axis.z, *np.ravel(places)]).all()
    assert math.isfinite(grasp.offset)


def test_one_touched_pad_gives_no_line():
    grasp = grasp_of(shape(block(6, 6), Shape.SQUARE), shape(np.zeros((16, 16), np.float32), Shape.NONE))
    assert grasp.contact == Grasp.ONE_SIDED and math.isnan(grasp.width) and math.isnan(grasp.midpoint.x)


# Tests of the state of a side, and of the reliability of its centre.

def dead(values, *taxels):
    for row, col in taxels:
        values[row, col] = np.nan
    return values


def bar():
    values = np.zeros((16, 16), np.float32)
    values[5:10, :] = 50e3
    return values


def rows_hidden():
    values = block(6, 6)
    values[:8] = np.nan
    return values


@pytest.mark.parametrize(('values', 'kind', 'state', 'hides_creep'), [
    (block(6, 6), Shape.SQUARE, SideState.TOUCHED, False),
    (block(6, 6), Shape.UNKNOWN, SideState.TOUCHED, False),
    (np.zeros((16, 16), np.float32), Shape.NONE, SideState.EMPTY, False),
    (dead(np.zeros((16, 16), np.float32), (3, 3), (9, 4)), Shape.NONE, SideState.EMPTY, False),
    (bar(), Shape.RECTANGLE, SideState.TOUCHED, True), (bar(), Shape.UNKNOWN, SideState.TOUCHED, True),
    (rows_hidden(), Shape.UNKNOWN, SideState.TOUCHED, True)],
    ids=['square', 'unknown', 'empty', 'empty with dead taxels', 'bar', 'unknown bar', 'half of it is hidden'])
def test_a_side_is_empty_only_if_seen_and_a_cut_contact_shows_no_creep(values, kind, state, hides_creep):
    result = side_result(shape(values, kind), 5.0)
    assert (result.state, result.hides_creep, result.time) == (state, hides_creep, 5.0)
    assert (result.centre is None) == (state is SideState.EMPTY)
    assert result.is_bound == hides_creep


@pytest.mark.parametrize('kind', (Shape.RECTANGLE, Shape.UNKNOWN))
def test_a_contact_at_the_edge_is_a_bound_for_a_grasp_even_if_its_force_is_exact(kind):
    """The object may extend beyond the finger.

    An object beyond the finger may have its centre elsewhere, and may creep along its own length.
    """
    message = shape(bar(), kind)
    assert message.at_edge and message.force_is_bound and message.centre_of_pressure_is_bound
    # The message has these values if the finger ends at the edge of the pad.
    message.force_is_bound = message.centre_of_pressure_is_bound = False
    assert side_result(message, 5.0).is_bound and side_result(message, 5.0).hides_creep


def test_a_dead_taxel_beside_a_contact_does_not_hide_its_creep():
    rows, cols = np.nonzero(block(6, 6))
    values = dead(block(6, 6), (rows.min() - 1, cols.min() + 2))
    message = shape(values, Shape.SQUARE)
    result = side_result(message, 5.0)
    assert not message.size_is_bound and message.hidden_ring_taxels == 1
    assert not result.hides_creep and not result.is_bound
    # The standard deviation already includes the force that one dead taxel may add, so the result is not a bound.
    assert not side_result(shape(values, Shape.UNKNOWN), 5.0).is_bound


def test_the_resolution_of_a_centre_is_that_of_its_source():
    values = block(6, 6)
    values[5, 4] *= 0.99  # With two different values, the contact counts as pressures and not as on/off.
    assert side_result(shape(values, Shape.SQUARE), 0.0).resolution == pytest.approx(0.1 * PITCH, rel=0.01)
    assert side_result(shape(values, Shape.UNKNOWN), 0.0).resolution == pytest.approx(0.5 * PITCH, rel=0.01)
    message = shape(values, Shape.SQUARE)
    message.force = math.nan  # On/off taxels have no force.
    assert side_result(message, 0.0).resolution == pytest.approx(PITCH, rel=0.01)
    message = shape(values, Shape.SQUARE)
    message.standard_deviations[0] = 0.5 * PITCH
    assert side_result(message, 0.0).resolution == pytest.approx(PITCH)


def test_hidden_taxels_that_could_hold_a_contact_are_not_empty():
    names = ['none', 'unknown']
    message = ContactShape(shape=ContactShape.UNKNOWN, class_name='unknown', unknown_reason=ContactShape.NOT_SEEN,
                           class_names=names, probabilities=[0.0, 1.0], frame_probabilities=[0.0, 1.0])
    assert side_result(message, 0.0).state is SideState.UNSEEN
    assert side_result(ContactShape(), 0.0).state is SideState.UNSEEN
    message.shape = ContactShape.NONE  # The shape NONE from an unseen pad does not prove that the pad is empty.
    assert side_result(message, 0.0).state is SideState.UNSEEN
