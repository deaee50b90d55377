"""Forward the records of Python's logger `tactile_node` to a node's logger, and so to /rosout and the console."""

import logging

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

PACKAGE_LOGGER = 'tactile_node'


class RosoutHandler(logging.Handler):
    """Forwards each record of level INFO or above once to ``node``, from any thread.

    If a process has several nodes, the node named in the record publishes it (see `of_node`). If the record names no
    node, the oldest node publishes it.
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
    """Return the ``extra`` of a log record that ``node`` reports, with further ``facts``."""
    return {'node': node.get_logger().name, **facts}


def forward_logs_to(node: Node) -> None:
    """Start to forward records to ``node``; call `stop_forwarding_to` before the node is destroyed."""
    package = logging.getLogger(PACKAGE_LOGGER)
    if all(handler.node is not node for handler in _handlers()):
        package.addHandler(RosoutHandler(node))
    if package.level == logging.NOTSET:
        package.setLevel(logging.INFO)  # because the default of the root logger would suppress INFO


def stop_forwarding_to(node: Node) -> None:
    """Stop forwarding records to ``node``. If no node is left, Python writes warnings to stderr."""
    for handler in _handlers():
        if handler.node is node:
            logging.getLogger(PACKAGE_LOGGER).removeHandler(handler)


def _handlers() -> list[RosoutHandler]:
    """Return the handlers of all nodes, oldest node first."""
    return [each for each in logging.getLogger(PACKAGE_LOGGER).handlers if isinstance(each, RosoutHandler)]


def _log(logger: RcutilsLogger, level: int, message: str) -> None:
    """Log with one line of code per severity, because rclpy refuses a line that logs with a changed severity."""
    if level >= logging.CRITICAL:
        logger.fatal(message)
    elif level >= logging.ERROR:
        logger.error(message)
    elif level >= logging.WARNING:
        logger.warning(message)
    else:
        logger.info(message)
