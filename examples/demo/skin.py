"""The simulated skin of the demo, a separate process as hardware would be: an slcan adapter on a pseudo-terminal.

Prints the port. A line on its standard input gives the time at which the script of touches begins [s, Unix epoch]; the
end of that input is its end. Then it prints the report of the wire as JSON.

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
    """The clock of the touches, which stands before them until ``begin`` is known [s, Unix epoch].

    The script goes on when the driver starts a device again. The device's own clock would start the script again.
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
    gc.freeze()  # a full collection would delay a sweep by some 40 ms
    for line in sys.stdin:
        script.begin = float(line)
        simulator.report()  # the next one is of the touches alone
    report = simulator.report()
    simulator.stop()
    print(json.dumps(report._asdict() if report else {}))


if __name__ == '__main__':
    main(sys.argv[1:])
