"""Where the faults of the catalogue are injected: a supervised driver, a skin, another participant on the bus."""

import os
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

import can
import numpy as np
from can_bench import Bench, wait_until
from faulty_bus import Adapter

from tactile_node.assembly.health import NodeFault
from tactile_node.bus import skin_bus
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.cia301.emergency import Emergency
from tactile_node.simulator.skin_simulator import WireSettings
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

LAYOUT, SIDE, PRESSED = 'sim8x8_16bit.yaml', 8, 12.5
#: what the skin sends takes its time on a wire of 1 Mbit/s; TACTILE_TEST_WIRE=off: it is sent at once
WIRE = WireSettings() if os.environ.get('TACTILE_TEST_WIRE') != 'off' else None
TIMEOUT = 60.0  # s; a busy machine may be slow, a wrong one never gets there


class Coded:
    """Taxels whose values show their place and sampling time: 1 N, 0.2 N a taxel, 1 mN a sample (mod CYCLE)."""

    CYCLE, TAXEL, SAMPLE = 100, 0.2, 0.001
    place = 1 + TAXEL * np.arange(SIDE * SIDE).reshape(SIDE, SIDE)

    def __init__(self):
        self.sampled: list[float] = []  #: when each sample was taken [s, Unix epoch]

    def __call__(self, _t: float) -> np.ndarray:
        self.sampled.append(time.time())
        return self.place + self.SAMPLE * ((len(self.sampled) - 1) % self.CYCLE)

    def check(self, frame: TaxelFrame, fresh: bool, within: float) -> None:
        """All valid taxels are in their places and of one sample; ``fresh``: taken ``within`` [s] of its SYNC."""
        valid = frame.status == TaxelStatus.VALID
        if not valid.any():
            return
        samples = (frame.values[valid] - self.place[valid]) / self.SAMPLE
        code = round(float(samples[0]))
        np.testing.assert_allclose(samples, code, atol=0.3)
        taken = np.array(self.sampled[code::self.CYCLE]) - frame.stamp
        assert not fresh or ((taken > -0.005) & (taken < within)).any(), f'sampled {taken} s after its SYNC'


class FaultBench(Bench):
    """Pads of 8x8 Coded taxels, unless ``layout`` and ``source`` say otherwise; every frame published is kept, and
    checked at the end.

    ``cause`` and ``end_of_cause`` mark when the fault acts; ``detected`` and ``publishing_again`` [s] are
    measured from them.
    """

    def __init__(self, channel: str, nodes: tuple[int, ...] = (32,), recover: bool = True, source=None,
                 layout: str = LAYOUT, **settings: Any):
        self.coded = Coded() if source is None else None
        self.is_clock_true = True  #: False: stamps cannot be compared with the wall clock
        self.sampled_within = 0.7  #: the longest from a SYNC to the devices' samples [s]; a cycle of Coded has 2 s
        self.source = source or self.coded
        super().__init__(channel, layout, nodes, source=self.source, wire=WIRE)
        self.adapter = Adapter()
        self.kept: list[tuple[str, TaxelFrame]] = []
        self.hold = threading.Event()
        self.hold.set()  #: cleared: the consumer hangs
        self.settings = BusSettings('virtual', channel, **{'sync_period': 0.02} | settings)
        self.driver = Supervisor(self.settings, self.pads, self.keep, recover)
        self.detected = self.publishing_again = None
        self._begun = self._ended = 0.0

    def __enter__(self) -> 'FaultBench':
        self._open_bus, skin_bus.open_bus = skin_bus.open_bus, self.adapter.open
        super().__enter__()
        self.other = can.Bus(self.channel, interface='virtual')
        return self

    def __exit__(self, *problem: object) -> None:
        self.other.shutdown()
        super().__exit__(*problem)
        skin_bus.open_bus = self._open_bus
        if problem[0] is None:
            self._check_all()

    @property
    def device(self):
        return self.simulator.devices[32]

    def power_cycle(self) -> None:
        self.device.power_off()
        self.device.boot()

    def run(self) -> 'FaultBench':
        super().run()
        self.wait_for_whole('pad32')
        return self

    def send(self, can_id: int, data: str = '') -> None:
        self.other.send(can.Message(arbitration_id=can_id, is_extended_id=False, data=bytes.fromhex(data)))

    def send_error(self, can_id: int, data: Iterable[int]) -> None:
        """Send the error frame of a controller."""
        self.other.send(can.Message(arbitration_id=can_id, is_extended_id=False, is_error_frame=True, data=bytes(data)))

    def repeat(self, can_id: int, period: float, data: bytes = b'') -> can.broadcastmanager.CyclicSendTaskABC:
        """Send a frame each ``period`` [s], until what is returned is stopped."""
        return self.other.send_periodic(can.Message(arbitration_id=can_id, is_extended_id=False, data=data), period)

    def heard(self) -> list[can.Message]:
        """What the other participant has received since the last call."""
        return list(iter(lambda: self.other.recv(0), None))

    def node(self, pad: str = 'pad32'):
        return self.driver.health().nodes[pad][0]

    def cause(self) -> None:
        self._begun = self._ended = time.monotonic()

    def end_of_cause(self) -> 'FaultBench':
        self._ended = time.monotonic()
        return self

    @property
    def last_emergency(self) -> Emergency | None:
        """Those kept of node 32, oldest first."""
        return self.driver.monitor.emergencies[32].last

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        assert wait_until(condition, TIMEOUT), f'{what}; {self.driver.health()}; {self.log.errors}'

    def detect(self, *facts: object, kind: Callable[[Any], bool] = lambda fact: False) -> None:
        """Wait until a warning or an error in the log has one of ``facts``, or one that is of a ``kind``."""
        self.wait(lambda: any(fact in facts or kind(fact) for fact in self.log.error_facts), f'{facts} not logged')
        self.detected = time.monotonic() - self._begun

    def repair(self, *pads: str) -> None:
        """Take all faults off the adapter; wait until whole frames come again."""
        self.adapter.mend()
        self.end_of_cause().recover(*pads)

    def recover(self, *pads: str) -> None:
        """Wait until whole frames come again that were acquired after the cause had ended."""
        for pad in pads or ('pad32',):
            self.wait_for_whole(pad, time.time() - (time.monotonic() - self._ended))
        self.publishing_again = time.monotonic() - self._ended
        self.wait(lambda: all(node.fault is NodeFault.NONE and node.is_operational
                              for nodes in self.driver.health().nodes.values() for node in nodes), 'a fault stays')

    def wait_for_whole(self, pad: str, after: float = 0.0) -> None:
        def has_come() -> bool:
            return any(name == pad and frame.stamp > after and not frame.missing_can_frames
                       for name, frame in self.kept[-20:])
        self.wait(has_come, f'no whole frames of {pad}')

    def keep(self, name: str, frame) -> None:
        self.hold.wait(TIMEOUT)
        self.kept.append((name, frame))

    def _check_all(self) -> None:
        """Nothing wrong was published as valid, no sequence number and no stamp twice, in the whole run."""
        for pad in self.pads:
            frames = [frame for name, frame in self.kept if name == pad.name]
            assert all((np.diff([getattr(frame, key) for frame in frames]) > 0).all() for key in ('sequence', 'stamp'))
            for frame in frames:
                valid = frame.status == TaxelStatus.VALID
                assert np.isnan(frame.values[~valid]).all() and (frame.status[~valid] == TaxelStatus.STALE).all()
                if self.coded is not None:
                    self.coded.check(frame, self.is_clock_true, self.sampled_within)
                assert valid.all() == (frame.missing_can_frames == 0)
