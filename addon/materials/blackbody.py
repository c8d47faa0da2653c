# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour of a black body, as Blender has it: linear Rec.709 of luminance 1."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

LOWEST, HIGHEST = 800.0, 12000.0  # kelvin; Blender's range


def _lobe(x: npt.NDArray[np.float64], center: float, low: float, high: float) -> npt.NDArray[np.float64]:
    t = (x - center) * np.where(x < center, low, high)
    return np.exp(-0.5 * t * t)


def xyz_sensitivities(nm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """CIE 1931 colour matching functions (N, 3) at wavelengths in nm.

    Multi-lobe fit of Wyman, Sloan and Shirley 2013, "Simple Analytic Approximations to the CIE XYZ Color Matching
    Functions", Journal of Computer Graphics Techniques 2(2).
    """
    x = 1.056 * _lobe(nm, 599.8, 0.0264, 0.0323) + 0.362 * _lobe(nm, 442.0, 0.0624, 0.0374)
    x -= 0.065 * _lobe(nm, 501.1, 0.0490, 0.0382)
    y = 0.821 * _lobe(nm, 568.8, 0.0213, 0.0247) + 0.286 * _lobe(nm, 530.9, 0.0613, 0.0322)
    z = 1.217 * _lobe(nm, 437.0, 0.0845, 0.0278) + 0.681 * _lobe(nm, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z], axis=-1)


#: Linear Rec.709 from CIE XYZ (IEC 61966-2-1).
REC709_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def blackbody_rgb(kelvin: float) -> npt.NDArray[np.float64]:
    """(3,) linear Rec.709 of luminance 1; ``kelvin`` is clamped to Blender's range. Out-of-gamut blue is 0.

    Within 2 % of Blender from 2000 K up; below, the fit of the eye's far red makes it less red.
    """
    kelvin = min(max(kelvin, LOWEST), HIGHEST)
    nm = np.arange(360.0, 831.0, 2.0)
    metres = nm * 1e-9
    planck = metres**-5 / np.expm1(1.438777e-2 / (metres * kelvin))
    xyz = planck @ xyz_sensitivities(nm)
    return np.maximum(REC709_FROM_XYZ @ (xyz / xyz[1]), 0.0)


@functools.cache
def blackbody_table() -> tuple[npt.NDArray[np.float64], float, float]:
    """(N, 5) table of position 0..1 and RGBA, with the temperatures of its ends in kelvin."""
    positions = np.linspace(0.0, 1.0, 256)
    colors = [(*blackbody_rgb(LOWEST + (HIGHEST - LOWEST) * p), 1.0) for p in positions]
    return np.column_stack([positions, colors]), LOWEST, HIGHEST
