"""Security promises of a release: a workflow runs every check with pinned actions, and loading a file runs no code."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tactile_node.errors import TactileError
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import LEARNED

ROOT = Path(__file__).resolve().parents[1]


class Intruder:
    """An object whose pickle creates a file when it is loaded."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


@pytest.mark.slow
def test_no_code_of_a_model_or_taxel_file_is_run(tmp_path):
    """SECURITY.md promises that loading runs no code, because a model or taxel file may come from anyone."""
    mark = tmp_path / 'ran'
    harmful = np.array([Intruder(mark)], dtype=object)
    np.save(tmp_path / 'taxels.npy', harmful)
    with np.load(ROOT / 'config/recogniser.npz') as model:
        np.savez(tmp_path / 'model.npz', **dict.fromkeys(model.files, harmful))
    done = subprocess.run([sys.executable, '-m', 'tactile_node.cli.main', 'classify', tmp_path / 'taxels.npy'],
                          cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and 'tactile: error' in done.stderr
    with pytest.raises(TactileError):
        make_recogniser(LEARNED, str(tmp_path / 'model.npz'))
    assert not mark.exists()
