"""Draw docs/architecture.png, and write docs/architecture.txt, from the imports in the code: `make architecture`.

Each box is a subpackage of tactile_node/ with its number of lines of code. An arrow leads from a subpackage to each
subpackage that it imports. The picture omits arrows that are implied by a chain of other arrows. The text file lists
all imports, and a test compares this list with the code.
"""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'tactile_node'
#: Position (column, row) of the box of each subpackage, in box widths and with row 0 at the bottom.
PLACES = {
    'cia301': (1.0, 0), 'contact': (5.1, 0), 'helmholtz': (6.3, 0),
    'skin': (1.0, 1), 'conditioning': (3.0, 1), 'shape': (5.7, 1),
    'assembly': (1.0, 2), 'grasp': (4.5, 2), 'pose': (5.9, 2),
    'logs': (1.0, 3), 'commissioning': (4.5, 3), 'learning': (5.9, 3), 'bus': (1.0, 4), 'library': (7.2, 4),
    'sources': (1.0, 5), 'simulator': (2.4, 5), 'ros': (4.4, 5), 'viewing': (6.6, 6), 'nodes': (4.0, 7),
    'gripper': (3.0, 8), 'cli': (4.6, 9)}
COLOURS = {'CAN side, no ROS': '#cfe3f5', 'numerical core: neither CAN nor ROS': '#d8efd3',
           'no ROS, with the core': '#d5ecea', 'ROS 2': '#fbe3c4',
           'programs': '#eeeeee'}
SIDES = {'CAN side, no ROS': ('cia301', 'skin', 'assembly', 'logs', 'bus', 'sources', 'simulator'),
         'no ROS, with the core': ('viewing',), 'ROS 2': ('ros', 'nodes', 'gripper'), 'programs': ('cli',)}
WIDTH, HEIGHT = 0.92, 0.5


def rooms() -> list[str]:
    """Return the names of all subpackages."""
    return sorted(path.parent.name for path in PACKAGE.glob('*/__init__.py'))


def lines_of(room: str) -> int:
    return sum(len(path.read_text(encoding='utf-8').splitlines()) for path in (PACKAGE / room).rglob('*.py'))


def imports_of(room: str) -> list[str]:
    """Return the other subpackages that a subpackage imports, including imports inside functions."""
    found = set()
    for path in (PACKAGE / room).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [node.module or ''] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            found |= {name.split('.')[1] for name in names if name.startswith('tactile_node.')}
    return sorted((found & set(rooms())) - {room})


def edges() -> dict[str, list[str]]:
    return {room: imports_of(room) for room in rooms()}


def direct(imports: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return ``imports`` without the imports that are implied by a chain of other imports."""
    def reach(room: str) -> set[str]:
        return {further for below in imports[room] for further in ({below} | reach(below))}
    return {room: [below for below in found if not any(below in reach(other) for other in found if other != below)]
            for room, found in imports.items()}


def text(imports: dict[str, list[str]]) -> str:
    """Return the content of docs/architecture.txt."""
    lines = [f'{room}: {", ".join(found) or "-"}' for room, found in imports.items()]
    return '\n'.join(['# subpackage: the subpackages that it imports. Written by `make architecture`.', *lines]) + '\n'


def draw(imports: dict[str, list[str]], path: Path) -> None:
    from matplotlib.figure import Figure  # a late import, because the test of the imports needs no picture
    figure = Figure(figsize=(13, 10))
    axes = figure.subplots()
    for room, found in direct(imports).items():
        for below in found:
            _draw_arrow(axes, PLACES[room], PLACES[below])
    for room in imports:
        _draw_room(axes, room)
    for row, (side, colour) in enumerate(COLOURS.items()):
        axes.text(6.6, 9.1 - 0.4 * row, side, fontsize=11, va='center',
                  bbox={'boxstyle': 'round', 'facecolor': colour, 'edgecolor': 'grey'})
    axes.set(xlim=(0.4, 9.7), ylim=(-0.5, 9.6))
    axes.set_axis_off()
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def _draw_room(axes, room: str) -> None:
    from matplotlib.patches import FancyBboxPatch
    x, y = PLACES[room]
    side = next((side for side, members in SIDES.items() if room in members), 'numerical core: neither CAN nor ROS')
    axes.add_patch(FancyBboxPatch((x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, boxstyle='round,pad=0.02',
                                  facecolor=COLOURS[side], edgecolor='grey', zorder=2))
    axes.text(x, y + 0.08, room, ha='center', va='center', fontsize=11.5, weight='bold', zorder=3)
    axes.text(x, y - 0.14, f'{lines_of(room)} lines', ha='center', va='center', fontsize=8.5, zorder=3)


def _draw_arrow(axes, above: tuple[float, float], below: tuple[float, float]) -> None:
    same_column = abs(above[0] - below[0]) < 0.1
    bend = 0.35 if same_column and above[1] - below[1] > 1 else 0.0
    axes.annotate('', (below[0], below[1] + HEIGHT / 2), (above[0], above[1] - HEIGHT / 2), zorder=1, arrowprops={
        'arrowstyle': '-|>', 'color': '#555555', 'linewidth': 1.2, 'shrinkA': 0, 'shrinkB': 0,
        'connectionstyle': f'arc3,rad={bend}'})


def main() -> None:
    imports = edges()
    (ROOT / 'docs/architecture.txt').write_text(text(imports), encoding='utf-8')
    draw(imports, ROOT / 'docs/architecture.png')


if __name__ == '__main__':
    main()
