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

from tactile_node.assembly.frame_source import FrameSource
from tactile_node.conditioning.tare import Tare as Measured
from tactile_node.conditioning.tare import TaredPad
from tactile_node.conditioning.taxel_faults import FaultyTaxels, save_faults
from tactile_node.errors import ConfigurationError, TactileError, TareRefusal, TareRefusedError
from tactile_node.threads import ReportedThread
from tactile_skin.srv import Tare

FRAMES = 50  #: Number of frames averaged by default.
LONGEST = 60.0  #: Longest duration of a request for all its pads [s]. A longer request is refused as a mistake.


class Zeroing(NamedTuple):
    """The pads and the source that a tare works on."""

    pads: Mapping[str, TaredPad]  #: by name of the pad
    #: Returns, for the name of a pad, the highest reading at which a taxel counts as not pressed, in the unit of the
    #: pad. It raises ConfigurationError if the pad has no zero.
    limit: Callable[[str], float]
    frame_period: float  #: time between two frames [s]
    source: FrameSource  #: gives access to devices that zero themselves


class TareService:
    """The service `~/tare`. It measures the zero of pads from their frames.

    A thread does the work, so the executor is not blocked.
    The service exists as long as its node, because rclpy cannot answer a request after the service was destroyed.
    """

    def __init__(self, node: Node):
        self._node = node
        self._zeroing: Zeroing | None = None
        self._thread: threading.Thread | None = None
        group = ReentrantCallbackGroup()  # in the default group, a running request would block all other callbacks
        self._answered = node.create_guard_condition(lambda: None, group)  # wakes the executor to send an answer
        node.create_service(Tare, '~/tare', self._answer, callback_group=group)

    def begin(self, zeroing: Zeroing) -> None:
        """Prepare for a newly configured driver. Requests are refused until ``expect`` is called."""
        self._zeroing = zeroing
        self.give_up('a configured one')

    def expect(self) -> None:
        """Serve requests from now on."""
        for pad in self._pads():
            pad.expect()

    def give_up(self, why: str) -> None:
        """Refuse requests from now on, including a running one. ``why`` describes the driver in the refusal."""
        for pad in self._pads():
            pad.give_up(why)

    def end(self) -> None:
        """Refuse requests, because the driver is no longer configured, and wait until a running request has ended."""
        if self._zeroing is not None:
            self.give_up('one that is cleaned up')
            self._zeroing = None
        if self._thread is not None:
            self._thread.join()

    def _pads(self) -> tuple[TaredPad, ...]:
        return () if self._zeroing is None else tuple(self._zeroing.pads.values())

    async def _answer(self, request: Tare.Request, response: Tare.Response) -> Tare.Response:
        """Answer a request, without blocking the executor."""
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
                                   got='one that is not', remedy='Configure and activate it first.')
        if self._thread is not None and self._thread.is_alive():
            raise TareRefusedError('tare', TareRefusal.BUSY, expected='one request at a time',
                                   got='a second one', remedy='Wait for the answer to the first request.')
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
            except Exception:  # it would end the thread, and the client would get no answer
                is_done = False
                reports.append(f'{name}: {traceback.format_exc()}')
        done.set_result(self._logged(response, is_done, ' '.join(reports)))
        self._answered.trigger()

    def _logged(self, response: Tare.Response, is_done: bool, message: str) -> Tare.Response:
        """Fill in the response, log its message and return it."""
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
                                 remedy='Leave pads empty to tare all of them.')
    pad, frames = zeroing.pads[name], request.frames or FRAMES
    given = frames, zeroing.limit(name), 1 + 2 * frames * zeroing.frame_period
    measurements = 3 if request.on_device else 1  # the device is measured before, between and after
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
        Node that serves requests.
    path : str
        File to write; '' if the user gave none, and requests are then refused.
    faults : callable
        Returns the faulty taxels by name of the pad.
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
