"""Build the diagnostic message for one state of a bus in the same way as the driver."""

from types import MappingProxyType

NONE = MappingProxyType({})


def diagnosed(diagnostics, counts, health, conditions=NONE):
    return diagnostics.message_of(diagnostics.evaluate(counts, health, conditions), counts, health, conditions)
