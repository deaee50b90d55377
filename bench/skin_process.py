"""The simulated skin as a separate process, behind a pseudo-terminal and on a wire that keeps time."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tactile_node.simulator.wire import WireReport  # noqa: E402

REPORT_TIMEOUT = 10.0  #: s


class SkinProcess:
    """Runs until ``end``; ``port`` is the adapter's, which it has opened. ``options``: of `tactile simulate`."""

    def __init__(self, folder: Path, layout: str, nodes: Sequence[int], options: Sequence[str] = ()):
        self.port, self._file = str(folder / 'can'), folder / 'wire.jsonl'
        command = [sys.executable, '-m', 'tactile_node.cli.main', 'simulate', '--pty', '--link', self.port, '--layout',
                   layout, '--node-id', ','.join(map(str, nodes)), '--report', str(self._file), *options]
        self._process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self._reports = 0
        if not self._process.stdout or not self._process.stdout.readline():
            sys.exit('the simulated skin has not started')

    def report(self) -> WireReport:
        """Of the time since the one before."""
        self._process.send_signal(signal.SIGUSR1)
        end = time.monotonic() + REPORT_TIMEOUT
        while time.monotonic() < end:
            lines = self._file.read_text(encoding='utf-8').split('\n') if self._file.exists() else []
            if len(lines) - 1 > self._reports:
                self._reports = len(lines) - 1
                return WireReport(**json.loads(lines[-2]))
            time.sleep(0.01)
        sys.exit('the simulated skin does not report')

    def end(self) -> None:
        self._process.terminate()
        self._process.wait()
