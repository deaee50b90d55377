"""Forwards the records of Python's logger `tactile_node` to a node's logger, and so to /rosout and the console."""

import logging

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

PACKAGE_LOGGER = 'tactile_node'


class RosoutHandler(logging.Handler):
    """Forwards each record of level INFO and above once, from any thread, to ``node``.

    Of several nodes in one process, the node of the record publishes it (`of_node`); the oldest one if it names none.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(logging.INFO)
        self.node, self._logger = node, node.get_logger()
        self.node_name = self._logger.name

    def emit(self, record: logging.LogRecord) -> None:
        handlers = _handlers()
        named = [each for each in handlers if each.node_name == getattr(record, 'node', None)]
        if self is not next(iter(named or handlers), self):
            return
        try:
            _log(self._logger, record.levelno, self.format(record))
        except Exception:
            self.handleError(record)


def of_node(node: Node, **facts: object) -> dict[str, object]:
    """Return the ``extra`` of a record that ``node`` reports, with ``facts``."""
    return {'node': node.get_logger().name, **facts}


def forward_logs_to(node: Node) -> None:
    """Begin to forward records to ``node``; call `stop_forwarding_to` before it is destroyed."""
    package = logging.getLogger(PACKAGE_LOGGER)
    if all(handler.node is not node for handler in _handlers()):
        package.addHandler(RosoutHandler(node))
    if package.level == logging.NOTSET:
        package.setLevel(logging.INFO)  # the root's default would withhold INFO


def stop_forwarding_to(node: Node) -> None:
    """Forward no record to ``node`` any more; where no node is left, warnings go to stderr, as Python does it."""
    for handler in _handlers():
        if handler.node is node:
            logging.getLogger(PACKAGE_LOGGER).removeHandler(handler)


def _handlers() -> list[RosoutHandler]:
    """Return those of the nodes, of the oldest node first."""
    return [each for each in logging.getLogger(PACKAGE_LOGGER).handlers if isinstance(each, RosoutHandler)]


def _log(logger: RcutilsLogger, level: int, message: str) -> None:
    """One line for each severity: rclpy refuses a line of code that logs with another severity than before."""
    if level >= logging.CRITICAL:
        logger.fatal(message)
    elif level >= logging.ERROR:
        logger.error(message)
    elif level >= logging.WARNING:
        logger.warning(message)
    else:
        logger.info(message)
