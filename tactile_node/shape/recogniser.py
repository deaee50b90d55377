"""Recognise shapes with a trained network: contact pattern -> patch and geometry -> network -> probabilities.

The recogniser has two small networks, one for on/off taxels and one for pressures. A contact with pressures is
recognised by both networks, because skins differ more in their pressures than in the outlines of their contacts. The
result is the weighted mean of both answers. Each network returns six logits.
Five logits belong to the five classes and are divided by a temperature fitted to validation patterns. The sixth logit
is for a contact with none of the five shapes and has a bias.

The weights are stored in config/recogniser.npz, which training/train.py writes. A file from `tactile teach` contains
these weights and the heads of taught shapes (taught.py). A file from `tactile assess` contains these weights and the
adaptation to a skin (adaptation.py).
"""

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED
from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import ConfigurationError
from tactile_node.shape.adaptation import Adaptation, read_adaptations
from tactile_node.shape.invariants import COUNT, LOG_TAXELS, OVERLAPS, describe_all
from tactile_node.shape.network import TAPS, Network
from tactile_node.shape.patch import Patch, joined, make_patch
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, TaughtShape, UnknownReason
from tactile_node.shape.steepest_outline import steepest_outline
from tactile_node.shape.support import (
    UNSUPPORTED,
    as_far_as_it_fits,
    as_far_as_it_holds,
    as_far_as_it_is_filled,
    as_far_as_no_edge_shapes_it,
    has_sure_name,
    is_convex,
    low_outline,
)
from tactile_node.shape.taught import Head, join, read_taught

#: Class of each output of the networks. The order is part of the file format of the weights.
OUTPUTS = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE, Shape.UNKNOWN)
#: Smallest number of taxels with which a contact is recognised. A smaller contact is UNKNOWN. The limits correspond to
#: an area of nine taxels. Pressures need fewer pressed taxels because they also show the rim of the contact.
FEWEST_TAXELS = {'on_off': 6, 'graded': 4}
#: The pieces of a torn contact are recognised together. If joining the pieces raises the probability of UNKNOWN by more
#: than this value, compared with the largest piece alone, the largest piece is recognised alone.
DOUBT_GAIN = 0.2
#: To be recognised alone, the largest piece must have at least this share of the taxels of all pieces. Pieces of
#: similar size are parts of one contact.
MOST_OF_PIECES = 0.5
#: Smallest probability of UNKNOWN for a non-convex contact.
NOT_CONVEX_PROBABILITY = 0.99
#: From this number of taxels on, the network for on/off taxels has as much weight as the network for pressures. With
#: fewer taxels it has proportionally less, because the outline then decides less. 40, 60 and 80 give similar rates on
#: the validation seeds.
OUTLINE_TAXELS = 80
LAYERS = len(TAPS) + 3
MOST_ARRAY_BYTES = 1 << 24  #: Largest total size of the arrays in a file [bytes]. Actual files are far smaller.
KINDS = ('on_off', 'graded')  #: Kinds of frames: on/off taxels and pressures.
SIZES = (12, 17, 24, 34, 48, 68, 96, 136, 200, 300)  #: Sizes at which UNKNOWN is calibrated [taxels].
LOG_SIZES = np.log(SIZES)


class Calibration(NamedTuple):
    """Converts the logits of a network into probabilities."""

    temperature: float   #: temperature of the five classes
    biases: np.ndarray   #: logit above which UNKNOWN is likelier than not, for each of SIZES, (len(SIZES),)

    def probabilities(self, logits: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the probabilities of the five classes and of UNKNOWN.

        Parameters
        ----------
        logits : np.ndarray
            Logits of K contacts, (K, 6).
        log_taxels : np.ndarray
            Logarithm of the number of taxels of each contact, (K,).

        Returns
        -------
        np.ndarray
            Probabilities, (K, 6).
        """
        scaled = logits[:, :-1] / self.temperature
        odds = np.exp(scaled - scaled.max(1, keepdims=True))
        foreign = 1 / (1 + np.exp(np.interp(log_taxels, LOG_SIZES, self.biases) - logits[:, -1]))[:, None]
        return np.concatenate((odds / odds.sum(1, keepdims=True) * (1 - foreign), foreign), 1)


class NetworkAnswers(NamedTuple):
    """The answers to K contacts of one kind of frame, with a probability for each of the recogniser's ``outputs``."""

    probabilities: np.ndarray  #: (K, outputs)
    embedding: np.ndarray      #: from the network for this kind of frame, (K, network.width)
    geometry: np.ndarray       #: (K, invariants.COUNT)


class ShapeRecogniser:
    """Recognises the shape of a contact from on/off taxels or, more reliably, from pressures.

    Parameters
    ----------
    networks : dict[str, Network]
        Network for each of KINDS.
    calibrations : dict[str, Calibration]
        Calibration for each of KINDS.
    taught : tuple[TaughtShape, ...]
        Taught shapes.
    heads : Mapping[str, Head]
        Heads of the taught shapes by kind of frame. Without a head for its kind, a frame is never recognised as a
        taught shape.
    adaptations : Mapping[str, Adaptation]
        Adaptations to a skin by kind of frame, also an attribute. Without an adaptation for a kind, the probabilities
        are not changed.

    Attributes
    ----------
    outputs : tuple[ShapeClass, ...]
        Class of each column of the answers' probabilities.
    classes : tuple[ShapeClass, ...]
        All classes that a recognition may report.
    unadapted : ShapeRecogniser or None
        The recogniser without its adaptations, if one of them must make no name sure.
    """

    def __init__(self, networks: dict[str, Network], calibrations: dict[str, Calibration],
                 taught: tuple[TaughtShape, ...] = (), heads: Mapping[str, Head] = MappingProxyType({}),
                 adaptations: Mapping[str, Adaptation] = MappingProxyType({})):
        self._networks, self._calibrations, self._heads = networks, calibrations, heads
        self._taught, self.adaptations = taught, adaptations
        self.outputs: tuple[ShapeClass, ...] = (*OUTPUTS, *taught)
        self.classes: tuple[ShapeClass, ...] = (*Shape, *taught)
        all_make_sure = all(adaptation.makes_sure for adaptation in adaptations.values())
        self.unadapted: ShapeRecogniser | None = None if all_make_sure else self.adapted({})

    @classmethod
    def from_file(cls, path: str | Path) -> 'ShapeRecogniser':
        """Load the recogniser from a file that training/train.py, `tactile teach` or `tactile assess` has written.

        Raises
        ------
        ConfigurationError
            Raised if the file cannot be read, or does not contain the expected arrays.
        """
        try:
            data = read_arrays(path)
            networks = {kind: _network(data, kind) for kind in KINDS}
            widths = {kind: network.width for kind, network in networks.items()}
            taught, heads = read_taught(data, widths)
            return cls(networks, {kind: _calibration(data, kind) for kind in KINDS}, taught, heads,
                       read_adaptations(data, len(OUTPUTS) + len(taught), widths))
        except OSError as error:
            raise _unusable(path, error.strerror or str(error)) from None
        except KeyError as error:
            raise _unusable(path, f'no array {error}') from None
        except (ValueError, TypeError, EOFError, AttributeError, MemoryError, OverflowError, BadZipFile,
                NotImplementedError, RuntimeError, zlib.error) as error:  # NumPy passes on errors from zipfile and zlib
            raise _unusable(path, ' '.join(str(error).split())) from None

    def adapted(self, adaptations: Mapping[str, Adaptation]) -> 'ShapeRecogniser':
        """Return a copy of the recogniser with ``adaptations`` instead of its own adaptations."""
        return ShapeRecogniser(self._networks, self._calibrations, self._taught, self._heads, adaptations)

    def recognise(self, pattern: ContactPattern) -> Recognition:
        """Return the recognition of the largest contact.

        An empty pattern is recognised as NONE, and a contact of fewer than FEWEST_TAXELS taxels as UNKNOWN. Pieces that
        may belong to one torn contact are recognised as one contact. If the joined contact is much more likely to be
        UNKNOWN than its largest piece, the largest piece is recognised alone.
        """
        return self.recognise_all([pattern])[0]

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Return the same results as `recognise` for each pattern, but faster than separate calls."""
        together = [joined(pattern) for pattern in patterns]
        whole = self._verified([(pattern.values, mask) for pattern, mask in zip(patterns, together)])
        return [self._decide(pattern, mask, found) for pattern, mask, found in zip(patterns, together, whole)]

    def _decide(self, pattern: ContactPattern, together: np.ndarray, whole: Recognition) -> Recognition:
        """Return the recognition ``whole`` of all pieces ``together``, or that of the largest piece alone."""
        if np.count_nonzero(together) == np.count_nonzero(pattern.mask):
            return whole
        whole = whole._replace(joined=whole.shape is not Shape.UNKNOWN)
        if (whole.probabilities[Shape.UNKNOWN] <= DOUBT_GAIN
                or np.count_nonzero(pattern.mask) < MOST_OF_PIECES * np.count_nonzero(together)):
            return whole
        largest = self._verified([(pattern.values, pattern.mask)])[0]
        gain = whole.probabilities[Shape.UNKNOWN] - largest.probabilities[Shape.UNKNOWN]
        return largest if gain > DOUBT_GAIN else whole

    def _verified(self, contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Recognition]:
        """Return the recognition of each contact, a pair of values and mask.

        A contact without a sure name is recognised again within its `steepest_outline`. A name that only this outline
        shows is not sure. Joined pieces keep their outlines, because the steepest outline contains a single piece.
        """
        found = self._held(contacts)
        again = [(k, (values, steepest)) for k, (values, mask) in enumerate(contacts)
                 if not has_sure_name(found[k]) and ndimage.label(mask, EIGHT_CONNECTED)[1] == 1
                 and (steepest := steepest_outline(values, mask)) is not mask]
        for (k, _), each in zip(again, self._held([contact for _, contact in again])):
            found[k] = each.no_surer_than(UNSUPPORTED, UnknownReason.UNSTABLE) if has_sure_name(each) else each
        return found

    def _held(self, contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Recognition]:
        """Return the recognition of each contact, with the confidence limited by the contact's low outline.

        The contacts and their low outlines are recognised in one call, which takes less time than two calls, even
        though only sure contacts need their low outline.
        """
        low = [low_outline(*contact) for contact in contacts]
        lower = [(values, mask) for (values, _), mask in zip(contacts, low) if mask is not None]
        found = self._recognise_contacts([*contacts, *lower])
        of_low = iter(found[len(contacts):])
        return [each if mask is None else as_far_as_it_holds(each, next(of_low)) for each, mask in zip(found, low)]

    def _recognise_contacts(self, contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Recognition]:
        """Recognise each contact, a pair of values and mask, with the network for its kind of frame."""
        found = [Recognition.certain(Shape.NONE)] * len(contacts)
        patches: dict[bool, list[tuple[int, Patch]]] = {False: [], True: []}
        for k, (values, mask) in enumerate(contacts):
            taxels = np.count_nonzero(mask)
            if not taxels:
                continue
            patch = make_patch(values, mask)
            if taxels < FEWEST_TAXELS[KINDS[patch.graded]]:
                found[k] = Recognition.unknown(UnknownReason.TOO_SMALL)
            else:
                patches[patch.graded].append((k, patch))
        for alike in patches.values():
            if alike:
                answers = self.answers([patch for _, patch in alike], [contacts[k] for k, _ in alike])
                for number, (k, patch) in enumerate(alike):
                    named = Recognition.of(dict(zip(self.outputs, answers.probabilities[number].tolist())))
                    if patch.graded:
                        size = int(np.count_nonzero(contacts[k][1]))
                        found[k] = as_far_as_it_fits(named, size, answers.geometry[number, OVERLAPS])
                    else:
                        values, mask = contacts[k]
                        found[k] = as_far_as_no_edge_shapes_it(as_far_as_it_is_filled(named, values, mask), mask)
        return found

    def answers(self, patches: Sequence[Patch], contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> NetworkAnswers:
        """Return the answers to K contacts of one kind of frame.

        Parameters
        ----------
        patches : Sequence[Patch]
            Patches of the contacts, which are either all graded or all not graded.
        contacts : Sequence[tuple[np.ndarray, np.ndarray]]
            Values and mask of each contact, both (rows, cols).
        """
        kind = KINDS[patches[0].graded]
        outlines = _outlines(contacts) if patches[0].graded else {}
        both = geometry_of([*patches, *outlines.values()])
        geometry, of_outlines = both[:len(patches)], both[len(patches):]
        embedding = self.embedding(patches, geometry)
        log_taxels = geometry[:, LOG_TAXELS]
        known = self.known(kind, embedding, log_taxels)
        if outlines:
            which, log_sizes = list(outlines), of_outlines[:, LOG_TAXELS]
            of_outline = self.known('on_off', self.embedding(list(outlines.values()), of_outlines), log_sizes)
            weight = np.minimum(np.exp(log_sizes) / OUTLINE_TAXELS, 1.0)[:, None]
            known[which] = (known[which] + weight * of_outline) / (1 + weight)
        # Only the five shapes have to be convex, so this check comes before the heads of taught shapes. On/off contacts
        # are not checked, because silent lines break the rim of such a contact into pieces that do not look convex.
        convex = np.array([not patch.graded or is_convex(*contact) for patch, contact in zip(patches, contacts)])
        known[~convex] = _as_foreign(known[~convex])
        probabilities = self.with_taught(kind, known, embedding, log_taxels)
        if kind in self.adaptations:
            probabilities = self.adaptations[kind].applied(probabilities, embedding)
        return NetworkAnswers(probabilities, embedding, geometry)

    def embedding(self, patches: Sequence[Patch], geometry: np.ndarray) -> np.ndarray:
        """Return the embedding of K patches, from which the heads and adaptations compute their results.

        Parameters
        ----------
        patches : Sequence[Patch]
            Patches of the contacts, which are either all graded or all not graded.
        geometry : np.ndarray
            Geometry of the patches, (K, invariants.COUNT), as returned by `geometry_of`.

        Returns
        -------
        np.ndarray
            (K, network.width).
        """
        images = np.array([(patch.level, patch.unseen) for patch in patches], np.float32).transpose(0, 2, 3, 1)
        return self._networks[KINDS[patches[0].graded]].embedding(images, geometry)

    def with_taught(self, kind: str, known: np.ndarray, embedding: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the probabilities of the recogniser's ``outputs``, without adaptations.

        Parameters
        ----------
        kind : str
            Kind of frame, one of KINDS.
        known : np.ndarray
            Probabilities of OUTPUTS, (K, 6).
        embedding : np.ndarray
            Embedding of the contacts, (K, network.width).
        log_taxels : np.ndarray
            Logarithm of the number of taxels of each contact, (K,).

        Returns
        -------
        np.ndarray
            Probabilities, (K, outputs).
        """
        if kind in self._heads:
            return join(known, self._heads[kind].evidence(embedding, log_taxels))
        return np.pad(known, ((0, 0), (0, len(self._taught)))) if self._taught else known

    def known(self, kind: str, embedding: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the probabilities of OUTPUTS, without taught shapes and adaptations.

        Parameters
        ----------
        kind : str
            Kind of frame, one of KINDS.
        embedding : np.ndarray
            Embedding of K contacts, (K, F).
        log_taxels : np.ndarray
            Logarithm of the number of taxels of each contact, (K,).

        Returns
        -------
        np.ndarray
            Probabilities, (K, 6).
        """
        logits = self._networks[kind].logits(embedding)
        return self._calibrations[kind].probabilities(logits.astype(float), log_taxels)


def geometry_of(patches: Sequence[Patch]) -> np.ndarray:
    """Return the geometry of K patches, graded or not, (K, invariants.COUNT)."""
    return describe_all(np.array([patch.level for patch in patches]), np.array([patch.unseen for patch in patches]),
                        np.array([patch.scale for patch in patches]))


def _outlines(contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[int, Patch]:
    """Return the patches of contacts as if their taxels were on/off, by the index of the contact.

    Contacts with too few taxels are left out.
    """
    return {k: make_patch(np.where(np.isfinite(values), mask, np.nan), mask)
            for k, (values, mask) in enumerate(contacts) if np.count_nonzero(mask) >= FEWEST_TAXELS['on_off']}


def _as_foreign(probabilities: np.ndarray) -> np.ndarray:
    """Return probabilities of OUTPUTS, (K, 6), in which UNKNOWN has at least NOT_CONVEX_PROBABILITY."""
    unknown = np.maximum(probabilities[:, -1:], NOT_CONVEX_PROBABILITY)
    known = probabilities[:, :-1] * (1 - unknown) / np.maximum(1 - probabilities[:, -1:], 1e-12)
    return np.concatenate((known, unknown), 1)


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """Return all arrays of a .npz file by name.

    The size is checked before the file is unpacked, because a small .npz file may unpack to more data than fits in
    memory.

    Raises
    ------
    ValueError
        Raised if the arrays are too large, use a compression method that NumPy does not write, or contain NaN or
        infinity.
    BadZipFile
        Raised if the file is not an archive.
    """
    with ZipFile(path) as packed:
        members = packed.infolist()
    if not {each.compress_type for each in members} <= {ZIP_STORED, ZIP_DEFLATED}:
        raise ValueError('a compression method that NumPy does not write')
    if (size := sum(each.file_size for each in members)) > MOST_ARRAY_BYTES:
        raise ValueError(f'{size} bytes of arrays, more than {MOST_ARRAY_BYTES}')
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    for name, array in arrays.items():
        if array.dtype.kind in 'fc' and not np.isfinite(array).all():
            raise ValueError(f'numbers that are not finite in {name}')
    return arrays


def _network(data: Mapping[str, np.ndarray], kind: str) -> Network:
    def arrays(name: str) -> tuple[np.ndarray, ...]:
        return tuple(data[f'{kind}_{name}{layer}'].astype(np.float32) for layer in range(LAYERS))
    network = Network(arrays('kernel'), arrays('bias'), data[f'{kind}_middle'], data[f'{kind}_spread'])
    fits = [kernel.shape[1:] == bias.shape for kernel, bias in zip(network.kernels, network.biases)]
    if not all(fits) or network.middle.shape != (COUNT,) or network.kernels[-1].shape[1] != len(OUTPUTS):
        raise ValueError(f'arrays of {kind} that do not fit together')
    if not (network.spread > 0).all():
        raise ValueError(f'a spread of {kind} that is not positive')
    return network


def _calibration(data: Mapping[str, np.ndarray], kind: str) -> Calibration:
    biases = data[f'{kind}_biases'].astype(float)
    if biases.shape != LOG_SIZES.shape:
        raise ValueError(f'{biases.shape[0]} biases of {kind}, not {len(SIZES)}')
    temperature = float(data[f'{kind}_temperature'])
    if temperature <= 0:
        raise ValueError(f'a temperature of {kind} that is not positive')
    return Calibration(temperature, biases)


def _unusable(path: str | Path, got: str) -> ConfigurationError:
    return ConfigurationError(f'weights of the recogniser, {path}', got=got,
                              expected='a file written by training/train.py, `tactile teach` or `tactile assess`',
                              remedy='Use config/recogniser.npz, or write the file again with one of these programs.')
