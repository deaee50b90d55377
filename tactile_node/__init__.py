"""Contact shape from a tactile skin: CAN frame -> taxel frame -> pattern -> features -> shape.

One folder a stage; ``docs/architecture.md`` says which folder may import which.
"""

__all__ = ['__version__']


def __getattr__(name: str) -> str:
    """Give ``__version__`` when it is read first: a node that never reads it pays nothing for it."""
    if name == '__version__':
        from tactile_node.version import package_version
        globals()[name] = package_version()
        return globals()[name]
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
