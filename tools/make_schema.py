"""Writes config/skin_layout.schema.json: the keys of a skin layout as JSON Schema, for editors and other programs.

`make schema` runs it; a test compares the file with this one, and the schema with what the reader accepts. The bounds
are the reader's constants. What relates two keys (taxels within rows and cols, fields that overlap, COB-IDs given
twice) no schema can express: `tactile check` reports it.
"""

import json
from pathlib import Path
from typing import Any

from tactile_node.cia301.objects import (
    EVENT_TIMER_UNIT,
    ID_MASK,
    INHIBIT_UNIT,
    MANUFACTURER_EVENT,
    MAX_INDEX,
    MAX_NODE_ID,
    MAX_PDO_BITS,
    MAX_SUBINDEX,
    MAX_TIME,
    MAX_TPDOS,
    PROFILE_EVENT,
)
from tactile_node.skin.layout import MAX_DOMAIN_BYTES, MAX_SIDE
from tactile_node.skin.layout_file import LARGEST, MOST, UNITS
from tactile_node.skin.layout_rules import PITCHES
from tactile_node.yaml_section import LARGEST as LARGEST_NUMBER

FILE = Path(__file__).resolve().parents[1] / 'config/skin_layout.schema.json'
MAX_ROW = 255  # one byte
MAX_BITS = 32  # of a taxel
TERM = r'(\$[Nn][Oo][Dd][Ee][Ii][Dd]|0[Xx][0-9A-Fa-f]+|[0-9]+)'
COB_ID = rf'^ *{TERM}( *\+ *{TERM})* *$'

Schema = dict[str, Any]


def schema() -> Schema:
    """Return the schema of a whole layout."""
    return {
        '$schema': 'https://json-schema.org/draft/2020-12/schema',
        'title': 'Skin layout of tactile_skin',
        'description': 'How the taxels of a pad arrive over CANopen. All values in SI units.',
        **_object({
            'rows': _integer('Rows of taxels.', 1, MAX_SIDE),
            'cols': _integer('Columns of taxels.', 1, MAX_SIDE),
            'pitch': _positive('Between the centres of neighbouring taxels [m].'),
            'unusual_pitch': {'description': 'The pitch is meant, though below '
                              f'{1000 * PITCHES[0]:g} mm or above {1000 * PITCHES[1]:g} mm.', 'type': 'boolean'},
            'value': _value(),
            'sync_cob_id': _integer('COB-ID of the SYNC that starts a sweep (default 0x080).', 1, ID_MASK),
            'dead_taxels': _list('Taxels known to be dead, [row, col] each; they are NaN.', _place(0)),
            'nodes': _integer('CANopen nodes that make up the pad (default 1).', 1, MAX_NODE_ID),
            'tpdos': _list('The TPDOs that carry the taxels, in the order in which the device sends them.', _tpdo()),
            'domain': _optional(_domain()),
            'event_driven': _optional(_event_driven()),
        }, required=('rows', 'cols', 'pitch', 'value')),
        'anyOf': [{'required': ['tpdos'], 'properties': {'domain': {'type': 'null'}}},
                  {'required': ['domain'], 'properties': {
                      'domain': {'type': 'object'}, 'tpdos': {'maxItems': 0}, 'event_driven': {'type': 'null'},
                      'nodes': {'const': 1}}}],
    }


def _value() -> Schema:
    return _object({
        'unit': {'description': 'Pressure, force, or 1 for on/off taxels.', 'enum': list(UNITS)},
        'scale': _positive('Unit per count.'),
        'offset': {'description': 'Counts without load (default: the end of the range).', 'type': 'integer'},
        'bits': _integer('Width of one taxel.', 1, MAX_BITS),
        'signed': {'description': "Two's complement (default false).", 'type': 'boolean'},
        'byte_order': {'description': 'How CANopen maps objects (default little); big: start_bit counts from the top '
                       'bit of byte 0.', 'enum': ['little', 'big']},
        'pressure': {'description': 'Whether counts rise under pressure (default rising).',
                     'enum': ['rising', 'falling']},
    }, 'What the counts of a taxel mean: value = scale (counts - offset), or the negative where they fall.',
        required=('unit', 'scale', 'bits'))


def _tpdo() -> Schema:
    places = {'count': _integer('Frames.', 1, MAX_SUBINDEX + 1), 'step': _steps('Of the taxels from frame to frame.')}
    return {
        **_object({
            'number': _integer('1 is object 0x1800, 0x1A00.', 1, MAX_TPDOS),
            'cob_id': {'description': "As in the EDS: 0x1A0 or '$NODEID+0x180', without the flags of bits 29 to 31.",
                       'anyOf': [_integer('', 0, ID_MASK), {'type': 'string', 'pattern': COB_ID}]},
            'node': _integer('Which of several nodes sends it (default 0).', 0, MAX_NODE_ID - 1),
            'map': _map(),
            'taxels': _taxels(),
            'rows': _optional(_object({'first': _integer('Number of the first row (default 0).', 0, MAX_ROW), **places},
                                      'Many frames under one COB-ID, distinguished by a number in byte 0.',
                                      required=('count', 'step'))),
            'mpdo': _optional(_object({'object': _index(), 'sub': _sub('Of the first frame.'), **places},
                                      'Many objects under one COB-ID, as MPDOs with source addressing.',
                                      required=('object', 'sub', 'count', 'step'))),
            'repeat': _repeat(),
        }, required=('number', 'cob_id', 'taxels')),
        'if': {'required': ['mpdo'], 'properties': {'mpdo': {'type': 'object'}}},
        'then': {'properties': {'map': False, 'rows': False}}, 'else': {'required': ['map']},
    }


def _map() -> Schema:
    run = _object({'object': _index(), 'sub': _sub('Of the first object.'),
                   'bits': _integer('Of each object.', 1, MAX_PDO_BITS),
                   'count': _integer('Of consecutive sub-indices (default 1).', 1, MAX_PDO_BITS)},
                  required=('object', 'sub', 'bits'))
    return {'description': 'The objects mapped into it, written to 0x1A00 and following.',
            'anyOf': [run, _list('[index, sub-index, bits] each.', _integers(3, 0, MAX_INDEX))]}


def _taxels() -> Schema:
    run = _object({'first': _place(0), 'step': _steps('From one taxel to the next.'),
                   'count': _integer('Taxels.', 1, MAX_PDO_BITS),
                   'start_bit': _integer('Of the first (default 0).', 0, MAX_PDO_BITS - 1),
                   'bit_step': _integer('From one taxel to the next.', 1, MAX_PDO_BITS)},
                  required=('first', 'step', 'count', 'bit_step'))
    return {'description': 'Where its taxels are on the pad, and in the CAN frame.',
            'anyOf': [run, _list('[row, col, start bit] each.', _integers(3, 0, MAX_SIDE))]}


def _repeat() -> Schema:
    loop = _object({'count': _integer('Repetitions.', 1, MOST),
                    **{key: _integer('', -most, most) for key, most in LARGEST.items()},
                    'step': _steps('Of all taxels.')}, required=('count',))
    return {'description': 'This entry stands for "count" TPDOs; in each, the keys named are so much greater than in '
            'the one before, and "step" moves its taxels. A list of these is loops, the outermost first.',
            'anyOf': [loop, {'type': 'array', 'items': loop}, {'type': 'null'}]}


def _domain() -> Schema:
    bits = 8 * MAX_DOMAIN_BYTES
    return _object({
        'object': _index(), 'sub': _sub('(default 0)'), 'bytes': _integer('Its size.', 1, MAX_DOMAIN_BYTES),
        'start_bit': _integer('Of the first taxel (default 0).', 0, bits),
        'bit_step': _integer('From one taxel to the next.', 1, bits),
        'order': {'description': 'Row by row or column by column (default rows).', 'enum': ['rows', 'cols']},
    }, 'In place of tpdos: the taxels are one DOMAIN object, polled by SDO.', required=('object', 'bytes', 'bit_step'))


def _event_driven() -> Schema:
    return {**_object({
        'transmission_type': _integer('Of CiA 301: 254 by the maker, 255 by the profile.', MANUFACTURER_EVENT,
                                      PROFILE_EVENT),
        'event_timer': _number('The most between two transmissions of a TPDO [s]; 0: off.', 0,
                               MAX_TIME * EVENT_TIMER_UNIT),
        'inhibit_time': _number('The least between two transmissions of a TPDO [s] (default 0).', 0,
                                MAX_TIME * INHIBIT_UNIT),
        'frames': {'description': 'sweeps: all TPDOs of a scan come together; snapshots: each at its own time.',
                   'enum': ['sweeps', 'snapshots']},
        'period': _positive('Of sweeps: the least between the beginnings of two [s] (default event_timer).'),
        'max_age': _positive('Of snapshots: how old the values of a TPDO may become [s] (default 3 event timers).'),
    }, 'A skin that sends without SYNC.', required=('transmission_type', 'event_timer', 'frames')),
        'if': {'properties': {'frames': {'const': 'sweeps'}}},
        'then': {'properties': {'max_age': False},
                 'if': {'properties': {'event_timer': {'const': 0}}}, 'then': {'required': ['period']}},
        'else': {'properties': {'period': False, 'event_timer': {'exclusiveMinimum': 0}}}}


def _index() -> Schema:
    return _integer('Index of the object.', 1, MAX_INDEX)


def _sub(text: str) -> Schema:
    return _integer(f'Sub-index. {text}', 0, MAX_SUBINDEX)


def _place(low: int) -> Schema:
    return _integers(2, low, MAX_SIDE, '[row, col]')


def _steps(text: str) -> Schema:
    return _integers(2, -MAX_SIDE, MAX_SIDE, f'[down, right]. {text}')


def _integer(text: str, low: int, high: int) -> Schema:
    return {**_described(text), 'type': 'integer', 'minimum': low, 'maximum': high}


def _number(text: str, low: float, high: float) -> Schema:
    return {**_described(text), 'type': 'number', 'minimum': low, 'maximum': high}


def _positive(text: str) -> Schema:
    return {**_described(text), 'type': 'number', 'exclusiveMinimum': 0, 'exclusiveMaximum': LARGEST_NUMBER}


def _integers(count: int, low: int, high: int, text: str = '') -> Schema:
    return {**_described(text), 'type': 'array', 'items': _integer('', low, high), 'minItems': count,
            'maxItems': count}


def _list(text: str, items: Schema) -> Schema:
    return {**_described(text), 'type': 'array', 'items': items}


def _object(properties: Schema, text: str = '', *, required: tuple[str, ...]) -> Schema:
    return {**_described(text), 'type': 'object', 'properties': properties, 'required': list(required),
            'additionalProperties': False}


def _optional(kind: Schema) -> Schema:
    """null is as good as no such key."""
    return {**kind, 'type': [kind['type'], 'null']}


def _described(text: str) -> Schema:
    return {'description': text} if text else {}


def written() -> str:
    """Return the text of the file."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + '\n'


if __name__ == '__main__':
    FILE.write_text(written(), encoding='utf-8')
