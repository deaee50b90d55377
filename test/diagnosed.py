"""Build the messages about one state of a bus in the same way as the driver."""

from types import MappingProxyType

from tactile_node.ros.diagnostics import BusDiagnostics
from tactile_node.ros.status_message import status_message

NONE = MappingProxyType({})


def diagnosed(diagnostics, facts, conditions=NONE):
    return diagnostics.message_of(diagnostics.evaluate(facts, conditions), facts, conditions)


def status_of(facts, conditions=NONE):
    return status_message(BusDiagnostics('driver', 'can0').evaluate(facts, conditions), facts, conditions)
