"""Tests that only the modules listed here read the wall clock of their host.

The clocks of two hosts may differ, so all other modules use message stamps and a steady clock. See docs/hosts.md.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(path for folder in ('tactile_node', 'examples', 'launch') for path in (ROOT / folder).rglob('*.py'))
#: Maps each allowed module to its use of the host's wall clock.
WALL_CLOCK = {
    'tactile_node/bus/stamp_clock.py': 'stamps that never go backwards',
    'tactile_node/bus/slcan_bus.py': 'the time of CAN frames, which stamp_clock maps to its own stamps',
    'tactile_node/bus/bus_network.py': 'the time of sent CAN frames in a recording',
    'tactile_node/cia301/emergency.py': 'the time of an EMCY for human readers',
    'tactile_node/nodes/guarded_input.py': 'a warning that the stamps come from another clock',
    'tactile_node/nodes/state_publisher.py': 'the stamp of a diagnostic according to REP 107',
    'tactile_node/nodes/node_health.py': 'the stamp of a diagnostic according to REP 107',
    'tactile_node/nodes/pad_transforms.py': 'stamps on tf from the publishing host, see docs/hosts.md',
    'tactile_node/viewing/page_parts.py': 'a warning that the stamps come from another clock',
    'tactile_node/gripper/gripper_node.py': 'the time of an outcome for human readers',
    'tactile_node/cli/commission.py': 'the date of a report for human readers',
    'examples/other_skin.py': 'stamps of taxels, like those of the driver',
    'examples/simulated_gripper/session.py': 'stamps of joint states, like those of every controller',
    'examples/simulated_gripper/hand_interface.py': 'stamps on tf, like those of every robot',
    'examples/demo/bag.py': 'the time at which a message was recorded, beside its stamp',
    'examples/demo/watcher.py': 'the demo runs on one host',
    'examples/demo/session.py': 'the demo runs on one host',
    'examples/demo/skin.py': 'the demo runs on one host',
    'tactile_node/simulator/device.py': 'the touches of the simulated skin',
    'tactile_node/simulator/slcan_pty.py': 'the stamps of a CAN adapter',
    'tactile_node/simulator/wire_gateway.py': 'the stamps of a CAN adapter'}
#: DDS QoS policies that no code may use. Lifespan compares the stamp of the sender's host with the clock of the
#: receiver's host. The other policies depend on deadlines and leases that no module monitors.
QOS = {'lifespan', 'deadline', 'liveliness', 'liveliness_lease_duration'}


def name_of(node: ast.expr) -> str:
    """Return the dotted name of a called function, in which each inner call ends with ()."""
    if isinstance(node, ast.Call):
        return f'{name_of(node.func)}()'
    if isinstance(node, ast.Attribute):
        return f'{name_of(node.value)}.{node.attr}'
    return getattr(node, 'id', '')


@pytest.fixture(scope='module')
def nodes():
    """Return all calls and assignments as pairs of file and syntax node."""
    return [(path, node) for path in FILES for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
            if isinstance(node, (ast.Call, ast.Assign))]


@pytest.fixture(scope='module')
def calls(nodes):
    return [(path, node) for path, node in nodes if isinstance(node, ast.Call)]


def reads_wall_clock(call: ast.Call) -> bool:
    name = name_of(call.func)
    return (name in ('time.time', 'time.time_ns', 'datetime.now', 'datetime.utcnow', 'time.localtime')
            or name.endswith(('get_clock().now', '_clock.now')))


def test_the_modules_that_look_at_the_wall_clock_are_those_of_the_list(calls):
    found = {str(path.relative_to(ROOT)) for path, call in calls if reads_wall_clock(call)}
    assert found == set(WALL_CLOCK)


def test_every_timer_is_on_a_steady_clock(calls):
    """By default, a timer uses the node's clock and would stall after the wall clock is set back."""
    timers = [(path, call) for path, call in calls if name_of(call.func).endswith('create_timer')]
    assert timers
    for path, call in timers:
        given = {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords}
        assert given.get('clock') == 'Clock(clock_type=ClockType.STEADY_TIME)', (path, call.lineno)


def test_no_qos_compares_the_clocks_of_hosts(nodes, calls):
    profiles = [(path, call) for path, call in calls if name_of(call.func) == 'QoSProfile']
    assert profiles
    for path, call in profiles:
        assert not QOS & {keyword.arg for keyword in call.keywords}, (path, call.lineno)
    for path, node in nodes:
        targets = node.targets if isinstance(node, ast.Assign) else []
        assert not any(isinstance(each, ast.Attribute) and each.attr in {'lifespan', 'liveliness'}
                       for each in targets), path
