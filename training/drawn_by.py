"""Record which version of the code drew the samples in a folder."""

from pathlib import Path

from tactile_node.errors import ConfigurationError
from training.code_digest import code_digest

ROOT = Path(__file__).resolve().parents[1]
DRAWING = ('training', 'training/ground_truth',
           *(f'tactile_node/{room}' for room in ('contact', 'pose', 'shape', 'simulator')))


def claim(folder: Path) -> None:
    """Mark the samples in a folder as drawn by this version. Raise ConfigurationError if another version drew them.

    Without this check, the weights could name this version although another version drew their samples or began their
    training.
    """
    mark, now = folder / 'drawn_by', _digest()
    before = mark.read_text() if mark.exists() else '' if any(folder.glob('*')) else now
    if before != now:
        raise ConfigurationError(f'samples in {folder}', expected=f'those drawn by this code ({now})',
                                 got=f'those drawn by {before or "unknown code"}',
                                 remedy='Delete the folder, or choose an empty folder with --samples.')
    folder.mkdir(parents=True, exist_ok=True)
    mark.write_text(now)


def _digest() -> str:
    """Return a short digest of all code on which samples and networks depend."""
    return code_digest(path for folder in DRAWING for path in (ROOT / folder).glob('*.py'))
