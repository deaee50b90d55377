"""Results -> messages, and back where a node reads another's message."""

from array import array

import numpy as np
from builtin_interfaces.msg import Time

from tactile_node.contact.pattern import ContactPattern
from tactile_node.helmholtz.features import Features, Turned
from tactile_node.shape.recognition import Recognition, Shape
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import ContactFeatures, ContactShape, FeatureRange, TaxelArray


def time_message(seconds: float) -> Time:
    """Seconds since the Unix epoch -> Time."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def taxel_array_message(frame: TaxelFrame, pitch: float, unit: str, frame_id: str) -> TaxelArray:
    message = TaxelArray(
        sequence=frame.sequence, rows=frame.values.shape[0], cols=frame.values.shape[1], pitch=pitch, unit=unit,
        values=_array('f', frame.values, np.float32), status=_array('B', frame.status, np.uint8),
        missing_can_frames=frame.missing_can_frames)
    message.header.stamp = time_message(frame.stamp)
    message.header.frame_id = frame_id
    return message


def taxel_values(message: TaxelArray) -> np.ndarray:
    """Return the values of ``message``, float32, shape (rows, cols), NaN = no valid value."""
    return np.frombuffer(message.values, np.float32).reshape(message.rows, message.cols)


def features_message(taxels: TaxelArray, pattern: ContactPattern, features: Features) -> ContactFeatures:
    """An empty pattern has no features: the list stays empty."""
    return ContactFeatures(
        header=taxels.header, sequence=taxels.sequence, contacts=pattern.contacts,
        missing_can_frames=taxels.missing_can_frames, rows=taxels.rows, cols=taxels.cols, pitch=taxels.pitch,
        pattern=_array('B', pattern.mask, np.uint8), features=_feature_ranges(features) if pattern.contacts else [])


def features_of(message: ContactFeatures) -> Features:
    """Return the features of ``message``, as `compute_features` gave them to its sender."""
    values, turned = {'N': 0.0}, {}
    for feature in message.features:
        values[feature.name] = feature.value
        turned[feature.name] = Turned(feature.min, feature.max, feature.dif, _angle(feature.min_angle),
                                      _angle(feature.max_angle))
    return Features(values, turned)


#: Shape.msg numbers of our shapes, also the index into ContactShape.probabilities.
SHAPE_NUMBERS = {
    Shape.NONE: ContactShape.NONE, Shape.UNKNOWN: ContactShape.UNKNOWN, Shape.CIRCLE: ContactShape.CIRCLE,
    Shape.SQUARE: ContactShape.SQUARE, Shape.RECTANGLE: ContactShape.RECTANGLE,
    Shape.RIGHT_TRIANGLE: ContactShape.RIGHT_TRIANGLE, Shape.ISOSCELES_TRIANGLE: ContactShape.ISOSCELES_TRIANGLE}


def shape_message(features: ContactFeatures, recognition: Recognition, method: str) -> ContactShape:
    probabilities = np.zeros(len(SHAPE_NUMBERS), np.float32)
    for shape, number in SHAPE_NUMBERS.items():
        probabilities[number] = recognition.probabilities[shape]
    return ContactShape(
        header=features.header, sequence=features.sequence, shape=SHAPE_NUMBERS[recognition.shape],
        confidence=float(recognition.probabilities[recognition.shape]), probabilities=probabilities, method=method,
        taxels=sum(features.pattern), missing_can_frames=features.missing_can_frames)


def _feature_ranges(features: Features) -> list[FeatureRange]:
    undefined = Turned(*[float('nan')] * 3, None, None)
    return [_feature_range(name, value, features.turned.get(name, undefined))
            for name, value in features.values.items()]


def _feature_range(name: str, value: float, turned: Turned) -> FeatureRange:
    return FeatureRange(name=name, value=float(value), min=turned.min, max=turned.max, dif=turned.dif,
                        min_angle=_degrees(turned.min_angle), max_angle=_degrees(turned.max_angle))


def _degrees(angle: int | None) -> float:
    return float('nan') if angle is None else float(angle)


def _angle(degrees: float) -> int | None:
    return None if degrees != degrees else int(degrees)


def _array(code: str, values: np.ndarray, dtype: type) -> array:
    """As array.array: rclpy checks any other sequence element by element."""
    return array(code, np.ascontiguousarray(values, dtype).tobytes())
