"""Slow and simple code that computes every quantity of the paper directly from its definition.

The module shares no code with tactile_node. The functions use nested loops over taxels, dense matrices and numpy's
dense eigenvalues.
"""

import math

import numpy as np

ANGLES = range(0, 181, 4)
EDGES = [(-1, 0), (1, 0), (0, -1), (0, 1)]
CORNERS = [(-1, -1), (-1, 1), (1, -1), (1, 1)]


def taxels(mask):
    return [(r, c) for r in range(mask.shape[0]) for c in range(mask.shape[1]) if mask[r, c]]


def entry(p, q, k):
    """Return the matrix element A(i,j) of A_k for the taxels p and q."""
    step = (q[0] - p[0], q[1] - p[1])
    if step == (0, 0):
        return 4.0 if k == 5 else 20 / 6
    if step in EDGES:
        return -1.0 if k == 5 else -4 / 6
    return -1 / 6 if k == 9 and step in CORNERS else 0.0


def dense(points, k):
    """Return the matrix A_k for the taxels ``points`` in the given order."""
    return np.array([[entry(p, q, k) for q in points] for p in points]).reshape(len(points), len(points))


def border(points, k):
    active = set(points)
    steps = EDGES if k == 5 else EDGES + CORNERS
    return [(r, c) for r, c in points if any((r + dr, c + dc) not in active for dr, dc in steps)]


def of_matrix(points, k):
    """Return the eigenvalue, the information measures and the centre of gravity of A_k for ``points``."""
    n = len(points)
    a = dense(points, k)
    s = [sum(a[i]) for i in range(n)]
    found = {'lambda': min(np.linalg.eigvalsh(a)) if n else math.nan,
             'info_sum': sum(s), 'info_sq': sum(v * v for v in s),
             'info_norm': sum(v * v for v in s) / n if n else math.nan,
             'x': math.nan, 'y': math.nan, 'V': math.nan, 'alpha': math.nan}
    lower = [(i, j) for i in range(1, n + 1) for j in range(1, i) if a[i - 1, j - 1] != 0]
    if lower:
        total = sum(a[i - 1, j - 1] for i, j in lower)
        x = sum(a[i - 1, j - 1] * (i - 1) / (n - 1) for i, j in lower) / total
        y = sum(a[i - 1, j - 1] * (j - 1) / (n - 1) for i, j in lower) / total
        found |= {'x': x, 'y': y, 'V': math.sqrt(x * x + y * y), 'alpha': math.degrees(math.atan2(x, y))}
    return found


def of_pattern(mask):
    """Return all features of one pattern, named as in the output of `tactile features`."""
    points = taxels(mask)
    found = {'N': len(points), 'P05': len(border(points, 5)), 'P09': len(border(points, 9))}
    sets = {'': points, '_border5': border(points, 5), '_border9': border(points, 9)}
    for suffix, chosen in sets.items():
        for k in (5, 9):
            found |= {f'{name}{k}{suffix}': value for name, value in of_matrix(chosen, k).items()}
    return found


def fine_points(mask):
    """Return the real and fictive points as a set of (x, y) on the fine lattice."""
    points = {(5 * c, 5 * r) for r, c in taxels(mask)}
    rows, cols = mask.shape
    for r in range(rows - 1):
        for c in range(cols - 1):
            block = [(r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)]
            for missing in range(4):
                if all(mask[p] for i, p in enumerate(block) if i != missing):
                    points |= _triangle(r, c, missing)
    return points


def _triangle(r, c, missing):
    inside = [lambda i, j: i + j >= 5, lambda i, j: i >= j, lambda i, j: j >= i, lambda i, j: i + j <= 5]
    return {(5 * c + j, 5 * r + i) for i in range(6) for j in range(6) if inside[missing](i, j)}


def rotated(mask, degrees):
    """Return the pattern after a rotation by one angle with its holes filled, as a mask with a margin of one taxel."""
    real = taxels(mask)
    cx, cy = 5 * sum(c for _, c in real) / len(real), 5 * sum(r for r, _ in real) / len(real)
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    kept = set()
    for x, y in fine_points(mask):
        # A value half-way between two fine points (within 1e-9) is rounded up.
        rotated_x = math.floor(cx + cos * (x - cx) - sin * (y - cy) + 0.5 + 1e-9)
        rotated_y = math.floor(cy + sin * (x - cx) + cos * (y - cy) + 0.5 + 1e-9)
        if rotated_x % 5 == 0 and rotated_y % 5 == 0:
            kept.add((rotated_x // 5, rotated_y // 5))
    return _as_mask(_filled(kept))


def _filled(points):
    # Rules 1 to 3 fill holes along y, along x, and along both diagonals.
    for axes in ([(0, 1)], [(1, 0)], [(1, 1), (1, -1)]):
        points = points | {(x + dx, y + dy) for dx, dy in axes for x, y in points
                           if (x + 2 * dx, y + 2 * dy) in points}
    return points


def _as_mask(points):
    if not points:
        return np.zeros((3, 3), bool)
    left, top = min(x for x, _ in points), min(y for _, y in points)
    mask = np.zeros((max(y for _, y in points) - top + 3, max(x for x, _ in points) - left + 3), bool)
    for x, y in points:
        mask[y - top + 1, x - left + 1] = True
    return mask


def over_rotations(mask):
    """Return (min, max, dif) of every feature over those of the 46 angles at which the feature is defined."""
    each = [of_pattern(rotated(mask, degrees)) for degrees in ANGLES]
    result = {}
    for name in each[0]:
        values = [features[name] for features in each if not math.isnan(features[name])]
        result[name] = (min(values), max(values), max(values) - min(values)) if values else None
    return result
