"""Fuzz the package with random and mutated files of every kind it reads, and with CAN frames of every kind and timing.

Run by `make fuzz`, or: python test/fuzzing.py [--frames N] [--files N] [--lines N] [--sweeps N] [--seed 1]

No input may raise any error other than TactileError. An input must not cause a hang, an unreported loss, an exception
in a callback, or growing memory. The script keeps each file that breaks one of these rules in build/fuzz. After you
have fixed the defect, move the file to test/data/corpus, which the tests read.
"""

import argparse
import gzip
import itertools
import logging
import os
import random
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import can
import numpy as np
from can_bench import INTERFACE, TINY, Bench, serial_line
from waiting import wait_until
from wire_worlds import HOST, ONE, TWO, TWO_NODES, WIRE, random_world

from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.bus.slcan_bus import LONGEST_LINE, BulkSlcanBus
from tactile_node.errors import TactileError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recogniser import ShapeRecogniser
from tactile_node.shape.recognition import VOLF
from tactile_node.simulator.slcan_pty import encode
from tactile_node.skin.eds import load_eds
from tactile_node.skin.layout_file import load_layout
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelStatus

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / 'test/data/corpus'
TIMEOUT = 20  #: time limit for one file [s]
GROWTH = 10    #: allowed growth of the memory after the first tenth of the steps [MB]
BURST = 2000   #: number of CAN frames that are sent before the test waits for the driver
NASTY = ('', '0', '-1', '1e999', 'nan', '0x', '$NODEID', '$NODEID+', '99999999999999999999', '[', ']', '{', '}',
         ': ', '- ', '=', ';', '#', '\0', '\n', '\t', '\ufeff', '&a', '*a', '!!python/object:os.system', '0x80000180',
         'é', '%s', "'")
LOG_SUFFIXES = ('.log', '.asc', '.blf', '.trc', '.log.gz', '.csv')


class HangError(Exception):
    """Raised if reading a file takes longer than TIMEOUT."""


def read_log(path: Path) -> None:
    for _ in CanLogReader(path):
        pass


#: Maps each kind of file to its reader. A reader may not raise any error other than TactileError.
READERS: dict[str, Callable[[Path], object]] = {
    'eds': lambda path: load_eds(path, 32), 'layout': load_layout, 'log': read_log,
    'weights': ShapeRecogniser.from_file, 'curves': lambda path: make_recogniser(VOLF, str(path))}


def survives(kind: str, path: Path) -> str:
    """Read a file and return 'read' or 'refused'.

    Raises HangError after TIMEOUT, and passes on every error from the reader except TactileError.
    """
    def hang(*_: object):
        raise HangError(f'{path} takes longer than {TIMEOUT} s')
    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(TIMEOUT)
    try:
        READERS[kind](path)
        return 'read'
    except TactileError:
        return 'refused'
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def originals(folder: Path) -> list[tuple[str, str, bytes]]:
    """Return valid files of each kind as (kind, suffix, content).

    The files are small, so that reading many of them takes little time.
    """
    config = ROOT / 'config'
    eds = (config / 'sim8x8_16bit.eds').read_bytes()
    found = [('eds', '.eds', eds), ('eds', '.eds', eds[:3000]), ('layout', '.yaml', TINY.encode()),
             ('layout', '.yaml', (config / 'sim8x8_16bit.yaml').read_bytes())]
    messages = list(itertools.islice(can.LogReader(str(ROOT / 'test/data/sim16x16_two_pads.log.gz')), 200))
    for suffix in LOG_SUFFIXES:
        path = folder / f'sound{suffix}'
        with can.Logger(str(path)) as writer:
            for message in messages:
                writer.on_message_received(message)
        found.append(('log', suffix, path.read_bytes()))
    return found


def mutated(rng: random.Random, content: bytes, is_text: bool) -> bytes:
    """Return ``content`` with one to four random changes."""
    for _ in range(rng.randint(1, 4)):
        content = rng.choice(_TEXT_CHANGES if is_text else _CHANGES)(rng, content)
    return content


def _flip(rng: random.Random, content: bytes) -> bytes:
    data = bytearray(content or b'\0')
    for _ in range(rng.choice((1, 1, 4, 40))):
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _cut(rng: random.Random, content: bytes) -> bytes:
    return content[:rng.randint(0, len(content))]


def _moved(rng: random.Random, content: bytes) -> bytes:
    """Move a piece of the content to another place, or copy it there."""
    begin, to = rng.randint(0, len(content)), rng.randint(0, len(content))
    piece = content[begin:begin + rng.choice((1, 8, 80))]
    if rng.random() < 0.5:
        content = content[:begin] + content[begin + len(piece):]
    return content[:to] + piece + content[to:]


def _line(rng: random.Random, content: bytes) -> bytes:
    """Delete a line, duplicate a line, or swap two lines."""
    lines = content.splitlines(keepends=True) or [b'']
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(3)
    if change == 0:
        del lines[at]
    elif change == 1:
        lines.insert(other, lines[at])
    else:
        lines[at], lines[other] = lines[other], lines[at]
    return b''.join(lines)


def _nasty(rng: random.Random, content: bytes) -> bytes:
    """Replace a word with a string that often breaks parsers."""
    words = content.replace(b'=', b' = ').split(b' ')
    words[rng.randrange(len(words))] = rng.choice(NASTY).encode()
    return b' '.join(words).replace(b' = ', b'=')


_CHANGES = (_flip, _cut, _moved)
_TEXT_CHANGES = (*_CHANGES, _line, _line, _nasty, _nasty)


def mutated_files(seed: int, folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield broken files as (kind, path).

    Read each file before you request the next one, because a later file may overwrite it.
    """
    rng, sound = random.Random(seed), originals(folder)
    number = 0
    while True:
        for kind, suffix, content in sound:
            is_text = suffix != '.blf'
            if suffix == '.log.gz' and rng.random() < 0.5:  # change the content of the archive, or the archive itself
                content = gzip.compress(mutated(rng, gzip.decompress(content), True))
            else:
                content = mutated(rng, content, is_text and suffix != '.log.gz')
            number += 1
            path = folder / f'broken{number % 50}{suffix}'
            path.write_bytes(content)
            yield kind, path


def random_message(rng: random.Random, ids: list[int]) -> can.Message:
    """Return a random CAN message. Half of all random messages have an identifier from ``ids``."""
    extended, fd = rng.random() < 0.03, rng.random() < 0.02
    can_id = rng.choice(ids) if rng.random() < 0.5 else rng.randrange(0x800)
    size = rng.choice((0, 1, 2, 4, 7, 8, 8, 8, 8)) if not fd else rng.choice((8, 12, 64))
    if rng.random() < 0.01:
        size = rng.randrange(16)  # a controller never reports more than 8 bytes, but the firmware of an adapter may
    kind = rng.random()
    stamp = rng.choice((0.0, -1.0, 1e18, float('nan'))) if kind < 0.02 else time.time()
    return can.Message(timestamp=stamp, arbitration_id=can_id | rng.getrandbits(18) << 11 if extended else can_id,
                       is_extended_id=extended, is_fd=fd, is_remote_frame=0.02 < kind < 0.05 and not fd,
                       is_error_frame=0.05 < kind < 0.055, data=rng.randbytes(size), dlc=size, check=False)


class FrameFuzz:
    """Context manager for a supervised driver of one pad, on a bus with random CAN messages."""

    def __init__(self, channel: str, seed: int):
        self._rng = random.Random(seed)
        self.sent = 0
        self.frames = 0
        self.bad = []
        self.bench = Bench(channel, 'sim8x8_16bit.yaml')
        self.bench.driver = Supervisor(self.bench.settings, self.bench.pads, self._check)
        node, = self.bench.pads[0].nodes
        self._ids = [0x000, 0x080, 0x0A0, 0x5A0, 0x620, 0x720, *(t.cob_id.of(node.node_id) for t in node.layout.tpdos)]
        self._stamp = -np.inf

    def __enter__(self) -> 'FrameFuzz':
        self.bench.__enter__()
        self.bench.run()
        self._other = can.Bus(self.bench.channel, interface=INTERFACE)
        return self

    def __exit__(self, *problem: object) -> None:
        self._other.shutdown()
        self.bench.__exit__(*problem)

    def send(self, count: int) -> None:
        """Send ``count`` messages, then wait until the driver has received them."""
        for _ in range(count):
            self._other.send(random_message(self._rng, self._ids))
        self.sent += count
        while self._other.recv(0) is not None:  # this participant also receives messages, so its queue must be emptied
            pass
        assert wait_until(lambda: self.seen() >= self.sent, 60), f'{self.sent} sent, {self.seen()} seen'

    def seen(self) -> int:
        facts = self.bench.driver.facts()
        return sum(facts.can_frames.values()) + facts.queue_overruns

    def right_again(self) -> bool:
        """Reset the node, and return True if the driver then publishes whole frames of untouched taxels."""
        self._other.send(can.Message(arbitration_id=0, data=[0x81, 32], is_extended_id=False))
        self._still = 0
        return wait_until(lambda: self._still > 10, 30)

    def _check(self, _name: str, frame) -> None:
        self.frames += 1
        valid = frame.status == TaxelStatus.VALID
        if not (np.isnan(frame.values) == ~valid).all() or not frame.stamp > self._stamp:
            self.bad.append(frame)
        self._stamp = frame.stamp
        self._still = getattr(self, '_still', 0) + 1 if valid.all() and (frame.values == 0).all() else 0


class Tracebacks(logging.Handler):
    """Counts logged exceptions by logger and type, because an exception in a callback appears only in the log."""

    def __init__(self):
        super().__init__(logging.ERROR)
        self.counts: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info or isinstance(record.msg, Exception):
            error = record.exc_info[1] if record.exc_info else record.msg
            self.counts[f'{record.name} on {threading.current_thread().name}: {type(error).__name__}'] += 1

    @property
    def ours(self) -> int:
        """Number of exceptions in our package.

        Exceptions in canopen's SDO server, which the simulated skin uses, do not count.
        """
        return sum(count for where, count in self.counts.items() if where.startswith('tactile_node'))


class SerialFuzz:
    """Context manager for an slcan adapter on a serial line that damages its data."""

    def __init__(self, seed: int):
        self._rng, self._stack = random.Random(seed), ExitStack()
        self.sent, self.outcome = 0, Counter()

    def __enter__(self) -> 'SerialFuzz':
        self._adapter, port = self._stack.enter_context(serial_line())
        os.set_blocking(self._adapter, False)
        self.bus = BulkSlcanBus(port, bitrate=DEFAULT_BITRATE, sleep_after_open=0.0)
        self._stack.callback(self.bus.shutdown)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def send(self, count: int) -> None:
        """Send broken lines, each followed by a valid line that must arrive unchanged."""
        for _ in range(count):
            self.sent += 1
            mark = self.sent.to_bytes(8, 'big')
            os.write(self._adapter, self._broken() + b'\r' + encode(can.Message(arbitration_id=0x7FF, data=mark,
                                                                              is_extended_id=False)))
            while True:
                message = self.bus.recv(TIMEOUT)
                assert message is not None, f'valid line {self.sent} did not arrive'
                if message.arbitration_id == 0x7FF and bytes(message.data) == mark:
                    break
                self.outcome['reported as damaged' if message.is_error_frame else 'a frame by chance'] += 1
            assert len(self.bus._buffer) <= LONGEST_LINE
            try:
                os.read(self._adapter, 1 << 16)  # discard the data that the driver has sent to the adapter
            except BlockingIOError:
                pass

    def _broken(self) -> bytes:
        rng = self._rng
        line = encode(random_message(rng, [0x181, 0x720])) if rng.random() < 0.8 else rng.randbytes(rng.randrange(400))
        for _ in range(rng.randint(1, 3)):
            line = rng.choice((_flip, _cut, _moved))(rng, line)
        return line


def resident() -> float:
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE') / 1e6


class Growth:
    """Growth of the process's memory after the first tenth of ``count`` steps."""

    def __init__(self, count: int):
        self._tenth, self._warm = count // 10, 0.0

    def look(self, number: int) -> None:
        if number == self._tenth:
            self._warm = resident()

    def report(self) -> bool:
        """Print the growth of the memory, and return True if it exceeds GROWTH."""
        grown = resident() - self._warm
        print(f'memory {grown:+.1f} MB after the first tenth', flush=True)
        return grown > GROWTH


def fuzz_files(count: int, seed: int) -> int:
    """Read ``count`` broken files, print the outcome, and return the number of files that break a rule."""
    outcome, broken, kept, growth = Counter(), 0, ROOT / 'build/fuzz', Growth(count)
    kept.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for number, (kind, path) in zip(range(count), mutated_files(seed, Path(folder))):
            growth.look(number)
            try:
                outcome[f'{kind} {survives(kind, path)}'] += 1
            except Exception:
                broken += 1
                saved = kept / f'{kind}_{seed}_{number}{"".join(path.suffixes)}'
                saved.write_bytes(path.read_bytes())
                print(f'  {saved.name}: {traceback.format_exc(limit=-1)}', flush=True)
    print(f'files: {count}, seed {seed}, {dict(sorted(outcome.items()))}; broke the rule: {broken}')
    return broken + growth.report()


def fuzz_frames(count: int, seed: int) -> int:
    """Send ``count`` random CAN messages, print the outcome, and return the number of broken rules."""
    bursts = count // BURST
    with FrameFuzz('fuzz', seed) as fuzz:
        growth = Growth(bursts)
        for burst in range(bursts):
            growth.look(burst)
            fuzz.send(BURST)
        has_grown, right = growth.report(), fuzz.right_again()
        facts, errors = fuzz.bench.driver.facts(), fuzz.bench.log.errors
    print(f'CAN messages: {fuzz.sent}, seed {seed}; {dict(sorted(facts.can_frames.items()))}; '
          f'{facts.queue_overruns} lost and counted; {facts.pad("pad32")}; errors logged: {len(errors)}; '
          f'taxel frames with a wrong mark or stamp: {len(fuzz.bad)}; right again after a reset: {right}')
    return len(fuzz.bad) + (not right) + has_grown


def fuzz_lines(count: int, seed: int) -> int:
    """Send ``count`` broken slcan lines, print the outcome, and return the number of broken rules."""
    growth = Growth(10)
    with SerialFuzz(seed) as fuzz:
        for tenth in range(10):
            growth.look(tenth)
            fuzz.send(count // 10)
    print(f'slcan lines: {fuzz.sent} broken, {dict(fuzz.outcome)}; every valid line after them arrived')
    return growth.report()


def fuzz_timings(count: int, seed: int) -> int:
    """Simulate ``count`` sweeps with random timing, print the outcome, and return the number of wrong taxel frames."""
    worlds = itertools.cycle(itertools.product((ONE, TWO, TWO_NODES), (HOST, WIRE)))
    sent = whole = wrong = 0
    for number, (pads, clock) in enumerate(worlds):
        if sent >= count:
            break
        for seen in random_world(pads, clock, 1000 * seed + number):
            sent, whole, wrong = sent + len(seen.answered), whole + len(seen.whole), wrong + seen.wrong
    print(f'sweeps with random timings: {sent} sent by all nodes, {100 * whole / sent:.2f} % whole; taxel frames of '
          f'two sweeps or with the stamp of another SYNC: {wrong}')
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--frames', type=int, default=1_000_000)
    parser.add_argument('--files', type=int, default=10_000)
    parser.add_argument('--lines', type=int, default=100_000, help='number of broken slcan lines')
    parser.add_argument('--sweeps', type=int, default=1_000_000, help='number of sweeps with random timings')
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    tracebacks = Tracebacks()
    logging.getLogger().handlers = [tracebacks]
    broken = fuzz_files(args.files, args.seed) if args.files else 0
    broken += fuzz_frames(args.frames, args.seed) if args.frames else 0
    broken += fuzz_lines(args.lines, args.seed) if args.lines else 0
    broken += fuzz_timings(args.sweeps, args.seed) if args.sweeps else 0
    print(f'exceptions caught and logged: {dict(tracebacks.counts)}')
    return int(broken + tracebacks.ours > 0)


if __name__ == '__main__':
    sys.exit(main())
