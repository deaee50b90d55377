"""Make the diagnostic message for one state of a bus, as the driver makes it."""

from types import MappingProxyType

NONE = MappingProxyType({})


def diagnosed(diagnostics, counts, health, conditions=NONE):
    return diagnostics.message_of(diagnostics.evaluate(counts, health, conditions), counts, health, conditions)
