"""Rules for skin layouts beyond the YAML syntax. Each violation raises a ConfigurationError."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NoReturn

from tactile_node.cia301.objects import MAX_PDO_BITS, SYNC, reserved_for
from tactile_node.errors import ConfigurationError
from tactile_node.skin.layout import DomainLayout, EventDriven, SkinLayout, TpdoLayout


def collect_errors(checks: Iterable[Callable[[], object]]) -> list[ConfigurationError]:
    """Run every check, and return the errors raised."""
    found = []
    for check in checks:
        try:
            check()
        except ConfigurationError as error:
            found.append(error)
    return found


PITCHES = 0.0003, 0.025  #: smallest and largest usual pitch [m]; commercial skins lie well within this range


def layout_checks(layout: SkinLayout) -> Iterator[Callable[[], None]]:
    """Yield check functions. Each function raises ConfigurationError for the first violation it finds."""
    yield partial(_check_pitch, layout)
    if layout.event_driven is not None:
        yield partial(_check_event_driven, layout, layout.event_driven)
    if layout.domain is not None:
        yield partial(_check_domain, layout, layout.domain)
        return
    yield partial(_check_tpdos, layout)
    for position, tpdo in enumerate(layout.tpdos):
        yield partial(_check_tpdo, layout, tpdo.key or f'tpdos[{position}]', tpdo)
    yield partial(_check_unique_taxels, layout)
    pdos = _distinct_pdos(layout)
    for node in range(layout.nodes):
        own = [tpdo for tpdo in pdos if tpdo.node == node]
        yield partial(_check_node, layout, node, own)
        yield partial(_check_unique, layout, 'number', [(tpdo.number, tpdo.key) for tpdo in own])
        yield partial(_check_unique, layout, 'cob_id', [(str(tpdo.cob_id), tpdo.key) for tpdo in own])
    yield partial(_check_prefixes, layout)
    yield partial(_check_sync, layout)
    yield partial(_check_dead, layout)


def _check_pitch(layout: SkinLayout) -> None:
    least, most = PITCHES
    if not (least <= layout.pitch <= most or layout.unusual_pitch):
        _refuse(layout, 'pitch', expected=f'{least:g} to {most:g} m', got=f'{layout.pitch:g} m',
                remedy='Write it in metres: 2 mm is 0.002. If the value is correct, add "unusual_pitch: true".')


def _check_tpdos(layout: SkinLayout) -> None:
    if not layout.tpdos:
        _refuse(layout, 'tpdos', expected='at least one TPDO', got='none',
                remedy='List the TPDOs that carry the taxels, or give the "domain" that carries them.')


def _check_event_driven(layout: SkinLayout, event: EventDriven) -> None:
    if layout.domain is not None:
        _refuse(layout, 'event_driven', expected='TPDOs', got='a DOMAIN, which is polled', remedy='Remove one of them.')
    if 0 < event.event_timer < event.inhibit_time:
        _refuse(layout, 'event_driven.inhibit_time', expected=f'at most the event timer, {event.event_timer:g} s',
                got=f'{event.inhibit_time:g}', remedy='Correct one of the two.')
    if not event.is_sweeps:
        if event.max_age <= event.event_timer:
            _refuse(layout, 'event_driven.max_age', expected=f'more than the event timer, {event.event_timer:g} s',
                    got=f'{event.max_age:g}', remedy='A TPDO without changes is repeated only after the event timer.')
        return
    if layout.nodes > 1:
        _refuse(layout, 'event_driven.frames', expected='snapshots, because nodes without SYNC scan at different times',
                got='sweeps', remedy='Write snapshots.')
    if 0 < event.event_timer < event.period:
        _refuse(layout, 'event_driven.period', expected=f'at most the event timer, {event.event_timer:g} s',
                got=f'{event.period:g}', remedy='The period is the shortest time between the beginnings of two sweeps.')
    frames = Counter(tpdo.number for tpdo in layout.tpdos)
    if frames and (least := event.inhibit_time * (max(frames.values()) - 1)) > event.sweep_time:
        _refuse(layout, 'event_driven.inhibit_time', expected=f'a whole sweep within {event.sweep_time:g} s',
                got=f'{least:g} s between the first and the last frame of one multiplexed TPDO',
                remedy='Reduce inhibit_time, or give the device a longer period.')


def _check_node(layout: SkinLayout, node: int, own: list[TpdoLayout]) -> None:
    if not own:
        _refuse(layout, 'tpdos', expected=f'a TPDO for each of the {layout.nodes} nodes', got=f'none with node: {node}',
                remedy='Give each TPDO its "node", or correct "nodes".')


def _check_domain(layout: SkinLayout, domain: DomainLayout) -> None:
    if layout.tpdos or layout.nodes > 1:
        _refuse(layout, 'domain', expected='a single node and no "tpdos" beside the domain', got='tpdos or nodes',
                remedy='Choose whether the domain or TPDOs carry the taxels.')
    for field in domain.taxels:
        _check_inside(layout, 'domain.taxels', field.row, field.col)
        if (end := field.start_bit + layout.value.bits) > 8 * domain.length:
            _refuse(layout, 'domain.taxels', expected=f'fields within its {8 * domain.length} bits',
                    got=f'taxel ({field.row}, {field.col}) in bits {field.start_bit}..{end - 1}',
                    remedy='Correct start_bit, bit_step or bytes.')
    _check_overlap(layout, 'domain', domain)
    _check_dead(layout)


def _check_dead(layout: SkinLayout) -> None:
    for taxel in layout.dead:
        _check_inside(layout, 'dead_taxels', *taxel)


def _check_tpdo(layout: SkinLayout, key: str, tpdo: TpdoLayout) -> None:
    mapped = tpdo.bits
    if tpdo.node >= layout.nodes:
        _refuse(layout, f'{key}.node', expected=f'a node 0..{layout.nodes - 1}, as "nodes" is {layout.nodes}',
                got=str(tpdo.node), remedy='Correct it, or "nodes".')
    if not 1 <= mapped <= MAX_PDO_BITS:
        _refuse(layout, f'{key}.map', expected=f'1..{MAX_PDO_BITS} mapped bits in one TPDO', got=f'{mapped} bits',
                remedy='Distribute the objects over more TPDOs.')
    if not tpdo.cob_id.relative and (use := reserved_for(tpdo.cob_id.base)):
        _refuse(layout, f'{key}.cob_id', expected='a COB-ID that a PDO may use',
                got=f'{tpdo.cob_id}, which CiA 301 reserves: {use}',
                remedy='Choose one from 0x181 to 0x57F.')
    for field in tpdo.taxels:
        _check_inside(layout, f'{key}.taxels', field.row, field.col)
        end = field.start_bit + layout.value.bits
        if field.start_bit < (head := 8 * len(tpdo.prefix(1))):
            _refuse(layout, f'{key}.taxels', expected=f'fields behind the {head} bits that identify the frame',
                    got=f'taxel ({field.row}, {field.col}) from bit {field.start_bit}', remedy='Correct start_bit.')
        if end > mapped:
            _refuse(layout, f'{key}.taxels', expected=f'fields within the {mapped} mapped bits',
                    got=f'taxel ({field.row}, {field.col}) in bits {field.start_bit}..{end - 1}',
                    remedy='Map more objects, or correct start_bit.')
    _check_overlap(layout, key, tpdo)


def _check_overlap(layout: SkinLayout, key: str, tpdo: TpdoLayout | DomainLayout) -> None:
    fields = sorted(tpdo.taxels, key=lambda field: field.start_bit)
    for one, other in zip(fields, fields[1:]):
        if other.start_bit < one.start_bit + layout.value.bits:
            _refuse(layout, f'{key}.taxels', expected=f'fields of {layout.value.bits} bits that do not overlap',
                    got=f'taxels ({one.row}, {one.col}) and ({other.row}, {other.col}) '
                    f'at bits {one.start_bit} and {other.start_bit}', remedy='Correct start_bit or bit_step.')


def _check_inside(layout: SkinLayout, key: str, row: int, col: int) -> None:
    if not (0 <= row < layout.rows and 0 <= col < layout.cols):
        _refuse(layout, key, expected=f'taxels within rows 0..{layout.rows - 1} and cols 0..{layout.cols - 1}',
                got=f'taxel ({row}, {col})', remedy='Correct the taxel, or rows and cols.')


def _check_unique_taxels(layout: SkinLayout) -> None:
    keys: dict[tuple[int, int], str] = {}
    for key, row, col in [(tpdo.key, field.row, field.col) for tpdo in layout.tpdos for field in tpdo.taxels]:
        if (first := keys.get((row, col))) is not None:
            _refuse(layout, f'{key}.taxels', expected='every taxel named once',
                    got=f'taxel ({row}, {col}) also in {first}', remedy='Remove one of the two.')
        keys[row, col] = key


def _distinct_pdos(layout: SkinLayout) -> list[TpdoLayout]:
    """Return the TPDOs, with only the first frame of each multiplexed TPDO."""
    first: dict[object, TpdoLayout] = {}
    for rank, tpdo in enumerate(layout.tpdos):
        mapping = None if tpdo.is_mpdo else tpdo.mapping
        first.setdefault((tpdo.node, tpdo.number, tpdo.cob_id, mapping) if tpdo.is_multiplexed else rank, tpdo)
    return list(first.values())


def _check_prefixes(layout: SkinLayout) -> None:
    seen = set()
    for tpdo in filter(lambda tpdo: tpdo.is_multiplexed, layout.tpdos):
        if (identity := (tpdo.node, tpdo.number, tpdo.prefix(1))) in seen:
            _refuse(layout, tpdo.key, expected='each row number, or object of an MPDO, once',
                    got=f'{tpdo.prefix(1)[-3:].hex()} again',
                    remedy='Correct first, object, sub or count.')
        seen.add(identity)


def _check_unique(layout: SkinLayout, key: str, values: list[tuple[object, str]]) -> None:
    given = [value for value, _ in values]
    for position, (value, where) in enumerate(values):
        if (first := given.index(value)) != position:
            _refuse(layout, f'{where}.{key}', expected='a different value for each TPDO',
                    got=f'{value}, as in {values[first][1]}', remedy='Give each TPDO its own.')


def _check_sync(layout: SkinLayout) -> None:
    if use := reserved_for(layout.sync_cob_id):
        _refuse(layout, 'sync_cob_id', expected='a COB-ID that SYNC may use', got=f'0x{layout.sync_cob_id:03X}: {use}',
                remedy=f'Use 0x{SYNC:03X}, unless the device is configured otherwise.')


def _refuse(layout: SkinLayout, key: str, *, expected: str, got: str, remedy: str) -> NoReturn:
    raise ConfigurationError(f'{layout.source}, key "{key}"', expected=expected, got=got, remedy=remedy)
