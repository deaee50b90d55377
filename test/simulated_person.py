"""Commission the simulated gripper as a person does: with two processes and their terminals.

    python test/simulated_person.py FOLDER [OPTION ...]

The person reads each question of `tactile commission`, types an order into the simulated gripper, and answers. The
options are passed on to `tactile commission`.
"""

import os
import pty
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from built_messages import BUILT, built_messages, environment_with

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 400.0  #: Time limit from one question to the next [s].
LAST = 15  #: Number of the last row and of the last column of a pad.
BLOCKS = '0.025:0.022,0.040:0.018,0.055:0.014'
GRIPPER = ('--joint', 'hand_gap', '--unit', 'm', '--limits', '0', '0.09', '--most-effort', '20', '--blocks', BLOCKS,
           '--action', 'hand/gripper_cmd')


#: Place of the hand along x [m], and force [N], of each touch of an object with which a recording is made.
TOUCHES = (0.0, 2), (0.002, 4), (-0.002, 6), (0.001, 8), (-0.001, 12), (0.0015, 3), (-0.0015, 5), (0.0005, 10)
UNKNOWN = 'ball', 'bottle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle', 'block_25', 'block_40'


class Process:
    """Runs a process on a pseudo-terminal, and collects the text that the process prints."""

    def __init__(self, *words):
        ours, theirs = pty.openpty()
        self._terminal, self.text = ours, ''
        self.process = subprocess.Popen([sys.executable, *words], env=environment_with('control_msgs'), cwd=ROOT,
                                        stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
        os.close(theirs)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        try:
            while data := os.read(self._terminal, 4096):
                self.text += data.decode(errors='replace')
        except OSError:  # the process has closed its terminal
            pass

    def type(self, line=''):
        os.write(self._terminal, f'{line}\n'.encode())

    def stop(self):
        self.process.terminate()
        self.process.wait(30)

    def end(self):
        """Kill the process and close its terminal."""
        self.process.kill()
        self.process.wait()
        self._reader.join(10)
        os.close(self._terminal)


class SimulatedPerson:
    """The person between `tactile commission` and the simulated gripper."""

    def __init__(self, gripper, command):
        self._gripper, self._command = gripper, command
        self._answered = 0  # number of characters that were read
        self._before = 0.0
        self._touching = threading.Thread()

    def run(self):
        """Answer all questions, and return the exit code of the command."""
        end = time.monotonic() + LIMIT
        while self._command.process.poll() is None:
            assert time.monotonic() < end, self._command.text
            text = self._command.text[self._answered:]
            if not re.search(r'\[[^\]\n]*\] $', text):
                time.sleep(0.05)
                continue
            end = time.monotonic() + LIMIT
            self._answered += len(text)
            print(text, file=sys.stderr, flush=True)
            self._command.type(self._answer(text))
        return self._command.process.wait()

    def gap(self):
        """Return the opening that the simulated gripper prints [m]."""
        start = len(self._gripper.text)
        self._gripper.type()
        while not (found := re.search(r'gap ([-\d.]+) mm', self._gripper.text[start:])):
            time.sleep(0.02)
        return 1e-3 * float(found[1])

    def _answer(self, text):
        if 'Start?' in text:
            self._before = self.gap()
            return 'yes'
        if 'stop in your reach' in text or 'shall they be used' in text:
            return 'yes'
        if 'How have the fingers moved' in text:
            change = self.gap() - self._before
            self._before += change
            return 'not moved' if abs(change) < 1e-4 else 'opened' if change > 0 else 'closed'
        self._act(text)
        return ''

    def _act(self, text):
        """Do what a question asks for."""
        if items := self._items(text):
            self._touch(items)
        elif 'Take the object away' in text:
            self._touching.join()
        elif found := re.search(r'Hold the (left|right) pad .* press the (.*) for', text):
            self._press(found[1], found[2])
        elif found := re.search(r'Press everywhere on the (left|right)', text):
            threading.Thread(target=self._stroke, args=(found[1],), daemon=True).start()
        elif 'Take everything out' in text:
            self._gripper.type('move lift=0.12')
            time.sleep(3.0)
        elif found := re.search(r'block of (\d+) mm', text):
            self._hold(f'block_{found[1]}')
        elif 'Hold the foam' in text:
            self._hold('square')
        elif 'Hold the block' in text:
            self._hold('block_40')

    def _hold(self, item):
        self._gripper.type(f'item {item}')
        time.sleep(0.5)

    @staticmethod
    def _items(text):
        """Return the items for the touches that a question asks for, or an empty list."""
        if 'each time with a different object' in text:
            return UNKNOWN
        found = 'disc' if 'Press the flat disc' in text else re.search("with the object '(.*)'|$", text)[1]
        return [found] * len(TOUCHES) if found else []

    def _touch(self, items):
        """Start to press each item once between the pads."""
        self._touching = threading.Thread(target=self._close_on, args=(items,), daemon=True)
        self._touching.start()

    def _close_on(self, items):
        time.sleep(2.5)  # nothing may touch the pad when the recording begins
        for item, (x, force) in zip(items, TOUCHES):
            for order, seconds in ((f'item {item}', 0.7), (f'move x={x}', 0.5), (f'close {force}', 2.5), ('open', 2.0)):
                self._gripper.type(order)
                time.sleep(seconds)

    def _press(self, pad, place):
        """Press a place, seen with the fingertip up. The rows of the left pad run to the tip, those of the right pad
        away from the tip."""
        right = 0.5 if 'middle' in place else float(place.endswith('on the right'))
        tip = LAST - 2 if pad == 'left' else 2
        across = 2 + (LAST - 4) * (right if pad == 'left' else 1 - right)
        self._gripper.type(f'press {pad} {tip} {across} 5 2.5')

    def _stroke(self, pad):
        for row in range(1, LAST + 1, 2):
            for col in range(1, LAST + 1, 2):
                self._gripper.type(f'press {pad} {row} {col} 5 0.2')
                time.sleep(0.18)


#: Parameters with which the driver works on a busy machine with two cores.
SLOW = '''/**/skin_driver:
    ros__parameters:
        sync_period: 0.07
        heartbeat_timeout: 3.0
'''
PADS = ('bringup', '--pads', 'left,right', '--node-ids', '32,64', '--params-file')
DELAYED = ('import sys; from examples.simulated_gripper import __main__, drive; drive.DELAY = {}; '
           '__main__.main(sys.argv[1:])')


def commission(folder, *options, driver=(), delay=0.04):
    """Run the driver, the simulated gripper and the command. Return the exit code, and the text of the command.

    Parameters
    ----------
    folder : Path
        Folder of the results.
    driver : sequence of str
        Arguments of `tactile` that start the driver, without those of the bus.
    delay : float
        Time from a command to the motor of the simulated gripper [s].
    """
    skin, slow = str(Path(folder) / 'skin'), Path(folder) / 'slow.yaml'
    slow.write_text(SLOW)
    gripper = Process('-c', DELAYED.format(delay), '--item', 'square', '--link', skin)
    processes = [gripper]
    try:
        while 'action /hand/gripper_cmd' not in gripper.text:
            assert gripper.process.poll() is None, gripper.text
            time.sleep(0.1)
        processes.append(Process('-m', 'tactile_node.cli.main', *(driver or (*PADS, str(slow))), '--interface', 'slcan',
                                 '--channel', skin))
        command = Process('-m', 'tactile_node.cli.main', 'commission', '--output', str(folder), *GRIPPER, *options)
        processes.append(command)
        code = SimulatedPerson(gripper, command).run()
        time.sleep(0.5)  # the rest of the text arrives
        return code, command.text
    finally:
        for each in reversed(processes):
            each.stop()
        print(processes[1].text[-4000:] if len(processes) > 1 else gripper.text, file=sys.stderr)


if __name__ == '__main__':
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    with built_messages('control_msgs', BUILT):
        result, printed = commission(sys.argv[1], *sys.argv[2:])
    print(printed)
    sys.exit(result)
