"""`pip install .`: with the version of package.xml, which bloom bumps, and the files of config/ and msg/."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

#: folder of package data, as a package inside tactile_node -> where it lies here
DATA = {'tactile_node.config': 'config', 'tactile_node.msg': 'msg'}

setup(version=ElementTree.parse('package.xml').findtext('version'),
      packages=[*find_packages(include=['tactile_node', 'tactile_node.*']), *DATA],
      package_dir=DATA,
      package_data={'tactile_node': ['py.typed'], **{package: ['*'] for package in DATA}})
