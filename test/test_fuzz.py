"""Tests with a small, fixed part of `make fuzz` and with every input that once caused a fault."""

import logging
from pathlib import Path

import pytest
from fuzzing import CORPUS, FrameFuzz, SerialFuzz, Tracebacks, mutated_files, survives

from tactile_node.bus.slcan_bus import is_sound

CASES = sorted(path for path in CORPUS.iterdir() if path.name != 'README.md')


@pytest.mark.parametrize('path', CASES, ids=lambda path: path.name)
def test_inputs_that_once_broke_a_reader_are_survived(path: Path):
    """The file name of a case begins with the kind of the file."""
    assert survives(path.name.split('_')[0], path) in ('read', 'refused')


@pytest.mark.slow
def test_mutated_files_are_read_or_refused(tmp_path):
    """Mutations that were all harmless or all fatal would test nothing, so both outcomes must occur."""
    outcomes = {survives(kind, path) for (kind, path), _ in zip(mutated_files(2, tmp_path), range(300))}
    assert outcomes == {'read', 'refused'}


@pytest.mark.bus
def test_random_can_messages_leave_a_driver_that_still_works():
    tracebacks = Tracebacks()
    logging.getLogger().addHandler(tracebacks)
    try:
        with FrameFuzz('fuzzed', 3) as fuzz:
            fuzz.send(4000)
            assert fuzz.right_again()
            assert not fuzz.bad and fuzz.bench.log.errors
    finally:
        logging.getLogger().removeHandler(tracebacks)
    assert not tracebacks.ours, tracebacks.counts


@pytest.mark.parametrize(('line', 'sound'), [
    ('t1812AABB', True), ('t1812AABB0042', True), ('T000001811AA', True), ('r1818', True), ('V1013', True),
    ('d1819' + 24 * '0', True), ('t1812AAB', False), ('t1812AABBCC', False),
    ('t1812AABBt1812CCDD', False), ('t8FF0', False), ('t+120', False),
    ('r123a', False), ('t1819' + 24 * '0', False), ('T200000000', False), ('t', False),
    ('1812AABB', False), ('AABB', False), ('z', True), ('F00', True), ('F01812AABB', False), ('F', False)])
def test_slcan_lines_are_checked_whole(line, sound):
    assert is_sound(line) == sound


def test_broken_slcan_lines_are_reported_and_the_sound_ones_received():
    with SerialFuzz(4) as fuzz:
        fuzz.send(500)
        assert fuzz.outcome['reported as damaged'] > 100
