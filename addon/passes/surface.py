# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen at each pixel: triangles by rasterization, then their materials, batch by batch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np

from ..camera import CameraRays
from ..gpu import interface
from ..gpu.context import GpuContext
from ..scene import RayVisibility
from ..settings import Settings
from .geometry import Geometry
from .inject import LightTable
from .materials import MaterialPass, MaterialSet
from .voxelize import Voxels

#: Partly transparent surfaces that one pass looks through at a pixel, at most; the next one counts as opaque.
MAX_LAYERS = 256
#: Texels of a pixel's own ray, side by side (lib/ray.glsl).
RAY_TEXELS = 2


@dataclass
class SurfacePictures:
    """One layer of surfaces, as lib/pixel.glsl reads them. ``rays`` None: it is what the camera sees."""

    size: tuple[int, int]
    seen: moderngl.Texture  # r32ui: triangle + 1; 0: none
    position: moderngl.Texture
    normal: moderngl.Texture
    diffuse: moderngl.Texture
    f0: moderngl.Texture
    f90: moderngl.Texture
    emission: moderngl.Texture
    rays: moderngl.Texture | None  # rgba32f, RAY_TEXELS a pixel

    @classmethod
    def allocate(cls, gpu: GpuContext, name: str, size: tuple[int, int], *, rays: bool) -> SurfacePictures:
        def picture(components: int, kind: str, width: int = 1) -> moderngl.Texture:
            return gpu.texture(name, (width * size[0], size[1]), components, kind)

        return cls(
            size,
            seen=picture(1, "u4"),
            position=picture(4, "f4"),
            normal=picture(4, "nu2"),
            diffuse=picture(4, "f2"),
            f0=picture(4, "f2"),
            f90=picture(4, "f2"),
            emission=picture(4, "f4"),
            rays=picture(4, "f4", RAY_TEXELS) if rays else None,
        )

    @property
    def ray_defines(self) -> dict[str, object]:
        return {"RAYS_OF_PIXELS": self.rays is not None}

    def bind(self, gpu: GpuContext) -> None:
        """Bind for reading."""
        slot = interface.slot
        gpu.use_source(self.position, "TEX_POSITION")
        gpu.use_source(self.normal, "TEX_NORMAL")
        gpu.use_source(self.diffuse, "TEX_DIFFUSE")
        self.f0.use(slot("TEX_F0"))
        self.f90.use(slot("TEX_F90"))
        self.bind_rays()

    def bind_rays(self) -> None:
        if self.rays is not None:
            self.rays.bind_to_image(interface.slot("IMG_RAYS"), read=True, write=True)

    def bind_images(self) -> None:
        """Bind for writing."""
        self.seen.bind_to_image(interface.slot("IMG_0"), read=True, write=True)
        for unit, picture in enumerate(
            (self.position, self.normal, self.diffuse, self.f0, self.f90, self.emission), start=1
        ):
            picture.bind_to_image(interface.slot(f"IMG_{unit}"), read=False, write=True)
        self.bind_rays()

    def release(self, gpu: GpuContext) -> None:
        gpu.free(self.seen, self.position, self.normal, self.diffuse, self.f0, self.f90, self.emission, self.rays)


@dataclass(frozen=True)
class View:
    """How one pass looks at the surfaces."""

    camera: CameraRays
    offset: tuple[float, float]  # where in each pixel it samples
    sample: int  # of the random sequences
    seed: int
    samples: int  # passes that share a pixel

    @property
    def texture_scale(self) -> float:
        """Side of what one pass sees of a pixel, in sides of a pixel: textures are averaged over no more."""
        return float(self.samples**-0.5)

    @property
    def uniforms(self) -> dict[str, Any]:
        """For lib/camera.glsl."""
        return self.camera.uniforms(self.offset)


@dataclass(frozen=True)
class Surfaces:
    """What can be seen: triangles, the voxels through which they are found, and what they are made of."""

    geometry: Geometry
    voxels: Voxels
    materials: MaterialSet
    material_pass: MaterialPass


class SurfacePass:
    """Rasterizes which triangle is seen, then evaluates materials for lists of pixels."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.pictures: SurfacePictures | None = None
        self._owned: list[Any] = []
        self._framebuffer: moderngl.Framebuffer | None = None
        self._depth: moderngl.Framebuffer | None = None  # of the same depth buffer alone
        self._pixels: moderngl.Buffer | None = None
        self._bins: moderngl.Buffer | None = None
        self._counters: moderngl.Buffer | None = None
        self._batches = 0

    def allocate(self, size: tuple[int, int], batches: int) -> SurfacePictures:
        """Make the pictures for a resolution; kept when nothing changed."""
        if self.pictures is not None and self.pictures.size == size and self._batches == batches:
            return self.pictures
        self.release()
        gpu = self.gpu
        name = "surface pictures"
        self.pictures = SurfacePictures.allocate(gpu, name, size, rays=False)
        seen = self.pictures.seen
        depth = gpu.make(name, 4 * size[0] * size[1], lambda: gpu.mgl.depth_renderbuffer(size))
        self._framebuffer = gpu.make(name, 0, lambda: gpu.mgl.framebuffer([seen], depth))
        self._depth = gpu.make(name, 0, lambda: gpu.mgl.framebuffer([], depth))
        self._pixels = gpu.buffer("pixel lists", size=4 * size[0] * size[1])
        self._bins = gpu.buffer("pixel lists", size=20 * max(batches, 1))
        self._counters = gpu.buffer("pixel lists", size=4 * max(batches, 4))
        self._owned = [self._framebuffer, self._depth, depth, self._pixels, self._bins, self._counters]
        self._batches = batches
        return self.pictures

    def run(self, surfaces: Surfaces, view: View) -> Iterator[float]:
        """Fill ``pictures`` for one pass. Yields the share done."""
        assert self.pictures is not None
        with self.gpu.timed("visibility"):
            self._rasterize(surfaces.geometry, view)
        yield from self.shade(surfaces, self.pictures, view)

    def shade(self, surfaces: Surfaces, pictures: SurfacePictures, view: View) -> Iterator[float]:
        """Fill ``pictures`` where ``seen`` says which triangle their rays meet first. Yields the share done."""
        if surfaces.geometry.triangle_count:
            for _ in self._timed(self._evaluate(surfaces, pictures, view)):
                yield 0.25
        yield 0.5
        if surfaces.materials.has_transparency and surfaces.geometry.triangle_count:
            yield from self._look_through(surfaces, pictures, view)
        yield 1.0

    def _timed(self, steps: Iterator[None]) -> Iterator[None]:
        """The same steps, with the time of each counted, and not what is done between them."""
        is_more = True
        while is_more:
            with self.gpu.timed("surface"):
                is_more = next(steps, steps) is None
            if is_more:
                yield

    def _rasterize(self, geometry: Geometry, view: View) -> None:
        gpu, camera = self.gpu, view.camera
        framebuffer, depth, pictures = self._framebuffer, self._depth, self.pictures
        assert framebuffer is not None and depth is not None and pictures is not None
        pictures.seen.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
        pictures.position.bind_to_image(interface.slot("IMG_1"), read=False, write=True)
        gpu.kernel("clear").set(picture_size=pictures.size).run_tiles(*pictures.size)
        gpu.barrier()  # triangles are drawn over it
        depth.clear(depth=1.0)  # without the numbers: what clearing integers this way does is not defined
        framebuffer.use()
        gpu.mgl.enable_only(moderngl.DEPTH_TEST)
        if not geometry.meshes:
            return
        program = gpu.program("visibility")
        clip_from_grid = camera.raster_matrix(view.offset)
        matrix: Any = program["clip_from_grid"]
        matrix.write(np.ascontiguousarray(clip_from_grid.T, np.float32).tobytes())
        for name, value in (
            ("camera_position", camera.position),
            ("camera_forward", camera.forward),
            ("depth_range", camera.depth_range),
        ):
            member: Any = program[name]
            member.value = tuple(float(c) for c in value)
        for draw in geometry.meshes:
            if draw.vertex_array is None:
                draw.vertex_array = gpu.make("vertex arrays", 0, lambda draw=draw: gpu.mgl.vertex_array(  # type: ignore
                    program,
                    [
                        (draw.positions, "3f4", "position_os"),
                        (draw.instances, "4f4 4f4 4f4 1u4/i", "grid_from_object_x", "grid_from_object_y",
                         "grid_from_object_z", "first_triangle"),
                    ],
                    index_buffer=draw.indices, index_element_size=4,
                ))  # fmt: skip
            shown = draw.show(clip_from_grid)
            if shown:
                draw.vertex_array.render(moderngl.TRIANGLES, instances=shown)
        gpu.barrier()  # the numbers are read through image loads

    def _evaluate(self, surfaces: Surfaces, pictures: SurfacePictures, view: View, behind: int = 0) -> Iterator[None]:
        """Evaluate the materials of all pixels. Yields after each program that had to be compiled.

        ``behind``: how many partly transparent surfaces were looked through; the pixels that did are evaluated.
        """
        gpu, slot = self.gpu, interface.slot
        materials, material_pass = surfaces.materials, surfaces.material_pass
        assert self._bins is not None and self._pixels is not None
        self._bin(surfaces, pictures, pending=behind > 0)
        for index, batch in enumerate(materials.batches):
            family = materials.compiled.families[batch.family]
            kernel = gpu.kernel(
                "surface",
                material_pass.defines(batch)
                | pictures.ray_defines
                | surfaces.geometry.defines
                | {
                    "HAS_OPACITY": family.has_transparency,
                    "HAS_GLASS": family.has_transmission,
                    "HAS_COAT": family.has_coat,
                    "IS_LAYERED": materials.has_transparency,
                    "FLAT_SHADING": False,
                },
                material_pass.texts(batch),
            )
            pictures.bind_images()
            self._pixels.bind_to_storage_buffer(slot("BUF_WORK"))
            self._bins.bind_to_storage_buffer(slot("BUF_RESULTS"))
            surfaces.geometry.bind(kernel)
            material_pass.bind(batch, kernel)
            kernel.set(
                batch=index,
                random_seed=(view.seed * 0x9E3779B1 + view.sample * MAX_LAYERS + behind) & 0xFFFFFFFF,
                turn_seed=view.seed + behind,
                texture_scale=view.texture_scale,
                sample_index=view.sample,
                **view.uniforms,
                **surfaces.geometry.grid.level_uniforms,
            )
            if family.has_transparency:
                kernel.set(behind=behind, last_layer=behind == MAX_LAYERS - 1)
            was_cold = kernel.is_cold
            kernel.run_indirect(self._bins, 20 * index)
            material_pass.unbind(batch)
            if was_cold:
                yield
        gpu.barrier()  # lighting reads the pictures as textures

    def _bin(self, surfaces: Surfaces, pictures: SurfacePictures, *, pending: bool) -> None:
        gpu, slot, materials = self.gpu, interface.slot, surfaces.materials
        assert self._bins is not None and self._pixels is not None and self._counters is not None
        self._counters.clear()
        for step in (0, 1, 2):
            kernel = gpu.kernel("pixel_bins", surfaces.geometry.defines | {"STEP": step})
            kernel.set(picture_size=pictures.size, batch_count=len(materials.batches), pending_only=pending)
            gpu.use_source(surfaces.geometry.triangles, "TEX_TRIANGLES")
            materials.batch_table.bind_to_storage_buffer(slot("BUF_MATERIALS"))
            self._counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
            self._bins.bind_to_storage_buffer(slot("BUF_RESULTS"))
            self._pixels.bind_to_storage_buffer(slot("BUF_WORK"))
            pictures.seen.bind_to_image(slot("IMG_0"), read=True, write=False)
            if step == 1:
                kernel.run_groups(1, 1, 1)
            else:
                kernel.run_tiles(*pictures.size)
            gpu.barrier()  # each step reads the counters of the one before; dispatches read their arguments

    def _look_through(self, surfaces: Surfaces, pictures: SurfacePictures, view: View) -> Iterator[float]:
        for behind in range(1, MAX_LAYERS):
            with self.gpu.timed("surface"):
                is_more = self._advance(surfaces.voxels, pictures, view)
            if not is_more:
                return
            for _ in self._timed(self._evaluate(surfaces, pictures, view, behind)):
                yield 0.5
            yield 0.5 + 0.5 * behind / MAX_LAYERS

    def _advance(self, voxels: Voxels, pictures: SurfacePictures, view: View) -> bool:
        """Find what lies behind the surfaces that this pass looks through; whether there is anything."""
        gpu, slot = self.gpu, interface.slot
        assert self._counters is not None
        kernel = gpu.kernel("advance", pictures.ray_defines | voxels.trace_defines | {"HAS_OPACITY": False})
        self._counters.clear()
        voxels.bind(kernel)
        rays = RayVisibility.CAMERA if pictures.rays is None else RayVisibility.GLOSSY
        kernel.set(ray_mask=int(rays), **view.uniforms)
        pictures.bind_rays()
        pictures.position.use(slot("TEX_POSITION"))
        pictures.seen.bind_to_image(slot("IMG_0"), read=True, write=True)
        pictures.position.bind_to_image(slot("IMG_1"), read=False, write=True)
        self._counters.bind_to_storage_buffer(slot("BUF_COUNTS"))
        kernel.run_tiles(*pictures.size)
        gpu.barrier()  # the count is read back, the marks by the next step
        return bool(np.frombuffer(self._counters.read(4), np.uint32)[0])

    def show_lights(self, lights: LightTable, view: View, settings: Settings) -> None:
        """Put lights that the camera sees into the pictures."""
        pictures = self.pictures
        assert pictures is not None
        with self.gpu.timed("light shapes"):
            kernel = self.gpu.kernel("light_shapes", lights.defines(settings))
            lights.bind(kernel, settings)
            pictures.position.use(interface.slot("TEX_POSITION"))
            pictures.bind_images()
            kernel.set(**view.uniforms)
            kernel.run_tiles(*pictures.size)
            self.gpu.barrier()  # lighting reads the pictures as textures

    def release(self) -> None:
        """Free everything."""
        if self._framebuffer is not None:
            # moderngl binds again what it bound last, and would bind a framebuffer that is gone.
            self.gpu.mgl.detect_framebuffer(0).use()
            self._framebuffer = self._depth = None
        self.gpu.free(*self._owned)
        self._owned = []
        if self.pictures is not None:
            self.pictures.release(self.gpu)
            self.pictures = None
        self._batches = 0
