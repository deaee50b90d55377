"""Tests of ``tactile simulate``, ``record`` and ``replay``, alone and connected through a pseudo-terminal."""

import argparse
import os
import signal
import subprocess
import sys
from ctypes.util import find_library
from pathlib import Path
from types import SimpleNamespace

import can
import numpy as np
import pytest
from can_bench import Bench
from waiting import wait_until

from tactile_node.bus.open_bus import open_bus
from tactile_node.bus.skin_bus import BusSettings, SkinBus
from tactile_node.cli import record, replay, simulate
from tactile_node.cli.main import main
from tactile_node.errors import BusError, ConfigurationError, LogError, TactileError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.skin.pads import make_pad
from tactile_node.sources.log_source import UNREAD_EXIT

pytestmark = pytest.mark.bus

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / 'test' / 'data'
TACTILE = 'import sys; from tactile_node.cli.main import main; sys.exit(main())'


def run(module, *words):
    parser = argparse.ArgumentParser()
    module.add_options(parser)
    args = parser.parse_args([*map(str, words)])
    return module.run(args)


def spawn(*words):
    return subprocess.Popen([sys.executable, '-c', TACTILE, *map(str, words)], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_driver_and_skin_are_two_programs_joined_by_slcan(tmp_path):
    link, frames = tmp_path / 'skin', []
    skin = spawn('simulate', '--pty', '--link', link, '--node-id', 32, '--node-id', 64, '--shapes', 'square')
    try:
        port = skin.stdout.readline().split()[-1]
        assert port.startswith('/dev/pts/') and os.readlink(link) == port
        driver = SkinBus(BusSettings('slcan', port, sync_period=0.1),
                         (make_pad('left', 32, 'sim16x16.yaml'), make_pad('right', 64, 'sim16x16.yaml')),
                         lambda name, frame: frames.append((name, frame)))
        driver.open()
        driver.configure()
        driver.start()
        assert wait_until(lambda: all(sum(_whole_and_touched(f) for name, f in frames if name == pad) >= 3
                                      for pad in ('left', 'right')))
        driver.close()
    finally:
        skin.send_signal(signal.SIGTERM)
        assert skin.wait(60) == 0, skin.stderr.read()
    for name in ('left', 'right'):
        pad = driver.facts().pad(name)
        assert pad.tpdos_received == pad.tpdos_used + pad.tpdos_pending + sum(pad.losses.values())
    assert not link.is_symlink()


def _whole_and_touched(frame) -> bool:
    # A pad with a peak above 30 kPa counts as touched.
    return frame.missing_can_frames == 0 and frame.values.max() > 30e3


@pytest.mark.parametrize('suffix', ['.log', '.log.gz', '.mcap'])
def test_killed_recording_is_readable(tmp_path, suffix):
    """SIGKILL ends a process that is writing numbered frames to a log.

    The log must then contain all flushed frames in order, starting with frame 0.
    """
    log = tmp_path / f'x{suffix}'
    code = f'''
import can, itertools, time
from tactile_node.logs.log_writer import CanLogWriter
writer = CanLogWriter({str(log)!r})
for i in itertools.count():
    writer.write(can.Message(1.7e9 + i, 0x181, False, data=i.to_bytes(4, 'little'), channel=1))
    time.sleep(0.001)
'''
    process = subprocess.Popen([sys.executable, '-c', code], cwd=ROOT)
    # Count frames rather than seconds, because a busy machine flushes frames more slowly.
    assert wait_until(lambda: _count_readable(log) > 10)
    process.kill()
    process.wait()
    reader = CanLogReader(log)
    messages = list(reader)
    numbers = [int.from_bytes(message.data, 'little') for message in messages]
    assert numbers == list(range(len(numbers))) and len(numbers) > 10 and reader.unread <= 1
    assert messages[0].timestamp == pytest.approx(1.7e9, abs=0.001)


def _count_readable(log: Path) -> int:
    """Return the number of frames in a log that is still being written, or 0 while its header is incomplete."""
    try:
        return len(list(CanLogReader(log)))
    except LogError:
        return 0


def test_record_of_a_silent_bus_reports_it(tmp_path, capsys):
    assert run(record, '--interface', 'virtual', '--channel', 'nobody', '--duration', 0.2, tmp_path / 'x.log') == 1
    assert '0 CAN frames' in capsys.readouterr().out


def test_record_ends_with_one_error_if_the_adapter_is_unplugged(tmp_path, monkeypatch):
    def fails(*_):
        raise can.CanOperationError('unplugged')
    bus = SimpleNamespace(channel_info='slcan', recv=fails, shutdown=fails)
    monkeypatch.setattr(record, 'open_bus', lambda *_: bus)
    with pytest.raises(BusError, match='to continue receiving, got unplugged'):
        run(record, tmp_path / 'x.log')


def test_record_from_a_live_bus(tmp_path, capsys):
    log = tmp_path / 'x.log'
    with Bench('commands', sync_period=0.01) as bench:
        bench.run()
        assert run(record, '--interface', 'virtual', '--channel', 'commands', '--duration', 1.5, log) == 0
    ids = [message.arbitration_id for message in CanLogReader(log)]
    assert f'{len(ids)} CAN frames' in capsys.readouterr().out
    assert ids.count(0x080) > 10 and ids.count(0x1A0) > 10 and ids.count(0x720) > 0


def test_replay_writes_frames_and_the_fate_of_each_can_frame(tmp_path, capsys):
    output = tmp_path / 'frames.npz'
    assert run(replay, DATA / 'nus_ring_session.log.gz', '--layout', 'nus_sinapse_64x64.yaml', '--output',
               output) == 0
    frames = np.load(output)['values']
    assert frames.shape == (77, 64, 64) and frames.dtype == np.float32 and not np.isnan(frames).any()
    printed = capsys.readouterr().out
    assert '77 taxel frames, 77 complete, 0 incomplete' in printed
    assert '4928 expected, 0 brought no taxels; 4928 received: 4928 used' in printed


def test_replay_of_two_pads_writes_two_files(tmp_path):
    assert run(replay, DATA / 'sim16x16_two_pads.log.gz', '--node-id', 32, '--node-id', 64, '--output',
               tmp_path / 'x.npz') == 0
    left, right = (np.load(tmp_path / f'x_{pad}.npz')['values'] for pad in ('pad32', 'pad64'))
    np.testing.assert_array_equal(left, right[:, :, ::-1])


def test_node_ids_and_names_that_do_not_match_are_named_together(capsys):
    """Without --pads, two node-IDs are two pads."""
    log = str(DATA / 'sim16x16_two_pads.log.gz')
    assert main(['replay', log, '--node-id', '32,64', '--pads', 'left']) == 2
    printed = capsys.readouterr().err
    assert '--node-id, --pads: ' in printed and 'got node-IDs 32, 64 and the pads left.' in printed


@pytest.mark.parametrize(('node_ids', 'further'), [
    ('32', 'node 64 also sends all TPDOs of this layout. If it is a pad, give --node-id 32,64.'),
    ('64', 'give --node-id 64,32.'), ('32,64', '')])
def test_replay_names_a_pad_that_it_ignores(capsys, node_ids, further):
    assert run(replay, DATA / 'sim16x16_two_pads.log.gz', '--node-id', node_ids, '--duration', '3') == 0
    printed = capsys.readouterr().err
    assert further in printed and ('also sends' in printed) == bool(further)


def test_replay_calls_the_pads_as_it_is_told(tmp_path):
    log = DATA / 'sim16x16_two_pads.log.gz'
    assert run(replay, log, '--node-id', '32,64', '--pads', 'left,robot/right', '--output', tmp_path / 'x.npz') == 0
    assert [str(np.load(tmp_path / f'x_{name}.npz')['pad']) for name in ('left', 'robot_right')] == [
        'left', 'robot/right']


def session_as_asc(folder, *lines):
    """Write the session of the two pads as an ASC log, with ``lines`` inserted among its frames."""
    path = folder / 'session.asc'
    with can.Logger(str(path)) as writer:
        for message in CanLogReader(DATA / 'sim16x16_two_pads.log.gz'):
            message.channel = 0
            writer(message)
    recorded = path.read_text().splitlines()
    path.write_text('\n'.join([*recorded[:2000], *lines, *recorded[2000:]]) + '\n')
    return path


@pytest.mark.parametrize(('line', 'code'), [('   0.010000 CANFD   1 Statistic: D 10 R 0 XD 0', 0),
                                            ('   0.010000 1  1A0  Rx   d 8 00 11', UNREAD_EXIT)])
def test_replay_says_by_its_exit_code_that_a_line_could_not_be_read_and_writes_the_rest(tmp_path, capsys, line, code):
    assert run(replay, session_as_asc(tmp_path, line), '--output', tmp_path / 'x.npz') == code
    assert run(replay, DATA / 'sim16x16_two_pads.log.gz', '--output', tmp_path / 'whole.npz') == 0
    np.testing.assert_array_equal(*(np.load(tmp_path / name)['values'] for name in ('x.npz', 'whole.npz')))
    assert ('damaged line' in capsys.readouterr().err) == bool(code)


def test_replay_without_a_sync_fails(tmp_path, capsys):
    (tmp_path / 'x.log').write_text('(1.0) can0 1A0#0011223344556677\n')
    assert run(replay, tmp_path / 'x.log') == 1
    assert '0 taxel frames' in (printed := capsys.readouterr().out) and '1 before_first_sync' in printed


@pytest.mark.parametrize(('module', 'words', 'error'), [
    (replay, ('none.log',), LogError), (replay, (DATA / 'README.md',), LogError),
    (replay, (DATA / 'nus_ring_session.log.gz', '--layout', 'none.yaml'), ConfigurationError),
    (simulate, ('--interface', 'virtual', '--eds', DATA / 'README.md'), ConfigurationError),
    (simulate, ('--interface', 'virtual', '--node-id', '200'), ConfigurationError),
    (simulate, ('--interface', 'nonsense'), ConfigurationError),
    (record, ('--interface', 'nonsense', 'x.log'), ConfigurationError),
    (record, ('--interface', 'virtual', 'x.pdf'), LogError)])
def test_bad_input_is_one_of_our_errors(module, words, error):
    with pytest.raises(error):
        run(module, *words)


@pytest.mark.parametrize(('interface', 'channel', 'library', 'linux_driver'), [
    ('kvaser', '0', 'CANlib', 'kvaser_usb'), ('pcan', 'PCAN_USBBUS1', 'PCAN-Basic', 'peak_usb')])
def test_the_error_names_a_makers_missing_library_and_the_driver_that_needs_none(
        interface, channel, library, linux_driver):
    """For each adapter maker, python-can reports the missing library with a different error."""
    if find_library({'kvaser': 'canlib', 'pcan': 'pcanbasic'}[interface]):
        pytest.skip('it is installed here')
    with pytest.raises(BusError) as refused:
        open_bus(interface, channel, 1_000_000)
    assert refused.value.got == f'no library {library} of its maker'
    assert all(word in refused.value.remedy for word in (linux_driver, 'socketcan', 'docs/adapters.md'))


def test_an_error_of_the_makers_library_is_passed_on_with_the_workaround(monkeypatch):
    def refuses(**options):
        raise can.CanOperationError('Function canIoCtl failed - Error in parameter.')
    monkeypatch.setattr(can, 'Bus', refuses)
    with pytest.raises(BusError) as refused:
        open_bus('kvaser', '0', 1_000_000)
    assert 'canIoCtl failed' in refused.value.got and 'kvaser_usb' in refused.value.remedy
    assert '..' not in str(refused.value)


@pytest.mark.parametrize('words', [('--output', 'x.npy'), ('--output', '/nowhere/x.npz'), ('--node-id', '0'),
                                   ('--pads', 'left,right'), ('--pads', 'a b')])
def test_replay_refuses_before_it_plays(words):
    with pytest.raises(TactileError):
        run(replay, DATA / 'sim16x16_two_pads.log.gz', *words)


def test_a_link_replaces_links_only(tmp_path):
    precious, folder = tmp_path / 'precious.txt', tmp_path / 'folder'
    precious.write_text('kept')
    folder.mkdir()
    for link in (precious, folder, tmp_path / 'nowhere' / 'skin'):
        with pytest.raises(ConfigurationError):
            run(simulate, '--pty', '--link', link, '--duration', 0)
    assert precious.read_text() == 'kept'
    (tmp_path / 'skin').symlink_to(tmp_path / 'gone')
    assert run(simulate, '--pty', '--link', tmp_path / 'skin', '--duration', 0) == 0
