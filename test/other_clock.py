"""Runs a module of ours while libfaketime gives this process another wall clock; prints what that clock shows.

    LD_PRELOAD=... python test/other_clock.py tactile_node.nodes.driver_node --ros-args ...

Lines of JSON on stdout: how far the wall clock is ahead of the steady one, which libfaketime leaves alone.
"""

import json
import runpy
import sys
import threading
import time

PERIOD = 0.05  # s


def show(stop: threading.Event) -> None:
    while not stop.wait(PERIOD):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        if after - before < 1e-3:  # else this thread was held up
            print(json.dumps({'at': after, 'lead': wall - (before + after) / 2}), flush=True)


def sleep(seconds: float) -> None:
    """time.sleep of Python 3.11 ends in EINVAL under libfaketime 0.9.10: it asks for an absolute monotonic time."""
    threading.Event().wait(seconds)


def main() -> None:
    time.sleep = sleep
    threading.Thread(target=show, args=(threading.Event(),), daemon=True).start()
    module, sys.argv = sys.argv[1], sys.argv[1:]
    runpy.run_module(module, run_name='__main__', alter_sys=True)


if __name__ == '__main__':
    main()
