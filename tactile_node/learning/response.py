"""Read and write the response of a skin.

`tactile calibrate` writes the response file. The driver and `tactile classify` read the file.
"""

from pathlib import Path
from typing import NamedTuple

import yaml

from tactile_node.conditioning.gain import ResponseCurve, make_curve
from tactile_node.errors import ConfigurationError
from tactile_node.output_file import output_file
from tactile_node.pose.profiles import Layer, check_layer
from tactile_node.yaml_keys import ListOf, Number, OneOf
from tactile_node.yaml_section import load_mapping

RESPONSE_SUFFIX = '.response.yaml'  #: Suffix of the response file, which is stored beside the layout.
WRITTEN_DIGITS = 6                 #: Number of significant digits in the file.


class SkinResponse(NamedTuple):
    """Response of all taxels of a skin."""

    unit: str  #: unit of readings and pressures: 'Pa' or 'N'
    layer: Layer
    curve: ResponseCurve


def load_response(path: str | Path) -> SkinResponse:
    """Read a response file, or raise a ConfigurationError that names the file and the faulty key."""
    top = load_mapping(Path(path), 'a skin response')
    unit = top.read('unit', OneOf(('Pa', 'N')))
    section, nodes = top.section('layer'), top.section('curve')
    layer = Layer(*(section.read(key, Number(positive=True)) for key in ('depth', 'deviation')))
    section.done()
    numbers = ListOf(Number(remedy='Calibrate the skin again.'))
    readings, pressures = (nodes.read(key, numbers) for key in ('readings', 'pressures'))
    nodes.done()
    top.take('found_from', None)  # this section is for human readers only
    top.done()
    try:
        check_layer(layer)
        return SkinResponse(unit, layer, make_curve(readings, pressures))
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}, {error.where}', expected=error.expected, got=error.got,
                                 remedy=error.remedy) from None


def save_response(path: str | Path, response: SkinResponse, head: str, found_from: dict[str, object]) -> None:
    """Write a response file.

    Parameters
    ----------
    path : str or Path
        The file.
    response : SkinResponse
        Response to write.
    head : str
        Comment at the top of the file.
    found_from : dict
        Facts about the calibration, for human readers.

    Raises
    ------
    InputError
        Raised if the file cannot be written.
    """
    content = {
        'unit': response.unit,
        'layer': {'depth': _rounded(response.layer.depth), 'deviation': _rounded(response.layer.deviation)},
        'curve': {'readings': [_rounded(value) for value in response.curve.readings],
                  'pressures': [_rounded(value) for value in response.curve.pressures]},
        'found_from': found_from}
    comment = ''.join(f'# {line}\n' for line in head.splitlines())
    with output_file(path) as stream:
        stream.write((comment + yaml.safe_dump(content, default_flow_style=None, sort_keys=False, width=110)).encode())


def _rounded(value: float) -> float:
    return float(f'{value:.{WRITTEN_DIGITS}g}')
