"""The work of `tactile features`: a record for each frame."""

import argparse
from collections.abc import Iterator

import numpy as np

from tactile_node.cli.frame_patterns import files, patterns
from tactile_node.cli.records import KNOWN, Record, flattened, write_records
from tactile_node.helmholtz.feature_groups import Group
from tactile_node.helmholtz.features import compute_features


def write_features(args: argparse.Namespace) -> None:
    write_records(_records(args), lambda: _columns(args.groups), args)


def _records(args: argparse.Namespace) -> Iterator[Record]:
    for path, found in files(args):
        for k, pattern in enumerate(patterns(path, found, args, largest=args.largest_contact)):
            yield {'file': path, 'frame': k, **found.known_of(k),
                   **compute_features(pattern.mask, args.groups).as_json()}


def _columns(wanted: Group) -> list[str]:
    """Of every frame, also of one without a contact."""
    return [*KNOWN, *flattened(compute_features(np.ones((2, 2), bool), wanted).as_json())]
