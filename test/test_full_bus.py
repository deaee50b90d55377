"""Sweeps at the limit of the wire, in virtual time: frames take their time, SYNC and TPDOs cross."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest
from wire import SYNC_ID, Node, carried, frame_seconds

from tactile_node.assembly.assembler import FrameAssembler
from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.skin.layout_file import load_layout

LOADS = (0.8, 0.9, 0.95, 0.98)
SWEEPS, EVENT = 600, 200  #: in a world; the number of the one to which something happens
CODES = 251               #: the TPDOs of a sweep hold its number modulo this, plus 1
BEHIND = 0.0006           #: s from the wire to the driver where SYNC is stamped by the host, and TPDOs as they come
HOST, WIRE = 'stamps of the host', 'stamps of the wire'


class Pad(NamedTuple):
    """A pad with its nodes and its assembler."""

    layout: str
    node_ids: tuple[int, ...]


class Seen(NamedTuple):
    """Of one pad: numbers of the sweeps that are whole, of those in which all nodes answered; frames that are wrong."""

    whole: list[int]
    answered: list[int]
    wrong: int


ONE, TWO_NODES = (Pad('sim16x16.yaml', (32,)),), (Pad('nodes2_12x8_12bit.yaml', (32, 35)),)
TWO = (Pad('sim16x16.yaml', (32,)), Pad('sim16x16.yaml', (64,)))


def period_at(load: float, pads: Sequence[Pad]) -> float:
    frames = sum(len(load_layout(pad.layout).tpdos) for pad in pads)
    return (frames * frame_seconds(8) + frame_seconds(0)) / load


def played(pads: Sequence[Pad], syncs: Sequence[float], clock: str, *, lost: float = 0.0, behind_by: float = 0.0,
           seed: int = 0, **of_nodes) -> list[Seen]:
    """Let the nodes answer ``syncs`` on one wire; what each pad's assembler makes of the frames that it receives.

    ``lost``: share of TPDOs that are not received; ``behind_by``: up to so much later than BEHIND [s].
    """
    rng = np.random.default_rng(seed)
    layouts = [load_layout(pad.layout) for pad in pads]
    nodes = [[Node([tpdo.cob_id.of(node_id) for tpdo in layout.tpdos if tpdo.node == place], **of_nodes)
              for place, node_id in enumerate(pad.node_ids)] for pad, layout in zip(pads, layouts)]
    received, last = [], 0.0
    for frame in carried(syncs, [node for own in nodes for node in own]):
        if frame.can_id == SYNC_ID:
            received.append((frame.end if clock == WIRE else frame.offered, frame))
        elif rng.random() >= lost:
            last = max(last, frame.end + (0.0 if clock == WIRE else BEHIND + rng.uniform(0, behind_by)))
            received.append((last, frame))
    received.sort(key=lambda item: item[0])
    return [_seen(pad, layout, own, received, clock) for pad, layout, own in zip(pads, layouts, nodes)]


def _seen(pad, layout, nodes, received, clock) -> Seen:
    assembler, stamps, frames = FrameAssembler(layout, pad.node_ids, one_clock=clock == WIRE), {}, []
    heads = {tpdo.cob_id.of(pad.node_ids[tpdo.node]): tpdo.length for tpdo in layout.tpdos}
    for stamp, frame in received:
        if frame.can_id == SYNC_ID:
            stamps[stamp] = frame.number
            frames += assembler.sync(stamp)
        elif frame.can_id in heads:
            frames += assembler.feed(frame.can_id, coded(frame.number, layout)[:heads[frame.can_id]], stamp)
    frames = [frame for frame in (*frames, *assembler.end_period()) if isinstance(frame, TaxelFrame)]
    whole, wrong = [], 0
    for frame in frames:
        number, valid = stamps[frame.stamp], frame.status != TaxelStatus.STALE
        counts = np.round(frame.values[valid] / layout.value.scale).astype(int) + layout.value.offset
        wrong += bool((counts != number % CODES + 1).any())
        whole += [number] if valid.all() else []
    answered = set.intersection(*(set(node.answered) for node in nodes))
    return Seen(whole, sorted(answered), wrong)


def rising(times: np.ndarray) -> np.ndarray:
    """No time twice: a SYNC has its own stamp."""
    return np.maximum.accumulate(times) + 1e-9 * np.arange(len(times))


def coded(number: int, layout) -> bytes:
    """Eight bytes of which every taxel of these layouts reads ``number`` modulo CODES, plus 1."""
    code, bits = number % CODES + 1, layout.value.bits
    if layout.value.byte_order == 'little':
        word = sum(code << place for place in range(0, 64 - bits + 1, bits))
        return word.to_bytes(8, 'little')
    word = sum(code << 64 - bits - place for place in range(0, 64 - bits + 1, bits))
    return word.to_bytes(8, 'big')


@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('pads', [ONE, TWO, TWO_NODES], ids=['one pad', 'two pads', 'a pad of two nodes'])
@pytest.mark.parametrize('load', LOADS)
def test_what_the_device_sent_whole_arrives_whole(load, pads, clock):
    """Above 94 % (90 % with slcan) the end of each sweep crosses the next SYNC: 1 frame in 1,000 was whole."""
    for seen in played(pads, np.arange(SWEEPS) * period_at(load, pads), clock, behind_by=0.0005):
        assert not seen.wrong and len(seen.answered) == SWEEPS
        assert len(seen.whole) >= SWEEPS - 1  # the end of the last one comes when nothing proves it


@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('load', LOADS)
def test_a_sync_late_by_half_a_period_or_jitter_costs_nothing(load, clock):
    period = period_at(load, ONE)
    rng = np.random.default_rng(7)
    late, shaken = np.arange(SWEEPS) * period, np.arange(SWEEPS) * period + rng.uniform(-3e-4, 3e-4, SWEEPS)
    late[EVENT] += period / 2
    for syncs in (late, rising(shaken)):
        seen, = played(ONE, syncs, clock)
        assert not seen.wrong and len(seen.whole) >= SWEEPS - 1


@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('load', LOADS)
def test_a_skipped_sweep_costs_at_most_four_frames(load, clock):
    """It, and those that could be it: CATCH_UP_PERIODS. Nothing proves that the node is not late."""
    seen, = played(ONE, np.arange(SWEEPS) * period_at(load, ONE), clock, skips=lambda number: number == EVENT)
    assert not seen.wrong and len(seen.answered) == SWEEPS - 1 and len(seen.whole) >= SWEEPS - 5


@pytest.mark.parametrize('clock', [HOST, WIRE])
def test_after_an_overload_sweeps_are_whole_again(clock):
    """101 % for 300 periods. Meanwhile a node may be late for more periods than can be detected (see assembler.py)."""
    loads = np.concatenate((np.full(100, 0.8), np.full(300, 1.01), np.full(200, 0.8)))
    syncs = np.concatenate(([0.0], np.cumsum([period_at(load, ONE) for load in loads])[:-1]))
    seen, = played(ONE, syncs, clock)
    assert set(range(410, 599)) <= set(seen.whole)
    before, = played(ONE, syncs[:100], clock)
    assert not before.wrong and len(seen.whole) > 500


@pytest.mark.slow
@pytest.mark.parametrize('clock', [HOST, WIRE])
@pytest.mark.parametrize('pads', [ONE, TWO, TWO_NODES], ids=['one pad', 'two pads', 'a pad of two nodes'])
def test_random_timings_and_losses_never_mix_two_sweeps(pads, clock):
    """The answer to a SYNC begins, and is received, within half a period, unless its node is still sending."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        count, shortest = 200, period_at(1.0, pads)
        syncs = np.cumsum(shortest / rng.uniform(0.6, 0.97, count))
        syncs += rng.uniform(0, 1, count) * (rng.random(count) < 0.05) * shortest / 2
        skipped = set(np.flatnonzero(rng.random(count) < 0.02).tolist())
        delays = rng.uniform(0.0001, 0.15 * shortest, count)
        for seen in played(pads, rising(syncs), clock, lost=rng.choice((0, 0.001, 0.02)),
                           behind_by=0.1 * shortest, seed=seed, skips=skipped.__contains__,
                           delay=lambda number, delays=delays: delays[number]):
            assert not seen.wrong, seed
