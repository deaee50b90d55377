"""What a release promises on security: a workflow that runs every check with pinned actions, files that run no code."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from tactile_node.errors import TactileError
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import LEARNED

ROOT = Path(__file__).resolve().parents[1]
WORKFLOW = ROOT / '.github/workflows/ci.yml'


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


def test_the_workflow_covers_every_python_that_setup_cfg_names():
    named = set(re.findall(r'Python :: (3\.\d+)$', (ROOT / 'setup.cfg').read_text(encoding='utf-8'), re.MULTILINE))
    text = WORKFLOW.read_text(encoding='utf-8')
    assert named == set(re.findall(r"'(3\.\d+)'", text))


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
