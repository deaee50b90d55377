"""Rotate the pattern by 0, 4, ..., 180 degrees, using fictive points between the taxels (section 6 of the paper).

The x axis runs along a row (column index), and the y axis runs across rows (row index). Positive angles rotate x
towards y. Points are rotated about the centre of gravity of the real points and rounded to the nearest fine point. A
coordinate half-way between two fine points is rounded up. A coordinate within 1e-9 of half-way counts as half-way, so
that rounding errors do not affect the result. All computations use the coordinates of the pattern's bounding box. The
result is therefore bit-identical wherever the pattern lies on the pad.
"""

import math

import numpy as np

FINE = 5                       #: Number of fine steps per pitch.
ANGLES = np.arange(0, 181, 4)  #: The 46 rotation angles [degrees].
ANGLES.flags.writeable = False
TIE_TOLERANCE = 1e-9  #: Distance below a half-way point within which a coordinate is still rounded up [fine steps].

#: Number of sites, over all angles, that are processed together. The number limits the memory needed for large
#: patterns.
CHUNK_SITES = 200_000


def with_rotated(mask: np.ndarray) -> np.ndarray:
    """Return the original pattern, followed by the pattern at each of ANGLES.

    The rotated patterns are decimated, and their holes are filled.

    Parameters
    ----------
    mask : np.ndarray
        Active taxels, bool (rows, cols), at least one.

    Returns
    -------
    np.ndarray
        bool (47, rows, cols), large enough for every angle, with a ring of inactive taxels around each pattern.
    """
    original = _cropped(mask)
    stack, (row, col) = decimated(original)
    fill_holes(stack)
    stack[0, row:row + original.shape[0], col:col + original.shape[1]] = original
    return stack


def fine_lattice(mask: np.ndarray) -> np.ndarray:
    """Return real and fictive points, bool (5 rows - 4, 5 cols - 4). Taxel (r, c) is at (5r, 5c).

    In each 2×2 block, every triple of active taxels fills its right isosceles triangle, including the edges.

    >>> int(fine_lattice(np.array([[True, False], [True, True]])).sum())
    21
    """
    rows, cols = mask.shape
    block = np.zeros((rows + 1, cols + 1), np.uint8)
    for bit, (down, right) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        block[1 - down:rows + 1 - down, 1 - right:cols + 1 - right] += mask.view(np.uint8) << np.uint8(bit)
    cells = _BLOCK_POINTS[block[1:, 1:]]  # (rows, cols, 6, 6): the points of each block, including shared edges
    fine = cells[:, :, :FINE, :FINE].transpose(0, 2, 1, 3).reshape(FINE * rows, FINE * cols)
    fine[:, FINE::FINE] |= cells[:, :-1, :FINE, FINE].transpose(0, 2, 1).reshape(FINE * rows, cols - 1)
    fine[FINE::FINE] |= cells[:-1, :, FINE, :FINE].reshape(rows - 1, FINE * cols)
    return fine[:FINE * rows - FINE + 1, :FINE * cols - FINE + 1]


def decimated(mask: np.ndarray) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the decimated patterns at ANGLES, before the hole rules are applied.

    The function does not rotate every point forward. Instead, the function rotates each taxel site back. Only the four
    fine points around the resulting position can be rounded to this site, so the function rotates only these four
    points forward to check.

    Parameters
    ----------
    mask : np.ndarray
        Pattern, bool (rows, cols), cropped to its active taxels.

    Returns
    -------
    stack : np.ndarray
        bool (47, rows, cols), with a ring of inactive taxels around each pattern. The first pattern in the stack is
        left empty.
    place : tuple of int
        Row and column in the stack at which ``mask`` begins.
    """
    rows, cols = np.nonzero(mask)
    centre = FINE * np.array([cols.sum(), rows.sum()]) / len(rows)
    # Fictive points lie between real points, so they are never farther away than the real points. Rounding moves a
    # point by less than 1.
    radius = FINE * math.sqrt(((cols - centre[0] / FINE) ** 2 + (rows - centre[1] / FINE) ** 2).max()) + 1.0
    sites, first = _sites_within(centre, radius)
    col, row = sites // FINE - first[:, np.newaxis] + 1
    wide, high = int(col.max()) + 2, int(row.max()) + 2
    stack = np.zeros((len(ANGLES) + 1, high, wide), bool)
    number, place = np.arange(1, len(ANGLES) + 1)[:, np.newaxis] * (high * wide), row * wide + col
    fine, low = _corner_bits(fine_lattice(mask), centre, radius)
    step = max(1, CHUNK_SITES // sites.shape[1])
    for begin in range(0, len(ANGLES), step):
        angles = slice(begin, begin + step)
        reached = _reached(fine, sites - centre[:, np.newaxis], centre - low, angles)
        stack.reshape(-1)[(number[angles] + place).take(reached)] = True
    return stack, (1 - int(first[1]), 1 - int(first[0]))


def fill_holes(stack: np.ndarray) -> None:
    """Fill an inactive taxel between two active taxels along y, then along x, then along either diagonal, in place.

    Each rule is applied to the result of the previous rule. ``stack`` is bool (K, rows, cols) and contiguous, with a
    ring of inactive taxels around each pattern.
    """
    # Because of the ring, a single shift of the flat array reaches each neighbour. For a taxel of the ring, one of the
    # two sites beside it is also in the ring, so the ring stays inactive.
    flat, wide = stack.reshape(-1), stack.shape[2]
    for steps in ((wide,), (1,), (wide + 1, wide - 1)):
        holes = [flat[:-2 * step] & flat[2 * step:] for step in steps]
        for step, hole in zip(steps, holes):
            flat[step:-step] |= hole


def _block_points() -> np.ndarray:
    """Return the fine points of a 2×2 block by its code.

    In the code, bits 1 and 2 denote the upper left and right taxels, and bits 4 and 8 denote the lower left and right
    taxels.
    """
    row, col = np.indices((FINE + 1, FINE + 1))
    corners = {1: (0, 0), 2: (0, FINE), 4: (FINE, 0), 8: (FINE, FINE)}
    triangles = {7: row + col <= FINE, 14: row + col >= FINE, 11: col >= row, 13: row >= col}
    points = np.zeros((16, FINE + 1, FINE + 1), bool)
    for code in range(16):
        for corner, place in corners.items():
            points[code][place] |= bool(code & corner)
        for triple, triangle in triangles.items():
            points[code] |= triangle & (code & triple == triple)
    points.flags.writeable = False
    return points


_BLOCK_POINTS = _block_points()


def _cosines_and_sines() -> tuple[np.ndarray, np.ndarray]:
    """Return the cosine and sine of ANGLES, (46,). Rational values are exact, so that half-way points remain exactly
    half-way."""
    cos, sin = np.cos(np.radians(ANGLES)), np.sin(np.radians(ANGLES))
    cos[[0, 15, 30, 45]], sin[[0, 45]] = (1, 0.5, -0.5, -1), 0  # at 0, 60, 120 and 180 degrees
    return cos, sin


_COS, _SIN = _cosines_and_sines()
# matrix that rotates (x, y) back by each angle: (x or y, 46, 2)
_BACK = np.array(((_COS, _SIN), (-_SIN, _COS))).swapaxes(1, 2)


def _cropped(mask: np.ndarray) -> np.ndarray:
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return mask[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1]


def _sites_within(centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the taxel sites that a rotated point can reach, as fine (x, y), (2, n), and the first (col, row)."""
    first = np.ceil((centre - radius) / FINE).astype(int)
    cols, rows = np.floor((centre + radius) / FINE).astype(int) - first + 1
    x = FINE * (first[0] + np.arange(cols))
    y = FINE * (first[1] + np.arange(rows))
    row, col = np.nonzero((x - centre[0]) ** 2 + ((y - centre[1]) ** 2)[:, np.newaxis] <= radius * radius)
    return np.array([x[col], y[row]]), first


def _reached(fine: np.ndarray, offset: np.ndarray, centre: np.ndarray, angles: slice) -> np.ndarray:
    """Return the angles and sites at which an active point arrives, as indices into a flattened array (angles, n).

    ``offset``, (2, n), is the position of each site relative to the centre. ``fine`` comes from `_corner_bits`, and
    ``centre`` is given in the coordinates of ``fine``.
    """
    x, y = np.matmul(_BACK[:, angles], offset) + centre[:, np.newaxis, np.newaxis]
    col, row = np.floor(x), np.floor(y)
    x -= col
    y -= row
    row *= fine.shape[1]
    row += col
    bits = fine.take(row.astype(np.intp))
    some = bits != 0
    near, counts = np.flatnonzero(some), np.count_nonzero(some, axis=1)
    bits, x, y = bits.take(near), x.take(near), y.take(near)
    arrive = _rounds_onto(bits, x, y, cos=np.repeat(_COS[angles], counts), sin=np.repeat(_SIN[angles], counts))
    return near[arrive]


def _corner_bits(fine: np.ndarray, centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the active corners of each fine cell as bits, and the position (x, y) of the first cell.

    Bits 1, 2, 4 and 8 denote the corners (x, y), (x+1, y), (x, y+1) and (x+1, y+1). The array of cells covers all
    points within ``radius`` of the ``centre``.
    """
    low, wide = np.floor(centre - radius) - 1, int(2 * radius) + 5
    origin = -low.astype(int)
    room = np.zeros((wide, wide), np.uint8)
    room[origin[1]:origin[1] + fine.shape[0], origin[0]:origin[0] + fine.shape[1]] = fine
    bits = room.copy()
    bits[:, :-1] |= room[:, 1:] << 1
    bits[:-1] |= room[1:] << 2
    bits[:-1, :-1] |= room[1:, 1:] << 3
    return bits, low


def _rounds_onto(bits: np.ndarray, x: np.ndarray, y: np.ndarray, cos: np.ndarray, sin: np.ndarray) -> np.ndarray:
    """Return True if an active corner of a fine cell, after rotation, rounds to the site at (x, y) in the cell.

    ``bits`` tells which corners of the cell are active.
    """
    u = sin * y - cos * x + TIE_TOLERANCE  # position of the rotated corner (0, 0) relative to the site
    v = TIE_TOLERANCE - sin * x - cos * y
    arriving = np.zeros(len(bits), np.uint8)
    for bit, du, dv in ((1, 0, 0), (2, cos, sin), (4, -sin, cos), (8, cos - sin, cos + sin)):
        lands = np.maximum(np.abs(u + du), np.abs(v + dv)) < 0.5
        arriving |= lands.view(np.uint8) * np.uint8(bit)
    return (arriving & bits) != 0
