"""All that is wrong at once, in place of the first."""

from collections.abc import Callable, Iterable

from tactile_node.errors import ConfigurationError


def raised_by(checks: Iterable[Callable[[], object]]) -> list[ConfigurationError]:
    """Make every check and return what they raise."""
    found = []
    for check in checks:
        try:
            check()
        except ConfigurationError as error:
            found.append(error)
    return found
