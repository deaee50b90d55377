"""A bench that injects the faults of the catalogue.

The bench has a supervised driver, a skin, and another participant on the bus.
"""

import itertools
import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import can
import numpy as np
from can_bench import Bench, TooSlowError
from faulty_bus import Adapter
from waiting import wait_until

from tactile_node.assembly.health import NodeFault, Overload
from tactile_node.bus import skin_bus
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.cia301.emergency import Emergency
from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.simulator.wire import Carried
from tactile_node.skin.pads import LivePad
from tactile_node.sources.supervisor import Supervisor
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

LAYOUT, SIDE, PRESSED = 'sim8x8_16bit.yaml', 8, 12.5
#: The CAN frames of the simulated skin travel over a simulated wire at 1 Mbit/s. With TACTILE_TEST_WIRE=off, CAN frames
#: take no time.
WIRE = WireSettings() if os.environ.get('TACTILE_TEST_WIRE') != 'off' else None
TIMEOUT = 60.0  # time limit on a busy machine [s]
SYNC = 0x80
PERIOD = 0.02  # SYNC period [s]
HELD_UP = 0.25  # half of the driver's default heartbeat_timeout [s]
PUNCTUAL = PERIOD / 2  # time within which the driver expects a device's TPDOs after a SYNC [s]


class Coded:
    """Taxels whose values encode their position and the SYNC that they answer.

    The value is 1 N + 0.2 N per taxel + 1 mN per SYNC.
    """

    TAXEL = 0.2
    SYNC = 0.001
    MOST = 10_000  #: number of SYNCs that a taxel's range can encode
    place = 1 + TAXEL * np.arange(SIDE * SIDE).reshape(SIDE, SIDE)

    def __init__(self):
        self.syncs = 0  #: number of SYNCs that the devices have received

    def __call__(self, _t: float) -> np.ndarray:
        assert self.syncs < self.MOST
        return self.place + self.SYNC * self.syncs

    def sync_of(self, frame: TaxelFrame) -> int | None:
        """Return the number of the SYNC that all valid taxels answer, or None if no taxel is valid."""
        valid = frame.status == TaxelStatus.VALID
        if not valid.any():
            return None
        numbers = (frame.values[valid] - self.place[valid]) / self.SYNC
        np.testing.assert_allclose(numbers, round(float(numbers[0])), atol=0.4)
        return round(float(numbers[0]))


class Answers:
    """The times at which the simulated devices of ``pads`` answered each SYNC.

    The taxels of these devices are ``coded``.

    ``at`` maps the number of a SYNC to the time at which the skin delivered its last TPDO for this SYNC [s, Unix
    epoch].
    """

    def __init__(self, simulator: SkinSimulator, coded: Coded, pads: Sequence[LivePad]):
        self.at: dict[int, float] = {}
        self._coded = coded
        self._value = pads[0].layout.value
        self._first_taxels = {tpdo.cob_id.of(node_id): tpdo.taxels[0][:2] for pad in pads for node_id in pad.node_ids
                              for tpdo in pad.layout.tpdos}
        gateway = simulator._gateway
        count, send = gateway.on_carried, gateway._send_to_host

        def carried(frame: Carried) -> None:
            coded.syncs += frame.frame.can_id == SYNC
            count(frame)

        def sent(frames: Sequence[CanFrame]) -> None:
            send(frames)
            self._note(frames, time.time())
        gateway.on_carried, gateway._send_to_host = carried, sent

    def _note(self, frames: Sequence[CanFrame], now: float) -> None:
        for frame in frames:
            if (taxel := self._first_taxels.get(frame.can_id)) is not None:
                counts = int.from_bytes(frame.data[:2], 'little', signed=True)
                value = (self._value.offset - counts) * self._value.scale  # the counts fall as the pressure rises
                self.at[round((value - self._coded.place[taxel]) / self._coded.SYNC)] = now


def check_stamps(frames: Sequence[TaxelFrame], coded: Coded, asked: Sequence[float],
                 answered: dict[int, float]) -> None:
    """Check that the taxels in each frame of one pad answer the SYNC to which the frame's stamp belongs.

    The driver cannot detect that a device answers a SYNC only after the next SYNC (see ``assembler``). If a busy
    machine delayed the simulated device for that long, the function raises TooSlowError. Any other wrong stamp raises
    AssertionError.

    Parameters
    ----------
    frames
        All published frames of the pad, in order.
    coded
        Coded taxels of the pad.
    asked
        Time at which each SYNC was on the bus [s, Unix epoch]. This time lies between the stamp of the SYNC and the
        stamp of the next SYNC.
    answered
        Maps the number of a SYNC to the time at which the skin delivered its TPDOs [s, Unix epoch].
    """
    for frame, after in itertools.zip_longest(frames, frames[1:]):
        number = coded.sync_of(frame)
        if number is None or frame.stamp <= asked[number - 1] < (math.inf if after is None else after.stamp):
            continue
        late = {n: round(answered[n] - asked[n - 1], 3) for n in range(number - 5, number + 2)
                if n in answered and answered[n] - asked[n - 1] > PUNCTUAL}
        raise (TooSlowError if late else AssertionError)(
            f'taxels that answer SYNC {number} of {asked[number - 1]:.3f} have the stamp {frame.stamp:.3f}; '
            f'SYNCs answered late: {late} s')


class FaultBench(Bench):
    """Context manager for a driver and pads. The bench records every published frame, and checks all frames at its end.

    By default, the pads have 8x8 Coded taxels; ``layout`` and ``source`` override this. ``cause`` and ``end_of_cause``
    mark the beginning and the end of the fault. ``detected`` is the time since the first mark, and ``publishing_again``
    the time since the second mark [s].
    """

    def __init__(self, channel: str, nodes: tuple[int, ...] = (32,), recover: bool = True, source=None,
                 layout: str = LAYOUT, **settings: Any):
        self.coded = Coded() if source is None else None
        self.is_clock_true = True  #: False if the stamps differ from the true times of the SYNCs
        self.wrong_durations: list[str] = []  #: reported by `make faults` only, because a busy machine may be the cause
        self.source = source or self.coded
        super().__init__(channel, layout, nodes, source=self.source, wire=WIRE)
        self.adapter = Adapter()
        self.kept: list[tuple[str, TaxelFrame]] = []
        self.hold = threading.Event()
        self.hold.set()  #: the consumer blocks while this event is cleared
        self.settings = BusSettings('virtual', channel, **{'sync_period': PERIOD} | settings)
        self.driver = Supervisor(self.settings, self.pads, self.keep, recover)
        self.detected = self.publishing_again = None
        self._begun = self._ended = 0.0

    def __enter__(self) -> 'FaultBench':
        self._open_bus, skin_bus.open_bus = skin_bus.open_bus, self.adapter.open
        super().__enter__()
        self._asked: list[float] = []  # time at which each SYNC was on the bus [s, Unix epoch]
        self.simulator._network.subscribe(SYNC, lambda _id, _data, stamp: self._asked.append(stamp))
        self._answers = Answers(self.simulator, self.coded, self.pads) if self.coded is not None and WIRE else None
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
        """Send an error frame like those that a CAN controller reports."""
        self.other.send(can.Message(arbitration_id=can_id, is_extended_id=False, is_error_frame=True, data=bytes(data)))

    def repeat(self, can_id: int, period: float, data: bytes = b'') -> can.broadcastmanager.CyclicSendTaskABC:
        """Send a frame every ``period`` [s] until the returned task is stopped."""
        return self.other.send_periodic(can.Message(arbitration_id=can_id, is_extended_id=False, data=data), period)

    def heard(self) -> list[can.Message]:
        """Return the messages that the other participant on the bus has received since the last call."""
        return list(iter(lambda: self.other.recv(0), None))

    def node(self, pad: str = 'pad32'):
        return self.driver.facts().pad(pad).nodes[0]

    def cause(self) -> None:
        self._begun = self._ended = time.monotonic()

    def end_of_cause(self) -> 'FaultBench':
        self._ended = time.monotonic()
        return self

    @property
    def emcy_last(self) -> Emergency | None:
        """The latest EMCY of node 32."""
        return self.driver.bus_monitor.emergencies[32].last

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        assert wait_until(condition, TIMEOUT), f'{what}; {self.driver.facts()}; {self.log.errors}'

    def detect(self, *facts: object, kind: Callable[[Any], bool] = lambda fact: False) -> None:
        """Wait until a warning or an error is logged with one of ``facts``, or with a fact that ``kind`` accepts."""
        self.wait(lambda: any(fact in facts or kind(fact) for fact in self.log.error_facts), f'{facts} not logged')
        self.detected = time.monotonic() - self._begun

    def repair(self, *pads: str) -> None:
        """Remove all faults from the adapter, and wait until whole frames are published again."""
        self.adapter.mend()
        self.end_of_cause().recover(*pads)

    def recover(self, *pads: str) -> None:
        """Wait until the driver publishes whole frames that were acquired after the end of the cause."""
        for pad in pads or ('pad32',):
            self.wait_for_whole(pad, time.time() - (time.monotonic() - self._ended))
        self.publishing_again = time.monotonic() - self._ended
        self.wait(lambda: all(node.fault is NodeFault.NONE and node.operational
                              for pad in self.driver.facts().pads for node in pad.nodes), 'a fault stays')

    def wait_for_whole(self, pad: str, after: float = 0.0) -> None:
        def has_come() -> bool:
            return any(name == pad and frame.stamp > after and not frame.missing_can_frames
                       for name, frame in self.kept[-20:])
        self.wait(has_come, f'no whole frames of {pad}')

    def assert_no_outage(self, *pads: str) -> None:
        """Assert that no pad had an outage.

        Raises TooSlowError if the machine delayed the driver or the simulated device.
        """
        nodes = [self.node(pad) for pad in pads or ('pad32',)]
        if any(node.outages for node in nodes):
            self.wait(lambda: all(self.node(pad).outage_present_reason is None for pad in pads or ('pad32',)),
                      'an outage stays')
            raise (TooSlowError if self._was_held_up() else AssertionError)(f'{nodes}; {self.log.errors}')

    def _was_held_up(self) -> bool:
        """Return True if the driver or the simulated device stood still for half of the heartbeat timeout."""
        answered = {} if self._answers is None else self._answers.at
        return self.driver.facts().stalls > 0 or any(
            answered.get(number, 0.0) - asked > HELD_UP for number, asked in enumerate(self._asked, 1))

    @property
    def complaints(self) -> list[str]:
        """All warnings and errors except those about an overload of this process."""
        return [record.message for record in self.log.records
                if record.level >= logging.WARNING and not isinstance(record.fact, Overload)]

    def keep(self, name: str, frame) -> None:
        self.hold.wait(TIMEOUT)
        self.kept.append((name, frame))

    def _check_all(self) -> None:
        """Assert that no wrong value was published as valid, and that no sequence number or stamp occurred twice."""
        for pad in self.pads:
            frames = [frame for name, frame in self.kept if name == pad.name]
            assert all((np.diff([getattr(frame, key) for frame in frames]) > 0).all() for key in ('sequence', 'stamp'))
            for frame in frames:
                valid = frame.status == TaxelStatus.VALID
                assert np.isnan(frame.values[~valid]).all() and (frame.status[~valid] == TaxelStatus.STALE).all()
                assert valid.all() == (frame.missing_can_frames == 0)
                assert self.coded is None or self.coded.sync_of(frame) != 0
            if self._answers is not None and self.is_clock_true:
                check_stamps(frames, self.coded, self._asked, self._answers.at)
