"""Several buses in one process: python bench/pads_process.py LAYOUT BUSES PADS RATE CHANNEL...

`tactile bringup` starts one bus a process. A System is the nodes of one bus, and an executor spins any nodes, so one
process for several is only this; it exists to be measured.
"""

import sys
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

import rclpy
from pads_cases import Case
from rclpy.signals import SignalHandlerOptions

from tactile_node.interruption import interruption
from tactile_node.nodes.run import wait
from tactile_node.nodes.spinning import spinning
from tactile_node.nodes.system import System


def main() -> int:
    layout, channels, case = sys.argv[1], sys.argv[5:], Case('one', *map(int, sys.argv[2:5]))
    with ExitStack() as stack:
        stop_requested = stack.enter_context(interruption())
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        systems = [System(case.nodes(bus, channel, layout)) for bus, channel in enumerate(channels)]
        for system in systems:
            stack.callback(system.destroy)
        spinner = stack.enter_context(spinning([node for system in systems for node in system.nodes]))
        for system in systems:
            system.autostart(stop_requested)
        wait(spinner, stop_requested)
    return 0


if __name__ == '__main__':
    sys.exit(main())
