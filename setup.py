"""Build the package for `pip install .`.

The metadata comes from package.xml, because bloom bumps the version there. The package data is in config/, msg/, srv/
and action/.
"""

import shutil
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

PACKAGE = ElementTree.parse('package.xml')
AUTHOR = PACKAGE.find('author')
#: name of a data package inside tactile_node -> its folder in this repository
DATA = {f'tactile_node.{folder}': folder for folder in ('config', 'msg', 'srv', 'action')}


class FreshBuild(build_py):
    """Empties the build folder first, because pip keeps it and would also install modules under old names."""

    def run(self):
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(cmdclass={'build_py': FreshBuild},
      version=PACKAGE.findtext('version'),
      author=AUTHOR.text,
      author_email=AUTHOR.get('email'),
      project_urls={url.get('type').capitalize(): url.text for url in PACKAGE.iter('url')},
      long_description=Path('README.md').read_text(encoding='utf-8'),
      long_description_content_type='text/markdown',
      packages=[*find_packages(include=['tactile_node', 'tactile_node.*']), *DATA],
      package_dir=DATA,
      package_data={'tactile_node': ['py.typed', 'viewing/*.html'], **{package: ['*'] for package in DATA}})
