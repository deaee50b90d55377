"""Within one process, nodes pass their results to each other by function calls.

The published results must equal those of nodes that exchange messages.
"""

import importlib
import os
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from hidden_skin import NODE_ID, write_log
from rclpy.parameter import Parameter
from ros_bench import RosBench, VirtualTime
from sensor_msgs.msg import Image
from waiting import until

from examples.demo.topics import frame_topics
from tactile_node.chain import Step
from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import bus_nodes
from tactile_node.nodes import guarded_input
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.driver_node import DriverNode
from tactile_node.nodes.processor_node import MOST_WAITING, ProcessorNode
from tactile_node.nodes.spinner import Spinner, spinning
from tactile_node.nodes.stage import StageInput, Stages
from tactile_node.nodes.system import System
from tactile_node.pose.pipeline import Taxels
from tactile_node.ros.contact_messages import PadFrame, pad_frame_of, taxel_array_message
from tactile_node.ros.message_age import age_seconds
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.settings import ReceiverSettings
from tactile_node.skin.taxel_array import RejectReason
from tactile_node.taxel_frame import SkinSide, TaxelFrame, TaxelStatus
from tactile_skin.msg import Contact, ContactEvent, ContactShape, ContactShapes, Grasp, GraspSides, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('ros')]

TIMEOUT, PERIOD = 60.0, 0.02
REPLAYED = 10_000 if os.environ.get('TACTILE_LONG') else 200
PRESS = np.zeros((16, 16), np.uint8)
PRESS[4:11, 5:12] = 120


class Process:
    """Runs the nodes of two pads in one process, and a subscriber in another context.

    The test supplies the taxel frames.
    """

    def __init__(self, stack_nodes=(), **every):
        self.system = System(bus_nodes(['left', 'right'], driver={'autostart': False}, every=every)[:-1])
        self.chain = self.system._stages.chain
        self.nodes = {node.get_fully_qualified_name(): node for node in self.system.nodes}
        self.peer = rclpy.create_node('peer')
        self.outputs = {}
        self.sequence = 0

    def __enter__(self):
        self._spinning = spinning((*self.system.nodes, self.peer))
        self._spinning.__enter__()
        return self

    def __exit__(self, *error):
        self._spinning.__exit__(None, None, None)
        self.system.destroy()
        self.peer.destroy_node()

    def input(self, name):
        """Return the input stage of the node with this name."""
        node = self.nodes[name]
        return node._taxels if name.endswith('processor') else node._contacts

    def send(self, pads=('left', 'right'), **drawn):
        """Pass a frame of each pad to the processors on the chain thread, as the driver does."""
        self.sequence += 1
        for pad in pads:
            self.chain.post(self.input(f'/{pad}/processor').feed, pad_frame(self.sequence, **drawn))

    def send_until(self, condition, **sent):
        """Send frames at intervals of PERIOD until ``condition()`` is true."""
        def is_met():
            self.send(**sent)
            time.sleep(PERIOD)
            return condition()
        until(is_met)


def pad_frame(sequence, press=True, up=0, saturated=False, acquired=None, clock=0.0):
    """Return a frame of a pad whose finger ends at the first row, by default acquired now.

    ``up`` is the number of rows by which the contact is moved towards that end. With ``saturated``, all pressed taxels
    are at the end of their range. ``clock`` is the time by which the wall clock of the driver has been set [s].
    """
    values = 50e3 * (np.roll(PRESS, -up, 0) > 0) * press + np.random.default_rng(sequence).normal(0, 200, PRESS.shape)
    status = np.where(saturated & (values > 25e3), TaxelStatus.SATURATED, TaxelStatus.VALID).astype(np.uint8)
    frame = TaxelFrame(1.7e9 + clock + PERIOD * sequence, sequence, values, status, 0,
                       acquired=time.monotonic() if acquired is None else acquired)
    return PadFrame.of(frame, Taxels(0.004, 'Pa', finger_ends=SkinSide.FIRST_ROW), 'pad')


def heard_by(node, kind, topic):
    heard = []
    node.create_subscription(kind, topic, heard.append, frames_qos(500))
    return heard


def blocked(chain):
    """Block the chain until the returned event is set, so that everything sent until then waits."""
    go = threading.Event()
    chain.post(go.wait, TIMEOUT)
    return go


def facts(message):
    """Return all fields of the message except its age."""
    return {name: str(getattr(message, name)) for name in message.get_fields_and_field_types() if name != 'age'}


def test_function_calls_and_messages_give_the_same_results():
    """One chain of nodes receives the frames through function calls, and a second chain receives them as messages.

    Both chains must report bitwise equal shapes.
    """
    def drawn(number):
        return {'press': number > 5, 'up': 4 * (number > 15), 'saturated': number > 20}
    with Process() as process:
        shapes, contacts = (heard_by(process.peer, kind, f'/left/{topic}')
                            for kind, topic in ((ContactShape, 'shape'), (Contact, 'contact')))
        until(lambda: all(process.peer.count_publishers(f'/left/{topic}') and any(
            publisher.topic_name == f'/left/{topic}' and publisher.get_subscription_count() > 0
            for node in process.system.nodes for publisher in node.publishers) for topic in ('shape', 'contact')))
        for number in range(1, 24):
            process.send(['left'], **drawn(number))
            until(lambda number=number: len(shapes) == number == len(contacts))
    nodes = [ProcessorNode(namespace='/left'), ClassifierNode(namespace='/left')]
    peer = rclpy.create_node('peer')
    by_message = heard_by(peer, ContactShape, '/left/shape')
    publisher = peer.create_publisher(TaxelArray, '/left/taxels', frames_qos(10))
    with spinning((*nodes, peer)):
        until(lambda: publisher.get_subscription_count() and peer.count_subscribers('/left/contact')
              and nodes[1]._shapes.is_wanted)
        time.sleep(0.5)  # The processor's publisher and the classifier need time to discover each other.
        for number in range(1, 24):
            publisher.publish(taxel_array_message(pad_frame(number, **drawn(number))))
            until(lambda number=number: len(by_message) == number)
    for node in (*nodes, peer):
        node.destroy_node()
    assert [facts(shape) for shape in shapes] == [facts(shape) for shape in by_message]
    assert {shape.class_name for shape in shapes if not shape.at_edge} == {'none', 'square'}
    assert [(shape.at_edge, shape.force_is_bound, shape.pad_force_is_bound) for shape in shapes] == (
        15 * [(False, False, False)] + 5 * [(True, False, False)] + 3 * [(True, True, True)])


def test_each_of_two_frames_that_wait_together_has_its_own_age():
    """A late chain finds two frames of a pad. The older frame must not get the age of the newer one."""
    with Process() as process:
        contacts = heard_by(process.peer, Contact, '/left/contact')
        taxels = process.input('/left/processor')
        process.send_until(lambda: len(contacts) > 0, pads=['left'])
        go, sent, apart = blocked(process.chain), process.sequence, 1000.0
        for number, before in ((1, apart), (2, 0.0)):
            process.chain.post(taxels.feed, pad_frame(sent + number, acquired=time.monotonic() - before))
        go.set()
        until(lambda: contacts[-1].sequence == sent + 2)
    first, second = (age_seconds(message.age) for message in contacts[-2:])
    assert contacts[-2].sequence == sent + 1 and first >= apart > second


def test_nothing_is_published_between_nodes_that_share_a_process():
    with Process() as process:
        grasps = heard_by(process.peer, GraspSides, '/grasp_sides')
        processors = [process.input(f'/{pad}/processor') for pad in ('left', 'right')]
        # Each frame waits for the previous one, so that a busy machine drops none.
        for number in range(1, 31):
            process.send()
            until(lambda number=number: all(stage.counts.processed == number for stage in processors))
        until(lambda: process.input('/right/classifier').counts.processed)
        for pad in ('left', 'right'):
            stages = [process.input(f'/{pad}/{role}') for role in ('processor', 'classifier')]
            assert all(stage._subscription is None for stage in stages)
            until(lambda stages=stages: sum((stages[1].counts.processed, stages[1].counts.overtaken)) == 30)
            assert stages[0].counts == (30, 30, {}, 0, 0), 'the processor must see every frame'
            assert not stages[1].counts.dropped and not stages[1].counts.skipped
        assert grasps and {side.class_name for side in grasps[-1].sides} == {'square'}
        assert max(side.age.sec + side.age.nanosec * 1e-9 for side in grasps[-1].sides) < 1.0
        # The lengths of the bounding box are computed when they are read, also for `grasp_sides`.
        for side in grasps[-1].sides:
            assert list(side.box_lengths) == pytest.approx([7 * 0.004, 7 * 0.004], abs=0.004)


@pytest.mark.parametrize('step', [3600.0, -3600.0])
def test_a_clock_that_is_set_costs_no_frame_between_nodes_of_one_process(step):
    with Process() as process:
        inputs = [process.input(f'/left/{role}') for role in ('processor', 'classifier')]
        inputs.append(process.nodes['/grasp']._shapes['left'])
        for clock in (0.0, step):
            for _ in range(10):
                process.send(['left'], clock=clock)
                assert process.chain.wait_until_idle(TIMEOUT)
        assert [stage.counts for stage in inputs] == 3 * [(20, 20, {}, 0, 0)]


def test_gaps_in_function_calls_do_not_read_the_message_types_again(ros, monkeypatch):
    """With drop_incomplete on a lossy bus, most results may follow a gap. Reading the types takes 0.14 ms."""
    reads, results, clock, bench = [], [], VirtualTime(), RosBench(ros)
    monkeypatch.setattr(guarded_input, 'publishers_of_other_type',
                        lambda node, topic: reads.append(clock.now()) or ())
    stages, reader = Stages(), bench.add('reader')
    ros.callback(stages.chain.stop, TIMEOUT)
    stage = StageInput(reader, TaxelArray, 'taxels', results.append, ReceiverSettings(), check=check_taxel_array,
                       parse=pad_frame_of, stages=stages, steady=clock.now)

    def feed(numbers):
        for number in numbers:
            clock.advance(3 * PERIOD)
            stage.feed(pad_frame(3 * number, acquired=clock.now()))
    for publishers in (1, 2):
        reader.create_publisher(TaxelArray, 'taxels', 1)
        bench.until(lambda count=publishers: reader.count_publishers('taxels') == count)
        feed(range(20 * publishers, 20 * publishers + 20))
        assert len(reads) == publishers  # once for each change of the number of publishers
    assert len(results) == 40 and stage.counts.skipped == 2 * 39


def test_an_exception_of_a_stage_is_counted_and_the_other_stages_continue(monkeypatch):
    with Process() as process:
        failing, good = process.input('/left/classifier'), process.input('/right/classifier')

        def fail(contact):
            raise ValueError('a stage that raises')
        monkeypatch.setattr(failing, '_accept', fail)
        for _ in range(10):
            process.send()
            time.sleep(PERIOD)
        assert process.chain.wait_until_idle(TIMEOUT)
        # A busy machine may leave out frames in these stages, or earlier in the processors.
        before = [process.input(f'/{pad}/processor').counts.overtaken for pad in ('left', 'right')]
        assert failing.counts.dropped[RejectReason.PROCESSING_FAILED] + failing.counts.overtaken + before[0] == 10
        assert good.counts.processed + good.counts.overtaken + before[1] == 10
        assert good.counts.processed > 0 and not good.counts.dropped and failing.counts.processed == 0


def test_a_blocked_stage_costs_frames_and_each_is_counted(monkeypatch):
    """The processor keeps only the two newest frames, and the classifier only the newest contact."""
    with Process() as process:
        stage, taxels = process.input('/left/classifier'), process.input('/left/processor')
        accept, begun, go = stage._accept, threading.Event(), threading.Event()

        def block(contact):
            begun.set()
            assert go.wait(TIMEOUT)
            accept(contact)
        monkeypatch.setattr(stage, '_accept', block)
        process.send()
        assert begun.wait(TIMEOUT)
        monkeypatch.setattr(stage, '_accept', accept)
        for _ in range(40):
            process.send()
        go.set()
        assert process.chain.wait_until_idle(TIMEOUT)
        assert taxels.counts == (41, 3, {}, 0, 38)
        assert stage.counts == (3, 2, {}, 0, 1), 'a frame that was left out on purpose is not missing'


def test_a_stage_takes_the_newest_waiting_message_and_counts_the_others():
    """If a slow stage took the oldest message first, the stage would lag by the whole queue for ever."""
    node, peer = ProcessorNode(namespace='/left'), rclpy.create_node('peer')
    publisher = peer.create_publisher(TaxelArray, '/left/taxels', frames_qos(10))
    until(lambda: publisher.get_subscription_count() > 0)
    with spinning([node]):
        go = blocked(node._stages.chain)
        for number in range(1, 11):
            publisher.publish(taxel_array_message(pad_frame(number)))
        until(lambda: len(node._taxels._arrived) == 10)
        go.set()
        assert node._stages.chain.wait_until_idle(TIMEOUT)
    assert node._taxels.counts == (10, MOST_WAITING, {}, 0, 10 - MOST_WAITING)
    for each in (node, peer):
        each.destroy_node()


def test_the_older_contact_of_two_waiting_pads_is_processed_first():
    """If the newer contact came first, the next contact of the other pad would be processed in between.

    No grasp would then have both pads of one SYNC.
    """
    answered = []
    with Process() as process:
        for pad in ('left', 'right'):
            process.input(f'/{pad}/classifier')._accept = (
                lambda each, pad=pad: answered.append((pad, each.sequence)))
        go = blocked(process.chain)
        for pad, sequence in (('left', 2), ('right', 1)):
            process.chain.post(process.input(f'/{pad}/processor').feed, pad_frame(sequence, acquired=PERIOD * sequence))
        go.set()
        assert process.chain.wait_until_idle(TIMEOUT)
    assert answered == [('right', 1), ('left', 2)]


def test_messages_for_viewers_follow_the_shapes_of_both_pads():
    """Computing images and features takes as long as computing a shape, and a planner waits for the shape.

    The times of the pads differ a little, because the driver reads the clocks separately for each pad.
    """
    made = []
    with Process() as process:
        go = blocked(process.chain)
        for pad, acquired in (('left', PERIOD), ('right', PERIOD + 3e-6)):
            process.input(f'/{pad}/classifier')._accept = lambda each, pad=pad: made.append(f'shape of {pad}')
            process.nodes[f'/{pad}/processor']._views = SimpleNamespace(
                is_wanted=True, publish=lambda contact, pad=pad: made.append(f'images of {pad}'))
            process.chain.post(process.input(f'/{pad}/processor').feed, pad_frame(1, acquired=acquired))
        go.set()
        assert process.chain.wait_until_idle(TIMEOUT)
    assert made == ['shape of left', 'shape of right', 'images of left', 'images of right']


def test_a_chain_that_hangs_does_not_keep_the_grasp_fresh():
    """The silence is noticed on another thread, so a planner is told even if no stage runs any more."""
    with Process() as process:
        grasps = heard_by(process.peer, Grasp, '/grasp')
        process.send_until(lambda: grasps and grasps[-1].fresh)
        go = blocked(process.chain)
        until(lambda: not grasps[-1].fresh)
        assert grasps[-1].contact == Grasp.UNSEEN
        go.set()


def test_a_stage_postpones_only_messages_with_a_subscriber(monkeypatch):
    """Without subscribers, 50 frames per second would each create a task and a closure that nobody needs."""
    postponed = []
    monkeypatch.setattr(StageInput, 'postpone',
                        lambda stage, step, *call: step is Step.SHOW and postponed.append(stage.topic))
    with Process() as process:
        stages = [process.input(name) for name in ('/left/processor', '/left/classifier')]
        process.send_until(lambda: all(each.counts.processed > 5 for each in stages))
        assert not postponed
        for topic, kind in (('/left/image', Image), ('/left/shapes', ContactShapes)):
            process.peer.create_subscription(kind, topic, lambda message: None, frames_qos(10))
        process.send_until(lambda: len(set(postponed)) == 2)
    assert set(postponed) == {each.topic for each in stages}


def test_a_shape_that_cannot_be_published_is_counted_and_costs_no_event(monkeypatch):
    """No later frame reports the event again that a contact was made."""
    with Process() as process:
        events, node = heard_by(process.peer, ContactEvent, '/left/events'), process.nodes['/left/classifier']
        until(lambda: process.peer.count_publishers('/left/events') and node._events.get_subscription_count())

        stage = process.input('/left/classifier')
        process.send_until(lambda: stage.counts.processed > 2, press=False)

        def fail(*_):
            raise ValueError('no room')
        monkeypatch.setattr(node._shapes, 'send', fail)
        process.send_until(lambda: ContactEvent.MADE in [each.kind for each in events])
        assert stage.counts.dropped[RejectReason.PROCESSING_FAILED]


def test_images_that_cannot_be_made_are_counted_and_cost_no_shape():
    with Process() as process:
        def fail(_):
            raise ValueError('no colours')
        process.nodes['/left/processor']._views = SimpleNamespace(is_wanted=True, publish=fail)
        process.send_until(lambda: process.input('/left/classifier').counts.processed > 5)
        until(lambda: process.input('/left/processor').counts.dropped[RejectReason.PROCESSING_FAILED] > 5)


def test_neither_a_foreign_node_in_the_middle_of_the_chain_nor_our_own_is_used(monkeypatch):
    with Process() as process:
        stage = process.input('/left/classifier')
        process.send_until(lambda: stage.counts.processed > 5)
        contacts = heard_by(process.peer, Contact, '/left/contact')
        outsider = rclpy.create_node('outsider')
        publisher = outsider.create_publisher(Contact, '/left/contact', frames_qos(10))
        process.send_until(lambda: publisher.get_subscription_count() > 1)
        process.send_until(lambda: len(contacts) > 5)
        assert not stage.counts.dropped, 'our own messages come back and are no second source'
        foreign = contacts[-1]
        foreign.sequence += 1_000_000
        malformed = Contact(sequence=7, rows=3, cols=3)
        before = stage.counts.processed

        def are_both_dropped():
            foreign.sequence += 1
            publisher.publish(foreign)
            publisher.publish(malformed)
            process.send()
            time.sleep(PERIOD)
            return stage.counts.dropped.get(RejectReason.OTHER_SOURCE, 0) > 30
        until(are_both_dropped)
        assert stage.counts.processed < before + 15
        assert stage.counts.dropped[RejectReason.WRONG_LENGTH] > 10
        outsider.destroy_node()
        before = stage.counts.processed
        process.send_until(lambda: stage.counts.processed > before + 10)
        process.send_until(lambda: stage._subscription is None)


def test_a_bag_that_records_everything_changes_no_count():
    """Every message is published for the bag.

    The stages still pass results by function calls, and receive none of the published messages.
    """
    with Process() as process:
        topics = {name: kind for name, kind in frame_topics(['left', 'right']).items() if not name.endswith('taxels')}
        heard = {name: heard_by(process.peer, getattr(importlib.import_module(f'{package}.msg'), kind), name)
                 for name, (package, _, kind) in ((name, kind.split('/')) for name, kind in topics.items())}
        process.send_until(lambda: all(heard.values()))
        for pad in ('left', 'right'):
            taxels, contacts = (process.input(f'/{pad}/{role}') for role in ('processor', 'classifier'))
            assert process.chain.wait_until_idle(TIMEOUT)
            assert taxels.counts.received == taxels.counts.processed + taxels.counts.overtaken == process.sequence
            assert contacts.counts.received == contacts.counts.processed + contacts.counts.overtaken
            assert contacts.counts.received == taxels.counts.processed
            assert not contacts.counts.skipped and contacts._subscription is None


def test_a_spinner_that_waits_stops_at_once(monkeypatch):
    """If the end came only with the timeout of the wait, every command would end up to a second late."""
    monkeypatch.setattr('tactile_node.nodes.spinner.EVENTS_PERIOD', 2 * TIMEOUT)
    node, called = rclpy.create_node('idle'), threading.Event()
    idle = Spinner([node])
    node.executor.create_task(called.set)
    assert called.wait(TIMEOUT)
    stopping = threading.Thread(target=idle.stop)
    stopping.start()
    stopping.join(TIMEOUT)
    assert not stopping.is_alive()
    node.destroy_node()


def replaying(path, **more):
    parameters = {'replay': str(path), 'replay_pace': 0.0, 'node_ids': [NODE_ID], **more}
    return System(bus_nodes(['pad'], driver=parameters, every={'lossless': True}, classifier={'fit': False}))


def test_a_replay_as_fast_as_possible_processes_every_frame(tmp_path):
    write_log(tmp_path / 'long.log', [PRESS * (number // 50 % 2) for number in range(REPLAYED)])
    system, listener, shapes = replaying(tmp_path / 'long.log'), rclpy.create_node('listener'), []
    listener.create_subscription(ContactShape, '/pad/shape', lambda message: shapes.append(message.sequence),
                                 frames_qos(50, lossless=True))
    with spinning((*system.nodes, listener)):
        system.autostart(threading.Event())
        assert system.source.finished.wait(max(TIMEOUT, REPLAYED / 20))
        assert system.recognised == REPLAYED, 'at the end of the log, every frame must have been processed'
        until(lambda: len(shapes) == REPLAYED)
        system.driver.trigger_deactivate()
    system.destroy()
    listener.destroy_node()
    assert shapes == list(range(REPLAYED))


def test_a_replay_that_waits_can_be_deactivated_at_once(tmp_path, monkeypatch):
    write_log(tmp_path / 'long.log', [PRESS] * 50)
    system, begun, go = replaying(tmp_path / 'long.log'), threading.Event(), threading.Event()
    stage = next(node for node in system.nodes if node.get_name() == 'classifier')._contacts

    def block(contact):
        begun.set()
        go.wait(TIMEOUT)
    monkeypatch.setattr(stage, '_accept', block)
    with spinning(system.nodes):
        system.autostart(threading.Event())
        assert begun.wait(TIMEOUT)
        begin = time.monotonic()
        system.driver.trigger_deactivate()
        assert time.monotonic() - begin < TIMEOUT / 2  # a blocked stage would hold it up for TIMEOUT
        go.set()
    system.destroy()


def test_a_stage_that_is_destroyed_ends_no_other_and_another_takes_its_place():
    with Process() as process:
        left, right = (process.input(f'/{pad}/classifier') for pad in ('left', 'right'))
        process.send_until(lambda: left.counts.processed > 5)
        processor, gone = process.nodes['/left/processor'], threading.Event()
        executor = processor.executor
        executor.create_task(lambda: (executor.remove_node(processor), processor.destroy_node(), gone.set()))
        assert gone.wait(TIMEOUT)
        before = right.counts.processed
        process.send_until(lambda: right.counts.processed > before + 5)
        other, before = ProcessorNode(namespace='/left'), left.counts.processed
        executor.add_node(other)
        frames = process.peer.create_publisher(TaxelArray, '/left/taxels', frames_qos(10))

        def is_used():
            frames.publish(taxel_array_message(pad_frame(process.sequence)))
            return left.counts.processed > before + 5
        process.send_until(is_used)
        executor.remove_node(other)
        other.destroy_node()


def test_a_node_that_is_destroyed_while_the_chain_is_busy_publishes_nothing(monkeypatch):
    """The end of a node waits only a limited time for the chain, so results may still wait for the node."""
    monkeypatch.setattr('tactile_node.nodes.stage.STOP_TIMEOUT', 0.01)
    with Process() as process:
        ended, are_fed = process.input('/left/processor'), threading.Event()
        first = blocked(process.chain)  # so that the following calls run in one turn, before the frames are processed
        process.send()
        process.chain.post(are_fed.set)
        second = blocked(process.chain)
        first.set()
        assert are_fed.wait(TIMEOUT)
        process.nodes['/left/processor'].destroy_node()
        second.set()
        assert process.chain.wait_until_idle(TIMEOUT)
        assert (ended.counts.received, ended.counts.processed, ended.counts.dropped) == (1, 0, {})


def test_a_driver_that_is_configured_again_plays_again(tmp_path):
    write_log(tmp_path / 'short.log', [PRESS] * 20)
    system = replaying(tmp_path / 'short.log')
    with spinning(system.nodes):
        system.autostart(threading.Event())
        assert system.source.finished.wait(TIMEOUT)
        for step in ('deactivate', 'cleanup', 'configure', 'activate'):
            getattr(system.driver, f'trigger_{step}')()
        assert system.source.finished.wait(TIMEOUT)
        assert system.recognised == 40
    system.destroy()


def test_a_lossless_replay_over_several_processes_is_refused_with_the_remedy(tmp_path):
    write_log(tmp_path / 'long.log', [PRESS] * 5)
    given = {'replay': str(tmp_path / 'long.log'), 'pads': ['pad'], 'node_ids': [NODE_ID], 'lossless': True}
    driver = DriverNode(parameter_overrides=[Parameter(name, value=value) for name, value in given.items()])
    with pytest.raises(ConfigurationError, match='tactile bringup --replay'):
        driver.autostart()
    driver.destroy_node()
