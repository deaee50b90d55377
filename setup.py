"""`pip install .`: with the version of package.xml, which bloom bumps, and the files of config/ and msg/."""

import shutil
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

#: folder of package data, as a package inside tactile_node -> where it lies here
DATA = {'tactile_node.config': 'config', 'tactile_node.msg': 'msg'}


class FreshBuild(build_py):
    """Begins with an empty folder: pip keeps build/lib, and a module that was renamed would be installed for ever."""

    def run(self):
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(cmdclass={'build_py': FreshBuild},
      version=ElementTree.parse('package.xml').findtext('version'),
      packages=[*find_packages(include=['tactile_node', 'tactile_node.*']), *DATA],
      package_dir=DATA,
      package_data={'tactile_node': ['py.typed'], **{package: ['*'] for package in DATA}})
