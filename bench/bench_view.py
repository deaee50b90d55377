"""`tactile view` of two pads at 50 Hz: updates a second, age of what the browser has, CPU with and without a browser.

The skin is `tactile simulate` behind a pseudo-terminal, in a process apart; the browser is headless Chromium without a
GPU. The age is that of the newest data when the browser has put them on its page. Needs requirements/view_test.txt and
Debian's chromium; left out without them.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FLAGS = ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']
SECONDS = 20.0
PORT = 8097
TICKS = os.sysconf('SC_CLK_TCK')
SKIN = ['--node-id', '32,64']


def tactile(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, '-m', 'tactile_node.cli.main', *arguments], stdout=subprocess.PIPE,
                            text=True)


def cpu_time(process: subprocess.Popen) -> float:
    """User and system time of a process [s] (proc(5), stat, fields 14 and 15)."""
    fields = Path(f'/proc/{process.pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def cpu_share(process: subprocess.Popen, seconds: float = SECONDS) -> float:
    before, begun = cpu_time(process), time.monotonic()
    time.sleep(seconds)
    return (cpu_time(process) - before) / (time.monotonic() - begun)


def looked_at(process: subprocess.Popen) -> None:
    from playwright.sync_api import sync_playwright
    with sync_playwright() as playwright:
        with playwright.chromium.launch(executable_path=shutil.which('chromium'), args=FLAGS) as browser:
            page = browser.new_page(viewport={'width': 1680, 'height': 950})
            page.goto(f'http://127.0.0.1:{PORT}')
            page.wait_for_selector('.tactile-map', timeout=60_000)
            page.wait_for_timeout(5000)
            share = cpu_share(process)
            status = page.locator('.tactile-status')
            rate, delay = (float(status.get_attribute(f'data-{name}')) for name in ('rate', 'delay'))
    print(f'with a browser:    {rate:.1f} updates/s, {1e3 * delay:.0f} ms old when shown, {share:.0%} of a core')


def main() -> int:
    try:
        import playwright  # noqa: F401
    except ModuleNotFoundError:
        print('bench_view: left out, playwright is missing (requirements/view_test.txt)')
        return 0
    link = Path(tempfile.mkdtemp()) / 'skin'
    with tactile('simulate', '--pty', '--no-wire', '--link', str(link), *SKIN) as simulator:
        simulator.stdout.readline()
        with tactile('view', '--interface', 'slcan', '--channel', str(link), '--port', str(PORT), *SKIN) as view:
            view.stdout.readline()
            time.sleep(3)
            print(f'without a browser: {cpu_share(view, SECONDS / 2):.1%} of a core')
            looked_at(view)
            time.sleep(4)
            print(f'browser closed:    {cpu_share(view, SECONDS / 2):.1%} of a core')
            view.terminate()
        simulator.terminate()
    return 0


if __name__ == '__main__':
    sys.exit(main())
