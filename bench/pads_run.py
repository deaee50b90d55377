"""One run of one case of bench_pads.py: starts skins, nodes and consumer, measures, counts, ends them."""

import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bench_launch import busy_seconds, cpu_seconds, ended, pss
from pads_cases import LAYOUT, NODE_IDS, ROOT, TPDOS, Case
from pads_consumer import Consumer
from pads_ledger import Counts, Station, Step, ledger
from skin_process import SkinProcess

from tactile_node.simulator.wire import WireReport

SETTLE = 3.0  #: s after the activation
NICE = -10    #: of skins and consumer: a device does not wait for the processor of its host
LATE = 0.005  #: s: a sender that is later (99 %) is not one that measures a driver
KEPT_UP = 0.98  #: of the shapes that are due: a node that gives fewer is saturated


class Row(NamedTuple):
    """CPU in cores, times in ms, memory in MB; counts of the whole session."""

    case: Case
    cpu: float              #: of all processes of nodes
    busiest: float          #: of one of these
    pss: float
    p50: float              #: from the last TPDO of a sweep on the wire to its shape at the consumer
    p99: float
    kept_up: float          #: shapes of those that are due
    sender_late: float      #: 99 % of all frames of the worst wire
    sender_cpu: float
    consumer_cpu: float
    others_cpu: float       #: all other processes of the machine
    idle: float
    wire_load: float        #: of the busiest
    counts: Counts
    shapes: int             #: received of the pads that the consumer watches
    left_out: int           #: by their messages
    gaps: int               #: in their sequence, beyond that
    overloads: tuple[str, ...]          #: as SkinStatus reports
    reported: dict[str, tuple[str, ...]]  #: what driver, processor and classifier reported

    @property
    def is_measured(self) -> bool:
        return self.sender_late <= 1e3 * LATE

    @property
    def is_saturated(self) -> bool:
        return self.kept_up < KEPT_UP

    @property
    def steps(self) -> tuple[Step, ...]:
        return ledger(self.counts)

    @property
    def unaccounted(self) -> int:
        return sum(max(step.unaccounted, 0) for step in self.steps)


def measured(case: Case, seconds: float, nice: int) -> Row:
    """``nice``: of the nodes. Raises SystemExit where nodes do not start."""
    if os.getsid(0) == os.getpid():
        raise_session(NICE, os.getpid())
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        skins = []
        for bus in range(case.buses):
            (folder / str(bus)).mkdir()
            skins.append(SkinProcess(folder / str(bus), LAYOUT, NODE_IDS[:case.pads]))
            stack.callback(skins[-1].end)
        consumer = stack.enter_context(Consumer(case))
        processes = [subprocess.Popen(words, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL,
                                      stderr=subprocess.DEVNULL, env=os.environ | {'PYTHONPATH': str(ROOT)})
                     for words in case.commands([skin.port for skin in skins], LAYOUT)]
        stack.callback(ended, processes)
        for process in processes:
            raise_session(nice, process.pid)
        consumer.spin_until(lambda: consumer.are_active() and consumer.are_shapes(), 'shapes of all pads',
                            60 + 5 * case.processes)
        return _session(case, seconds, skins, processes, consumer)


def _session(case: Case, seconds: float, skins: list[SkinProcess], processes: list[subprocess.Popen],
             consumer: Consumer) -> Row:
    consumer.deactivate()
    before = counted(consumer)
    _ = [skin.report() for skin in skins]
    consumer.activate()
    consumer.spin(SETTLE)
    first = [skin.report() for skin in skins]
    consumer.clear()
    begun, busy, own = time.monotonic(), busy_seconds(), time.process_time()
    cpu = [cpu_seconds([each]) for each in processes]
    consumer.spin(seconds)
    elapsed = time.monotonic() - begun
    cpu = [(cpu_seconds([each]) - then) / elapsed for each, then in zip(processes, cpu)]
    own, busy = (time.process_time() - own) / elapsed, (busy_seconds() - busy) / elapsed
    memory = sum(map(pss, processes))
    wires = [skin.report() for skin in skins]
    late = 1e3 * np.concatenate([seen.late for seen in consumer.seen.values()] or [np.array([np.nan])])
    overloads = tuple(sorted(each.name for each in consumer.overloads if each.is_overload))
    reported = {who: tuple(sorted(texts)) for who, texts in consumer.levels.items()}
    shapes, left_out, gaps = (sum(each) for each in zip(*((len(seen.late), seen.left_out, seen.gaps)
                                                          for seen in consumer.seen.values())))
    kept_up = shapes / (len(consumer.seen) * case.rate * elapsed)
    consumer.deactivate()
    after = counted(consumer, [*first, *wires, *(skin.report() for skin in skins)])
    senders = sum(wire.cpu / wire.seconds for wire in wires)
    return Row(case, cpu=sum(cpu), busiest=max(cpu), pss=memory, p50=quantile(late, 0.5), p99=quantile(late, 0.99),
               kept_up=kept_up, sender_late=1e3 * max(wire.late_p99 for wire in wires), sender_cpu=senders,
               consumer_cpu=own, others_cpu=busy - sum(cpu) - senders - own, idle=(os.cpu_count() or 1) - busy,
               wire_load=max(wire.load for wire in wires), counts=after - before, shapes=shapes,
               left_out=left_out, gaps=gaps, overloads=overloads, reported=reported)


def counted(consumer: Consumer, wires: Sequence[WireReport] = ()) -> Counts:
    """What all nodes report, and the wires where they are asked."""
    statuses = consumer.statuses.values()
    pads = [pad for status in statuses for pad in status.pads]
    stations = {role: sum((found for name, found in consumer.stations.items() if name.endswith(f'/{role}')),
                          start=Station()) for role in ('processor', 'classifier')}
    return Counts(
        len(pads), TPDOS,
        syncs_left_out=sum(status.sync_overruns + status.sync_pauses for status in statuses),
        sweeps=sum(wire.sweeps for wire in wires), sweeps_skipped=sum(wire.skipped for wire in wires),
        unread=sum(wire.lost for wire in wires), queue_overruns=sum(status.queue_overruns for status in statuses),
        received=sum(pad.tpdos_received for pad in pads), used=sum(pad.tpdos_used for pad in pads),
        missing=sum(pad.tpdos_expected - pad.tpdos_used for pad in pads),
        lost=sum(sum(pad.loss_counts) for pad in pads),
        outages=sum(node.outages for pad in pads for node in pad.nodes),
        published=sum(pad.frames_complete + pad.frames_incomplete for pad in pads), **stations)


def quantile(values: np.ndarray, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else float('nan')


def raise_session(nice: int, process: int) -> None:
    """Give the session of ``process``, its first, a priority, where that is allowed.

    Linux schedules sessions as groups (sched(7), autogroup): nice only orders the processes of one session.
    """
    try:
        Path(f'/proc/{process}/autogroup').write_text(f'{nice}')
    except OSError:  # not root, or a kernel without it
        pass
