"""Tests for assessing recognition on a skin and for adapting the recogniser to that skin.

The tests check when an adaptation is kept, what an adaptation changes, and which programs load an adaptation.
"""

import json

import numpy as np
import pytest
from taught_cross import LOADS, third_of_background

from tactile_node import Recogniser, find_contact
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.cli.main import main
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.learning.assess import (
    LEAST_TOUCHES,
    Answers,
    LabelledTouch,
)
from tactile_node.learning.assess import assess as assess_with
from tactile_node.learning.skin_measures import measure_skin
from tactile_node.learning.taught_file import write_taught
from tactile_node.learning.touches import AnyTouchFinder, Touches, TouchFrame, Unused
from tactile_node.package_files import config_path
from tactile_node.shape.adaptation import ADAPTATION_VERSION, Adaptation, arrays_of
from tactile_node.shape.fusion import RecognitionFusion
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.shape.patch import make_patch
from tactile_node.shape.recogniser import OUTPUTS, ShapeRecogniser, geometry_of, read_arrays
from tactile_node.shape.recognition import SHAPES, Recognition, Shape, UnknownReason
from tactile_node.shape.support import SURE
from tactile_node.simulator.figures import Skin, named_silhouette, pressure_frame, random_figure
from tactile_node.simulator.world import random_contact
from training.ground_truth.seeds import Purpose, generator

SIDE = 16
FOREIGN = {name: named_silhouette(name) for name in ('cross', 'l', 't')}
# The gains of the taxels differ by a factor of up to 3.
GAINS = np.exp(generator(Purpose.TEST, 780_000).uniform(-0.5, 0.5, (SIDE, SIDE)) * np.log(3))
BLUR = 1.2  # This blur and the uneven gains make the recogniser overconfident.


def frame_of(name, rng, gains=GAINS, blur=BLUR):
    area = rng.uniform(30, 70)
    contact = (random_figure(rng, FOREIGN[name], area, SIDE, SIDE) if name in FOREIGN
               else random_contact(rng, name, area, SIDE, SIDE))
    return gains * pressure_frame(contact, rng, SIDE, SIDE, skin=Skin(blur=blur)) + 100 * rng.standard_normal(
        (SIDE, SIDE))


def label_of(name):
    return Shape.UNKNOWN if name in FOREIGN else Shape(name)


def frames_of(names, number, count=8, **skin):
    """Yield ``count`` touches of each object as pairs of object name and touch frame."""
    rng = generator(Purpose.TEST, 780_000 + number)
    for name in names:
        for _ in range(count):
            reading = frame_of(name, rng, **skin)
            pattern = find_contact(reading, 'Pa')
            yield name, TouchFrame(pattern.mask, pattern, reading)


def touches_of(names, number, count=8, **skin):
    return [LabelledTouch(label_of(name), frame.pattern) for name, frame in frames_of(names, number, count, **skin)]


EVERY = *(shape.value for shape in SHAPES), *FOREIGN


def assess(recogniser, touches):
    return assess_with(recogniser, touches, lambda kind: third_of_background())


@pytest.fixture(scope='module')
def base():
    return ShapeRecogniser.from_file(config_path('recogniser.npz'))


@pytest.fixture(scope='module')
def assessed(base):
    return assess(base, touches_of(EVERY, 1))


def answers_to(recogniser, touches):
    guard = VisibilityGuard(recogniser)
    return Answers([touch.label for touch in touches],
                   [guard.recognise(touch.pattern) for touch in touches])


def adapted(base, assessment):
    return base.adapted({assessment.kind: assessment.adaptation})


def sure_names(answers):
    return {(k, each.shape) for k, each in enumerate(answers.found)
            if each.confidence >= SURE and each.shape is not Shape.UNKNOWN}


def test_the_counts_are_those_of_a_list_made_up():
    def answer(shape, confidence):
        return Recognition.of({shape: confidence, Shape.RECTANGLE: 1 - confidence})
    answers = Answers(
        [Shape.CIRCLE, Shape.CIRCLE, Shape.CIRCLE, Shape.SQUARE, Shape.SQUARE, Shape.UNKNOWN, Shape.UNKNOWN],
        [answer(Shape.CIRCLE, 0.95), answer(Shape.CIRCLE, 0.6), answer(Shape.SQUARE, 0.9), answer(Shape.UNKNOWN, 0.8),
         answer(Shape.NONE, 1.0), answer(Shape.UNKNOWN, 0.99), answer(Shape.CIRCLE, 0.97)])
    assert answers.counts() == (7, 3, 2, 3, 2)
    assert answers.counts(Shape.CIRCLE) == (3, 2, 0, 2, 1)
    assert answers.counts(Shape.SQUARE) == (2, 0, 2, 0, 0)
    assert answers.counts(Shape.UNKNOWN) == (2, 1, 0, 1, 1)
    # The Brier score is 2 * 0.05² for answer 0 and 2 * 0.4² for answer 1. A wrong answer with a confidence of 1 scores
    # 2.
    assert answers.scores()[[0, 1, 4]] == pytest.approx([0.005, 0.32, 2.0])
    assert [(group.right.right, group.right.total) for group in answers.groups()] == [(0, 0), (1, 1), (0, 1), (2, 5)]


@pytest.fixture(scope='module')
def fresh_answers(base, assessed):
    """Return the answers before and after the adaptation to 128 touches that were not used in the assessment.

    The touches cover all eight objects on the assessed skin.
    """
    fresh = touches_of(EVERY, 3, count=16)
    return answers_to(base, fresh), answers_to(adapted(base, assessed), fresh)


@pytest.mark.slow
def test_an_overconfident_recogniser_improves_on_unseen_touches(fresh_answers):
    before, after = fresh_answers
    gained = before.scores() - after.scores()
    assert gained.mean() > 2 * gained.std() / np.sqrt(len(gained))
    assert after.counts().right >= before.counts().right
    assert after.counts().sure_and_wrong < before.counts().sure_and_wrong


@pytest.mark.slow
def test_the_gain_that_is_reported_is_that_of_fresh_touches(assessed, fresh_answers):
    """The touches used to fit an adaptation would overstate its improvement, so the test uses fresh touches."""
    before, after = fresh_answers
    low, high = assessed.improvement.interval
    assert low < (before.scores() - after.scores()).mean() < high


@pytest.mark.slow
def test_a_touch_is_answered_without_its_own_label(base):
    others = [*touches_of(('circle', 'square'), 13, count=7), *touches_of(FOREIGN, 14)]
    last, = touches_of(['circle'], 15, count=1)
    found = [assess(base, [*others, last._replace(label=label)]).after.found[-1]
             for label in (Shape.CIRCLE, Shape.SQUARE)]
    assert found[0] == found[1]


@pytest.mark.parametrize('touches', [
    pytest.param(touches_of(['square'], 5, count=LEAST_TOUCHES - 1), id='too few'),
    pytest.param([], id='none'),
])
def test_nothing_is_adapted_from_too_little(base, touches):
    found = assess(base, touches)
    assert found.adaptation is None and found.after is None
    assert found.before.counts().total == len(touches)


@pytest.mark.slow
def test_nothing_is_adapted_without_an_improvement(base):
    found = assess(base, touches_of(('circle', 'rectangle', 'right_triangle'), 6, gains=1.0, blur=0.0))
    assert found.before.counts().right == found.before.counts().total, 'the model is already good'
    assert found.after is not None and found.adaptation is None


@pytest.mark.slow
@pytest.mark.parametrize('touched', [
    {'square': 8}, {'square': 8, 'rectangle': 8}, {'right_triangle': 8, 'rectangle': 1}], ids=str)
def test_without_unknown_objects_the_touched_are_answered_better_and_no_further_name_is_sure(touched, base,
                                                                                            fresh_answers):
    """These touches do not show how the skin shows objects of other shapes."""
    touches = [touch for name, count in touched.items() for touch in touches_of([name], 7, count)]
    found = assess(base, touches)
    before, _ = fresh_answers
    after = answers_to(adapted(base, found), touches_of(EVERY, 3, count=16))
    own = [answers.counts(Shape(name)).right for answers in (before, after) for name in touched]
    assert sum(own[len(touched):]) > sum(own[:len(touched)])
    others_before, others_after = (answers.counts().right - sum(answers.counts(Shape(name)).right for name in touched)
                                   for answers in (before, after))
    assert others_after >= others_before - 11, 'less than a tenth of the 112 touches of other objects is lost'
    assert sure_names(after) <= sure_names(before)


@pytest.mark.slow
def test_an_adaptation_with_unknown_objects_may_make_names_sure(base, assessed, fresh_answers):
    before, after = fresh_answers
    assert assessed.adaptation.makes_sure
    assert sure_names(after) - sure_names(before)


def test_a_class_that_is_not_recognised_stays_out():
    """A taught shape without a head for on/off frames has the probability 0."""
    adaptation = Adaptation(1.0, np.array([0.0, 20.0]), np.zeros((1, 2)), True)
    assert adaptation.applied(np.array([[1.0, 0.0]]), np.ones((1, 1))).tolist() == [[1.0, 0.0]]


def test_touches_of_both_kinds_are_refused(base):
    on_off = find_contact(np.pad(np.ones((5, 5), bool), 5))
    with pytest.raises(InputError):
        assess(base, [*touches_of(['square'], 8), LabelledTouch(Shape.SQUARE, on_off)])


def test_contacts_of_too_few_taxels_are_counted_and_not_adapted_to(base):
    specks = [find_contact(np.pad(np.full((1, 3), 5e4), 6), 'Pa') for _ in range(LEAST_TOUCHES)]
    found = assess(base, [LabelledTouch(label, speck)
                          for label, speck in zip([Shape.CIRCLE, Shape.SQUARE] * LEAST_TOUCHES, specks)])
    assert found.before.counts().no_name == LEAST_TOUCHES and found.after is None


def test_a_file_without_a_touch_is_named(tmp_path, capsys):
    np.save(tmp_path / 'empty.npy', np.zeros((3, 16, 16)))
    at_edge = np.zeros((3, 16, 16))
    at_edge[:, :5, :5] = 50e3
    np.savez(tmp_path / 'edge.npz', values=at_edge, unit='Pa')
    files = [str(tmp_path / name) for name in ('empty.npy', 'edge.npz')]
    assert main(['assess', '--name', 'square', '--from', *files]) == 2
    printed = capsys.readouterr()
    assert f'square: {files[0]}: 0 touches, because no frame has a contact\n' in printed.err
    assert f'square: {files[1]}: 0 touches' in printed.err


def test_every_contact_counts_but_those_cut_by_the_edge():
    """`tactile teach` skips touches that show no shape, but an assessment counts the answers to these touches."""
    speck = np.pad(np.full((2, 2), 5e4), ((6, 8), (6, 8)))
    frames = [load * each for each in (speck, np.roll(speck, 5, 0) + np.roll(speck, -5, 0), np.roll(speck, -6, 0))
              for load in LOADS]
    finder = AnyTouchFinder('Pa')
    found = finder.find(np.array(frames))
    assert len(found.touches) == 2 and set(found.unused) == {Unused.AT_EDGE}
    assert found.touches[1].middle.pattern.contacts == 2


@pytest.mark.slow
def test_the_skin_is_measured():
    """Gains with a log-uniform distribution over a 3:1 range have a standard deviation of log(3) / sqrt(12) = 0.317."""
    skins = {'gains': 1.0, 'blur': 0.0}, {'blur': 0.0}, {'gains': 1.0, 'blur': 2.0}
    even, uneven, blurred = (measure_skin([frame for _, frame in frames_of(EVERY, 9, count=6, **skin)])
                             for skin in skins)
    assert uneven.gains == pytest.approx(0.317, rel=0.15) and even.gains < 0.05
    assert blurred.halo > 0.1 and abs(even.halo) < 0.01
    assert even.noise == pytest.approx(100 / 50e3, rel=0.3)


def test_the_level_at_rest_does_not_matter():
    frames = [frame for _, frame in frames_of(EVERY, 12, count=6)]
    higher = [frame._replace(reading=frame.reading + 2e4) for frame in frames]
    assert measure_skin(higher) == pytest.approx(measure_skin(frames))


def test_an_unknown_skin_is_reported_as_unknown():
    assert str(measure_skin([])).count('not known') == 3


BIASES = np.array([-0.4, 0.2, 0.0, 0.0, 0.0, 0.2])


@pytest.fixture(scope='module')
def arrays(base):
    patches = [make_patch(np.ones((5, 5)), np.ones((5, 5), bool))]
    width = base.embedding(patches, geometry_of(patches)).shape[1]
    adaptation = Adaptation(2.0, BIASES, np.zeros((width, len(OUTPUTS))), True)
    return read_arrays(config_path('recogniser.npz')) | arrays_of('graded', adaptation)


def test_library_command_and_classifier_load_the_file_and_answer_as_it_says(arrays, tmp_path, capsys):
    path, rng = tmp_path / 'skin.npz', generator(Purpose.TEST, 780_010)
    np.savez(path, **arrays)
    frames = [frame_of(name, rng) for name in EVERY]
    for name, frame in zip(EVERY, frames):
        np.save(tmp_path / f'{name}.npy', frame)
    assert main(['classify', *(str(tmp_path / f'{name}.npy') for name in EVERY), '--model', str(path)]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    base, of_library, of_node = Recogniser(), Recogniser(file=path), make_recogniser(file=str(path))
    compared = 0
    for frame, line in zip(frames, lines):
        contact = find_contact(frame, unit=None)
        before, after = base.recognise(contact), of_library.recognise(contact)
        assert of_node.recognise(contact) == after and line['probabilities'] == pytest.approx(
            {shape.value: p for shape, p in after.probabilities.items()})
        # The confidence of a doubtful answer is limited, so its probabilities cannot be compared.
        if {before.doubt, after.doubt} != {UnknownReason.NOT_UNKNOWN}:
            continue
        expected = {shape: max(before.probabilities[shape], 1e-6) ** 0.5 * np.exp(bias)
                    for shape, bias in zip(OUTPUTS, BIASES)}
        total = sum(expected.values())
        assert after.probabilities[Shape.CIRCLE] == pytest.approx(expected[Shape.CIRCLE] / total)
        assert after.probabilities[Shape.UNKNOWN] == pytest.approx(expected[Shape.UNKNOWN] / total)
        compared += 1
    assert compared >= 3


@pytest.mark.parametrize('taxels, is_sure', [(3, False), (8, True)])
def test_an_adaptation_makes_no_name_sure_that_the_taxels_do_not_support(taxels, is_sure, arrays, tmp_path):
    """A shape recognised from too few taxels stays uncertain, even with many agreeing frames or a large bias.

    A rectangle needs at least 9 taxels to be certain, so 2 x 3 taxels are too few.
    """
    biases = [50.0 * (shape is Shape.RECTANGLE) for shape in OUTPUTS]
    np.savez(tmp_path / 'skin.npz', **changed('biases', biases)(arrays))
    bar = find_contact(np.pad(np.linspace(5e4, 6e4, 2 * taxels).reshape(2, taxels), 8), 'Pa')
    found, fusion = make_recogniser(file=str(tmp_path / 'skin.npz')).recognise(bar), RecognitionFusion()
    fused = [fusion.update(0.1 * k, found).recognition for k in range(20)]
    for each in (found, fused[-1]):
        assert each.shape is Shape.RECTANGLE and (each.confidence >= SURE) is is_sure


def changed(name, value):
    return lambda arrays: arrays | {f'graded_skin_{name}': np.array(value)}


def without(name):
    return lambda arrays: {key: array for key, array in arrays.items() if key != f'graded_skin_{name}'}


HOSTILE = {
    'another version': changed('version', ADAPTATION_VERSION + 1), 'version of text': changed('version', 'one'),
    'no version': without('version'), 'no temperature': without('temperature'), 'no weights': without('weights'),
    'temperature 0': changed('temperature', 0.0), 'temperature below 0': changed('temperature', -1.0),
    'tiny temperature': changed('temperature', 1e-300), 'huge temperature': changed('temperature', 1e9),
    'temperature of text': changed('temperature', 'warm'),
    'two temperatures': changed('temperature', [1.0, 1.0]), 'NaN': changed('biases', [np.nan] * 6),
    'biases of other classes': changed('biases', [0.0] * 7), 'one bias': changed('biases', 0.0),
    'huge bias': changed('biases', [1e9] + [0.0] * 5), 'biases of text': changed('biases', ['a'] * 6),
    'weights of another network': changed('weights', np.zeros((7, 6))), 'sure by a number': changed('makes_sure', 1),
    'two permissions': changed('makes_sure', [True, True]),
}


@pytest.mark.parametrize('change', HOSTILE.values(), ids=HOSTILE)
def test_a_file_without_an_assessment_is_refused_with_our_error(arrays, change, tmp_path):
    np.savez(tmp_path / 'hostile.npz', **change(arrays))
    with pytest.raises(ConfigurationError):
        make_recogniser(file=str(tmp_path / 'hostile.npz'))


def test_shapes_taught_afterwards_leave_the_adaptation_out(arrays, tmp_path):
    """The biases of an adaptation no longer fit once the user has taught more shapes."""
    with (tmp_path / 'taught.npz').open('wb') as stream:
        write_taught(stream, arrays, [], {})
    assert not any('_skin_' in name for name in read_arrays(tmp_path / 'taught.npz'))


@pytest.fixture(scope='module')
def recordings(tmp_path_factory):
    """Record a time series of touches on the uneven skin, in one file for each object."""
    folder, rng = tmp_path_factory.mktemp('touches'), generator(Purpose.TEST, 780_011)
    for name in EVERY:
        touches = [frame_of(name, rng) for _ in range(8)]
        frames = [load * touch + 100 * rng.standard_normal((SIDE, SIDE)) for touch in touches for load in LOADS]
        np.save(folder / f'{name}.npy', frames)
    return folder


def words_of(recordings, *names):
    return ['assess', *(word for name in names for word in (
        '--name', label_of(name).value, '--from', str(recordings / f'{name}.npy')))]


@pytest.mark.slow
def test_the_command_reports_and_writes_a_file_that_changes_the_answers_and_is_not_adapted_again(recordings, capsys):
    """A second adaptation from the same touches improves too little to be kept."""
    output, picture = recordings / 'skin.npz', recordings / 'reliability.png'
    assert main([*words_of(recordings, *EVERY), '-o', str(output), '--picture', str(picture)]) == 0
    printed = capsys.readouterr().out
    assert 'kept, with temperature' in printed
    assert 'spread of the gains' in printed
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert main(['classify', str(recordings / 'l.npy'), '--model', str(output)]) == 0
    adapted = capsys.readouterr().out
    assert main(['classify', str(recordings / 'l.npy')]) == 0
    assert adapted != capsys.readouterr().out
    assert main([*words_of(recordings, *EVERY), '--model', str(output), '-o', str(recordings / 'twice.npz')]) == 1
    assert 'not kept' in capsys.readouterr().out and not (recordings / 'twice.npz').exists()


def test_live_touches_are_recorded_here_without_an_output(tmp_path, monkeypatch, capsys):
    touch, = find_touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('tactile_node.cli.touch_sources._guide',
                        lambda name, count, layout, frames, failures, finder: Touches([touch] * count, {}))
    monkeypatch.setattr(SkinBus, 'configure', lambda bus: None)
    monkeypatch.setattr(SkinBus, 'start', lambda bus: None)
    assert main(['assess', '--name', 'ball', '--touches', '3', '--interface', 'virtual', '--channel', 'assess']) == 0
    told = capsys.readouterr()
    assert (tmp_path / 'ball_touches.log').exists() and 'ball_touches.log' in told.err
    assert 'ball: 3 touches' in told.out and 'No adaptation was tried' in told.out


@pytest.mark.parametrize('command', ['assess', 'teach'])
def test_a_picture_of_another_format_is_refused_before_touches_are_taken(command, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr('tactile_node.cli.touch_sources._live_touches',
                        lambda *given: pytest.fail('touches were taken'))
    name = {'assess': 'circle', 'teach': 'coin'}[command]
    assert main([command, '--name', name, '-o', str(tmp_path / 'm.npz'), '--picture', str(tmp_path / 'p.xyz')]) == 2
    assert 'png' in capsys.readouterr().err


def find_touch():
    square = np.pad(np.full((6, 6), 5e4), 5)
    return AnyTouchFinder('Pa').find([load * square for load in LOADS]).touches


@pytest.mark.parametrize('name', ['cross', 'none', 'Circle', ''])
def test_the_command_refuses_a_name_that_the_model_does_not_know(name, recordings, capsys):
    assert main(['assess', '--name', name, '--from', str(recordings / 'circle.npy')]) == 2
    assert 'tactile teach' in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_knows_bars_and_balls(recordings, capsys):
    given = {'bar': 'rectangle', 'ball': 'circle'}
    assert main(['assess', *(word for alias, name in given.items() for word in (
        '--name', alias, '--from', str(recordings / f'{name}.npy')))]) == 0
    printed = capsys.readouterr().out
    assert all(f'  {name} ' in printed for name in given.values())


def test_frames_of_two_skins_are_refused(recordings):
    np.save(recordings / 'other.npy', np.pad(np.full((5, 5), 5e4), 5)[:, 1:])
    assert main(['assess', '--name', 'circle', '--from', str(recordings / 'circle.npy'), '--name', 'square', '--from',
                 str(recordings / 'other.npy')]) == 2
