"""The C++ header that finds the outcome of a goal by its id is compiled here without ROS."""

import shutil
import subprocess
from pathlib import Path

import pytest

INCLUDE = Path(__file__).resolve().parents[1] / 'include'
COMPILER = shutil.which('g++')
#: Each line prints the result of the C++ header. The cases are those of the Python client's test.
PROGRAM = '''#include <cstdio>
#include <string>
#include <tactile_skin/touch_goals.hpp>
using namespace tactile_skin;
struct Outcome { GoalId goal_id; int outcome; bool of_hold; };
using Goals = TouchGoals<std::string, Outcome>;
const GoalId A{1}, B{2};
void say(const char * name, std::optional<Goals::Ending> ending) {
  if (!ending) { std::printf("%s under_way\\n", name); return; }
  std::printf("%s %s %d\\n", name, ending->result.c_str(), ending->outcome ? ending->outcome->outcome : -1);
}
int main() {
  { Goals goals; goals.on_result(A, "stalled", 10.0); say("result_first", goals.take(A, 10.0));
    goals.on_outcome({B, 8, false}, 10.1); say("of_another", goals.take(A, 10.1));
    goals.on_outcome({A, 3, false}, 10.2); say("then_outcome", goals.take(A, 10.2));
    say("is_forgotten", goals.take(A, 20.0)); }
  { Goals goals; goals.on_outcome({A, 2, false}, 10.0); say("outcome_first", goals.take(A, 20.0));
    goals.on_outcome({A, 19, true}, 20.0); goals.on_result(A, "stalled", 20.0);
    say("then_result", goals.take(A, 20.0)); }
  { Goals goals; goals.on_result(A, "aborted", 10.0); say("waits", goals.take(A, 11.0));
    say("lost", goals.take(A, 11.1)); }
  { Goals goals; goals.on_outcome({A, 2, false}, 10.0);
    for (unsigned char k = 0; k < 15; ++k) { goals.on_outcome({{9, k}, 8, false}, 11.0 + k); }
    goals.on_outcome({B, 4, false}, 40.0); goals.on_result(A, "aborted", 41.0); goals.on_result(B, "stalled", 41.0);
    say("oldest_gave_way", goals.take(A, 50.0)); say("newest_is_kept", goals.take(B, 41.0)); }
}
'''
EXPECTED = '''result_first under_way
of_another under_way
then_outcome stalled 3
is_forgotten under_way
outcome_first under_way
then_result stalled 2
waits under_way
lost aborted -1
oldest_gave_way aborted -1
newest_is_kept stalled 4
'''


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason='g++ is not installed')
def test_cpp_finds_the_outcome_of_each_goal(tmp_path):
    (tmp_path / 'goals.cpp').write_text(PROGRAM)
    subprocess.run([COMPILER, '-std=c++17', '-Wall', '-Wextra', '-Werror', '-I', INCLUDE, 'goals.cpp', '-o', 'goals'],
                   cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / 'goals'], check=True, capture_output=True, text=True).stdout == EXPECTED
