"""Draw contacts with exact orientation, place, size, aspect ratio and pressure, to search for blind spots.

This module and the training must not import each other.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, Contact, random_contact

AREAS = 16.0, 200.0    #: Range of the log-uniform areas in cells that do not vary the size [taxels].

#: Nominal conditions, the same as in training.field.
PRESSURE = 0.5
TILT = 0.2
BLUR = 0.5
NOISE = 0.01
MARGIN = 4             #: Margin around a contact [taxels].

#: Angles of the contacts, to which a random number of quarter turns is added [degrees].
ANGLES = range(0, 91, 5)
#: Offsets of the centre of area from a taxel's centre, along rows and columns [pitches].
PLACES = (0.0, 0.25, 0.5)
WIDTHS = (8, 10, 12, 14, 16, 18, 20, 24, 32, 48, 64)  #: Lengths of the longest side or diameter [taxels].
RATIOS = {'rectangle': (1.5, 1.75, 2.0, 2.5, 3.0), 'right_triangle': (1.5, 2.0, 2.5)}
APEXES = (40, 50, 60, 75)                  #: Apex angles of isosceles triangles [degrees].
PRESSURES = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8)
ANY_ANGLE, FLAT, DIAGONAL = 'any angle', '0 degrees', '45 degrees'


class Cell(NamedTuple):
    """One cell of the search. Parameters that are None or empty are drawn at random."""

    curve: str               #: name of the varied parameter, with the parameters that are held constant
    value: float             #: value of the varied parameter
    label: str               #: label of the value
    on_off: bool
    angle: float | None = None                    #: [degrees]
    places: tuple[tuple[float, float], ...] = ()  #: possible places, from which one is drawn
    width: float | None = None
    pressure: float = PRESSURE
    shape: str = ''          #: an empty string means the five shapes in turn
    ratio: float | None = None

    @property
    def words(self) -> str:
        """The label, written on one line."""
        return self.label.replace('\n', ', ')

    def kinds(self, count: int) -> list[str]:
        """Return the shapes of ``count`` contacts."""
        return [self.shape or CLASSES[k % len(CLASSES)] for k in range(count)]


def cells() -> list[Cell]:
    """Return all cells of all curves."""
    found = []
    for on_off in (True, False):
        found += [Cell('orientation [degrees]', angle, f'{angle}', on_off, angle=angle) for angle in ANGLES]
        for name, angle in ((ANY_ANGLE, None), (FLAT, 0.0)):
            places = [(x, y) for k, x in enumerate(PLACES) for y in PLACES[k:]]
            found += [Cell(f'place in the taxel, {name}', k, f'{x:g}\n{y:g}', on_off, angle, ((x, y), (y, x)))
                      for k, (x, y) in enumerate(places)]
        exact = tuple((x, y) for x in PLACES for y in PLACES)
        for name, angle, where in ((ANY_ANGLE, None, ()), (FLAT, 0.0, exact), (DIAGONAL, 45.0, exact)):
            found += [Cell(f'width [taxels], {name}', width, f'{width}', on_off, angle, where, width)
                      for width in WIDTHS]
        for shape, ratios in RATIOS.items():
            found += [Cell(f'ratio of sides, {shape.replace("_", " ")}', ratio, f'{ratio:g}', on_off, shape=shape,
                           ratio=ratio) for ratio in ratios]
        found += [Cell('apex [degrees], isosceles triangle', apex, f'{apex}', on_off, shape='isosceles_triangle',
                       ratio=2 * float(np.tan(np.radians(apex) / 2))) for apex in APEXES]
    found += [Cell('pressure [% of full scale]', 100 * pressure, f'{100 * pressure:g}', on_off=False,
                   pressure=pressure) for pressure in PRESSURES]
    return found


def frame(cell: Cell, kind: str, rng: np.random.Generator) -> np.ndarray:
    """Draw a frame with one contact of ``kind``, either bool or float in fractions of full scale."""
    contact, side = contact_in(cell, kind, rng)
    if cell.on_off:
        return contact.pattern(side, side)
    y, x = np.indices((side, side), float)
    towards, rise = rng.uniform(0, 2 * np.pi), TILT / np.sqrt(contact.area / np.pi)
    slope = 1 + rise * (np.cos(towards) * (x - contact.x) + np.sin(towards) * (y - contact.y))
    values = ndimage.gaussian_filter(coverage(contact, side, side) * np.clip(cell.pressure * slope, 0, 1), BLUR)
    return values + NOISE * rng.standard_normal(values.shape)


def contact_in(cell: Cell, kind: str, rng: np.random.Generator) -> tuple[Contact, int]:
    """Draw a contact. Return the contact, and the side length of a square pad that has room for it [taxels]."""
    drawn = random_contact(rng, kind, float(np.exp(rng.uniform(*np.log(AREAS)))))
    dimensions = _dimensions(cell, drawn)
    angle = drawn.angle if cell.angle is None else np.radians(cell.angle) + np.pi / 2 * rng.integers(4)
    side = 2 * (int(np.ceil(Contact(kind, dimensions, 0.0, 0.0).reach)) + MARGIN) + 1
    offset = cell.places[rng.integers(len(cell.places))] if cell.places else rng.uniform(-0.5, 0.5, 2)
    x, y = (side // 2 + offset[0], side // 2 + offset[1])
    return Contact(kind, dimensions, x=float(x), y=float(y), angle=float(angle)), side


def _dimensions(cell: Cell, drawn: Contact) -> tuple[float, ...]:
    """Return the drawn dimensions, scaled to the ratio and width of the cell."""
    lengths, rest = np.array(drawn.dimensions[:2]), drawn.dimensions[2:]
    if cell.ratio is not None:
        lengths = np.sqrt(lengths.prod()) * np.array((cell.ratio ** 0.5, cell.ratio ** -0.5))
    if cell.width is not None:
        longest = 2 * lengths[0] if drawn.shape == 'circle' else lengths.max()
        lengths = lengths * (cell.width / longest)
    return (*(float(length) for length in lengths), *rest)
