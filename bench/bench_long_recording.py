"""Recordings of hours: two pads at 100 Hz, CAN frames and topics, written to MCAP with rotation and read again.

Run by `make bench`, or: python bench/bench_long_recording.py [--minutes 5] [--rotate-mb 32] [--folder /data]. Five
minutes take about three on one core, an hour (--minutes 60 --rotate-mb 256) about half an hour, with 2 GB of disk; all
is removed at the end. CAN frames are written by `CanLogWriter`, as by `tactile record`; topics by the library mcap with
chunks and checksums, as `ros2 bag record -s mcap` writes them. All figures are measured, none is scaled to an hour.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from io import BytesIO
from itertools import islice, takewhile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from recorded_world import BEGIN, MESSAGES, SECOND, World, topics
from rosbags import typesys

from tactile_node.logs.bag_records import Recorded, begin_of, records_of
from tactile_node.logs.damage import Damage, damage_text
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.log_writer import MEGABYTE, CanLogWriter
from tactile_node.logs.mcap_file import McapFile
from tactile_node.logs.replay_times import Window
from tactile_node.logs.series import files_of
from tactile_node.logs.topic_bag import TAXELS, TopicBagReader, message_types

TOPIC_CHUNK = 1 << 20  #: bytes; ros2 bag record's is 786,432
SEEKS = 40
COMPARED = 20 * SECOND  #: of the recording, for the table of sizes [ns]
FLAT = 8.0  #: MB that the last quarter may have above the second
MB_A_MINUTE = 40.0  #: of disk, at most


class TopicSeries:
    """Topics in files of ``largest`` bytes in a folder, each a bag."""

    def __init__(self, folder: Path, largest: int):
        self.folder, self._largest, self._number = folder, largest, 0
        folder.mkdir()
        self._open()

    def _open(self) -> None:
        self._file = (self.folder / f'topics_{self._number}.mcap').open('wb')
        self._writer, self._channels = new_writer(self._file, topics())

    def write(self, topic: str, time_ns: int, cdr: bytes) -> None:
        self._writer.add_message(self._channels[topic], time_ns, cdr, time_ns)
        if self._file.tell() >= self._largest:
            self.close()
            self._number += 1
            self._open()

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


def new_writer(file, kinds: dict[str, str], definitions: dict[str, str] | None = None, **options
               ) -> tuple[Writer, dict[str, int]]:
    writer = Writer(file, **{'chunk_size': TOPIC_CHUNK} | options)
    writer.start(profile='ros2')
    schemas = {kind: writer.register_schema(kind, 'ros2msg', ((definitions or {}).get(kind) or _text(kind)).encode())
               for kind in dict.fromkeys(kinds.values())}
    return writer, {topic: writer.register_channel(topic, 'cdr', schemas[kind]) for topic, kind in kinds.items()}


def _text(kind: str) -> str:
    """With all that it contains."""
    return message_types(typesys, MESSAGES).generate_msgdef(kind, ros_version=2)[0]


def memory() -> float:
    """Of this process [MB]."""
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE') / 1e6


def busy_of_others() -> float:
    """Processor time of all processes but this one since the start of the machine [s]: proc(5), /proc/stat."""
    user, nice, system, _, _, irq, softirq, *_ = map(int, Path('/proc/stat').read_text().splitlines()[0].split()[1:])
    return (user + nice + system + irq + softirq) / os.sysconf('SC_CLK_TCK') - time.process_time()


class Memory:
    """Samples, and whether they are flat."""

    def __init__(self):
        self._samples: list[float] = []

    def note(self) -> None:
        self._samples.append(memory())

    def __str__(self) -> str:
        quarters = [max(each) for each in np.array_split(self._samples, 4)] if len(self._samples) > 3 else [0.0] * 4
        rise = quarters[3] - quarters[1]
        return (f'{self._samples[0]:.0f} MB at the begin, largest {max(self._samples):.0f} MB, last quarter '
                f'{rise:+.1f} MB beside the second: {"flat" if rise < FLAT else "NOT FLAT"}')


def write(folder: Path, minutes: float, largest: int) -> tuple[Path, Path]:
    """Write all, both series in turns; print what it cost."""
    world, can_log = World(), CanLogWriter(folder / 'can.mcap', 'can0', largest)
    bag, used, held = TopicSeries(folder / 'topics', largest), Memory(), [0.0, 0.0, 0.0]
    frames = messages = 0
    for second in range(round(60 * minutes)):
        begun = time.process_time()
        counts = world.counts(second)
        made = list(world.can_frames(second, counts)), list(world.messages(second, counts))
        held[0] += time.process_time() - begun
        begun = time.process_time()
        for message in made[0]:
            can_log.write(message)
        held[1] += time.process_time() - begun
        begun = time.process_time()
        for each in made[1]:
            bag.write(*each)
        held[2] += time.process_time() - begun
        frames, messages = frames + len(made[0]), messages + len(made[1])
        if second % 5 == 4:
            used.note()
    can_log.close()
    bag.close()
    assert can_log.can_frames == frames and not can_log.failure, can_log.failure
    print('| recording | messages | files | MB a minute | written at, times real time (processor time) |\n'
          '| --- | --- | --- | --- | --- |')
    for name, path, count, took in (('CAN frames', can_log.path, frames, held[1]),
                                    ('topics', bag.folder, messages, held[2])):
        files = files_of(path)
        size = sum(file.stat().st_size for file in files) / MEGABYTE
        print(f'| {name} | {count:,} | {len(files)} | {size / minutes:.1f} | {60 * minutes / took:.1f} |')
    print(f'\nMaking the frames and messages took {held[0]:.0f} s beside. Memory while writing: {used}.\n', flush=True)
    return can_log.path, bag.folder


def sizes(path: Path, name: str) -> None:
    """Of the first COMPARED, with each compression and some sizes of chunks."""
    begin = begin_of(path)
    taken = list(takewhile(lambda each: each.time < begin + COMPARED, records_of(path, fail)))
    minutes = (taken[-1].time - begin) / SECOND / 60
    for compression in CompressionType:
        row = [f'{_size(taken, compression, chunk) / MEGABYTE / minutes:.1f}' for chunk in (1 << 16, 1 << 18, 1 << 20)]
        print(f'| {name}, {compression.name.lower()} | {" | ".join(row)} |')
    seconds = [60 * minutes * chunk / _size(taken, CompressionType.NONE, chunk, index=False)
               for chunk in (1 << 16, 1 << 18, 1 << 20)]
    print(f'| {name}: a damaged chunk costs [s] | {" | ".join(f"{each:.2f}" for each in seconds)} |', flush=True)


def _size(taken: list[Recorded], compression: CompressionType, chunk: int, index: bool = True) -> int:
    stream = BytesIO()
    writer, channels = new_writer(stream, {each.topic: each.type for each in taken},
                                  {each.type: each.definition for each in taken}, chunk_size=chunk,
                                  compression=compression, index_types=IndexType.ALL if index else IndexType.CHUNK)
    for each in taken:
        writer.add_message(channels[each.topic], each.time, each.cdr, each.time)
    writer.finish()
    return len(stream.getvalue())


def fail(damage: Damage) -> None:
    raise SystemExit(f'a sound recording was found damaged: {damage_text(damage)}')


def seek(name: str, length: float, first_from: Callable[[float], object]) -> None:
    """Print how long it takes until the first message at a random time is there, from opening the recording on."""
    times, rng = [], np.random.default_rng(3)
    for at in rng.uniform(0, length - 1, SEEKS):
        begun = time.perf_counter()
        first_from(at)
        times.append(1e3 * (time.perf_counter() - begun))
    p50, p99 = np.quantile(times, (0.5, 0.99))
    print(f'| {name} | {p50:.0f} | {p99:.0f} | {max(times):.0f} |', flush=True)


def read_all(name: str, minutes: float, messages: Iterator[object]) -> None:
    used, begun, count = Memory(), time.process_time(), 0
    for count, _ in enumerate(messages, 1):
        if count % 2000 == 0:
            used.note()
    took = time.process_time() - begun
    print(f'| {name} | {count:,} | {took:.1f} | {60 * minutes / took:.1f} | {used} |', flush=True)


def damaged(name: str, path: Path, copy: Path) -> None:
    """What damage to one file of ``path`` costs our reader, and two others' libraries."""
    shutil.copyfile(path, copy)
    whole, size = _read(copy), copy.stat().st_size
    with copy.open('rb') as file:
        summary = McapFile(file.fileno(), copy.name).summary
    assert summary is not None
    places = sorted(each.chunk_start_offset for each in summary.chunk_indexes)
    middle = places[len(places) // 2]
    for what, at, new in (('40 bytes changed in a chunk', middle + 1000, b'\xC6' * 40),
                          ('64 KiB of zeros over the begin of one', middle - 2000, bytes(1 << 16)),
                          ('the last tenth cut off', size - size // 10, None)):
        with copy.open('r+b') as file:
            before = os.pread(file.fileno(), size - at if new is None else len(new), at)
            os.truncate(file.fileno(), at) if new is None else os.pwrite(file.fileno(), new, at)
            found = _read(copy)
            others = [f'{count:,}' for count in (_by_mcap(copy), _by_rosbags(copy))]
            os.pwrite(file.fileno(), before, at)
        damages = '; '.join(map(_as_text, found[1]))
        print(f'| {name} | {what} | {whole[0]:,} | {whole[0] - found[0]:,} | {damages} | {" | ".join(others)} |',
              flush=True)
    copy.unlink()


def _read(path: Path) -> tuple[int, list[Damage]]:
    damages: list[Damage] = []
    return sum(1 for _ in records_of(path, damages.append)), damages


def _as_text(damage: Damage) -> str:
    chunks = 'chunks not known' if damage.chunks is None else f'{damage.chunks} chunks'
    return f'{damage.kind.name}, {chunks}, ' + ('to the end' if damage.seconds is None else f'{damage.seconds:.2f} s')


def _by_mcap(path: Path) -> int:
    """Messages up to the error of MCAP's own reader in Python, which reads record by record."""
    from mcap.records import Message
    from mcap.stream_reader import StreamReader
    count = 0
    try:
        with path.open('rb') as file:
            for record in StreamReader(file, validate_crcs=True).records:
                count += isinstance(record, Message)
    except Exception:  # it lets struct's and zstandard's through
        pass
    return count


def _by_rosbags(path: Path) -> int:
    from rosbags.rosbag2 import Reader
    count = 0
    try:
        with Reader(path) as reader:
            for _ in reader.messages():
                count += 1
    except Exception:  # as above
        pass
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=float, default=5.0, help='of the recording (default: %(default)s)')
    parser.add_argument('--rotate-mb', type=float, default=32.0, help='size of a file (default: %(default)s)')
    parser.add_argument('--folder', help='where the recording is written (default: the folder for temporary files)')
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix='long_recording_', dir=args.folder) as name:
        folder, needed = Path(name), args.minutes * MB_A_MINUTE + args.rotate_mb
        if (free := shutil.disk_usage(folder).free / MEGABYTE) < needed:
            raise SystemExit(f'expected {needed:.0f} MB of free disk in {folder.parent}, got {free:.0f}: '
                             '--folder names another place')
        run(folder, args.minutes, round(args.rotate_mb * MEGABYTE))


def run(folder: Path, minutes: float, largest: int) -> None:
    begun, busy = time.monotonic(), busy_of_others()
    print(f'# {minutes:g} minutes of two pads of 16x16 taxels at 100 Hz, files of {largest / MEGABYTE:g} MB\n')
    can_log, bag = write(folder, minutes, largest)
    print('| first message at a random time [ms] | p50 | p99 | largest |\n| --- | --- | --- | --- |')
    seek('CAN frames', 60 * minutes, lambda at: next(iter(CanLogReader(can_log, window=Window(at, 1.0)))))
    seek('taxels', 60 * minutes, lambda at: next(TopicBagReader(bag).frames(since=BEGIN + at)))
    print('\n| read from begin to end | messages | processor time [s] | times real time | memory |\n'
          '| --- | --- | --- | --- | --- |')
    read_all('CAN frames', minutes, iter(CanLogReader(can_log)))
    read_all('taxels', minutes, TopicBagReader(bag).messages((TAXELS,)))
    print('\n| file | damage | messages | lost | reported | read by mcap | by rosbags |\n'
          '| --- | --- | --- | --- | --- | --- | --- |')
    damaged('CAN frames', files_of(can_log)[0], folder / 'damaged.mcap')
    damaged('topics', next(islice(files_of(bag), 1)), folder / 'damaged.mcap')
    print('\n| MB a minute | chunks of 64 KiB | 256 KiB | 1 MiB |\n| --- | --- | --- | --- |')
    sizes(can_log, 'CAN frames')
    sizes(bag, 'topics')
    took = time.monotonic() - begun
    print(f'\nIt took {took:.0f} s; other processes used {(busy_of_others() - busy) / took:.1f} of '
          f'{os.cpu_count()} cores meanwhile.')


if __name__ == '__main__':
    main()
