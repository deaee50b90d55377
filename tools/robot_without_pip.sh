#!/bin/bash
# Install and run our package in a clean root without pip, with the command from docs/install.md (make deb-test).
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
