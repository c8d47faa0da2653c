# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials on the GPU: compiled families, parameters, textures, and batches that run together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..materials.compile import CompiledMaterials, MaterialFamily, compile_materials
from ..materials.graph import ImageData, ImageEncoding, MaterialData

_SRGB8_ALPHA8 = 0x8C43


@dataclass(frozen=True)
class Batch:
    """Materials with one program and the same textures: one dispatch serves them all."""

    family: int
    textures: tuple[tuple[int, str, str], ...]  # image index, extension, interpolation
    uv_layers: tuple[int, ...]  # slot -> layer in MaterialSet.layers
    color_layers: tuple[int, ...]


@dataclass
class MaterialSet:
    """What passes need to evaluate materials."""

    compiled: CompiledMaterials
    layers: list[tuple[str, str | None]]  # ("uv" or "color", name) read by any material
    batches: list[Batch]
    batch_of_material: np.ndarray  # (M,) uint32
    values: moderngl.Texture
    batch_table: moderngl.Buffer
    textures: list[moderngl.Texture]

    @property
    def has_diffuse(self) -> bool:
        return any(family.has_diffuse for family in self.compiled.families)

    @property
    def has_transparency(self) -> bool:
        return any(family.has_transparency for family in self.compiled.families)

    @property
    def has_cutouts(self) -> bool:
        """Some triangles are transparent in parts."""
        return any(family.transparency_varies for family in self.compiled.families)

    @property
    def has_transmission(self) -> bool:
        return any(family.has_transmission for family in self.compiled.families)

    @property
    def lets_light_through(self) -> bool:
        """Some triangles stop only a part of the rays that look for light."""
        return self.has_transparency or self.has_transmission

    @property
    def least_roughness(self) -> float:
        """Of everything that is glossy; 0 where it varies, 1 when nothing is glossy."""
        return min((material.least_roughness for material in self.compiled.materials), default=1.0)

    @property
    def has_specular(self) -> bool:
        return any(family.has_specular for family in self.compiled.families)


@dataclass(frozen=True)
class Repainted:
    """Materials that look different from before, where nothing else of them has changed."""

    materials: np.ndarray  # (M,) bool
    glows: np.ndarray  # (M,) bool: all that emit or did, where that may have changed of one; else none

    def and_before(self, earlier: Repainted | None) -> Repainted:
        """Both together."""
        if earlier is None:
            return self
        return Repainted(self.materials | earlier.materials, self.glows | earlier.glows)


def repainted(old: MaterialSet | None, new: MaterialSet) -> Repainted | None:
    """What differs; None: more than looks does, such as what is read of meshes, or where light goes through."""
    if old is None or old.layers != new.layers or len(old.compiled.materials) != len(new.compiled.materials):
        return None
    count = len(new.compiled.materials)
    changed = np.array([_look(old, index) != _look(new, index) for index in range(count)], bool)
    families = [
        made.compiled.families[made.compiled.materials[index].family]
        for made in (old, new)
        for index in np.flatnonzero(changed)
    ]
    if any(family.has_transparency or family.has_transmission for family in families):
        return None
    glows = emitting(old) | emitting(new)
    return Repainted(changed, glows if (glows & changed).any() else np.zeros(count, bool))


def emitting(materials: MaterialSet) -> np.ndarray:
    """(M,) bool: materials that may emit."""
    compiled = materials.compiled
    return np.array([compiled.families[material.family].has_emission for material in compiled.materials], bool)


def _look(made: MaterialSet, index: int) -> tuple:
    """All that a material's look depends on."""
    material, images = made.compiled.materials[index], made.compiled.images
    return (
        made.compiled.families[material.family],
        material.parameters.tobytes(),
        tuple((id(images[texture.image]), texture.extension, texture.interpolation) for texture in material.textures),
        material.uv_layers,
        material.color_layers,
    )


class MaterialPass:
    """Compiles materials and uploads what they read."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.set: MaterialSet | None = None
        self._owned: list[Any] = []
        self._textures: list[tuple[ImageData, moderngl.Texture]] = []
        self._samplers: dict[tuple, moderngl.Sampler] = {}

    def run(self, materials: Sequence[MaterialData], uv_layers: Collection[str] = ()) -> MaterialSet:
        """Compile and upload. ``uv_layers``: names of the UV layers that meshes have, for nodes that ask by name.

        Images that were there before stay.
        """
        kept = {id(image): texture for image, texture in self._textures}
        self.gpu.age_programs()
        compiled = compile_materials(materials, uv_layers, self._max_textures())
        layers: list[tuple[str, str | None]] = []

        def layer(kind: str, name: str | None) -> int:
            if (kind, name) not in layers:
                layers.append((kind, name))
            return layers.index((kind, name))

        batches: list[Batch] = []
        batch_of_material = np.zeros(max(len(compiled.materials), 1), np.uint32)
        for index, material in enumerate(compiled.materials):
            textures = tuple((t.image, t.extension, t.interpolation) for t in material.textures)
            batch = Batch(
                material.family,
                textures,
                tuple(layer("uv", name) for name in material.uv_layers),
                tuple(layer("color", name) for name in material.color_layers),
            )
            if batch not in batches:
                batches.append(batch)
            batch_of_material[index] = batches.index(batch)

        header = np.zeros((max(len(compiled.materials), 1), 4), np.float32)
        parts, first = [header], len(header)
        for index, material in enumerate(compiled.materials):
            header[index, 0] = first
            parts.append(np.asarray(material.parameters, np.float32).reshape(-1, 4))
            first += len(parts[-1])
        rows = np.concatenate(parts)
        self.gpu.free(*self._owned)
        self._owned = []
        gone = [pair for pair in self._textures if not any(pair[0] is image for image in compiled.images)]
        self._textures = [pair for pair in self._textures if pair not in gone]
        self.gpu.free(*(texture for _, texture in gone))
        values = self.gpu.list_texture("material values", len(rows), 4, "f4", rows)
        self._owned.append(values)
        table = self.gpu.buffer("material batches", batch_of_material)
        self._owned.append(table)
        images = []
        for image in compiled.images:
            texture = kept.get(id(image))
            if texture is None:
                texture = upload_image(self.gpu, image)
                self._textures.append((image, texture))
            images.append(texture)
        self.set = MaterialSet(compiled, layers, batches, batch_of_material, values, table, images)
        return self.set

    def _max_textures(self) -> int:
        units = int(self.gpu.mgl.info.get("GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS", 16))
        return min(interface.MAX_MATERIAL_TEXTURES, units - interface.FIRST_MATERIAL_TEXTURE)

    def family(self, batch: Batch) -> MaterialFamily:
        """What a batch's materials have in common."""
        assert self.set is not None
        return self.set.compiled.families[batch.family]

    def texts(self, batch: Batch) -> dict[str, str]:
        """The generated include ``material`` of a batch's program."""
        family = self.family(batch)
        declared = "".join(
            f"layout(binding = TEX_MATERIAL_{k}) uniform sampler2D material_texture_{k};\n"
            for k in range(family.textures)
        )
        return {"material": declared + family.source}

    def defines(self, batch: Batch) -> dict[str, object]:
        family = self.family(batch)
        return {"MATERIAL_UV_LAYERS": family.uv_layers, "MATERIAL_COLOR_LAYERS": family.color_layers}

    def bind(self, batch: Batch, kernel: Kernel) -> None:
        """Bind what a batch's materials read."""
        assert self.set is not None
        self.set.values.use(interface.slot("TEX_MATERIALS"))
        for unit, (image, extension, interpolation) in enumerate(batch.textures):
            location = interface.FIRST_MATERIAL_TEXTURE + unit
            self.set.textures[image].use(location)
            self._sampler(extension, interpolation).use(location)
        for name, indices in (("material_uv_layers", batch.uv_layers), ("material_color_layers", batch.color_layers)):
            if indices and kernel.shader.get(name, None) is not None:
                kernel.shader[name].value = indices if len(indices) > 1 else indices[0]

    def unbind(self, batch: Batch) -> None:
        """Take the samplers away again: they would override the filters of other textures on these units."""
        for unit, (_, extension, interpolation) in enumerate(batch.textures):
            self._sampler(extension, interpolation).clear(interface.FIRST_MATERIAL_TEXTURE + unit)

    def _sampler(self, extension: str, interpolation: str) -> moderngl.Sampler:
        key = (extension == "REPEAT", interpolation == "CLOSEST")
        if key not in self._samplers:
            nearest = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
            linear = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self._samplers[key] = self.gpu.make("samplers", 0, lambda: self.gpu.mgl.sampler(
                repeat_x=key[0], repeat_y=key[0], filter=nearest if key[1] else linear
            ))  # fmt: skip
        return self._samplers[key]

    def put_away(self) -> None:
        """Free what is made of images that are in memory as well: :meth:`put_back` makes it again."""
        self.gpu.free(*(texture for _, texture in self._textures), *self._samplers.values())
        self._textures, self._samplers = [], {}

    def put_back(self) -> None:
        """After :meth:`put_away`."""
        if self.set is not None:
            self._textures = [(image, upload_image(self.gpu, image)) for image in self.set.compiled.images]
            self.set.textures[:] = [texture for _, texture in self._textures]

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(*self._owned, *(texture for _, texture in self._textures), *self._samplers.values())
        self._owned, self._textures, self._samplers = [], [], {}
        self.set = None


def upload_image(gpu: GpuContext, image: ImageData) -> moderngl.Texture:
    """A mip-mapped texture of an image; sRGB is decoded by the sampler, before it filters."""
    height, width = image.pixels.shape[:2]
    limit = int(gpu.mgl.info.get("GL_MAX_TEXTURE_SIZE", 16384))
    pixels = image.pixels
    while max(height, width) > limit:
        pixels = pixels[::2, ::2]
        height, width = pixels.shape[:2]
    internal = _SRGB8_ALPHA8 if pixels.dtype == np.uint8 and image.encoding is ImageEncoding.SRGB else None
    if pixels.dtype == np.uint8:
        stored, dtype, size = np.ascontiguousarray(pixels), "f1", 4
    else:
        most = float(np.finfo(np.float16).max)
        pixels = np.nan_to_num(pixels, posinf=most, neginf=-most)
        fits = bool(np.abs(pixels).max(initial=0.0) <= most)  # the sun in a picture of the sky may not
        stored, dtype, size = (pixels.astype(np.float16), "f2", 8) if fits else (pixels.astype(np.float32), "f4", 16)

    def make() -> moderngl.Texture:
        texture = gpu.mgl.texture(
            (width, height), 4, stored.tobytes(), dtype=dtype, internal_format=internal, alignment=1
        )
        texture.build_mipmaps()
        return texture

    made: moderngl.Texture = gpu.make("image textures", width * height * size * 4 // 3, make)
    return made
