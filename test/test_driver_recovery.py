"""Tests that the driver node survives an outage.

The same node must still be active afterwards, and /diagnostics must report the true state of the bus.
"""

import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from driver_bench import ERROR, OK, DriverBench
from fault_bench import PRESSED, SIDE, FaultBench
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Log
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

from tactile_node.bus import change_pace
from tactile_node.bus.log_throttle import FIRST_PAUSE
from tactile_node.cli.main import main
from tactile_node.nodes import driver_node, tare_client
from tactile_node.nodes.lifecycle_steps import WAITING
from tactile_node.nodes.pad_output import PadOutput
from tactile_node.ros.parameters import read
from tactile_node.ros.qos import STATUS_QOS
from tactile_node.ros.settings import DriverSettings
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import NodeStatus, SkinStatus, TaxelArray
from tactile_skin.srv import Tare

pytestmark = [pytest.mark.ros, pytest.mark.bus]

# QoS profile that keeps all status messages, not only the latest one.
ALL_STATUS_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def chain(ros):
    load = [PRESSED]
    bench = ros.enter_context(FaultBench('driver node', source=lambda t: np.full((SIDE, SIDE), load[0])))
    # A stall as long as this SYNC period [s] is reported as WARN, but stalls that long are rare.
    chain = DriverBench(ros, bench, sync_period=0.2)
    chain.load = load
    return chain


def test_an_unplugged_adapter_is_an_error_until_it_is_back_and_the_node_stays_active(chain, monkeypatch):
    """Both topics must report each change before the regular message of each second, which this test disables.

    `make faults` measures how soon a fault is reported, and test_pacer.py tests the highest rate of these reports.
    """
    chain.start()
    monkeypatch.setattr(change_pace, 'EARLY_ROUND', -inf)
    chain.bench.adapter.is_plugged = False
    chain.until(lambda: chain.levels[-1][0] == ERROR, 'no error')
    chain.until(lambda: chain.status[-1].fault != SkinStatus.FAULT_NONE, 'not in the status')
    chain.bench.adapter.is_plugged = True
    back = time.time()
    chain.until(lambda: chain.status[-1].fault == SkinStatus.FAULT_NONE, 'the end is not in the status')
    chain.until(lambda: any(frame.header.stamp.sec > back and not frame.missing_can_frames for frame in chain.taxels),
                'no taxels again')
    chain.until(lambda: chain.levels[-1] == (OK, OK), 'never OK again')
    sequences = [frame.sequence for frame in chain.taxels]
    assert sequences == sorted(set(sequences))
    assert chain.node._state_machine.current_state[1] == 'active'


def test_a_device_that_is_gone_is_never_ok_nor_operational(chain):
    chain.start()
    chain.bench.device.power_off()
    seen = len(chain.levels)
    chain.until(lambda: len(chain.levels) >= seen + 4, 'no diagnostics')
    # The first message may still describe the time before the outage.
    assert all(levels[1] != OK for levels in chain.levels[seen + 1:]), chain.levels[seen:]
    # While late taxels still arrive, the report states only that the heartbeat is missing.
    chain.until(lambda: 'neither heartbeat nor taxels' in chain.reports[-1], 'no report of the silence')
    assert chain.levels[-1][1] == ERROR
    # The status of the same time may arrive after the diagnostics.
    chain.until(lambda: chain.status[-1].pads[0].nodes[0].fault == NodeStatus.FAULT_SILENT, 'no status of the fault')
    node = chain.status[-1].pads[0].nodes[0]
    assert node.nmt_state == NodeStatus.NMT_OPERATIONAL
    assert not node.operational and node.heartbeat_age > 0.5
    chain.bench.device.boot()
    chain.until(lambda: chain.levels[-1] == (OK, OK), 'never OK again')


def test_the_driver_waits_for_a_missing_bus_and_reports_it_now_and_then(chain):
    chain.bench.adapter.is_plugged = False
    logged, begun, heard = chain.listen(Log, '/rosout', 100), time.monotonic(), chain.status
    starting = threading.Thread(target=chain.node.autostart, args=(threading.Event(),))
    starting.start()
    chain.until(lambda: len(heard) > 2 and heard[-1].failure, 'not reported')
    assert chain.levels[-1] == (ERROR,) and 'a bus that opens' in chain.reports[-1]
    assert (heard[-1].level, heard[-1].fault) == (SkinStatus.ERROR, SkinStatus.FAULT_NOT_OPENED)
    assert not heard[-1].active
    assert starting.is_alive() and chain.bench.adapter.opened == 0
    chain.until(lambda: any(WAITING in message.msg for message in logged), 'not logged')
    reports = sum(WAITING in message.msg for message in logged)
    assert reports <= 1 + (time.monotonic() - begun) / FIRST_PAUSE  # The driver must not log every attempt.
    chain.bench.adapter.is_plugged = True
    chain.until(lambda: (OK, OK) in chain.levels, 'never OK')
    starting.join()
    chain.until(lambda: heard[-1].active and heard[-1].fault == SkinStatus.FAULT_NONE, 'status not well again')


def test_the_pads_of_a_driver_are_seen_all_or_none(chain, monkeypatch):
    """While the driver waits at start, the executor already publishes the state of its pads.

    The driver must therefore add all pads at once.
    """
    driver, seen = chain.node, []

    def output(*given, **options):
        seen.append(len(driver._pads))
        return PadOutput(*given, **options)
    monkeypatch.setattr(driver_node, 'PadOutput', output)
    settings = replace(read(driver, DriverSettings), pads=('left', 'right'), node_ids=(32, 64), boot_timeout=0.1)
    monkeypatch.setattr(driver_node, 'read', lambda *_: settings)
    driver.trigger_configure()
    assert seen == [0, 0]


def test_the_state_can_be_looked_at_while_the_driver_is_released(chain):
    """The executor reads the state every 50 ms, even while another thread is destroying the publishers."""
    chain.node.trigger_configure()
    output, = chain.node._pads.values()
    output._looked = -np.inf
    output.end()
    assert output.condition.other_publishers == ()
    chain.node._owned.remove(output.end)


def test_a_report_that_fails_ends_nothing(chain, monkeypatch):
    chain.start()
    source = chain.node.source
    facts, failures = source.facts, []

    def fail_at_first():
        if len(failures) < 5:
            failures.append(time.time())
            raise ZeroDivisionError('of the report')
        return facts()
    monkeypatch.setattr(source, 'facts', fail_at_first)
    # On a busy machine, an earlier report may still be on its way.
    chain.until(lambda: len(failures) == 5 and seconds(chain.diagnostics[-1].header.stamp) > failures[-1],
                'no report after it')


def test_with_simulated_time_and_no_clock_faults_are_reported_with_the_stamp_0(chain):
    chain.set('use_sim_time', True)
    chain.start()
    chain.bench.adapter.is_plugged = False
    chain.until(lambda: chain.levels[-1][0] == ERROR, 'OK stays')
    assert all(message.header.stamp.sec == message.header.stamp.nanosec == 0 for message in chain.status[1:])


def test_each_frame_has_the_time_since_its_sync_when_it_was_sent(chain):
    """The age of a frame must include the time since its SYNC, or a delayed driver's taxels would look current.

    In this test, sender and receiver share a clock.
    """
    arrived = []
    chain.listener.create_subscription(TaxelArray, '/pad32/taxels', lambda frame: arrived.append((time.time(), frame)),
                                       50)
    chain.node.autostart()
    chain.until(lambda: len(arrived) > 5, 'no taxels')
    publish = chain.node._pads['pad32'].conditioned.feed
    chain.node._pads['pad32'].conditioned.feed = lambda frame: (time.sleep(0.15), publish(frame))[1]
    before = len(arrived)
    chain.until(lambda: len(arrived) > before + 5, 'no taxels')
    for number, (at, frame) in enumerate(arrived):
        age = seconds(frame.age)
        assert 0 < age <= at - seconds(frame.header.stamp)
        assert age > 0.15 or number <= before + 2


def test_waiting_at_start_ends_when_stopped(chain):
    chain.bench.adapter.is_plugged = False
    stop_requested = threading.Event()
    stop_requested.set()
    assert chain.node.autostart(stop_requested) is None


def test_activate_may_be_tried_again_after_an_outage(chain):
    """In the ROS 2 lifecycle, a failed activate leaves the node inactive, so the node stays configured."""
    chain.node.trigger_configure()
    chain.bench.adapter.is_plugged = False
    chain.until(lambda: chain.node.source.failure is not None, 'not failed')
    assert chain.node.trigger_activate() == TransitionCallbackReturn.FAILURE
    chain.bench.adapter.is_plugged = True
    chain.until(lambda: chain.node.trigger_activate() == TransitionCallbackReturn.SUCCESS, 'not active')
    chain.until(lambda: chain.taxels, 'no taxels')


def test_an_invalid_transition_is_answered_and_ends_nothing(chain):
    chain.node.autostart()

    def is_made(number):
        request = ChangeState.Request(transition=Transition(id=number))
        return chain.answer(ChangeState, 'change_state', request).success
    assert not any(map(is_made, (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CONFIGURE, 77)))
    assert chain.node._state_machine.current_state[1] == 'active'
    assert is_made(Transition.TRANSITION_DEACTIVATE)


def test_parameters_read_at_configure_can_be_set_only_while_unconfigured(chain):
    assert chain.set('sync_period', 0.1).successful
    for change in ('configure', 'activate'):
        getattr(chain.node, f'trigger_{change}')()
        refused = chain.set('sync_period', 0.3)
        assert not refused.successful and 'sync_period: read at configure' in refused.reason
    assert chain.node.get_parameter('sync_period').value == 0.1
    chain.node.trigger_deactivate()
    chain.node.trigger_cleanup()
    assert chain.set('sync_period', 0.2).successful
    chain.node.trigger_configure()
    assert chain.node._settings.sync_period == 0.2


def test_a_late_subscriber_gets_the_last_status(chain, monkeypatch):
    chain.start()
    early = chain.listen(SkinStatus, '/skin_driver/status', STATUS_QOS)

    def is_operational(status):
        return status.active and status.pads[0].nodes[0].nmt_state_text == 'OPERATIONAL' and not status.failure
    chain.until(lambda: early and is_operational(early[-1]), 'no status')
    state = chain.node._state
    with state._turn:  # no further status is published
        monkeypatch.setattr(state, '_publish', lambda *_: None)
        silent_from = chain.node.get_clock().now()
    late = chain.listen(SkinStatus, '/skin_driver/status', STATUS_QOS)
    chain.until(lambda: late, 'no status')
    assert Time.from_msg(late[0].header.stamp) <= silent_from and is_operational(late[0])


def test_each_change_of_the_lifecycle_is_logged_and_reported_when_it_happens(chain):
    """The last report within a transition shows its result, and does not wait for the next regular report."""
    logged, heard = chain.listen(Log, '/rosout', 50), chain.listen(SkinStatus, '/skin_driver/status', ALL_STATUS_QOS)
    unconfigured, inactive, active, finalized = (SkinStatus.UNCONFIGURED, SkinStatus.INACTIVE, SkinStatus.ACTIVE,
                                                 SkinStatus.FINALIZED)
    chain.until(lambda: heard and chain.listener.count_publishers('/rosout') > 1, 'no status, or no /rosout')
    assert heard[0].lifecycle_state == unconfigured
    for change, expected in (('configure', (False, inactive, 1)), ('activate', (True, active, 1)),
                             ('deactivate', (False, inactive, 1)), ('cleanup', (False, unconfigured, 0)),
                             ('configure', (False, inactive, 1)), ('activate', (True, active, 1)),
                             ('shutdown', (False, finalized, 0))):
        begun = chain.node.get_clock().now().nanoseconds
        getattr(chain.node, f'trigger_{change}')()
        ended = chain.node.get_clock().now().nanoseconds

        def of_the_change(begun=begun, ended=ended):
            return [(status.active, status.lifecycle_state, len(status.pads)) for status in heard
                    if begun <= Time.from_msg(status.header.stamp).nanoseconds <= ended]
        chain.until(lambda expected=expected, reported=of_the_change: reported()[-1:] == [expected],
                    f'{change} not reported')
    assert heard[-1].level == SkinStatus.STALE and heard[-1].message == 'not configured'
    chain.until(lambda: any('-> finalized' in message.msg for message in logged), 'not logged')
    assert [message.msg for message in logged if message.msg.startswith('Lifecycle')][:4] == [
        'Lifecycle: unconfigured -> inactive.', 'Lifecycle: inactive -> active.', 'Lifecycle: active -> inactive.',
        'Lifecycle: inactive -> unconfigured.']


OFFSET = 0.05  # This offset [N] is too small for a contact but above the default tare limit.


def tared(chain, limit, **request):
    """Start the driver, request a tare with this limit, and return the answer."""
    chain.start()
    assert chain.set('tare_limit', limit).successful
    return chain.answer(Tare, 'tare', Tare.Request(frames=5, **request))


def wait_for_values(chain, value):
    chain.until(lambda: chain.taxels and np.allclose(chain.taxels[-1].values, value, atol=0.01), f'not {value}')


def test_tare_is_refused_under_load_and_takes_off_what_is_below_the_limit(chain):
    """The whole skin first reads PRESSED, which is a load.

    The skin then reads OFFSET, which a higher limit accepts.
    """
    refused, also_refused = tared(chain, 0.5 * PRESSED), tared(chain, 2 * PRESSED)
    assert not refused.success and refused.refusal == Tare.Response.REFUSAL_PRESSED and not refused.tared
    assert not also_refused.success and also_refused.refusal == Tare.Response.REFUSAL_CONTACT
    assert 'row' in refused.message and not also_refused.tared
    wait_for_values(chain, PRESSED)
    chain.load[0] = OFFSET
    wait_for_values(chain, OFFSET)
    done = tared(chain, 2 * OFFSET)
    assert done.success and done.refusal == Tare.Response.REFUSAL_NOT_KNOWN
    assert done.tared == ['pad32'] and done.frames_used[0] == 5
    assert done.largest_offset[0] == pytest.approx(OFFSET, abs=0.01) and done.noise[0] == pytest.approx(0, abs=0.01)
    wait_for_values(chain, 0)


@pytest.fixture
def tare_here(chain, monkeypatch):
    """Return a function that runs `tactile tare` for 5 frames on another thread of the driver's process."""
    # ROS is already running in this process and must keep running.
    monkeypatch.setattr(rclpy, 'init', lambda **given: None)
    monkeypatch.setattr(rclpy, 'try_shutdown', lambda: None)

    def exit_code(*words):
        with ThreadPoolExecutor() as threads:
            running = threads.submit(main, ['tare', '--frames', '5', *words])
            chain.until(running.done, 'the command has not ended')
        return running.result()
    return exit_code


def test_a_command_that_does_not_wait_is_refused_once(chain, tare_here, capsys):
    chain.start()
    assert tare_here('--wait', '0') == 1
    refusal, = capsys.readouterr().err.splitlines()
    assert refusal.startswith('tactile: error: pad32: tare: expected nothing on the pad: all taxels below 0.03 N')


def test_the_command_retries_while_something_presses_and_tares_all_pads_of_the_driver(chain, tmp_path):
    printed = tmp_path / 'printed.txt'
    chain.start()
    with printed.open('w') as output:
        process = subprocess.Popen([sys.executable, '-m', 'tactile_node.cli.main', 'tare', '--frames', '5', '--wait',
                                    '600'], stdout=output, stderr=subprocess.STDOUT)
    chain.stack.callback(process.wait)
    chain.stack.callback(process.kill)
    chain.until(lambda: 'trying again for 600 s' in printed.read_text(), 'it does not try again')
    chain.load[0] = 0.02  # This load [N] is below the tare limit.
    chain.until(lambda: process.poll() is not None, 'the command has not ended')
    assert process.returncode == 0
    assert printed.read_text().splitlines()[-1].startswith('pad32: tared over 5 frames, noise ')
    wait_for_values(chain, 0)


@pytest.mark.parametrize('wait', ['0.01', '0'])
def test_a_command_that_has_retried_in_vain_suggests_fewer_frames(wait, monkeypatch, capsys):
    pressed = Tare.Response(refusal=Tare.Response.REFUSAL_PRESSED, message='pressed')
    client = SimpleNamespace(pads=lambda: ['pad32'], tare=lambda *request: pressed)
    monkeypatch.setattr(tare_client, 'tare_client', lambda namespace: nullcontext(client))
    assert main(['tare', '--wait', wait]) == 1
    assert ('--frames' in capsys.readouterr().err) == (wait != '0')


def test_without_a_driver_the_command_says_what_to_start_and_which_drivers_run(tare_here, capsys, monkeypatch):
    monkeypatch.setattr(tare_client, 'DISCOVERY_TIMEOUT', 0.0)  # Nodes in the same process discover each other at once.
    assert tare_here('--namespace', 'hand') == 2
    error, = capsys.readouterr().err.splitlines()
    assert '/hand/skin_driver: expected a running driver, got none, but /skin_driver.' in error
    assert '`tactile bringup`' in error and '--namespace' in error
    assert tare_here('--namespace', '1hand') == 2
    assert 'namespace' in capsys.readouterr().err


def refusal_of(answer):
    assert not answer.success
    return answer.refusal


def test_a_tare_of_unreasonably_many_frames_is_refused_at_once(chain):
    chain.node.autostart()
    answer = chain.answer(Tare, 'tare', Tare.Request(frames=10_000))
    assert refusal_of(answer) == Tare.Response.REFUSAL_TOO_MANY_FRAMES and 'takes at most 60 s' in answer.message


def test_the_driver_continues_while_a_tare_waits_for_frames(chain):
    """Without frames, the tare would wait for its full timeout of half a minute."""
    early = chain.answer(Tare, 'tare', Tare.Request(frames=5))
    assert refusal_of(early) == Tare.Response.REFUSAL_DRIVER_NOT_ACTIVE and 'a configured driver' in early.message
    chain.node.autostart()
    chain.bench.device.power_off()
    first, before = chain.call(Tare, 'tare', Tare.Request(frames=100)), len(chain.reports)
    chain.until(lambda: len(chain.reports) > before + 2, 'no diagnostics meanwhile')
    second = chain.answer(Tare, 'tare', Tare.Request(frames=5))
    assert refusal_of(second) == Tare.Response.REFUSAL_BUSY and 'one request at a time' in second.message
    assert not first.done()
    chain.node.trigger_deactivate()
    chain.until(first.done, 'no answer')
    assert refusal_of(first.result()) == Tare.Response.REFUSAL_DRIVER_NOT_ACTIVE
    assert 'one that was deactivated' in first.result().message
    third = chain.answer(Tare, 'tare', Tare.Request(frames=100))
    assert refusal_of(third) == Tare.Response.REFUSAL_DRIVER_NOT_ACTIVE and 'Activate it' in third.message
    chain.node.trigger_cleanup()


def test_a_power_cycle_after_the_devices_own_zero_leaves_no_valid_value_before_the_next_tare(chain):
    chain.load[0] = OFFSET
    done = tared(chain, 2 * OFFSET, on_device=True)
    assert done.success and f'{SIDE * SIDE} channels zeroed on the device' in done.message
    # The device has already removed the offset, so the driver measures none.
    assert done.largest_offset[0] == pytest.approx(0, abs=0.01)
    wait_for_values(chain, 0)
    chain.bench.device.power_off()
    chain.bench.device.boot()
    chain.until(lambda: 'until the next tare' in chain.reports[-1], 'not reported')
    assert chain.levels[-1][1] == ERROR
    since = len(chain.taxels)
    chain.until(lambda: len(chain.taxels) > since + 10, 'no frames')
    assert all(np.isnan(frame.values).all() for frame in chain.taxels[since:])
    assert chain.answer(Tare, 'tare', Tare.Request(frames=5)).success
    wait_for_values(chain, 0)
    chain.until(lambda: chain.levels[-1][1] == OK, 'not well again')
