"""Generate the list of public names of `import tactile_node as tn` from their source code."""

import ast
import inspect
from collections.abc import Iterator
from textwrap import dedent

import tactile_node


def markdown() -> str:
    names = [name for name in tactile_node.__all__ if not name.startswith('_')]
    return '\n\n'.join(f'## {name}\n\n```python\n{outline(getattr(tactile_node, name))}\n```' for name in names)


def outline(thing: object) -> str:
    """Return the signature and the docstring of a function, or of a class and of its public members."""
    source = dedent(inspect.getsource(thing))
    lines, definition = source.splitlines(), ast.parse(source).body[0]
    members = _members(definition, lines) if isinstance(definition, ast.ClassDef) else ()
    return '\n\n'.join((_without_body(definition, lines), *members))


def _members(definition: ast.ClassDef, lines: list[str]) -> Iterator[str]:
    """Yield the public fields of a class with their comments, and then each public method."""
    fields = [line for node in definition.body if isinstance(node, ast.AnnAssign | ast.Assign)
              for line in _with_comment(node, lines)]
    if fields:
        yield '\n'.join(fields)
    for node in definition.body:
        if isinstance(node, ast.FunctionDef) and (not node.name.startswith('_') or node.name == '__init__'):
            yield _without_body(node, lines)


def _with_comment(field: ast.stmt, lines: list[str]) -> list[str]:
    """Return the source lines of a field, and the comment above it."""
    first = field.lineno - 1
    while lines[first - 1].lstrip().startswith('#:'):
        first -= 1
    return lines[first:field.end_lineno]


def _without_body(node: ast.ClassDef | ast.FunctionDef, lines: list[str]) -> str:
    """Return the source of a definition up to the end of its docstring."""
    first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
    has_docstring = ast.get_docstring(node) is not None
    last = node.body[0].end_lineno if has_docstring else node.body[0].lineno - 1
    return '\n'.join(lines[first - 1:last])
