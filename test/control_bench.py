"""The rules of the gripper controller with a virtual gripper and pads, without ROS.

Messages arrive in the step in which they are sent, and in their order.
"""

from collections import deque
from dataclasses import dataclass, replace

from virtual_gripper import AGE, STEP, THRESHOLD, Motor, Pads

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import ForceReading, TouchReading
from tactile_node.gripper.rules.commands import GripperResult
from tactile_node.gripper.rules.control import TouchControl, Wish
from tactile_node.gripper.rules.touch_settings import TouchSettings

TIMEOUT = 120.0  #: Virtual time within which each condition must become true [s].
CANCEL_STEPS = 20  #: Number of steps between two repetitions of an unanswered cancel request.


class Action:
    """The gripper's own action between the rules and the motor."""

    def __init__(self, bench):
        self._bench = bench
        self.is_there = True
        self.known = []  #: goals that the server knows
        self._unread = deque()  # requests that a silent server has not read

    def send(self, opening, speed, command, commands):
        goal = SentToMotor(self, self._bench.motor, opening, speed, command, commands)
        self.request(goal.arrive)
        return goal

    def request(self, read):
        if self.is_there:
            self._unread.append(read)

    def answer(self, respond, *args, **flags):
        self._bench.post(lambda: respond(*args, **flags))

    def work(self):
        """Read the requests, and return True if there were any."""
        if self._bench.motor.is_silent or not self._unread:
            return False
        self._unread.popleft()()
        return True

    def forget(self):
        """Forget all goals and requests."""
        self.known.clear()
        self._unread.clear()


class ActionMotor(Motor):
    """A motor behind an `Action`, with the faults of its server."""

    def __init__(self, bench, action):
        super().__init__(lambda: bench.now)
        self._action = action

    def fall_silent(self, goes_on=False):
        self.is_silent, self.goes_on = True, goes_on

    def wake(self):
        """Respond to all requests that arrived while the server was silent."""
        self.is_silent = False

    def restart(self):
        """Replace the server with a server that knows no goal. The hardware continues the last command."""
        self._action.forget()
        self.is_silent, self._goal = False, None

    def die(self):
        """End the server for ever."""
        self._action.forget()
        self._action.is_there = False


class SentToMotor:
    """A goal that the rules have sent to the motor."""

    def __init__(self, action, motor, opening, speed, command, commands):
        self._action, self._motor, self._command, self._commands = action, motor, command, commands
        self.opening, self.speed = opening, speed
        self.is_cancel_requested = self.has_ended = False
        self._requests, self._is_answered = 0, True

    def arrive(self):
        if not self._motor.is_accepting:
            self._action.answer(self._commands.on_rejected, self._command)
            return
        self._action.known.append(self)
        self._action.answer(self._commands.on_accepted, self._command)
        self._motor.accept(self)

    def cancel(self):
        self._requests, self._is_answered = self._requests + 1, False
        self.repeat_cancel()

    def repeat_cancel(self):
        if not self._is_answered:
            number = self._requests
            self._action.request(lambda: self._cancel(number))

    def _cancel(self, number):
        is_unknown = self not in self._action.known
        is_gone = is_unknown or self.has_ended
        if not (is_gone or self._motor.stays):
            self.is_cancel_requested = True

        def respond():
            if number == self._requests and not self._is_answered:
                self._is_answered = True
                self._commands.on_cancelled(self._command, is_ending=is_gone or self.is_cancel_requested,
                                            is_unknown=is_unknown)
        self._action.answer(respond)

    def publish(self, opening):
        self._action.answer(self._commands.on_feedback, opening)

    def end(self, status, *, reached_goal=False, stalled=False):
        self.has_ended = True
        self._action.answer(self._commands.on_result, self._command,
                            GripperResult(reached_goal, stalled, status == 'succeed'))


class SensedPads(Pads):
    """Pads whose readings go to the rules. ``change`` modifies the readings."""

    def __init__(self, bench, motor, **options):
        super().__init__(motor, **options)
        self._bench = bench

    def send(self):
        forces, now = self.forces(), self._bench.now
        contact = GraspContact(GraspContact.NO_CONTACT + sum(force > THRESHOLD for force in forces))
        touch = self.change(TouchReading(now - AGE, True, contact, tuple(map(ForceReading, forces))))
        opening = self._motor.opening

        def sense():
            control = self._bench.control
            control.touch = touch.after(control.touch)
            if self.knows_gap:
                control.measure(opening, now)
            control.look()
        self._bench.post(sense)


@dataclass
class Alone:
    """No other process commands the gripper."""

    text: str = ''
    has_listened: bool = True


@dataclass
class SentGoal:
    """A client's goal, with its ending and the ending of the hold after it."""

    is_cancel_requested: bool = False
    ending: object = None
    of_hold: object = None

    def cancel(self):
        self.is_cancel_requested = True


class ControlBench:
    """The rules with a motor, pads and a client.

    Parameters
    ----------
    commands_speed : bool
        True if the gripper accepts a speed.
    pads : dict
        Options of the pads.
    **settings
        Settings of the rules.
    """

    def __init__(self, commands_speed=True, pads=(), **settings):
        self.now, self._steps = 1000.0, 0
        self._messages = deque()
        self._action, self.duplicates, self.ends = Action(self), Alone(), []
        self.motor = ActionMotor(self, self._action)
        self.control = TouchControl(replace(TouchSettings(), **settings), self._action, self.duplicates, self._on_end,
                                    why_unseen=lambda: 'unseen', commands_speed=commands_speed,
                                    steady=lambda: self.now)
        self.pads = SensedPads(self, self.motor, **dict(pads))
        self.wait(0.1)

    def _on_end(self, handle, ending):
        self.ends.append(ending)
        if ending.is_hold:
            handle.of_hold = ending
        else:
            handle.ending = ending

    def post(self, message):
        self._messages.append(message)

    def step(self):
        self.now += STEP
        self._steps += 1
        self.control.look()
        if self._steps % CANCEL_STEPS == 0:
            self.control.commands.repeat_cancels()
        self.motor.step()
        self.pads.step()
        while self._messages or self._action.work():
            if self._messages:
                self._messages.popleft()()

    def wait(self, seconds):
        for _ in range(round(seconds / STEP)):
            self.step()

    def until(self, condition):
        end = self.now + TIMEOUT
        while not condition():
            assert self.now < end, 'timeout'
            self.step()

    def send(self, opening=0.0, speed=0.0, force=0.0):
        """Send a goal, and return it."""
        sent = SentGoal()
        self.control.accept(sent, Wish(opening, speed, force))
        return sent

    def result(self, sent):
        """Return how a goal ended."""
        self.until(lambda: sent.ending)
        return sent.ending

    def close(self, opening=0.0, speed=0.0, force=0.0):
        """Send a goal, and return how it ended."""
        return self.result(self.send(opening, speed, force))

    def outcome(self, **goal):
        return self.close(**goal).outcome

    @property
    def hold_ends(self):
        """Outcomes of the holds that have ended."""
        return [each.outcome for each in self.ends if each.is_hold]

    def press(self, force):
        """Move the gripper until both pads read ``force`` [N], before any goal is sent."""
        self.motor.move_to(self.pads.width - force / self.pads.stiffness)
        self.wait(0.2)
        self.motor.commands.clear()

    def hide(self, change):
        """Change all further readings by ``change``, or send none if ``change`` is None."""
        self.pads.is_silent = change is None
        self.pads.change = change or self.pads.change


def unseen(touch):
    return touch._replace(contact=GraspContact.UNSEEN, pads=(ForceReading(), touch.pads[1]))


def stale(touch):
    return touch._replace(fresh=False)


def unchanged(touch):
    return touch


#: Changes after which the pads are not seen. With None, the pads send nothing.
NOT_SEEN = (unseen, stale, None)
