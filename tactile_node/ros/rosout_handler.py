"""Forward the records of Python's logger `tactile_node` to a node's logger, which writes to /rosout and the console.
"""

import logging

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

PACKAGE_LOGGER = 'tactile_node'


class RosoutHandler(logging.Handler):
    """Forwards log records of level INFO or above to ``node``, from any thread.

    If a process has several nodes, only one of them publishes a record: the node that the record names (see `of_node`)
    or, if the record names no node, the oldest node.
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
    """Return the argument ``extra`` that adds ``facts`` to a log record and makes ``node`` publish the record."""
    return {'node': node.get_logger().name, **facts}


def forward_logs_to(node: Node) -> None:
    """Start forwarding records to ``node``. Call `stop_forwarding_to` before the node is destroyed."""
    package = logging.getLogger(PACKAGE_LOGGER)
    if all(handler.node is not node for handler in _handlers()):
        package.addHandler(RosoutHandler(node))
    if package.level == logging.NOTSET:
        package.setLevel(logging.INFO)  # the default of the root logger would suppress INFO


def stop_forwarding_to(node: Node) -> None:
    """Stop forwarding records to ``node``. If no node remains, Python writes warnings to stderr."""
    for handler in _handlers():
        if handler.node is node:
            logging.getLogger(PACKAGE_LOGGER).removeHandler(handler)


def _handlers() -> list[RosoutHandler]:
    """Return the handlers of all nodes, beginning with the oldest node."""
    return [each for each in logging.getLogger(PACKAGE_LOGGER).handlers if isinstance(each, RosoutHandler)]


def _log(logger: RcutilsLogger, level: int, message: str) -> None:
    """Log from a separate call site for each severity, as rclpy requires."""
    if level >= logging.CRITICAL:
        logger.fatal(message)
    elif level >= logging.ERROR:
        logger.error(message)
    elif level >= logging.WARNING:
        logger.warning(message)
    else:
        logger.info(message)
