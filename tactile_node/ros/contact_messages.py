"""Contact patterns and their features as messages, and back."""

from array import array

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility
from tactile_node.helmholtz.features import UNDEFINED, Extremes, Features
from tactile_node.pose.pipeline import FoundContact, Taxels
from tactile_node.pose.profiles import Layer
from tactile_node.ros.time_messages import time_message
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_skin.msg import Contact, ContactFeatures, FeatureRange, TaxelArray


def taxel_array_message(frame: TaxelFrame, pitch: float, unit: str, frame_id: str,
                        layer: Layer | None = None) -> TaxelArray:
    """``pitch`` [m], ``unit``, ``frame_id`` and ``layer``, if it is known, are the pad's."""
    message = TaxelArray(
        sequence=frame.sequence, rows=frame.values.shape[0], cols=frame.values.shape[1], pitch=pitch, unit=unit,
        values=as_array('f', frame.values, np.float32), status=as_array('B', frame.status, np.uint8),
        missing_can_frames=frame.missing_can_frames)
    message.header.stamp = time_message(frame.stamp)
    message.header.frame_id = frame_id
    if layer is not None:
        message.layer_depth, message.layer_deviation = layer
    if frame.tpdo_ages is not None:
        message.tpdo_ages = as_array('f', frame.tpdo_ages.ages, np.float32)
        message.taxel_tpdos = as_array('H', frame.tpdo_ages.taxel_tpdos, np.uint16)
    return message


def taxel_values(message: TaxelArray | Contact) -> np.ndarray:
    """Return the values of a TaxelArray or Contact, float32, shape (rows, cols), NaN = no valid value."""
    return np.frombuffer(message.values, np.float32).reshape(message.rows, message.cols)


def as_array(code: str, values: np.ndarray, dtype: type) -> array:
    """Return ``values`` as array.array, row by row: rclpy checks any other sequence element by element."""
    return array(code, np.ascontiguousarray(values, dtype).tobytes())


def contact_message(taxels: TaxelArray, found: FoundContact) -> Contact:
    """``found``: in ``taxels``."""
    pattern, visibility, _, smallest_contact = found
    values, status = _without_left_over(taxels, pattern)
    return Contact(
        header=taxels.header, sequence=taxels.sequence, age=taxels.age, state=pad_state(pattern, visibility),
        smallest_contact=smallest_contact,
        pad_seen=visibility.pad_seen, rows=taxels.rows, cols=taxels.cols, pitch=taxels.pitch, unit=taxels.unit,
        values=values, status=status, labels=as_array('B', pattern.labels, np.uint8),
        contacts=pattern.contacts, contact_taxels=array('I', pattern.sizes),
        noise_floor=as_array('f', pattern.noise, np.float32) if np.isfinite(pattern.noise).all() else array('f'),
        layer_depth=taxels.layer_depth, layer_deviation=taxels.layer_deviation,
        missing_can_frames=taxels.missing_can_frames)


def _without_left_over(taxels: TaxelArray, pattern: ContactPattern) -> tuple[array, array]:
    """Return values and status of the taxels; those left over by a contact are FAULTY, without a value."""
    left = pattern.hidden & np.isfinite(taxel_values(taxels))
    if not left.any():
        return taxels.values, taxels.status
    status = np.frombuffer(taxels.status, np.uint8).reshape(left.shape)
    return (as_array('f', pattern.values, np.float32),
            as_array('B', np.where(left, TaxelStatus.FAULTY, status), np.uint8))


def pad_state(pattern: ContactPattern, visibility: Visibility) -> int:
    """Return the `state` of a Contact: without a contact, a pad that is not seen is not EMPTY."""
    if pattern.contacts:
        return Contact.TOUCHED
    return Contact.EMPTY if visibility.pad_seen else Contact.NOT_SEEN


def contact_of(message: Contact) -> FoundContact:
    """Return the contact that ``message`` was made from. Whether the pad was seen is for its sender to say."""
    taxels = Taxels(message.pitch, message.unit, layer_of(message))
    found = FoundContact.of(_pattern(message), taxels, message.smallest_contact)
    return found._replace(visibility=found.visibility._replace(pad_seen=message.pad_seen))


def _pattern(message: Contact) -> ContactPattern:
    labels = np.frombuffer(message.labels, np.uint8).reshape(message.rows, message.cols)
    values = taxel_values(message).astype(float)
    unmapped = taxels_of(message, TaxelStatus.UNMAPPED)
    return ContactPattern(
        mask=labels == 1, values=values, contacts=message.contacts, labels=labels, sizes=tuple(message.contact_taxels),
        hidden=~(np.isfinite(values) | unmapped), saturated=taxels_of(message, TaxelStatus.SATURATED),
        unmapped=unmapped, noise=_noise(message))


def layer_of(message: TaxelArray | Contact) -> Layer | None:
    """Return the layer of a calibrated skin, None where it is not known."""
    return Layer(message.layer_depth, message.layer_deviation) if message.layer_depth else None


def _noise(message: Contact) -> np.ndarray:
    if not len(message.noise_floor):
        return np.full((message.rows, message.cols), np.nan)
    return np.frombuffer(message.noise_floor, np.float32).reshape(message.rows, message.cols).astype(float)


def taxels_of(message: TaxelArray | Contact, status: TaxelStatus) -> np.ndarray:
    """Return which taxels of ``message`` have this status, bool, shape (rows, cols)."""
    codes = np.frombuffer(message.status, np.uint8).reshape(message.rows, message.cols)
    of_status: np.ndarray = codes == status
    return of_status


def features_message(taxels: TaxelArray, found: FoundContact, features: Features) -> ContactFeatures:
    """Return the ``features`` of what was ``found`` in ``taxels``; without a contact the list stays empty."""
    pattern, visibility = found.pattern, found.visibility
    return ContactFeatures(
        header=taxels.header, sequence=taxels.sequence, age=taxels.age, state=pad_state(pattern, visibility),
        hidden_taxels=visibility.hidden_in_contact + visibility.hidden_in_ring, contacts=pattern.contacts,
        rows=taxels.rows, cols=taxels.cols, pitch=taxels.pitch, pattern=as_array('B', pattern.mask, np.uint8),
        features=_feature_ranges(features) if pattern.contacts else [])


def features_of(message: ContactFeatures) -> Features:
    """Return the features of ``message``, as `compute_features` gave them to its sender."""
    values, rotated = {'N': 0.0}, {}
    for feature in message.features:
        values[feature.name] = feature.value
        rotated[feature.name] = Extremes(min=feature.min, max=feature.max, dif=feature.dif,
                                         min_angle=_angle(feature.min_angle), max_angle=_angle(feature.max_angle))
    return Features(values, rotated)


def _feature_ranges(features: Features) -> list[FeatureRange]:
    return [_feature_range(name, value, features.rotated.get(name, UNDEFINED))
            for name, value in features.values.items()]


def _feature_range(name: str, value: float, rotated: Extremes) -> FeatureRange:
    return FeatureRange(name=name, value=float(value), min=rotated.min, max=rotated.max, dif=rotated.dif,
                        min_angle=_degrees(rotated.min_angle), max_angle=_degrees(rotated.max_angle))


def _degrees(angle: int | None) -> float:
    return float('nan') if angle is None else float(angle)


def _angle(degrees: float) -> int | None:
    return None if degrees != degrees else int(degrees)
