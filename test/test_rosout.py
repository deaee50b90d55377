"""Records of Python's logging appear on /rosout once, with their level, under the driver's name, from any thread."""

import itertools
import logging
import threading
import time

import pytest
from fault_bench import LAYOUT, FaultBench
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from ros_bench import RosBench

from tactile_node.cli import replay
from tactile_node.cli.main import main
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.ros.rosout_handler import RosoutHandler, forward_logs_to, stop_forwarding_to
from tactile_skin.msg import TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LEVELS = {logging.INFO: Log.INFO, logging.WARNING: Log.WARN, logging.ERROR: Log.ERROR, logging.CRITICAL: Log.FATAL}
CAN_SIDE = logging.getLogger('tactile_node.bus.skin_bus')


_numbers = itertools.count()


def driver(namespace=None, **given):
    """Return a driver in a namespace that no other test uses.

    The /rosout publisher of a destroyed node may live on and still publish under the node's name.
    """
    namespace = namespace or f'test{next(_numbers)}'
    return DriverNode(namespace=namespace,
                      parameter_overrides=[Parameter(name, value=value) for name, value in given.items()])


class Rosout(RosBench):
    """Collects the messages published on /rosout."""

    def __init__(self, stack):
        super().__init__(stack)
        self.node, self.heard = self.add('rosout_listener'), []
        self.node.create_subscription(Log, '/rosout', self.heard.append, 100)

    def wait_for_driver(self):
        """Write log records until one arrives, which proves that discovery has found the driver's publisher."""
        def is_found():
            CAN_SIDE.info('hello')
            self.executor.spin_once(timeout_sec=0.05)
            return self.heard
        self.until(is_found, 'not connected')
        self.settle()
        self.heard.clear()

    def settle(self):
        """Receive the messages that are still in transit. The test logs an end mark and waits for it."""
        CAN_SIDE.info('end mark %d', mark := time.monotonic_ns())
        self.until(lambda: any(str(mark) in message.msg for message in self.heard), 'no end mark')
        self.heard[:] = [message for message in self.heard if 'end mark' not in message.msg]


@pytest.fixture
def rosout(ros):
    return Rosout(ros)


@pytest.fixture
def made(rosout):
    node = driver()
    rosout.wait_for_driver()
    yield node
    node.destroy_node()


@pytest.mark.parametrize('level', LEVELS)
def test_a_record_arrives_once_with_its_level_and_the_drivers_name(rosout, made, level):
    logging_thread = threading.Thread(target=CAN_SIDE.log, args=(level, 'node %d is silent', 32))
    logging_thread.start()
    logging_thread.join()
    rosout.settle()
    heard, = rosout.heard
    assert made.get_logger().name.endswith('.skin_driver')
    assert (heard.level, heard.name, heard.msg) == (LEVELS[level], made.get_logger().name, 'node 32 is silent')


def test_debug_and_other_libraries_records_are_not_forwarded(rosout, made):
    CAN_SIDE.debug('detail')
    logging.getLogger('another_library').error('not ours')
    rosout.settle()
    assert not rosout.heard


def test_a_traceback_is_forwarded_with_its_record(rosout, made):
    try:
        raise ValueError('the cause')
    except ValueError:
        CAN_SIDE.exception('failed')
    rosout.settle()
    heard, = rosout.heard
    assert heard.level == Log.ERROR and heard.msg.startswith('failed\n') and 'ValueError: the cause' in heard.msg


def test_the_older_of_two_drivers_forwards_records_first(rosout):
    first, second = driver('first'), driver('second')
    rosout.wait_for_driver()
    CAN_SIDE.warning('one')
    rosout.settle()
    assert [(heard.name, heard.msg) for heard in rosout.heard] == [('first.skin_driver', 'one')]
    first.destroy_node()
    rosout.wait_for_driver()
    CAN_SIDE.warning('two')
    rosout.settle()
    assert [(heard.name, heard.msg) for heard in rosout.heard] == [('second.skin_driver', 'two')]
    second.destroy_node()


def test_each_node_of_a_process_logs_under_its_own_name(rosout):
    """A node publishes its own log records, and the driver publishes the log records of the bus."""
    node, namespace = driver(), f'test{next(_numbers)}'
    processor = rosout.add(ProcessorNode(namespace=namespace))
    forward_logs_to(processor)
    rosout.wait_for_driver()
    publisher = rosout.node.create_publisher(TaxelArray, f'/{namespace}/taxels', 10)
    rosout.until(publisher.get_subscription_count)
    publisher.publish(TaxelArray())

    def dropped():
        return [heard for heard in rosout.heard if 'dropped' in heard.msg]
    rosout.until(dropped, 'the processor has logged nothing')
    CAN_SIDE.warning('of the bus')
    rosout.settle()
    line, = dropped()
    assert line.name == processor.get_logger().name == f'{namespace}.processor' and namespace not in line.msg.split()[0]
    assert [heard.name for heard in rosout.heard if heard.msg == 'of the bus'] == [node.get_logger().name]
    stop_forwarding_to(processor)
    node.destroy_node()


def test_without_a_node_warnings_go_to_stderr(rosout, capfd, monkeypatch):
    package = logging.getLogger('tactile_node')
    # Without propagation, records do not reach the handlers of pytest.
    monkeypatch.setattr(package, 'propagate', False)
    driver().destroy_node()
    assert not any(isinstance(handler, RosoutHandler) for handler in package.handlers)
    CAN_SIDE.warning('after the end')
    assert capfd.readouterr().err.splitlines()[-1:] == ['after the end']


def test_commands_without_nodes_print_warnings_to_stderr_once(capsys, monkeypatch):
    def run(_args):
        CAN_SIDE.info('detail')
        CAN_SIDE.warning('attention')
        return 0
    monkeypatch.setattr(replay, 'run', run)
    handlers = list(logging.getLogger('tactile_node').handlers)
    assert main(['replay', 'any.log']) == 0
    assert capsys.readouterr().err == 'tactile: attention\n'
    assert logging.getLogger('tactile_node').handlers == handlers


def test_log_records_of_the_bus_arrive_under_the_drivers_name(rosout):
    """The supervisor's thread writes these log records.

    The test switches the device off, and closes the driver while the device is off.
    """
    with FaultBench('rosout') as bench:
        node = driver(interface='virtual', channel=bench.channel, pads=['pad32'], node_ids=[32], layouts=[LAYOUT])
        rosout.wait_for_driver()
        node.autostart()
        bench.device.power_off()

        def errors():
            return [heard for heard in rosout.heard if heard.level == Log.ERROR and 'ode 32' in heard.msg]
        rosout.until(errors, 'no error')
        assert {heard.name for heard in rosout.heard} == {node.get_logger().name}
        assert any(heard.level == Log.INFO and 'is open' in heard.msg for heard in rosout.heard)
        rosout.settle()
        assert len({heard.msg for heard in errors()}) == len(errors())
        node.destroy_node()
