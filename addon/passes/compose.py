# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: means over passes of the picture and of every render pass that was asked for."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from ..camera import MAX_REACH, filter_reach, filter_weights
from ..gpu import interface
from ..gpu.context import GpuContext
from ..scene import FloatArray, SceneData
from .converge import Convergence
from .frame import ActiveTiles, Frame, LitVoxels
from .view import PIXEL_VIEWS, VOXEL_VIEWS, draw_view


class Keeps(enum.Enum):
    """What an output holds after some passes."""

    MEAN = enum.auto()
    FIRST = enum.auto()  # the first pass's value
    LATEST = enum.auto()


#: Name -> channels, and what is kept.
OUTPUTS: dict[str, tuple[int, Keeps]] = {
    "combined": (4, Keeps.MEAN),
    "depth": (1, Keeps.FIRST),
    "normal": (3, Keeps.FIRST),
    "position": (3, Keeps.FIRST),
    "diffuse_direct": (3, Keeps.MEAN),
    "diffuse_indirect": (3, Keeps.MEAN),
    "diffuse_color": (3, Keeps.MEAN),
    "glossy_direct": (3, Keeps.MEAN),
    "glossy_indirect": (3, Keeps.MEAN),
    "glossy_color": (3, Keeps.MEAN),
    "emission": (3, Keeps.MEAN),
    "environment": (3, Keeps.MEAN),
    # To explain a picture.
    "direct": (3, Keeps.MEAN),
    "indirect": (3, Keeps.MEAN),
    "specular": (3, Keeps.MEAN),
    "sample_count": (1, Keeps.LATEST),
    **{name: (1, Keeps.MEAN) for name in PIXEL_VIEWS},
    **{name: (3, Keeps.MEAN) for name in VOXEL_VIEWS},
}


#: Outputs that tell light straight from where it is made from light that was passed on.
SPLIT_OUTPUTS = ("diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect", "direct", "indirect")


#: Outputs whose means hold reflected light, and that are read divided by the mean colour: so their product with
#: the colour is exactly what is in the picture, also where a pixel shows several surfaces. As in Cycles.
DIVIDED_BY_COLOR = ("diffuse_direct", "diffuse_indirect")


@dataclass(frozen=True)
class PixelLight:
    """Light at pixels; None: there is none of this kind."""

    direct_diffuse: moderngl.Texture | None = None  # irradiance / pi
    direct_glossy: moderngl.Texture | None = None  # reflected radiance
    gathered: moderngl.Texture | None = None  # mean incoming radiance
    gathered_emitted: moderngl.Texture | None = None  # what of it comes straight from where it is made
    reflected: moderngl.Texture | None = None  # radiance
    reflected_emitted: moderngl.Texture | None = None


class Film:
    """Means in float32, one picture for each output that was asked for."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.samples = 0
        self._weights = [0.0, 0.0]  # of all passes, and of half of them: see camera.filter_weights
        self.size = (0, 0)
        self._means: dict[str, moderngl.Texture] = {}
        self._value: moderngl.Texture | None = None  # of one output, in this pass
        self._convergence: Convergence | None = None

    @property
    def splits_light(self) -> bool:
        """Whether an output tells light straight from where it is made from light that was passed on."""
        return any(name in self._means for name in SPLIT_OUTPUTS)

    @property
    def names(self) -> list[str]:
        """Outputs that can be read."""
        return list(self._means)

    @property
    def active_tiles(self) -> ActiveTiles | None:
        """Tiles that need more passes; None: there is no noise threshold, all do."""
        return self._convergence.active if self._convergence else None

    @property
    def is_converged(self) -> bool:
        """Whether the noise is below the threshold everywhere."""
        return self._convergence is not None and self._convergence.is_done

    @property
    def mean_samples(self) -> float:
        """Passes that a pixel has had, on average."""
        return self._convergence.mean_samples if self._convergence else float(self.samples)

    def start(self, size: tuple[int, int], names: Iterable[str], *, adaptive: bool) -> None:
        """Begin again at zero, with these outputs. ``adaptive``: there is a noise threshold."""
        asked = set(names)
        if adaptive:
            asked.add("combined")  # whose noise is measured
        if asked & set(DIVIDED_BY_COLOR):
            asked.add("diffuse_color")
        wanted = [name for name in OUTPUTS if name in asked]
        if size != self.size or wanted != list(self._means):
            self.release()
            self._means = {name: self.gpu.texture("film", size, 4, "f4") for name in wanted}
            self._value = self.gpu.texture("film", size, 4, "f4")
        if adaptive and self._convergence is not None:
            self._convergence.start()
        elif adaptive:
            self._convergence = Convergence(self.gpu, size)
        elif self._convergence is not None:
            self._convergence.release()
            self._convergence = None
        zeros = bytes(16 * size[0] * size[1])
        for texture in self._means.values():
            texture.write(zeros)
        self.size = size
        self.samples, self._weights = 0, [0.0, 0.0]

    def read(self, name: str) -> FloatArray:
        """(H, W, channels) float32, row 0 at the bottom, scene-linear, premultiplied. Raises KeyError."""
        channels, _ = OUTPUTS[name]
        result = np.ascontiguousarray(self.read_mean(name)[..., :channels])
        if name in DIVIDED_BY_COLOR:
            color = self.read_mean("diffuse_color")[..., :3]
            return np.divide(result, color, out=np.zeros_like(result), where=color > 0.0)
        return result

    def read_mean(self, name: str) -> FloatArray:
        """(H, W, 4) float32 as :meth:`read`, with coverage, and light not divided by colour. Raises KeyError."""
        width, height = self.size
        return np.frombuffer(self._means[name].read(), np.float32).reshape(height, width, 4)

    def copy_mean(self, name: str, target: moderngl.Texture) -> None:
        """Put what :meth:`read_mean` gives into ``target``, rgba32f of the same size. Raises KeyError."""
        self.gpu.copy(self._means[name], target)

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._means.values(), self._value)
        self._means, self._value = {}, None
        self.size = (0, 0)
        if self._convergence is not None:
            self._convergence.release()
            self._convergence = None

    def add(self, frame: Frame, lit: LitVoxels, scene: SceneData, light: PixelLight) -> None:
        """Take one pass into all means."""
        weight = math.prod(sum(filter_weights(place, scene.pixel_filter_width)) for place in frame.offset)
        self._weights = [self._weights[0] + weight, self._weights[1] + (weight if self.samples % 2 == 0 else 0.0)]
        with self.gpu.timed("film"):
            for name, picture in self._means.items():
                keeps = OUTPUTS[name][1]
                if keeps is Keeps.MEAN:
                    self._compose(name, self._value, frame, lit, scene, light)
                    self._accumulate(name, picture, frame, scene.pixel_filter_width)
                elif keeps is Keeps.LATEST or self.samples == 0:
                    self._compose(name, picture, frame, lit, scene, light)
            self.samples += 1
            if self._convergence is not None:
                self._convergence.add(self.samples, self._means["combined"], frame.settings.noise_threshold)

    def _compose(
        self,
        name: str,
        target: moderngl.Texture | None,
        frame: Frame,
        lit: LitVoxels,
        scene: SceneData,
        light: PixelLight,
    ) -> None:
        """Put what this pass brings to output ``name`` into ``target``."""
        assert target is not None
        if name in PIXEL_VIEWS or name in VOXEL_VIEWS:
            draw_view(self.gpu, name, target, frame, lit, scene.exposure)
            return
        slot, camera, settings, grid = interface.slot, frame.camera, frame.settings, lit.voxels.grid
        defines: dict[str, object] = {f"OUTPUT_{name.upper()}": index for index, name in enumerate(OUTPUTS)}
        defines |= {f"HAS_{name.upper()}": texture is not None for name, texture in vars(light).items()}
        defines |= frame.defines | {"WORLD_IS_TEXTURE": lit.world.texture is not None}
        kernel = self.gpu.kernel("compose", defines | {"OUTPUT": f"OUTPUT_{name.upper()}"})
        frame.bind(kernel)
        frame.surface.emission.use(slot("TEX_EMISSION"))
        lit.world.bind(kernel)
        for kind, texture in vars(light).items():
            if texture is not None:
                texture.use(slot(f"TEX_{kind.upper()}"))
        target.bind_to_image(slot("IMG_0"), read=False, write=True)
        kernel.set(
            direct_amount=settings.direct_amount if settings.use_direct else 0.0,
            indirect_amount=settings.indirect_amount if settings.use_indirect else 0.0,
            specular_amount=settings.specular_amount if settings.use_specular else 0.0,
            exposure=scene.exposure, film_transparent=scene.film_transparent,
            camera_forward=tuple(camera.forward), camera_position=tuple(camera.position),
            cell_size=grid.cell_size, grid_origin_ws=grid.origin,
            share_of_samples=min((self.samples + 1) / settings.samples, 1.0),
        )  # fmt: skip
        kernel.run_tiles(*self.size)
        self.gpu.barrier()  # read as a texture, or read back

    def _accumulate(self, name: str, total: moderngl.Texture, frame: Frame, filter_width: float) -> None:
        """Take what ``_compose`` left into a mean, filtered."""
        slot, assembled = interface.slot, self._value
        assert assembled is not None
        half = None
        if name == "combined" and self._convergence is not None and self._convergence.keeps_half(self.samples):
            half = self._convergence.half
        kernel = self.gpu.kernel(
            "film", frame.defines | {"KEEPS_HALF": half is not None, "FILTER_TAPS": 2 * MAX_REACH + 1}
        )
        frame.bind_tiles()
        assembled.use(slot("TEX_VALUE"))
        total.bind_to_image(slot("IMG_0"), read=True, write=True)
        if half is not None:
            half.bind_to_image(slot("IMG_1"), read=True, write=True)
        reach = filter_reach(filter_width)
        columns, rows = (filter_weights(place, filter_width) for place in frame.offset)
        weight = sum(columns) * sum(rows)
        kernel.set(
            picture_size=self.size, reach=reach, weights_x=columns, weights_y=rows, share=weight / self._weights[0]
        )  # fmt: skip
        if half is not None:
            kernel.set(half_share=weight / self._weights[1])
        kernel.run_tiles(*self.size)
        self.gpu.barrier()  # the next pass adds to it; the next output takes the value's place
