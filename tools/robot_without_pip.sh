#!/bin/bash
# What a robot without pip does, in a clean root (make deb-test): the command of docs/install.md, then our package.
set -euxo pipefail
cd /srv
if command -v pip; then exit 1; fi
eval "$(sed -n 's/^ *sudo \(apt install .*\.deb\).*/\1 --yes/p' docs/install.md)"
python3 -m doctest README.md
tactile() { python3 -m tactile_node.cli.main "$@"; }
tactile simulate --pty --link /tmp/skin --duration 20 &
until [ -e /tmp/skin ]; do sleep 0.2; done
tactile scan --interface slcan --channel /tmp/skin | tee /dev/stderr | grep -q 'node'
wait
