"""The simulated wire in virtual time is compared with a separate model, and used with devices and the assembler."""

import math
import os

import numpy as np
import pytest
from wire import SYNC_ID, Node, carried, frame_seconds

from tactile_node.assembly.sync_assembler import SyncAssembler
from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.simulator.device import SimulatedDevice
from tactile_node.simulator.segment import Segment
from tactile_node.simulator.skin_simulator import WireNetwork, WireSettings
from tactile_node.simulator.wire import PEAK_WINDOW, Wire, WireRecord
from tactile_node.skin.pads import make_pad
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

LONG = bool(os.environ.get('TACTILE_LONG'))
START = CanFrame(0x000, bytes([1, 0]))


def answered(syncs, nodes) -> list[tuple[float, int]]:
    """Return the end time and the COB-ID of each TPDO that the nodes send.

    ``nodes`` behave like the nodes in test/wire.py and send on a Segment.
    """
    segment, ends = Segment(Wire()), []
    segment.on_carried = lambda frame: ends.append((frame.end, frame.frame.can_id))
    master = segment.join(lambda frame: None)
    for ready in syncs:
        master.put(ready, CanFrame(SYNC_ID))
    for node in nodes:
        _join(segment, node)
    segment.run(math.inf)
    return ends


def _join(segment: Segment, node: Node) -> None:
    numbers, last = iter(range(10**6)), [0.0]

    def answer(received) -> None:
        if received.frame.can_id != SYNC_ID:
            return
        number = next(numbers)
        if node.skips(number):
            return
        before = sender.skipped
        ready = max(received.end + node.delay(number), last[0])
        sender.put_sweep(ready, [CanFrame(can_id, bytes(node.size)) for can_id in node.can_ids], node.most_queued)
        last[0] = ready if sender.skipped == before else last[0]
    sender = segment.join(answer)


def advance(wire, until):
    return iter(lambda: wire.carry(until), None)


def random_world(seed: int) -> tuple[list[float], list[Node]]:
    """Return random SYNC times, and up to four nodes with COB-IDs in any order.

    The load of the bus is 40 to 130 %, with late SYNCs and omitted sweeps.
    """
    rng = np.random.default_rng(seed)
    ids = iter(rng.permutation(np.arange(0x101, 0x700)).tolist())
    nodes, seconds = [], frame_seconds(0)
    for _ in range(rng.integers(1, 5)):
        count, size = int(rng.integers(1, 20)), int(rng.integers(0, 9))
        delays, skipped = rng.uniform(0, 0.002, 200), set(np.flatnonzero(rng.random(200) < 0.05).tolist())
        nodes.append(Node([next(ids) for _ in range(count)], size, delays.__getitem__, skipped.__contains__,
                          int(rng.integers(1, 4))))
        seconds += count * frame_seconds(size)
    periods = seconds / rng.uniform(0.4, 1.3) * (1 + (rng.random(200) < 0.05) * rng.uniform(0, 1, 200))
    return np.cumsum(periods).tolist(), nodes


@pytest.mark.parametrize('seed', range(20 if LONG else 8))
def test_two_models_written_apart_agree_frame_by_frame(seed):
    syncs, nodes = random_world(seed)
    ours = answered(syncs, nodes)
    _, again = random_world(seed)  # The second model needs new nodes, because a Node remembers its earlier TPDOs.
    theirs = [(frame.end, frame.can_id) for frame in carried(syncs, again)]
    assert [can_id for _, can_id in ours] == [can_id for _, can_id in theirs]
    np.testing.assert_allclose([end for end, _ in ours], [end for end, _ in theirs], rtol=0, atol=1e-9)


class Skin:
    """Simulated devices on a segment, each with one 16x16 pad and configured by hand.

    The taxels read the number of the sweep.
    """

    def __init__(self, node_ids, **settings):
        self.settings = WireSettings(**{'jitter': 0.0} | settings)
        self.segment = Segment(Wire(self.settings.bitrate))
        self.segment.now = 0.0
        self.frames = []
        self.segment.on_carried = self.frames.append
        self.host = self.segment.join(lambda frame: None)
        self.networks = [WireNetwork(self.segment, self.settings, node_id) for node_id in node_ids]
        self.pads = [make_pad(f'pad{node_id}', node_id, 'sim16x16.yaml') for node_id in node_ids]
        self.sampled = [0] * len(node_ids)
        self.devices = [SimulatedDevice(network, pad.nodes[0], self._source(i), network.send_sweep)
                        for i, (network, pad) in enumerate(zip(self.networks, self.pads))]
        for i, device in enumerate(self.devices):
            device.boot()
            self._enable(node_ids[i], self.pads[i].layout)
        self.host.put(self.segment.now, START)
        self.segment.run(self.segment.now + 0.1)
        self.frames.clear()

    def _source(self, index):
        def sample(_time):
            self.sampled[index] += 1
            return np.full((16, 16), (self.sampled[index] % 250 + 1) * self.pads[index].layout.value.scale)
        return sample

    def _enable(self, node_id, layout):
        for number, tpdo in enumerate(layout.tpdos):
            cob_id = tpdo.cob_id.of(node_id).to_bytes(4, 'little')
            self.host.put(self.segment.now, CanFrame(0x600 + node_id, bytes([0x23, number, 0x18, 1]) + cob_id))
            self.segment.run(self.segment.now + 0.01)

    def can_ids(self):
        return [[tpdo.cob_id.of(pad.nodes[0].node_id) for tpdo in pad.layout.tpdos] for pad in self.pads]

    def play(self, syncs):
        for ready in syncs:
            self.host.put(ready, CanFrame(SYNC_ID))
        self.segment.run(syncs[-1] + 1.0)


@pytest.mark.parametrize('load', [0.7, 0.99, 1.2])
@pytest.mark.parametrize('node_ids', [(32,), (32, 64)])
def test_simulated_devices_keep_the_time_of_the_other_model(node_ids, load):
    skin = Skin(node_ids)
    period = (32 * len(node_ids) * frame_seconds(8) + frame_seconds(0)) / load
    syncs = (skin.segment.now + np.arange(60) * period).tolist()
    skin.play(syncs)
    nodes = [Node(can_ids, delay=lambda number: skin.settings.delay) for can_ids in skin.can_ids()]
    theirs = list(carried(syncs, nodes))
    assert [frame.frame.can_id for frame in skin.frames] == [frame.can_id for frame in theirs]
    np.testing.assert_allclose([frame.end for frame in skin.frames], [frame.end for frame in theirs], rtol=0, atol=1e-9)
    assert skin.sampled == [len(node.answered) for node in nodes]
    assert (load > 1) == any(len(node.answered) < 60 for node in nodes)


def test_the_frames_on_the_wire_are_assembled_in_virtual_time():
    """With the most stuff bits, two pads use 98 % of the wire's capacity.

    Each sweep must arrive complete, with the values of its own SYNC.
    """
    skin = Skin((32, 64))
    period = (64 * frame_seconds(8) + frame_seconds(0)) / 0.98
    skin.play((skin.segment.now + np.arange(100) * period).tolist())
    for pad, own in zip(skin.pads, skin.can_ids()):
        assembler, results, syncs = SyncAssembler(pad.layout, (pad.nodes[0].node_id,), one_clock=True), [], []
        for carried_frame in skin.frames:
            can_id, end = carried_frame.frame.can_id, carried_frame.end
            if can_id == SYNC_ID:
                syncs.append(end)
                results += assembler.sync(end)
            elif can_id in own:
                results += assembler.feed(can_id, carried_frame.frame.data, end)
        frames = [result for result in (*results, *assembler.end_period()) if isinstance(result, TaxelFrame)]
        whole = [frame for frame in frames if (frame.status == TaxelStatus.VALID).all()]
        assert len(syncs) == 100 and len(whole) >= 99
        for frame in whole:
            counts = np.round(frame.values / pad.layout.value.scale)
            assert (counts == syncs.index(frame.stamp) + 2).all()


def test_heartbeats_take_part_in_wire_time():
    skin = Skin((32,))
    # Request for a heartbeat every 100 ms.
    skin.host.put(skin.segment.now, CanFrame(0x620, bytes.fromhex('2B17100064000000')))
    begin = skin.segment.now
    skin.segment.run(begin + 10.05)
    beats = [frame for frame in skin.frames if frame.frame == CanFrame(0x720, b'\x05')]
    assert len(beats) == 101
    np.testing.assert_allclose(np.diff([frame.start for frame in beats]), 0.1, atol=1e-6)


def test_a_device_without_supply_leaves_its_sweep_unsent():
    skin = Skin((32,))
    skin.host.put(skin.segment.now, CanFrame(SYNC_ID))
    skin.segment.run(skin.segment.now + 0.002)
    sent = len(skin.frames)
    skin.devices[0].power_off()
    skin.segment.run(skin.segment.now + 1.0)
    assert 1 < sent < 33 and len(skin.frames) <= sent + 1  # The frame on the wire at that time is still counted.


def test_jitter_delays_each_answer_and_a_seed_repeats_it():
    def delays(seed):
        skin = Skin((32,), jitter=0.001, delay=0.0005, seed=seed)
        skin.play((skin.segment.now + np.arange(50) * 0.01).tolist())
        ends = [frame.end for frame in skin.frames if frame.frame.can_id == SYNC_ID]
        starts = [frame.start for frame in skin.frames if frame.frame.can_id == 0x1A0]
        return np.subtract(starts, ends)
    first = delays(1)
    assert first.min() >= 0.0005 - 1e-9 and 0.001 < first.max() <= 0.0015 + 1e-9
    assert (delays(1) == first).all() and (delays(2) != first).any()


def test_load_counts_every_frame_and_its_busiest_window():
    """The wire is busy for one millisecond in every two, and for the whole of the second window."""
    record = WireRecord(10.0)
    for k in range(500):
        is_peak = PEAK_WINDOW <= k * 0.002 < 2 * PEAK_WINDOW - 1e-9
        record.carried(10 + k * 0.002, 10 + k * 0.002 + (0.002 if is_peak else 0.001))
    assert record.load(11.0) == pytest.approx(0.55) and record.peak_load == pytest.approx(1.0)
    across = WireRecord(0.0)
    across.carried(0.06, 0.14)
    assert across.peak_load == pytest.approx(0.4)
    across.carried(0.14, 0.2)
    assert across.peak_load == pytest.approx(1.0)
    late = WireRecord(0.0)
    for i in range(1000):
        late.handed_over(0.000_01 * i + 0.000_005)
    assert late.late(0.5) == pytest.approx(0.005) and late.late(0.99) == pytest.approx(0.0099)
    assert late.late_max == pytest.approx(0.009_995)


def test_a_timer_takes_part_at_its_time():
    segment, order = Segment(Wire()), []
    segment.on_carried = lambda carried_frame: order.append(carried_frame.frame.can_id)
    busy, urgent = segment.join(lambda carried_frame: None), segment.join(lambda carried_frame: None)
    for _ in range(20):
        busy.put(0.0, CanFrame(0x700, bytes(8)))
    segment.at(2.5 * frame_seconds(8), lambda: urgent.put(segment.now, CanFrame(0x100)))
    segment.run(1.0)
    assert order.index(0x100) == 3


def test_a_queue_without_room_skips_whole_sweeps_and_takes_the_next():
    wire = Wire()
    sender = wire.join(limit=40)
    sweep = [CanFrame(0x181 + i) for i in range(16)]
    for _ in range(3):
        sender.put_sweep(0.0, sweep, most=9)
    for _ in range(10):
        sender.put(0.0, CanFrame(0x701))
    assert (sender.queued, sender.skipped, sender.refused) == (2, 1, 2)
    assert [frame.frame.can_id for frame in advance(wire, 1.0)] == [*range(0x181, 0x191)] * 2 + [0x701] * 8
    sender.put_sweep(1.0, sweep, most=1)
    assert sender.queued == 3 and len(list(advance(wire, 2.0))) == 16


def test_behind_a_gateway_several_hosts_arbitrate():
    """If the gateway sends by priority, a host with many frames does not delay the SYNC of another host."""
    for by_priority, place in ((True, 1), (False, 50)):
        wire = Wire()
        gateway = wire.join(by_priority=by_priority)
        for _ in range(50):
            gateway.put(0.0, CanFrame(0x0A0, bytes(8)))
        first = wire.carry(frame_seconds(8))
        gateway.put(frame_seconds(8) / 2, CanFrame(SYNC_ID))
        order = [first, *advance(wire, 1.0)]
        assert [frame.frame.can_id for frame in order].index(SYNC_ID) == place


def test_a_participant_that_fails_does_not_stop_the_wire(caplog):
    segment, received = Segment(Wire()), []

    def fail(carried_frame):
        raise ValueError('a malformed frame')
    segment.join(fail)
    segment.join(received.append)
    host = segment.join(lambda carried_frame: None)
    segment.at(0.5, lambda: fail(None))
    host.put(0.0, CanFrame(0x600, b'\x01'))
    host.put(0.6, CanFrame(0x601, b'\x01'))
    segment.run(1.0)
    assert [carried_frame.frame.can_id for carried_frame in received] == [0x600, 0x601] and len(caplog.records) == 3
