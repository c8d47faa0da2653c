# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the picture is still noisy: passes leave out the tiles whose noise is below the threshold."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext
from .frame import ActiveTiles

#: Passes before the first look at the noise, and between two looks. Both are multiples of four: noise is the difference
#: between all passes and half of them, and any four hold two of these.
FIRST_LOOK, LOOK_EVERY = 8, 4
#: The half: passes whose number has an even number of these bits. By other bits, such as the lowest, half of the points
#: of a Sobol sequence may lie in half of the square; by these they are about as even as all. Found by a search.
HALF_BITS = 0xB6DA


class Convergence:
    """Owns the mean over half of the passes, and knows how many passes each tile has had."""

    def __init__(self, gpu: GpuContext, size: tuple[int, int]) -> None:
        self.gpu = gpu
        self.size = size
        tile = interface.TILE_SIZE
        self._tiles = (-(-size[0] // tile), -(-size[1] // tile))
        self.half = gpu.texture("film", size, 4, "f4")
        self._noise = gpu.texture("film", self._tiles, 1, "f4")
        self._texture = gpu.texture("film", self._tiles, 1, "u1")
        self.start()

    def start(self) -> None:
        """Begin again: all tiles are active."""
        self.half.write(bytes(16 * self.size[0] * self.size[1]))
        columns, rows = self._tiles
        self._counts = np.zeros((rows, columns), np.int32)  # passes that each tile has had
        self.noise = np.full((rows, columns), np.inf, np.float32)  # at the last look at each tile
        self._activate(np.ones((rows, columns), bool))

    def _activate(self, mask: np.ndarray) -> None:
        self.active = ActiveTiles(self._texture, mask)
        self._texture.write(mask.astype(np.uint8).tobytes(), alignment=1)

    @property
    def is_done(self) -> bool:
        """Whether no tile is active any more."""
        return not self.active.mask.any()

    def keeps_half(self, passes: int) -> bool:
        """Whether the next pass, after ``passes``, goes into ``half`` too."""
        return (passes & HALF_BITS).bit_count() % 2 == 0

    def add(self, passes: int, mean: moderngl.Texture, threshold: float) -> None:
        """Count a pass, the ``passes``-th, that went into ``mean``; now and then look which tiles need more."""
        self._counts += self.active.mask
        if passes < FIRST_LOOK or passes % LOOK_EVERY:
            return
        kernel = self.gpu.kernel("noise")
        for picture, unit in ((mean, "IMG_0"), (self.half, "IMG_1")):
            picture.bind_to_image(interface.slot(unit), read=True, write=False)
        self._noise.bind_to_image(interface.slot("IMG_2"), read=False, write=True)
        kernel.set(picture_size=self.size, tile_count=self._tiles)
        kernel.run_tiles(*self._tiles)
        self.gpu.barrier()  # read back
        found = np.frombuffer(self._noise.read(), np.float32).reshape(self.noise.shape)
        self.noise = np.where(self.active.mask, np.nan_to_num(found, nan=np.inf), self.noise)
        # Chance makes a single tile look better than it is; its neighbours are much like it.
        padded = np.pad(self.noise, 1, mode="edge")
        around = sum(
            padded[y : y + self.noise.shape[0], x : x + self.noise.shape[1]] for y in range(3) for x in range(3)
        )
        self._activate(self.active.mask & (np.maximum(self.noise, around / 9.0) > threshold))

    @property
    def mean_samples(self) -> float:
        """Passes that a pixel has had, on average."""
        tile = interface.TILE_SIZE
        of_pixels = self._counts.repeat(tile, axis=0).repeat(tile, axis=1)
        return float(of_pixels[: self.size[1], : self.size[0]].mean())

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.half, self._noise, self._texture)
