"""Message packages that are not on PyPI.

If ROS does not provide a package, this module builds it or generates its Python classes.

Building a package takes 20 s of processor time and happens only once; its messages can then be sent. Generating the
Python classes takes 1 s, but their messages cannot be sent.

The module contains only the interfaces that our code uses, under the names of the real packages: geometry2, MoveIt 2
and ros2_control. The interfaces of control_msgs and tf2_msgs have the same type hashes as in the real
packages, so nodes with either package can exchange messages. The messages of MoveIt lack fields.

    python test/built_messages.py PACKAGE ...

builds packages and writes build/messages/setup.bash, which adds the packages to the environment of a shell.
"""

import ctypes
import fcntl
import hashlib
import importlib
import importlib.util
import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
MESSAGES, BUILT = ROOT / 'msg', ROOT / 'build' / 'messages'
#: Maps each package to the packages that it needs, and to its messages and actions.
INTERFACES: dict[str, tuple[tuple[str, ...], dict[str, str]]] = {
    'tf2_msgs': (('geometry_msgs',), {'TFMessage': 'geometry_msgs/TransformStamped[] transforms'}),
    'moveit_msgs': (('std_msgs', 'geometry_msgs', 'shape_msgs'), {
        'CollisionObject': '''std_msgs/Header header
geometry_msgs/Pose pose
string id
shape_msgs/SolidPrimitive[] primitives
geometry_msgs/Pose[] primitive_poses
shape_msgs/Mesh[] meshes
geometry_msgs/Pose[] mesh_poses
byte ADD=0
byte REMOVE=1
byte APPEND=2
byte MOVE=3
byte operation''',
        'AttachedCollisionObject': 'string link_name\nCollisionObject object\nstring[] touch_links\nfloat64 weight'}),
    'control_msgs': (('sensor_msgs', 'action_msgs'), {
        'GripperCommand': 'float64 position\nfloat64 max_effort',
        'action/GripperCommand': 'GripperCommand command\n---\n' + '---\n'.join(2 * [
            'float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n']),
        'action/ParallelGripperCommand': '''sensor_msgs/JointState command
---
sensor_msgs/JointState state
bool stalled
bool reached_goal
---
sensor_msgs/JointState state'''}),
    # This definition stands in for another version of our package: two fields are swapped, so the message has the same
    # length.
    'tactile_skin': (('std_msgs', 'builtin_interfaces'), {
        'TaxelArray': (MESSAGES / 'TaxelArray.msg').read_text(encoding='utf-8').replace(
            'uint32 rows\nuint32 cols\n', 'uint32 cols\nuint32 rows\n')})}


def source(name: str) -> dict[str, str]:
    """Return the files of package ``name``."""
    needs, messages = INTERFACES[name]
    depend = ''.join(f'<depend>{each}</depend>' for each in needs)
    find = '\n'.join(f'find_package({each} REQUIRED)' for each in needs)
    files = {each if '/' in each else f'msg/{each}': text for each, text in messages.items()}
    files = {f'{each}.{each.split("/")[0]}': text for each, text in files.items()}
    return {
        'package.xml': f'''<package format="3"><name>{name}</name><version>0.0.0</version><description>for tests
</description><maintainer email="maintainers@tactile-skin.org">tests</maintainer><license>Apache-2.0</license>
<buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>
{depend}<member_of_group>rosidl_interface_packages</member_of_group></package>''',
        'CMakeLists.txt': f'''cmake_minimum_required(VERSION 3.16)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{find}
rosidl_generate_interfaces({name} {" ".join(files)} {"DEPENDENCIES " + " ".join(needs) if needs else ""})
ament_package()''',
        **files}


@contextmanager
def built_messages(name: str, folder: Path) -> Iterator[None]:
    """Make package ``name`` importable. A package that is not installed is built once in ``folder`` (about 10 s)."""
    if importlib.util.find_spec(name):
        yield
        return
    modules = built(name, folder)
    prefix = modules.parents[2]
    for library in prefix.glob('lib/*.so'):  # rosidl opens the libraries by name, so they must be loaded first.
        ctypes.CDLL(str(library))
    with _importable(name, modules):
        yield


@contextmanager
def generated_messages(name: str) -> Iterator[None]:
    """Make package ``name`` importable.

    For a package that is not installed, only the Python classes are generated, which DDS cannot send.
    """
    if importlib.util.find_spec(name):
        yield
        return
    from rosidl_generator_py.cli import GeneratePython
    with TemporaryDirectory() as folder:
        sources, modules = Path(folder, 'source'), Path(folder, 'modules')
        _write_source(name, sources)
        interfaces = [f'{sources}:{path.relative_to(sources)}' for path in sources.glob('*/*')]
        with redirect_stdout(io.StringIO()):  # The generator prints the name of each file.
            GeneratePython('py').generate(name, interfaces, [f'{sys.prefix}/share'], modules / name)
        with _importable(name, modules):
            yield


@contextmanager
def _importable(name: str, modules: Path) -> Iterator[None]:
    sys.path.append(str(modules))
    try:
        yield
    finally:
        sys.path.remove(str(modules))
        for module in [each for each in sys.modules if each.split('.')[0] == name]:
            del sys.modules[module]


def environment_with(name: str) -> dict[str, str]:
    """Return the environment for a process that imports package ``name``.

    The package must be importable in this process.
    """
    modules = Path(importlib.import_module(name).__file__).parents[1]
    paths = {'PYTHONPATH': modules, 'LD_LIBRARY_PATH': modules.parents[2] / 'lib'}
    return {**os.environ, **{key: f'{path}:{os.environ.get(key, "")}' for key, path in paths.items()}}


def built(name: str, folder: Path) -> Path:
    """Build package ``name`` once in ``folder``, even if it is installed, and return its folder of Python modules."""
    folder = folder / name / _fingerprint(name)
    folder.mkdir(parents=True, exist_ok=True)
    prefix, is_built = folder / 'install', folder / 'is_built'
    with (folder / 'lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # Another run of pytest may build the same package at the same time.
        if not is_built.exists():
            _build(name, folder)
            is_built.touch()
    modules, = prefix.glob('lib/python*/site-packages')
    return modules


def _fingerprint(name: str) -> str:
    """Return a fingerprint of the package's sources, the environment, and the installation time of the environment."""
    std_msgs = Path(importlib.util.find_spec('std_msgs').origin)
    facts = [source(name), sys.prefix, sys.version, std_msgs.stat().st_mtime_ns]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]


def _write_source(package: str, folder: Path) -> None:
    for name, text in source(package).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding='utf-8')


def _build(package: str, folder: Path) -> None:
    sources, build, prefix = folder / 'source', folder / 'build', folder / 'install'
    _write_source(package, sources)
    cmake = str(Path(sys.executable).with_name('cmake'))
    environment = {**os.environ, 'AMENT_PREFIX_PATH': sys.prefix, 'CMAKE_PREFIX_PATH': sys.prefix,
                   'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}'}
    for arguments in (['-S', sources, '-B', build, f'-DCMAKE_INSTALL_PREFIX={prefix}', '-DBUILD_TESTING=OFF',
                       f'-DPython3_EXECUTABLE={sys.executable}', '-DCMAKE_INSTALL_RPATH=$ORIGIN;$ORIGIN/../../..'],
                      ['--build', build, '--target', 'install', '--parallel', '2']):
        done = subprocess.run([cmake, *map(str, arguments)], env=environment, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        assert done.returncode == 0, done.stdout[-3000:]


def write_setup(names: list[str], folder: Path) -> Path:
    """Build the packages in ``folder``, and write a script that adds them to the environment of a shell.

    The script leaves out a package that is installed elsewhere. The script appends to the search paths, so that a
    package of a ROS workspace is found first.

    Returns
    -------
    Path
        The script, which bash and zsh can source.
    """
    lines = []
    for name in names:
        spec = importlib.util.find_spec(name)
        if spec and spec.origin and not Path(spec.origin).is_relative_to(folder):
            continue
        modules = built(name, folder)
        prefix = modules.parents[2]
        paths = {'PYTHONPATH': modules, 'LD_LIBRARY_PATH': prefix / 'lib', 'AMENT_PREFIX_PATH': prefix}
        lines += [f'export {key}="${{{key}:+${key}:}}{path}"\n' for key, path in paths.items()]
    script = folder / 'setup.bash'
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(''.join(lines), encoding='utf-8')
    return script


if __name__ == '__main__':
    print(f'messages: source {write_setup(sys.argv[1:], BUILT)}')
