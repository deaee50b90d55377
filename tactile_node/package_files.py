"""Find the files of this package, wherever it is installed.

In a wheel and in a ROS workspace, config/, msg/, srv/ and action/ are inside the Python package. In a checkout, these
folders are beside the Python package. In an editable install or after `colcon build --symlink-install`, links lead back
to the checkout.
"""

from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

from tactile_node.errors import ConfigurationError

PACKAGE_FOLDER = Path(__file__).parent
CHECKOUT = Path(__file__).resolve().parents[1]


def config_path(name: str) -> Path:
    """Return the path of a file in the current folder, or otherwise of the file with this name in ``config/``.

    Raises
    ------
    ConfigurationError
        Raised if neither file exists.
    """
    given = Path(name).expanduser()
    return given if given.is_file() else package_file(f'config/{name}')


def is_found(name: str) -> bool:
    """Return True if `config_path` finds ``name``."""
    try:
        config_path(name)
    except ConfigurationError:
        return False
    return True


def package_file(name: str) -> Path:
    """Return the path of a file of this package, such as 'config/sim16x16.yaml'.

    Raises
    ------
    ConfigurationError
        Raised if the package has no such file.
    """
    folders = [PACKAGE_FOLDER, *([CHECKOUT] if is_checkout() else [])]
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise ConfigurationError(
        f'file {name.removeprefix("config/")!r}', expected='an existing file, or the name of one in config/',
        got='no such file', remedy=f'Looked in the current folder and in {", ".join(map(str, folders))}.')


def is_checkout() -> bool:
    """Return True if this module is part of a checkout, which includes links to a checkout and editable installs."""
    return (CHECKOUT / 'package.xml').is_file()


#: Names of the distribution, for pip and for ament_python_install_package.
DISTRIBUTIONS = ('tactile-skin', 'tactile_node')


def package_version() -> str:
    """Return the version from package.xml, or from the metadata installed beside this package."""
    if is_checkout():
        return ElementTree.parse(CHECKOUT / 'package.xml').findtext('version', default='unknown')
    beside = [str(PACKAGE_FOLDER.parent)]
    for name in DISTRIBUTIONS:
        for distribution in metadata.distributions(name=name, path=beside):
            return distribution.version
    return 'unknown'
