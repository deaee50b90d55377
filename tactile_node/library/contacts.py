"""Find the contact in an array of taxel values, with its features and its shape, pose and size."""

import math
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import ContactPattern, PatternExtractor, as_frame
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.unit_scale import UnitScale
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.helmholtz.features import Features, Group, compute_features
from tactile_node.learning.response import SkinResponse, load_response
from tactile_node.pose import box
from tactile_node.pose.box import ContactBox
from tactile_node.pose.fit import ShapeFit, fit_contact
from tactile_node.pose.moments import check_pitch
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import DEFAULT_METHOD, Recognition, Shape, ShapeClass, TaughtShape
from tactile_node.taxel_frame import PRESS_BY_UNIT

Kind = TypeVar('Kind')


def instance(value: object, kind: type[Kind], name: str, remedy: str) -> Kind:
    """Return ``value`` if it is a ``kind``, or raise an InputError with ``name`` and ``remedy``."""
    if not isinstance(value, kind):
        raise InputError(name, expected=f'a {kind.__name__}', got=f'a {type(value).__name__}', remedy=remedy)
    return value


def plain(value: Any) -> Any:
    """Return a NumPy scalar or an array without dimensions, such as `np.load` returns it, as a Python object."""
    return value.item() if isinstance(value, np.ndarray | np.generic) and value.ndim == 0 else value


def scale_by(unit: str | None, thresholds: object) -> tuple[PressThresholds | None, UnitScale]:
    """Return the thresholds to apply, and an object that checks whether values are plausible in their unit.

    The unit is used only if there are no thresholds.

    Parameters
    ----------
    unit : str or None
        Unit of the values.
    thresholds : PressThresholds or None
        Fixed thresholds.

    Raises
    ------
    ConfigurationError
        Raised if the unit is unknown.
    InputError
        Raised if ``thresholds`` has the wrong type.
    """
    unit = plain(unit)
    if thresholds is None and not (unit is None or isinstance(unit, str) and unit in ('', *PRESS_BY_UNIT)):
        raise ConfigurationError('unit of the taxel values', expected=f'one of {", ".join(PRESS_BY_UNIT)}',
                                 got=repr(unit), remedy='Convert the values, or pass thresholds in their unit.')
    if thresholds is None:
        return None, UnitScale(unit)
    return instance(thresholds, PressThresholds, 'thresholds', 'Pass PressThresholds(press, release).'), UnitScale(None)


def known_response(response: object, unit: str | None = None) -> SkinResponse | None:
    """Return the response of a skin.

    Parameters
    ----------
    response : str, Path, SkinResponse or None
        Path of the response file, its content, or None for no response.
    unit : str or None
        Unit of the readings, or None if unknown.

    Raises
    ------
    ConfigurationError
        Raised if the response is for another unit.
    InputError
        Raised if ``response`` has the wrong type.
    """
    if response is None:
        return None
    if not isinstance(response, str | Path | SkinResponse):
        raise InputError('response', expected='the path of a file', got=f'a {type(response).__name__}',
                         remedy='Pass the file that `tactile calibrate` has written, or None.')
    found = response if isinstance(response, SkinResponse) else load_response(response)
    if unit and unit != found.unit:
        raise ConfigurationError('response', expected=f'a response to readings in {unit!r}',
                                 got=f'one in {found.unit!r}',
                                 remedy='Pass the unit of the readings with which the skin was calibrated.')
    return found


def checked_frame(values: ArrayLike, scale: UnitScale) -> np.ndarray:
    """Return ``values`` as a frame.

    Raises
    ------
    InputError
        Raised if the values may be counts, or are implausible in their unit.
    """
    frame = as_frame(values)
    if scale.unit == '' and np.asarray(values).dtype.kind in 'iu':
        raise InputError('unit', expected='a unit for integers, which may be counts', got='none',
                         remedy="Pass unit='Pa', 'N' or '1'. For counts, pass unit=None or convert them.")
    check_values(frame, scale.unit)
    if error := scale.doubt(frame):
        raise error
    return frame


def check_values(frame: np.ndarray, unit: str | None) -> None:
    """Raise InputError if the values of ``frame`` cannot be in ``unit``.

    The check exists because on/off values and pressures are easily confused.
    """
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
    """Return the Shape with this name, or a taught shape unchanged."""
    if isinstance(shape, TaughtShape):
        return shape
    try:
        return Shape(shape)
    except ValueError:
        raise InputError('shape', expected=f'a Shape: one of {", ".join(each.value for each in Shape)}',
                         got=repr(shape), remedy='Pass the shape of a recognition, or one of Shape.') from None


def seconds(stamp: object) -> float:
    """Return ``stamp`` as a float, or raise InputError if ``stamp`` is not a finite number."""
    number = plain(stamp)
    if isinstance(number, int | float) and math.isfinite(number):
        return float(number)
    raise InputError('stamp', expected='the time of the frame in seconds', got=repr(stamp),
                     remedy='Pass a finite number, for example time.time() at the acquisition.')


def find_contact(values: ArrayLike, unit: str | None = '',
                 thresholds: PressThresholds | None = None, *, saturated: ArrayLike | None = None,
                 unmapped: ArrayLike | None = None) -> ContactPattern:
    """Return the largest contact of one frame.

    A taxel is pressed if its value stands out from the noise of the resting taxels. At least a quarter of the taxels
    must be at rest. The contact ends where its taxels read less than half of the contact's own level. With
    ``thresholds``, fixed values replace these rules. In a Boolean array, True marks a pressed taxel.

    Taxels that are NaN, infinite or masked have no valid value and count as hidden. If too many taxels are hidden, the
    pad is not seen (`pad_seen`), and the absence of contacts does not mean that the pad is empty.

    Parameters
    ----------
    values : array_like
        Taxel values, real numbers or bool, (rows, cols).
    unit : str or None
        Unit of the values: 'Pa' (contacts of 2 kPa or more), 'N' (contacts of 7 mN or more) or '1' (on/off). None means
        that the values have no unit, like counts. Values without a unit are on/off if they contain only 0 and one other
        number. The unit '' has the same meaning as None, except that integers are refused.
    thresholds : PressThresholds or None
        Fixed thresholds.
    saturated : array_like or None
        Taxels whose value is a lower bound, bool (rows, cols).
    unmapped : array_like or None
        Cells without a taxel, which hide nothing, bool (rows, cols).

    Raises
    ------
    InputError
        Raised if an array is invalid, if integers are passed without a unit, or if the values of a contact are far too
        low for the unit, as counts would be.
    ConfigurationError
        Raised if the unit is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> int(find_contact(np.pad(np.full((2, 3), 50e3), 1), 'Pa').mask.sum())  # taxels pressed together
    6
    """
    known, scale = scale_by(unit, thresholds)
    frame = checked_frame(values, scale)
    return PatternExtractor(known, unit=scale.unit or None).extract(frame, saturated=saturated, unmapped=unmapped)


def paper_features(contact: ContactPattern, groups: Group = Group.ALL) -> Features:
    """Return the quantities of Volf, Dvořák and Vlček for a contact, by name.

    Parameters
    ----------
    contact : ContactPattern
        Result of `find_contact`.
    groups : Group
        Features to compute.

    Returns
    -------
    Features
        Lengths are in taxels and angles in degrees. The names are those of `tactile features`.

    Raises
    ------
    InputError
        Raised if ``contact`` is not a ContactPattern.

    Examples
    --------
    >>> import numpy as np
    >>> features = paper_features(find_contact(np.array([[True, False], [True, True]])))
    >>> features.values['N'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    instance(groups, Group, 'groups', 'Pass Group.ALL, or some of its members joined by |.')
    return compute_features(_contact(contact).mask, groups)


class Recogniser:
    """Recognises the shape of a contact. The weights are read once, when the object is created.

    Parameters
    ----------
    method : str
        'learned', or 'volf' for the three planes of the paper.
    file : str, Path or None
        File with other weights or curves, such as a file from `tactile teach` or `tactile assess`, or None for the
        package's own file.

    Raises
    ------
    ConfigurationError
        Raised if the method does not exist or the file cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> Recogniser().recognise(find_contact(np.pad(np.full((7, 7), 50e3), 4))).shape.value
    'square'
    """

    def __init__(self, method: str = DEFAULT_METHOD, file: str | Path | None = None):
        #: the recogniser without argument checks, for a ContactPipeline
        self.method = make_recogniser(method, str(file or ''))

    @property
    def classes(self) -> tuple[ShapeClass, ...]:
        """All classes that get a probability, with the taught shapes last."""
        return self.method.classes

    def recognise(self, contact: ContactPattern) -> Recognition:
        """Return the most probable shape of a contact, and the probability of each class.

        The shape is NONE if the pad was seen and nothing presses it. If the shape is UNKNOWN, `reason` states why, for
        example not seen, unfamiliar or too small. If hidden taxels could change the shape, the confidence usually stays
        below 0.9.

        Raises
        ------
        InputError
            Raised if ``contact`` is not a ContactPattern.
        """
        return self.method.recognise(_contact(contact))


def fit_shape(contact: ContactPattern, shape: ShapeClass, pitch: float = 1.0,
              response: str | Path | SkinResponse | None = None) -> ShapeFit | None:
    """Return the pose and size of a contact, with their covariance.

    Values that contain only 0 and one other number are treated as on/off.

    Parameters
    ----------
    contact : ContactPattern
        Result of `find_contact`.
    shape : Shape
        Shape to fit.
    pitch : float
        Distance between neighbouring taxels. All lengths have the unit of the pitch.
    response : str, Path or None
        Response file from `tactile calibrate`, if its curve has been applied to the values. With a response, lengths
        must be in metres.

    Returns
    -------
    ShapeFit or None
        The fit, or None for NONE, UNKNOWN and taught shapes.

    Raises
    ------
    InputError
        Raised if the contact has no taxel, or the shape is unknown.
    ConfigurationError
        Raised if the pitch is not a finite length above 0.

    Examples
    --------
    >>> import numpy as np
    >>> from tactile_node import Shape
    >>> found = fit_shape(find_contact(np.pad(np.full((7, 7), 50e3), 4)), Shape.SQUARE, pitch=0.004)
    >>> [round(1000 * length) for length in (*found.centre, *found.dimensions)]
    [28, 28, 28]
    """
    shape = known_shape(shape)
    known = known_response(response)
    return fit_contact(_contact(contact), shape, plain(pitch), None if known is None else known.layer)


def contact_box(contact: ContactPattern, pitch: float = 1.0) -> ContactBox:
    """Return the smallest rectangle around a contact of any shape, with standard deviations.

    Every number in the result is NaN if there is no contact.

    If the pad's edge or hidden taxels cut off the contact, each affected length is a bound.

    Parameters
    ----------
    contact : ContactPattern
        Result of `find_contact`.
    pitch : float
        Distance between neighbouring taxels. All lengths have the unit of the pitch.

    Raises
    ------
    InputError
        Raised if ``contact`` is not a ContactPattern.
    ConfigurationError
        Raised if the pitch is not a finite length above 0.

    Examples
    --------
    >>> import numpy as np
    >>> box = contact_box(find_contact(np.pad(np.full((3, 9), 50e3), 4)), pitch=0.004)
    >>> [round(1000 * length) for length in box.lengths], box.length_is_bound
    ([36, 12], (False, False))
    """
    return box.contact_box(_contact(contact), plain(pitch))


def _contact(contact: object) -> ContactPattern:
    return instance(contact, ContactPattern, 'contact', 'Pass the result of find_contact.')


if TYPE_CHECKING:
    from matplotlib.axes import Axes

INVALID = 'grey'  #: Colour of a taxel without a valid value. The colour map inferno does not contain grey.

def plot_frame(values: ArrayLike, fit: ShapeFit | None = None, pitch: float = 1.0,
               axes: 'Axes | None' = None) -> 'Axes':
    """Draw a frame and the outline of a fit.

    Row 0 is at the bottom. Taxel (row, col) is at x = col * pitch, y = row * pitch. A taxel without a valid value is
    grey.

    Parameters
    ----------
    values : array_like
        Taxel values, (rows, cols).
    fit : ShapeFit or None
        Fit to draw.
    pitch : float
        Pitch passed to `fit_shape`.
    axes : Axes or None
        Matplotlib axes, or None for the axes of the current figure.

    Returns
    -------
    Axes
        The axes.

    Raises
    ------
    InputError
        Raised if the array is invalid.
    ConfigurationError
        Raised if the pitch is not a finite length above 0, or matplotlib is not installed.

    Examples
    --------
    >>> import numpy as np, matplotlib
    >>> matplotlib.use('Agg')
    >>> [round(float(edge), 3) for edge in plot_frame(np.zeros((16, 12)), pitch=0.004).get_xlim()]
    [-0.002, 0.046]
    """
    check_pitch(pitch)
    frame = as_frame(values)
    pyplot = _pyplot()
    axes = pyplot.gca() if axes is None else axes
    rows, cols = frame.shape
    left, right, bottom, top = (pitch * (edge - 0.5) for edge in (0, cols, 0, rows))
    colours = pyplot.get_cmap('inferno').with_extremes(bad=INVALID)
    axes.imshow(frame.astype(float), origin='lower', extent=(left, right, bottom, top), cmap=colours)
    axes.set_xlabel('x, in the unit of the pitch')
    axes.set_ylabel('y, in the unit of the pitch')
    if fit is not None:
        axes.plot(*np.vstack((fit.outline, fit.outline[:1])).T, color='cyan')
        axes.set_title(fit.shape.value)
    return axes


def _pyplot() -> ModuleType:
    """Import matplotlib only when it is needed, because it is optional and slow to import."""
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError as error:
        raise ConfigurationError('plot_frame', expected='matplotlib', got=f'no module {error.name!r}',
                                 remedy="Install it: pip install 'tactile-skin[picture]'.") from None
    return pyplot
