"""What the driver's parameters say about the conditioning of its pads."""

from collections.abc import Mapping
from types import SimpleNamespace

from tactile_node.conditioning.conditioned_pad import ConditionedPad
from tactile_node.conditioning.drift import DriftFollower
from tactile_node.conditioning.fault_file import load_faults
from tactile_node.conditioning.gain import load_gains
from tactile_node.conditioning.tare import TaredPad
from tactile_node.conditioning.taxel_faults import FaultDetector
from tactile_node.ros.parameters import masks_faulty, rest_limit, tare_limit
from tactile_node.skin.pads import PadSettings, one_for_each


def conditioned_pads(pads: tuple[PadSettings, ...], settings: SimpleNamespace) -> dict[str, ConditionedPad]:
    """Make them by name. Raises ConfigurationError for a wrong parameter, gain file or file of faulty taxels."""
    gain_files = one_for_each('gain_files', settings.gain_files, pads)
    shapes = {pad.name: (pad.layout.rows, pad.layout.cols) for pad in pads}
    known = load_faults(settings.faulty_taxels_file, shapes) if settings.faulty_taxels_file else {}
    made = {}
    for pad, gain_file in zip(pads, gain_files):
        detector = FaultDetector(*shapes[pad.name], rest_limit(settings.tare_limit, pad.layout.value.unit))
        made[pad.name] = ConditionedPad(TaredPad(), detector, known.get(pad.name) or detector.faults,
                                        load_gains(gain_file, *shapes[pad.name]) if gain_file else None)
    adjust(made, {pad.name: pad.layout.value.unit for pad in pads}, settings)
    return made


def adjust(pads: Mapping[str, ConditionedPad], units: Mapping[str, str], settings: SimpleNamespace) -> None:
    """Take what may change while frames flow. Raises ConfigurationError, nothing changed then."""
    masks = masks_faulty(settings.faulty_taxels)
    rest = {name: rest_limit(settings.tare_limit, units[name]) for name in pads}
    drifting = {name: tare_limit(settings.tare_limit, units[name]) for name in pads
                if settings.follow_drift and units[name] != '1'}  # on/off taxels have no zero
    for name, pad in pads.items():
        pad.masks, pad.detector.limit, pad.frozen_after = masks, rest[name], settings.frozen_after
        if (pad.tared.drift is None) != (name not in drifting):
            pad.tared.drift = DriftFollower(drifting[name]) if name in drifting else None
        elif pad.tared.drift is not None:
            pad.tared.drift.limit = drifting[name]
