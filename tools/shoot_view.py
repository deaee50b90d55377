"""Takes pictures of `tactile view` on the simulated skin, for the README's moving picture.

    python tools/shoot_view.py docs/view.gif

Needs requirements/view_test.txt and Debian's chromium, as `make view-test`.
"""

import argparse
import io
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

FLAGS = ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']
WIDTH, HEIGHT = 1400, 800  # pixels
DRAWN = 900, 514  # pixels of the moving picture
SHOWN = 250  # ms of each picture
SETTLED = 6000  # ms until the page has history to show
PORT = 8098
SKIN = ('--node-id', '32,64')


def program(*arguments: str) -> subprocess.Popen:
    """Start `tactile` and wait for its first line: it is ready."""
    process = subprocess.Popen([sys.executable, '-m', 'tactile_node.cli.main', *arguments], stdout=subprocess.PIPE,
                               text=True)
    process.stdout.readline()
    return process


def shoot(output: Path, count: int, period: int) -> None:
    """Write a moving picture of ``count`` pictures of the page that is served, taken ``period`` [ms] apart."""
    images = []
    with sync_playwright() as playwright, playwright.chromium.launch(
            executable_path=shutil.which('chromium'), args=FLAGS) as browser:
        page = browser.new_page(viewport={'width': WIDTH, 'height': HEIGHT})
        page.goto(f'http://127.0.0.1:{PORT}')
        page.wait_for_selector('.tactile-map', timeout=60_000)
        for notice in page.locator('.mantine-Notification-closeButton').all():
            notice.click()
        page.wait_for_timeout(SETTLED)
        for _ in range(count):
            images.append(Image.open(io.BytesIO(page.screenshot())).convert('RGB').resize(DRAWN))
            page.wait_for_timeout(period)
    images = [image.quantize(palette=images[0].quantize()) for image in images]  # one palette: colours do not flicker
    images[0].save(output, save_all=True, append_images=images[1:], duration=SHOWN, loop=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('output', type=Path)
    parser.add_argument('--count', type=int, default=40)
    parser.add_argument('--period', type=int, default=100, help='between two pictures [ms], default %(default)s')
    args = parser.parse_args()
    with TemporaryDirectory() as place:
        link = f'{place}/skin'
        programs = []
        try:
            programs.append(program('simulate', '--pty', '--no-wire', '--link', link, *SKIN))
            programs.append(program('view', '--interface', 'slcan', '--channel', link, '--port', str(PORT), *SKIN,
                                    '--pads', 'left,right'))
            shoot(args.output, args.count, args.period)
        finally:
            for each in reversed(programs):
                each.terminate()
                each.wait()


if __name__ == '__main__':
    main()
