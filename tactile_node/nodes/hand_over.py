"""Hand results from one stage to the next: by a call if both run in one process, on a topic for everyone else.

The driver thread puts each taxel frame into a bounded slot of the processor and wakes the executor. On the executor's
thread, the processor takes every frame. When no frame waits, a classifier takes its newest contact. The grasp node
takes every shape.

The classifiers work in rounds, the oldest contact first. The shapes of both pads for one SYNC therefore usually reach
the grasp node before those for the next SYNC. Messages that no stage waits for, such as images, are made at the end of
a round, so they delay no shape.

The same rules apply to results from a call and from a topic: they are counted, and dropped while there is a second
source.
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

#: Time between two checks for other publishers [s]. Discovery takes about as long.
LISTENING_PERIOD = 0.1
#: Time after which a thread that waits for answers wakes the executor again [s]. The executor may have been started
#: only after the first attempt.
WAKING_PERIOD = 0.2


class StageResult(Protocol):
    """A result that a stage hands over. It belongs to one taxel frame, like a message of the chain."""

    @property
    def header(self) -> Header: ...

    @property
    def sequence(self) -> int: ...


Result = TypeVar('Result', bound=StageResult)
Waiting: TypeAlias = list[tuple[Any, float]]  #: Waiting results, each with the time when its taxels were acquired [s].


class HandOver:
    """The stages of one process and the order of their work, which the executor of their nodes carries out.

    It is meant for `FrameExecutor`, because rclpy's own executors wait for all entities before each turn.
    """

    def __init__(self) -> None:
        self._inputs: dict[str, StageInput] = {}
        self._changed = threading.Condition()
        self._awake: Executor | None = None  # executor with a pending task of this object
        self._is_working = False
        self._is_released = False
        # Classifiers of the present round, each with the contacts that waited when the round began
        self._round: deque[tuple[StageInput, Waiting]] = deque()
        self._postponed: deque[tuple[StageInput, Callable[[], None]]] = deque()  # calls for the end of the round

    def add(self, stage: 'StageInput') -> None:
        """Hand the results sent on the topic of ``stage`` to that stage from now on."""
        self._inputs = self._inputs | {stage.topic: stage}  # a new dict, because another thread may iterate the old one

    def remove(self, stage: 'StageInput') -> None:
        """Hand nothing more to ``stage``, because its node ends."""
        self._inputs = {topic: each for topic, each in self._inputs.items() if each is not stage}
        self._round = deque(each for each in self._round if each[0] is not stage)
        self._postponed = deque(each for each in self._postponed if each[0] is not stage)
        with self._changed:
            self._changed.notify_all()

    def input_of(self, topic: str) -> 'StageInput | None':
        """Return the stage of this process that reads ``topic``, or None."""
        return self._inputs.get(topic)

    def is_complete(self, topic: str) -> bool:
        """Return True if all stages from ``topic`` to the shape run in this process."""
        stage = self._inputs.get(topic)
        return stage is not None and (stage.sends_on is None or self.is_complete(stage.sends_on))

    def wake(self) -> None:
        """Wake the executor, so that it works on the waiting results.

        One task is created however many results wait. No task is created while the executor is working on results.
        """
        with self._changed:
            executor = next((stage.node.executor for stage in self._inputs.values() if stage.node.executor), None)
            if executor is None or self._awake is executor or self._is_working:
                return
            self._awake = executor
        with suppress(AttributeError, InvalidHandle):  # rclpy's own executors raise these after their shutdown
            executor.create_task(self._work)

    def postpone(self, stage: 'StageInput', publish: Callable[[], None]) -> None:
        """Publish messages that no other stage waits for, at the end of the round.

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
        """Return when no result waits and no stage is working. This keeps a log from being played too fast.

        Between `release` and `hold`, the method returns immediately: the thread of the log must not wait for the
        executor while the executor waits for the end of that thread.
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
        """Let ``wait_until_answered`` wait again."""
        with self._changed:
            self._is_released = False

    def _is_idle(self) -> bool:
        return not (self._is_working or self._has_work())

    def _has_work(self) -> bool:
        return bool(self._round or self._postponed) or any(stage.waits for stage in self._inputs.values())

    def _work(self) -> None:
        """Take one turn. The next turn runs in another task, so other callbacks can run in between."""
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
        """Work on every waiting frame, then on one newest contact. At the end of a round, make the postponed calls."""
        self._work_on_all()
        if not self._round:
            found = ((stage, stage.take()) for stage in self._inputs.values() if stage.takes_newest and stage.waits)
            self._round.extend(sorted(found, key=lambda each: each[1][-1][1]))  # by the time of the newest
        if self._round:
            stage, waiting = self._round.popleft()
            stage.work(waiting)
            self._work_on_all()
        while self._postponed and not self._round:
            stage, publish = self._postponed.popleft()
            stage.call(publish)

    def _work_on_all(self) -> None:
        """Work on waiting frames and shapes, once for each stage, so that a classifier always has its turn."""
        for stage in self._inputs.values():
            if not stage.takes_newest and stage.waits:
                stage.work(stage.take())


class StageInput(GuardedSubscription[Message], Generic[Message, Result]):
    """Input of a stage. It takes results from a stage of this process or from a topic.

    The input subscribes to the topic unless a stage of this process is its only publisher. If another node also
    publishes the topic, the input uses no result from the moment at which that node sends. Messages of this process
    that come back over the topic are recognised by sequence number and stamp, and ignored.

    Parameters
    ----------
    node : Node
        Node of the stage.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    accept : callable
        Called with each result, or with the newest waiting result.
    settings : ReceiverSettings
        Settings of the node.
    check : callable
        Returns the reason why a message cannot be used, or None.
    parse : callable
        Makes a result from a message.
    hand_over : HandOver
        Hand-over of this process.
    newest_only : bool
        True to work only on the newest waiting result.
    steady : callable
        Steady clock [s].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, accept: Callable[[Result], None],
                 settings: ReceiverSettings, *, check: Check[Message], parse: Callable[[Message], Result],
                 hand_over: HandOver, newest_only: bool = False, steady: Callable[[], float] = time.monotonic):
        self.node, self._accept, self._hand_over = node, accept, hand_over
        # A full slot drops its oldest result. With newest_only the slot is unlimited, so that each result that is
        # overtaken by a newer one is counted.
        self._slot: deque[tuple[Result, float]] = deque(maxlen=None if newest_only else settings.most_waiting)
        self._own: deque[FrameKey] = deque(maxlen=2 * settings.input_qos.depth)  # messages that may come back
        self._is_fed = False
        self._listened = -math.inf  # time of the last check for other publishers, on the steady clock [s]
        self.sends_on: str | None = None  #: topic of the results of this stage; None for the last stage of a pad
        qos = settings.input_qos
        qos.depth = qos.depth if newest_only or settings.lossless else settings.most_waiting
        super().__init__(node, kind, topic, lambda message: accept(parse(message)), qos, check=check,
                         newest_only=newest_only, steady=steady)
        hand_over.add(self)

    @property
    def waits(self) -> bool:
        """True if a result waits."""
        return bool(self._slot)

    def announce(self, result: Result) -> None:
        """Note that ``result`` is about to be published and handed over, so its message is ignored if it comes back."""
        self._is_fed = True
        self._own.append(frame_key(result))

    def put(self, result: Result, acquired: float) -> None:
        """Hand over a result. Any thread may call this.

        Parameters
        ----------
        result : Result
            Result of the previous stage.
        acquired : float
            Time when its taxels were acquired, on the steady clock [s]; -inf if not known.
        """
        self._slot.append((result, acquired))
        self._hand_over.wake()

    def end_feeding(self) -> None:
        """Note that the previous stage is gone. From now on, every publisher of the topic counts as another source."""
        self._is_fed = False
        self._own.clear()

    def end(self) -> None:
        """Accept no further results, because the node ends."""
        self._hand_over.remove(self)

    def take(self) -> Waiting:
        """Return the waiting results and empty the slot."""
        return [self._slot.popleft() for _ in range(len(self._slot))]

    def work(self, waiting: Waiting) -> None:
        """Work on all results in ``waiting``, or only on the newest one. This runs on the executor's thread."""
        try:
            if self._steady() - self._listened >= LISTENING_PERIOD:
                self._listen()
        except Exception as error:  # an exception would end the executor
            self._failed(error)
        for results in [waiting] if self.takes_newest else [[each] for each in waiting]:
            usable = [result for result, acquired in results if self._is_usable(result, acquired)]
            self._work_on(usable, self._accept)

    def postpone(self, publish: Callable[[], None]) -> None:
        """Call ``publish`` when no shape has to wait for it any more."""
        self._hand_over.postpone(self, publish)

    def call(self, publish: Callable[[], None]) -> None:
        """Call ``publish``, and log an exception, which would otherwise end the executor."""
        try:
            publish()
        except Exception as error:
            self._failed(error)

    @property
    def health(self) -> StreamHealth:
        """Counts of the messages, age and stamp of the newest data, and the publishers of the topic."""
        self._listen()
        return super().health

    def _on_message(self, message: Message) -> None:
        self._count_publishers()
        news = [each for each in (message, *self._waiting()) if frame_key(each) not in self._own]
        self._work_on([each for each in news if self._is_usable(each)], self._callback)

    def _listen(self) -> None:
        """Subscribe to the topic, unless a stage of this process is its only publisher."""
        self._listened = self._steady()
        self._count_publishers()
        others = self._publishers - self._is_fed
        if self._is_fed and others <= 0:
            self.destroy()
        elif self._subscription is None and (others > 0 or not self._is_fed):
            self._subscription = self._subscribe()


class StageOutput(Generic[Result]):
    """Output of a stage. It hands results to the next stage of this process, and publishes them on a topic.

    A message is only made while there is a subscriber, except in a lossless replay, where it is always made.

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
        Makes a message from a result.
    hand_over : HandOver
        Hand-over of this process.
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
            Time when its taxels were acquired, on the steady clock [s].
        """
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.announce(result)
        try:
            if is_wanted(self._publisher, self._is_lossless):
                message = self._make(result)
                message.age = age_message(time.monotonic() - acquired)
                self._publisher.publish(message)
        finally:  # the next stage must get the result even if the message for other subscribers fails
            if reader is not None:
                reader.put(result, acquired)

    def end(self) -> None:
        """Stop sending, because the node ends or is no longer configured."""
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.end_feeding()
        self._node.destroy_publisher(self._publisher)


class StageNode(Node):
    """A node with inputs and outputs of stages, which it ends when it is destroyed."""

    stages: 'tuple[StageInput | StageOutput, ...]' = ()  #: empty if the constructor has failed

    def destroy_node(self) -> None:
        """End all inputs and outputs, and destroy the node."""
        for stage in self.stages:
            stage.end()
        super().destroy_node()
