"""Generate the list of public names of `import tactile_node as tn` from their docstrings."""

import inspect

import tactile_node


def markdown() -> str:
    names = [name for name in tactile_node.__all__ if not name.startswith('_')]
    lines = ['```{eval-rst}', '.. py:module:: tactile_node', '']
    for name in names:
        if inspect.isclass(getattr(tactile_node, name)):
            lines += [f'.. autoclass:: tactile_node.{name}', '   :members:', '   :undoc-members:', '']
        else:
            lines += [f'.. autofunction:: tactile_node.{name}', '']
    return '\n'.join([*lines, '```'])
