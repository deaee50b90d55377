"""Neither integers without a unit nor counts passed as pressures are silently taken for values in pascals."""

import json
import os

import numpy as np
import pytest

import tactile_node as tn
from tactile_node.cli.main import main
from tactile_node.contact.unit_scale import UnitScale

RNG = np.random.default_rng(27)
PRESSED = np.pad(np.ones((7, 7)), 5)
SQUARE = PRESSED + 0.1 * RNG.random(PRESSED.shape)  # The values vary slightly, like those of an A/D converter.
BYTES = np.rint(200 * SQUARE * PRESSED)
NOISE = RNG.normal(0, 1, (2000, 16, 16))
LONG = bool(os.environ.get('TACTILE_LONG'))
COUNTS = {'of a byte': BYTES, 'of a byte, integers': BYTES.astype(int), 'flat': 200 * PRESSED,
          'faint': BYTES // 8, 'most of the pad': BYTES[4:13, 4:13],
          'noisy': np.rint(BYTES + 2 * np.abs(NOISE[0].mean()) + np.abs(RNG.normal(0, 2, BYTES.shape))),
          'fractions of full scale': BYTES / 255, 'a taxel without value': np.where(np.eye(17), np.nan, BYTES)}
#: Values in pascals from pads that are idle or lightly touched.
PASCALS = {'nothing': np.zeros((16, 16)), 'quiet': NOISE[0], 'drift': np.linspace(0, 1500, 256).reshape(16, 16),
           'a light touch': 1500 * SQUARE * PRESSED + 0.5, 'steps of 25 Pa': 25 * np.rint(50 * SQUARE * PRESSED),
           'a warm place': 300 * SQUARE * PRESSED + np.resize(NOISE[1], PRESSED.shape), 'a fault': np.pad([[180.0]], 7),
           'a light touch in whole pascals': np.rint(900 * SQUARE * PRESSED)}


@pytest.mark.parametrize('kind', [np.uint8, np.int64, list, np.ma.masked_array])
def test_an_integer_array_needs_a_unit(kind):
    values = BYTES.astype(int).tolist() if kind is list else kind(BYTES.astype(int))
    for refused in (lambda: tn.find_contact(values), lambda: tn.ContactStream().update(values, 0.0)):
        with pytest.raises(tn.InputError) as error:
            refused()
        assert "unit='Pa'" in error.value.remedy and 'unit=None' in error.value.remedy
    for found in (tn.find_contact(values, unit=None), tn.find_contact(values, thresholds=tn.PressThresholds(100, 80)),
                  tn.ContactStream(unit=None).update(values, 0.0).found.pattern, tn.find_contact(PRESSED > 0)):
        assert found.mask.sum() == PRESSED.sum()
    assert tn.find_contact(np.asarray(values, int) * 300, unit='Pa').mask.sum() == PRESSED.sum()


@pytest.mark.parametrize('name', COUNTS)
def test_counts_passed_as_pascal_are_refused(name):
    stream = tn.ContactStream(unit='Pa')
    for refused in (lambda: tn.find_contact(COUNTS[name], unit='Pa'), *2 * [lambda: stream.update(COUNTS[name], 0.0)]):
        with pytest.raises(tn.InputError) as error:
            refused()
        assert 'no unit' in error.value.remedy
    assert tn.find_contact(COUNTS[name], unit=None).mask.sum() >= 40


@pytest.mark.parametrize('name', PASCALS)
def test_an_idle_or_lightly_touched_pad_in_pascal_is_not_refused(name):
    assert not tn.find_contact(PASCALS[name], unit='Pa').contacts
    assert not tn.ContactStream(unit='Pa').update(PASCALS[name], 0.0).found.pattern.contacts


@pytest.mark.parametrize('deviation', [0.3, 0.5, 1, 3, 40])
@pytest.mark.parametrize('clipped', [False, True])
@pytest.mark.parametrize('cols', [6, 16])
def test_no_noise_is_taken_for_counts(deviation, clipped, cols):
    for frame in np.rint(deviation * NOISE[:500 if LONG else 100, :, :cols]):
        assert UnitScale('Pa', most=1.0).doubt(np.maximum(frame, 0) if clipped else frame) is None


def test_the_command_and_nodes_doubt_counts_of_more_bits_that_the_library_lets_pass():
    of_12_bits = np.rint(1500 * SQUARE * PRESSED)
    assert UnitScale('Pa', most=1.0).doubt(of_12_bits) and not UnitScale('Pa').doubt(of_12_bits)
    assert UnitScale('N').doubt(1e-8 * BYTES)
    assert not any(UnitScale(unit, most=1.0).doubt(BYTES) for unit in (None, '1', 'N'))
    assert not UnitScale('Pa').doubt(BYTES > 0)


@pytest.mark.parametrize('options', [(), ('--fuse', '--period', '0.02')])
def test_the_command_warns_once_if_counts_are_given_as_pascal(tmp_path, capsys, options):
    path = str(tmp_path / 'frames.npy')
    np.save(path, np.array(3 * [BYTES]))
    found = {}
    for unit in ([], ['--unit', 'Pa']):
        assert main(['classify', path, *unit, *options]) == 0
        out, err = capsys.readouterr()
        found[len(unit)] = [json.loads(line)['shape'] for line in out.splitlines()], err.count('Give counts no unit')
    assert found == {0: (3 * ['square'], 0), 2: (3 * ['none'], 1)}
