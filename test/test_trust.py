"""For each case in a shared table, Python and C++ must agree on whether a grasp may be used.

The tests also check that CMake finds the header.
"""

import os
import shutil
import subprocess
import sys
from math import isnan
from pathlib import Path

import pytest
import yaml

from tactile_node.grasp import trust
from tactile_skin.msg import Grasp

ROOT = Path(__file__).resolve().parents[1]
HEADER = ROOT / 'include' / 'tactile_skin' / 'trust.hpp'
CASES = yaml.safe_load((ROOT / 'test' / 'trust_cases.yaml').read_text(encoding='utf-8'))
#: Fields of a grasp that may be used.
GOOD = {'silence': 0.02, 'sec': 0, 'nanosec': 30_000_000, 'contact': 'TWO_SIDED', 'fresh': True, 'stable': True,
        'line_is_bound': False, 'centre': [0.01, 0.015], 'offset': 0.001, 'width': 0.03}
COMPILER = shutil.which('g++')
needs_compiler = pytest.mark.skipif(COMPILER is None, reason='g++ is not installed')
PLAIN = '''struct Age { int sec; unsigned nanosec; };
struct Grasp { static constexpr unsigned char NOT_KNOWN = 0, UNSEEN = 1, NO_CONTACT = 2, ONE_SIDED = 3, TWO_SIDED = 4;
  Age age; unsigned char contact; bool fresh, stable, line_is_bound; double centre[2], offset, width; };
'''
OF_ROS = '#include <tactile_skin/action/wait_for_grasp.hpp>\n#include <tactile_skin/msg/grasp.hpp>\n' \
         'using tactile_skin::msg::Grasp;\n'


def given(case: dict) -> dict:
    found = {**GOOD, **case}
    contact = found['contact']
    return {**found, 'contact': getattr(Grasp, contact) if isinstance(contact, str) else contact}


@pytest.mark.parametrize('case', CASES, ids=str)
def test_python_says_why(case):
    facts = given(case)
    assert facts.keys() == GOOD.keys() | {'doubt'}
    grasp, silence, expected = Grasp(), facts.pop('silence'), facts.pop('doubt')
    grasp.age.sec, grasp.age.nanosec = facts.pop('sec'), facts.pop('nanosec')
    for name, value in facts.items():
        setattr(grasp, name, value)
    assert trust.doubt(grasp, silence).value == expected


def test_every_doubt_has_a_case():
    assert {case['doubt'] for case in CASES} == {each.value for each in trust.Doubt}


def program(definition: str) -> str:
    """Return a C++ program that prints its decision on each case, one per line."""
    def number(value) -> str:
        if isinstance(value, list):
            return ', '.join(map(number, value))
        return ('NAN' if isnan(value) else 'INFINITY' if value == float('inf') else str(value).lower())

    lines = []
    for facts in map(given, CASES):
        sets = [f'g.age.{name} = {facts[name]};' for name in ('sec', 'nanosec')]
        sets += [f'g.{name} = {number(facts[name])};'
                 for name in ('contact', 'fresh', 'stable', 'line_is_bound', 'offset', 'width')]
        sets += [f'g.centre[{place}] = {number(value)};' for place, value in enumerate(facts['centre'])]
        lines.append(f'{{ Grasp g{{}}; {" ".join(sets)} puts(name_of(doubt(g, {number(facts["silence"])}))); }}')
    return '\n'.join(['#include <cstdio>', definition, '#include <tactile_skin/trust.hpp>',
                      'using namespace tactile_skin;', 'int main() {', *lines, '}', ''])


def answers(executable: Path) -> list[str]:
    return subprocess.run([executable], check=True, capture_output=True, text=True).stdout.split()


@needs_compiler
def test_cpp_says_the_same_without_ros(tmp_path):
    (tmp_path / 'cases.cpp').write_text(program(PLAIN))
    subprocess.run([COMPILER, '-std=c++17', '-Wall', '-Wextra', '-Werror', '-I', HEADER.parents[1], 'cases.cpp', '-o',
                    'cases'], cwd=tmp_path, check=True)
    assert answers(tmp_path / 'cases') == [case['doubt'] for case in CASES]
    assert len(CASES) > 20


CONSUMER = '''cmake_minimum_required(VERSION 3.16)
project(my_planner)
find_package(tactile_skin REQUIRED)
add_executable(cases cases.cpp)
target_link_libraries(cases ${tactile_skin_TARGETS})
'''


@needs_compiler
@pytest.mark.slow
def test_another_package_finds_messages_action_and_rules_by_cmake(tmp_path):
    """The test calls CMake as colcon does in a workspace, and uses the installation in this environment."""
    cmake = Path(sys.executable).with_name('cmake')
    if not cmake.exists():
        pytest.skip('cmake is not installed')
    (tmp_path / 'cases.cpp').write_text(program(OF_ROS))
    (tmp_path / 'CMakeLists.txt').write_text(CONSUMER)
    environment = {**os.environ, 'CMAKE_PREFIX_PATH': sys.prefix, 'AMENT_PREFIX_PATH': sys.prefix,
                   'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}'}
    for words in (['-S', '.', '-B', 'build', f'-DPython3_EXECUTABLE={sys.executable}'], ['--build', 'build']):
        done = subprocess.run([cmake, *words], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]
    assert answers(tmp_path / 'build' / 'cases') == [case['doubt'] for case in CASES]
