"""tf2_msgs with its one message, built into a folder where no ROS installation has it: PyPI does not."""

import ctypes
import fcntl
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SOURCE = {
    'package.xml': '''<package format="3"><name>tf2_msgs</name><version>0.0.0</version><description>as in geometry2
</description><maintainer email="maintainers@tactile-skin.org">tests</maintainer><license>Apache-2.0</license>
<buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>
<depend>geometry_msgs</depend><member_of_group>rosidl_interface_packages</member_of_group></package>''',
    'CMakeLists.txt': '''cmake_minimum_required(VERSION 3.16)
project(tf2_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(geometry_msgs REQUIRED)
rosidl_generate_interfaces(tf2_msgs msg/TFMessage.msg DEPENDENCIES geometry_msgs)
ament_package()''',
    'msg/TFMessage.msg': 'geometry_msgs/TransformStamped[] transforms'}


@contextmanager
def tf2_msgs(folder: Path) -> Iterator[None]:
    """Make tf2_msgs importable: the installed one, or one that is built in ``folder`` (about 10 s), once."""
    if importlib.util.find_spec('tf2_msgs'):
        yield
        return
    folder = folder / _fingerprint()
    folder.mkdir(parents=True, exist_ok=True)
    prefix, is_built = folder / 'install', folder / 'is_built'
    with (folder / 'lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another run of pytest may build it, too
        if not is_built.exists():
            _build(folder)
            is_built.touch()
    modules, = prefix.glob('lib/python*/site-packages')
    for library in prefix.glob('lib/*.so'):  # rosidl opens them by name: those that are loaded are found
        ctypes.CDLL(str(library))
    sys.path.append(str(modules))
    try:
        yield
    finally:
        sys.path.remove(str(modules))
        for name in [name for name in sys.modules if name.split('.')[0] == 'tf2_msgs']:
            del sys.modules[name]


def _fingerprint() -> str:
    """Of what the build depends on: the sources, the environment and when the environment was installed."""
    geometry_msgs = Path(importlib.util.find_spec('geometry_msgs').origin)
    facts = [SOURCE, sys.prefix, sys.version, geometry_msgs.stat().st_mtime_ns]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]


def _build(folder: Path) -> None:
    source, build, prefix = folder / 'source', folder / 'build', folder / 'install'
    for name, text in SOURCE.items():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text(text, encoding='utf-8')
    cmake = str(Path(sys.executable).with_name('cmake'))
    environment = {**os.environ, 'AMENT_PREFIX_PATH': sys.prefix, 'CMAKE_PREFIX_PATH': sys.prefix,
                   'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}'}
    for arguments in (['-S', source, '-B', build, f'-DCMAKE_INSTALL_PREFIX={prefix}', '-DBUILD_TESTING=OFF',
                       f'-DPython3_EXECUTABLE={sys.executable}', '-DCMAKE_INSTALL_RPATH=$ORIGIN;$ORIGIN/../../..'],
                      ['--build', build, '--target', 'install', '--parallel', '2']):
        done = subprocess.run([cmake, *map(str, arguments)], env=environment, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        assert done.returncode == 0, done.stdout[-3000:]
