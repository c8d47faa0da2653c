# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a picture is from what it should be. All pictures are (H, W, 3) linear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from blender_tests.pictures import Picture, bias, relative_mse

from .catalogue import BenchmarkScene
from .job import Job
from .store import Result

#: Weights of luminance, Rec. 709.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Answer:
    """A picture that is right, up to noise: two independent halves, and a denoised one that only weighs errors."""

    a: Picture
    b: Picture
    smooth: Picture

    @property
    def mean(self) -> Picture:
        return np.asarray(0.5 * (self.a + self.b), np.float32)

    def minus(self, a: Picture, b: Picture) -> Answer:
        """Without parts that the halves have."""
        return Answer(self.a - a, self.b - b, np.maximum(self.smooth - 0.5 * (a + b), 0.0))

    @classmethod
    def of(cls, results: dict[str, Result], frame: int = 0) -> Answer:
        """From the results of :func:`.peers.reference_jobs`."""
        return cls(*(results[name].picture(frame=frame) for name in ("a", "b", "smooth")))


@dataclass(frozen=True)
class Reference:
    """The path-traced answer: the whole picture, and what of it is indirect light."""

    full: Answer
    indirect: Answer | None
    direct: Picture | None  # what is subtracted from a whole picture to get the indirect light

    @classmethod
    def of(cls, scene: BenchmarkScene, results: dict[str, Result]) -> Reference:
        """From the results of :func:`.peers.reference_jobs`.

        Direct is what lamps light without a bounce, and what the camera sees glowing; light of the world and of
        surfaces that glow is indirect, as it is gathered. Cycles' own passes count such light as direct, so where a
        scene has both, a render of lamps alone is subtracted instead.
        """
        full = Answer.of(results)
        if scene.measure != "indirect":
            return cls(full, None, None)
        if "direct" in results:
            parts = [results["direct"].picture()] * 2
        else:
            parts = [_own_direct(scene, results[name]) for name in ("a", "b")]
        return cls(full, full.minus(*parts), np.asarray(0.5 * (parts[0] + parts[1]), np.float32))


def _own_direct(scene: BenchmarkScene, result: Result) -> Picture:
    seen = result.picture("seen")
    return seen + result.picture("direct") if scene.has_lamps else seen


def indirect_of(scene: BenchmarkScene, job: Job, result: Result, reference: Reference) -> Picture:
    """The indirect light in a picture. An engine's own direct light is subtracted where it tells that exactly, and else
    the reference's: then errors of direct light count as well."""
    assert reference.direct is not None
    split = job.passes and (job.engine == "conelight" or not (scene.has_lamps and scene.has_surroundings))
    return result.picture() - (_own_direct(scene, result) if split else reference.direct)


def compare(picture: Picture, answer: Answer) -> dict[str, float]:
    """Error of a picture."""
    return {
        "relative_mse": relative_mse(picture, answer.a, answer.b, answer.smooth),
        "bias": bias(picture, answer.mean),
        "median_error": median_relative_error(picture, answer.mean),
    }


def reference_noise(answer: Answer) -> float:
    """Relative mean squared error that the mean of two halves has by noise: their difference has twice the variance of
    one, and four times that of the mean."""
    noise = 0.5 * (answer.a - answer.b)
    return relative_mse(answer.smooth + noise, answer.smooth)


def median_relative_error(picture: Picture, reference: Picture) -> float:
    """Median over pixels of |x - r| / r of luminance, where the reference is not black."""
    x, r = picture @ LUMINANCE, reference @ LUMINANCE
    lit = r > 1e-6 * max(float(r.mean()), 1e-30)
    return float(np.median(np.abs(x - r)[lit] / r[lit])) if lit.any() else 0.0


def flip(picture: Picture, reference: Picture) -> float | None:
    """Mean of FLIP, the difference that people see on flipping between two pictures, for pictures with high dynamic
    range; None where OpenImageIO is older than 3.2, which brought it."""
    if not hasattr(oiio.ImageBufAlgo, "FLIP_diff"):
        return None
    x, r = (oiio.ImageBuf(np.ascontiguousarray(p, np.float32)) for p in (picture, reference))
    return float(np.asarray(oiio.ImageBufAlgo.FLIP_diff(r, x).get_pixels(oiio.FLOAT))[..., 0].mean())


def constancy(picture: Picture, expected: float) -> dict[str, float]:
    """Of a picture that should be ``expected`` everywhere: its mean over that, minus 1, and the largest deviation."""
    ratio = picture.astype(np.float64) / expected
    return {"bias": float(ratio.mean() - 1.0), "largest": float(np.abs(ratio - 1.0).max())}


def leak(picture: Picture, irradiance: float) -> float:
    """Mean radiance of what should be black, over the irradiance outside."""
    return float(picture.mean(dtype=np.float64) / irradiance)


def flicker(pictures: Sequence[Picture], answers: Sequence[Answer]) -> tuple[float, float]:
    """Temporal standard deviation of x - r for each pixel and channel, over the mean of r: its mean over pixels, and
    the root of the mean of its square.

    The variance is the covariance of x - a and x - b, so that noise of the references cancels; where it comes out
    negative, it counts as 0 in the first number. The second has no such bias.
    """
    x = np.stack(pictures).astype(np.float64)
    a = np.stack([answer.a for answer in answers]).astype(np.float64)
    b = np.stack([answer.b for answer in answers]).astype(np.float64)
    mean = float(0.5 * (a.mean() + b.mean()))
    products: npt.NDArray[np.float64] = _deviation(x - a) * _deviation(x - b)
    variance = products.sum(axis=0) / max(len(x) - 1, 1)
    return float(np.sqrt(np.maximum(variance, 0.0)).mean()) / mean, float(np.sqrt(max(variance.mean(), 0.0))) / mean


def _deviation(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return values - values.mean(axis=0)
