"""Build the diagnostic message for one state of a bus in the same way as the driver."""

from types import MappingProxyType

NONE = MappingProxyType({})


def diagnosed(diagnostics, facts, conditions=NONE):
    return diagnostics.message_of(diagnostics.evaluate(facts, conditions), facts, conditions)
