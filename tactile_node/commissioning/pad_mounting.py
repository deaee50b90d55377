"""Find how a pad is mounted, from presses at named places.

Looking at the skin with the fingertip up, x points to the right and y to the fingertip. A pad that is mounted as its
layout says has its columns along x and its rows along y, so that its z axis points out of the skin.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.recording import PadFrames, PadGrid

#: Places that the person presses on each pad, as (x, y) in half the size of the pad. The third place lies between the
#: first two. With a third corner instead, a press at the wrong second corner would look like a mirrored pad.
PLACES: Mapping[str, tuple[float, float]] = {
    'corner at the tip, on the left': (-1.0, 1.0), 'corner at the tip, on the right': (1.0, 1.0),
    'middle of the edge at the tip': (0.0, 1.0)}
LEAST_FORCE = 1.0      #: Smallest force of a press [N].
LEAST_TIME = 0.5       #: Smallest duration of a press [s].
HELD_SHARE = 0.5       #: A press lasts while its force is above this share of its largest force.
CONTACT_SHARE = 0.25   #: A taxel belongs to a press above this share of the strongest taxel.
SECOND_SHARE = 0.3     #: Two fingers press if the second group of taxels carries this share of the first one.
MOST_OFF = 0.35        #: Largest distance between a press and its place [half sizes of the pad].
REACH = 0.75           #: Distance of a pressed corner or edge from the centre [half sizes of the pad].


class Press(NamedTuple):
    """One press of a finger."""

    pad: int                      #: number of the pad that felt the press
    place: tuple[float, float]    #: centre of the press along columns and rows, from -1 to 1


class PadMounting(NamedTuple):
    """How a pad is mounted, compared with its layout."""

    quarter_turns: int  #: quarter turns of the pad counterclockwise, 0 to 3
    is_mirrored: bool   #: True if the columns run the other way before the pad is turned

    @property
    def matrix(self) -> np.ndarray:
        """Matrix that converts (column, row) directions of the pad to (x, y), (2, 2)."""
        turn = np.linalg.matrix_power(np.array(((0, -1), (1, 0))), self.quarter_turns)
        return turn @ np.diag((-1 if self.is_mirrored else 1, 1))

    def __str__(self) -> str:
        return f'turned by {90 * self.quarter_turns} degrees' + (', mirrored' if self.is_mirrored else '')


MOUNTINGS = tuple(PadMounting(turns, is_mirrored) for is_mirrored in (False, True) for turns in range(4))


def find_press(pads: Sequence[PadFrames], where: str) -> Press:
    """Return the press in a recording whose zero has been subtracted.

    Raises
    ------
    RefusedStepError
        Raised if the press is too light, too short, or made with two fingers.
    """
    totals = [np.nansum(pad.forces, axis=(1, 2)) for pad in pads]
    number = int(np.argmax([total.max(initial=0.0) for total in totals]))
    frames, total = pads[number], totals[number]
    largest = float(total.max(initial=0.0))
    if largest < LEAST_FORCE:
        raise RefusedStepError(where, Mistake.TOO_LIGHT, expected=f'a force of at least {LEAST_FORCE:g} N',
                               got=f'{largest:.2g} N', remedy='Press harder.')
    is_held = total >= HELD_SHARE * largest
    held = float(np.ptp(frames.times[is_held]))
    if held < LEAST_TIME:
        raise RefusedStepError(where, Mistake.LET_GO_EARLY, expected=f'a press of at least {LEAST_TIME:g} s',
                               got=f'{held:.2g} s', remedy='Hold the press until the next text appears.')
    image = np.nan_to_num(np.nanmean(frames.forces[is_held], axis=0))
    groups, count = ndimage.label(image >= CONTACT_SHARE * image.max(), structure=np.ones((3, 3)))
    loads = np.sort(ndimage.sum_labels(image, groups, range(1, count + 1)))[::-1]
    if count > 1 and loads[1] >= SECOND_SHARE * loads[0]:
        raise RefusedStepError(where, Mistake.TWO_FINGERS, expected='one contact', got='two contacts',
                               remedy='Press with one finger.')
    group = 1 + int(np.argmax(ndimage.sum_labels(image, groups, range(1, count + 1))))
    row, col = ndimage.center_of_mass(image, groups, group)
    rows, cols = image.shape
    return Press(number, (2 * col / (cols - 1) - 1, 2 * row / (rows - 1) - 1))


def find_mounting(presses: Sequence[Press], where: str) -> tuple[int, PadMounting]:
    """Return the number of the pad that was pressed at PLACES, and how it is mounted.

    Raises
    ------
    RefusedStepError
        Raised if the presses were felt by different pads, or do not lie at PLACES for any mounting.
    """
    if len({press.pad for press in presses}) > 1:
        raise RefusedStepError(where, Mistake.WRONG_PAD, expected='all presses on one pad', got='presses on both pads',
                               remedy='In the repeat, press only the pad that the text names.')
    pressed = np.array([press.place for press in presses])
    wanted = np.array(list(PLACES.values())) * REACH
    errors = [np.abs(pressed @ each.matrix.T - wanted).max() for each in MOUNTINGS]
    best = int(np.argmin(errors))
    if errors[best] > MOST_OFF:
        raise RefusedStepError(where, Mistake.WRONG_CORNER, expected='presses at ' + ', '.join(PLACES),
                               got='places that do not match these for any way to mount the pad',
                               remedy='Look at the skin with the fingertip up, and press the places in this order.')
    return presses[0].pad, MOUNTINGS[best]


def check_two_pads(first: int, second: int) -> None:
    """Raise RefusedStepError if the presses on both pads were felt by the same pad."""
    if first == second:
        raise RefusedStepError('presses on the right pad', Mistake.WRONG_PAD, expected='the other pad to feel them',
                               got='the pad that felt the presses on the left pad',
                               remedy='In the repeat, press the places of each pad again.')


def taxel_places(grid: PadGrid, mounting: PadMounting) -> np.ndarray:
    """Return the place of each taxel from the centre of the pad, seen with the fingertip up, (rows, cols, 2) [m]."""
    cols, rows = np.meshgrid(np.arange(grid.cols) - (grid.cols - 1) / 2, np.arange(grid.rows) - (grid.rows - 1) / 2)
    places: np.ndarray = np.stack((cols, rows), axis=-1) * grid.pitch @ mounting.matrix.T
    return places
