"""Tests that our executor serves everything that rclpy's executor serves, but QoS events only once a second."""

import threading
import time
from contextlib import suppress
from functools import partial

import pytest
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from tactile_node.nodes.spinning import EVENTS_PERIOD, FrameExecutor, spinning

pytestmark = [pytest.mark.ros, pytest.mark.bus]

TIMEOUT = 60.0  # Timeout [s].


@pytest.fixture
def nodes():
    rclpy.init()
    made = [rclpy.create_node(name) for name in ('served', 'other')]
    yield made
    for node in made:
        node.destroy_node()
    rclpy.shutdown()


def wait_for(condition):
    end = time.monotonic() + TIMEOUT
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    assert condition()


def test_messages_timers_and_answers_that_take_a_while_are_served(nodes):
    served, other = nodes
    heard, ticks = [], []

    async def answer(request, response):
        done = Future(executor=served.executor)
        threading.Timer(0.3, lambda: done.set_result(True)).start()
        response.success = await done
        return response
    served.create_subscription(String, 'words', lambda message: heard.append(message.data), 10)
    served.create_timer(0.05, lambda: ticks.append(time.monotonic()))
    # The driver's tare service also uses a reentrant callback group.
    served.create_service(Trigger, 'ask', answer, callback_group=ReentrantCallbackGroup())
    client = other.create_client(Trigger, 'ask')
    publisher = other.create_publisher(String, 'words', 10)
    with spinning(nodes):
        assert client.wait_for_service(TIMEOUT)
        call = client.call_async(Trigger.Request())
        wait_for(lambda: publisher.get_subscription_count() == 1)
        for word in 'abc':
            publisher.publish(String(data=word))
        wait_for(lambda: call.done() and len(ticks) > 5 and heard == ['a', 'b', 'c'])
    assert call.result().success


def test_a_publisher_whose_qos_does_not_fit_is_reported_also_while_messages_come(nodes):
    served, other = nodes
    events = []
    served.create_subscription(String, 'words', lambda message: None, QoSProfile(depth=1),
                               event_callbacks=SubscriptionEventCallbacks(incompatible_qos=events.append))
    served.create_subscription(String, 'busy', lambda message: None, 10)
    busy = other.create_publisher(String, 'busy', 10)
    other.create_timer(0.005, lambda: busy.publish(String()))
    with spinning(nodes):
        time.sleep(1.5 * EVENTS_PERIOD)
        other.create_publisher(String, 'words', QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
        wait_for(lambda: events)


def test_most_waits_do_not_include_event_handlers(nodes):
    executor = FrameExecutor()
    for node in nodes:
        executor.add_node(node)
    first, second = executor.get_nodes(), executor.get_nodes()
    assert [a is b for a, b in zip(first, second)] == [True, True]
    assert [list(each.waitables) for each in second] == [[], []]
    executor.remove_node(nodes[0])
    assert len(executor.get_nodes()) == 1


class WaitCounter(FrameExecutor):
    """Counts how often the executor waits for entities, because each wait prepares all entities."""

    waits = 0

    def get_nodes(self):
        self.waits += 1
        return super().get_nodes()


def test_tasks_and_steady_timers_cost_no_wait_for_entities(nodes):
    executor, ticks, done = WaitCounter(), [], []
    executor.add_node(nodes[0])
    nodes[0].create_timer(0.01, lambda: ticks.append(time.monotonic()), clock=Clock(clock_type=ClockType.STEADY_TIME))
    end = time.monotonic() + TIMEOUT
    while len(ticks) < 100 and time.monotonic() < end:
        executor.create_task(lambda: done.append(threading.current_thread()))
        executor.spin_once(timeout_sec=0.01)
    waits, seconds = executor.waits, TIMEOUT - (end - time.monotonic())
    executor.shutdown()
    assert len(ticks) >= 100 and set(done) == {threading.current_thread()}
    assert waits <= 4 + seconds / EVENTS_PERIOD  # The executor waits a few times at the start, and then once a second.


def test_tasks_that_never_end_keep_neither_timers_nor_messages_waiting(nodes):
    served, other = nodes
    heard, ticks, ending = [], [], []
    served.create_subscription(String, 'words', lambda message: heard.append(message.data), 10)
    served.create_timer(0.05, lambda: ticks.append(1), clock=Clock(clock_type=ClockType.STEADY_TIME))
    publisher = other.create_publisher(String, 'words', 10)
    with spinning(nodes):
        def again():
            if not ending:
                served.executor.create_task(again)
        again()
        wait_for(lambda: publisher.get_subscription_count() == 1)
        publisher.publish(String(data='a'))
        wait_for(lambda: heard and len(ticks) > 5)
        ending.append(1)


def test_a_timer_that_is_destroyed_or_cancelled_is_not_called_again(nodes):
    ticks, clock = {'destroyed': 0, 'cancelled': 0, 'kept': 0}, Clock(clock_type=ClockType.STEADY_TIME)

    def tick(name):
        ticks[name] += 1
    timers = {name: nodes[0].create_timer(0.01, partial(tick, name), clock=clock) for name in ticks}
    with spinning(nodes):
        wait_for(lambda: min(ticks.values()) > 2)
        nodes[0].destroy_timer(timers['destroyed'])
        timers['cancelled'].cancel()
        time.sleep(0.1)
        before = dict(ticks)
        wait_for(lambda: ticks['kept'] > before['kept'] + 10)
    assert (ticks['destroyed'], ticks['cancelled']) == (before['destroyed'], before['cancelled'])


def test_an_exception_of_a_task_or_a_timer_ends_the_spinning(nodes):
    def fail():
        raise RuntimeError('as asked')
    for start in (lambda: nodes[0].executor.create_task(fail),
                  lambda: nodes[0].create_timer(0.01, fail, clock=Clock(clock_type=ClockType.STEADY_TIME))):
        with pytest.raises(RuntimeError, match='as asked'), spinning(nodes) as spinner:
            start()
            end = time.monotonic() + TIMEOUT
            while time.monotonic() < end:
                spinner.check()
                time.sleep(0.01)


def test_the_next_executor_serves_entities_that_were_ready_but_not_run(nodes):
    heard, executor = [], FrameExecutor()
    nodes[0].create_subscription(String, 'words', lambda message: heard.append(message.data), 10)
    publisher = nodes[1].create_publisher(String, 'words', 10)
    executor.add_node(nodes[0])
    executor.spin_once(timeout_sec=0)  # This call starts the thread that waits for messages.
    wait_for(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(String(data='a'))
    wait_for(lambda: executor._found is not None)
    executor.shutdown()
    assert not heard
    with spinning(nodes):
        wait_for(lambda: heard == ['a'])


def test_a_callback_that_ends_the_thread_keeps_none_of_the_others_waiting(nodes):
    heard, executor = [], FrameExecutor()

    def hear(message):
        heard.append(message.data)
        raise KeyboardInterrupt
    nodes[0].create_subscription(String, 'words', hear, 10)
    publisher = nodes[1].create_publisher(String, 'words', 10)
    executor.add_node(nodes[0])
    wait_for(lambda: publisher.get_subscription_count() == 1)
    for word in 'ab':
        publisher.publish(String(data=word))
    end = time.monotonic() + TIMEOUT
    while len(heard) < 2 and time.monotonic() < end:
        with suppress(KeyboardInterrupt):
            executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert heard == ['a', 'b']


def test_an_entity_that_is_destroyed_during_a_wait_causes_no_failure(nodes):
    served, other = nodes
    heard = []
    with spinning(nodes):
        for number in range(200):
            gone = served.create_subscription(String, f'gone_{number % 5}', lambda message: None, 10)
            served.executor.create_task(partial(served.destroy_subscription, gone))
        served.create_subscription(String, 'words', lambda message: heard.append(message.data), 10)
        publisher = other.create_publisher(String, 'words', 10)
        wait_for(lambda: publisher.get_subscription_count() == 1)
        publisher.publish(String(data='a'))
        wait_for(lambda: heard)
