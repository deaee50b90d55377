"""A resting contact must be distinguished from a creeping one, despite noise, steps and the errors of real fits.

`make misled` runs all combinations. `make test` uses one rate, one direction, and one shape for each kind of centre.
Each pair of values of pitch, noise, step and speed occurs in `make test`, but not every combination of all four.
"""

import os
from itertools import product

import numpy as np
import pytest

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import ConfigurationError
from tactile_node.grasp.steadiness import (
    FIT_RESOLUTION,
    PATTERN_RESOLUTION,
    PRESSURE_RESOLUTION,
    Steadiness,
    SteadinessSettings,
)
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.moments import contact_moments
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.ground_truth.seeds import Purpose, generator

CREEP, REST = 0.5e-3, 0.05e-3  # Speeds in m/s.
FRACTION = 0.1  # Resolution of a fit [pitches].
LONG = bool(os.environ.get('TACTILE_LONG'))
RATES = (20, 50, 100) if LONG else (50,)  # Rates in Hz.
PITCHES = (0.002, 0.005)  # m
NOISES = (0.0, 0.06)      # pitches
STEPS = (0.0, 0.1)        # pitches


def cases(*speeds):
    """Return a mark that runs a test with values of pitch, noise, step and speed.

    All combinations are used with TACTILE_LONG, and otherwise the half that contains each pair of values.
    """
    every = product(*map(enumerate, (PITCHES, NOISES, STEPS, speeds)))
    return pytest.mark.parametrize(('pitch', 'noise', 'step', 'speed'), [
        tuple(value for _, value in case) for case in every if LONG or sum(index for index, _ in case) % 2 == 0])


def path(speed, rate, duration, rng, noise=0.0, step=0.0, begin=0.0):
    """Return the times and the centres [m] of a contact that starts to creep at ``begin``.

    The measured centre changes in steps of ``step``.
    """
    times = np.arange(round(duration * rate)) / rate
    way = rng.uniform(0, 0.005) + speed * np.maximum(0, times - begin)
    way = np.floor(way / step) * step if step else way
    angle = rng.uniform(0, 2 * np.pi)
    return times, way[:, None] * (np.cos(angle), np.sin(angle)) + noise * rng.standard_normal((len(times), 2))


def rests(times, centres, resolution):
    steadiness = Steadiness()
    return np.array([steadiness.update(time, tuple(centre), resolution) for time, centre in zip(times, centres)])


@pytest.mark.parametrize('rate', RATES)
@cases(CREEP, 1e-3, 3e-3)
def test_a_steady_creep_never_rests(rate, pitch, noise, step, speed):
    rng = np.random.default_rng(1)
    for _ in range(2):
        times, centres = path(speed, rate, 12.0, rng, noise * pitch, step * pitch)
        assert not rests(times, centres, FRACTION * pitch).any()


@pytest.mark.slow
@pytest.mark.parametrize('rate', RATES)
@cases(0.0, REST)
def test_a_resting_contact_is_recognised_and_keeps_resting_for_a_minute(rate, pitch, noise, step, speed):
    """A resting contact must be recognised as resting within 1 s plus 0.7 s per mm of pitch.

    The tracker needs this time to distinguish rest from creep.
    """
    rng = np.random.default_rng(2)
    times, centres = path(speed, rate, 65.0, rng, noise * pitch, step * pitch)
    found = rests(times, centres, FRACTION * pitch)
    began = times[found.argmax()]
    assert found.any() and began < 1.0 + 700 * pitch
    assert found[times >= began].all()


@pytest.mark.parametrize('pitch', PITCHES)
@pytest.mark.parametrize('noise', NOISES)
def test_a_creep_after_a_rest_ends_it_before_two_tolerances(pitch, noise):
    rng = np.random.default_rng(3)
    for _ in range(3 if LONG else 1):
        times, centres = path(CREEP, 50, 40.0, rng, noise * pitch, begin=15.0)
        found = rests(times, centres, FRACTION * pitch)
        assert found[(times > 10) & (times < 15)].all()
        assert not found[times > 15 + 1.2e3 * pitch].any()


def test_wrong_settings_are_refused():
    for wrong in ({'max_creep': 0.0}, {'slip': np.nan}, {'max_creep': np.inf}):
        with pytest.raises(ConfigurationError):
            SteadinessSettings(**wrong)


# The centres in these tests are from real fits, whose errors are neither white nor known. Lengths are in pitches.

PAD, AREA = 28, 40.0
SKIN = Skin(blur=0.5, noise=0.02)


def measured(kind, contact, rng, extractor):
    """Return the measured centre of ``contact`` [pitches]."""
    if kind == 'pattern':
        values = contact.pattern(PAD, PAD).astype(float)
        mask = values > 0
    else:
        values = pressure_frame(contact, rng, PAD, PAD, skin=SKIN)
        mask = extractor.extract(values).mask
    if kind == 'fit':
        return fit_shape(values, mask, Shape(contact.shape)).centre
    return contact_moments(values, mask, 1.0, 'Pa').centre_of_pressure


def centres_of(kind, shape, direction, travelled, seed=0):
    rng = generator(Purpose.TEST, seed)
    # The contact starts in the middle, so it can travel by 6 pitches before it reaches the edge.
    begin = random_contact(rng, shape, AREA, PAD, PAD)
    extractor = PatternExtractor(PressThresholds(30e3, 24e3))
    places = [Contact(shape, begin.dimensions, begin.x + way * np.cos(direction), begin.y + way * np.sin(direction),
                      begin.angle) for way in travelled]
    return np.array([measured(kind, place, rng, extractor) for place in places])


#: Kind of centre, its resolution [pitches], the distance that the contact travels [pitches], and the shape that is used
#: without TACTILE_LONG.
CASES = [('fit', FIT_RESOLUTION, 1.5, 'right_triangle'), ('pressure', PRESSURE_RESOLUTION, 6.0, 'circle'),
         ('pattern', PATTERN_RESOLUTION, 6.0, 'right_triangle')]
RATE = 20  # Rate in Hz.


@pytest.mark.slow
@pytest.mark.parametrize(('kind', 'fraction', 'travel', 'shape'), [
    (kind, fraction, travel, shape) for kind, fraction, travel, short in CASES for shape in CLASSES
    if LONG or shape == short])
@pytest.mark.parametrize('direction', [0.5, 0.0] if LONG else [0.5])
def test_no_contact_that_creeps_rests(kind, fraction, travel, shape, direction):
    pitches = PITCHES if LONG else PITCHES[shape == 'circle':][:1]
    for pitch in pitches if kind != 'fit' else (0.003,):
        times = np.arange(0, travel * pitch / CREEP, 1 / RATE)
        centres = pitch * centres_of(kind, shape, direction, times * CREEP / pitch)
        assert not rests(times, centres, fraction * pitch).any(), pitch


@pytest.mark.parametrize('noise', NOISES)
def test_a_slip_ends_the_rest_at_once(noise):
    rng = np.random.default_rng(4)
    times, centres = path(0.0, 50, 10.0, rng, noise * 0.002)
    centres[300:] += (0.0015, 0.0)
    found = rests(times, centres, 0.0002)
    assert found[290:300].all() and not found[300:320].any() and found[-1]


def test_a_time_that_goes_back_starts_again():
    steadiness = Steadiness()
    for time in np.arange(0, 2, 0.02):
        resting = steadiness.update(time, (0.0, 0.0), 0.0002)
    assert resting and steadiness.since == 0.0
    assert not steadiness.update(1.0, (0.0, 0.0), 0.0002) and steadiness.since == 1.0
