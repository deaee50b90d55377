"""Hand results from one stage to the next by a call within the process, and publish them for all other nodes.

The driver thread puts each taxel frame into a bounded queue of the processor and wakes the executor. On the executor's
thread, the processor takes every frame. When no frame is waiting, a classifier takes its newest contact. The grasp node
takes every shape.

The classifiers work in rounds and process the oldest contact first. The shapes of both pads for one SYNC therefore
usually reach the grasp node before the shapes for the next SYNC. Messages that no stage waits for, such as images, are
created at the end of a round, so that they do not delay a shape.

A stage treats a result from a call like a message from a topic: it counts the result, and drops it while there is a
second source.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.node import Node
from std_msgs.msg import Header

from tactile_node.nodes.guarded_subscription import FrameKey, GuardedSubscription, frame_key
from tactile_node.ros.message_age import age_message
from tactile_node.ros.message_checks import Check, Message
from tactile_node.ros.message_health import StreamHealth
from tactile_node.ros.qos import is_wanted
from tactile_node.ros.settings import NodeSettings, ReceiverSettings

#: Time between two checks for other publishers [s], which is about as long as ROS discovery takes.
LISTENING_PERIOD = 0.1
#: Time after which a thread that waits for results wakes the executor again [s]. The first attempt is lost if the
#: executor starts later.
WAKING_PERIOD = 0.2


class StageResult(Protocol):
    """A result that a stage hands over. Like a message of the chain, the result belongs to one taxel frame."""

    @property
    def header(self) -> Header: ...

    @property
    def sequence(self) -> int: ...


Result = TypeVar('Result', bound=StageResult)
Waiting: TypeAlias = list[tuple[Any, float]]  #: Waiting results, each with the time when its taxels were acquired [s].


class HandOver:
    """Holds the stages of one process, and decides in which order the executor processes their results.

    Use the hand-over with `FrameExecutor`, because rclpy's own executors wait for all entities before each turn.
    """

    def __init__(self) -> None:
        self._inputs: dict[str, StageInput] = {}
        self._changed = threading.Condition()
        self._awake: Executor | None = None  # executor that has a pending task for this hand-over
        self._is_working = False
        self._is_released = False
        # Classifiers of the current round, each with the contacts that were waiting when the round began
        self._round: deque[tuple[StageInput, Waiting]] = deque()
        # functions to call at the end of the round
        self._postponed: deque[tuple[StageInput, Callable[[], None]]] = deque()

    def add(self, stage: 'StageInput') -> None:
        """From now on, hand every result for the topic of ``stage`` to that stage."""
        # a new dict, because another thread may be iterating over the old dict
        self._inputs = self._inputs | {stage.topic: stage}

    def remove(self, stage: 'StageInput') -> None:
        """Hand no more results to ``stage``, because its node is ending."""
        self._inputs = {topic: each for topic, each in self._inputs.items() if each is not stage}
        self._round = deque(each for each in self._round if each[0] is not stage)
        self._postponed = deque(each for each in self._postponed if each[0] is not stage)
        with self._changed:
            self._changed.notify_all()

    def input_of(self, topic: str) -> 'StageInput | None':
        """Return the stage of this process that reads ``topic``, or None."""
        return self._inputs.get(topic)

    def is_complete(self, topic: str) -> bool:
        """Return True if all stages from ``topic`` up to the classifier run in this process."""
        stage = self._inputs.get(topic)
        return stage is not None and (stage.sends_on is None or self.is_complete(stage.sends_on))

    def wake(self) -> None:
        """Wake the executor, so that it processes the waiting results.

        One task is enough for any number of waiting results. No task is created while the executor is processing
        results.
        """
        with self._changed:
            executor = next((stage.node.executor for stage in self._inputs.values() if stage.node.executor), None)
            if executor is None or self._awake is executor or self._is_working:
                return
            self._awake = executor
        with suppress(AttributeError, InvalidHandle):  # rclpy's own executors raise these errors after their shutdown
            executor.create_task(self._work)

    def postpone(self, stage: 'StageInput', publish: Callable[[], None]) -> None:
        """At the end of the round, publish messages that no other stage waits for.

        Parameters
        ----------
        stage : StageInput
            Stage that calls ``publish``.
        publish : callable
            Function that publishes the messages.
        """
        self._postponed.append((stage, publish))
        self.wake()

    def wait_until_answered(self) -> None:
        """Block until no result is waiting and no stage is working, so that a log is not played too fast.

        Between `release` and `hold`, the method returns immediately, because the log's thread must not wait for the
        executor while the executor is waiting for that thread to end.
        """
        with self._changed:
            while not (self._is_released or self._is_idle()):
                if not self._changed.wait(WAKING_PERIOD):
                    self._awake = None
                    self.wake()

    def release(self) -> None:
        """Let ``wait_until_answered`` return immediately from now on."""
        with self._changed:
            self._is_released = True
            self._changed.notify_all()

    def hold(self) -> None:
        """Let ``wait_until_answered`` block again."""
        with self._changed:
            self._is_released = False

    def _is_idle(self) -> bool:
        return not (self._is_working or self._has_work())

    def _has_work(self) -> bool:
        return bool(self._round or self._postponed) or any(stage.waits for stage in self._inputs.values())

    def _work(self) -> None:
        """Take one turn. The next turn runs in a separate task, so that other callbacks can run in between."""
        with self._changed:
            self._awake, self._is_working = None, True
        try:
            self._take_turn()
        finally:
            with self._changed:
                self._is_working = False
                self._changed.notify_all()
        if not self._is_idle():
            self.wake()

    def _take_turn(self) -> None:
        """Process all waiting frames, then the newest contact of one classifier.

        At the end of a round, also make the postponed calls.
        """
        self._work_on_all()
        if not self._round:
            found = ((stage, stage.take()) for stage in self._inputs.values() if stage.takes_newest and stage.waits)
            # ordered by the acquisition time of their newest contact
            self._round.extend(sorted(found, key=lambda each: each[1][-1][1]))
        if self._round:
            stage, waiting = self._round.popleft()
            stage.work(waiting)
            self._work_on_all()
        while self._postponed and not self._round:
            stage, publish = self._postponed.popleft()
            stage.call(publish)

    def _work_on_all(self) -> None:
        """Process waiting frames and shapes once for each stage, so that every classifier gets its turn."""
        for stage in self._inputs.values():
            if not stage.takes_newest and stage.waits:
                stage.work(stage.take())


class StageInput(GuardedSubscription[Message], Generic[Message, Result]):
    """Input of a stage, which receives results from a stage of this process or from a topic.

    The input subscribes to the topic unless a stage of this process is its only publisher. If another node also
    publishes the topic, the input drops all results from the moment that node starts to send. If a message of this
    process comes back over the topic, the input recognises it by its sequence number and stamp, and ignores it.

    Parameters
    ----------
    node : Node
        Node of the stage.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    accept : callable
        Function that is called with each result or, with ``newest_only``, with the newest waiting result.
    settings : ReceiverSettings
        Settings of the node.
    check : callable
        Function that returns the reason why a message cannot be used, or None.
    parse : callable
        Function that creates a result from a message.
    hand_over : HandOver
        Hand-over that connects the stages of this process.
    newest_only : bool
        True to process only the newest waiting result.
    steady : callable
        Steady clock [s].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, accept: Callable[[Result], None],
                 settings: ReceiverSettings, *, check: Check[Message], parse: Callable[[Message], Result],
                 hand_over: HandOver, newest_only: bool = False, steady: Callable[[], float] = time.monotonic):
        self.node, self._accept, self._hand_over = node, accept, hand_over
        # A full queue drops its oldest result. With newest_only, the queue is unlimited, so that every overtaken result
        # is counted.
        self._slot: deque[tuple[Result, float]] = deque(maxlen=None if newest_only else settings.most_waiting)
        # messages of this process that may come back over the topic
        self._own: deque[FrameKey] = deque(maxlen=2 * settings.input_qos.depth)
        self._is_fed = False
        self._listened = -math.inf  # time of the last check for other publishers, on the steady clock [s]
        self.sends_on: str | None = None  #: topic of this stage's results, or None for the last stage of a pad
        qos = settings.input_qos
        qos.depth = qos.depth if newest_only or settings.lossless else settings.most_waiting
        super().__init__(node, kind, topic, lambda message: accept(parse(message)), qos, check=check,
                         newest_only=newest_only, steady=steady)
        hand_over.add(self)

    @property
    def waits(self) -> bool:
        """True if a result is waiting."""
        return bool(self._slot)

    def announce(self, result: Result) -> None:
        """Record that ``result`` will be published and handed over, so that its message is ignored if it comes back."""
        self._is_fed = True
        self._own.append(frame_key(result))

    def put(self, result: Result, acquired: float) -> None:
        """Put a result into the queue. Any thread may call this method.

        Parameters
        ----------
        result : Result
            Result of the previous stage.
        acquired : float
            Time when the taxels were acquired, on the steady clock [s]; -inf if not known.
        """
        self._slot.append((result, acquired))
        self._hand_over.wake()

    def end_feeding(self) -> None:
        """Record that the previous stage is gone, so that every publisher of the topic counts as another source."""
        self._is_fed = False
        self._own.clear()

    def end(self) -> None:
        """Accept no further results, because the node is ending."""
        self._hand_over.remove(self)

    def take(self) -> Waiting:
        """Return the waiting results and empty the queue."""
        return [self._slot.popleft() for _ in range(len(self._slot))]

    def work(self, waiting: Waiting) -> None:
        """Process all results in ``waiting``, or only the newest one, on the executor's thread."""
        try:
            if self._steady() - self._listened >= LISTENING_PERIOD:
                self._listen()
        except Exception as error:  # an uncaught exception would end the executor
            self._failed(error)
        for results in [waiting] if self.takes_newest else [[each] for each in waiting]:
            usable = [result for result, acquired in results if self._is_usable(result, acquired)]
            self._work_on(usable, self._accept)

    def postpone(self, publish: Callable[[], None]) -> None:
        """Call ``publish`` at the end of the round, when it no longer delays a shape."""
        self._hand_over.postpone(self, publish)

    def call(self, publish: Callable[[], None]) -> None:
        """Call ``publish``, and log an exception, because an uncaught exception would end the executor."""
        try:
            publish()
        except Exception as error:
            self._failed(error)

    @property
    def health(self) -> StreamHealth:
        """Message counts, age and stamp of the newest data, and the publishers of the topic."""
        self._listen()
        return super().health

    def _on_message(self, message: Message) -> None:
        self._count_publishers()
        news = [each for each in (message, *self._waiting()) if frame_key(each) not in self._own]
        self._work_on([each for each in news if self._is_usable(each)], self._callback)

    def _listen(self) -> None:
        """Subscribe to the topic unless a stage of this process is its only publisher."""
        self._listened = self._steady()
        self._count_publishers()
        others = self._publishers - self._is_fed
        if self._is_fed and others <= 0:
            self.destroy()
        elif self._subscription is None and (others > 0 or not self._is_fed):
            self._subscription = self._subscribe()


class StageOutput(Generic[Result]):
    """Output of a stage, which hands results to the next stage of this process and publishes them on a topic.

    The output creates a message only while the topic has a subscriber. In a lossless replay, it always creates one.

    Parameters
    ----------
    node : Node
        Node of the stage.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    settings : NodeSettings
        Settings of the node.
    make : callable
        Function that creates a message from a result.
    hand_over : HandOver
        Hand-over that connects the stages of this process.
    """

    def __init__(self, node: Node, kind: type, topic: str, settings: NodeSettings, make: Callable[[Result], Any],
                 hand_over: HandOver):
        self._node, self._make, self._hand_over = node, make, hand_over
        self._is_lossless = settings.lossless
        self._publisher: Any = node.create_publisher(kind, topic, settings.qos)
        self.topic: str = self._publisher.topic_name  #: full name of the topic

    def send(self, result: Result, acquired: float) -> None:
        """Publish a result and hand it over.

        Parameters
        ----------
        result : Result
            Result of this stage.
        acquired : float
            Time when the taxels were acquired, on the steady clock [s].
        """
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.announce(result)
        try:
            if is_wanted(self._publisher, self._is_lossless):
                message = self._make(result)
                message.age = age_message(time.monotonic() - acquired)
                self._publisher.publish(message)
        finally:  # the next stage must get the result even if publishing the message fails
            if reader is not None:
                reader.put(result, acquired)

    def end(self) -> None:
        """Stop sending, because the node is ending or is no longer configured."""
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.end_feeding()
        self._node.destroy_publisher(self._publisher)


class StageNode(Node):
    """A node that ends its stage inputs and outputs when it is destroyed."""

    stages: 'tuple[StageInput | StageOutput, ...]' = ()  #: empty if the constructor failed

    def destroy_node(self) -> None:
        """End all inputs and outputs, and destroy the node."""
        for stage in self.stages:
            stage.end()
        super().destroy_node()
