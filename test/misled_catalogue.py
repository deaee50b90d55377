"""Cases that try to mislead a consumer. Each case disturbs one thing while both pads hold an object.

The consumer looks only at the latest message. `python test/misled_catalogue.py` (`make misled`) runs every case. The
script prints each false claim that the consumer saw, how long the claim lasted, and how long it was allowed to last.
test_misled.py runs some of these cases and measures no times.
"""

import argparse
import sys
import threading
import time
from array import array
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rclpy
import yaml
from built_messages import BUILT, built_messages
from can_bench import TooSlowError
from gripper_bench import GripperBench, started_node
from misled_bench import (
    PERIOD,
    QOS,
    WITHDRAWN,
    Claim,
    FalseClaim,
    Finding,
    Record,
    World,
    current,
    empty,
    negated,
    stable,
)
from misled_skin import NODE_IDS, PADS, gripper_pads
from put_down_process import PlannerProcess
from sensor_msgs.msg import JointState
from virtual_gripper import START

from tactile_node.gripper.put_down_goal import FEEDBACK_LIMIT
from tactile_node.gripper.rules.closing import LOST_AFTER
from tactile_node.gripper.rules.put_down import BASELINE_TIME, LASTING, PutDownOutcome
from tactile_node.nodes.classifier_node import ClassifierNode
from tactile_node.nodes.processor_node import ProcessorNode
from tactile_skin.msg import Contact, ContactEvent, ContactMotion, ContactShape, GripperOutcome, TaxelArray
from tactile_skin.srv import Tare

FROZEN_AFTER = 0.5  # value of the driver's parameter frozen_after [s]
HELD_BACK = 5.0  # time for which a relay holds messages back [s]
SMALL = {'side': 5.0}  # side of an object that covers at most nine rows [taxels]
BURST = 10  # largest number of messages that a relay keeps
SETTLED = 0.3  # time after which all messages must be true again [s]
MINUTE = 60.0
# Time for which a movement is still reported after its end [s], which is a little shorter for a fast movement.
SLIDES_ON = 0.5
EMPTY, LEFT_EMPTY = FalseClaim('empty', empty), FalseClaim('empty', empty, topic='left')
NOT_EMPTY = FalseClaim('not empty', lambda record: record['contact'] != 'NO_CONTACT', SETTLED)
Case = Callable[..., list[Finding]]  # some of the functions also accept a period


def skin_freezes() -> list[Finding]:
    """The skin keeps sending its last values. The driver's parameter frozen_after is set."""
    with World(driver={'frozen_after': FROZEN_AFTER}) as world:
        world.hold()
        world.skin.set(is_frozen=True)
        since = time.monotonic()
        return world.watch(since, FROZEN_AFTER + 1.0, EMPTY,
                           FalseClaim('stable', stable, FROZEN_AFTER + PERIOD + WITHDRAWN))


def bus_fails() -> list[Finding]:
    """The CAN adapter is unplugged."""
    with World() as world:
        return unplugged(world)


def unplugged(world: World) -> list[Finding]:
    world.hold()
    world.skin.unplug()
    return _after(world, 1.0, WITHDRAWN + PERIOD)


def one_pad_loses_power() -> list[Finding]:
    """The right pad goes silent, and the left pad continues."""
    with World() as world:
        world.hold()
        world.skin.power_off(NODE_IDS[1])
        since = time.monotonic()
        return world.watch(since, 1.5, EMPTY, FalseClaim('stable', stable, WITHDRAWN + 2 * PERIOD))


def driver_ends() -> list[Finding]:
    """The driver is destroyed, and the other nodes continue."""
    with World() as world:
        world.hold()
        # The driver first stops the devices, and no other node of this process runs during that time.
        world.remove('driver')
        return _after(world, 1.0, WITHDRAWN + PERIOD)


def classifier_ends() -> list[Finding]:
    """One of the two classifiers stops without a message."""
    with World() as world:
        world.hold()
        since = time.monotonic()
        world.remove('classifier_right')
        return _after(world, 1.0, WITHDRAWN + PERIOD, since)


def nodes_start_while_held() -> list[Finding]:
    """The processor and the classifier of a pad restart while the object is held."""
    with World() as world:
        world.hold()
        since = time.monotonic()
        for name, kind in (('processor_left', ProcessorNode), ('classifier_left', ClassifierNode)):
            world.remove(name)
            world.add(name, kind, 'left', {})
        world.hold()
        return world.watch(since, 0.0, EMPTY, LEFT_EMPTY)


def rows_are_hidden() -> list[Finding]:
    """On the left pad, the TPDOs of the nine rows under the object are lost."""
    with World(SMALL) as world:
        return rows_lost(world)


def rows_lost(world: World) -> list[Finding]:
    world.hold()
    layout = gripper_pads()[0].layout
    lost = {layout.tpdos[2 * row + half].cob_id.of(NODE_IDS[0]) for row in range(3, 12) for half in (0, 1)}
    world.skin.lose(lost)
    since = time.monotonic()
    return world.watch(since, 1.5, EMPTY, LEFT_EMPTY, FalseClaim('stable', stable, WITHDRAWN + PERIOD),
                       FalseClaim('a force', _has_force, SETTLED, 'left'))


def a_part_is_hidden() -> list[Finding]:
    """The lower rows of the object are hidden.

    The visible part is shorter than the whole object, carries less force, and has a different centre.
    """
    with World() as world:
        world.hold()
        layout = gripper_pads()[0].layout
        world.skin.lose({tpdo.cob_id.of(NODE_IDS[0]) for tpdo in layout.tpdos[16:24]})  # the TPDOs of rows 8 to 11
        since = time.monotonic()
        return world.watch(since, 1.5, EMPTY, LEFT_EMPTY, FalseClaim('stable', stable, WITHDRAWN + PERIOD),
                           FalseClaim('a force', _has_force, SETTLED, 'left'),
                           FalseClaim('a size', _has_size, SETTLED, 'left'))


def taxels_saturate() -> list[Finding]:
    """The object presses with 2.5 times the pressure that the taxels can measure."""
    since = time.monotonic()
    with World({'pressure': 2.5}) as world:
        world.wait(lambda: world.latest('left').get('taxels'), 'a contact')
        time.sleep(1.0)
        return world.watch(since, 0.0, FalseClaim('a force', _has_force, topic='left'))


def object_creeps(period: float = PERIOD) -> list[Finding]:
    """The object slides at 0.5 mm/s from the beginning."""
    since = time.monotonic()
    with World({'speed': 0.5e-3}, period=period) as world:
        world.wait(lambda: world.latest('grasp').get('contact') == 'TWO_SIDED', 'contact')
        time.sleep(4.0)
        return world.watch(since, 0.0, FalseClaim('stable', stable))


def object_creeps_slowly() -> list[Finding]:
    """The object slides at 0.05 mm/s for a minute.

    A grasp stays stable up to ``max_creep``, which is ten times this speed. A message that reports the grasp as not
    stable is therefore false.
    """
    with World({'speed': 0.05e-3}) as world:
        world.hold()
        since = time.monotonic()
        return world.watch(since, MINUTE, FalseClaim('not stable', negated(stable), world.unstable * MINUTE))


def messages_held_back(link: str = 'shape') -> list[Finding]:
    """A relay holds back ten messages of each pad for 5 s, and then sends all ten at once."""
    with World(relayed=link) as world:
        world.hold()
        relays = world.relays
        since = time.monotonic()
        for relay in relays:
            relay.hold_back(BURST)
        world.wait(lambda: all(relay.is_full for relay in relays), 'ten messages')
        time.sleep(HELD_BACK)
        for relay in relays:
            relay.release()
        time.sleep(0.5)
        return world.watch(since, 0.0, FalseClaim('current', current, WITHDRAWN + PERIOD), EMPTY)


def malformed_messages() -> list[Finding]:
    """Another node sends default-constructed and contradictory messages for the left pad every 50 ms."""
    with World() as world:
        return malformed_sent(world)


def malformed_sent(world: World) -> list[Finding]:
    world.hold()
    peer = world.peer()
    publishers = [(peer.create_publisher(kind, f'left/{topic}', QOS), kind) for topic, kind in (
        ('taxels', TaxelArray), ('contact', Contact), ('shape', ContactShape))]
    since = time.monotonic()
    while time.monotonic() < since + 1.5:
        for publisher, kind in publishers:
            publisher.publish(kind())
        publishers[0][0].publish(TaxelArray(rows=4_000_000_000, cols=4_000_000_000, pitch=float('nan'), unit='psi'))
        publishers[0][0].publish(TaxelArray(rows=2, cols=2, pitch=0.004, unit='Pa', values=array('f', [0.0] * 4),
                                            status=array('B', [0] * 4)))
        time.sleep(0.05)
    return world.watch(since, 0.0, EMPTY, FalseClaim('not stable', negated(stable), (0.02 + world.unstable) * 1.5))


def tare_is_requested() -> list[Finding]:
    """A client requests a tare while the object is held, and tare_limit is above the pressure of the object."""
    with World(driver={'tare_limit': 1e6}) as world:
        world.hold()
        client = world.peer().create_client(Tare, 'skin_driver/tare')
        world.wait(client.service_is_ready, 'the service')
        since = time.monotonic()
        future = client.call_async(Tare.Request(frames=5))
        world.wait(future.done, 'an answer')
        time.sleep(0.5)
        success = future.result().success
        answered = Finding('tared', float(success), int(success), 0.0, 0.0, 0.0, future.result().message[:60],
                           has_ended=not success)
        return [*world.watch(since, 0.0, EMPTY), answered]


def taxels_are_dead() -> list[Finding]:
    """Eight scattered taxels (3 %) of each pad are dead.

    The chain must still report the grasp, and later the empty pads.
    """
    places = {pad: np.random.default_rng(number).permutation(256)[:8] for number, pad in enumerate(PADS)}
    with TemporaryDirectory() as folder:
        file = Path(folder) / 'faults.yaml'
        file.write_text(yaml.safe_dump({'pads': {pad: {'dead': [[int(k) // 16, int(k) % 16] for k in dead]}
                                                 for pad, dead in places.items()}}))
        with World(driver={'faulty_taxels_file': str(file)}) as world:
            world.hold()
            since = time.monotonic()
            held = world.watch(since, 3.0, EMPTY,
                               FalseClaim('not stable', negated(stable), (0.02 + world.unstable) * 3.0))
            world.skin.set(is_there=False)
            return [*held, *world.watch(time.monotonic(), 1.0, NOT_EMPTY)]


def object_is_taken_away() -> list[Finding]:
    """The object is removed, so both pads are empty.

    After a short time, a message that does not report both pads as empty is false.
    """
    with World() as world:
        world.hold()
        world.skin.set(is_there=False)
        return world.watch(time.monotonic(), 1.0, NOT_EMPTY, FalseClaim('stable', stable, WITHDRAWN))


def _after(world: World, seconds: float, bound: float, since: float | None = None) -> list[Finding]:
    """Watch an interrupted chain, which may report current results only for up to ``bound``.

    The interrupted chain must never report a pad as empty.
    """
    since = time.monotonic() if since is None else since
    return world.watch(since, seconds, EMPTY, FalseClaim('current', current, bound))


def _has_force(record: Record) -> bool:
    return record['force'] is not None and not record['force_is_bound']


def _has_size(record: Record) -> bool:
    return record['fit_valid'] and not record['size_is_bound']


def named(name: str, function: Callable[..., list[Finding]]) -> Case:
    function.__name__ = name  # type: ignore[attr-defined]
    return function


def one_pad_never_answers() -> list[Finding]:
    """The right pad has never sent a result."""
    with World(without=['classifier_right']) as world:
        since = time.monotonic()
        world.wait(lambda: world.latest('grasp'), 'a grasp')
        time.sleep(1.0)
        return world.watch(since, 0.0, EMPTY, FalseClaim('current', current))


def joint_states_end() -> list[Finding]:
    """The joint states stop, so that the node can no longer compute the opening.

    An old width must not be reported as the current width.
    """
    limit = 0.3
    with World(grasp={'gap_source': 'joint_states', 'gap_joints': ['finger'], 'max_gap_age': limit}) as world:
        controller = world.peer()
        publisher = controller.create_publisher(JointState, '/joint_states', QOS)
        world.hold(0.0)
        before = time.monotonic()
        while time.monotonic() < before + 1.0:
            message = JointState(name=['finger'], position=[0.04])
            # Every controller stamps its joint states with the present time.
            message.header.stamp = controller.get_clock().now().to_msg()
            publisher.publish(message)
            time.sleep(PERIOD)
        since = time.monotonic()
        assert any(record.get('width') for record in world.records), 'no width was published while the joint was known'
        return world.watch(since, 1.0, FalseClaim('a width', _has('width'), limit + PERIOD),
                           FalseClaim('a gap', _has('gap'), limit + PERIOD))


def opening_is_not_known() -> list[Finding]:
    """No source provides the gripper's opening.

    Without an opening, no width may be reported, in particular not the width of a closed gripper.
    """
    since = time.monotonic()
    with World() as world:
        world.hold()
        return world.watch(since, 0.0, FalseClaim('a width', _has('width')))


def _has(name: str) -> Claim:
    return lambda record: record[name] is not None


def event_of_a_stale_skin() -> list[Finding]:
    """The skin freezes, and the object is removed. A frozen skin must not report a movement or a lost contact."""
    with World(driver={'frozen_after': FROZEN_AFTER}) as world:
        world.hold()
        world.skin.set(is_frozen=True)
        world.skin.set(is_there=False)
        since = time.monotonic()
        return world.watch(since, FROZEN_AFTER + 1.0,
                           FalseClaim('what moves', lambda record: any(record['moving']),
                                      FROZEN_AFTER + PERIOD + WITHDRAWN),
                           FalseClaim('lost', lambda record: ContactEvent.LOST in record['last_events']))


def latched_event_is_no_present_one() -> list[Finding]:
    """The object slips once by 1.5 taxels.

    The field `moving` must stop reporting the slip well before the field `last_event` does.
    """
    with World() as world:
        world.hold()
        since = time.monotonic()
        world.skin.set(x=9.1)
        found = world.watch(since, 2.5, FalseClaim('sliding', _goes_across, SLIDES_ON + PERIOD))
        grasps = [record for record in world.records if record['topic'] == 'grasp']
        assert any(map(_goes_across, grasps)), 'no slip was reported'
        latest = world.latest('grasp')
        for event, age in zip(latest['last_events'], latest['event_ages']):
            assert event not in (ContactEvent.SLIDING, ContactEvent.SHIFTED) or age >= 1, latest
        return found


def _goes_across(record: Record) -> bool:
    return any(moving & (ContactMotion.SHIFTING | ContactMotion.SLIDING) for moving in record['moving'])


def _moves(name: str, spoil: Callable[[World], None], bound: float, begin: Callable[[World, GripperBench], None],
           held: dict, parameters: dict, **given: dict) -> Case:
    """Return a case in which ``spoil`` disturbs the data of the pads while the gripper node moves the gripper.

    The gripper must then stop, and a new goal to close must not move the gripper.
    """
    def case() -> list[Finding]:
        with World(held, **given) as world, ExitStack() as stack:
            world.wait(lambda: world.latest('grasp').get('fresh'), 'a grasp')
            rclpy.init()
            stack.callback(rclpy.try_shutdown)
            bench = GripperBench(stack, parameters={'max_age': MAX_AGE, 'fast_speed': 0.01, **parameters}, pads=None)
            _until_closing(world, bench, begin)
            since = time.monotonic()
            spoiler = threading.Thread(target=spoil, args=(world,))
            spoiler.start()
            bench.wait(bound + 1.0)
            spoiler.join()
            goes_on = max(0.0, bench.motor.moved_at - since)
            stall = sum(length for begun, length in world.stalls if since <= begun <= since + bound)
            found = Finding('closes', goes_on, len(bench.motor.commands), bound, PERIOD, stall,
                            ', '.join(each.message for each in bench.client.outcomes) or 'no outcome',
                            has_ended=not bench.motor.moves)
            bench.motor.commands.clear()
            since = time.monotonic()
            outcome = bench.close(position=0.0)[2]
            moved = max(0.0, bench.motor.moved_at - since)
            return [found, Finding('closes anew', moved, len(bench.motor.commands), 0.0, PERIOD, 0.0, outcome.message,
                                   has_ended=not bench.motor.moves)]
    return named(name, case)


def _until_closing(world: World, bench: GripperBench, begin: Callable[[World, GripperBench], None]) -> None:
    """Call ``begin`` until the gripper closes. On a busy machine, late frames may end a goal or a hold before that."""
    for _ in range(TRIES):
        bench.motor.move_to(START)
        begin(world, bench)
        bench.until(partial(_closes_or_has_ended, bench, len(bench.client.outcomes)),
                    'it does not close without a fault')
        if bench.motor.moves:
            return
    raise TooSlowError(f'the outcomes are {[each.message for each in bench.client.outcomes]}: is the machine too busy?')


def _closes_or_has_ended(bench: GripperBench, outcomes: int) -> bool:
    """Return True if the gripper closes, or if there are more than ``outcomes`` outcomes."""
    return bench.motor.moves and bench.motor.opening < START - 0.001 or len(bench.client.outcomes) > outcomes


def _closes(what: str, spoil: Callable[[World], None], bound: float, **given: dict) -> Case:
    """Return a case in which the gripper has a goal to close and the pads touch no object."""
    return _moves(f'gripper_closes_while_{what}', spoil, bound, lambda _, bench: bench.client.send(position=0.0),
                  {'is_there': False}, {}, **given)


def _presses(what: str, spoil: Callable[[World], None], bound: float, **given: dict) -> Case:
    """Return a case in which the held object yields, so that the gripper closes further until the fault stops it."""
    def begin(world: World, bench: GripperBench) -> None:
        world.skin.set(pressure=0.5)
        world.hold()
        world.wait(lambda: world.latest('left').get('force'), 'a force')
        # A goal that is clearly below the present force would end as ALREADY_PRESSED.
        goal = {'position': 0.0, 'effort': 0.99 * world.latest('left')['force']}
        ends = []
        while GripperOutcome.FORCE_REACHED not in ends:
            assert len(ends) < TRIES, f'the outcomes are {ends}: is the machine too busy?'
            ends.append(bench.outcome(**goal))
        world.skin.set(pressure=0.25)
    return _moves(f'gripper_presses_while_{what}', spoil, bound, begin, {},
                  {'hold': True, 'hold_travel': 0.05}, **given)


MAX_AGE = 0.15  # value of the gripper node's parameter max_age [s]
TRIES = 5
STOPPED = MAX_AGE + PERIOD + 0.03  # the sum allows for one more message and for the transport of a cancel request [s]
LOST_ROWS = [tpdo.cob_id.of(NODE_IDS[0]) for tpdo in gripper_pads()[0].layout.tpdos[6:24]]
CLOSING = (
    _closes('skin_freezes', lambda world: world.skin.set(is_frozen=True), FROZEN_AFTER + STOPPED,
            driver={'frozen_after': FROZEN_AFTER}),
    _closes('bus_fails', lambda world: world.skin.unplug(), STOPPED),
    _closes('one_pad_loses_power', lambda world: world.skin.power_off(NODE_IDS[1]), STOPPED),
    _closes('rows_are_hidden', lambda world: world.skin.lose(LOST_ROWS), STOPPED),
    _closes('driver_ends', lambda world: world.remove('driver'), STOPPED),
    _closes('classifier_ends', lambda world: world.remove('classifier_right'), STOPPED),
    _closes('grasp_node_ends', lambda world: world.remove('grasp'), STOPPED),
    _presses('skin_freezes', lambda world: world.skin.set(is_frozen=True), FROZEN_AFTER + STOPPED,
             driver={'frozen_after': FROZEN_AFTER}),
    _presses('bus_fails', lambda world: world.skin.unplug(), STOPPED),
    _presses('rows_are_hidden', lambda world: world.skin.lose(LOST_ROWS), STOPPED))


def _lowers(what: str, spoil: Callable[[World, ExitStack], object], bound: float, touches_for: float = 0.0,
            **given: dict) -> Case:
    """Return a case in which examples/put_down.py lowers the object in the air while ``spoil`` disturbs the data.

    If the planner took a disturbance for a table and opened the gripper, the object would fall. If the planner lowered
    the arm without data, the arm would press the object onto the table.

    Parameters
    ----------
    what : str
        Words for the disturbance.
    spoil : callable
        Function that disturbs the data.
    bound : float
        Time after which the arm must have stopped for good [s].
    touches_for : float
        Infinity if the node may report that something touches the object. The arm feels no contact, so the planner must
        not open the gripper nevertheless.
    """
    def case() -> list[Finding]:
        with World(period=SLOW_PERIOD, **given) as world, ExitStack() as stack:
            world.hold()
            rclpy.init()
            stack.callback(rclpy.try_shutdown)
            bench = GripperBench(stack, parameters={'max_age': MAX_AGE}, pads=None)
            planner = _lowering(bench, stack)
            since = time.monotonic()
            spoiler = threading.Thread(target=spoil, args=(world, stack))
            spoiler.start()
            bench.until(lambda: planner.has_ended)
            spoiler.join()
            ended = planner.events[-1][0].removeprefix('outcome_')
            seen = 'no result' if ended == 'gone' else PutDownOutcome(int(ended)).name
            touched = float(seen == PutDownOutcome.SOMETHING_TOUCHES.name)
            stall = sum(length for begun, length in world.stalls if since <= begun <= since + bound)
            return [Finding('lowers', planner.stopped_at() - since, 0, bound, SLOW_PERIOD, stall, seen, has_ended=True),
                    Finding('touches', touched, int(touched), touches_for, 0.0, 0.0, seen, has_ended=True),
                    Finding('opens', float(len(bench.motor.commands)), len(bench.motor.commands), 0.0, 0.0, 0.0, seen,
                            has_ended=not bench.motor.commands)]
    return named(f'arm_lowers_while_{what}', case)


def _lowering(bench: GripperBench, stack: ExitStack) -> PlannerProcess:
    """Return a planner that lowers an arm after its baseline. On a busy machine, late frames may end a goal."""
    for _ in range(TRIES):
        planner = stack.enter_context(PlannerProcess())
        bench.until(planner.moves_or_has_ended)
        bench.wait(BASELINE_TIME + 1.0)
        bench.until(planner.moves_or_has_ended)
        if planner.is_moving:
            return planner
    raise TooSlowError('the machine is too busy')


def _sent_late(world: World, stack: ExitStack) -> None:
    """Hold back the shapes of both pads, and send them after the next ones."""
    for relay in world.relays:
        relay.hold_back(BURST)
    world.wait(lambda: all(relay.is_full for relay in world.relays), 'ten messages')
    time.sleep(1.0)
    for relay in world.relays:
        relay.release()


# Time between two frames [s], so that the machine keeps up although it also runs a planner.
SLOW_PERIOD = 0.05
LOWERED = STOPPED + SLOW_PERIOD + FEEDBACK_LIMIT  # time after which an arm without data must have stopped [s]
JOINED = 10.0  # time for the start and the discovery of a second gripper node [s]
LOWERING = (
    _lowers('skin_freezes', lambda world, _: world.skin.set(is_frozen=True), FROZEN_AFTER + LOWERED,
            driver={'frozen_after': FROZEN_AFTER}),
    _lowers('bus_fails', lambda world, _: world.skin.unplug(), LOWERED),
    _lowers('one_pad_loses_power', lambda world, _: world.skin.power_off(NODE_IDS[1]), LOWERED),
    _lowers('rows_are_hidden', lambda world, _: world.skin.lose(LOST_ROWS), LOWERED),
    _lowers('driver_ends', lambda world, _: world.remove('driver'), LOWERED),
    _lowers('shapes_are_held_back', _sent_late, LOWERED, relayed='shape'),
    _lowers('object_is_lost', lambda world, _: world.skin.set(is_there=False), LOST_AFTER + LOWERED),
    _lowers('second_gripper_node_starts', lambda _, stack: stack.enter_context(started_node()), JOINED),
    # The pads cannot tell an object that slips from a table (docs/put_down.md).
    _lowers('object_slips', lambda world, _: world.skin.set(x=8.6), LASTING + LOWERED, touches_for=np.inf))


#: Cases that `make misled SHORT=1` runs.
SHORT: Sequence[Case] = (
    skin_freezes, bus_fails, rows_are_hidden, a_part_is_hidden, taxels_saturate, object_creeps, malformed_messages,
    tare_is_requested, event_of_a_stale_skin, latched_event_is_no_present_one)
LONG: Sequence[Case] = (
    one_pad_loses_power, driver_ends, classifier_ends, nodes_start_while_held,
    one_pad_never_answers, taxels_are_dead, joint_states_end, opening_is_not_known, object_is_taken_away,
    messages_held_back, *CLOSING, *LOWERING,
    *(named(f'{link}_held_back', partial(messages_held_back, link=link)) for link in ('contact', 'taxels')),
    object_creeps_slowly)
HEADER = ('case', 'false claim', 'misled [s]', 'messages', 'allowed [s]', 'latency [s]', 'stalled [s]',
          'the consumer sees')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', default='', help='run the cases whose name contains this')
    parser.add_argument('--short', action='store_true', help='leave out the long cases')
    parser.add_argument('--apart', action='store_true', help='run each node in a separate process')
    args = parser.parse_args()
    World.hands_over = not args.apart
    cases = [case for case in (*SHORT, *(() if args.short else LONG)) if args.only in case.__name__]
    print('| ' + ' | '.join(HEADER) + ' |\n|' + ' --- |' * len(HEADER))
    with built_messages('control_msgs', BUILT):
        wrong = sum(map(_run, cases))
    print(f'\n{wrong} claims lasted longer than allowed' if wrong else '\nNo consumer was misled.')
    return int(wrong > 0)


def _run(case: Case) -> int:
    """Run ``case``, print its findings, and return the number of claims that lasted too long."""
    findings = case()
    for finding in findings:
        times = (finding.bound, finding.latency, finding.stall)
        print(f'| {case.__name__.replace("_", " ")} | {finding.claim} | {finding.seconds:.2f} | '
              f'{finding.messages} | {" | ".join(f"{time:.2f}" for time in times)} | {finding.seen} |'
              + ('' if finding.holds else ' **misled**'), flush=True)
    return sum(not finding.holds for finding in findings)


if __name__ == '__main__':
    sys.exit(main())
