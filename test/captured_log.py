"""Collects the package's log records, for tests that run longer than one caplog phase or outside pytest."""

import logging
from collections import deque
from typing import NamedTuple

KEPT = 10_000  #: Largest number of log records in memory, because a fuzzing run takes hours.


class Logged(NamedTuple):
    level: int
    message: str
    fact: object  #: the fault, error, EMCY or command that the log record reports, or None


class CapturedLog(logging.Handler):
    """Context manager that collects the log records of ``tactile_node`` from level INFO on."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._logger = logging.getLogger('tactile_node')
        self._level_before = logging.NOTSET
        self._records: deque[Logged] = deque(maxlen=KEPT)

    def __enter__(self) -> 'CapturedLog':
        self._level_before = self._logger.level
        self._logger.setLevel(logging.INFO)
        self._logger.addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        self._logger.removeHandler(self)
        self._logger.setLevel(self._level_before)

    def emit(self, record: logging.LogRecord) -> None:
        self._records.append(Logged(record.levelno, record.getMessage(), getattr(record, 'fact', None)))

    @property
    def records(self) -> list[Logged]:
        """All log records, oldest first."""
        return list(self._records.copy())

    @property
    def messages(self) -> list[str]:
        """Texts of all log records, oldest first."""
        return [record.message for record in self._records.copy()]

    @property
    def facts(self) -> list[object]:
        """Facts of all log records, oldest first."""
        return [record.fact for record in self._records.copy() if record.fact is not None]

    @property
    def error_facts(self) -> list[object]:
        """Facts of all warnings and errors, oldest first."""
        return [record.fact for record in self.records if record.level >= logging.WARNING and record.fact is not None]

    @property
    def errors(self) -> list[str]:
        """Texts of all warnings and errors, oldest first."""
        return [record.message for record in self._records.copy() if record.level >= logging.WARNING]
