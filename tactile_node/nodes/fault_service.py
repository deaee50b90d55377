"""The service `~/save_faulty_taxels` of a driver node."""

from collections.abc import Callable, Mapping

from rclpy.node import Node
from std_srvs.srv import Trigger

from tactile_node.conditioning.fault_file import save_faults
from tactile_node.conditioning.taxel_faults import FaultyTaxels
from tactile_node.errors import ConfigurationError


class FaultService:
    """Writes what ``faults()`` gives, by pad, to the file ``path``."""

    def __init__(self, node: Node, path: str, faults: Callable[[], Mapping[str, FaultyTaxels]]):
        self._node = node
        self._path = path
        self._faults = faults
        self._service = node.create_service(Trigger, '~/save_faulty_taxels', self._answer)

    def destroy(self) -> None:
        self._node.destroy_service(self._service)

    def _answer(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            if not self._path:
                raise ConfigurationError('parameter faulty_taxels_file', expected='the path of a file', got='none',
                                         remedy='Set it, and configure the driver again.')
            faults = self._faults()
            save_faults(self._path, faults)
            response.success = True
            response.message = f'{sum(found.total for found in faults.values())} faulty taxels written to {self._path}.'
        except ConfigurationError as error:
            response.success, response.message = False, str(error)
        return response
