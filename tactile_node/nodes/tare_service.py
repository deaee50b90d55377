"""The service `~/tare` of a driver node."""

from collections.abc import Callable, Mapping

from rclpy.node import Node

from tactile_node.conditioning.tare import Tare as Measured
from tactile_node.conditioning.tare import TaredPad
from tactile_node.errors import BusError, ConfigurationError, DeviceError, TareRefusedError
from tactile_skin.srv import Tare

FRAMES = 50  #: averaged unless the request says otherwise
LONGEST = 10.0  #: s: the executor waits for all pads of a request


class TareService:
    """A request measures the zero of ``pads`` (by name) from the frames they are fed, on the executor's thread.

    ``limit``: a pad's name -> what a taxel may read at most [unit] to count as not pressed; ConfigurationError
    where it has no zero. ``auto_zero``: a pad's name -> its devices zero themselves; see FrameSource.
    """

    def __init__(self, node: Node, pads: Mapping[str, TaredPad], limit: Callable[[str], float], frame_period: float,
                 auto_zero: Callable[[str], int]):
        self._node, self._pads, self._limit, self._period = node, pads, limit, frame_period
        self._auto_zero = auto_zero
        self._service = node.create_service(Tare, '~/tare', self._answer)

    def destroy(self) -> None:
        self._node.destroy_service(self._service)

    def _answer(self, request: Tare.Request, response: Tare.Response) -> Tare.Response:
        told, response.success = [], True
        names = list(dict.fromkeys(request.pads or self._pads))
        for name in names:
            try:
                told.append(self._tared(name, len(names), request, response))
            except (TareRefusedError, ConfigurationError, DeviceError, BusError) as error:
                response.success = False
                told.append(f'{name}: {error}')
        response.message = ' '.join(told)
        logger = self._node.get_logger()
        if response.success:  # rclpy wants each severity to have a line of its own
            logger.info(response.message)
        else:
            logger.error(response.message)
        return response

    def _tared(self, name: str, count: int, request: Tare.Request, response: Tare.Response) -> str:
        if name not in self._pads:
            raise ConfigurationError('tare', expected=f'one of the pads {", ".join(self._pads)}', got=repr(name),
                                     remedy='Leave pads empty for all of them.')
        pad, frames = self._pads[name], request.frames or FRAMES
        given = frames, self._limit(name), 1 + 2 * frames * self._period
        if count * given[2] > LONGEST:
            raise TareRefusedError('tare', expected=f'so few frames that all is done in {LONGEST:g} s at most',
                                   got=f'{frames} of {self._period:g} s each on {count} pads',
                                   remedy='Ask for fewer frames, or for one pad after another.')
        if not request.on_device:
            return self._told(name, pad.tare(*given), response)
        channels, found = pad.tare_after(lambda: self._auto_zero(name), *given)
        return self._told(name, found, response, f'{channels} channels zeroed on the device, then ')

    def _told(self, name: str, found: Measured, response: Tare.Response, on_device: str = '') -> str:
        response.tared.append(name)
        response.frames_used.append(found.frames)
        response.noise.append(found.noise)
        response.largest_offset.append(found.largest)
        return (f'{name}: {on_device}tared over {found.frames} frames, noise {found.noise:.3g}, '
                f'largest offset {found.largest:.3g}.')
