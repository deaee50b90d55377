"""Finds the bit rate of a bus by listening at each in turn; sends nothing, not even an acknowledgement.

A controller in listen-only mode disturbs no bus, whatever its bit rate. It also acknowledges nothing: frames get
through only where two other nodes are on the bus, since one alone repeats its first frame until another acknowledges.
"""

import time
from typing import NamedTuple

import can

from tactile_node.bus.bus_network import open_bus
from tactile_node.errors import BusError, ConfigurationError

#: bit/s, of CiA 301 (5.4): first those in use for skins
RATES = (1_000_000, 500_000, 250_000, 125_000, 800_000, 50_000, 20_000, 10_000)
LISTEN_ONLY = {'slcan': {'listen_only': True}}  #: options of python-can, by interface
SETTLED = 0.1  #: s after opening, of which frames do not count: lines cut by the change may come
ENOUGH = 10    #: sound frames: more prove no more
_REMEDY = ('At least two other nodes have to be on the bus, and one of them has to send, such as a heartbeat. The '
           'adapter has to know the command L (listen only); CANable 2.0 as delivered does not. Otherwise give the '
           'bit rate.')
_BY_HAND = {'socketcan': 'The bit rate is set by "ip link set {channel} down", then "ip link set {channel} up type can '
                         'bitrate 500000 listen-only on", and so on; candump shows whether frames come.'}


class RateTried(NamedTuple):
    """What was heard at one bit rate."""

    bitrate: int       #: bit/s
    frames: int        #: sound ones
    error_frames: int

    @property
    def is_right(self) -> bool:
        """At another bit rate no CRC is right, and no frame sound."""
        return self.frames > 0 and not self.error_frames


def find_bit_rate(interface: str, channel: str, listen: float) -> int:
    """Return the bit rate [bit/s] at which sound frames and no others come within ``listen`` [s].

    Raises ConfigurationError for an interface that cannot do it, BusError where there is no such bit rate.
    """
    if interface not in LISTEN_ONLY:
        raise ConfigurationError('--bitrate', expected=f'a number, with interface {interface}', got='auto',
                                 remedy=_BY_HAND.get(interface, 'Only these find it: ' + ', '.join(LISTEN_ONLY) + '.')
                                 .format(channel=channel))
    tried = []
    for bitrate in RATES:
        tried.append(heard_at(interface, channel, bitrate, listen))
        if tried[-1].is_right:
            return bitrate
    heard = ', '.join(f'{each.bitrate / 1000:g} kbit/s: {each.frames} ({each.error_frames} error frames)'
                      for each in tried if each.frames or each.error_frames)
    raise BusError(f'CAN bus {interface} {channel}', got=heard or 'no frames',
                   expected=f'sound frames and no error frames at one of {len(RATES)} bit rates', remedy=_REMEDY)


def heard_at(interface: str, channel: str, bitrate: int, listen: float) -> RateTried:
    """Listen at one bit rate, for as long as it may be right. Raises BusError."""
    frames = error_frames = 0
    bus = open_bus(interface, channel, bitrate, LISTEN_ONLY[interface])
    try:
        begun = time.monotonic()
        while frames < ENOUGH and not error_frames and (left := begun + SETTLED + listen - time.monotonic()) > 0:
            message = bus.recv(left)
            if message is not None and time.monotonic() >= begun + SETTLED:
                frames += not message.is_error_frame
                error_frames += message.is_error_frame
    except (can.CanError, OSError) as error:
        raise BusError(f'CAN bus {interface} {channel}', expected='to receive', got=str(error),
                       remedy='Check the adapter.') from error
    finally:
        bus.shutdown()
    return RateTried(bitrate, frames, error_frames)
