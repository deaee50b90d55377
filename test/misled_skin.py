"""The skin of a gripper that holds an object: two pads behind a serial CAN adapter, in a separate process.

    python test/misled_skin.py /tmp/port '{"side": 7.0}'

Each line on stdin is a command in JSON: {"set": {"is_frozen": true}}, {"lose": [417, 418]}, {"power_off": 48} or
{"unplug": true}. After "lose", the adapter loses all CAN frames with the given identifiers.
"""

import fcntl
import json
import sys
import termios
import time
from array import array
from collections.abc import Callable
from typing import Any

import can
import numpy as np

from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.simulator.world import Contact as Touching
from tactile_node.skin.pads import LivePad, make_pads, with_dictionaries

PADS, NODE_IDS, LAYOUT = ('left', 'right'), (32, 48), 'sim16x16.yaml'
PITCH = 0.002  # pitch of the layout sim16x16 [m]
FULL_SCALE = 100e3  # [Pa]


def gripper_pads() -> tuple[LivePad, ...]:
    return with_dictionaries(make_pads([LAYOUT], NODE_IDS, PADS))


class Object:
    """The held object. Every attribute of the object may be changed while the skin runs."""

    def __init__(self, **attributes: Any):
        self.side = 7.0  #: side of the square object [taxels]
        self.pressure = 0.5  #: pressure of the object [fraction of full scale]
        self.angle = 0.2  #: [rad]
        self.is_there = True
        self.x = 7.6  #: position of the object's centre if ``speed`` is 0 [taxels]
        self.is_frozen = False  #: True if the skin keeps sending its last values
        self.speed = 0.0  #: speed of the object along x, starting in the left part of the pad [m/s]
        self._began = time.monotonic()
        self._random = np.random.default_rng(5)
        self._last = {pad: np.zeros((16, 16)) for pad in PADS}
        self.set(attributes)

    def set(self, attributes: dict[str, Any]) -> None:
        for name, value in attributes.items():
            assert hasattr(self, name), name
            setattr(self, name, value)

    def source(self, pad: str) -> Callable[[float], np.ndarray]:
        def sample(_time: float) -> np.ndarray:
            if not self.is_frozen:
                self._last[pad] = self._frame()
            return self._last[pad]
        return sample

    def _frame(self) -> np.ndarray:
        x = self.x if not self.speed else 5.0 + self.speed * (time.monotonic() - self._began) / PITCH
        square = Touching('square', (self.side,), x=x, y=7.3, angle=self.angle) if self.is_there else None
        values = pressure_frame(square, self._random, 16, 16, pressure=self.pressure,
                                skin=Skin(full_scale=FULL_SCALE, blur=0.5, noise=0.005))
        return np.clip(values, 0, FULL_SCALE)


class LossyPort(SlcanPty):
    """An adapter that loses all CAN frames with the identifiers in ``lost_ids``."""

    def __init__(self, link: str):
        self.lost_ids: frozenset[int] = frozenset()
        super().__init__(link)

    def lose(self, can_ids: frozenset[int]) -> None:
        """From now on, lose all CAN frames with these identifiers.

        The method returns only after the host has read all earlier frames, which takes time.
        """
        self.lost_ids = can_ids
        waiting = array('i', [1])
        while waiting[0] or self._unsent:
            fcntl.ioctl(self._port_fd, termios.FIONREAD, waiting)
            time.sleep(0.001)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id not in self.lost_ids:
            super().send(msg, timeout)


def main() -> None:
    held, port = Object(**json.loads(sys.argv[2])), LossyPort(sys.argv[1])
    simulator = SkinSimulator(gripper_pads(), {pad: held.source(pad) for pad in PADS})
    simulator.start_on(port)
    print('ready', flush=True)
    for line in sys.stdin:
        (command, value), = json.loads(line).items()
        if command == 'set':
            held.set(value)
        elif command == 'lose':
            port.lose(frozenset(value))
        elif command == 'power_off':
            simulator.devices[value].power_off()
        else:
            assert command == 'unplug', command
            simulator.stop()
        print('done', flush=True)


if __name__ == '__main__':
    main()
