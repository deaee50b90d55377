"""What is stated in two places agrees: the versions in package.xml, setup.cfg and requirements/."""

import re
from pathlib import Path
from xml.etree import ElementTree

import tactile_node

ROOT = Path(__file__).resolve().parents[1]


def test_the_version_is_that_of_package_xml():
    version = ElementTree.parse(ROOT / 'package.xml').findtext('version')
    assert tactile_node.__version__ == version


def test_the_lowest_versions_that_are_tested_are_those_that_setup_cfg_allows():
    setup = (ROOT / 'setup.cfg').read_text(encoding='utf-8')
    allowed = set(re.findall(r'([\w-]+) >= ([\d.]+)', setup))
    tested = set(re.findall(r'^([\w-]+)==([\d.]+)$', (ROOT / 'requirements/lowest.txt').read_text(), re.MULTILINE))
    assert len(allowed) == 13
    assert allowed <= tested
    assert {name for name, _ in tested} - {name for name, _ in allowed} == {'pytest', 'pytest-cov', 'setuptools',
                                                                            'py-trees', 'jsonschema'}


def test_every_lowest_version_is_a_library_of_the_lock_too():
    lock = (ROOT / 'requirements/lock.txt').read_text(encoding='utf-8')
    locked = {name.lower() for name in re.findall(r'^([\w-]+)==', lock, re.MULTILINE)}
    for name in re.findall(r'^([\w-]+)==', (ROOT / 'requirements/lowest.txt').read_text(), re.MULTILINE):
        assert name in locked


def test_every_package_of_the_lock_has_the_hashes_of_its_files():
    """Else pip would take whatever the index gives under that version."""
    lock = (ROOT / 'requirements/lock.txt').read_text(encoding='utf-8')
    packages = re.split(r'^(?=[\w-]+==)', lock, flags=re.MULTILINE)[1:]
    assert len(packages) > 150
    for package in packages:
        assert re.search(r' \\\n    --hash=sha256:[0-9a-f]{64}\b', package), package
    assert 'http' not in lock and 'index-url' not in lock
