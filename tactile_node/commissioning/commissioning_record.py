"""Keep the results of the steps in one JSON file, so that a commissioning can be continued."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactile_node.commissioning.block_grip import BlockFace, BlockGrip, Print
from tactile_node.commissioning.lateral_shift import HungWeight
from tactile_node.commissioning.measurement import Estimate
from tactile_node.commissioning.pad_rest import PadRest
from tactile_node.commissioning.plan import CommissioningPlan, GaugeBlock
from tactile_node.commissioning.recording import PadGrid
from tactile_node.errors import InputError
from tactile_node.output_file import output_file

VERSION = 1  #: Version of the file.


class CommissioningRecord(dict[str, dict[str, Any]]):
    """The results of the finished steps, by name of the step. A step that has not been finished has no results.

    Parameters
    ----------
    path : str or Path
        The file. A file that exists is continued.

    Raises
    ------
    InputError
        Raised if the file exists and is no record of this version.
    """

    def __init__(self, path: str | Path):
        super().__init__()
        self._path = Path(path)
        if self._path.exists():
            try:
                content = json.loads(self._path.read_text(encoding='utf-8'))
                version, steps = content['version'], content['steps']
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise self._refusal('another file') from error
            if version != VERSION or not isinstance(steps, dict):
                raise self._refusal(f'version {version}')
            self.update(steps)

    def __missing__(self, step: str) -> dict[str, Any]:
        return {}

    @property
    def serial_numbers(self) -> list[str]:
        """Serial number of each pad, or '' if it is not known. An older record has none."""
        return self['rest'].get('serial_numbers', ['', ''])

    def save(self, step: str, results: Mapping[str, Any]) -> None:
        """Add the results of a step, and write the file."""
        self[step] = json.loads(json.dumps(results, default=_plain))
        with output_file(self._path) as stream:
            stream.write(json.dumps({'version': VERSION, 'steps': self}, indent=1).encode())

    def _refusal(self, got: str) -> InputError:
        return InputError(str(self._path), expected=f'a record of a commissioning, version {VERSION}', got=got,
                          remedy='Name another file.')


def plan_from(content: Mapping[str, Any]) -> CommissioningPlan:
    """Return a plan from the JSON of its fields."""
    blocks = tuple(GaugeBlock(**each) for each in content['blocks'])
    lists = {'grid': PadGrid(*content['grid']), 'blocks': blocks, 'down': tuple(content['down']),
             'pads': tuple(content.get('pads', CommissioningPlan.pads)), 'jig': tuple(content.get('jig', ()))}
    return CommissioningPlan(**dict(content) | lists)


def rest_from(content: Mapping[str, Any]) -> PadRest:
    """Return the properties of an untouched pad from the JSON of its fields."""
    return PadRest(Estimate(*content['noise']), Estimate(*content['drift']), content['rate'], content['lost'],
                   np.array(content['zero'], float))


def grip_from(content: Mapping[str, Any]) -> BlockGrip:
    """Return a grip from the JSON of its fields."""
    left, right = map(print_from, content['prints'])
    return BlockGrip(content['width'], Estimate(*content['onset']), np.array(content['slopes']), (left, right),
                     Estimate(*content['stiffness']), tuple(content['efforts']), tuple(content['forces']),
                     content['imbalance'])


def hung_from(content: Mapping[str, Any]) -> HungWeight:
    """Return a grip with a weight from the JSON of its fields."""
    (before, also), (loaded, last) = (map(print_from, content[name]) for name in ('before', 'loaded'))
    return HungWeight((before, also), (loaded, last), tuple(content['forces']))


def faces_from(content: Mapping[str, Any]) -> tuple[BlockFace, BlockFace]:
    """Return the faces of the block in the jig on both pads from the JSON of the step."""
    left, right = (BlockFace(np.array(centre), angle, np.array(slopes)) for centre, angle, slopes in content['faces'])
    return left, right


def print_from(content: tuple[list[float], float]) -> Print:
    return Print(np.array(content[0]), content[1])


def _plain(value: object) -> object:
    """Return a number or a list for JSON."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f'{type(value).__name__} cannot be saved')
