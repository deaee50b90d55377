"""Write a figure of matplotlib to the file that an option names."""

from pathlib import Path
from typing import TYPE_CHECKING

from tactile_node.errors import InputError
from tactile_node.output_file import output_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_figure(path: str | Path) -> None:
    """Check that matplotlib can write a figure with the suffix of ``path``.

    Call this before touches are recorded, because an error after the recording would lose them.

    Raises
    ------
    InputError
        If matplotlib does not support the suffix.
    ModuleNotFoundError
        If matplotlib is not installed.
    """
    from matplotlib.backend_bases import FigureCanvasBase  # optional, and slow to import

    formats = FigureCanvasBase.get_supported_filetypes()
    if _format_of(path) not in formats:
        raise InputError(f'picture {str(path)!r}', expected='a format that matplotlib writes: ' + ', '.join(formats),
                         got=_format_of(path), remedy='Use another suffix.')


def write_figure(path: str | Path, figure: 'Figure') -> None:
    """Write ``figure`` in the format of the suffix of ``path``, or as PNG if it has none."""
    with output_file(path) as stream:
        figure.savefig(stream, format=_format_of(path), dpi=110)


def _format_of(path: str | Path) -> str:
    return Path(path).suffix[1:].lower() or 'png'
