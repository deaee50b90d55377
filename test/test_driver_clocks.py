"""The exchange with the driver: it never waits, survives an absent, silent or false one, and is shown as facts."""

import math
import time
from contextlib import ExitStack

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor

from tactile_node.delay.clock_offset import ClockOffset
from tactile_node.errors import InputError
from tactile_node.nodes import driver_clocks
from tactile_node.nodes.driver_clocks import DriverClocks, wall_lead
from tactile_node.nodes.host_time_service import HostTimeService
from tactile_node.ros.clock_facts import DriverClock, stamps_ahead_of
from tactile_node.ros.message_health import MessageCounts, StreamHealth, health_status
from tactile_node.ros.time_messages import time_message
from tactile_skin.msg import TaxelArray
from tactile_skin.srv import HostTime

pytestmark = pytest.mark.ros

TIMEOUT = 60.0  # s, for a busy machine
nan = math.nan


class World:
    """Drivers and one receiver on one executor."""

    def __init__(self, stack):
        self.context = rclpy.context.Context()
        rclpy.init(context=self.context)
        stack.callback(self.context.try_shutdown)
        self.executor = SingleThreadedExecutor(context=self.context)
        stack.callback(self.executor.shutdown)
        self.receiver = self.node('receiver')

    def node(self, name, **options):
        node = rclpy.create_node(name, context=self.context, **options)
        self.executor.add_node(node)
        return node

    def driver(self, name='skin_driver', pad='left', answer=None):
        """A node that publishes taxels; ``answer``: fills in the response, None: as ours does."""
        driver = self.node(name)
        driver.create_publisher(TaxelArray, f'/{pad}/taxels', 1)
        if answer is None:
            HostTimeService(driver, lambda: 0.0)
        else:
            driver.create_service(HostTime, f'/{name}/host_time', lambda _, response: answer(response))
        return driver

    def wait(self, condition):
        end = time.monotonic() + TIMEOUT
        while not (found := condition()):
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.05)
        return found


@pytest.fixture
def world(monkeypatch):
    monkeypatch.setattr(driver_clocks, 'PERIOD', 0.2)
    with ExitStack() as stack:
        yield World(stack)


def apart(seconds, ahead=0.0):
    """Answers of a host whose clock is that much ahead."""
    def answer(response):
        now = time.time() + seconds
        response.received = response.sent = time_message(now)
        response.stamps_ahead = ahead
        return response
    return answer


def known(clocks):
    """Those that have an offset."""
    return {name: clock for name, clock in clocks.look().items() if not math.isnan(clock.host.offset)}


def test_the_driver_of_the_same_host_is_not_apart(world):
    world.driver()
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    clock, = world.wait(lambda: known(clocks)).values()
    assert abs(clock.host.offset) <= clock.host.bound + 1e-3 and clock.unanswered == 0


@pytest.mark.parametrize('seconds', [0.2, -3600.0])
def test_a_driver_is_found_by_the_taxels_beside_a_topic(world, seconds):
    world.driver('driver_a', 'left', apart(seconds, ahead=1.5))
    world.driver('driver_b', 'elsewhere', apart(7.0))
    clocks = DriverClocks(world.receiver, ['/left/shape', '/right/shape'])
    found = world.wait(lambda: known(clocks))
    assert set(found) == {'/driver_a'}
    clock = found['/driver_a']
    assert abs(clock.host.offset - seconds) <= clock.host.bound + 1e-3
    assert clock.stamps_offset == clock.host.offset + 1.5


def test_pads_of_two_drivers_have_two_clocks(world):
    world.driver('driver_a', 'left', apart(1.0))
    world.driver('driver_b', 'right', apart(-1.0))
    clocks = DriverClocks(world.receiver, ['/left/shape', '/right/shape'])
    found = world.wait(lambda: found if len(found := known(clocks)) == 2 else None)
    assert found['/driver_a'].host.offset > 0 > found['/driver_b'].host.offset


def test_nothing_is_asked_where_no_driver_is(world):
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    assert clocks.look() == {} and DriverClocks(world.receiver, []).look() == {}


def test_what_publishes_taxels_without_the_service_is_not_known(world):
    """As a player of bags."""
    world.node('player').create_publisher(TaxelArray, '/left/taxels', 1)
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    clock, = world.wait(clocks.look).values()
    assert math.isnan(clock.host.offset) and clock.unanswered == 0


def test_a_driver_that_does_not_answer_costs_no_time_and_is_asked_again(world):
    """It stands: its executor does not run."""
    silent = world.driver()
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    world.wait(clocks.look)
    world.wait(lambda: world.receiver.count_services('/skin_driver/host_time'))
    world.executor.remove_node(silent)
    world.wait(lambda: clocks.look()['/skin_driver'].unanswered >= 3)
    assert len(list(world.receiver.clients)[0]._pending_requests) <= 1
    world.executor.add_node(silent)
    world.wait(lambda: known(clocks))


def test_a_driver_that_has_ended_is_forgotten(world):
    driver = world.driver()
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    world.wait(lambda: known(clocks))
    world.executor.remove_node(driver)
    driver.destroy_node()
    world.wait(lambda: not clocks.look())
    assert not list(world.receiver.clients)


@pytest.mark.parametrize('wrong', [
    {'received': time_message(100.0), 'sent': time_message(99.0)}, {'received': time_message(0.0)},
    {'stamps_ahead': -1.0}, {'stamps_ahead': math.inf}])
def test_a_false_answer_is_counted_and_not_used(world, wrong):
    def answer(response):
        response = apart(0.0)(response)
        for name, value in wrong.items():
            setattr(response, name, value)
        return response
    world.driver(answer=answer)
    clocks = DriverClocks(world.receiver, ['/left/contact'])
    clock = world.wait(lambda: next((each for each in clocks.look().values() if each.unanswered >= 2), None))
    assert math.isnan(clock.host.offset)


def test_the_stamps_of_a_replay_are_of_no_clock():
    clock = DriverClock(ClockOffset(9.0, 0.001), stamps_ahead_of(nan))
    assert math.isnan(clock.stamps_offset) and not clock.is_apart(0.05)
    with pytest.raises(InputError):
        stamps_ahead_of(-0.001)


def test_the_lead_of_the_wall_clock_is_that_of_this_moment():
    assert wall_lead() == pytest.approx(time.time() - time.monotonic(), abs=0.05)


def status_of(clocks, limit=0.05):
    counts = MessageCounts(received=54, processed=54, dropped={})
    before = MessageCounts(received=4, processed=4, dropped={})
    return health_status('/grasp', {'/left/shape': StreamHealth(counts, 0.02, ('/driver',))}, {'/left/shape': before},
                         1.0, clocks, max_clock_offset=limit)


def values_of(status):
    return {pair.key: pair.value for pair in status.values}


@pytest.mark.parametrize(('offset', 'bound', 'ahead', 'is_apart'), [
    (0.05, 0.001, 0.0, False), (0.052, 0.001, 0.0, True), (-0.2, 0.001, 0.0, True), (0.2, 0.16, 0.0, False),
    (0.0, 0.001, 1.0, True),     # its clock was set back while it ran: the stamps are ahead still
    (-1.0, 0.001, 1.0, False),
    (nan, math.inf, 0.0, False)])
def test_clocks_are_apart_when_it_is_certain_that_stamps_are(offset, bound, ahead, is_apart):
    status = status_of({'/skin_driver': DriverClock(ClockOffset(offset, bound), ahead)})
    assert ('CLOCKS_APART' == values_of(status)['faults']) is is_apart
    assert status.level == (DiagnosticStatus.WARN if is_apart else DiagnosticStatus.OK)


def test_offset_bound_and_drift_are_values_of_the_diagnostic():
    values = values_of(status_of({'/a/skin_driver': DriverClock(ClockOffset(0.0, 0.001)),
                                  '/b/skin_driver': DriverClock(ClockOffset(-0.2003, 0.00049, 2e-5, 1.26), 0.5, 3)}))
    assert {key: values[key] for key in values if 'clock' in key or 'stamps' in key} == {
        'clock_of': '/b/skin_driver', 'clock_offset_s': '-0.2003', 'clock_offset_bound_s': '0.0005',
        'clock_age_s': '1.3', 'clock_drift_ppm': '+20', 'stamps_offset_s': '+0.2997', 'clock_unanswered': '3'}


def test_without_a_driver_the_clock_is_not_known():
    values = values_of(status_of({}))
    assert (values['clock_of'], values['clock_offset_s'], values['stamps_offset_s']) == ('', 'not known', 'not known')
