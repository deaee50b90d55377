"""Checks of what a program passes to the library: a wrong argument is refused, with expected, got and remedy."""

import math
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.calibration.response import SkinResponse, load_response
from tactile_node.contact.pattern import PatternExtractor, as_frame
from tactile_node.contact.press import PRESS_BY_UNIT, PressThresholds
from tactile_node.contact.scale import UnitScale
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.shape.recognition import Shape, ShapeClass, TaughtShape

Kind = TypeVar('Kind')


def instance(value: object, kind: type[Kind], name: str, remedy: str) -> Kind:
    """Return ``value``, which must be a ``kind``."""
    if not isinstance(value, kind):
        raise InputError(name, expected=f'a {kind.__name__}', got=f'a {type(value).__name__}', remedy=remedy)
    return value


def extractor_by(unit: str | None, thresholds: object) -> tuple[PatternExtractor, UnitScale]:
    """Return what finds contacts by ``thresholds``, or where they are None by ``unit``, and what doubts the unit."""
    if thresholds is None and unit not in (None, '', *PRESS_BY_UNIT):
        raise ConfigurationError('unit of the taxel values', expected=f'one of {", ".join(PRESS_BY_UNIT)}',
                                 got=repr(unit), remedy='Convert the values, or pass thresholds in their unit.')
    if thresholds is None:
        return PatternExtractor(unit=unit or None), UnitScale(unit)
    known = instance(thresholds, PressThresholds, 'thresholds', 'Pass PressThresholds(press, release).')
    return PatternExtractor(known), UnitScale(None)


def known_response(response: object, unit: str | None = None) -> SkinResponse | None:
    """Return what ``response``, the path of a file, what is in it, or None, stands for.

    Raises ConfigurationError where it is of another ``unit``.
    """
    if response is None:
        return None
    if not isinstance(response, str | Path | SkinResponse):
        raise InputError('response', expected='the path of a file', got=f'a {type(response).__name__}',
                         remedy='Pass the file that `tactile calibrate` has written, or None.')
    found = response if isinstance(response, SkinResponse) else load_response(response)
    if unit and found.unit and unit != found.unit:
        raise ConfigurationError('response', expected=f'one to readings in {unit!r}', got=f'one in {found.unit!r}',
                                 remedy='Pass the unit of the readings that it was found from.')
    return found


def checked_frame(values: ArrayLike, scale: UnitScale) -> np.ndarray:
    """Return ``values`` as a frame. Raises InputError where they may be counts, or cannot be of their unit."""
    frame = as_frame(values)
    if scale.unit == '' and np.asarray(values).dtype.kind in 'iu':
        raise InputError('unit', expected='one for integers, which may be counts', got='none',
                         remedy="Pass unit='Pa', 'N' or '1'; for counts unit=None, or convert them.")
    check_values(frame, scale.unit)
    if error := scale.doubt(frame):
        raise error
    return frame


def check_values(frame: np.ndarray, unit: str | None) -> None:
    """Raise InputError where the values of ``frame`` cannot be in ``unit``: on/off and pressure are mistaken easily."""
    if frame.dtype == bool or unit not in ('Pa', '1'):
        return
    finite = frame[np.isfinite(frame)]
    is_on_off = bool(((finite == 0) | (finite == 1)).all())
    if unit == 'Pa' and is_on_off and finite.any():
        raise InputError('taxel frame', expected='pressures in pascal', got='the numbers 0 and 1 only',
                         remedy="Pass a bool array, or unit='1', for on/off taxels.")
    if unit == '1' and not ((finite >= 0) & (finite <= 1)).all():
        raise InputError('taxel frame', expected='on/off values between 0 and 1',
                         got=f'values from {finite.min():g} to {finite.max():g}',
                         remedy='Pass a bool array, or thresholds in the unit of the values.')


def known_shape(shape: object) -> ShapeClass:
    """Return the Shape of that name; one that was taught as it is."""
    if isinstance(shape, TaughtShape):
        return shape
    try:
        return Shape(shape)
    except ValueError:
        raise InputError('shape', expected=f'a Shape: one of {", ".join(each.value for each in Shape)}',
                         got=repr(shape), remedy='Pass the shape of a recognition, or one of Shape.') from None


def seconds(stamp: object) -> float:
    """Return ``stamp``, which must be a finite number."""
    if isinstance(stamp, (int, float, np.integer, np.floating)) and math.isfinite(stamp):
        return float(stamp)
    raise InputError('stamp', expected='the time of the frame in seconds', got=repr(stamp),
                     remedy='Pass a finite number, for example time.time() at the acquisition.')
