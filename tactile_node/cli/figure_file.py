"""Write a matplotlib figure to the file named in an option."""

from pathlib import Path
from typing import TYPE_CHECKING

from tactile_node.errors import InputError
from tactile_node.output_file import output_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_figure(path: str | Path) -> None:
    """Check that matplotlib supports the suffix of ``path``.

    Call this function before recording touches, because an error after the recording would lose the touches.

    Raises
    ------
    InputError
        Raised if matplotlib does not support the suffix.
    ModuleNotFoundError
        Raised if matplotlib is not installed.
    """
    from matplotlib.backend_bases import FigureCanvasBase  # matplotlib is optional and slow to import

    formats = FigureCanvasBase.get_supported_filetypes()
    if _format_of(path) not in formats:
        raise InputError(f'picture {str(path)!r}', expected='a format that matplotlib writes: ' + ', '.join(formats),
                         got=_format_of(path), remedy='Use another suffix.')


def write_figure(path: str | Path, figure: 'Figure') -> None:
    """Write ``figure`` in the format given by the suffix of ``path``, or as PNG if there is no suffix."""
    with output_file(path) as stream:
        figure.savefig(stream, format=_format_of(path), dpi=110)


def _format_of(path: str | Path) -> str:
    return Path(path).suffix[1:].lower() or 'png'
