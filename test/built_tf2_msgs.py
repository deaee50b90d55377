"""tf2_msgs with its one message, built into a folder where no ROS installation has it: PyPI does not."""

import ctypes
import importlib.util
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
    """Make tf2_msgs importable: the installed one, or one that is built in ``folder`` (about 10 s)."""
    if importlib.util.find_spec('tf2_msgs'):
        yield
        return
    prefix = _build(folder)
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


def _build(folder: Path) -> Path:
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
    return prefix
