"""Stages of the processing chain: nodes that call each other in one process, and send messages between processes.

The driver, the processors, the classifiers and the grasp node are stages. A `StageOutput` is an `OnDemandPublisher`. If
the next stage runs in the same process, the output also calls the `StageInput` of that stage, on the chain thread. A
`StageInput` is a `GuardedInput`. The `StageInput` posts each message from the topic to the chain of its process.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

from rclpy.node import Node
from rclpy.subscription import Subscription

from tactile_node.chain import Chain, Step
from tactile_node.nodes.guarded_input import FrameKey, GuardedInput, frame_key
from tactile_node.nodes.on_demand_publisher import OnDemandPublisher
from tactile_node.ros.message_age import age_since
from tactile_node.ros.message_checks import Check, Message
from tactile_node.ros.message_health import StreamHealth
from tactile_node.ros.settings import NodeSettings, ReceiverSettings

#: Time between two checks for other publishers [s], which is about as long as ROS discovery takes.
LISTENING_PERIOD = 0.1
STOP_TIMEOUT = 2.0  #: Longest time that the end of a node waits for a running call of the chain [s].


#: A result of a stage: PadFrame, PadContact or PadShape. Each has the ``header``, ``sequence`` and ``acquired`` of its
#: taxel frame, and the number ``left_out`` of overtaken frames before it.
Result = TypeVar('Result')


class Stages:
    """The stages of one process, by topic, and the chain on which they run.

    Attributes
    ----------
    chain : Chain
        Running chain of the process.
    """

    def __init__(self) -> None:
        self.chain = Chain()
        self.chain.start()
        self._inputs: dict[str, StageInput] = {}

    def add(self, stage: 'StageInput') -> None:
        """Pass every result for the topic of ``stage`` to that stage."""
        # a new dict, because another thread may be reading the old one
        self._inputs = self._inputs | {stage.topic: stage}

    def remove(self, stage: 'StageInput') -> None:
        """Pass no more results to ``stage``, and wait until a running call of the chain has ended."""
        self._inputs = {topic: each for topic, each in self._inputs.items() if each is not stage}
        self.chain.wait_until_idle(STOP_TIMEOUT)

    def input_of(self, topic: str) -> 'StageInput | None':
        """Return the input that reads ``topic`` in this process, or None."""
        return self._inputs.get(topic)

    def is_complete(self, topic: str) -> bool:
        """Return True if all stages from ``topic`` up to the classifier run in this process."""
        stage = self._inputs.get(topic)
        return stage is not None and (stage.sends_on is None or self.is_complete(stage.sends_on))


class StageOutput(OnDemandPublisher[Any], Generic[Result]):
    """Output of a stage, which publishes results on a topic and passes them to the next stage of this process.

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
    stages : Stages
        Stages of this process.
    """

    def __init__(self, node: Node, kind: type, topic: str, settings: NodeSettings, make: Callable[[Result], Any],
                 stages: Stages):
        super().__init__(node, kind, topic, settings.qos, lossless=settings.lossless)
        self._make, self._stages = make, stages

    def send(self, result: Result) -> None:
        """Publish a result if the topic has a subscriber, and pass it on, on the chain thread.

        In a lossless replay, publish every result. If publishing raises an exception, the next stage still gets the
        result, and the caller gets the exception and counts it.
        """
        try:
            self.publish(self._message, result)
        finally:
            if (reader := self._stages.input_of(self.topic)) is not None:
                reader.feed(result)

    def end(self) -> None:
        """Stop sending, because the node is ending or is no longer configured."""
        reader = self._stages.input_of(self.topic)
        if reader is not None:
            reader.end_feeding()
        self.destroy()

    def _message(self, result: Any) -> Any:
        message = self._make(result)
        message.age = age_since(result.acquired)
        return message


class StageInput(GuardedInput[Message], Generic[Message, Result]):
    """Input of a stage, which receives results from a stage of the same process or messages from a topic.

    Both wait for their turn on the chain. The input subscribes to the topic unless a stage of this process is its only
    publisher. If another node also publishes the topic, the input drops all results from the moment that node starts to
    send. If a message of this process comes back over the topic, the input recognises it by its sequence number and
    stamp, and ignores it.

    Parameters
    ----------
    node : Node
        Node of the stage.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    accept : callable
        Function that is called with each result, on the chain thread.
    settings : ReceiverSettings
        Settings of the node.
    check : callable
        Function that returns the reason why a message cannot be used, or None.
    parse : callable
        Function that creates a result from a message and the time when its taxels were acquired, on the steady clock
        [s] (-inf if not known).
    stages : Stages
        Stages of this process.
    step : Step or None
        Step of the chain in which ``accept`` is called, or None to call it at once.
    most_waiting : int
        Number of results that may wait for ``step``. A newer result takes the place of the oldest one, which then
        counts as overtaken. In a lossless replay, ``accept`` gets all results.
    sends_on : str or None
        Topic of this stage's results, or None for the last stage of a pad. `Stages.is_complete` reads the topic.
    steady : callable
        Steady clock [s].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, accept: Callable[[Result], None],
                 settings: ReceiverSettings, *, check: Check[Message], parse: Callable[[Message, float], Result],
                 stages: Stages, step: Step | None = None, most_waiting: int = 1, sends_on: str | None = None,
                 steady: Callable[[], float] = time.monotonic):
        super().__init__(node, kind, topic, check=check, lossless=settings.lossless, steady=steady)
        self._accept = accept
        self._parse = parse
        self._stages = stages
        self._step = step
        self._most_waiting = math.inf if settings.lossless else most_waiting
        qos = settings.input_qos
        # Messages from the topic that wait for the chain. A full queue drops its oldest message, as DDS does.
        self._arrived: deque[Message] = deque(maxlen=qos.depth)
        self._waiting: deque[Any] = deque()  # usable results (NamedTuples) that wait for ``step``
        # messages of this process that may come back over the topic
        self._own: deque[FrameKey] = deque(maxlen=2 * qos.depth)
        self._is_fed = False
        self._has_ended = False
        self._listened = -math.inf  # time of the last check for other publishers, on the steady clock [s]
        self.sends_on = sends_on
        self._subscribe = partial(node.create_subscription, kind, topic, self._on_message, qos)
        self._subscription: Subscription | None = self._subscribe()
        stages.add(self)

    @property
    def health(self) -> StreamHealth:
        """Counts, age and stamp of the newest data, and the publishers of the topic."""
        self.count_publishers()
        self._listen()
        return super().health

    def feed(self, result: Any) -> None:
        """Receive a result from a stage of this process, on the chain thread.

        If the message of the result comes back over the topic, the chain takes it later and ignores it.
        """
        self._is_fed = True
        self._own.append(frame_key(result))
        self.attempt(self._look_for_others)
        if self.admit(result, is_result=True):
            self._wait_for_step(result)

    def end_feeding(self) -> None:
        """Record that the previous stage is gone, so that every publisher of the topic counts as another source."""
        self._is_fed = False
        self._own.clear()

    def postpone(self, step: Step, acquired: float, call: Callable[..., object], *args: object) -> None:
        """Run a call in a later step of the chain; see `Chain.postpone`. If the call fails, count a failure."""
        self._stages.chain.postpone(step, acquired, self.attempt, call, *args)

    def end(self) -> None:
        """Accept no further results, because the node is ending. Results that still wait on a busy chain are lost."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._arrived.clear()
        self._stages.remove(self)
        self._has_ended = True

    def _wait_for_step(self, result: Any) -> None:
        self._waiting.append(result)
        if self._step is None:
            self._process_next()
        elif len(self._waiting) > self._most_waiting:
            overtaken, following = self._waiting.popleft(), self._waiting.popleft()
            self._waiting.appendleft(following._replace(left_out=following.left_out + overtaken.left_out + 1))
            self.count_overtaken(1)
        else:
            self._stages.chain.postpone(self._step, result.acquired, self._process_next)

    def _process_next(self) -> None:
        if self._waiting and not self._has_ended:
            self.process(self._accept, self._waiting.popleft())

    def _on_message(self, message: Message) -> None:
        self._arrived.append(message)
        self._stages.chain.post(self._take_message)

    def _take_message(self) -> None:
        if not self._arrived:  # the queue was full, or the node is ending
            return
        message = self._arrived.popleft()
        self.count_publishers()
        if frame_key(message) not in self._own and self.admit(message):
            self.attempt(self._wait_for_result_of, message)

    def _wait_for_result_of(self, message: Message) -> None:
        self._wait_for_step(self._parse(message, self.acquired))

    def _look_for_others(self) -> None:
        """Let the executor subscribe to the topic if another node publishes it, and end the subscription otherwise."""
        now = self._steady()
        if now - self._listened < LISTENING_PERIOD:
            return
        self._listened = now
        self.count_publishers()
        executor = self._node.executor
        if executor is not None and self._has_others != (self._subscription is not None):
            executor.create_task(self._listen)

    @property
    def _has_others(self) -> bool:
        """True if another node publishes the topic, or if no stage of this process does."""
        return not self._is_fed or self.publishers > 1

    def _listen(self) -> None:
        if self._has_others and self._subscription is None:
            self._subscription = self._subscribe()
        elif not self._has_others and self._subscription is not None:
            subscription, self._subscription = self._subscription, None
            self._node.destroy_subscription(subscription)
