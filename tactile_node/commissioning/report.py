"""Write the report of a commissioning as a page (Markdown) and as JSON."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tactile_node.commissioning.evaluation import Evaluation
from tactile_node.commissioning.parameter_file import MeasuredParameters
from tactile_node.commissioning.report_lines import NOT_DONE, Verdict, fact_lines, measurement_lines
from tactile_node.output_file import output_file

SKIN_STEPS = 'response', 'assessment'  #: Steps that `tactile calibrate` and `tactile assess` carry out.
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
    lines = ['# Commissioning', '', *(f'- {name}: {value}' for name, value in about.items())]
    for title, rows in (('finding', fact_lines(found)), ('quantity', measurement_lines(found))):
        lines += ['', f'| {title} | value | verdict | reason |', '| --- | --- | --- | --- |']
        lines += [f'| {each.name} | {each.value} | {each.verdict.value} | {each.reason} |' for each in rows]
    lines += ['', '| overshoot [N] | fastest speed [mm/s] |', '| --- | --- |']
    lines += [f'| {force:g} | {_speed(found.allowed_speed(force))} |' for force in FORCES]
    for file, caption in pictures.items():
        lines += ['', f'![{caption}]({file})', '', caption]
    for step in SKIN_STEPS:
        text = found.record[step].get('text', 'The step was not carried out.')
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
    for each in (*fact_lines(found), *measurement_lines(found)):
        if each.verdict is Verdict.UNKNOWN:
            unknown.setdefault(each.reason, []).append(each.name)
        else:
            lines.append(f'{each.name}: {each.value}' + ', FAIL' * (each.verdict is Verdict.FAIL)
                         + (f' ({each.reason})' if each.reason else ''))
    return lines + [f'unknown: {", ".join(names)} ({reason})' for reason, names in unknown.items()
                    if reason != NOT_DONE]


def report_data(found: Evaluation, parameters: MeasuredParameters, about: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of the JSON file. A value that is not known is null."""
    return {'about': dict(about),
            'facts': [{'name': each.name, 'value': each.value, 'verdict': each.verdict.value, 'reason': each.reason}
                      for each in fact_lines(found)],
            'measurements': [{'name': each.name, 'value': _number(each.estimate.value),
                              'deviation': _number(each.estimate.deviation), 'unit': each.unit,
                              'verdict': each.verdict.value, 'reason': each.reason}
                             for each in measurement_lines(found)],
            'fastest_speeds': [{'overshoot': force, 'speed': _number(found.allowed_speed(force))} for force in FORCES],
            'skin': {step: found.record[step].get('text') for step in SKIN_STEPS},
            'parameters': parameters.nodes, 'absent': parameters.absent, 'notes': list(parameters.notes)}


def _speed(speed: float) -> str:
    if math.isnan(speed):
        return 'unknown'
    return f'{1e3 * speed:.2f}' if speed else 'none is slow enough'


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
