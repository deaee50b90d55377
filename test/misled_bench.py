"""A bench that tries to mislead subscribers.

The bench runs the whole chain, with the skin and the consumer as separate processes.

Both pads of a simulated gripper hold an object. A case disturbs the skin, the bus, the nodes or the messages, and names
the claims that are false from then on. The method `World.false` measures for how long the consumer's latest message
made such a false claim.
"""

import gc
import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import rclpy
from can_bench import TooSlowError, is_overloaded
from misled_skin import LAYOUT, NODE_IDS, PADS
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_node.nodes.spinner import SpinnerExecutor
from tactile_node.nodes.stage import STOP_TIMEOUT, Stages
from tactile_skin.msg import Contact, ContactShape, TaxelArray

PERIOD = 0.02  # time between two frames [s]
WITHDRAWN = max(0.1, 3 * PERIOD)  # time limit for withdrawing `fresh` from a grasp [s]
QOS = QoSProfile(depth=100)
PAUSE = 0.005  # pause of the thread that detects stalls [s]
MESSAGES = {'taxels': TaxelArray, 'contact': Contact, 'shape': ContactShape}
READERS = {'taxels': 'processor', 'contact': 'classifier', 'shape': 'grasp'}
TIMEOUT = 60.0  # time limit on a busy machine [s]
Record = dict[str, Any]  # one line that the consumer printed
Claim = Callable[[Record], bool]
Popen = Callable[..., subprocess.Popen]  # function that starts a process on this host or on another host
#: Starts the processes of nodes from a server that has imported the nodes, because an import takes seconds.
FORKS = get_context('forkserver')
FORKS.set_forkserver_preload([kind.__module__ for kind in (DriverNode, ProcessorNode, ClassifierNode, GraspNode)])


def empty(record: Record) -> bool:
    """Return True if the message reports one or both pads as empty."""
    return (record.get('contact') in ('NO_CONTACT', 'ONE_SIDED') or 'SIDE_EMPTY' in record.get('sides', ())
            or record.get('shape') == 'NONE' or 'NONE' in record.get('shapes', ()))


def current(record: Record) -> bool:
    """Return True if the message claims to be current."""
    return bool(record.get('fresh') or record.get('stable'))


def stable(record: Record) -> bool:
    return bool(record.get('stable'))


def negated(claim: Claim) -> Claim:
    return lambda record: not claim(record)


class SkinProcess:
    """The skin simulated by misled_skin.py on the serial port ``link``."""

    def __init__(self, link: str, attributes: dict[str, Any], popen: Popen = subprocess.Popen):
        path = Path(__file__).with_name('misled_skin.py')
        self._process = popen([sys.executable, str(path), link, json.dumps(attributes)], text=True,
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._process.stdout.readline() == 'ready\n'

    def set(self, **attributes: Any) -> None:
        """Change attributes of the held object, which are those of `misled_skin.Object`."""
        self._send(set=attributes)

    def lose(self, can_ids: Iterable[int]) -> None:
        self._send(lose=list(can_ids))

    def power_off(self, node_id: int) -> None:
        self._send(power_off=node_id)

    def unplug(self) -> None:
        """Unplug the adapter."""
        self._send(unplug=True)

    def _send(self, **command: Any) -> None:
        self._process.stdin.write(json.dumps(command) + '\n')
        self._process.stdin.flush()
        assert self._process.stdout.readline() == 'done\n'

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


class FalseClaim(NamedTuple):
    """A claim that is false from a certain time on."""

    name: str
    is_made: Claim       #: function that returns True if a message makes the claim
    bound: float = 0.0   #: time for which messages may still make the claim [s], or 0 if no message may make it
    topic: str = 'grasp'


class Finding(NamedTuple):
    """The result for one false claim in one case."""

    claim: str       #: name of the false claim
    seconds: float   #: time for which the latest message made the claim [s]
    messages: int    #: number of messages that made the claim
    bound: float     #: allowed time [s]
    latency: float   #: transport time before the fault; old data still arrives for this long after the fault [s]
    stall: float     #: time for which the machine itself stood still [s]
    seen: str        #: states that the consumer saw
    has_ended: bool  #: True if the latest message no longer makes the claim

    @property
    def holds(self) -> bool:
        return self.seconds <= self.bound + (self.latency + self.stall if self.bound else 0.0)


class Relay:
    """A relay between two topics.

    While the relay holds messages back, it keeps the first messages and drops all later ones.
    """

    def __init__(self, node: Any, kind: type, topic: str, relayed: str):
        self._publisher = node.create_publisher(kind, relayed, QOS)
        self._subscription = node.create_subscription(kind, topic, self._pass, QOS)
        # Largest number of messages that the relay keeps, or None while it passes messages on.
        self._room: int | None = None
        self._kept: list[Any] = []

    @property
    def is_full(self) -> bool:
        return len(self._kept) == self._room

    def hold_back(self, messages: int) -> None:
        self._room = messages

    def release(self) -> None:
        for message in self._kept:
            self._publisher.publish(message)

    def _pass(self, message: Any) -> None:
        if self._room is None:
            self._publisher.publish(message)
        elif len(self._kept) < self._room:
            self._kept.append(message)


class Watch:
    """The lines that consumers have printed, and the false claims found in these lines."""

    def __init__(self) -> None:
        self.latency = 0.0  #: longest time from acquisition to the consumer before the fault [s]
        self.unstable = 0.0  #: fraction of the time before the fault without a stable grasp
        self.records: list[Record] = []
        self.stalls: list[tuple[float, float]] = []  #: start and duration of each stall of this process [s]
        self._stop = threading.Event()

    def tick(self) -> None:
        """Record each stall, during which this process had no processor or one thread held the interpreter lock."""
        before = time.monotonic()
        while not self._stop.wait(PAUSE):
            now = time.monotonic()
            if now - before > 2 * PAUSE:
                self.stalls.append((before, now - before - PAUSE))
            before = now

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> None:
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                raise self.failure(f'waited {timeout:.0f} s for {what}; last: {self.records[-3:]}')
            time.sleep(0.005)

    @staticmethod
    def failure(text: str) -> Exception:
        """Return the error for a wait that timed out. On an overloaded machine, the returned error skips the test."""
        return TooSlowError(text) if is_overloaded() else AssertionError(text)

    def latest(self, topic: str) -> Record:
        return next((record for record in reversed(self.records) if record['topic'] == topic), {})

    def hold(self, seconds: float = 1.0) -> None:
        """Wait until the consumer sees a stable grasp, then measure the undisturbed chain for ``seconds``."""
        self.wait(lambda: self.latest('grasp').get('stable'), 'a stable grasp')
        began = time.monotonic()
        time.sleep(seconds)
        held = [record for record in list(self.records) if record['topic'] == 'left' and record['time'] > began]
        self.latency = max((record['latency'] for record in held), default=0.0)
        self.unstable = self.false(FalseClaim('not stable', negated(stable)), began).seconds / max(seconds, 1e-9)

    def watch(self, since: float, seconds: float, *claims: FalseClaim) -> list[Finding]:
        """Watch for ``seconds`` after ``since`` [s, monotonic], and then until the claims with a bound have ended."""
        end = since + seconds
        time.sleep(max(0.0, end - time.monotonic()))
        while True:
            # Only the latest messages are read here, because reading all would hold up the nodes of this process.
            while any(claim.bound and claim.is_made(self.latest(claim.topic)) for claim in claims) \
                    and time.monotonic() < end + TIMEOUT:
                time.sleep(PERIOD)
            findings = [self.false(claim, since) for claim in claims]
            if all(finding.has_ended or not finding.bound for finding in findings) or time.monotonic() > end + TIMEOUT:
                return findings

    def false(self, claim: FalseClaim, since: float) -> Finding:
        """Return for how long after ``since`` [s, monotonic] the latest message made ``claim``."""
        until = time.monotonic()
        records = [record for record in list(self.records)
                   if record['topic'] == claim.topic and record['time'] <= until]
        assert records, f'no message on {claim.topic}'
        ends = [record['time'] for record in records[1:]] + [until]
        claimed = [(max(record['time'], since), end, record['time'] > since)
                   for record, end in zip(records, ends) if end > since and claim.is_made(record)]
        last = max((end for _, end, _ in claimed), default=since)
        stall = sum(length for begin, length in list(self.stalls) if since <= begin + length and begin <= last)
        return Finding(claim.name, sum(end - begin for begin, end, _ in claimed), sum(sent for _, _, sent in claimed),
                       claim.bound, self.latency, stall, self._seen(claim.topic, since, until),
                       not claim.is_made(records[-1]))

    def _seen(self, topic: str, since: float, until: float) -> str:
        """Return the states that the consumer saw, in order."""
        seen: list[str] = []
        for record in list(self.records):
            if record['topic'] == topic and since < record['time'] <= until:
                state = _state(record)
                if not seen or seen[-1] != state:
                    seen.append(state)
        return ' > '.join(seen[:4] + ['...'] * (len(seen) > 4)) or 'nothing'


class World(Watch):
    """The processing chain of a gripper.

    A case may leave out nodes, or set the parameters of the node with a given role.

    The bench records stalls of this process only. Without ``hands_over``, it does not see a stall of a node.

    ``period`` is the time between two frames [s]. The allowed times are based on PERIOD. A longer ``period`` lets a
    busy machine keep up.
    """

    #: True if all nodes run in this process and pass results by function calls. False if each node runs in a separate
    #: process and the results pass as messages.
    hands_over = True

    def __init__(self, held: dict[str, Any] | None = None, *, without: Sequence[str] = (),
                 topics: Sequence[str] = ('grasp=grasp', 'left=left/shape'), relayed: str = '', period: float = PERIOD,
                 **parameters: dict[str, Any]):
        super().__init__()
        self._held = held or {}
        self.nodes: dict[str, Any] = {}
        self._processes: dict[str, BaseProcess] = {}  # processes of the nodes that run outside this process
        self._topics = topics
        self._relayed = relayed
        self._without = without
        self.period = period
        self.relays: list[Relay] = []
        self._parameters = parameters
        self._stages: Stages | None = None
        self._stack = ExitStack()

    def __enter__(self) -> 'World':
        self._stack = self._started()
        return self

    def __exit__(self, *problem: object) -> None:
        self._stack.close()

    def _started(self) -> ExitStack:
        stack = ExitStack()
        try:
            self._start(stack)
        except BaseException:
            stack.close()
            raise
        return stack

    def _start(self, stack: ExitStack) -> None:
        # Without a collection, each earlier world keeps its participant of the middleware, with eight threads. If there
        # are too many participants, the middleware does not discover a new process.
        gc.unfreeze()
        gc.collect()
        self.context = Context()
        rclpy.init(context=self.context)
        stack.callback(self.context.try_shutdown)
        self._consume(stack, self._topics, self.records)
        self._port = str(Path(stack.enter_context(TemporaryDirectory())) / 'skin')
        self.skin = SkinProcess(self._port, self._held)
        stack.callback(self.skin.end)
        self.executor = SpinnerExecutor(context=self.context)
        if self.hands_over:
            self._stages = Stages()
            stack.callback(self._stages.chain.stop, STOP_TIMEOUT)
        self._make_nodes()
        stack.callback(self._destroy_nodes)
        spinner = threading.Thread(target=self._spin, daemon=True)
        spinner.start()
        ticker = threading.Thread(target=self.tick, daemon=True)
        ticker.start()
        stack.callback(ticker.join)
        stack.callback(spinner.join)
        stack.callback(self._stop.set)
        if 'driver' in self.nodes:
            self.nodes['driver'].autostart()
        # Our processes also freeze the garbage collector, because a full collection takes as long as an allowed
        # silence.
        gc.freeze()

    def _make_nodes(self) -> None:
        driver = {'interface': 'slcan', 'channel': self._port, 'pads': list(PADS), 'node_ids': list(NODE_IDS),
                  'layouts': [LAYOUT], 'sync_period': self.period}
        kinds = [('driver', DriverNode, '', driver),
                 *((f'{role}_{pad}', kind, pad, {}) for pad in PADS
                   for role, kind in (('processor', ProcessorNode), ('classifier', ClassifierNode))),
                 ('grasp', GraspNode, '', {'left_pad': 'left', 'right_pad': 'right'})]
        for name, kind, namespace, given in kinds:
            if name not in self._without:
                self.add(name, kind, namespace, given | self._parameters.get(name, {}))

        if self._relayed:
            peer = self.peer()
            self.relays = [Relay(peer, MESSAGES[self._relayed], f'{pad}/{self._relayed}', f'{pad}/relayed')
                           for pad in PADS]

    def peer(self) -> Any:
        """Create and return a node that does not belong to the chain."""
        node = rclpy.create_node('peer', context=self.context)
        self.nodes['peer'] = node
        self.executor.add_node(node)
        return node

    def add(self, name: str, kind: type, namespace: str, parameters: dict[str, Any]) -> None:
        if not self.hands_over:
            self._start_process(name, kind, namespace, parameters)
            return
        node = kind(self._stages, context=self.context, namespace=namespace, cli_args=self._remappings(name),
                    parameter_overrides=[Parameter(key, value=value) for key, value in parameters.items()])
        self.nodes[name] = node
        self.executor.add_node(node)

    def _start_process(self, name: str, kind: type, namespace: str, parameters: dict[str, Any]) -> None:
        """Start the executable of a node."""
        given = [f'{key}:={json.dumps(value)}' for key, value in parameters.items()]
        words = [*self._remappings(name), '--ros-args', '-r', f'__ns:=/{namespace}',
                 *(word for each in given for word in ('-p', each))]
        self._processes[name] = FORKS.Process(target=_run_executable, args=(kind, words), name=name, daemon=True)
        self._processes[name].start()

    def _remappings(self, name: str) -> list[str]:
        """Return the command-line arguments that make the subscriber of a relayed topic subscribe to the relay."""
        if not self._relayed or name.split('_')[0] != READERS[self._relayed]:
            return []
        rules = [f'{pad}/shape:={pad}/relayed' for pad in PADS] if name == 'grasp' else [f'{self._relayed}:=relayed']
        return ['--ros-args', *(word for rule in rules for word in ('-r', rule))]

    def remove(self, name: str) -> None:
        """Destroy a node without any message, as a crash would.

        The executor's thread destroys a node of this process, because this thread may be using the node.
        """
        if name in self._processes:
            process = self._processes.pop(name)
            assert process.is_alive(), f'{name} has ended with {process.exitcode}'
            process.kill()
            process.join()
            return
        node = self.nodes.pop(name)
        done = threading.Event()

        def end() -> None:
            self.executor.remove_node(node)
            node.destroy_node()
            done.set()
        self.executor.create_task(end)
        self.wait(done.is_set, f'{name} to end')

    def _destroy_nodes(self) -> None:
        ended = {name: process.exitcode for name, process in self._processes.items() if not process.is_alive()}
        for process in self._processes.values():
            process.kill()
            process.join()
        self.executor.shutdown()
        # The driver feeds the other nodes, so it is destroyed first.
        for name in sorted(self.nodes, key='driver'.__ne__):
            self.nodes[name].destroy_node()
        self.nodes.clear()
        assert not ended, f'nodes have ended with these exit codes: {ended}'

    def _spin(self) -> None:
        while not self._stop.is_set():
            self.executor.spin_once(timeout_sec=0.1)

    def _consume(self, stack: ExitStack, topics: Sequence[str], records: list[Record],
                 popen: Popen = subprocess.Popen) -> subprocess.Popen:
        """Start a consumer of ``topics`` whose output is added to ``records``."""
        path = Path(__file__).with_name('misled_consumer.py')
        consumer = popen([sys.executable, str(path), *topics], stdout=subprocess.PIPE, text=True)

        def read() -> None:
            for line in consumer.stdout:
                records.append(json.loads(line))
        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        stack.callback(reader.join)
        stack.callback(consumer.wait)
        stack.callback(consumer.kill)
        self.wait(lambda: records, 'the consumer to start')
        return consumer


def _state(record: Record) -> str:
    if record['topic'] == 'grasp':
        words = [record['contact'], *(word for word in ('fresh', 'stable') if record[word])]
    else:
        words = [record['shape'], *([record['reason']] if record['shape'] == 'UNKNOWN' else [])]
    return ' '.join(words).lower()


def _run_executable(kind: type, words: Sequence[str]) -> None:
    """Run the executable of a node with the arguments ``words``."""
    sys.argv = ['node', *words]
    sys.modules[kind.__module__].main()
