"""Execute the orders that a user types, one per line (see ORDERS)."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from examples.simulated_gripper.drive import MAX_EFFORT, Command
from examples.simulated_gripper.items import ITEMS, item_of
from examples.simulated_gripper.model import MAX_GAP
from examples.simulated_gripper.world import AXES, World, random_place
from tactile_node.errors import InputError, TactileError


def _move(world: World, words: list[str]) -> None:
    world.move(**{axis: float(value) for axis, _, value in (word.partition('=') for word in words)})


def _close(world: World, words: list[str]) -> None:
    world.command(Command(0.0, **({'effort': float(words[0])} if words else {})))


#: For each order, the arguments as text and the function that executes the order.
ORDERS: Mapping[str, tuple[str, Callable[[World, list[str]], None]]] = MappingProxyType({
    'close': (f'[N, up to {MAX_EFFORT:g}]', _close),
    'open': ('', lambda world, words: world.command(Command(MAX_GAP))),
    'stop': ('', lambda world, words: world.stop_gripper()),
    'move': (f'{"|".join(AXES)}=METRES or RADIANS ...', _move),
    'shake': ('[times gravity]', lambda world, words: world.shake(*map(float, words[:1]))),
    'item': (f'{"|".join(ITEMS)}', lambda world, words: world.exchange(item_of(words[0]))),
    'press': ('left|right ROW COL [N] [SECONDS]',
              lambda world, words: world.press(words[0], *map(float, words[1:5]))),
    'place': ('SEED', lambda world, words: world.place(random_place(int(words[0]))))})

HELP = '; '.join(f'{name} {takes}'.strip() for name, (takes, _) in ORDERS.items())


def obey(world: World, line: str) -> str:
    """Execute the order in ``line``, and return the state of the bench or an error message."""
    name, *words = line.split() or ['']
    try:
        if name:
            _order(world, name, words)
    except TactileError as error:
        return str(error)
    (left, right), off = world.forces.values(), world.off_hand()
    return (f'{world.outcome.value}: gap {1e3 * world.gap:.1f} mm, pads press {left:.2f} and {right:.2f} N, '
            f'item off by x {1e3 * off.x:.1f} mm, y {1e3 * off.y:.1f} mm, yaw {off.yaw:.3f} rad')


def _order(world: World, name: str, words: list[str]) -> None:
    try:
        ORDERS[name][1](world, words)
    except (KeyError, ValueError, IndexError):
        raise InputError('order', expected=HELP, got=repr(' '.join((name, *words))),
                         remedy='Type one of these orders.') from None
