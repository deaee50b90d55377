"""The sources of a viewer are topics, a bus, a log and a bag. Each source runs only while a viewer is connected."""

import time
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from test_topic_bag import EPOCH, TAXELS, bag, store, taxel_array
from viewed import NAN
from waiting import until

from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.open_bus import open_bus
from tactile_node.cli import view
from tactile_node.cli.main import main
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.logs.topic_bag import GRASP
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pads, with_dictionaries
from tactile_node.viewing.bus_source import BusSource
from tactile_node.viewing.recording_source import RecordingSource
from tactile_node.viewing.recordings import BagRecording, LogRecording
from tactile_node.viewing.timeline import Timeline

pytestmark = pytest.mark.bus
LAYOUT = 'sim16x16.yaml'
LOG = str(Path(__file__).with_name('data') / 'sim16x16_two_pads.log.gz')
BEGIN = 1700000002.0  # stamp of the first taxel frame in this log [s]; the last frame is 4.76 s later


def received(bus):
    return [message.arbitration_id for message in iter(lambda: bus.recv(0), None)]


@pytest.fixture
def skin(request):
    """Return the settings of a virtual bus named after this test.

    A square of 7 x 7 taxels touches the pad on this bus.
    """
    pads = with_dictionaries(make_pads([LAYOUT], [32], ['left']))
    taxels = np.zeros((16, 16))
    taxels[4:11, 4:11] = 50e3
    simulator = SkinSimulator(pads, {'left': lambda seconds: taxels})
    simulator.start('virtual', request.node.name)
    yield BusSettings('virtual', request.node.name), pads
    simulator.stop()


def test_a_bus_is_shown_while_somebody_looks_and_left_alone_after(skin):
    source = BusSource(*skin)
    source.check()
    assert source.store.shown().pads['left'] is None
    source.start()
    until(lambda: (seen := source.store.shown().pads['left']) is not None and seen.contact.shape == 'square')
    until(lambda: source.store.shown().bus is not None)
    seen = source.store.shown().pads['left']
    assert seen.contact.force == pytest.approx(49 * 50e3 * seen.pitch ** 2, rel=0.02)
    assert source.age(seen) < 5
    source.stop()
    assert source.store.shown().pads['left'] is None  # The next viewer must not see earlier data.
    with open_bus(skin[0].interface, skin[0].channel, 1_000_000) as other:
        time.sleep(0.3)
        heard = received(other)
    # SYNC and TPDOs have these COB-IDs (CiA 301).
    assert 0x80 not in heard and not any(0x180 <= can_id < 0x580 for can_id in heard)


def test_a_bus_that_another_master_runs_is_not_disturbed(skin):
    import can
    with open_bus(skin[0].interface, skin[0].channel, 1_000_000) as other:
        sync = other.send_periodic(can.Message(arbitration_id=0x80, is_extended_id=False), 0.02)
        with pytest.raises(BusError, match='another'):
            BusSource(*skin).check()
        sync.stop()
        sent = received(other)
    assert 0x000 not in sent and 0x620 not in sent  # NMT commands and SDO requests have these COB-IDs.


def test_a_device_that_is_gone_is_reported_on_the_page(skin):
    settings, pads = skin
    source = BusSource(BusSettings('virtual', settings.channel + '_other', boot_timeout=0.2), pads)
    source.start()
    until(lambda: source.store.shown().problem)
    assert 'node 32' in source.store.shown().problem
    source.stop()


def test_a_view_can_seek_in_a_log():
    """Seek in a log in which five shapes touch the pad one after the other, a circle first and then a square.

    At the end of the log, the pad is empty. The period of the frames is 0.04 s.
    """
    source = RecordingSource(LogRecording(LOG, make_pads([LAYOUT], [32], ['left'])))
    source.check()
    assert source.length == 0  # The source reads the log only once a viewer is connected.
    source.play(False)
    source.start()
    until(lambda: source.is_complete)
    assert source.store.shown().problem == ''
    assert source.length == pytest.approx(4.76)

    def shown(position):
        """Return the position of the frame that is shown, and the shape of the pad."""
        source.seek(position)
        until(lambda: (seen := source.store.shown().pads['left']) is not None and 0 <= source.age(seen) < 0.0401)
        seen = source.store.shown().pads['left']
        return seen.stamp - BEGIN, seen.contact.shape
    assert shown(4.76) == (pytest.approx(4.76), 'none')
    assert shown(1.5) == (pytest.approx(1.48), 'square')
    assert shown(0.62) == (pytest.approx(0.6), 'circle')
    source.close()


def test_a_gap_in_a_bag_is_not_shown_as_if_the_pad_were_read(tmp_path):
    """The frames have the stamps 1, 2, 3 and 60 s, and the expected values are worked out by hand."""
    times = (1, 2, 3, 60)
    bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), time)) for time in times])
    source = RecordingSource(BagRecording(str(tmp_path / 'bag')))
    source.play(False)
    source.start()
    until(lambda: source.is_complete)
    assert source.length == 59 and source.store.pads == ('left',)
    source.seek(30.0)
    until(lambda: (seen := source.store.shown().pads['left']) is not None and source.age(seen) == 28.0)
    seen = source.store.shown().pads['left']
    np.testing.assert_array_equal(seen.values, [[1, 2, NAN], [4, 5, 6]])
    source.seek(0.5)
    until(lambda: source.age(source.store.shown().pads['left']) == 0.5)
    source.close()


def bag_with_grasps(folder, topics=('/grasp',)):
    """Return a bag with taxels of 9.25 and 12.25 s, and with two grasps of 10 and 11 s, recorded 0.25 s later.

    The second grasp has a code that this version does not know.
    """
    types = store(Grasp='std_msgs/Header header\nuint8 contact\nbool fresh\nbool stable\n')
    kinds = types.types

    def grasp(time, *fields):
        stamp = kinds['builtin_interfaces/msg/Time'](EPOCH + time, 0)
        return kinds[GRASP](kinds['std_msgs/msg/Header'](stamp, ''), *fields)

    messages = [('/left/taxels', taxel_array(types, 9)), (topics[0], grasp(10, 4, True, False)),
                (topics[-1], grasp(11, 99, True, True)), ('/left/taxels', taxel_array(types, 12))]
    return str(bag(folder, messages, types=types, times=lambda k: EPOCH + 9.25 + k,
                   topics=(('/left/taxels', TAXELS), *((topic, GRASP) for topic in topics))))


def test_a_bag_has_its_grasp_with_an_age_at_each_time(tmp_path):
    timeline = Timeline()
    BagRecording(bag_with_grasps(tmp_path / 'bag')).read(timeline, Event())
    assert timeline.grasp(EPOCH + 10.125)[0] is None
    first, age = timeline.grasp(EPOCH + 11.0)
    assert (first.contact, first.is_fresh, first.is_stable, age) == ('two_sided', True, False, 1.0)
    second, age = timeline.grasp(EPOCH + 11.5)
    assert (second.contact, age) == ('not_known', 0.5)
    timeline.close()


def test_grasps_of_several_grippers_are_not_mixed(tmp_path):
    timeline = Timeline()
    BagRecording(bag_with_grasps(tmp_path / 'bag', ('/a/grasp', '/b/grasp'))).read(timeline, Event())
    assert timeline.grasp(EPOCH + 12)[0] is None
    timeline.close()


def test_the_grasp_at_the_position_is_shown(tmp_path):
    source = RecordingSource(BagRecording(bag_with_grasps(tmp_path / 'bag')))
    source.play(False)
    source.start()
    until(lambda: source.is_complete)
    source.seek(1.5)  # 10.75 s
    source.show()
    seen = source.store.shown().grasp
    assert seen.contact == 'two_sided' and seen.acquired <= time.monotonic() - 0.75
    source.seek(0.5)
    source.show()
    assert source.store.shown().grasp is None
    source.close()


def test_a_recording_that_is_not_readable_to_its_end_reports_this_and_ends(tmp_path):
    bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), 1))])
    recording = BagRecording(str(tmp_path / 'bag'))

    def full(timeline, is_stopping):
        raise OSError('No space left on device')
    recording.read = full
    source = RecordingSource(recording)
    source.start()
    until(lambda: source.is_complete)
    assert 'No space left' in source.store.shown().problem
    source.close()


INTERNAL = 'internal error: ZeroDivisionError: division by zero'


def test_a_bus_source_that_dies_says_why(skin, monkeypatch, caplog):
    source = BusSource(*skin)
    monkeypatch.setattr(source, '_follow', lambda *_: 1 / 0)
    source.start()
    until(lambda: source.store.shown().problem == INTERNAL, 60)
    source.stop()
    assert 'Traceback' in caplog.text


@pytest.mark.parametrize('method', ['read', 'show'])
def test_a_recording_whose_thread_dies_says_why_and_ends(method, tmp_path, monkeypatch, caplog, capsys):
    """One thread reads the recording, and another thread shows it."""
    bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), time)) for time in (1, 9999)])
    of = BagRecording if method == 'read' else RecordingSource
    monkeypatch.setattr(of, method, lambda *_: 1 / 0)
    assert main(['view', str(tmp_path / 'bag'), '--terminal']) == 0
    assert INTERNAL in capsys.readouterr().out and 'Traceback' in caplog.text


def test_pads_of_a_bag_can_be_chosen(tmp_path):
    topics = [(f'/{pad}/taxels', TAXELS) for pad in ('left', 'right')]
    bag(tmp_path / 'bag', [(topic, taxel_array(store(), 1)) for topic, _ in topics], topics=topics)
    assert BagRecording(str(tmp_path / 'bag')).pads == ('left', 'right')
    source = RecordingSource(BagRecording(str(tmp_path / 'bag'), ['right']))
    source.start()
    until(lambda: source.store.shown().pads['right'] is not None)
    assert source.store.pads == ('right',) and source.store.shown().problem == ''
    source.close()
    with pytest.raises(ConfigurationError):
        BagRecording(str(tmp_path / 'bag'), ['rihgt'])


def test_the_command_shows_a_bag_on_a_pipe(tmp_path, capsys):
    bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), time)) for time in (1, 2)])
    assert main(['view', str(tmp_path / 'bag'), '--terminal']) == 0
    assert 'left: ' in capsys.readouterr().out


@pytest.mark.parametrize('arguments, where', [
    (['no_such.log'], 'no_such.log'), (['x.log', '--interface', 'virtual'], '--interface'),
    (['--model', 'taught.npz'], '--model'), (['--full-scale', '0'], '--full-scale'),
    (['--interface', 'no_such_interface'], 'no_such_interface')])
def test_a_source_that_cannot_be_shown_is_an_error(arguments, where, capsys):
    assert main(['view', '--port', '0', *arguments]) == 2
    assert where in capsys.readouterr().err


BUS_OPTIONS = '--bitrate 125000 --node-id 64 --layout x.yaml --eds x.eds'.split()
WINDOW = '--start 3 --duration 9'.split()


@pytest.mark.parametrize(('source', 'options', 'ignored'), [
    ([], [*BUS_OPTIONS, '--any-device', *WINDOW], '--bitrate, --node-id, --layout, --eds, --any-device, --start, '
     '--duration'),
    (['--channel', 'can0'], ['--namespace', 'arm', *WINDOW], '--namespace, --start, --duration'),
    (['x.log'], ['--bitrate', '125000', '--namespace', 'arm'], '--namespace, --bitrate'),
    (['bag'], [*BUS_OPTIONS, '--channel', 'can0', '--any-device'], '--channel, --bitrate, --node-id, --layout, --eds, '
     '--any-device')])
def test_an_option_that_a_source_would_ignore_is_an_error(source, options, ignored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(view, '_serve', lambda *_: None)  # Without this replacement, the command would serve for ever.
    bag(tmp_path / 'bag', [('/left/taxels', taxel_array(store(), 1))])
    assert main(['view', '--port', '0', *source, *options]) == 2
    assert f'got {ignored}. ' in capsys.readouterr().err


def test_a_layout_that_does_not_fit_a_log_is_refused_before_the_log_is_shown(capsys):
    words = ['view', LOG, '--layout', 'sim8x8_16bit.yaml', '--terminal']
    assert main(words) == 2
    printed = capsys.readouterr()
    assert 'object 0x1018' in printed.err and not printed.out


def test_the_eds_of_a_log_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(view, '_serve', lambda *_: None)
    (tmp_path / 'can.log').write_text('(1.000000) can0 1A0#0000000000000000\n')
    assert main(['view', str(tmp_path / 'can.log'), '--eds', 'no_such.eds']) == 2
    assert 'no_such.eds' in capsys.readouterr().err
