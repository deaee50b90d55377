"""Features as messages, and back."""

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility
from tactile_node.helmholtz.features import UNDEFINED, Extremes, Features
from tactile_node.ros.contact_messages import pad_state
from tactile_node.ros.taxel_messages import as_array
from tactile_skin.msg import ContactFeatures, FeatureRange, TaxelArray


def features_message(taxels: TaxelArray, pattern: ContactPattern, visibility: Visibility,
                     features: Features) -> ContactFeatures:
    """An empty pattern has no features: the list stays empty."""
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
