"""An array of taxel values -> its contact, its features, its shape with pose and size."""

import math
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import ContactPattern, PatternExtractor, as_frame
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.scale import UnitScale
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
    """Return ``value``, which must be a ``kind``."""
    if not isinstance(value, kind):
        raise InputError(name, expected=f'a {kind.__name__}', got=f'a {type(value).__name__}', remedy=remedy)
    return value


def scale_by(unit: str | None, thresholds: object) -> tuple[PressThresholds | None, UnitScale]:
    """Return ``thresholds``, and what doubts that the values are in ``unit``, which counts where these are None."""
    if thresholds is None and unit not in (None, '', *PRESS_BY_UNIT):
        raise ConfigurationError('unit of the taxel values', expected=f'one of {", ".join(PRESS_BY_UNIT)}',
                                 got=repr(unit), remedy='Convert the values, or pass thresholds in their unit.')
    if thresholds is None:
        return None, UnitScale(unit)
    return instance(thresholds, PressThresholds, 'thresholds', 'Pass PressThresholds(press, release).'), UnitScale(None)


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


def find_contact(values: ArrayLike, unit: str | None = '',
                 thresholds: PressThresholds | None = None, *, saturated: ArrayLike | None = None,
                 unmapped: ArrayLike | None = None) -> ContactPattern:
    """Return the largest contact of one frame; ``values`` are real numbers or bool, shape (rows, cols).

    NaN, infinite and masked taxels have no valid value: they are hidden, and a pad of which too much is hidden is not
    seen (`pad_seen`), so that 0 contacts do not mean that it is empty. ``unmapped`` (bool): places without a taxel,
    which hide nothing. ``saturated`` (bool): values that are lower bounds. A bool array is itself the pressed taxels.
    Pressed is what stands out of the noise of the taxels at rest, of which there must be a quarter, up to where it
    reads half of its contact. ``unit``: 'Pa' (from 2 kPa on), 'N' (from 7 mN) or '1' (on/off). None: no unit, as of
    counts; values that are 0 and a single other are on/off. '': as None, but integers are refused. ``thresholds``
    replace this rule by fixed values.

    >>> import numpy as np
    >>> int(find_contact(np.pad(np.full((2, 3), 50e3), 1), 'Pa').mask.sum())  # taxels pressed together
    6

    Raises InputError for another array, for integers without a unit and for a contact that is far too low for its unit,
    as counts are; ConfigurationError for another unit.
    """
    known, scale = scale_by(unit, thresholds)
    frame = checked_frame(values, scale)
    return PatternExtractor(known, unit=scale.unit or None).extract(frame, saturated=saturated, unmapped=unmapped)


def paper_features(contact: ContactPattern, groups: Group = Group.ALL) -> Features:
    """Return the quantities of Volf, Dvořák and Vlček for ``contact``, by name; ``groups`` limits them.

    Lengths are in taxels, angles in degrees; the names are those of `tactile features`. Raises InputError for
    something else than a contact.

    >>> import numpy as np
    >>> features = paper_features(find_contact(np.array([[True, False], [True, True]])))
    >>> features.values['N'], round(features.values['lambda5'], 6)
    (3, 2.585786)
    """
    instance(groups, Group, 'groups', 'Pass Group.ALL, or some of its members joined by |.')
    return compute_features(_contact(contact).mask, groups)


class Recogniser:
    """Recognises the shape of a contact; reads its weights once, when it is made.

    ``method``: 'learned', or 'volf' for the paper's three planes. ``file``: other weights or curves than the
    package's own, such as one of `tactile teach` or `tactile assess`. Raises ConfigurationError for an unknown method
    or a file that cannot be used.

    >>> import numpy as np
    >>> Recogniser().recognise(find_contact(np.pad(np.full((7, 7), 50e3), 4))).shape.value
    'square'
    """

    def __init__(self, method: str = DEFAULT_METHOD, file: str | Path | None = None):
        self.method = make_recogniser(method, str(file or ''))  #: the same without checks, for a ContactPipeline

    @property
    def classes(self) -> tuple[ShapeClass, ...]:
        """Every class that a recognition gives a probability, taught shapes last."""
        return self.method.classes

    def recognise(self, contact: ContactPattern) -> Recognition:
        """Return the most probable shape and the probability of each. Raises InputError for anything but a contact.

        NONE where the pad was seen and nothing presses it. `reason` says why a shape is UNKNOWN: not seen, unfamiliar
        or too small. Where hidden taxels could change the answer, its confidence stays below 0.9.
        """
        return self.method.recognise(_contact(contact))


def fit_shape(contact: ContactPattern, shape: ShapeClass, pitch: float = 1.0,
              response: str | Path | SkinResponse | None = None) -> ShapeFit | None:
    """Return pose and size of ``contact`` as a ``shape``, with covariance; None for NONE, UNKNOWN and TaughtShapes.

    ``pitch``: distance of neighbouring taxels; all lengths come in its unit. Values that are 0 or one other number are
    taken as on/off. ``response``: file of `tactile calibrate`, whose curve the values have already passed; lengths in
    metres. Raises InputError where the contact has no taxel, or for an unknown shape; ConfigurationError for
    a pitch that is no length > 0.

    >>> import numpy as np
    >>> from tactile_node import Shape
    >>> found = fit_shape(find_contact(np.pad(np.full((7, 7), 50e3), 4)), Shape.SQUARE, pitch=0.004)
    >>> [round(1000 * length) for length in (*found.centre, *found.dimensions)]
    [28, 28, 28]
    """
    shape = known_shape(shape)
    known = known_response(response)
    return fit_contact(_contact(contact), shape, pitch, None if known is None else known.layer)


def contact_box(contact: ContactPattern, pitch: float = 1.0) -> ContactBox:
    """Return the least rectangle around ``contact``, whatever its shape, with deviations; NaN without a contact.

    ``pitch`` as in `fit_shape`. What the pad's edge or hidden taxels cut is a bound. Raises InputError for something
    else than a contact, ConfigurationError for a pitch that is no length > 0.

    >>> import numpy as np
    >>> box = contact_box(find_contact(np.pad(np.full((3, 9), 50e3), 4)), pitch=0.004)
    >>> [round(1000 * length) for length in box.lengths], box.length_is_bound
    ([36, 12], (False, False))
    """
    return box.contact_box(_contact(contact), pitch)


def _contact(contact: object) -> ContactPattern:
    return instance(contact, ContactPattern, 'contact', 'Pass what find_contact returns.')


if TYPE_CHECKING:
    from matplotlib.axes import Axes

INVALID = 'grey'  #: a colour that inferno has not

def plot_frame(values: ArrayLike, fit: ShapeFit | None = None, pitch: float = 1.0,
               axes: 'Axes | None' = None) -> 'Axes':
    """Draw a frame, shape (rows, cols), and the outline of ``fit``; return the axes.

    ``pitch`` as given to `fit_shape`. ``axes``: matplotlib's, None for those of the current figure. Row 0 is at the
    bottom, taxel (row, col) at x = col * pitch, y = row * pitch. A taxel without a valid value is grey. Raises
    InputError for another array, ConfigurationError for a pitch that is no length > 0 and without matplotlib.

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
    """Import matplotlib when it is needed: it is optional, and slow to import."""
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError as error:
        raise ConfigurationError('plot_frame', expected='matplotlib', got=f'no module {error.name!r}',
                                 remedy="Install it: pip install 'tactile-skin[picture]'.") from None
    return pyplot
