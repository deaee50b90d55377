"""What a release shows beside the code: changelog, citation, licences, workflow, promises on security."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from tactile_node.errors import TactileError
from tactile_node.shape.methods import LEARNED, make_recogniser

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ElementTree.parse(ROOT / 'package.xml')
VERSION = PACKAGE.findtext('version')
CHANGELOG = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
WORKFLOW = ROOT / '.github/workflows/ci.yml'


def sections() -> dict[str, str]:
    """Title of each section of the changelog -> its text."""
    parts = re.split(r'^(\S.*)\n-{3,}\n', CHANGELOG, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2]))


def test_the_changelog_has_a_section_for_the_version():
    """'Forthcoming' is what catkin_prepare_release renames; every other title is a version with its date (REP-132)."""
    titles = list(sections())
    assert titles[0] == 'Forthcoming' or titles[0].split()[0] == VERSION
    for title in titles[titles[0] == 'Forthcoming':]:
        assert re.fullmatch(r'\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)', title)
    for text in sections().values():
        assert re.search(r'^\* Contributors: \S', text, re.MULTILINE)


@pytest.mark.filterwarnings('ignore::DeprecationWarning')
def test_the_changelog_is_read_by_the_tool_that_bloom_uses():
    """Once 'Forthcoming' is a version: nothing of it is lost, and no markup is refused."""
    changelog = pytest.importorskip('catkin_pkg.changelog')
    released = re.sub(r'^Forthcoming\n-+$', '1.2.3 (2026-11-23)\n------------------', CHANGELOG, flags=re.MULTILINE)
    read = changelog.populate_changelog_from_rst(changelog.Changelog('tactile_skin'), released)
    versions = [version for version, _, _ in read.foreach_version()]
    assert versions[0] == '1.2.3' and len(versions) == len(sections())


def test_the_changelog_has_only_the_markup_that_rep_132_allows():
    core = pytest.importorskip('docutils.core')
    tree = core.publish_doctree(CHANGELOG, settings_overrides={'report_level': 5})
    kinds = {node.__class__.__name__ for node in tree.findall()}
    assert kinds <= {'document', 'title', 'subtitle', 'section', 'bullet_list', 'list_item', 'paragraph', 'Text',
                     'literal', 'strong', 'emphasis', 'reference', 'target'}


def test_every_link_of_the_changelog_leads_to_a_file():
    links = re.findall(r'`[^`<]+<([^>]+)>`__', CHANGELOG)
    assert links
    assert [link for link in links if not (ROOT / link.partition('#')[0]).is_file()] == []


def test_the_citation_names_software_and_paper():
    """The keys are those that the schema of CFF 1.2.0 requires; the facts are those of package.xml and the paper."""
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert {'cff-version', 'message', 'title', 'authors'} <= set(citation) and citation['cff-version'] == '1.2.0'
    assert (citation['title'], str(citation['version'])) == (PACKAGE.findtext('name'), VERSION)
    assert citation['license'] == PACKAGE.findtext('license')
    assert citation['repository-code'] == PACKAGE.findtext("url[@type='repository']")
    assert [author['name'] for author in citation['authors']] == [author.text for author in PACKAGE.iter('author')]
    paper = citation['preferred-citation']
    assert {'authors', 'title', 'type'} <= set(paper)
    assert [author['family-names'] for author in paper['authors']] == ['Volf', 'Dvořák', 'Vlček']
    page = ' '.join((ROOT / 'docs/paper.md').read_text(encoding='utf-8').split())
    assert paper['title'].casefold() in page.casefold()
    assert not {'doi', 'year', 'journal'} & set(paper)  # our copy gives none of them


def test_package_xml_has_addresses_authors_and_licences_with_their_texts():
    assert {url.get('type') for url in PACKAGE.iter('url')} == {'website', 'repository', 'bugtracker'}
    assert list(PACKAGE.iter('author')) and list(PACKAGE.iter('maintainer'))
    words = {'Apache-2.0': 'Apache License', 'MIT': 'MIT License'}
    for licence in PACKAGE.iter('license'):
        assert words[licence.text] in (ROOT / licence.get('file')).read_text(encoding='utf-8')


def test_notice_names_every_copyright_of_others():
    notice = (ROOT / 'NOTICE').read_text(encoding='utf-8')
    assert re.search(r'^Copyright \d{4} the tactile_skin maintainers$', notice, re.MULTILINE)
    others = re.findall(r'^Copyright .*$', (ROOT / 'test/data/LICENSE').read_text(encoding='utf-8'), re.MULTILINE)
    assert others and all(line in notice for line in others)


def workflow() -> dict:
    return yaml.safe_load(WORKFLOW.read_text(encoding='utf-8'))


def steps() -> list[dict]:
    return [step for job in workflow()['jobs'].values() for step in job['steps']]


def test_the_workflow_runs_what_must_pass():
    """.ci/run itself, in a job that nothing skips or forgives."""
    run, = (job for job in workflow()['jobs'].values() if any(step.get('run') == '.ci/run' for step in job['steps']))
    assert not {'if', 'continue-on-error', 'strategy'} & set(run)
    assert not any({'if', 'continue-on-error'} & set(step) for step in run['steps'])
    assert {'push', 'pull_request'} <= set(workflow()[True])  # YAML 1.1 reads `on` as true


def test_the_workflow_may_only_read_and_uses_pinned_actions():
    assert workflow()['permissions'] == {'contents': 'read'}
    assert not any('permissions' in job for job in workflow()['jobs'].values())
    actions = [step['uses'] for step in steps() if 'uses' in step]
    assert actions and all(re.fullmatch(r'[\w-]+/[\w-]+@[0-9a-f]{40}', action) for action in actions)
    assert 'secrets.' not in WORKFLOW.read_text() and 'pull_request_target' not in WORKFLOW.read_text()
    assert all(step['with']['persist-credentials'] is False for step in steps() if 'checkout' in step.get('uses', ''))


def test_every_target_that_the_workflow_makes_is_in_the_makefile():
    targets = set(re.findall(r'^([a-z]+):', (ROOT / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE))
    runs = [step['run'] for step in steps() if 'run' in step]
    strategies = [job.get('strategy', {}) for job in workflow()['jobs'].values()]
    runs += [run for strategy in strategies for run in strategy.get('matrix', {}).get('run', ())]
    made = {shlex.split(run)[1] for run in runs if run.startswith('make ')}
    assert made and made <= targets


def test_the_workflow_covers_every_python_that_setup_cfg_names():
    named = set(re.findall(r'Python :: (3\.\d+)$', (ROOT / 'setup.cfg').read_text(encoding='utf-8'), re.MULTILINE))
    text = WORKFLOW.read_text(encoding='utf-8')
    assert named == set(re.findall(r"'(3\.\d+)'", text))


@pytest.mark.parametrize('page', ['SECURITY.md', 'QUALITY_DECLARATION.md', 'docs/install.md'])
def test_every_file_and_target_that_a_page_names_exists(page):
    """A claim that leads nowhere is none."""
    text = (ROOT / page).read_text(encoding='utf-8')
    targets = set(re.findall(r'^([a-z]+):', (ROOT / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE))
    assert set(re.findall(r'`make ([a-z]+)', text)) <= targets
    folder = (ROOT / page).parent
    for link in re.findall(r'\]\((?!http)([^)#]+)', text):
        assert (folder / link).exists(), link
    for name in re.findall(r'`((?:test|docs|tools|examples|requirements|\.ci|\.github)/[\w./-]+)`', text):
        assert (ROOT / name).exists(), name


class Intruder:
    """Its pickle writes a file."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


def test_no_code_of_a_model_or_taxel_file_is_run(tmp_path):
    """SECURITY.md promises it: such a file may come from anyone."""
    mark = tmp_path / 'ran'
    harmful = np.array([Intruder(mark)], dtype=object)
    np.save(tmp_path / 'taxels.npy', harmful)
    with np.load(ROOT / 'config/recogniser.npz') as model:
        np.savez(tmp_path / 'model.npz', **dict.fromkeys(model.files, harmful))
    done = subprocess.run([sys.executable, '-m', 'tactile_node.cli.main', 'classify', tmp_path / 'taxels.npy'],
                          cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and 'tactile: error' in done.stderr
    with pytest.raises(TactileError):
        make_recogniser(LEARNED, str(tmp_path / 'model.npz'))
    assert not mark.exists()
