"""The noise of the taxels that nothing presses, by one frame."""

import numpy as np

from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import grown

FEWEST = 8             #: taxels that show the noise
TO_DEVIATION = 1.4826  #: from the median of absolute normal values


def resting_noise(pattern: ContactPattern) -> float:
    """Return the standard deviation of the taxels farther than 2 from any contact [unit of the values].

    Robust: 1.4826 times the median deviation from the median; where half of the taxels read the same, as in whole
    counts, the root mean square deviation. NaN where fewer than 8 taxels rest, or all read the same: noise below the
    resolution is not known.
    """
    resting = pattern.values[~(grown(grown(pattern.labels > 0)) | pattern.hidden | pattern.unmapped)]
    if resting.size < FEWEST:
        return float('nan')
    deviations = np.abs(resting - np.median(resting))
    noise = float(TO_DEVIATION * np.median(deviations)) or float(np.sqrt(np.mean(np.square(deviations))))
    return noise if noise > 0 else float('nan')
