"""Write the report of a commissioning as a page (Markdown) and as JSON."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tactile_node.commissioning.evaluation import NOT_DONE, Evaluation
from tactile_node.commissioning.measurement import Measurement, Verdict
from tactile_node.commissioning.parameter_file import MeasuredParameters
from tactile_node.output_file import output_file

SKIN_STEPS = 'response', 'assessment'  #: Steps that `tactile calibrate` and `tactile assess` carry out.
#: Factor and unit in which a value is written for a person. The JSON file keeps the units of the measurements.
SHOWN_AS = {'m': (1e3, 'mm'), 'm/s': (1e3, 'mm/s'), 'rad': (180 / math.pi, 'degrees'), 's': (1e3, 'ms'),
            'm/percent': (1e3, 'mm/percent'), 'm/rad': (1e3, 'mm/rad'), 'N/m': (1e-3, 'N/mm')}
FORCES = 1.0, 2.0, 5.0, 10.0  #: Overshoots for which the page gives the fastest speed [N].


def write_report(page: str | Path, data: str | Path, found: Evaluation, parameters: MeasuredParameters,
                 about: Mapping[str, str], pictures: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write the page and the JSON file.

    Parameters
    ----------
    page, data : str or Path
        The two files.
    found : Evaluation
        Results of the commissioning.
    parameters : MeasuredParameters
        The parameters of the parameter file.
    about : mapping of str to str
        Lines for the head of the page, for example the date, the versions and the identities of the devices.
    pictures : mapping of str to str
        Caption of each picture, by the name of its file beside the page.
    """
    with output_file(page) as stream:
        stream.write(page_text(found, parameters, about, pictures).encode())
    with output_file(data) as stream:
        stream.write(json.dumps(report_data(found, parameters, about), indent=1, allow_nan=False).encode())


def page_text(found: Evaluation, parameters: MeasuredParameters, about: Mapping[str, str],
              pictures: Mapping[str, str]) -> str:
    """Return the page."""
    lines = ['# Commissioning', '', *(f'- {name}: {value}' for name, value in about.items()), '',
             '| finding | value | verdict | reason |', '| --- | --- | --- | --- |']
    lines += [f'| {fact.name} | {fact.value} | {fact.verdict.value} | {fact.reason} |' for fact in found.facts]
    lines += ['', '| quantity | value | verdict | reason |', '| --- | --- | --- | --- |']
    lines += [f'| {each.name} | {_written(each)} | {each.verdict.value} | {each.reason} |'
              for each in found.measurements]
    lines += ['', '| overshoot [N] | fastest speed [mm/s] |', '| --- | --- |']
    lines += [f'| {force:g} | {_speed(found.allowed_speed(force))} |' for force in FORCES]
    for file, caption in pictures.items():
        lines += ['', f'![{caption}]({file})', '', caption]
    for step in SKIN_STEPS:
        text = found.of_skin(step).get('text', 'The step was not carried out.')
        lines += ['', f'## Skin: {step}', '', *(f'    {line}'.rstrip() for line in text.strip().splitlines())]
    lines += ['', '## Before you use the parameters', '', *(f'- {note}' for note in parameters.notes or ['Nothing.'])]
    lines += ['', '## Parameters that are missing', '']
    lines += [f'- {name}: {reason}' for name, reason in parameters.absent.items()] or ['None.']
    if found.left_place is None:
        lines += ['', 'The poses of the pads are relative only. Their place in the frame of the gripper was not '
                  'measured.']
    return '\n'.join(lines) + '\n'


def found_lines(found: Evaluation) -> list[str]:
    """Return a line for each known value, and a line for each reason why values are unknown.

    Values whose step was not carried out have no line.
    """
    lines: list[str] = []
    unknown: dict[str, list[str]] = {}
    rows = [(each.name, each.value, each.verdict, each.reason) for each in found.facts]
    rows += [(each.name, _written(each), each.verdict, each.reason) for each in found.measurements]
    for name, value, verdict, reason in rows:
        if verdict is Verdict.UNKNOWN:
            unknown.setdefault(reason, []).append(name)
        else:
            lines.append(f'{name}: {value}' + ', FAIL' * (verdict is Verdict.FAIL) + (f' ({reason})' if reason else ''))
    return lines + [f'unknown: {", ".join(names)} ({reason})' for reason, names in unknown.items()
                    if reason != NOT_DONE]


def report_data(found: Evaluation, parameters: MeasuredParameters, about: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of the JSON file. A value that is not known is null."""
    return {'about': dict(about),
            'facts': [{'name': each.name, 'value': each.value, 'verdict': each.verdict.value, 'reason': each.reason}
                      for each in found.facts],
            'measurements': [{'name': each.name, 'value': _number(each.estimate.value),
                              'deviation': _number(each.estimate.deviation), 'unit': each.unit,
                              'verdict': each.verdict.value, 'reason': each.reason} for each in found.measurements],
            'fastest_speeds': [{'overshoot': force, 'speed': _number(found.allowed_speed(force))} for force in FORCES],
            'skin': {step: found.of_skin(step).get('text') for step in SKIN_STEPS},
            'parameters': parameters.nodes, 'absent': parameters.absent, 'notes': list(parameters.notes)}


def _written(each: Measurement) -> str:
    if not each.estimate.is_known:
        return 'unknown'
    value, deviation = each.estimate
    factor, shown = SHOWN_AS.get(each.unit, (1.0, each.unit))
    value, unit = factor * value, '' if each.unit == '1' else f' {shown}'
    return f'{value:.4g} +- {factor * deviation:.2g}{unit}' if deviation else f'{value:.4g}{unit}'


def _speed(speed: float) -> str:
    if math.isnan(speed):
        return 'unknown'
    return f'{1e3 * speed:.2f}' if speed else 'none is slow enough'


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
