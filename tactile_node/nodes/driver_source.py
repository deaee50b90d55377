"""Create the source of the driver's taxel frames from its settings: a live bus or a recorded log."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from tactile_node.assembly.router import OnFrame
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.chain import Chain
from tactile_node.errors import ConfigurationError
from tactile_node.logs.log_writer import MEGABYTE
from tactile_node.ros.settings import DriverSettings
from tactile_node.skin.pads import PadSettings, live_pads, make_pads, one_for_each, with_dictionaries
from tactile_node.sources.frame_source import FrameSource
from tactile_node.sources.log_source import LogSource
from tactile_node.sources.supervisor import Supervisor

#: Smallest number of missing heartbeats after which a node may count as lost. A single missing heartbeat may just be
#: late.
HEARTBEATS_LOST = 2


def driver_pads(settings: DriverSettings) -> tuple[PadSettings, ...]:
    """Return the pads of the driver. For a live bus, the pads include the object dictionaries from their EDS files.

    Raises ConfigurationError if the parameters, a layout or an EDS file cannot be used.
    """
    if not settings.pads:
        raise ConfigurationError('parameter pads', expected='a name for each pad', got='none', remedy='Name a pad.')
    mirrored = [name for name in settings.mirrored_pads if name]
    if unknown := [name for name in mirrored if name not in settings.pads]:
        raise ConfigurationError('parameter mirrored_pads', expected=f'names of {", ".join(settings.pads)}',
                                 got=', '.join(unknown), remedy='Correct the name of the pad.')
    pads = tuple(replace(pad, layout=pad.layout.mirrored()) if pad.name in mirrored else pad
                 for pad in make_pads(settings.layouts, settings.node_ids, settings.pads))
    return pads if settings.replay else with_dictionaries(pads, settings.eds)  # pads of a log need no EDS file


def pad_frames(settings: DriverSettings, pads: Sequence[PadSettings]) -> list[str]:
    """Return the coordinate frame of each pad. Raises ConfigurationError if the number of frame_ids is wrong."""
    frame_ids = one_for_each('frame_ids', settings.frame_ids, pads)
    return [settings.frame_prefix + (frame_id or f'{pad.name}_pad') for pad, frame_id in zip(pads, frame_ids)]


def check_heartbeat(settings: DriverSettings) -> None:
    """Raise ConfigurationError if heartbeat_timeout is shorter than HEARTBEATS_LOST heartbeat periods.

    The check is skipped for a log, because a replay does not configure the heartbeat periods of devices.
    """
    if not settings.replay and settings.heartbeat_timeout < HEARTBEATS_LOST * settings.heartbeat_period:
        raise ConfigurationError('parameters heartbeat_period and heartbeat_timeout',
                                 expected=f'a timeout of {HEARTBEATS_LOST} periods or more',
                                 got=f'{settings.heartbeat_period:g} and {settings.heartbeat_timeout:g} s',
                                 remedy='Raise heartbeat_timeout.')


def make_source(settings: DriverSettings, pads: tuple[PadSettings, ...], on_frame: OnFrame, chain: Chain,
                on_time: Callable[[float], object]) -> FrameSource:
    """Return the supervised bus, or the log to replay, without opening it.

    Parameters
    ----------
    settings : DriverSettings
        Settings of the driver.
    pads : tuple of PadSettings
        Pads of the driver.
    on_frame : callable
        Function that the source calls with the name of the pad for each taxel frame: a bus on the chain thread, and a
        log on its own thread.
    chain : Chain
        Chain on which a bus assembles the frames.
    on_time : callable
        Function that a log calls with the current replay time [s].

    Raises
    ------
    ConfigurationError
        Raised if both replay and record are set, or if heartbeat_timeout is too short.
    """
    if settings.replay and settings.record:
        raise ConfigurationError('parameters replay and record', expected='only one of the two, because a replay '
                                 'cannot be recorded', got=f'{settings.replay!r} and {settings.record!r}',
                                 remedy='Unset one of the two. To duplicate a log, copy its file.')
    if settings.replay:
        return LogSource(settings.replay, pads, on_frame, pace=settings.replay_pace or None,
                         drop_incomplete=settings.drop_incomplete, channel=settings.replay_channel, eds=settings.eds,
                         on_message=lambda message: on_time(message.timestamp))
    check_heartbeat(settings)
    bus = BusSettings(interface=settings.interface, channel=settings.channel, bitrate=settings.bitrate,
                      sync_period=settings.sync_period, produce_sync=settings.produce_sync,
                      boot_timeout=settings.boot_timeout, drop_incomplete=settings.drop_incomplete,
                      record=settings.record, record_largest=round(settings.record_rotate_mb * MEGABYTE),
                      sdo_timeout=settings.sdo_timeout, sdo_retries=settings.sdo_retries,
                      allow_full_bus=settings.allow_full_bus,
                      heartbeat_ms=round(1000 * settings.heartbeat_period))
    return Supervisor(bus, live_pads(pads), on_frame, recover=settings.recover,
                      heartbeat_timeout=settings.heartbeat_timeout, chain=chain)
