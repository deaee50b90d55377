"""Make a Debian package from the canopen library in this environment, for robots with apt but without pip.

Run `make deb`, or: python tools/make_canopen_deb.py dist. The package works with every Python version in Debian and
Ubuntu.
"""

import re
import subprocess
import sys
import tempfile
from importlib.metadata import Distribution, distribution
from pathlib import Path

DEPENDS = {'python-can>=3.0.0': 'python3-can (>= 3.0.0)'}  #: Maps each requirement of canopen to a Debian package.

#: The package omits these files, because they would let pip uninstall files that apt installed.
OF_PIP = {'INSTALLER', 'RECORD', 'REQUESTED', 'direct_url.json'}
CONTROL = """Package: python3-canopen
Version: {version}
Architecture: all
Section: python
Priority: optional
Maintainer: tactile_skin maintainers <maintainers@tactile-skin.org>
Depends: python3, {depends}
Homepage: https://github.com/canopen-python/canopen
Description: {summary}
 Built by tactile_skin from the files on PyPI, which contain the licence.
"""


def control(canopen: Distribution) -> str:
    """Return the text of the control file. Raises KeyError if a requirement has no Debian package in DEPENDS."""
    needed = [re.sub('[ ()]', '', each) for each in canopen.requires or () if 'extra ==' not in each]
    return CONTROL.format(version=canopen.version, summary=canopen.metadata['Summary'],
                          depends=', '.join(DEPENDS[each] for each in needed))


def make(folder: Path) -> Path:
    """Write the Debian package to ``folder``, and return the path of the package."""
    canopen = distribution('canopen')
    path = folder / f'python3-canopen_{canopen.version}_all.deb'
    with tempfile.TemporaryDirectory() as root:
        for file in canopen.files or ():
            if file.suffix != '.pyc' and file.name not in OF_PIP:
                target = Path(root, 'usr/lib/python3/dist-packages', file)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(file.read_binary())
        Path(root, 'DEBIAN').mkdir()
        Path(root, 'DEBIAN/control').write_text(control(canopen), encoding='utf-8')
        Path(root).chmod(0o755)
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(['dpkg-deb', '--root-owner-group', '--build', root, path], check=True)
    return path


if __name__ == '__main__':
    make(Path(sys.argv[1]))
