"""Events of a contact are published in `<pad>/events`, in `shape` and in `grasp`.

A pad with stale data reports no events.
"""

import math

import lift_slower
import numpy as np
import pytest
from test_malformed_messages import good_shape
from test_stages import Pad

from tactile_node.grasp.gripper import Gripper
from tactile_node.grasp.opening import UNKNOWN_OPENING
from tactile_node.grasp.tracker import GraspTracker
from tactile_node.pose.events import Event, EventKind, Motion, Moving, Observable, SeenBy
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.grasp_messages import CurrentGrasp, grasp_message, side_result
from tactile_node.ros.message_age import age_message, age_seconds
from tactile_node.ros.motion_messages import check_contact_event, check_motion, motion_message
from tactile_node.ros.shape_messages import pad_shape_of
from tactile_node.ros.time_messages import time_message
from tactile_node.viewing.states import moving_words
from tactile_skin.msg import ContactEvent, ContactMotion

pytestmark = pytest.mark.ros

STAMP, PERIOD, AGE = 1.7e9, 0.05, 0.03
SLID = Event(EventKind.SLIDING, STAMP - 2.0, SeenBy.OUTLINE, 0.99, speed=0.01, direction=1.0)
SLIDING = Motion(Moving.SLIDING, 0.01, 1.0, math.nan, Observable.ALONG_X, (), SLID)
STOPPED = Motion(Moving.STILL, observable=Observable.ALONG_X, last_event=SLID)


class Held:
    """A grasp whose left contact moves as the test directs, while the right contact stays still."""

    def __init__(self):
        self.now, self._tracker = 100.0, GraspTracker()

    def grasp(self, seconds, motion=STOPPED, later=0.0):
        sides = [good_shape(), good_shape()]
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            for name, side, moves in zip(('left', 'right'), sides, (motion, Motion(Moving.STILL))):
                side.header.stamp = time_message(STAMP + self.now)
                side.motion = motion_message(moves, STAMP)
                self._tracker.update(name, side_result(pad_shape_of(side), self.now - AGE), self.now)
        self.now += later
        message = grasp_message(CurrentGrasp(self._tracker.state(self.now), [*map(pad_shape_of, sides)],
                                             UNKNOWN_OPENING, 'gripper', (AGE + later,) * 2, Gripper()))
        assert check_grasp(message) is None
        return message


def test_a_sliding_grasp_is_unstable_from_the_first_message_on():
    held = Held()
    assert held.grasp(3.0).stable
    message = held.grasp(PERIOD, SLIDING)
    assert not message.stable and message.motions[0].moving == ContactMotion.SLIDING
    assert message.motions[0].speed == pytest.approx(0.01) and message.motions[1].moving == ContactMotion.STILL


def test_a_grasp_that_a_load_shifts_is_unstable_until_it_rests():
    held = Held()
    shifting = SLIDING._replace(moving=Moving.SHIFTING)
    assert held.grasp(3.0).stable
    message = held.grasp(PERIOD, shifting)
    assert not message.stable and message.motions[0].moving == ContactMotion.SHIFTING
    assert message.motions[0].speed == pytest.approx(0.01)
    assert held.grasp(3.0).stable


def test_a_latched_event_is_distinguished_from_a_present_one():
    motion = Held().grasp(1.0).motions[0]
    assert motion.moving == ContactMotion.STILL and motion.last_event == ContactEvent.SLIDING
    assert age_seconds(motion.last_event_age) == pytest.approx(2.0 + AGE, abs=1e-6) and math.isnan(motion.speed)


def test_a_side_that_is_too_old_moves_in_no_known_way():
    motion = Held().grasp(1.0, SLIDING, later=1.0).motions[0]
    assert (motion.moving, motion.observable, motion.last_event) == (0, 0, 0)
    assert age_seconds(motion.last_event_age) == math.inf and check_motion(motion) is None


def test_events_are_published_once_by_the_classifier(ros):
    pad, heard = Pad(ros), []
    pad.peer.create_subscription(ContactEvent, 'events', heard.append, 10)
    pad.until(lambda: pad.peer.count_publishers('events') and pad.classifier.count_subscribers('events'))
    empty, pressed = np.zeros((16, 16)), np.zeros((16, 16))
    pressed[4:10, 3:9] = 50e3
    sent = [pad.send(frame) for frame in (empty, empty, pressed, pressed, empty, np.full((16, 16), np.nan))]
    pad.until(lambda: len(heard) == 2)
    pad.wait(0.1)
    assert [event.kind for event in heard] == [ContactEvent.MADE, ContactEvent.LOST]
    assert [event.sequence for event in heard] == [sent[2].shape.sequence, sent[4].shape.sequence]
    assert all(check_contact_event(event) is None for event in heard)
    assert heard[0].header == sent[2].shape.header and heard[0].age.sec == sent[2].shape.age.sec
    assert sent[3].shape.motion.last_event == ContactEvent.MADE and sent[5].shape.motion.moving == 0


def test_a_view_states_the_motion():
    assert moving_words(Moving.SLIDING | Moving.TURNING, 0.002, 0.5, EventKind.LIGHTER, 0.2) == \
        'sliding 2.0 mm/s, turning 29 deg/s, event: lighter 0.2 s ago'
    assert moving_words(Moving.SHIFTING, 0.002, math.nan, 0, math.inf) == 'shifting 2.0 mm/s'
    assert moving_words(Moving.STILL, math.nan, math.nan, EventKind.SLIDING, 60.0) == ''


class Peer:
    def create_subscription(self, *given):
        pass


def test_the_example_lifts_more_slowly_after_an_event():
    held = Held()
    limit = lift_slower.LiftSpeed(Peer(), ('left', 'right'), steady=lambda: held.now)
    assert limit.speed() == 0.0  # No grasp has been received yet.
    for _ in range(60):
        message = held.grasp(PERIOD)
        message.age = age_message(AGE)
        limit.on_grasp(message)
    assert limit.speed() == lift_slower.FULL / 2  # The pads could not observe a slide along y.
    limit.on_event(ContactEvent())
    assert limit.speed() == lift_slower.FULL / 2 and not limit.has_slid
    for _ in range(3):
        limit.on_event(ContactEvent(kind=ContactEvent.SLIDING, seen_by=ContactEvent.OUTLINE, probability=1.0))
    assert limit.speed() == pytest.approx(lift_slower.FULL / 8) and limit.has_slid
    held.now += 1.0
    assert limit.speed() == 0.0  # The last received grasp is too old.
