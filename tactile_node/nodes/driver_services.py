"""The services `~/tare` and `~/save_faulty_taxels` of a driver node."""

import threading
import traceback
from collections.abc import Callable, Mapping
from typing import NamedTuple

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.service import Service
from rclpy.task import Future
from std_srvs.srv import Trigger

from tactile_node.conditioning.faulty_taxels_file import save_faults
from tactile_node.conditioning.tare import Tare as Measured
from tactile_node.conditioning.tared_pad import TaredPad
from tactile_node.conditioning.taxel_faults import FaultyTaxels
from tactile_node.errors import ConfigurationError, TactileError, TareRefusal, TareRefusedError
from tactile_node.sources.frame_source import FrameSource
from tactile_node.threads import ReportedThread
from tactile_skin.srv import Tare

FRAMES = 50  #: Number of taxel frames averaged if a request does not give a number.
#: Longest duration of a tare request, for all its pads together [s]. A longer request is probably a mistake.
LONGEST = 60.0


class Zeroing(NamedTuple):
    """The pads to tare and the source of their frames."""

    pads: Mapping[str, TaredPad]  #: pads to tare, by pad name

    #: Returns the highest reading at which a taxel of the named pad still counts as not pressed, in the pad's unit.
    #: Raises ConfigurationError if the pad has no zero.
    limit: Callable[[str], float]
    frame_period: float  #: time between two taxel frames [s]
    source: FrameSource  #: source of the frames; it can also tell a device to zero itself


class TareService:
    """Serves `~/tare`, which measures the zero of the pads from their taxel frames.

    A separate thread measures the zero, so that the executor is not blocked. The service lives as long as its node,
    because rclpy cannot answer a request after its service was destroyed.
    """

    def __init__(self, node: Node):
        self._node = node
        self._zeroing: Zeroing | None = None
        self._thread: threading.Thread | None = None
        # in the default callback group, a running request would block all other callbacks
        group = ReentrantCallbackGroup()
        # wakes the executor, so that it sends the response
        self._answered = node.create_guard_condition(lambda: None, group)
        node.create_service(Tare, '~/tare', self._answer, callback_group=group)

    def begin(self, zeroing: Zeroing) -> None:
        """Prepare for a newly configured driver. The service refuses requests until ``expect`` is called."""
        self._zeroing = zeroing
        self.give_up('a configured one')

    def expect(self) -> None:
        """Accept tare requests from now on."""
        for pad in self._pads():
            pad.expect()

    def give_up(self, why: str) -> None:
        """Refuse a running tare request and all later ones. The refusal describes the driver as ``why``."""
        for pad in self._pads():
            pad.give_up(why)

    def end(self) -> None:
        """Refuse tare requests after the driver was cleaned up, and wait until a running request has ended."""
        if self._zeroing is not None:
            self.give_up('one that is cleaned up')
            self._zeroing = None
        if self._thread is not None:
            self._thread.join()

    def _pads(self) -> tuple[TaredPad, ...]:
        return () if self._zeroing is None else tuple(self._zeroing.pads.values())

    async def _answer(self, request: Tare.Request, response: Tare.Response) -> Tare.Response:
        """Answer a tare request without blocking the executor."""
        try:
            zeroing = self._ready()
        except TareRefusedError as error:
            response.refusal = error.refusal.value
            return self._logged(response, False, str(error))
        done = Future()
        self._thread = thread = ReportedThread(self._work, 'tare', zeroing, request, response, done)
        thread.start()
        return await done

    def _ready(self) -> Zeroing:
        if self._zeroing is None:
            raise TareRefusedError('tare', TareRefusal.DRIVER_NOT_ACTIVE, expected='a configured driver',
                                   got='an unconfigured driver', remedy='Configure and activate the driver first.')
        if self._thread is not None and self._thread.is_alive():
            raise TareRefusedError('tare', TareRefusal.BUSY, expected='one request at a time',
                                   got='a second request', remedy='Wait for the answer to the first request.')
        return self._zeroing

    def _work(self, zeroing: Zeroing, request: Tare.Request, response: Tare.Response, done: Future) -> None:
        reports: list[str] = []
        is_done = True
        names = list(dict.fromkeys(request.pads or zeroing.pads))
        for name in names:
            try:
                reports.append(_tared(zeroing, name, len(names), request=request, response=response))
            except TactileError as error:
                is_done = False
                if isinstance(error, TareRefusedError):
                    response.refusal = response.refusal or error.refusal.value
                reports.append(f'{name}: {error}')
            except Exception:  # an uncaught exception would end the thread, and the client would never get a response
                is_done = False
                reports.append(f'{name}: {traceback.format_exc()}')
        done.set_result(self._logged(response, is_done, ' '.join(reports)))
        self._answered.trigger()

    def _logged(self, response: Tare.Response, is_done: bool, message: str) -> Tare.Response:
        """Fill in the response, log its message and return the response."""
        response.success = is_done
        response.message = message
        logger = self._node.get_logger()
        if is_done:  # rclpy requires a separate call site for each severity
            logger.info(message)
        else:
            logger.error(message)
        return response


def _tared(zeroing: Zeroing, name: str, count: int, request: Tare.Request, response: Tare.Response) -> str:
    if name not in zeroing.pads:
        raise ConfigurationError('tare', expected=f'one of the pads {", ".join(zeroing.pads)}', got=repr(name),
                                 remedy='Leave pads empty to tare all pads.')
    pad, frames = zeroing.pads[name], request.frames or FRAMES
    given = frames, zeroing.limit(name), 1 + 2 * frames * zeroing.frame_period
    # on_device collects frames three times, each with the same timeout
    measurements = 3 if request.on_device else 1
    if measurements * count * given[2] > LONGEST:
        raise TareRefusedError('tare', TareRefusal.TOO_MANY_FRAMES,
                               expected=f'a request that takes at most {LONGEST:g} s',
                               got=f'{frames} frames of {zeroing.frame_period:g} s each on {count} pads',
                               remedy='Request fewer frames, or tare one pad after another.')
    if not request.on_device:
        return _noted(name, pad.tare(*given), response)
    source = zeroing.source
    channels, found = pad.tare_after(lambda: source.auto_zero(name), lambda: source.boots(name), *given)
    return _noted(name, found, response, f'{channels} channels zeroed on the device, then ')


def _noted(name: str, found: Measured, response: Tare.Response, on_device: str = '') -> str:
    response.tared.append(name)
    response.frames_used.append(found.frames)
    response.noise.append(found.noise)
    response.largest_offset.append(found.largest)
    return (f'{name}: {on_device}tared over {found.frames} frames, noise {found.noise:g} {found.unit}, '
            f'largest offset {found.largest:g} {found.unit}.')


def serve_faults(node: Node, path: str, faults: Callable[[], Mapping[str, FaultyTaxels]]) -> Service:
    """Create the service `~/save_faulty_taxels`, which writes the faulty taxels of all pads to a file.

    Parameters
    ----------
    node : Node
        Node that provides the service.
    path : str
        File to write. If the path is '', the service refuses every request.
    faults : callable
        Function that returns the faulty taxels of each pad, by pad name.
    """
    def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            if not path:
                raise ConfigurationError('parameter faulty_taxels_file', expected='the path of a file', got='none',
                                         remedy='Set the parameter, and configure the driver again.')
            found = faults()
            save_faults(path, found)
            response.success = True
            response.message = f'{sum(each.total for each in found.values())} faulty taxels written to {path}.'
        except ConfigurationError as error:
            response.success, response.message = False, str(error)
        return response
    return node.create_service(Trigger, '~/save_faulty_taxels', answer)
