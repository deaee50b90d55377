"""Find the sections of a ROS 2 parameter file that no node of this package reads, because rcl ignores them silently."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches

import yaml

from tactile_node.node_graph import NODE_NAMES

PARAMETERS = 'ros__parameters'
#: nodes of this package; a parameter file may serve several processes
KNOWN_NODES = (*NODE_NAMES.values(), 'touch_gripper')


def section_warnings(path: str) -> list[str]:
    """Return a warning for each section that names no node of this package, or for a file without sections.

    The result is empty for a file that is no YAML, because rcl refuses such a file.
    """
    try:
        with open(path, encoding='utf-8') as stream:
            sections = list(_sections(yaml.safe_load(stream)))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return []
    if not sections:
        return [f'{path} sets no parameter: expected a section such as /**/skin_driver with {PARAMETERS}, got none. '
                'Compare the file with config/parameters.yaml.']
    unknown = [each for each in sections if '*' not in _name(each) and _name(each) not in KNOWN_NODES]
    return [f'{path}, section {each!r}: no node of this package has this name. {_remedy(_name(each))}'
            for each in unknown]


def _sections(content: object, above: str = '') -> Iterator[str]:
    """Yield the names of the sections with parameters. A section may be nested in the sections of its namespaces."""
    if isinstance(content, Mapping):
        if PARAMETERS in content:
            yield above
        for name, below in content.items():
            if name != PARAMETERS:
                yield from _sections(below, f'{above}/{name}' if above else str(name))


def _name(section: str) -> str:
    return section.rsplit('/', 1)[-1]


def _remedy(name: str) -> str:
    similar = get_close_matches(name, KNOWN_NODES, 1)
    return f'Did you mean {similar[0]!r}?' if similar else f'The nodes are {", ".join(KNOWN_NODES)}.'
