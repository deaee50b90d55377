"""Tests for a pad whose taxels form a DOMAIN that the driver reads by SDO.

The tests check the protocol byte by byte, the resulting frames, and a whole driver. The CRC-16/XMODEM of b'123456789'
is 0x31C3. Every catalogue of CRCs lists this check value, and CiA 301 specifies the same polynomial.
"""

from random import Random

import numpy as np
import pytest
from can_bench import Bench, Loss, only, tally, telling, tiny_layout
from test_logs import play

from tactile_node.assembly.domain_assembler import DomainAssembler
from tactile_node.assembly.facts import LossReason
from tactile_node.cia301.sdo import SdoUpload, UploadStep
from tactile_node.errors import ConfigurationError, DeviceError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.skin.layout_file import load_layout
from tactile_node.skin.pads import PadSettings
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelStatus

TINY = '''
rows: 3
cols: 3
pitch: 0.003
value: {unit: Pa, scale: 1.0, offset: 0, bits: 8}
domain: {object: 0x2400, sub: 1, bytes: 9, bit_step: 8}
'''
LAYOUT = 'domain16x10_16bit.yaml'
BEGIN, ANSWER, START = '> A4 00 24 01 7F 00 00 00', '< C6 00 24 01 09 00 00 00', '> A3 00 00 00 00 00 00 00'
SEGMENTS = '< 01 31 32 33 34 35 36 37', '< 82 38 39 00 00 00 00 00'
# The command byte 0xD5 states that the last segment has 5 unused bytes.
ACKNOWLEDGE, END = '> A2 02 7F 00 00 00 00 00', '< D5 C3 31 00 00 00 00 00'
BLOCK = (BEGIN, ANSWER, START, *SEGMENTS, ACKNOWLEDGE, END)
SEGMENTED = ('> 40 00 24 01 00 00 00 00', '< 41 00 24 01 09 00 00 00', '> 60 00 00 00 00 00 00 00',
             '< 00 31 32 33 34 35 36 37', '> 70 00 00 00 00 00 00 00', '< 1B 38 39 00 00 00 00 00')


def steps(upload, *frames):
    calls = {'>': upload.request, '<': upload.response}
    return [calls[frame[0]](bytes.fromhex(frame[1:])) for frame in frames]


def follow(*frames):
    upload = SdoUpload(0x2400, 1)
    return steps(upload, *frames)[-1], upload.data


@pytest.mark.parametrize('frames', [BLOCK, SEGMENTED], ids=('block', 'segmented'))
def test_upload_is_followed_to_its_end(frames):
    assert steps(SdoUpload(0x2400, 1), *frames) == [
        UploadStep.BEGUN, *[UploadStep.NOTHING] * (len(frames) - 2), UploadStep.DONE]
    assert follow(*frames) == (UploadStep.DONE, b'123456789')


def test_expedited_upload():
    assert follow(SEGMENTED[0], '< 4B 00 24 01 31 32 00 00') == (UploadStep.DONE, b'12')
    assert follow(SEGMENTED[0], '< 42 00 24 01 31 32 33 34') == (UploadStep.DONE, b'1234')


def test_segments_sent_again_count_once():
    again = (BEGIN, ANSWER, START, SEGMENTS[1], '> A2 00 7F 00 00 00 00 00', *SEGMENTS, ACKNOWLEDGE, END)
    assert follow(*again) == (UploadStep.DONE, b'123456789')
    partly = (BEGIN, ANSWER, START, *SEGMENTS, '> A2 01 7F 00 00 00 00 00', '< 81 38 39 00 00 00 00 00',
              '> A2 01 7F 00 00 00 00 00', END)
    assert follow(*partly) == (UploadStep.DONE, b'123456789')


@pytest.mark.parametrize('frames', [
    (*SEGMENTED[:4], SEGMENTED[3]),
    (*BLOCK[:-1], '< D5 C4 31 00 00 00 00 00'), (BEGIN, ANSWER, START, SEGMENTS[0], ACKNOWLEDGE),
    (BEGIN, '< 80 00 24 01 00 00 02 06'), (BEGIN, ANSWER, '> 80 00 24 01 00 00 04 05'),
    (BEGIN, '< C6 01 24 01 09 00 00 00'), (*SEGMENTED[:3], '< 00 31 32'), (BEGIN, ANSWER, '> 40 01 20 00 00 00 00 00')],
    ids=('segment doubled', 'wrong CRC',
         'lost in the log', 'aborted by the server', 'by the client', 'another object', 'short frame',
         'channel taken'))
def test_broken_uploads(frames):
    assert follow(*frames)[0] is UploadStep.BROKEN


def test_without_crc_none_is_checked():
    frames = [frame.replace('> A4', '> A0') for frame in BLOCK[:-1]]
    assert follow(*frames, '< D5 00 00 00 00 00 00 00') == (UploadStep.DONE, b'123456789')


def test_other_objects_are_not_ours():
    assert steps(SdoUpload(0x2400, 0), *BLOCK) == [UploadStep.NOTHING] * len(BLOCK)


def test_a_damaged_upload_never_yields_wrong_bytes():
    random = Random(11)
    for _ in range(3000):
        frames = [bytes.fromhex(frame[1:]) for frame in BLOCK]
        upload, given = SdoUpload(0x2400, 1), []
        for place in random.sample(range(len(frames)), 2):
            damage = random.choice(('lost', 'cut', 'doubled', 'bit'))
            frames[place] = {'lost': None, 'cut': frames[place][:random.randrange(8)], 'doubled': frames[place],
                             'bit': bytes([*frames[place][:7], frames[place][7] ^ 0x20])}[damage]
            if damage == 'bit':
                # The first byte of the first two frames stays intact, because its flags request the CRC.
                which = random.randrange(place < 2, 8)
                flip = 1 << random.randrange(8)
                frames[place] = bytes(b ^ flip * (i == which) for i, b in enumerate(frames[place]))
        for original, frame in zip(BLOCK, frames):
            if frame is not None:
                step = (upload.request if original[0] == '>' else upload.response)(frame)
                given += [upload.data] if step is UploadStep.DONE else []
        assert given in ([], [b'123456789'])


def domain_assembler(tmp_path, text=TINY, **options):
    layout = tiny_layout(tmp_path, text)
    return telling(DomainAssembler(layout, layout.domain, 5), **options)


@pytest.fixture
def assembler(tmp_path):
    return domain_assembler(tmp_path)


def feed(assembler, *frames, at=1.0):
    return only([assembler.feed({'>': 0x605, '<': 0x585}[frame[0]], bytes.fromhex(frame[1:]), at + i)
            for i, frame in enumerate(frames)][-1])


def test_an_upload_is_a_frame_stamped_with_its_request(assembler):
    frame = feed(assembler, *BLOCK)
    assert frame.values.tolist() == [[0x31, 0x32, 0x33], [0x34, 0x35, 0x36], [0x37, 0x38, 0x39]]
    assert (frame.stamp, frame.sequence, frame.missing_can_frames) == (1.0, 0, 0)
    assert feed(assembler, *BLOCK, at=10.0).sequence == 1
    assert tally(assembler) == (2, 0, 2, 2, 2, 0)


def test_a_failed_poll_is_a_frame_without_values(assembler):
    assert feed(assembler, *BLOCK[:-1], '< D5 00 00 00 00 00 00 00') == Loss(LossReason.BROKEN)
    frame = feed(assembler, BEGIN, at=20.0)
    assert np.isnan(frame.values).all() and (frame.status == TaxelStatus.STALE).all()
    assert (frame.stamp, frame.sequence, frame.missing_can_frames) == (1.0, 0, 1)
    unanswered = feed(assembler, BEGIN, at=30.0)
    assert (unanswered.stamp, unanswered.sequence) == (20.0, 1)
    counts = assembler.facts()
    assert (counts.frames_incomplete, counts.tpdos_expected, counts.tpdos_received, counts.tpdos_used) == (2, 2, 1, 0)
    assert counts.losses[LossReason.BROKEN] == 1


@pytest.mark.parametrize(('size', 'reason'), [(8, LossReason.OVER_LONG), (10, LossReason.SHORT)])
def test_wrong_sizes(tmp_path, size, reason):
    text = TINY.replace('bytes: 9', f'bytes: {size}').replace('rows: 3', 'rows: 2')
    assert feed(domain_assembler(tmp_path, text), *BLOCK) == Loss(reason)


@pytest.mark.parametrize('order', ['little', 'big'])
def test_fields_may_lie_across_any_bytes(tmp_path, order):
    """Fields of 12 bits begin at bit 3.

    The expected value of field k is cut from the whole object, read as a single number.
    """
    text = (TINY.replace('bits: 8', f'bits: 12, byte_order: {order}').replace('bytes: 9', 'bytes: 14')
            .replace('bit_step: 8', 'start_bit: 3, bit_step: 12').replace('rows: 3\n', 'rows: 3\n'))
    payload = np.random.default_rng(7).integers(0, 256, 14, dtype=np.uint8).tobytes()
    whole = int.from_bytes(payload, order)
    places = [3 + 12 * k for k in range(9)]
    shifts = places if order == 'little' else [8 * 14 - place - 12 for place in places]
    codec = TaxelCodec(tiny_layout(tmp_path, text))
    values, _ = codec.decode(payload, np.array([True]))
    assert values.ravel().tolist() == [whole >> shift & 0xFFF for shift in shifts]
    again, _ = codec.decode(codec.encode(values), np.array([True]))
    assert again.tolist() == values.tolist()


@pytest.mark.parametrize(('change', 'says'), [
    (('bytes: 9', 'bytes: 8'), 'within its 64 bits'), (('bit_step: 8', 'bit_step: 7'), 'do not overlap'),
    (('sub: 1', 'sub: 1, blocks: 3'), 'domain.blocks'), (('bytes: 9', 'bytes: 0'), 'domain.bytes'),
    (('domain:', 'nodes: 2\ndomain:'), 'single node'), (('domain:', 'tpdos: [{number: 1, cob_id: 0x181, '
     'map: [[0x2000, 1, 8]], taxels: [[0, 0, 0]]}]\ndomain:'), 'no "tpdos" beside the domain')])
def test_bad_layouts_are_refused(tmp_path, change, says):
    with pytest.raises(ConfigurationError, match=says):
        tiny_layout(tmp_path, TINY.replace(*change))


def moving():
    """Return a source whose samples all differ.

    The value is 10 * (taxel number + 7 * sample number) Pa.
    """
    samples = iter(range(10 ** 6))
    return lambda t: 10.0 * (np.arange(160).reshape(16, 10) + 7 * next(samples))


@pytest.mark.bus
@pytest.mark.parametrize('refuses_blocks', [False, True], ids=('block', 'segmented'))
def test_simulated_skin_end_to_end_and_its_log_again(tmp_path, refuses_blocks):
    log, live = tmp_path / 'session.log', []
    with Bench(f'domain{refuses_blocks}', LAYOUT, source=moving(), record=str(log)) as bench:
        bench.simulator.devices[32].refuses_blocks = refuses_blocks
        bench.run()
        live += bench.take_whole(5)
        assert any(('segmented' if refuses_blocks else 'by block') in sentence for sentence in bench.log.messages)
    firsts = [frame.values[0, 0] / 10 for _, frame in live]
    for (_, frame), first in zip(live, firsts):
        np.testing.assert_allclose(frame.values, 10 * (first + np.arange(160).reshape(16, 10)))
    assert np.all(np.diff(firsts) >= 7) and {first % 7 for first in firsts} == {0}
    replayed, _ = play(log, (PadSettings('pad32', (32,), load_layout(LAYOUT)),))
    values = [frame.values.tolist() for _, frame in replayed]
    assert all(frame.values.tolist() in values for _, frame in live)


@pytest.mark.bus
def test_our_own_requests_take_their_part_of_the_bus(tmp_path):
    """The recorded log must contain every frame that counts towards the load.

    ``bits`` maps the number of data bytes to the length of a frame with 11 identifier bits and the most stuff bits (ISO
    11898-1).
    """
    log, bits = tmp_path / 'session.log', {0: 55, 1: 65, 2: 75, 8: 135}
    with Bench('domain_load', LAYOUT, source=moving(), record=str(log)) as bench:
        bench.simulator.devices[32].refuses_blocks = True
        bench.supervise()
        bench.run()
        bench.take_whole(2)
        bench.driver.close()
        messages = list(CanLogReader(log))
    assert bench.driver.bus_monitor.bits == sum(bits[len(message.data)] for message in messages)
    assert sum(message.arbitration_id == 0x620 for message in messages) > 100


@pytest.mark.bus
def test_a_device_with_another_domain_is_refused(tmp_path):
    text = load_layout(LAYOUT).source
    wrong = tmp_path / 'wrong.yaml'
    wrong.write_text(open(text).read().replace('bytes: 320', 'bytes: 321'))
    (tmp_path / 'wrong.eds').write_text(open(text.replace('.yaml', '.eds')).read())
    with Bench('domain_size', LAYOUT):
        other = Bench('domain_size', str(wrong))
        other.driver.open()
        with pytest.raises(DeviceError, match='321 bytes, as in the layout; got 320 bytes|321.*320'):
            other.driver.configure()
        other.driver.close()
