"""Writes a figure of matplotlib to the file that an option names."""

from pathlib import Path
from typing import TYPE_CHECKING

from tactile_node.errors import InputError
from tactile_node.output_file import output_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figure(path: str | Path, figure: 'Figure') -> None:
    """Write ``figure`` in the format of the suffix. Raises InputError for a suffix that matplotlib does not know."""
    try:
        with output_file(path) as stream:
            figure.savefig(stream, format=Path(path).suffix[1:] or 'png', dpi=110)
    except ValueError as error:
        raise InputError(f'picture {str(path)!r}', expected='a format that matplotlib writes, such as .png',
                         got=str(error).splitlines()[0], remedy='Give another suffix.') from None
