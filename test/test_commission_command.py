"""`tactile commission` on a gripper whose action, joint states and taxels a test serves."""

import io
import json
import os
import pty
import select
import signal
import threading
from array import array
from importlib.util import find_spec

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from launch_stand_in import processes_of, put_stand_ins
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from sensor_msgs.msg import JointState
from simulated_person import PADS, ROOT, SLOW, Process, commission
from waiting import until, wait_until

from tactile_node.cli.commission import Terminal, _plan
from tactile_node.cli.main import _parser, main
from tactile_node.commissioning.commissioned_gripper import Act, Question
from tactile_node.commissioning.commissioning_record import CommissioningRecord
from tactile_node.commissioning.force import map_effort
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.movement import StopTrial
from tactile_node.commissioning.recording import PadGrid
from tactile_node.errors import ConfigurationError
from tactile_node.gripper.ros_gripper import RosGripper
from tactile_node.nodes.spinner import spinning
from tactile_skin.msg import TaxelArray

LAUNCH_FILE = ROOT / 'launch' / 'bringup.launch.py'
LIMIT = 60.0  #: Time limit on a busy machine [s].
FIRST = ('--joint', 'finger', '--unit', 'm', '--limits', '0', '0.08', '--most-effort', '40')


class Hand:
    """Publishes joint states and the taxels of two pads, and serves a gripper's action, on another thread.

    A goal ends only if it is cancelled, as if foam kept the joint from its goal. A newer goal does not end it, because
    the request to cancel the older goal may arrive after the newer goal.
    """

    def __init__(self, ros, action, name='hand'):
        import rclpy
        self.position, self.goals, self.cancels, self.order = 0.05, [], 0, []
        self.is_accepting, self.sends_states = True, True
        self.values = [250.0] * 16
        self._target, self._sequence = self.position, 0
        self._action = action
        self._stopping = threading.Event()
        self.node = rclpy.create_node(name, start_parameter_services=False)
        group = ReentrantCallbackGroup()
        self._server = ActionServer(
            self.node, action, '/hand/gripper_cmd', self._execute, callback_group=group,
            goal_callback=lambda goal: GoalResponse.ACCEPT if self.is_accepting else GoalResponse.REJECT,
            handle_accepted_callback=self._accept, cancel_callback=self._cancel)
        self._states = self.node.create_publisher(JointState, '/joint_states', 10)
        self._taxels = [self.node.create_publisher(TaxelArray, f'/{pad}/taxels', 10) for pad in ('left', 'right')]
        self.node.create_timer(0.02, self._tick, callback_group=group)
        self._executor = MultiThreadedExecutor(8)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()
        ros.callback(self._stop)

    def _stop(self):
        self._stopping.set()
        self._executor.shutdown()
        self._thread.join()
        self._server.destroy()
        self.node.destroy_node()

    def _accept(self, handle):
        command = handle.request.command
        self.goals.append((command.position[0], command.velocity[0], command.effort[0]))
        self._target = command.position[0]
        self.order.append('goal')
        handle.execute()

    def _cancel(self, handle):
        self.cancels += 1
        self.order.append('cancel')
        self._target = self.position
        return CancelResponse.ACCEPT

    def _execute(self, handle):
        while not handle.is_cancel_requested and not self._stopping.wait(0.01):
            pass
        (handle.canceled if handle.is_cancel_requested else handle.abort)()
        return self._action.Result()

    def _tick(self):
        self.position += max(-2e-4, min(2e-4, self._target - self.position))
        stamp = self.node.get_clock().now().to_msg()
        if self.sends_states:
            state = JointState(name=['finger'], position=[self.position])
            state.header.stamp = stamp
            self._states.publish(state)
        self._sequence += 1
        for publisher in self._taxels:
            frame = TaxelArray(sequence=self._sequence, rows=4, cols=4, pitch=0.002, unit='Pa',
                               values=array('f', self.values), status=array('B', [TaxelArray.VALID] * 16))
            frame.header.stamp = stamp
            publisher.publish(frame)


@pytest.fixture
def parallel(control_msgs):
    from control_msgs.action import ParallelGripperCommand
    return ParallelGripperCommand


def adapter(ros, action='/hand/gripper_cmd'):
    """Return a RosGripper whose node spins on another thread."""
    import rclpy
    node = rclpy.create_node('commission', start_parameter_services=False)
    ros.callback(node.destroy_node)
    found = RosGripper(node, action=action, joint='finger', joint_states='/joint_states', pads=('left', 'right'))
    ros.callback(found.destroy)
    ros.enter_context(spinning([node]))
    return found


@pytest.fixture
def gripper(ros, parallel):
    """A connected RosGripper, and the hand that it commands."""
    hand, found = Hand(ros, parallel), adapter(ros)
    assert found.connect(LIMIT)[:2] == (4, 4)
    return found, hand


# ---- the adapter ----

@pytest.mark.ros
@pytest.mark.bus
def test_the_gripper_moves_stops_in_both_ways_and_sees_other_clients(ros, gripper, parallel):
    import rclpy
    found, hand = gripper
    recording = found.advance(0.5)
    assert all(len(pad.times) > 5 for pad in recording.pads) and len(recording.joint.times) > 5
    np.testing.assert_allclose(recording.pads[0].forces, 250.0 * 0.002 ** 2, rtol=1e-5)  # Pa to N
    assert np.all(np.diff(recording.joint.times) > 0)
    assert recording.joint.positions[-1] == pytest.approx(0.05)

    diagnostics = hand.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    hand.values = [250.0, 0.0, 0.0, 0.0] * 4
    until(lambda: diagnostics.get_subscription_count())
    diagnostics.publish(DiagnosticArray(status=[
        DiagnosticStatus(name='/hand: left', values=[KeyValue(key='mirrored', value='True'),
                                                     KeyValue(key='serial_number', value='17')]),
        DiagnosticStatus(name='/other: right', values=[KeyValue(key='mirrored', value='True')])]))
    until(lambda: found.serial_numbers() == ('17', ''))
    found.advance(0.3)
    left, right = found.advance(0.3).pads
    assert np.all(left.forces[:, :, 3] > 0) and np.all(right.forces[:, :, 0] > 0)  # as the device counts its columns

    found.command(0.03, 5.0, 0.01)
    until(lambda: hand.goals)
    assert hand.goals == [(0.03, 0.01, 5.0)]
    until(lambda: found.advance(0.1).joint.positions[-1] < 0.049)
    assert found.others() == ''  # its own goal is live

    found.cancel()
    found.command(hand.position, 5.0, 0.01)
    assert found.settle()
    # the server may answer the first request to cancel after the goal; no live goal is left for the next program
    assert sorted(hand.order) == ['cancel', 'cancel', 'goal', 'goal'] and hand.order[-1] == 'cancel'
    assert hand.goals[1][0] == pytest.approx(hand.position, abs=1e-3)

    planner = ActionClient(hand.node, parallel, '/hand/gripper_cmd')
    ros.callback(planner.destroy)
    goal = parallel.Goal()
    goal.command.position, goal.command.velocity, goal.command.effort = [0.06], [0.01], [5.0]
    planner.send_goal_async(goal)
    until(lambda: '1 live goals' in found.others())
    found.cancel()
    until(lambda: found.others() == '')

    other = rclpy.create_node('other', start_parameter_services=False)  # no executor uses it while it is destroyed
    second = ActionServer(other, parallel, '/hand/gripper_cmd', lambda handle: None)
    until(lambda: '2 servers' in found.others())
    second.destroy()
    other.destroy_node()
    until(lambda: found.others() == '')

    hand.is_accepting = False
    found.command(0.02, 5.0, 0.01)
    assert found.settle()
    with pytest.raises(RefusedStepError) as refused:
        found.advance(0.1)
    assert refused.value.mistake is Mistake.COMMAND_REJECTED

    hand.sends_states = False
    found.advance(0.3)
    assert not len(found.advance(0.2).joint.times)  # a position is not repeated


@pytest.mark.ros
@pytest.mark.bus
def test_a_goal_whose_state_is_not_known_is_cancelled_at_the_end(gripper):
    """On a busy machine, the status of the last goal may arrive too late."""
    found, hand = gripper
    found._node.destroy_subscription(found._status)
    found.command(0.05, 5.0, 0.01)
    until(lambda: hand.goals)
    assert found.settle() and hand.order == ['goal', 'cancel']


@pytest.mark.ros
@pytest.mark.bus
def test_a_driver_that_does_not_say_whether_it_mirrors_a_pad_is_named(ros, parallel):
    Hand(ros, parallel, 'skin_driver')
    found = adapter(ros)

    def missing():
        with pytest.raises(ConfigurationError) as refused:
            found.connect(0.0)
        return str(refused.value)
    until(lambda: 'the state of the driver' in missing())


@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.usefixtures('control_msgs')
def test_a_missing_action_is_named(ros):
    found = adapter(ros, action='/none')
    with pytest.raises(ConfigurationError, match='/none'):
        found.connect(0.0)


# ---- the command ----

class Session(Process):
    """A process of `tactile commission`, whose questions the test answers."""

    def __init__(self, ros, *words):
        super().__init__('-m', 'tactile_node.cli.main', 'commission', *words)
        ros.callback(self.end)

    def answer(self, text, line=''):
        """Wait until the process prints ``text`` and its prompt, and type a line.

        The process discards what is typed before the prompt.
        """
        self.until([text])
        self.until(['] '], self.text.index(text))
        self.text = ''
        self.type(line)

    def until(self, texts, start=0):
        assert wait_until(lambda: any(text in self.text[start:] for text in texts), LIMIT), self.text


def first_movement(ros, folder, hand):
    """Return a session in its first movement.

    If a busy machine delays the frames of the pads or the joint states, a session asks to repeat a part. The test then
    ends the session, and the next session continues its record.
    """
    repeat = 'to repeat this part'
    while True:
        session = Session(ros, '--output', str(folder), '--action', '/hand/gripper_cmd')
        session.answer('emergency stop in your reach', 'yes')
        session.until(('Take everything out', repeat))
        if repeat not in session.text:
            session.answer('Take everything out')
            session.until(('Start?', repeat))
        if repeat not in session.text:
            session.answer('Start?', 'y')
            until(lambda: hand.goals)
            return session
        session.end()


@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.parametrize('number', [signal.SIGINT, pytest.param(signal.SIGHUP, marks=pytest.mark.long),
                                    pytest.param(signal.SIGTSTP, marks=pytest.mark.long)])
def test_an_interruption_stops_the_gripper_in_both_ways(ros, parallel, tmp_path, number):
    hand = Hand(ros, parallel)
    record = ready_record(tmp_path)
    session = first_movement(ros, tmp_path, hand)
    session.process.send_signal(number)
    assert session.process.wait(LIMIT) == 130, session.text
    assert hand.order.count('cancel') == 2 and hand.order[-1] == 'cancel'  # no live goal is left
    assert hand.goals[-1][0] == pytest.approx(hand.position, abs=1e-3)
    assert abs(hand.goals[0][0] - 0.05) <= 0.02 * 0.08 + 1e-9  # the first movement
    assert record.read_text().count('"first movement"') == 0


@pytest.mark.ros
@pytest.mark.bus
def test_the_command_refuses_while_another_client_has_a_live_goal(ros, parallel, tmp_path):
    hand = Hand(ros, parallel)
    planner = ActionClient(hand.node, parallel, '/hand/gripper_cmd')
    ros.callback(planner.destroy)
    until(planner.server_is_ready)
    goal = parallel.Goal()
    goal.command.position, goal.command.velocity, goal.command.effort = [0.05], [0.01], [5.0]
    planner.send_goal_async(goal)
    until(lambda: hand.goals)
    session = Session(ros, '--output', str(tmp_path), '--action', '/hand/gripper_cmd', *FIRST)
    assert session.process.wait(LIMIT) == 1
    assert 'another client' in session.text
    assert len(hand.goals) == 1 and not hand.cancels


@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.long
@pytest.mark.skipif(find_spec('mujoco') is None, reason='pip install -r requirements/bench_physics.txt')
@pytest.mark.usefixtures('ros', 'control_msgs')
@pytest.mark.parametrize(('truth', 'delay'), [('as built', 0.04), ('swapped', 0.1), ('mirrored', 0.02)])
def test_a_person_commissions_a_simulated_gripper(tmp_path, monkeypatch, truth, delay):
    """The truth comes from the model: each pad presses with the effort, and a command takes effect after ``delay``.

    The driver gets its arguments from the launch file. In the last case, the driver then gets the measured parameters,
    and a check finds no change.
    """
    put_stand_ins(monkeypatch)
    pads = 'right,left' if truth == 'swapped' else 'left,right'
    layouts = {'layouts': f'{mirrored_layout(tmp_path)},sim16x16.yaml', 'eds': 'sim16x16.eds'} if truth == 'mirrored' \
        else {}

    def driver(parameters):
        (tmp_path / 'driver.yaml').write_text(SLOW + parameters)
        return processes_of(LAUNCH_FILE, pads=pads, node_ids='32,64', params_file=str(tmp_path / 'driver.yaml'),
                            **layouts)[0]['arguments']
    code, text = commission(tmp_path, '--rest-time', '15', '--hold-time', '5', '--stop-trials', '3', '--skip',
                            'block,step,weight', driver=driver(''), delay=delay)
    assert code == 0, text
    steps = json.loads((tmp_path / 'record.json').read_text())['steps']
    report = json.loads((tmp_path / 'report.json').read_text())
    assert steps.keys() == {'plan', 'rest', 'pads', 'first movement', 'stops', 'foam'}
    assert steps['pads']['order'] == [truth == 'swapped', truth != 'swapped']
    assert steps['pads']['mountings'] == [[0, truth == 'mirrored'], [2, False]]
    assert steps['rest']['serial_numbers'] == (['64', '32'] if truth == 'swapped' else ['32', '64'])
    assert steps['first movement']['opens_rising'] is True
    trials = [StopTrial(*each) for way in steps['stops']['trials'].values() for each in way]
    assert len(trials) == 9 and all(trial.is_stopped for trial in trials)
    found = {each['name']: each['value'] for each in report['measurements']}
    assert found['time from a command to the movement'] >= delay
    found = map_effort(steps['foam']['efforts'], steps['foam']['forces'])
    assert found.slope.value == pytest.approx(1.0, abs=0.1)
    assert {'gap_offset, gap_scale', 'shift_per_load', 'gripper_step'} <= report['absent'].keys()
    parameters = yaml.safe_load((tmp_path / 'parameters.yaml').read_text())
    assert set(parameters) == {'/**/touch_gripper', *['/**/skin_driver'] * (truth == 'mirrored')}
    if truth == 'mirrored':
        assert parameters['/**/skin_driver'] == {'ros__parameters': {'mirrored_pads': ['left']}}
        measured = driver('        mirrored_pads: [left]\n')
        code, text = commission(tmp_path, '--check', driver=measured, delay=delay)
        assert code == 0, text


@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.long
@pytest.mark.skipif(find_spec('mujoco') is None, reason='pip install -r requirements/bench_physics.txt')
@pytest.mark.usefixtures('ros', 'control_msgs')
def test_a_person_measures_the_skin_of_a_simulated_gripper(tmp_path):
    """The driver then gets the response, and the commissioning goes on."""
    options = ('--disc', '0.0125', '--shapes', 'circle,unknown', '--rest-time', '10', '--stop-trials', '3', '--skip',
               'foam,step,weight')
    code, text = commission(tmp_path, *options)
    assert code == 2 and 'expected the response of the skin' in text, text
    steps = json.loads((tmp_path / 'record.json').read_text())['steps']
    assert steps.keys() == {'plan', 'response', 'assessment'}
    assert '8 touches' in steps['response']['text'] and 'unknown' in steps['assessment']['text']
    parameters = yaml.safe_load((tmp_path / 'parameters.yaml').read_text())
    assert parameters['/**/skin_driver']['ros__parameters'] == {'response_files': [steps['response']['file']]}
    measured = *PADS, str(tmp_path / 'parameters.yaml'), '--params-file', str(tmp_path / 'slow.yaml')
    _, text = commission(tmp_path, *options, driver=measured)
    assert 'rest' in json.loads((tmp_path / 'record.json').read_text())['steps'], text


def mirrored_layout(folder):
    """Write the layout of the simulated skin with the columns in the other direction, and return its file."""
    text = (ROOT / 'config' / 'sim16x16.yaml').read_text()
    for here, there in (('first: [0, 0], step: [0, 1]', 'first: [0, 15], step: [0, -1]'),
                        ('step: [0, 8]', 'step: [0, -8]')):
        assert here in text
        text = text.replace(here, there)
    path = folder / 'mirrored.yaml'
    path.write_text(text)
    return path


def ready_record(folder):
    """Write a record in which rest and pads are finished, and return its file."""
    from dataclasses import asdict

    from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
    path = folder / 'record.json'
    record = CommissioningRecord(path)
    plan = CommissioningPlan(PadGrid(4, 4, float(np.float32(0.002))), 'finger', 'm', 0.0, 0.08, 40.0,
                             (GaugeBlock(0.01, 0.02),), 5.0)
    record.save('plan', asdict(plan))
    rest = {'noise': (1e-4, 1e-6), 'drift': (0.0, 1e-9), 'rate': 50.0, 'lost': 0.0, 'zero': [[0.001] * 4] * 4}
    record.save('rest', {'pads': [rest, rest], 'age': 0.01})
    record.save('pads', {'order': [0, 1], 'mountings': [(0, False)] * 2, 'taxels': [[[1] * 4] * 4] * 2})
    return path


def test_a_pipe_cannot_answer(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('sys.stdin', io.StringIO('yes\n'))
    assert main(['commission', '--output', str(tmp_path), *FIRST]) == 2
    assert 'expected a terminal' in capsys.readouterr().err


class Typed(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(('words', 'named'), [
    ((), '--joint'), ((*FIRST, '--pads', 'left'), '--pads'), ((*FIRST, '--skip', 'rest'), '--skip'),
    ((*FIRST, '--jig', '0,0'), '--jig'), ((*FIRST, '--check'), 'Commission the gripper first'),
    ((*FIRST, '--blocks', '0.01'), '--blocks')])
def test_a_wrong_option_is_named_before_anything_is_connected(tmp_path, capsys, monkeypatch, words, named):
    monkeypatch.setattr('sys.stdin', Typed())
    assert main(['commission', '--output', str(tmp_path), *words]) == 2
    assert named in capsys.readouterr().err


def test_another_gripper_needs_another_record(tmp_path, capsys, monkeypatch):
    ready_record(tmp_path)
    monkeypatch.setattr('sys.stdin', Typed())
    assert main(['commission', '--output', str(tmp_path), '--most-effort', '50']) == 2
    assert 'expected 40' in capsys.readouterr().err


def test_a_later_run_may_state_another_place_of_the_jig(tmp_path):
    path, grid = ready_record(tmp_path), PadGrid(4, 4, float(np.float32(0.002)))

    def jig(*words):
        args = _parser('commission').parse_args(['commission', '--output', str(tmp_path), *words])
        return _plan(args, CommissioningRecord(path), grid).jig
    assert jig() == ()
    assert jig('--jig', '0,0,0.1') == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    assert jig('--jig=-0.002,0.001,0.1,0,0,1.5') == jig() == (-0.002, 0.001, 0.1, 0.0, 0.0, 1.5)


def test_an_answer_that_was_typed_before_the_question_is_no_consent():
    ours, theirs = pty.openpty()
    with open(theirs, encoding='utf-8') as answers:
        os.write(ours, b'yes\n')
        until(lambda: select.select([answers], [], [], 0)[0])
        later = threading.Timer(0.3, os.write, (ours, b'no\n'))
        later.start()
        asked = Question(Act.CONSENT, 'Start?', ('yes', 'no'))
        assert Terminal(answers, io.StringIO()).ask(asked) == 'no'
        later.join()
    os.close(ours)


def test_the_person_types_a_choice_or_its_beginning():
    texts = io.StringIO()
    person = Terminal(io.StringIO('maybe\n\nopened\nc\n\nx\n\n'), texts)
    moved = Question(Act.DIRECTION, 'How have the fingers moved?', ('opened', 'closed', 'not moved'))
    assert person.ask(moved) == 'opened'
    assert person.ask(moved) == 'closed'
    done = Question(Act.CLEAR, 'Take everything out.')
    assert [person.ask(done), person.ask(done)] == ['done', 'done']
    with pytest.raises(KeyboardInterrupt):
        person.ask(done)
    assert texts.getvalue().count('How have the fingers moved?') == 2
