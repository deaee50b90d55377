"""Set up the conditioning of the driver's pads from its settings."""

from collections.abc import Mapping
from types import MappingProxyType

from tactile_node.conditioning.conditioned_pad import ConditionedPad
from tactile_node.conditioning.drift import DriftFollower
from tactile_node.conditioning.faulty_taxels_file import load_faults
from tactile_node.conditioning.gain import load_gains
from tactile_node.conditioning.tare import ContactGuard, drift_limit, rest_limit
from tactile_node.conditioning.tared_pad import TaredPad
from tactile_node.conditioning.taxel_faults import FaultDetector
from tactile_node.errors import ConfigurationError
from tactile_node.learning.response import SkinResponse, load_response
from tactile_node.pose.profiles import check_layer
from tactile_node.ros.settings import DriverSettings
from tactile_node.skin.pads import PadSettings, one_for_each
from tactile_node.taxel_frame import ON_OFF_UNIT

MASK = 'mask'
REPORT = 'report'


def skin_responses(pads: tuple[PadSettings, ...], settings: DriverSettings) -> dict[str, SkinResponse]:
    """Return the skin response of each pad that has a response file, by pad name.

    Raises
    ------
    ConfigurationError
        Raised if a file cannot be used, or if its unit or pitch differs from the unit or pitch of the pad.
    """
    found = {}
    for pad, path in zip(pads, one_for_each('response_files', settings.response_files, pads)):
        if path:
            found[pad.name] = response = load_response(path)
            if response.unit != pad.layout.value.unit:
                raise ConfigurationError(f'{path}, pad {pad.name!r}', got=f'readings in {response.unit!r}',
                                         expected=f'a response to readings in {pad.layout.value.unit!r}',
                                         remedy='Repeat the calibration with the layout of this pad.')
            check_layer(response.layer, pad.layout.pitch)
    return found


def conditioned_pads(pads: tuple[PadSettings, ...], settings: DriverSettings,
                     responses: Mapping[str, SkinResponse] = MappingProxyType({})) -> dict[str, ConditionedPad]:
    """Return the conditioning stage of each pad, by pad name.

    Parameters
    ----------
    pads
        Pads of the driver.
    settings
        Settings of the driver.
    responses
        Skin responses by pad name. Pads without a response are absent.

    Raises
    ------
    ConfigurationError
        Raised if a parameter, a gain file or the file of faulty taxels is invalid.
    """
    gain_files = one_for_each('gain_files', settings.gain_files, pads)
    shapes = {pad.name: (pad.layout.rows, pad.layout.cols) for pad in pads}
    known = load_faults(settings.faulty_taxels_file, shapes) if settings.faulty_taxels_file else {}
    made = {}
    for pad, gain_file in zip(pads, gain_files):
        unit = pad.layout.value.unit
        gains = load_gains(gain_file, *shapes[pad.name]) if gain_file else None
        guard = ContactGuard.of_unit(unit, 1.0 if gains is None else gains)
        detector = FaultDetector(*shapes[pad.name], rest_limit(settings.tare_limit, unit))
        curve = responses[pad.name].curve if pad.name in responses else None
        made[pad.name] = ConditionedPad(TaredPad(guard), detector, known.get(pad.name) or detector.faults, gains,
                                        curve)
    adjust(made, {pad.name: pad.layout.value.unit for pad in pads}, settings)
    return made


def adjust(pads: Mapping[str, ConditionedPad], units: Mapping[str, str], settings: DriverSettings) -> None:
    """Apply the settings that may change while taxel frames are processed.

    Raises
    ------
    ConfigurationError
        Raised if a setting is invalid. If the error is raised, no setting has changed.
    """
    masks = masks_faulty(settings.faulty_taxels)
    rest = {name: rest_limit(settings.tare_limit, units[name]) for name in pads}
    drifting = {name: drift_limit(settings.tare_limit, units[name], pad.gains) for name, pad in pads.items()
                if settings.follow_drift and units[name] != ON_OFF_UNIT}  # on/off taxels have no zero that could drift
    for name, pad in pads.items():
        pad.masks = masks
        pad.detector.limit = rest[name]
        pad.frozen_after = settings.frozen_after
        if (pad.tared.drift is None) != (name not in drifting):
            pad.tared.drift = DriftFollower(drifting[name]) if name in drifting else None
        elif pad.tared.drift is not None:
            pad.tared.drift.limit = drifting[name]


def masks_faulty(given: str) -> bool:
    """Return True if detected faulty taxels are masked. Raises ConfigurationError if ``given`` is unknown."""
    if given not in (MASK, REPORT):
        raise ConfigurationError('parameter faulty_taxels', expected=f'{MASK} or {REPORT}', got=repr(given),
                                 remedy='Set the parameter to one of these values.')
    return given == MASK
