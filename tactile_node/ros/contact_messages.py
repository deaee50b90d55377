"""Convert taxel frames, contacts and features to messages and back."""

import math
from array import array
from typing import NamedTuple

import numpy as np
from std_msgs.msg import Header

from tactile_node.contact.pattern import ContactPattern
from tactile_node.helmholtz.features import UNDEFINED, Extremes, Features
from tactile_node.pose.pipeline import FoundContact, Taxels
from tactile_node.pose.profiles import Layer
from tactile_node.ros.time_messages import time_message
from tactile_node.taxel_frame import SkinSide, TaxelFrame, TaxelStatus, TpdoAges
from tactile_skin.msg import Contact, ContactFeatures, FeatureRange, TaxelArray


class PadFrame(NamedTuple):
    """The content of a `TaxelArray`, which the stages in one process pass on without a message."""

    header: Header          #: stamp and coordinate frame of the pad
    sequence: int
    values: np.ndarray      #: taxel values, float32, shape (rows, cols); NaN where no value is valid
    status: np.ndarray      #: `TaxelStatus` of each taxel, uint8, shape (rows, cols)
    taxels: Taxels
    missing_can_frames: int
    acquired: float = -math.inf  #: time when the taxels were acquired, on the steady clock [s]; -inf if not known
    tpdo_ages: TpdoAges | None = None
    left_out: int = 0  #: number of frames before this one that newer frames have overtaken

    @classmethod
    def of(cls, frame: TaxelFrame, taxels: Taxels, frame_id: str) -> 'PadFrame':
        """Return a frame whose numbers are rounded as in a message, so that calls and messages give equal results."""
        layer = None if taxels.layer is None else Layer(*map(single, taxels.layer))
        return cls(Header(stamp=time_message(frame.stamp), frame_id=frame_id), frame.sequence,
                   np.ascontiguousarray(frame.values, np.float32), np.ascontiguousarray(frame.status, np.uint8),
                   taxels._replace(pitch=single(taxels.pitch), layer=layer), frame.missing_can_frames, frame.acquired,
                   frame.tpdo_ages)


class PadContact(NamedTuple):
    """The content of a `Contact`, which the stages in one process pass on without a message."""

    frame: PadFrame
    found: FoundContact
    left_out: int = 0  #: number of frames before this one that newer frames have overtaken

    @classmethod
    def of(cls, frame: PadFrame, found: FoundContact) -> 'PadContact':
        """Return the contact in a frame, with its noise rounded as in a message; see `PadFrame.of`."""
        noise = found.pattern.noise.astype(np.float32).astype(float)
        known = noise if np.isfinite(noise).all() else np.full(noise.shape, np.nan)
        return cls(frame, found._replace(pattern=found.pattern._replace(noise=known)), frame.left_out)

    @property
    def header(self) -> Header:
        return self.frame.header

    @property
    def sequence(self) -> int:
        return self.frame.sequence

    @property
    def acquired(self) -> float:
        return self.frame.acquired


def taxel_array_message(frame: PadFrame) -> TaxelArray:
    message = TaxelArray(
        header=frame.header, sequence=frame.sequence, rows=frame.values.shape[0], cols=frame.values.shape[1],
        pitch=frame.taxels.pitch, unit=frame.taxels.unit, values=as_array('f', frame.values, np.float32),
        status=as_array('B', frame.status, np.uint8), missing_can_frames=frame.missing_can_frames,
        finger_ends=int(frame.taxels.finger_ends))
    if frame.taxels.layer is not None:
        message.layer_depth, message.layer_deviation = frame.taxels.layer
    if frame.tpdo_ages is not None:
        message.tpdo_ages = as_array('f', frame.tpdo_ages.ages, np.float32)
        message.taxel_tpdos = as_array('H', frame.tpdo_ages.taxel_tpdos, np.uint16)
    return message


def pad_frame_of(message: TaxelArray | Contact, acquired: float = -math.inf) -> PadFrame:
    """Return the frame from which ``message`` was created, but without the ages of its TPDOs.

    ``acquired`` is the time when the taxels were acquired, on the steady clock [s]; -inf if not known.
    """
    layer = Layer(message.layer_depth, message.layer_deviation) if message.layer_depth else None
    return PadFrame(message.header, message.sequence, taxel_values(message),
                    np.frombuffer(message.status, np.uint8).reshape(message.rows, message.cols),
                    Taxels(message.pitch, message.unit, layer, SkinSide(message.finger_ends)),
                    message.missing_can_frames, acquired)


def taxel_values(message: TaxelArray | Contact) -> np.ndarray:
    """Return the taxel values of a message as float32, shape (rows, cols); NaN means no valid value."""
    return np.frombuffer(message.values, np.float32).reshape(message.rows, message.cols)


def as_array(code: str, values: np.ndarray, dtype: type) -> array:
    """Return ``values`` row by row as array.array, because rclpy checks any other sequence element by element."""
    return array(code, np.ascontiguousarray(values, dtype).tobytes())


def without_left_over(contact: PadContact) -> PadFrame:
    """Return the frame of a contact, in which left-over taxels are FAULTY and have no value."""
    frame = contact.frame
    left = contact.found.pattern.hidden & np.isfinite(frame.values)
    if not left.any():
        return frame
    return frame._replace(values=np.where(left, np.float32(np.nan), frame.values),
                          status=np.where(left, np.uint8(TaxelStatus.FAULTY), frame.status))


def contact_message(contact: PadContact) -> Contact:
    frame, (pattern, visibility, taxels, smallest_contact) = without_left_over(contact), contact.found
    message = Contact(
        header=frame.header, sequence=frame.sequence, state=pad_state(contact.found), left_out=contact.left_out,
        smallest_contact=smallest_contact, pad_seen=visibility.pad_seen, rows=frame.values.shape[0],
        cols=frame.values.shape[1], pitch=taxels.pitch, unit=taxels.unit,
        values=as_array('f', frame.values, np.float32),
        status=as_array('B', frame.status, np.uint8), labels=as_array('B', pattern.labels, np.uint8),
        contacts=pattern.contacts, contact_taxels=array('I', pattern.sizes),
        noise_floor=as_array('f', pattern.noise, np.float32) if np.isfinite(pattern.noise).all() else array('f'),
        missing_can_frames=frame.missing_can_frames, finger_ends=int(taxels.finger_ends))
    if taxels.layer is not None:
        message.layer_depth, message.layer_deviation = taxels.layer
    return message


def pad_state(found: FoundContact) -> int:
    """Return the `state` of a Contact. A pad without a contact is EMPTY only if the whole pad was seen."""
    if found.pattern.contacts:
        return int(Contact.TOUCHED)
    return int(Contact.EMPTY if found.visibility.pad_seen else Contact.NOT_SEEN)


def pad_contact_of(message: Contact, acquired: float = -math.inf) -> PadContact:
    """Return the contact from which ``message`` was created. The message states whether the pad was seen.

    ``acquired`` is the time when the taxels were acquired, on the steady clock [s]; -inf if not known.
    """
    frame = pad_frame_of(message, acquired)
    found = FoundContact.of(_pattern(message, frame), frame.taxels, message.smallest_contact)
    seen = found.visibility._replace(pad_seen=message.pad_seen)
    return PadContact(frame, found._replace(visibility=seen), message.left_out)


def _pattern(message: Contact, frame: PadFrame) -> ContactPattern:
    """Return the pattern in a message, from which the recognition gives bit-identical results.

    The message lacks ``is_covered`` and ``is_left_over``. Only ``pad_seen`` depends on them, and the message contains
    ``pad_seen``.
    """
    labels = np.frombuffer(message.labels, np.uint8).reshape(message.rows, message.cols)
    values, unmapped = frame.values.astype(float), frame.status == TaxelStatus.UNMAPPED
    return ContactPattern(
        mask=labels == 1, values=values, contacts=message.contacts, labels=labels, sizes=tuple(message.contact_taxels),
        hidden=~(np.isfinite(values) | unmapped), saturated=frame.status == TaxelStatus.SATURATED,
        unmapped=unmapped, noise=_noise(message))


def _noise(message: Contact) -> np.ndarray:
    if not len(message.noise_floor):
        return np.full((message.rows, message.cols), np.nan)
    return np.frombuffer(message.noise_floor, np.float32).reshape(message.rows, message.cols).astype(float)


def features_message(contact: PadContact, features: Features) -> ContactFeatures:
    """Return the features of a contact as a message, with an empty list if there is no contact."""
    frame, (pattern, visibility, taxels, _) = contact.frame, contact.found
    return ContactFeatures(
        header=frame.header, sequence=frame.sequence, state=pad_state(contact.found),
        hidden_taxels=visibility.hidden_in_contact + visibility.hidden_in_ring, contacts=pattern.contacts,
        rows=pattern.mask.shape[0], cols=pattern.mask.shape[1], pitch=taxels.pitch,
        pattern=as_array('B', pattern.mask, np.uint8), features=_feature_ranges(features) if pattern.contacts else [])


def _feature_ranges(features: Features) -> list[FeatureRange]:
    return [_feature_range(name, value, features.rotated.get(name, UNDEFINED))
            for name, value in features.values.items()]


def _feature_range(name: str, value: float, rotated: Extremes) -> FeatureRange:
    return FeatureRange(name=name, value=float(value), min=rotated.min, max=rotated.max, dif=rotated.dif,
                        min_angle=_degrees(rotated.min_angle), max_angle=_degrees(rotated.max_angle))


def _degrees(angle: int | None) -> float:
    return float('nan') if angle is None else float(angle)


def single(value: float) -> float:
    """Return ``value`` rounded to single precision, as a message stores it."""
    return float(np.float32(value))
