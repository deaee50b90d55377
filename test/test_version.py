"""The version outside a checkout: from the metadata beside the package, under either of the distribution's names."""

import re
from pathlib import Path

import pytest

from tactile_node import version

PACKAGE_XML = Path(__file__).resolve().parents[1] / 'package.xml'


def test_a_checkout_has_the_version_of_package_xml():
    written = re.search(r'<version>(.+)</version>', PACKAGE_XML.read_text(encoding='utf-8'))[1]
    assert version.package_version() == written


@pytest.mark.parametrize('distribution', ['tactile_skin', 'tactile_node'])  # pip's name, ament's name
def test_an_installation_has_the_version_of_its_own_metadata(distribution, tmp_path, monkeypatch):
    info = tmp_path / f'{distribution}-7.8.9.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {distribution}\nVersion: 7.8.9\n', encoding='utf-8')
    monkeypatch.setattr(version, 'is_checkout', lambda: False)
    monkeypatch.setattr(version, 'PACKAGE_FOLDER', tmp_path / 'tactile_node')
    assert version.package_version() == '7.8.9'


def test_without_metadata_the_version_is_unknown_and_not_that_of_another_installation(tmp_path, monkeypatch):
    monkeypatch.setattr(version, 'is_checkout', lambda: False)
    monkeypatch.setattr(version, 'PACKAGE_FOLDER', tmp_path / 'tactile_node')
    assert version.package_version() == 'unknown'
