"""Forwards the records of Python's logger `tactile_node` to a node's logger, and so to /rosout and the console."""

import logging
from weakref import WeakKeyDictionary

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

PACKAGE_LOGGER = 'tactile_node'


class RosoutHandler(logging.Handler):
    """Forwards each record of level INFO and above once, from any thread: to the node that was added first.

    A record names no node, so of several nodes in one process the oldest one publishes for all of them. Where no node
    is left, warnings and errors go to stderr, as Python's logging does by default.
    """

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._loggers: WeakKeyDictionary[Node, RcutilsLogger] = WeakKeyDictionary()  # oldest node first

    @property
    def is_empty(self) -> bool:
        return not self._loggers

    def add(self, node: Node) -> None:
        self.acquire()
        try:
            self._loggers.setdefault(node, node.get_logger())
        finally:
            self.release()

    def remove(self, node: Node) -> None:
        self.acquire()
        try:
            self._loggers.pop(node, None)
        finally:
            self.release()

    def emit(self, record: logging.LogRecord) -> None:
        logger = next(iter(self._loggers.values()), None)
        if logger is None:
            self._last_resort(record)
            return
        try:
            _log(logger, record.levelno, self.format(record))
        except Exception:
            self.handleError(record)

    @staticmethod
    def _last_resort(record: logging.LogRecord) -> None:
        if logging.lastResort is not None and record.levelno >= logging.lastResort.level:
            logging.lastResort.handle(record)


def forward_logs_to(node: Node) -> None:
    """Begin to forward records to ``node``; call `stop_forwarding_to` before it is destroyed."""
    package = logging.getLogger(PACKAGE_LOGGER)
    handler = _handler()
    if handler is None:
        handler = RosoutHandler()
        package.addHandler(handler)
        if package.level == logging.NOTSET:
            package.setLevel(logging.INFO)  # the root's default would withhold INFO
    handler.add(node)


def stop_forwarding_to(node: Node) -> None:
    """Forward no record to ``node`` any more."""
    handler = _handler()
    if handler is None:
        return
    handler.remove(node)
    if handler.is_empty:
        logging.getLogger(PACKAGE_LOGGER).removeHandler(handler)


def _handler() -> RosoutHandler | None:
    handlers = logging.getLogger(PACKAGE_LOGGER).handlers
    return next((handler for handler in handlers if isinstance(handler, RosoutHandler)), None)


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
