"""Store solved indenters on disk. Solving a pool takes a minute, so all training runs read the same file."""

from pathlib import Path

import numpy as np

from tactile_node.simulator import world
from tactile_node.taxel_frame import read_only
from training.code_digest import code_digest
from training.ground_truth import contact_solver, half_space, indenters, mechanics
from training.ground_truth.mechanics import Solution

SCALARS = ('kind', 'label', 'cell', 'origin', 'filled', 'compression', 'tilt')


def source_digest() -> str:
    """Return a short digest of the solver's code. A pool from another version of the code is not read."""
    own = Path(__file__).with_name('mechanics.py')
    paths = [own, *(Path(module.__file__) for module in (contact_solver, half_space, indenters, mechanics, world))]
    return code_digest(paths)


def write_solutions(path: Path, solutions: list[Solution]) -> None:
    """Write the solutions into one file, with the pressures as float32."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix('.part.npz')
    arrays = {name: np.array([getattr(solution, name) for solution in solutions]) for name in SCALARS}
    np.savez(unfinished, shapes=np.array([solution.pressure.shape for solution in solutions]),
             pressures=np.concatenate([solution.pressure.reshape(-1) for solution in solutions]).astype(np.float32),
             corners=np.array([len(solution.outline) for solution in solutions]),
             outlines=np.concatenate([solution.outline for solution in solutions]), **arrays)
    unfinished.rename(path)


def read_solutions(path: Path) -> list[Solution]:
    """Return the solutions written by `write_solutions`."""
    with np.load(path) as data:
        shapes, columns = data['shapes'], [data[name].tolist() for name in SCALARS]
        pressures = np.split(data['pressures'], np.cumsum(shapes.prod(1))[:-1])
        outlines = np.split(data['outlines'], np.cumsum(data['corners'])[:-1])
    solutions = []
    for pressure, shape, outline, row in zip(pressures, shapes, outlines, zip(*columns)):
        known = dict(zip(SCALARS, row))
        known |= {'origin': tuple(known['origin']), 'tilt': tuple(known['tilt'])}
        solutions.append(Solution(pressure=read_only(pressure.reshape(shape).astype(float)),
                                  outline=read_only(outline.copy()), **known))
    return solutions
