"""The driver node over an outage: same node, still active, /diagnostics true to what the bus does."""

import gc
import itertools
import threading
import time
from collections import Counter
from dataclasses import replace
from math import inf, log2

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_bench import LAYOUT, PRESSED, SIDE, FaultBench
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

from tactile_node.assembly.health import BusFault, Failure
from tactile_node.bus import threads
from tactile_node.bus.threads import FIRST_REMINDER
from tactile_node.nodes import driver_node
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.lifecycle_steps import WAITING
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.ros.parameters import read
from tactile_node.ros.qos import STATUS_QOS, frames_qos
from tactile_node.ros.settings import DriverSettings
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import NodeStatus, SkinStatus, TaxelArray
from tactile_skin.srv import Tare

pytestmark = [pytest.mark.ros, pytest.mark.bus]

OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR
TIMEOUT = 60.0  # s, for a busy machine
ALL_STATUS_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # not the latest alone


class Chain:
    """The driver node on the bench's bus, and a listener; spun by the test that waits."""

    def __init__(self, channel):
        given = {'interface': 'virtual', 'channel': channel, 'pads': ['pad32'], 'node_ids': [32], 'layouts': [LAYOUT],
                 'sync_period': 0.2}  # s: a stall of that length is rare; each would be a WARN
        self.driver = DriverNode(parameter_overrides=[Parameter(name, value=value) for name, value in given.items()])
        self.listener = rclpy.create_node('listener')
        self.taxels = []
        self.levels = []
        self.reports = []
        self.listener.create_subscription(TaxelArray, '/pad32/taxels', self.taxels.append, frames_qos(50, False))
        self.listener.create_subscription(DiagnosticArray, '/diagnostics', self._diagnosed, 10)
        self.executor = SingleThreadedExecutor()
        for node in (self.driver, self.listener):
            self.executor.add_node(node)

    def _diagnosed(self, message):
        self.levels.append(tuple(status.level for status in message.status))
        self.reports.append(' '.join(status.message for status in message.status))

    def wait(self, condition, what):
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, f'{what}: {self.reports[-3:]}'
            self.executor.spin_once(timeout_sec=0.1)

    def close(self):
        self.executor.shutdown()
        self.driver.destroy_node()
        self.listener.destroy_node()
        # rclpy ends a lifecycle node only when it is collected, and then takes /rosout from a new node of its name
        del self.driver
        gc.collect()


@pytest.fixture
def chain():
    rclpy.init()
    load = [PRESSED]
    with FaultBench('driver node', source=lambda t: np.full((SIDE, SIDE), load[0])) as bench:
        chain = Chain(bench.channel)
        chain.load = load
        chain.bench = bench
        try:
            yield chain
        finally:
            chain.close()
    rclpy.shutdown()


def test_an_unplugged_adapter_is_an_error_until_it_is_back_and_the_node_stays_active(chain):
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    chain.bench.adapter.is_plugged = False
    chain.wait(lambda: chain.levels[-1][0] == ERROR, 'no error')
    chain.bench.adapter.is_plugged = True
    back = time.time()
    chain.wait(lambda: any(frame.header.stamp.sec > back and not frame.missing_can_frames for frame in chain.taxels),
               'no taxels again')
    chain.wait(lambda: chain.levels[-1] == (OK, OK), 'never OK again')
    sequences = [frame.sequence for frame in chain.taxels]
    assert sequences == sorted(set(sequences))
    assert chain.driver._state_machine.current_state[1] == 'active'


def test_a_device_that_is_gone_is_never_ok(chain):
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    chain.bench.device.power_off()
    seen = len(chain.levels)
    chain.wait(lambda: len(chain.levels) >= seen + 4, 'no diagnostics')
    # The first message after it may be of the second before
    assert all(levels[1] != OK for levels in chain.levels[seen + 1:]), chain.levels[seen:]
    assert 'neither heartbeat nor taxels' in chain.reports[-1] and chain.levels[-1][1] == ERROR
    chain.bench.device.boot()
    chain.wait(lambda: chain.levels[-1] == (OK, OK), 'never OK again')


def test_what_is_missing_at_start_is_waited_for_and_reported_now_and_then(chain):
    chain.bench.adapter.is_plugged = False
    logged, heard, begun = [], [], time.monotonic()
    chain.listener.create_subscription(Log, '/rosout', lambda message: logged.append(message.msg), 100)
    chain.listener.create_subscription(SkinStatus, '/skin_driver/status', heard.append, STATUS_QOS)
    starting = threading.Thread(target=chain.driver.autostart, args=(threading.Event(),))
    starting.start()
    chain.wait(lambda: len(heard) > 2 and heard[-1].failure, 'not reported')
    assert chain.levels[-1] == (ERROR,) and 'a bus that opens' in chain.reports[-1]
    assert (heard[-1].level, heard[-1].fault) == (SkinStatus.ERROR, SkinStatus.FAULT_NOT_OPENED)
    assert not heard[-1].active
    assert starting.is_alive() and chain.bench.adapter.opened == 0
    chain.wait(lambda: any(WAITING in sentence for sentence in logged), 'not logged')
    reports = sum(WAITING in sentence for sentence in logged)
    assert reports <= 1 + (time.monotonic() - begun) / FIRST_REMINDER  # not at each attempt
    chain.bench.adapter.is_plugged = True
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    starting.join()
    chain.wait(lambda: heard[-1].active and heard[-1].fault == SkinStatus.FAULT_NONE, 'status not well again')


def test_a_device_that_never_answers_is_reported_ever_more_rarely(chain):
    chain.bench.device.power_off()
    chain.driver.set_parameters([Parameter('boot_timeout', value=0.1)])
    logged, begun, stop = [], time.monotonic(), threading.Event()
    chain.listener.create_subscription(Log, '/rosout', lambda message: logged.append(message.msg), 100)
    starting = threading.Thread(target=chain.driver.autostart, args=(stop,))
    starting.start()
    chain.wait(lambda: chain.bench.adapter.opened >= 6, 'no further attempt')
    stop.set()
    starting.join()
    counts, most = Counter(logged), 1 + log2(1 + (time.monotonic() - begun) / FIRST_REMINDER)
    assert any(WAITING in sentence for sentence in counts) and max(counts.values()) <= most < 5, counts


def test_the_pads_of_a_driver_are_seen_all_or_none(chain, monkeypatch):
    """While the driver waits at start, the executor publishes the state of its pads: these may not grow meanwhile."""
    driver, seen = chain.driver, []

    def output(*given, **options):
        seen.append(len(driver._pads))
        return PadOutput(*given, **options)
    monkeypatch.setattr(driver_node, 'PadOutput', output)
    settings = replace(read(driver, DriverSettings), pads=('left', 'right'), node_ids=(32, 64), boot_timeout=0.1)
    monkeypatch.setattr(driver_node, 'read', lambda *_: settings)
    driver.trigger_configure()
    assert seen == [0, 0]


def test_the_state_can_be_looked_at_while_the_driver_is_released(chain):
    """The executor looks every 50 ms, also while another thread destroys the publishers."""
    chain.driver.trigger_configure()
    output, = chain.driver._pads.values()
    output._looked = -np.inf
    output.destroy()
    assert output.condition.other_publishers == ()
    chain.driver._owned.remove(output.destroy)


def test_a_report_that_fails_ends_nothing(chain, monkeypatch):
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    source = chain.driver.source
    statistics, failures = source.statistics, iter(range(5))

    def fail_now_and_then():
        if next(failures, None) is not None:
            raise ZeroDivisionError('of the report')
        return statistics()
    monkeypatch.setattr(source, 'statistics', fail_now_and_then)
    seen = len(chain.levels)
    chain.wait(lambda: len(chain.levels) > seen, 'no report after it')
    assert next(failures, None) is None


def test_a_fault_is_reported_with_simulated_time_and_no_clock(chain):
    chain.driver.set_parameters([Parameter('use_sim_time', value=True)])
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    chain.bench.adapter.is_plugged = False
    chain.wait(lambda: chain.levels[-1][0] == ERROR, 'OK stays')


def test_each_frame_has_the_time_since_its_sync_when_it_was_sent(chain):
    """Here sender and receiver share a clock. The taxels of a held-up driver would look current."""
    arrived = []
    chain.listener.create_subscription(TaxelArray, '/pad32/taxels', lambda frame: arrived.append((time.time(), frame)),
                                       frames_qos(50, False))
    chain.driver.autostart()
    chain.wait(lambda: len(arrived) > 5, 'no taxels')
    publish = chain.driver._pads['pad32'].conditioned.feed
    chain.driver._pads['pad32'].conditioned.feed = lambda frame: (time.sleep(0.15), publish(frame))[1]
    before = len(arrived)
    chain.wait(lambda: len(arrived) > before + 5, 'no taxels')
    for number, (at, frame) in enumerate(arrived):
        age = seconds(frame.age)
        assert 0 < age <= at - seconds(frame.header.stamp)
        assert age > 0.15 or number <= before + 2


def test_waiting_at_start_ends_when_stopped(chain):
    chain.bench.adapter.is_plugged = False
    stop_requested = threading.Event()
    stop_requested.set()
    assert chain.driver.autostart(stop_requested) is None


def test_activate_may_be_tried_again_after_an_outage(chain):
    """A failed activate leaves the node inactive, that is configured, as the lifecycle says."""
    chain.driver.trigger_configure()
    chain.bench.adapter.is_plugged = False
    chain.wait(lambda: chain.driver.source.failure is not None, 'not failed')
    assert chain.driver.trigger_activate() == TransitionCallbackReturn.FAILURE
    chain.bench.adapter.is_plugged = True
    chain.wait(lambda: chain.driver.trigger_activate() == TransitionCallbackReturn.SUCCESS, 'not active')
    chain.wait(lambda: chain.taxels, 'no taxels')


def test_a_transition_that_does_not_fit_is_answered_and_ends_nothing(chain):
    chain.driver.autostart()
    client = chain.listener.create_client(ChangeState, '/skin_driver/change_state')
    request = ChangeState.Request()
    for number in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CONFIGURE, 77):
        request.transition.id = number
        call = client.call_async(request)
        chain.wait(call.done, 'no answer')
        assert not call.result().success
    assert chain.driver._state_machine.current_state[1] == 'active'
    request.transition.id = Transition.TRANSITION_DEACTIVATE
    call = client.call_async(request)
    chain.wait(call.done, 'no answer')
    assert call.result().success


def test_what_configure_reads_can_be_set_while_unconfigured_and_not_after(chain):
    def set_period(seconds):
        return chain.driver.set_parameters([Parameter('sync_period', value=seconds)])[0]
    assert set_period(0.1).successful
    for change in ('configure', 'activate'):
        getattr(chain.driver, f'trigger_{change}')()
        refused = set_period(0.3)
        assert not refused.successful and 'sync_period: read at configure' in refused.reason
    assert chain.driver.get_parameter('sync_period').value == 0.1
    chain.driver.trigger_deactivate()
    chain.driver.trigger_cleanup()
    assert set_period(0.2).successful
    chain.driver.trigger_configure()
    assert chain.driver._settings.sync_period == 0.2


def test_each_transition_is_logged(chain):
    logged = []
    chain.listener.create_subscription(Log, '/rosout', lambda message: logged.append(message.msg), 50)
    chain.wait(lambda: chain.listener.count_publishers('/rosout') > 1, 'no /rosout')
    for change in ('configure', 'activate', 'deactivate', 'cleanup'):
        getattr(chain.driver, f'trigger_{change}')()
    chain.wait(lambda: 'Lifecycle: inactive -> unconfigured.' in logged, 'not logged')
    assert [message for message in logged if message.startswith('Lifecycle')] == [
        'Lifecycle: unconfigured -> inactive.', 'Lifecycle: inactive -> active.', 'Lifecycle: active -> inactive.',
        'Lifecycle: inactive -> unconfigured.']


def test_whoever_comes_late_gets_the_last_status(chain):
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    heard = []
    chain.listener.create_subscription(SkinStatus, '/skin_driver/status', heard.append, STATUS_QOS)
    chain.wait(lambda: heard, 'no status')
    assert heard[0].active and heard[0].pads[0].nodes[0].nmt_state_text == 'OPERATIONAL' and not heard[0].failure


def test_each_change_of_the_lifecycle_is_reported_when_it_happens(chain):
    """Not only by the next message of the timer, whose callback cannot run meanwhile."""
    heard, changes = [], []
    chain.listener.create_subscription(SkinStatus, '/skin_driver/status', heard.append, ALL_STATUS_QOS)
    chain.wait(lambda: heard, 'no status')
    for change in ('configure', 'activate', 'deactivate', 'cleanup', 'configure', 'activate', 'shutdown'):
        begun = chain.driver.get_clock().now().nanoseconds
        getattr(chain.driver, f'trigger_{change}')()
        ended = chain.driver.get_clock().now().nanoseconds

        def of_the_change(begun=begun, ended=ended):
            return [status for status in heard
                    if begun <= Time.from_msg(status.header.stamp).nanoseconds <= ended]
        chain.wait(of_the_change, f'{change} not reported')
        last = of_the_change()[-1]
        changes.append((change, last.active, last.lifecycle_state, len(last.pads)))
    unconfigured, inactive, active, finalized = (SkinStatus.UNCONFIGURED, SkinStatus.INACTIVE, SkinStatus.ACTIVE,
                                                 SkinStatus.FINALIZED)
    assert heard[0].lifecycle_state == unconfigured
    assert changes == [('configure', False, inactive, 1), ('activate', True, active, 1),
                       ('deactivate', False, inactive, 1), ('cleanup', False, unconfigured, 0),
                       ('configure', False, inactive, 1), ('activate', True, active, 1),
                       ('shutdown', False, finalized, 0)]
    assert heard[-1].level == SkinStatus.STALE and heard[-1].message == 'not configured'


def seen_status(chain):
    """The messages that come, each with its time of arrival."""
    heard = []
    chain.listener.create_subscription(SkinStatus, '/skin_driver/status',
                                       lambda message: heard.append((time.monotonic(), message)), ALL_STATUS_QOS)
    return heard


def test_a_state_that_stays_is_published_once_a_second(chain, monkeypatch):
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    source = chain.driver.source
    counts, health = source.statistics(), source.health()  # a busy machine loses some TPDOs: hold the state still
    monkeypatch.setattr(source, 'statistics', lambda: counts)
    monkeypatch.setattr(source, 'health', lambda: health)
    heard = seen_status(chain)
    chain.wait(lambda: heard and heard[-1][1].level == SkinStatus.STALE, 'the frames do not stop')
    begin = len(heard)
    chain.wait(lambda: len(heard) >= begin + 3, 'it is not repeated')
    stamps = [seconds(message.header.stamp) for _, message in heard[begin - 1:]]
    assert stamps[3] - stamps[0] > 2.0, stamps  # not at each look, every 50 ms


def test_a_fault_reaches_the_status_when_it_changes(chain, monkeypatch):
    """Not by the message of each second, which does not come here; `make faults` measures how soon."""
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    monkeypatch.setattr(threads, 'EARLY', -inf)
    heard = seen_status(chain)
    chain.bench.adapter.is_plugged = False
    chain.wait(lambda: heard and heard[-1][1].fault != SkinStatus.FAULT_NONE, 'not reported')
    chain.bench.adapter.is_plugged = True
    chain.wait(lambda: heard[-1][1].fault == SkinStatus.FAULT_NONE, 'the end is not reported')


def test_of_a_flapping_fault_the_last_state_is_reported(chain, monkeypatch):
    """How often at most: test_pacer.py."""
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    heard, source = seen_status(chain), chain.driver.source
    states = itertools.cycle([None, Failure(BusFault.BUS_OFF)])
    health = source.health
    monkeypatch.setattr(source, 'health', lambda: health()._replace(failure=next(states)))
    chain.wait(lambda: len(heard) > 20, 'the changes are not reported')
    assert {message.fault for _, message in heard} == {SkinStatus.FAULT_NONE, SkinStatus.FAULT_BUS_OFF}
    monkeypatch.setattr(source, 'health', lambda: health()._replace(failure=Failure(BusFault.SENDING_FAILED)))
    chain.wait(lambda: heard[-1][1].fault == SkinStatus.FAULT_SENDING_FAILED, 'the last state is missing')


def test_with_simulated_time_and_no_clock_the_status_continues_with_the_stamp_0(chain):
    chain.driver.set_parameters([Parameter('use_sim_time', value=True)])
    heard = seen_status(chain)
    chain.wait(lambda: len(heard) > 2, 'the status has stopped')
    assert all(message.header.stamp.sec == message.header.stamp.nanosec == 0 for _, message in heard[1:])


def test_a_node_that_is_silent_is_not_operational(chain):
    heard = []
    chain.listener.create_subscription(SkinStatus, '/skin_driver/status', heard.append, STATUS_QOS)
    chain.driver.autostart()
    chain.wait(lambda: heard and heard[-1].pads and heard[-1].pads[0].nodes[0].operational, 'never operational')
    chain.bench.device.power_off()
    chain.wait(lambda: heard[-1].pads[0].nodes[0].fault == NodeStatus.FAULT_SILENT, 'fault not reported')
    node = heard[-1].pads[0].nodes[0]
    assert not node.operational and node.nmt_state == NodeStatus.NMT_OPERATIONAL and node.heartbeat_age > 0.5


OFFSET = 0.05  # N, below a contact and above the default limit


def tares(chain, limits, **request):
    """The answers to a tare with each of ``limits``."""
    chain.driver.autostart()
    chain.wait(lambda: (OK, OK) in chain.levels, 'never OK')
    client = chain.listener.create_client(Tare, '/skin_driver/tare')
    for limit in limits:
        assert chain.driver.set_parameters([Parameter('tare_limit', value=limit)])[0].successful
        call = client.call_async(Tare.Request(frames=5, **request))
        chain.wait(call.done, 'no answer')
        yield call.result()


def test_tare_is_refused_under_load_and_takes_off_what_is_below_the_limit(chain):
    """The skin reads PRESSED all over, which is a load; then OFFSET: with a higher limit that is none."""
    refused, also_refused = tares(chain, (0.5 * PRESSED, 2 * PRESSED))
    assert not refused.success and refused.refusal == Tare.Response.REFUSAL_PRESSED and not refused.tared
    assert not also_refused.success and also_refused.refusal == Tare.Response.REFUSAL_CONTACT
    assert 'row' in refused.message and not also_refused.tared
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, PRESSED, atol=0.01), 'tared away')
    chain.load[0] = OFFSET
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, OFFSET, atol=0.01), 'the load stays')
    done, = tares(chain, (2 * OFFSET,))
    assert done.success and done.refusal == Tare.Response.REFUSAL_NOT_KNOWN
    assert done.tared == ['pad32'] and done.frames_used[0] == 5
    assert done.largest_offset[0] == pytest.approx(OFFSET, abs=0.01) and done.noise[0] == pytest.approx(0, abs=0.01)
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, 0, atol=0.01), 'tare not taken off')


def request_tare(chain, frames):
    client = chain.listener.create_client(Tare, '/skin_driver/tare')
    chain.wait(client.service_is_ready, 'no service')
    return client.call_async(Tare.Request(frames=frames))


def test_a_tare_of_unreasonably_many_frames_is_refused_at_once(chain):
    chain.driver.autostart()
    call = request_tare(chain, 10_000)
    chain.wait(call.done, 'no answer')
    assert not call.result().success and call.result().refusal == Tare.Response.REFUSAL_TOO_MANY_FRAMES
    assert 'in 60 s at most' in call.result().message


def test_the_driver_continues_while_a_tare_waits_for_frames(chain):
    """Without frames it would wait for as long as they may take, half a minute."""
    early = request_tare(chain, 5)
    chain.wait(early.done, 'no answer')
    assert not early.result().success and early.result().refusal == Tare.Response.REFUSAL_DRIVER_NOT_ACTIVE
    assert 'a configured driver' in early.result().message
    chain.driver.autostart()
    chain.bench.device.power_off()
    first, before = request_tare(chain, 100), len(chain.reports)
    chain.wait(lambda: len(chain.reports) > before + 2, 'no diagnostics meanwhile')
    second = request_tare(chain, 5)
    chain.wait(second.done, 'no answer')
    assert not second.result().success and second.result().refusal == Tare.Response.REFUSAL_BUSY
    assert 'one request after another' in second.result().message
    assert not first.done()
    chain.driver.trigger_deactivate()
    chain.wait(first.done, 'no answer')
    assert not first.result().success and first.result().refusal == Tare.Response.REFUSAL_DRIVER_NOT_ACTIVE
    assert 'one that was deactivated' in first.result().message
    third = request_tare(chain, 100)
    chain.wait(third.done, 'no answer')
    assert not third.result().success and 'Activate it' in third.result().message
    chain.driver.trigger_cleanup()


def test_a_power_cycle_after_the_devices_own_zero_leaves_no_valid_value_before_the_next_tare(chain):
    chain.load[0] = OFFSET
    done, = tares(chain, (2 * OFFSET,), on_device=True)
    assert done.success
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, 0, atol=0.01), 'not zero')
    chain.bench.device.power_off()
    chain.bench.device.boot()
    chain.wait(lambda: 'until the next tare' in chain.reports[-1], 'not reported')
    assert chain.levels[-1][1] == ERROR
    since = len(chain.taxels)
    chain.wait(lambda: len(chain.taxels) > since + 10, 'no frames')
    assert all(np.isnan(frame.values).all() for frame in chain.taxels[since:])
    again = request_tare(chain, 5)
    chain.wait(again.done, 'no answer')
    assert again.result().success
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, 0, atol=0.01), 'not zero')
    chain.wait(lambda: chain.levels[-1][1] == OK, 'not well again')


def test_the_devices_own_zero_is_requested_only_without_load(chain):
    answers = tares(chain, (0.5 * OFFSET, 2 * OFFSET), on_device=True)
    chain.load[0] = OFFSET
    refused, answered = next(answers), len(chain.taxels)
    chain.wait(lambda: any(not frame.missing_can_frames for frame in chain.taxels[answered:]), 'no whole frame')
    values = np.concatenate([frame.values for frame in chain.taxels])
    np.testing.assert_allclose(values[np.isfinite(values)], OFFSET, atol=0.01)  # the refused tare took nothing off
    done = next(answers)
    assert not refused.success and refused.refusal == Tare.Response.REFUSAL_PRESSED and 'row' in refused.message
    assert done.success and f'{SIDE * SIDE} channels zeroed on the device' in done.message
    assert done.largest_offset[0] == pytest.approx(0, abs=0.01)  # nothing was left for the driver to take off
    chain.wait(lambda: np.allclose(chain.taxels[-1].values, 0, atol=0.01), 'not zero')
