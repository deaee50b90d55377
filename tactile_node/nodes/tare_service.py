"""The service `~/tare` of a driver node."""

from collections.abc import Callable, Mapping

from rclpy.node import Node

from tactile_node.conditioning.tare import TaredPad
from tactile_node.errors import ConfigurationError, TareRefusedError
from tactile_skin.srv import Tare

FRAMES = 50  #: averaged unless the request says otherwise


class TareService:
    """A request measures the zero of ``pads`` (by name) from the frames they are fed, on the executor's thread.

    ``limit``: a pad's name -> what a taxel may read at most [unit] to count as not pressed; ConfigurationError
    where it has no zero.
    """

    def __init__(self, node: Node, pads: Mapping[str, TaredPad], limit: Callable[[str], float], frame_period: float):
        self._node, self._pads, self._limit, self._period = node, pads, limit, frame_period
        self._service = node.create_service(Tare, '~/tare', self._answer)

    def destroy(self) -> None:
        self._node.destroy_service(self._service)

    def _answer(self, request: Tare.Request, response: Tare.Response) -> Tare.Response:
        told, response.success = [], True
        for name in request.pads or self._pads:
            try:
                told.append(self._tared(name, request.frames or FRAMES, response))
            except (TareRefusedError, ConfigurationError) as error:
                response.success = False
                told.append(f'{name}: {error}')
        response.message = ' '.join(told)
        logger = self._node.get_logger()
        if response.success:  # rclpy wants each severity to have a line of its own
            logger.info(response.message)
        else:
            logger.error(response.message)
        return response

    def _tared(self, name: str, frames: int, response: Tare.Response) -> str:
        if name not in self._pads:
            raise ConfigurationError('tare', expected=f'one of the pads {", ".join(self._pads)}', got=repr(name),
                                     remedy='Leave pads empty for all of them.')
        found = self._pads[name].tare(frames, self._limit(name), 1 + 2 * frames * self._period)
        response.tared.append(name)
        response.frames_used.append(found.frames)
        response.noise.append(found.noise)
        response.largest_offset.append(found.largest)
        return f'{name}: tared over {found.frames} frames, noise {found.noise:.3g}, largest offset {found.largest:.3g}.'
