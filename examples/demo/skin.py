"""Run the demo's simulated skin as an slcan adapter on a pseudo-terminal, in a separate process like real hardware.

The process prints its port, and then reads a line with the time at which the script of touches begins [s, Unix epoch].
At the end of its standard input, the process prints a report about the bus as JSON and exits.

    python -m examples.demo.skin SEED AREA ...
"""

import gc
import json
import math
import sys
import time
from functools import partial

from examples.demo.touches import TouchedPad, demo_pads, scripts_of
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.simulator.slcan_pty import SlcanPty


class Script:
    """Clock of the touches, which shows a time before the first touch until ``begin`` [s, Unix epoch] is set.

    The script continues when the driver restarts a device. With the device's own clock, the script would start again.
    """

    begin = math.inf

    def felt(self, pad: TouchedPad, _since_operational: float):
        return pad(time.time() - self.begin)


def main(words: list[str]) -> None:
    seed, *areas = words
    pads, script = demo_pads(), Script()
    scripts = scripts_of(int(seed), [float(area) for area in areas])
    sources = {pad.name: partial(script.felt, TouchedPad(scripts[pad.name], pad.layout.rows, pad.layout.cols, number))
               for number, pad in enumerate(pads, int(seed) + len(pads))}
    adapter = SlcanPty()
    simulator = SkinSimulator(pads, sources, lambda error: print(f'skin: {error}', file=sys.stderr), WireSettings())
    simulator.start_on(adapter)
    print(adapter.port, flush=True)
    gc.freeze()  # a full garbage collection would delay a sweep by about 40 ms
    for line in sys.stdin:
        script.begin = float(line)
        simulator.report()  # discard this report, so that the next report covers only the touches
    report = simulator.report()
    simulator.stop()
    print(json.dumps(report._asdict() if report else {}))


if __name__ == '__main__':
    main(sys.argv[1:])
