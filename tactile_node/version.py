"""The version of this package. Its one source is package.xml, where bloom bumps it."""

from importlib import metadata
from xml.etree import ElementTree

from tactile_node.package_files import CHECKOUT, PACKAGE_FOLDER, is_checkout

#: what pip calls the distribution, and what ament_python_install_package calls it
DISTRIBUTIONS = ('tactile-skin', 'tactile_node')


def package_version() -> str:
    """Return the version in package.xml, or in the metadata that was made of it and installed beside this package."""
    if is_checkout():
        return ElementTree.parse(CHECKOUT / 'package.xml').findtext('version', default='unknown')
    beside = [str(PACKAGE_FOLDER.parent)]
    for name in DISTRIBUTIONS:
        for distribution in metadata.distributions(name=name, path=beside):
            return distribution.version
    return 'unknown'
