"""Generate the tables of all node parameters from the settings classes with which the nodes declare them."""

import math

from reference import markdown as md
from tactile_node.gripper.gripper_settings import GripperSettings
from tactile_node.ros import settings
from tactile_node.ros.parameters import NodeSettings, Parameter, table

#: Settings class of each node, in the order in which data passes through the nodes.
NODES = {'skin_driver': settings.DriverSettings, 'processor': settings.ProcessorSettings,
         'classifier': settings.ClassifierSettings, 'grasp': settings.GraspNodeSettings,
         'touch_gripper': GripperSettings}


def markdown() -> str:
    """Return one table for the parameters that all nodes have in common, and one table for each node."""
    common = {row.name for row in table(NodeSettings)}
    parts = ['## Of every node', _table(table(NodeSettings))]
    for node, kind in NODES.items():
        parts += [f'## {node}', _table(tuple(row for row in table(kind) if row.name not in common))]
    return '\n\n'.join(parts)


def _table(rows: tuple[Parameter, ...]) -> str:
    return md.table(('parameter', 'default', 'range', 'set while it runs', 'meaning'), (
        (md.code(row.name), md.code(_written(row.default)), _range(row), 'yes' if row.properties.live else '',
         md.prose(row.properties.description)) for row in rows))


def _written(default: object) -> str:
    """Return a default value in the syntax of a parameter file."""
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, tuple):
        return f'[{", ".join(map(_written, default))}]'
    return f'{default:.6g}' if isinstance(default, float) else str(default) or "''"


def _range(row: Parameter) -> str:
    low, high = row.properties.low, row.properties.high
    return f'{low:,.10g} ... {high:,.10g}' if math.isfinite(high) else ''
