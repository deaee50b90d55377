"""Pads for tests of the viewers: hand-made states, and a source that the test controls."""

import time

import numpy as np

from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.source import Store
from tactile_node.viewing.states import PadState, SeenContact

NAN = float('nan')
PITCH = 0.004


def contact(shape='square', outline=((0.004, 0.004), (0.012, 0.004), (0.012, 0.012), (0.004, 0.012)), **changed):
    is_shape = shape not in ('unknown', 'none')
    fields = {'shape': shape, 'reason': 'not_seen' if shape == 'unknown' else '', 'probabilities': {shape: 0.97},
              'outline': np.array(outline) if is_shape else None, 'force': 1.5, 'size_is_bound': False,
              'dimensions': (('side', 0.008),) if is_shape else (), 'mask': None} | changed
    return SeenContact(**fields)


def state(pad='left', stamp=100.0, shape='square', values=None, acquired=None, **changed):
    """Return the state of a pad of 4 x 4 taxels at 50 kPa."""
    values = np.full((4, 4), 50e3) if values is None else np.asarray(values, float)
    status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
    fields = {'status': status, 'pitch': PITCH, 'unit': 'Pa', 'contact': contact(shape)} | changed
    return PadState(pad, stamp, time.monotonic() if acquired is None else acquired, values, **fields)


class HandSource:
    """A source of a viewer whose store the test fills.

    ``begun`` and ``ended`` count the calls of `start` and `stop`.
    """

    player = None
    title = 'by hand'

    def __init__(self, pads=('left', 'right')):
        self.store = Store(pads)
        self.begun = self.ended = 0

    def check(self):
        pass

    def start(self):
        self.begun += 1

    def stop(self):
        self.ended += 1

    def close(self):
        pass

    def age(self, seen):
        return time.monotonic() - seen.acquired
