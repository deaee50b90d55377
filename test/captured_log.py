"""What the package logs, kept as records for tests that run longer than one caplog phase or outside pytest."""

import logging
from collections import deque
from typing import NamedTuple

KEPT = 10_000  # of a fuzzing run of hours only the last ones


class Logged(NamedTuple):
    level: int
    message: str
    fact: object  #: the fault, error, EMCY or command that the record reports, None for any other


class CapturedLog(logging.Handler):
    """Keeps what the loggers of ``tactile_node`` report from INFO on; use with ``with``."""

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
        """All, oldest first."""
        return list(self._records.copy())

    @property
    def messages(self) -> list[str]:
        """All, oldest first."""
        return [record.message for record in self._records.copy()]

    @property
    def facts(self) -> list[object]:
        """What the records report beside their text, oldest first."""
        return [record.fact for record in self._records.copy() if record.fact is not None]

    @property
    def error_facts(self) -> list[object]:
        """Those of the warnings and errors, oldest first."""
        return [record.fact for record in self.records if record.level >= logging.WARNING and record.fact is not None]

    @property
    def errors(self) -> list[str]:
        """The warnings and errors, oldest first."""
        return [record.message for record in self._records.copy() if record.level >= logging.WARNING]
