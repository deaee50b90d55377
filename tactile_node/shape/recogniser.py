"""The learned recogniser: contact pattern -> patch and geometry -> two small networks -> probabilities.

One network is for on/off taxels, one for pressures. Each gives five logits, one a class, which are divided by a
temperature found on validation patterns, and one that the contact is none of them, which has a bias.
The weights are data (config/recogniser.npz), written by training/train.py. A file of `tactile teach` has the same
arrays and, after them, the heads of taught shapes (taught.py); one of `tactile assess` has the adaptation to a skin
(adaptation.py).
"""

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import ConfigurationError
from tactile_node.shape.adaptation import Adaptation, read_adaptations
from tactile_node.shape.convexity import is_convex
from tactile_node.shape.invariants import COUNT, LOG_TAXELS, OVERLAPS, describe_all
from tactile_node.shape.network import TAPS, Network
from tactile_node.shape.patch import Patch, joined, make_patch
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, TaughtShape, UnknownReason
from tactile_node.shape.support import as_far_as_it_fits, as_far_as_it_holds, low_outline
from tactile_node.shape.taught import Head, join, read_taught

#: what each output of the networks in the weights' file stands for; its order is part of the file's format
OUTPUTS = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE, Shape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE, Shape.UNKNOWN)
#: a pattern of fewer taxels is UNKNOWN: it stands for a contact of less than nine taxels' area, of which
#: pressures show the rim
FEWEST_TAXELS = {'on_off': 6, 'graded': 4}
DOUBT_GAIN = 0.2   #: by so much the whole must be likelier unknown than its largest piece to be given up
MOST_OF_PIECES = 0.5  #: it has so many of their taxels; several pieces alike are one contact of several parts
NOT_CONVEX_PROBABILITY = 0.99     #: probability of UNKNOWN, at least, of a contact that is not convex
LAYERS = len(TAPS) + 3
MOST_ARRAY_BYTES = 1 << 24  #: size of the arrays of a file, far more than ours have
KINDS = ('on_off', 'graded')  #: kinds of frames: without and with values between none and full
SIZES = (12, 17, 24, 34, 48, 68, 96, 136, 200, 300)  #: taxels at which the evidence for UNKNOWN is calibrated
LOG_SIZES = np.log(SIZES)


class Calibration(NamedTuple):
    """From logits to probabilities."""

    temperature: float   #: temperature of the classes
    biases: np.ndarray   #: shape (len(SIZES),): how much evidence it takes to answer UNKNOWN, by size

    def probabilities(self, logits: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the probabilities of the five classes and of UNKNOWN, (K, 6), of logits (K, 6)."""
        scaled = logits[:, :-1] / self.temperature
        odds = np.exp(scaled - scaled.max(1, keepdims=True))
        foreign = 1 / (1 + np.exp(np.interp(log_taxels, LOG_SIZES, self.biases) - logits[:, -1]))[:, None]
        return np.concatenate((odds / odds.sum(1, keepdims=True) * (1 - foreign), foreign), 1)


class ShapeRecogniser:
    """Recognises the shape of a contact from on/off taxels or, better, from pressures.

    ``heads``: by kind of frames, of the ``taught`` shapes; a kind without one knows none of them.
    ``adaptations``: by kind of frames, to one skin; a kind without one is answered as on any skin.
    """

    def __init__(self, networks: dict[str, Network], calibrations: dict[str, Calibration],
                 taught: tuple[TaughtShape, ...] = (), heads: Mapping[str, Head] = MappingProxyType({}),
                 adaptations: Mapping[str, Adaptation] = MappingProxyType({})):
        self._networks, self._calibrations, self._heads = networks, calibrations, heads
        self._taught, self._adaptations = taught, adaptations
        self.outputs: tuple[ShapeClass, ...] = (*OUTPUTS, *taught)  #: what the columns of `probabilities` stand for
        self.classes: tuple[ShapeClass, ...] = (*Shape, *taught)    #: every class that a recognition may name

    @classmethod
    def from_file(cls, path: str | Path) -> 'ShapeRecogniser':
        """Read what training/train.py wrote; ConfigurationError where it is not that."""
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
                NotImplementedError, RuntimeError, zlib.error) as error:  # numpy lets zipfile's and zlib's through
            raise _unusable(path, ' '.join(str(error).split())) from None

    def adapted(self, adaptations: Mapping[str, Adaptation]) -> 'ShapeRecogniser':
        """Return the same recogniser with other adaptations."""
        return ShapeRecogniser(self._networks, self._calibrations, self._taught, self._heads, adaptations)

    def recognise(self, pattern: ContactPattern) -> Recognition:
        """Return the most probable shape; NONE for an empty pattern, UNKNOWN below FEWEST_TAXELS taxels.

        Pieces that may belong to one torn contact are looked at as one, unless that is much more
        likely to be no known shape than the largest of them alone.
        """
        return self.recognise_all([pattern])[0]

    def recognise_all(self, patterns: Sequence[ContactPattern]) -> list[Recognition]:
        """Recognise each pattern as `recognise` does, in less time than one after another."""
        together = [joined(pattern) for pattern in patterns]
        whole = self._verified([(pattern.values, mask) for pattern, mask in zip(patterns, together)])
        return [self._decide(pattern, mask, found) for pattern, mask, found in zip(patterns, together, whole)]

    def _decide(self, pattern: ContactPattern, together: np.ndarray, whole: Recognition) -> Recognition:
        """Choose between the pieces together and the largest alone, where that is most of them."""
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
        """Return the recognition of each contact, given as values and mask, no surer than its low outline allows.

        Both outlines are recognised together, which takes little longer than one.
        """
        low = [low_outline(*contact) for contact in contacts]
        lower = [(values, mask) for (values, _), mask in zip(contacts, low) if mask is not None]
        found = self._recognise_contacts([*contacts, *lower])
        of_low = iter(found[len(contacts):])
        return [each if mask is None else as_far_as_it_holds(each, next(of_low)) for each, mask in zip(found, low)]

    def _recognise_contacts(self, contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Recognition]:
        """Return the recognition of each contact, given as values and mask."""
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
                probabilities, _, geometry = self.probabilities([patch for _, patch in alike],
                                                                [contacts[k] for k, _ in alike])
                for (k, patch), of_outputs, numbers in zip(alike, probabilities.tolist(), geometry):
                    found[k] = Recognition.of(dict(zip(self.outputs, of_outputs)))
                    if patch.graded:
                        found[k] = as_far_as_it_fits(found[k], int(np.count_nonzero(contacts[k][1])),
                                                     numbers[OVERLAPS])
        return found

    def probabilities(self, patches: Sequence[Patch],
                      contacts: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the probabilities of ``outputs``, (K, len(outputs)), and what `embedding` returns.

        ``patches`` are those of ``contacts``, pairs of values and mask. All of them are graded, or none is.
        """
        kind = KINDS[patches[0].graded]
        embedding, geometry = self.embedding(patches)
        found = self.known(kind, embedding, geometry[:, LOG_TAXELS])
        # The five shapes are convex; taught ones need not be. Silent lines tear the rim of on/off contacts into pieces,
        # which would not look convex, so only pressures are checked.
        convex = np.array([not patch.graded or is_convex(*contact) for patch, contact in zip(patches, contacts)])
        found[~convex] = _as_foreign(found[~convex])
        if kind in self._heads:
            found = join(found, self._heads[kind].evidence(embedding, geometry[:, LOG_TAXELS]))
        else:
            found = np.pad(found, ((0, 0), (0, len(self._taught))))
        if kind in self._adaptations:
            found = self._adaptations[kind].applied(found, embedding)
        return found, embedding, geometry

    def embedding(self, patches: Sequence[Patch]) -> tuple[np.ndarray, np.ndarray]:
        """Return what the heads of taught shapes see of patches all graded or all not, and the patches' numbers."""
        levels, unseen = np.array([patch.level for patch in patches]), np.array([patch.unseen for patch in patches])
        geometry = describe_all(levels, unseen, np.array([patch.scale for patch in patches]))
        network = self._networks[KINDS[patches[0].graded]]
        images = np.empty((*levels.shape, 2), np.float32)
        images[..., 0], images[..., 1] = levels, unseen
        return network.embedding(images, geometry), geometry

    def known(self, kind: str, embedding: np.ndarray, log_taxels: np.ndarray) -> np.ndarray:
        """Return the probabilities of OUTPUTS, (K, 6), as without taught shapes."""
        logits = self._networks[kind].logits(embedding)
        return self._calibrations[kind].probabilities(logits.astype(float), log_taxels)


def _as_foreign(probabilities: np.ndarray) -> np.ndarray:
    """Return probabilities of OUTPUTS, (K, 6), with that of UNKNOWN at least NOT_CONVEX_PROBABILITY."""
    unknown = np.maximum(probabilities[:, -1:], NOT_CONVEX_PROBABILITY)
    known = probabilities[:, :-1] * (1 - unknown) / np.maximum(1 - probabilities[:, -1:], 1e-12)
    return np.concatenate((known, unknown), 1)


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """Return all arrays of the file, of finite numbers; ValueError and zipfile's errors where it is not that.

    A few bytes of a .npz may stand for more than fits into memory.
    """
    with ZipFile(path) as packed:
        members = packed.infolist()
    if not {each.compress_type for each in members} <= {ZIP_STORED, ZIP_DEFLATED}:
        raise ValueError('another compression than that of NumPy')
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
                              remedy='Use config/recogniser.npz, or write the file again with one of them.')
