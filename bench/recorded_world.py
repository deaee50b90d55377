"""What an hour of two pads puts on a bus and on topics, made as fast as it can be: one second after the other.

Two pads of 16x16 taxels of 8 bits at 100 Hz on one bus: SYNC, 64 TPDOs a sweep, heartbeats; a contact that wanders,
grows and pauses, and noise of a count. Topics as the nodes publish them: taxels, contact and shape of each pad, grasp.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import can
import numpy as np
from rosbags import typesys

from tactile_node.logs.topic_bag import message_types
from tactile_node.skin.layout_file import load_layout

RATE, NODES, PADS, SIDE = 100, (32, 64), ('left', 'right'), 16
BEGIN = 1_700_000_000.0  # s, Unix epoch
BITS = 135e-6  # s of a TPDO of 8 bytes at 1 Mbit/s, with the most stuff bits
PRESS = 5      # counts from which on a taxel is pressed
NOISE = 1.0    # counts
SECOND = 10**9  # ns
MESSAGES = ('TaxelArray', 'Contact', 'ContactShape', 'Grasp')
CLASSES = ('none', 'unknown', 'circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle', 'other')
PARAMETERS = ('x', 'y', 'angle', 'long', 'short')
CORNERS = 24  # of an outline


class TopicMessage(NamedTuple):
    topic: str
    time: int  #: [ns]
    cdr: bytes


class World:
    """Reproducible; ``seconds`` may be asked for in their order alone."""

    def __init__(self, seed: int = 16):
        self._rng = np.random.default_rng(seed)
        self._layout = load_layout('sim16x16.yaml')
        self._scale = self._layout.value.scale
        order = [(field.row, field.col) for carrier in self._layout.tpdos for field in carrier.taxels]
        self._rows, self._cols = np.array(order).T
        self._cob_ids = [tpdo.cob_id.of(node) for node in NODES for tpdo in self._layout.tpdos]
        self.types = message_types(typesys, MESSAGES)

    def counts(self, second: int) -> np.ndarray:
        """Return the taxels of a second, (sweeps, pads, rows, cols), uint8."""
        times = second + np.arange(RATE) / RATE
        rows, cols = np.indices((SIDE, SIDE))
        found = np.empty((RATE, len(PADS), SIDE, SIDE), np.uint8)
        for pad in range(len(PADS)):
            load = np.clip(4 * np.sin(2 * np.pi * times / 7.3 + pad * 0.2), 0, 1)[:, None, None]
            row, col = (7.5 + 4 * np.sin(times / period + pad)[:, None, None] for period in (11.0, 17.0))
            radius = 3.0 + np.sin(times / 23.0)[:, None, None]
            pressed = 150 * load / (1 + np.exp(3 * (np.hypot(rows - row, cols - col) - radius)))
            noise = self._rng.normal(0, NOISE, pressed.shape)
            found[:, pad] = np.clip(np.rint(pressed + noise), 0, 255)
        return found

    def can_frames(self, second: int, counts: np.ndarray) -> Iterator[can.Message]:
        payloads = counts[:, :, self._rows, self._cols].reshape(RATE, -1, 8)
        jitter = self._rng.normal(0, 20e-6, (RATE, len(self._cob_ids)))
        for sweep in range(RATE):
            at = BEGIN + second + sweep / RATE
            yield can.Message(at, 0x80, False, channel='can0')
            if sweep == 0:
                for node in NODES:
                    yield can.Message(at + 60e-6, 0x700 + node, False, data=b'\x05', channel='can0')
            for place, (cob_id, data) in enumerate(zip(self._cob_ids, payloads[sweep])):
                yield can.Message(at + 4e-4 + place * BITS + jitter[sweep, place], cob_id, False, data=data.tobytes(),
                                  channel='can0')

    def messages(self, second: int, counts: np.ndarray) -> Iterator[TopicMessage]:
        for sweep in range(RATE):
            sequence, time = RATE * second + sweep, int((BEGIN + second) * SECOND) + sweep * SECOND // RATE
            sides = []
            for pad, taken in zip(PADS, counts[sweep]):
                header = self._header(time, f'{pad}_pad')
                values, pressed = taken.astype(np.float32) * np.float32(self._scale), taken >= PRESS
                yield self._message(f'/{pad}/taxels', time + 12_000_000, 'TaxelArray', header=header, rows=SIDE,
                                    cols=SIDE, sequence=sequence, pitch=0.002, unit='Pa', values=values.ravel(),
                                    status=np.ones(values.size, np.uint8))
                yield self._message(f'/{pad}/contact', time + 15_000_000, 'Contact', header=header, rows=SIDE,
                                    cols=SIDE, sequence=sequence, state=3 if pressed.any() else 2, pad_seen=True,
                                    pitch=0.002, unit='Pa', values=values.ravel(), contacts=int(pressed.any()),
                                    status=np.ones(values.size, np.uint8), labels=pressed.astype(np.uint8).ravel(),
                                    contact_taxels=np.array([pressed.sum()], np.uint32),
                                    noise_floor=np.full(values.size, 400, np.float32))
                sides.append(self._shape(header, sequence, int(pressed.sum())))
                yield TopicMessage(f'/{pad}/shape', time + 22_000_000, self._cdr(sides[-1]))
            yield self._message('/grasp', time + 25_000_000, 'Grasp', header=self._header(time, 'gripper'), sides=sides,
                                side_states=np.array([3, 3], np.uint8), contact=4, fresh=True, gap=0.03)

    def _shape(self, header: Any, sequence: int, taxels: int) -> Any:
        """Of what it holds, all numbers that differ from frame to frame are drawn."""
        kinds, drawn = self.types.types, self._rng.random
        angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False) + drawn()
        corners = [kinds['geometry_msgs/msg/Point32'](float(x), float(y), 0.0)
                   for x, y in zip(np.cos(angles) * 0.006, np.sin(angles) * 0.006)]
        return default(self.types, 'tactile_skin/msg/ContactShape', header=header, sequence=sequence, shape=3,
                       class_name='circle', confidence=drawn(), class_names=list(CLASSES), method='learned',
                       probabilities=drawn(len(CLASSES)).astype(np.float32), taxels=taxels, fit_valid=True,
                       frame_probabilities=drawn(len(CLASSES)).astype(np.float32), pad_seen=True,
                       contact_areas=drawn(1), dimension_names=list(PARAMETERS[3:]), dimensions=drawn(2),
                       parameter_names=list(PARAMETERS), standard_deviations=drawn(5), covariance=drawn(25),
                       outline=kinds['geometry_msgs/msg/Polygon'](corners), force=drawn(), force_sd=drawn(),
                       contact_area=drawn(), residual=drawn())

    def _header(self, time: int, frame_id: str) -> Any:
        kinds = self.types.types
        return kinds['std_msgs/msg/Header'](kinds['builtin_interfaces/msg/Time'](*divmod(time, SECOND)), frame_id)

    def _message(self, topic: str, time: int, name: str, **fields: Any) -> TopicMessage:
        return TopicMessage(topic, time, self._cdr(default(self.types, f'tactile_skin/msg/{name}', **fields)))

    def _cdr(self, message: Any) -> bytes:
        return bytes(self.types.serialize_cdr(message, message.__msgtype__))


def topics() -> dict[str, str]:
    """Return the type of each topic."""
    found = {f'/{pad}/{topic}': kind for pad in PADS for topic, kind in (
        ('taxels', 'TaxelArray'), ('contact', 'Contact'), ('shape', 'ContactShape'))}
    return {topic: f'tactile_skin/msg/{kind}' for topic, kind in (found | {'/grasp': 'Grasp'}).items()}


def default(types: Any, kind: str, **fields: Any) -> Any:
    """Return a message with ``fields``, and zeros or nothing elsewhere."""
    return types.types[kind](**{name: fields[name] if name in fields else _empty(types, described)
                                for name, described in types.fielddefs[kind][1]})


def _empty(types: Any, described: tuple) -> Any:
    kind, detail = described
    if kind == kind.NAME:
        return default(types, detail)
    if kind == kind.BASE:
        return '' if detail[0] == 'string' else False if detail[0] == 'bool' else 0
    inner, count = detail
    if inner[0] == inner[0].NAME or inner[1][0] == 'string':
        return [_empty(types, inner) for _ in range(count)]
    return np.zeros(count, inner[1][0])
