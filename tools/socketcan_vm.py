"""Run a command of this checkout in a small virtual machine with a real Linux CAN stack.

    python tools/socketcan_vm.py [--folder build/socketcan] COMMAND...

The script needs apt, but neither root nor KVM. The script unpacks Debian packages into --folder and installs nothing on
the host. The virtual machine sees the files of the host read-only, with an overlay in RAM. The virtual machine has two
CAN controllers (SJA1000) on one emulated bus, can0 and can1, two virtual CAN interfaces, vcan0 and vcan1, and a serial
port /dev/ttyS1 that is connected to nothing. The script exits with the exit code of the command, or with 77 if the
virtual machine cannot be started. After exit code 77, the file not_run in --folder contains the reason.
"""

import argparse
import gzip
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

NOT_STARTED = 77  #: Exit code that means "skipped" in Automake tests.
PACKAGES = ('qemu-system-x86', 'linux-image-amd64', 'busybox-static', 'kmod', 'iproute2')
MODULES = ('9pnet_virtio', 'virtio_pci', '9p', 'overlay', 'vcan', 'can-raw', 'slcan', 'kvaser_pci')
RESULT = 'socketcan_vm: command ended with '
BEGUN = 'socketcan_vm: command begins'
DOWNLOAD_SECONDS = 300
CONTROLLERS = 2
INIT = '''#!/bin/busybox sh
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /host /ram /root
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
for module in {modules}; do modprobe $module || echo "socketcan_vm: no module $module"; done
mount -t 9p -o trans=virtio,version=9p2000.L,ro,msize=1048576,cache=loose host /host || poweroff -f
mount -t tmpfs tmpfs /ram; mkdir /ram/over /ram/work
mount -t overlay -o lowerdir=/host,upperdir=/ram/over,workdir=/ram/work overlay /root || poweroff -f
mount -t proc proc /root/proc; mount -t sysfs sys /root/sys; mount --bind /dev /root/dev
mkdir -p /root/dev/shm /root/dev/pts
mount -t tmpfs tmpfs /root/dev/shm; mount -t devpts devpts /root/dev/pts
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp
for name in lo vcan0 vcan1; do
  [ $name = lo ] || chroot /root ip link add $name type vcan
  chroot /root ip link set $name up
done
echo "{begun}"
chroot /root /bin/sh -c {command}
echo "{result}$?"
poweroff -f
'''


class CannotStartError(Exception):
    """Raised if the virtual machine cannot be started. The message contains the reason."""


def fetch(folder: Path) -> None:
    """Download the Debian packages in PACKAGES, and unpack them into ``folder``/root."""
    root, debs = folder / 'root', folder / 'debs'
    if (folder / 'unpacked').exists():
        return
    if not shutil.which('apt-get') or not shutil.which('dpkg-deb'):
        raise CannotStartError('expected apt-get and dpkg-deb, or an earlier download, found neither. '
                               'Run this script on Debian or Ubuntu.')
    (debs / 'partial').mkdir(parents=True, exist_ok=True)
    print('socketcan_vm: downloading kernel and emulator (about 100 MB, once)', flush=True)
    settings = [f'Dir::Cache::archives={debs.resolve()}', 'Debug::NoLocking=1', 'APT::Sandbox::User=']
    options = [word for setting in settings for word in ('-o', setting)]
    got = subprocess.run(['apt-get', *options, '-y', '-qq', '--download-only', '--reinstall', '--no-install-recommends',
                          'install', *PACKAGES], capture_output=True, text=True, timeout=DOWNLOAD_SECONDS)
    if got.returncode:
        reasons = got.stderr.strip().splitlines() or ['no reason given']
        raise CannotStartError(f'apt-get could not download: {reasons[-1]}')
    for deb in sorted(debs.glob('*.deb')):
        subprocess.run(['dpkg-deb', '-x', deb, root], check=True)
    (folder / 'unpacked').touch()


def found(root: Path, *patterns: str) -> Path:
    """Return the first path below ``root`` that matches one of ``patterns``."""
    for pattern in patterns:
        for path in sorted(root.glob(pattern)):
            return path
    raise CannotStartError(f'no {patterns[0]} among the packages')


def make_initramfs(folder: Path) -> tuple[Path, Path]:
    """Return the kernel and an initramfs, to which `boot` appends the command as a second archive."""
    root, image = folder / 'root', folder / 'initramfs.gz'
    kernel = found(root, 'boot/vmlinuz-*')
    version = kernel.name.removeprefix('vmlinuz-')
    modules = found(root, f'lib/modules/{version}', f'usr/lib/modules/{version}')
    busybox = found(root, 'bin/busybox', 'usr/bin/busybox')
    if not image.exists():
        with tempfile.TemporaryDirectory() as name:
            tree = Path(name)
            (tree / 'bin').mkdir()
            shutil.copy(busybox, tree / 'bin/busybox')
            (tree / 'sbin').symlink_to('bin')
            for kind in ('drivers/virtio', 'drivers/net/can', 'net/can', 'net/9p', 'fs', 'drivers/block'):
                shutil.copytree(modules / 'kernel' / kind, tree / 'lib/modules' / version / 'kernel' / kind)
            for part in ('modules.order', 'modules.builtin'):
                shutil.copy(modules / part, tree / 'lib/modules' / version / part)
            subprocess.run([busybox, 'depmod', '-b', tree, version], check=True)
            image.write_bytes(gzip.compress(archive(tree), 1))
    return kernel, image


def archive(tree: Path) -> bytes:
    """Return ``tree`` as a cpio archive in newc format (Linux Documentation/driver-api/early-userspace)."""
    parts = []
    for number, path in enumerate(sorted(tree.rglob('*')), 1):
        status, name = path.lstat(), str(path.relative_to(tree)).encode() + b'\0'
        data = os.readlink(path).encode() if path.is_symlink() else path.read_bytes() if path.is_file() else b''
        fields = (number, status.st_mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name), 0)
        head = b'070701' + b''.join(b'%08X' % field for field in fields) + name
        parts += [head, b'\0' * (-len(head) % 4), data, b'\0' * (-len(data) % 4)]
    name = b'TRAILER!!!\0'
    head = b'070701' + b''.join(b'%08X' % field for field in (0,) * 11 + (len(name), 0)) + name
    return b''.join([*parts, head, b'\0' * (-len(head) % 4)])


def with_init(folder: Path, image: Path, command: str) -> Path:
    """Append an archive that contains /init with the command to the initramfs, and return the path of the new file."""
    with tempfile.TemporaryDirectory() as name:
        init = Path(name) / 'init'
        init.write_text(INIT.format(modules=' '.join(MODULES), command=shlex.quote(command), begun=BEGUN,
                                    result=RESULT))
        init.chmod(0o755)
        whole = folder / f'initramfs_{os.getpid()}.gz'
        whole.write_bytes(image.read_bytes() + gzip.compress(archive(Path(name))))
    return whole


def emulator(root: Path) -> tuple[list[str], dict[str, str]]:
    """Return the command and the environment to run QEMU, either the host's QEMU or the unpacked one."""
    if own := shutil.which('qemu-system-x86_64'):
        return [own], {}
    libraries = {str(path.parent) for path in root.glob('**/*.so.*')}
    program = found(root, 'usr/bin/qemu-system-x86_64')
    data = [root / 'usr/share' / part for part in ('qemu', 'seabios', 'ipxe/qemu', 'qemu/firmware')]
    return ([str(program), *(word for path in data if path.is_dir() for word in ('-L', str(path)))],
            {'LD_LIBRARY_PATH': ':'.join(sorted(libraries)), 'QEMU_MODULE_DIR': str(found(root, 'usr/lib/*/qemu'))})


def boot(folder: Path, command: str, seconds: float) -> int:
    kernel, image = make_initramfs(folder)
    program, environment = emulator(folder / 'root')
    whole = with_init(folder, image, command)
    controllers = [word for number in range(CONTROLLERS) for word in ('-device', 'kvaser_pci,canbus=bus')]
    arguments = ['-nodefaults', '-no-user-config', '-nographic', '-serial', 'stdio', '-serial', 'null',
                 '-monitor', 'none', '-no-reboot', '-m', '1500', '-smp', '2', '-cpu', 'max',
                 '-accel', 'tcg,thread=multi', '-kernel', str(kernel), '-initrd', str(whole),
                 '-append', 'console=ttyS0 quiet panic=-1 loglevel=3', '-object', 'can-bus,id=bus', *controllers,
                 '-virtfs', 'local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap']
    machine = subprocess.Popen(program + arguments, env=os.environ | environment, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors='replace')
    try:
        return relay(machine, seconds)
    finally:
        machine.kill()
        machine.wait()
        whole.unlink()


def relay(machine: subprocess.Popen, seconds: float) -> int:
    """Print the output of the virtual machine until the command ends, and return the command's exit code."""
    watchdog = threading.Timer(seconds, machine.kill)
    watchdog.start()
    last, begun = '', False
    try:
        for line in machine.stdout:
            line = re.sub(r'\x1b(\[[0-9;?=]*[a-zA-Z]|c)', '', line.rstrip())
            line = line.rpartition('Booting from ROM..')[2]
            if line.startswith(RESULT):
                return int(line.removeprefix(RESULT))
            begun, last = begun or line == BEGUN, line or last
            print(line, flush=True)
    finally:
        watchdog.cancel()
    if begun:
        print(f'socketcan_vm: FAILED: no result within {seconds:g} s; last: {last!r}', flush=True)
        return 1
    raise CannotStartError(f'the machine stopped, or was stopped after {seconds:g} s, without a result; last: {last!r}')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--folder', type=Path, default=Path('build/socketcan'))
    parser.add_argument('--seconds', type=float, default=420, help='time limit [s] (default: %(default)s)')
    parser.add_argument('command', help='command for /bin/sh, run in the current folder')
    args = parser.parse_args()
    why_not = args.folder / 'not_run'
    why_not.unlink(missing_ok=True)
    try:
        if platform.machine() != 'x86_64' or sys.platform != 'linux':
            raise CannotStartError(f'Linux on x86_64 is needed, this is {sys.platform} on {platform.machine()}')
        fetch(args.folder)
        return boot(args.folder, f'cd {shlex.quote(os.getcwd())} && {args.command}', args.seconds)
    except (CannotStartError, subprocess.TimeoutExpired) as reason:
        print(f'socketcan_vm: NOT RUN: {reason}', flush=True)
        why_not.parent.mkdir(parents=True, exist_ok=True)
        why_not.write_text(f'{reason}\n')
        return NOT_STARTED


if __name__ == '__main__':
    sys.exit(main())
