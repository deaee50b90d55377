"""How a stage gives its results to the next: by a call where both share a process, on a topic for everyone else.

The driver's thread puts a taxel frame in a bounded slot of the processor and wakes the executor. There the processor
takes every frame; when none waits, a classifier takes its newest contact, and grasp each shape. The classifiers go in
rounds, the oldest contact first, so that both pads of a SYNC come out in one grasp, as a rule, before the next SYNC's.
What no stage waits for, such as images, is made at the end of a round, so that it delays no shape.
Results arrive in one way, whichever way they came: counted, and refused beside those of a second source.
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

LISTENING_PERIOD = 0.1  # s between two looks for other publishers, of whom discovery tells in as long
WAKING_PERIOD = 0.2  # s after which one who waits for answers wakes the executor again: it may have begun since


class StageResult(Protocol):
    """What a stage hands over: of one taxel frame, as a message of the chain."""

    @property
    def header(self) -> Header: ...

    @property
    def sequence(self) -> int: ...


Result = TypeVar('Result', bound=StageResult)
Waiting: TypeAlias = list[tuple[Any, float]]  # results, and when their taxels were acquired


class HandOver:
    """The stages of one process, by the topics between them; the executor of their nodes does their work.

    Meant for FrameExecutor: rclpy's own executors wait for all entities before each turn.
    """

    def __init__(self) -> None:
        self._inputs: dict[str, StageInput] = {}
        self._changed = threading.Condition()
        self._awake: Executor | None = None  # that a task of ours is pending with
        self._is_working = False
        self._is_released = False
        self._round: deque[tuple[StageInput, Waiting]] = deque()  # classifiers, with what waited when it began
        self._postponed: deque[tuple[StageInput, Callable[[], None]]] = deque()  # to the end of the round

    def add(self, stage: 'StageInput') -> None:
        """Let ``stage`` be handed what is sent on its topic."""
        self._inputs = self._inputs | {stage.topic: stage}  # another thread may be looking through them

    def remove(self, stage: 'StageInput') -> None:
        """Hand nothing more to ``stage``, whose node ends."""
        self._inputs = {topic: each for topic, each in self._inputs.items() if each is not stage}
        self._round = deque(each for each in self._round if each[0] is not stage)
        self._postponed = deque(each for each in self._postponed if each[0] is not stage)
        with self._changed:
            self._changed.notify_all()

    def input_of(self, topic: str) -> 'StageInput | None':
        """Return the stage of this process that reads ``topic``."""
        return self._inputs.get(topic)

    def is_complete(self, topic: str) -> bool:
        """Return whether what is sent on ``topic`` comes out as a shape in this process."""
        stage = self._inputs.get(topic)
        return stage is not None and (stage.sends_on is None or self.is_complete(stage.sends_on))

    def wake(self) -> None:
        """Have the executor do what waits: one task, however much waits, and none while it is at work."""
        with self._changed:
            executor = next((stage.node.executor for stage in self._inputs.values() if stage.node.executor), None)
            if executor is None or self._awake is executor or self._is_working:
                return
            self._awake = executor
        with suppress(AttributeError, InvalidHandle):  # errors of rclpy's own executors just after their shutdown
            executor.create_task(self._work)

    def postpone(self, stage: 'StageInput', publish: Callable[[], None]) -> None:
        """Have ``stage`` call ``publish`` at the end of the round: no other stage waits for what that publishes."""
        self._postponed.append((stage, publish))
        self.wake()

    def wait_until_answered(self) -> None:
        """Return when nothing waits and nothing is worked on: a log goes no faster than its consumers.

        After `release` at once, until `hold`: its thread must not wait for one that waits for it.
        """
        with self._changed:
            while not (self._is_released or self._is_idle()):
                if not self._changed.wait(WAKING_PERIOD):
                    self._awake = None
                    self.wake()

    def release(self) -> None:
        with self._changed:
            self._is_released = True
            self._changed.notify_all()

    def hold(self) -> None:
        with self._changed:
            self._is_released = False

    def _is_idle(self) -> bool:
        return not (self._is_working or self._has_work())

    def _has_work(self) -> bool:
        return bool(self._round or self._postponed) or any(stage.waits for stage in self._inputs.values())

    def _work(self) -> None:
        """Take one turn; the next in another task, after other callbacks."""
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
        """Take every frame that waits, then one newest contact; after the last of a round, what was postponed."""
        self._work_on_all()
        if not self._round:
            found = ((stage, stage.take()) for stage in self._inputs.values() if stage.takes_newest and stage.waits)
            self._round.extend(sorted(found, key=lambda each: each[1][-1][1]))  # by when its newest was acquired
        if self._round:
            stage, waiting = self._round.popleft()
            stage.work(waiting)
            self._work_on_all()
        while self._postponed and not self._round:
            stage, publish = self._postponed.popleft()
            stage.call(publish)

    def _work_on_all(self) -> None:
        """Once: frames that never end must not keep the classifiers waiting."""
        for stage in self._inputs.values():
            if not stage.takes_newest and stage.waits:
                stage.work(stage.take())


class StageInput(GuardedSubscription[Message], Generic[Message, Result]):
    """What a stage takes from ``topic``: ``accept`` is called with each result, or with the newest of those that wait.

    A result is handed over by a stage of this process, or ``parse`` makes it of a message. The topic is subscribed to
    unless the only one that publishes it is a stage of this process. While another one publishes it too, no result is
    used once that one sends; the own messages that come back are known by sequence and stamp.
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, accept: Callable[[Result], None],
                 settings: ReceiverSettings, *, check: Check[Message], parse: Callable[[Message], Result],
                 hand_over: HandOver, newest_only: bool = False, steady: Callable[[], float] = time.monotonic):
        self.node, self._accept, self._hand_over = node, accept, hand_over
        # The oldest gives way, but where it would be left out for a newer one: there each is counted as that
        self._slot: deque[tuple[Result, float]] = deque(maxlen=None if newest_only else settings.most_waiting)
        self._own: deque[FrameKey] = deque(maxlen=2 * settings.input_qos.depth)  # what may come back
        self._is_fed = False
        self._listened = -math.inf  # when it last looked for other publishers [s, steady clock]
        self.sends_on: str | None = None  #: topic of the results of this stage; None: of the last one of a pad
        qos = settings.input_qos
        qos.depth = qos.depth if newest_only or settings.lossless else settings.most_waiting
        super().__init__(node, kind, topic, lambda message: accept(parse(message)), qos, check=check,
                         newest_only=newest_only, steady=steady)
        hand_over.add(self)

    @property
    def waits(self) -> bool:
        """Whether a result waits."""
        return bool(self._slot)

    def announce(self, result: Result) -> None:
        """Note that ``result`` is about to be published and handed over: its message, if it arrives, is no news."""
        self._is_fed = True
        self._own.append(frame_key(result))

    def put(self, result: Result, acquired: float) -> None:
        """Hand ``result`` over, whose taxels were ``acquired`` [s, steady clock; -inf: not known]; from any thread."""
        self._slot.append((result, acquired))
        self._hand_over.wake()

    def end_feeding(self) -> None:
        """Note that the stage before is gone: any publisher of the topic is its source from now on."""
        self._is_fed = False
        self._own.clear()

    def end(self) -> None:
        """Be handed nothing more: the node ends."""
        self._hand_over.remove(self)

    def take(self) -> Waiting:
        """Return what waits: the next that comes waits alone."""
        return [self._slot.popleft() for _ in range(len(self._slot))]

    def work(self, waiting: Waiting) -> None:
        """Work on all of ``waiting``, or on the newest of it. On the executor's thread."""
        try:
            if self._steady() - self._listened >= LISTENING_PERIOD:
                self._listen()
        except Exception as error:  # it would end the executor
            self._failed(error)
        for results in [waiting] if self.takes_newest else [[each] for each in waiting]:
            usable = [result for result, acquired in results if self._is_usable(result, acquired)]
            self._work_on(usable, self._accept)

    def postpone(self, publish: Callable[[], None]) -> None:
        """Call ``publish`` when no shape waits any more."""
        self._hand_over.postpone(self, publish)

    def call(self, publish: Callable[[], None]) -> None:
        """Call ``publish``, whose failure must not end the executor."""
        try:
            publish()
        except Exception as error:
            self._failed(error)

    @property
    def health(self) -> StreamHealth:
        self._listen()
        return super().health

    def _on_message(self, message: Message) -> None:
        self._count_publishers()
        news = [each for each in (message, *self._waiting()) if frame_key(each) not in self._own]
        self._work_on([each for each in news if self._is_usable(each)], self._callback)

    def _listen(self) -> None:
        """Subscribe to the topic while anyone publishes it but the stage of this process that hands over."""
        self._listened = self._steady()
        self._count_publishers()
        others = self._publishers - self._is_fed
        if self._is_fed and others <= 0:
            self.destroy()
        elif self._subscription is None and (others > 0 or not self._is_fed):
            self._subscription = self._subscribe()


class StageOutput(Generic[Result]):
    """The topic of a stage's results; ``make`` makes the message of one while anyone subscribes, in a replay always."""

    def __init__(self, node: Node, kind: type, topic: str, settings: NodeSettings, make: Callable[[Result], Any],
                 hand_over: HandOver):
        self._node, self._make, self._hand_over = node, make, hand_over
        self._is_lossless = settings.lossless
        self._publisher: Any = node.create_publisher(kind, topic, settings.qos)
        self.topic: str = self._publisher.topic_name  #: its full name

    def send(self, result: Result, acquired: float) -> None:
        """Publish ``result``, whose taxels were ``acquired`` [s, steady clock], and hand it over."""
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.announce(result)
        try:
            if is_wanted(self._publisher, self._is_lossless):
                message = self._make(result)
                message.age = age_message(time.monotonic() - acquired)
                self._publisher.publish(message)
        finally:  # what a viewer asked for must not keep a result from the next stage
            if reader is not None:
                reader.put(result, acquired)

    def end(self) -> None:
        """Send nothing more: the node ends, or is not configured any more."""
        reader = self._hand_over.input_of(self.topic)
        if reader is not None:
            reader.end_feeding()
        self._node.destroy_publisher(self._publisher)


class StageNode(Node):
    """A node with stages: once it is destroyed nothing is handed to it, and its topics are no one's."""

    stages: 'tuple[StageInput | StageOutput, ...]' = ()  #: none of a node whose constructor has failed

    def destroy_node(self) -> None:
        for stage in self.stages:
            stage.end()
        super().destroy_node()
