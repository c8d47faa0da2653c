# SPDX-License-Identifier: GPL-3.0-or-later
"""Light from lights, emitters and a concentrated world onto voxel faces; the lights' records for all passes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..grid import VoxelGrid
from ..links import link_count
from ..scene import AreaShape, LightData, LightKind
from ..settings import Settings
from .emitters import FACE_SAMPLES, EmitterTable
from .face_changes import FaceChanges
from .voxelize import Voxels
from .world import FACE_SAMPLES as WORLD_SAMPLES
from .world import WorldLight

#: Threads times lights in one dispatch: bounds how long a step takes, so that cancelling is quick.
WORK_PER_STEP = 1 << 17
#: Where faces are few, one point of each tells too little of where shadows end: light is looked for at so many points
#: in all, but at no more than so many of a face.
POINTS_IN_ALL = 1 << 18
MOST_POINTS = 8

#: Lights that a point looks at in about the time of one ray.
LIGHTS_PER_RAY = 16


def light_records(lights: Sequence[LightData], grid: VoxelGrid) -> np.ndarray:
    """Lights as the shaders read them, in grid space."""
    records = np.zeros(max(len(lights), 1), interface.LIGHT.dtype)
    for record, light in zip(records, lights, strict=False):
        _fill(record, light, grid)
    return records


def _fill(record: np.ndarray, light: LightData, grid: VoxelGrid) -> None:
    position = (np.asarray(light.position, np.float64) - grid.origin) / grid.cell_size
    record["position_grid"] = position
    record["kind"] = int(light.kind)
    record["intensity"] = light.intensity
    record["axis_x"], record["axis_y"], record["axis_z"] = light.axes
    flags = int(light.visibility)
    flags |= interface.LIGHT_CASTS_SHADOW if light.casts_shadow else 0
    radiance = np.asarray(light.intensity, np.float64)
    if light.kind in (LightKind.POINT, LightKind.SPOT):
        record["radius_grid"] = light.radius / grid.cell_size
        flags |= interface.LIGHT_IS_SPHERE if light.radius > 0 and not light.soft_falloff else 0
        radiance = radiance / (np.pi * light.radius**2) if light.radius > 0 else radiance * 0.0
        if light.kind == LightKind.SPOT:
            cosine = np.cos(0.5 * light.spot_angle)
            record["cos_cone"] = cosine
            record["spot_smooth"] = 1.0 / max((1.0 - cosine) * light.spot_blend, 1e-5)
            record["spot_scale"] = [1.0 / (s if abs(s) > 1e-9 else 1e-9) for s in light.spot_scale]
    elif light.kind == LightKind.SUN:
        half = min(0.5 * light.angle, 0.5 * np.pi)
        record["radius_grid"] = np.sin(half)  # the cosine of a small angle has no digits left
        # L pi sin^2(half) = E; a sun without a disk is not seen.
        radiance = radiance / (np.pi * np.sin(half) ** 2) if half > 1e-6 else radiance * 0.0
    else:
        record["half_width_grid"] = 0.5 * light.size[0] / grid.cell_size
        record["half_height_grid"] = 0.5 * light.size[1] / grid.cell_size
        record["radius_grid"] = 0.5 * max(light.size) / grid.cell_size
        record["spot_smooth"] = 0.5 * light.spread
        flags |= interface.LIGHT_IS_ELLIPSE if light.shape == AreaShape.ELLIPSE else 0
    record["radiance"] = radiance
    record["flags"] = flags


class LightTable:
    """The lights on the GPU."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.records: moderngl.Texture | None = None
        self.count = 0
        self.cell_size = 1.0
        self._kinds: dict[str, object] = {}

    def run(self, lights: Sequence[LightData], grid: VoxelGrid) -> None:
        """Upload."""
        self.release()
        self.count = len(lights)
        round_lights = [light for light in lights if light.kind in (LightKind.POINT, LightKind.SPOT)]
        areas = [light for light in lights if light.kind == LightKind.AREA]
        self._kinds = {
            "HAS_POINTS": bool(round_lights),
            "HAS_SPOTS": any(light.kind == LightKind.SPOT for light in lights),
            "HAS_SPHERES": any(not light.soft_falloff and light.radius > 0.0 for light in round_lights),
            "HAS_SUNS": any(light.kind == LightKind.SUN for light in lights),
            "HAS_AREAS": bool(areas),
            "HAS_RECTANGLES": any(light.shape == AreaShape.RECTANGLE for light in areas),
            "HAS_ELLIPSES": any(light.shape == AreaShape.ELLIPSE for light in areas),
        }
        self.cell_size = grid.cell_size
        if not lights:
            return
        texels = light_records(lights, grid).view(np.uint32).reshape(-1, 4)
        self.records = self.gpu.list_texture("lights", len(texels), 4, "u4", texels)

    def defines(self, settings: Settings) -> dict[str, object]:
        """Kinds of light there are, for lib/light.glsl, and whether a part of them is asked (lib/light_pick.glsl)."""
        return self._kinds | {
            "PHYSICAL_FALLOFF": settings.light_falloff == 2.0,
            "HAS_MANY_LIGHTS": self._has_many(settings),
        }

    def rays(self, settings: Settings) -> int:
        """Shadows that a point asks for, about; of many lights, what looking at each costs counts as some more."""
        return interface.LIGHT_PICKS + self.count // LIGHTS_PER_RAY if self._has_many(settings) else self.count

    def _has_many(self, settings: Settings) -> bool:
        return settings.use_shadows and self.count > interface.LIGHT_PICKS

    def bind(self, kernel: Kernel, settings: Settings) -> None:
        """Bind what lib/light.glsl reads."""
        assert self.records is not None
        self.records.use(interface.slot("TEX_LIGHTS"))
        kernel.set(light_count=self.count, cell_size=self.cell_size, light_falloff=settings.light_falloff)

    def release(self) -> None:
        """Free the records."""
        self.gpu.free(self.records)
        self.records = None


class InjectPass:
    """Owns the light that lights, emitters and a concentrated world send onto all faces."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.irradiance: moderngl.Texture | None = None
        self._numbers = (0, 0)  # points and links of each face, which light is weighed by
        self.lit = 0  # faces that light was traced to, of the last run

    def run(
        self,
        voxels: Voxels,
        lights: LightTable,
        emitters: EmitterTable | None,
        world: WorldLight | None,
        settings: Settings,
        changes: FaceChanges | None = None,
    ) -> Iterator[float]:
        """Trace shadows and sum up irradiance / pi. Yields the share done.

        ``emitters``, ``world``: points and directions are drawn of them, weighed against the links, which look for them
        too; or None. ``changes``: what a scene that is the same but for an edit keeps of the irradiance there is; None:
        nothing.
        """
        points = max(1, min(MOST_POINTS, POINTS_IN_ALL // max(voxels.faces.count, 1)))
        if lights.count > interface.LIGHT_PICKS:
            points = 1  # to look at all of them at each point would take long
        numbers = points, link_count(settings.bounce_rays, voxels.faces.count)
        if numbers != self._numbers:
            changes = None  # other points were asked
        self._numbers = numbers
        before = self.irradiance if changes else None
        if before is None:
            self.release()
            changes = None
        irradiance = self.gpu.list_texture("face irradiance", voxels.faces.count, 2, "u4")
        self.irradiance = irradiance
        defines = (
            voxels.site_defines
            | lights.defines(settings)
            | {
                "HAS_LIGHTS": lights.count > 0,
                "HAS_EMITTERS": emitters is not None,
                "WORLD_IS_DRAWN": world is not None,
                "WORLD_IS_TEXTURE": world is not None,
            }
        )
        sources = lights, emitters, world, settings
        count = voxels.faces.count
        try:
            if changes and before:
                changes.begin()
                reach = None if emitters or world else self._find_reach(voxels, lights, settings, changes)
                finding = self.gpu.kernel("inject", defines | {"FINDS_CHANGED": True, "HAS_REACH": reach is not None})
                try:
                    yield from self._steps(finding, voxels, irradiance, count, sources, (changes, before, reach))
                finally:
                    self.gpu.free(reach)
                count = changes.found()
            self.lit = count
            kernel = self.gpu.kernel("inject", defines | {"FINDS_CHANGED": False, "HAS_REACH": False})
            yield from self._steps(kernel, voxels, irradiance, count, sources, (changes, None, None))
        finally:
            self.gpu.free(before)
        self.gpu.barrier()  # bounces read it as a texture

    def _steps(
        self,
        kernel: Kernel,
        voxels: Voxels,
        irradiance: moderngl.Texture,
        count: int,
        sources: tuple[LightTable, EmitterTable | None, WorldLight | None, Settings],
        taken: tuple[FaceChanges | None, moderngl.Texture | None, moderngl.Texture3D | None],
    ) -> Iterator[float]:
        """Over ``count`` faces: those that were found to be changed, or else all. ``taken``: what is taken over, from
        where, and the bricks in which faces may have changed; with no texture to take over, the list of changed faces
        counts."""
        lights, emitters, world, settings = sources
        changes, before, reach = taken
        points, links = self._numbers
        rays = lights.rays(settings) + (FACE_SAMPLES if emitters else 0) + (WORLD_SAMPLES if world else 0)
        step = max(interface.GROUP_SIZE, WORK_PER_STEP // max(1, rays * points))
        for first in range(0, count, step):
            with self.gpu.timed("inject"):
                voxels.bind(kernel)
                voxels.faces.bind()
                voxels.faces.bind_sites()
                if changes and before:
                    changes.bind(kernel, changes.boxes)
                    before.use(interface.slot("TEX_FACE_IRRADIANCE"))
                    if reach:
                        reach.use(interface.slot("TEX_REACH"))
                elif changes:
                    changes.bind_list()
                if lights.count:
                    lights.bind(kernel, settings)
                if emitters:
                    emitters.bind(kernel, FACE_SAMPLES)
                if world:
                    world.bind(kernel)
                    world.bind_drawn(kernel, WORLD_SAMPLES, table=True)
                irradiance.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
                kernel.set(
                    site_first=first, face_count=count, random_seed=settings.seed,
                    use_shadows=settings.use_shadows, point_count=points, link_count=links,
                )  # fmt: skip
                kernel.run_list(min(step, count - first))
            yield min(1.0, (first + step) / count)

    def _find_reach(
        self, voxels: Voxels, lights: LightTable, settings: Settings, changes: FaceChanges
    ) -> moderngl.Texture3D:
        bricks = voxels.grid.bricks
        reach = self.gpu.texture_3d("light reach", bricks, 1, "u1")
        with self.gpu.timed("inject"):
            kernel = self.gpu.kernel("inject_reach", lights.defines(settings) | voxels.grid.defines)
            self.gpu.use_source(voxels.bricks, "TEX_BRICKS")
            lights.bind(kernel, settings)
            changes.bind_boxes(kernel, changes.boxes)
            reach.bind_to_image(interface.slot("IMG_0"), read=False, write=True)
            low, high = voxels.grid.box
            kernel.set(**voxels.grid.uniforms, brick_count=bricks, farthest=float(np.linalg.norm(high - low)))
            kernel.run_list(bricks[0] * bricks[1] * bricks[2])
            self.gpu.barrier()  # read as a texture
        return reach

    def release(self) -> None:
        """Free it."""
        self.gpu.free(self.irradiance)
        self.irradiance = None
