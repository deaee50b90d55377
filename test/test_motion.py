"""Events of a contact in frames that are simulated with contact mechanics.

A slide and a turn must each be reported within the promised time. A steady hold, a load along the pad and a movement
that cannot be observed must cause no such report. `bench/bench_events.py` measures more cases of this kind.
"""

import os

import numpy as np
import pytest
from elastic_layer import ElasticLayer
from event_world import BEFORE, KINDS, PITCH, RATE, FingerSkin, Scene, followed, moved, shaken, slide, turn
from stuck_contact import PitchJoint

from bench.planner_world import FINE, ROWS, foundation, noisy
from tactile_node.pose.events import EventKind, Moving, Observable, SeenBy
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.shape.methods import make_recogniser
from training.ground_truth.seeds import Purpose, generator

#: Distance beyond the largest shift within which a slide must be reported [pitches].
PROMISED = {'outline': 0.4, 'centre of pressure': 0.8, 'on/off': 1.5}
SHIFT_PER_LOAD = 0.002  #: Parameter of the slides: half of it is the largest shift [m].
LARGEST_SHIFT = 0.5     #: Largest shift with this parameter [pitches].
SEED, LONG = 4_100, bool(os.environ.get('TACTILE_LONG'))
WHOLE = np.s_[6:12, 7:13]
TAXELS = Taxels(PITCH, 'Pa')


@pytest.fixture(scope='module')
def recogniser():
    return make_recogniser()


def events_of(frames):
    return [(frame, event) for frame in frames for event in frame.motion.events]


#: Each way of seeing a slide, each speed and each kind is tested once. With TACTILE_LONG, all combinations are tested.
SLIDES = [(way, speed, kind) for i, way in enumerate(PROMISED) for j, speed in enumerate((0.5, 10.0, 100.0))
          for k, kind in enumerate(('square', 'ball', 'right_triangle')) if LONG or i == j == k]


@pytest.mark.slow
@pytest.mark.parametrize(('way', 'speed', 'kind'), SLIDES)
def test_a_slide_is_reported_within_the_promised_distance_plus_one_frame(recogniser, way, speed, kind):
    rng = generator(Purpose.TEST, SEED)
    path, seconds = slide(rng, speed, LARGEST_SHIFT + PROMISED[way] + (0.7 if LONG or speed > 1 else 0.3))
    frames = Scene(rng, kind, way, dead=0.0).follow(recogniser, path, seconds, SHIFT_PER_LOAD)
    events = events_of(frames)
    frame, event = next(each for each in events if each[1].kind is EventKind.SLIDING)
    assert frame.time > BEFORE
    assert LARGEST_SHIFT < moved(frame.place) <= LARGEST_SHIFT + PROMISED[way] + speed * 1e-3 / PITCH / RATE + 1e-9
    assert {'outline': SeenBy.OUTLINE, 'centre of pressure': SeenBy.CENTRE_OF_PRESSURE,
            'on/off': SeenBy.ON_OFF}[way] is event.seen_by
    assert event.stamp == pytest.approx(1e3 + frame.time) and event.probability > 0.9
    sliding = [each for each in frames if each.motion.moving & Moving.SLIDING]
    way_x, way_y = frames[-1].place['dx'], frames[-1].place['dy']
    towards = np.cos([each.motion.direction - np.arctan2(way_y, way_x) for each in sliding])
    assert np.median(towards) > 0.8
    # A slow slide seems to stop between its steps.
    assert not {each.kind for _, each in events} - {EventKind.SLIDING, EventKind.SHIFTED}


@pytest.mark.slow
@pytest.mark.parametrize('speed', [20.0, pytest.param(2.0, marks=pytest.mark.long)])
def test_speed_is_that_of_the_slide_and_ends_with_it(recogniser, speed):
    rng = generator(Purpose.TEST, SEED + 1)
    path, seconds = slide(rng, speed, 4.0)
    frames = Scene(rng, 'square', dead=0.0).follow(recogniser, path, seconds + 0.5, SHIFT_PER_LOAD)
    under_way = [frame.motion for frame in frames if 1.0 < moved(frame.place) < 4.0]
    assert all(motion.moving & Moving.SLIDING for motion in under_way)
    assert np.median([motion.speed for motion in under_way]) == pytest.approx(speed * 1e-3, rel=0.25)
    assert frames[-1].motion.moving is Moving.STILL and np.isnan(frames[-1].motion.speed)
    # The last event lies in the past, and does not describe the present state.
    assert frames[-1].motion.last_event.kind is EventKind.SLIDING


@pytest.mark.slow
@pytest.mark.parametrize(('kind', 'speed'), [
    ('rectangle', 50.0), pytest.param('square', 2.0, marks=pytest.mark.long),
    pytest.param('isosceles_triangle', 2.0, marks=pytest.mark.long)])
def test_a_turn_is_reported(recogniser, kind, speed):
    rng = generator(Purpose.TEST, SEED + 2)
    scene = Scene(rng, kind, dead=0.0)
    path, seconds = turn(rng, speed, 1.5, scene.radius)
    frames = scene.follow(recogniser, path, seconds)
    frame, event = next(each for each in events_of(frames) if each[1].kind is EventKind.TURNING)
    assert BEFORE < frame.time and moved(frame.place, scene.radius) <= 0.3 + speed * 1e-3 / PITCH / RATE + 0.1
    rates = [each.motion.rate for each in frames if each.motion.moving & Moving.TURNING
             and moved(each.place, scene.radius) < 1.5]
    assert np.sign(np.median(rates)) == np.sign(frames[-1].place['turn'])


def test_a_fit_that_takes_another_side_for_the_base_is_no_turn(recogniser):
    """In one frame, the fit to a triangle with three nearly equal sides is turned by 120 degrees."""
    seen = Scene(generator(Purpose.TEST, SEED + 6), 'isosceles_triangle', dead=0.0).see(recogniser, lambda _: {}, 1.0)
    sight = seen[40].sight
    turned = sight._replace(fit=sight.fit._replace(angle=sight.fit.angle + 2 * np.pi / 3))
    seen[40] = seen[40]._replace(sight=turned)
    assert not events_of(followed(seen))


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['square', pytest.param('ball', marks=pytest.mark.long)])
def test_a_load_along_the_pad_shifts_the_contact_and_returns_it(recogniser, kind):
    """Half of the normal force along the pad, on a nearly incompressible skin of 3 mm, and then no load again."""
    skin = FingerSkin(ElasticLayer(0.003, 2e5, 0.49), PitchJoint())
    scene = Scene(generator(Purpose.TEST, SEED + 5), kind, dead=0.0, skin=skin)

    def path(time):
        return {'load': 0.5 * float(np.interp(time, (1.0, 1.3, 2.3, 2.6), (0, 1, 1, 0)))}
    frames = scene.follow(recogniser, path, 3.8)
    assert [event.kind for _, event in events_of(frames)] == [EventKind.SHIFTED, EventKind.RETURNED]
    shifting = [frame for frame in frames if frame.motion.moving & Moving.SHIFTING]
    assert 1.0 < shifting[0].time < 1.3
    towards = np.cos([frame.motion.direction - scene.direction for frame in shifting if frame.time < 1.3])
    assert np.median(towards) > 0.8
    assert all(frame.motion.moving is Moving.STILL for frame in frames if 2.0 < frame.time < 2.3 or frame.time > 3.5)


def states_of(steps, seconds=2.0):
    """Return the kinds of events of a contact that moves by ``steps`` [pitches] and rests after each step."""
    place, frames = 0.0, []
    for step in (0.0, *steps):
        place += step
        frames += [pressed(level=50e3, along=place)] * round(seconds * RATE)
    return kinds_of(motions(frames))


def test_shifts_add_up_to_a_slide():
    """A contact of 6 taxels may shift by 0.9 pitches. Two steps of 0.8 pitches in one direction are a slide."""
    assert states_of([0.8, -0.8, 0.8]) == ['SHIFTED', 'RETURNED', 'SHIFTED']
    assert states_of([0.8, 0.8]) == ['SHIFTED', 'SLIDING']
    assert states_of([3.0, -0.8]) == ['SLIDING', 'SHIFTED']  # The contact rests at another position after a slide.


#: Each way of seeing a slide is tested on a shaken hand, which causes more reports than a quiet hold. With
#: TACTILE_LONG, quiet holds are tested too, with all kinds and for a longer time.
HOLDS = [(way, is_shaken, KINDS if LONG else [('square', 'ball')[i % 2]])
         for is_shaken in ((False, True) if LONG else (True,)) for i, way in enumerate(PROMISED)]


@pytest.mark.slow
@pytest.mark.parametrize(('way', 'is_shaken', 'kinds'), HOLDS)
def test_a_hold_is_still(recogniser, way, is_shaken, kinds):
    """A shaken hold may cause one report per minute.

    A quiet hold, and a shaken hold of 3 s, must cause no report.
    """
    reports = []
    for number, kind in enumerate(kinds):
        rng = generator(Purpose.TEST, SEED + 10 + number)
        path = shaken(rng) if is_shaken else lambda _: {}
        reports += events_of(Scene(rng, kind, way).follow(recogniser, path, 6.0 if LONG else 3.0))
    assert len(reports) <= (is_shaken and LONG), reports


@pytest.mark.slow
@pytest.mark.parametrize('slope', [0.15, pytest.param(0.05, marks=pytest.mark.long)])
def test_an_oblique_face_that_is_pressed_harder_does_not_slide(recogniser, slope):
    """The contact grows from one edge while the gripper closes from 0.2 N to 5 N. The force is then held constant."""
    steps = (np.arange(ROWS * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid(steps - 7.3, steps - 7.8)
    height = np.where(np.maximum(abs(x), abs(y)) < 4, slope * PITCH * x, -np.inf)
    forces = np.concatenate((np.geomspace(0.2, 5.0, 75), np.full(60, 5.0)))
    rng, pipeline = generator(Purpose.TEST, SEED + 4), ContactPipeline(recogniser)
    found = [pipeline.follow(noisy(foundation(height, force)[0], rng), TAXELS, 100 + number / RATE).motion
             for number, force in enumerate(forces)]
    assert 'SLIDING' not in kinds_of(found)
    assert found[-1].moving is Moving.STILL
    # The pipeline does not promise to report slides while the force grows.
    slides = Observable.ALONG_X | Observable.ALONG_Y
    assert np.mean([bool(motion.observable & slides) for motion in found[10:75]]) < 0.2
    assert found[-1].observable & slides == slides


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['square', pytest.param('ball', marks=pytest.mark.long)])
def test_a_slide_under_a_shaken_force_is_reported(recogniser, kind):
    rng = generator(Purpose.TEST, SEED + 5)
    path, seconds = slide(rng, 5.0, 2.5)
    shaking = shaken(rng)
    frames = Scene(rng, kind, dead=0.0).follow(recogniser, lambda time: path(time) | shaking(time), seconds)
    frame = next(frame for frame, event in events_of(frames) if event.kind is EventKind.SLIDING)
    assert 0 < moved(frame.place) < 1.5


def pressed(where=WHOLE, level=50e3, along=0.0):
    """Return a frame whose pressed taxels have moved by ``along`` columns."""
    values = np.zeros((18, 20))
    values[where] = level
    whole, part = divmod(along, 1)
    return (1 - part) * np.roll(values, int(whole), 1) + part * np.roll(values, int(whole) + 1, 1)


def motions(frames, period=0.02, pipeline=None, **marks):
    """Return the motion in each of the consecutive frames, where None marks a missing frame."""
    pipeline, found = pipeline or ContactPipeline(), []
    for number, values in enumerate(frames):
        if values is not None:
            found.append(pipeline.follow(values, TAXELS, 100 + period * number, **marks).motion)
    return found


def kinds_of(found):
    return [event.kind.name for motion in found for event in motion.events]


EMPTY, HIDDEN = np.zeros((18, 20)), np.full((18, 20), np.nan)


@pytest.mark.slow
def test_made_and_lost_are_between_frames_that_are_seen():
    assert kinds_of(motions([EMPTY] * 5 + [pressed()] * 20 + [EMPTY] * 3)) == ['MADE', 'LOST']
    # Without an earlier frame of an empty pad, no contact counts as made.
    assert kinds_of(motions([pressed()] * 20)) == []
    assert kinds_of(motions([pressed()] * 20 + [HIDDEN] * 40)) == []
    assert kinds_of(motions([pressed()] * 20 + [HIDDEN] * 3 + [pressed()] * 20)) == []
    assert kinds_of(motions([EMPTY] * 20 + [HIDDEN] * 3 + [EMPTY] * 20)) == []
    # The contact was lost while the pad was hidden.
    assert kinds_of(motions([pressed()] * 20 + [HIDDEN] * 3 + [EMPTY] * 3)) == ['LOST']
    # After 40 frames without a view of the pad, the earlier contact is forgotten.
    assert kinds_of(motions([pressed()] * 20 + [HIDDEN] * 40 + [EMPTY] * 3)) == []
    assert kinds_of(motions([pressed()] * 20 + [None] * 40 + [EMPTY] * 3)) == []


def test_the_motion_of_an_unseen_contact_is_not_known():
    found = motions([pressed()] * 20 + [HIDDEN] * 2)
    assert found[19].moving is Moving.STILL and found[20].moving is found[21].moving is Moving.NOT_KNOWN
    assert found[21].observable is Observable.NOTHING
    found = motions([pressed()] * 20 + [None] * 20 + [pressed()])
    assert found[-1].moving is Moving.NOT_KNOWN and found[-1].last_event is None


def slid_after(change, **settings):
    """Return how far a contact slides until it is reported, after its force has changed by a factor [pitches]."""
    levels = 50e3 * np.concatenate((np.ones(60), np.linspace(1, change, 25), np.full(35, change)))
    ways = np.concatenate((np.zeros(90), 0.1 * np.arange(1, 31)))
    found = motions([pressed(level=level, along=way) for level, way in zip(levels, ways)],
                    pipeline=ContactPipeline(**settings))
    return next(way for motion, way in zip(found, ways) if motion.moving & Moving.SLIDING)


def test_a_change_of_force_does_not_delay_the_report_of_a_slide():
    """The growth of a contact under 1.5 times the force is smaller than the largest shift.

    The growth under 1.2 times the force is smaller than the step of a movement.
    """
    assert slid_after(1.5) == slid_after(1 / 1.5) == slid_after(1.0)
    known = {'shift_per_load': SHIFT_PER_LOAD}
    assert slid_after(1.2, **known) == slid_after(1 / 1.2, **known) == slid_after(1.0, **known)


def test_force_by_steps():
    levels = [50e3] * 40 + [60e3] * 40 + [75e3] * 40 + [30e3] * 9
    found = motions([pressed(level=level) for level in levels])
    assert kinds_of(found) == ['HARDER', 'LIGHTER']
    harder, lighter = (event for motion in found for event in motion.events)
    assert (harder.force_before, harder.force) == pytest.approx((36 * 50e3 * PITCH**2, 36 * 75e3 * PITCH**2))
    assert (lighter.force_before, lighter.force) == pytest.approx((36 * 75e3 * PITCH**2, 36 * 30e3 * PITCH**2))


@pytest.mark.slow
def test_another_contact_and_lost_taxels_do_not_count_as_movement():
    # The second contact overlaps the first and is taken for the same contact.
    assert kinds_of(motions([pressed()] * 40 + [pressed(np.s_[6:12, 12:18])] * 40)) == ['SLIDING']
    # The second contact does not overlap the first and is taken for a different contact.
    assert kinds_of(motions([pressed()] * 40 + [pressed(np.s_[6:12, 14:20])] * 40)) == []
    lost = pressed()
    lost[8:10] = np.nan
    assert 'SLIDING' not in kinds_of(motions([pressed()] * 40 + [lost] * 40 + [pressed()] * 40))


def observable(where):
    return motions([pressed(where)] * 5)[-1].observable


def test_movements_that_cannot_be_seen_are_not_marked_as_observable():
    both = Observable.ALONG_X | Observable.ALONG_Y
    assert observable(WHOLE) & both == both
    assert observable(np.s_[7:11, :]) & both == Observable.ALONG_Y  # A bar crosses the pad.
    assert observable(np.s_[:, 7:11]) & both == Observable.ALONG_X
    assert observable(np.s_[7:11, 9:]) & both == both  # One end of the bar is visible.
    assert observable(np.s_[:, :]) == Observable.NOTHING  # The contact is larger than the pad.
    diagonal = np.abs(np.subtract.outer(np.arange(18), np.arange(20))) < 4
    assert observable(diagonal) & both == Observable.NOTHING


@pytest.mark.parametrize('kind', ['ball', 'square'])
def test_a_round_contact_shows_no_rotation(recogniser, kind):
    frames = Scene(generator(Purpose.TEST, SEED + 3), kind, dead=0.0).follow(recogniser, lambda _: {}, 0.5)
    assert bool(frames[-1].motion.observable & Observable.ROTATION) == (kind == 'square')


def test_restart_forgets():
    pipeline = ContactPipeline()
    for number in range(20):
        pipeline.follow(EMPTY, TAXELS, number / 50)
    pipeline.restart()
    assert pipeline.follow(pressed(), TAXELS, 0.42).motion.events == ()
