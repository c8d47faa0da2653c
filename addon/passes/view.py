# SPDX-License-Identifier: GPL-3.0-or-later
"""Views that explain a picture: voxels as the camera sees them, and what keeps light from pixels.

They are outputs of the film like others. Only one that is asked for is compiled, and costs anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .frame import Frame, LitVoxels, run_tiles

#: What voxels are drawn by: nothing at pixels is needed.
VOXEL_VIEWS = ("voxels", "voxel_albedo", "voxel_normal", "voxel_radiance", "voxel_opacity", "voxel_emission")

#: What is asked of the surface that a pixel shows.
PIXEL_VIEWS = ("shadow", "ambient_occlusion")

#: Rays of one pixel that are traced to be drawn.
RAYS_SHOWN = 48
CONES_SHOWN = 6


@dataclass(frozen=True)
class SeenRays:
    """Rays (or axes of cones) that gather diffuse light at one pixel; world space, metres."""

    start: np.ndarray  # (3,)
    ends: np.ndarray  # (N, 3); none where the pixel shows no surface
    meets: np.ndarray  # (N,) bool: ends on a surface
    radiance: np.ndarray  # (N, 3) W/(m2 sr) that each brings
    tan_half: float  # of cones; 0: they are rays


_NUMBERS = {f"VIEW_{name.upper()}": number for number, name in enumerate((*VOXEL_VIEWS, *PIXEL_VIEWS))}


def draw_view(gpu: GpuContext, name: str, target: moderngl.Texture, frame: Frame, lit: LitVoxels, light: float) -> None:
    """Put view ``name`` of one pass into ``target`` (rgba32f). ``light``: factor on radiance."""
    with gpu.timed("view"):
        if name in VOXEL_VIEWS:
            _draw_voxels(gpu, name, target, frame, lit, light)
        else:
            _draw_pixels(gpu, name, target, frame, lit)
        gpu.barrier()  # read as a texture, or read back


def _draw_voxels(
    gpu: GpuContext, name: str, target: moderngl.Texture, frame: Frame, lit: LitVoxels, light: float
) -> None:
    voxels, features = lit.voxels, frame.features
    asks_emitters = name == "voxel_emission" and features.has_emission
    asks_faces = voxels.lit_faces is not None and name not in ("voxels", "voxel_emission")
    asks_radiance = asks_faces and name == "voxel_radiance" and lit.radiance is not None
    kernel = gpu.kernel(
        "voxel_view",
        voxels.trace_defines
        | _NUMBERS
        | {
            "VIEW": f"VIEW_{name.upper()}",
            "HAS_FACES": asks_faces,
            "HAS_RADIANCE": asks_radiance,
            "HAS_EMITTERS": asks_emitters,
        },
    )
    voxels.bind(kernel)
    if asks_faces:
        voxels.faces.bind()
    if asks_radiance:
        assert lit.radiance is not None
        lit.radiance.use(interface.slot("TEX_FACE_RADIANCE"))
    if asks_emitters:
        lit.emitters.bind(kernel, 0)
    kernel.set(**frame.camera.uniforms(frame.offset))
    kernel.set(level=frame.settings.viewport_level if name == "voxels" else 0, exposure=light)
    _bind_target(target)
    kernel.run_tiles(*frame.size)


def _draw_pixels(gpu: GpuContext, name: str, target: moderngl.Texture, frame: Frame, lit: LitVoxels) -> None:
    settings, voxels = frame.settings, lit.voxels
    asks_lights = name == "shadow"
    if asks_lights and not lit.lights.count:
        target.write(bytes(16 * frame.size[0] * frame.size[1]))
        return
    kernel: Kernel = gpu.kernel(
        "pixel_view",
        frame.defines
        | voxels.trace_defines
        | lit.lights.defines(settings)
        | _NUMBERS
        | {"VIEW": f"VIEW_{name.upper()}"},
    )

    def bind() -> None:
        voxels.bind(kernel)
        frame.bind(kernel)
        if asks_lights:
            lit.lights.bind(kernel, settings)
        _bind_target(target)
        kernel.set(
            sample_index=frame.index, random_seed=settings.seed, ray_count=settings.rays,
            max_distance=settings.ao_distance / voxels.grid.cell_size,
        )  # fmt: skip

    rays = lit.lights.count if asks_lights else settings.rays
    for _ in run_tiles(gpu, "view", kernel, frame, rays, bind):
        pass  # a debug view may take the time of a piece of work for each part


def _bind_target(target: moderngl.Texture) -> None:
    target.bind_to_image(interface.slot("IMG_0"), read=False, write=True)


def trace_rays(gpu: GpuContext, frame: Frame, lit: LitVoxels, pixel: tuple[int, int]) -> SeenRays:
    """What gathers diffuse light at the surface that ``pixel`` of the frame shows."""
    voxels, features, settings, grid = lit.voxels, frame.features, frame.settings, lit.voxels.grid
    cones = features.gather_cones
    kernel = gpu.kernel(
        "pixel_rays",
        voxels.trace_defines
        | lit.world.defines
        | {
            "WORLD_IS_DRAWN": False,
            "GATHER_CONES": cones,
            "GATHER_OCCLUSION": features.gather_occlusion or lit.radiance is None,
            "HAS_EMITTERS": features.gathers_emission and lit.radiance is not None,
        },
    )
    count = CONES_SHOWN if cones else RAYS_SHOWN
    limit = settings.ao_distance if features.gather_occlusion else settings.max_distance
    limit = limit / grid.cell_size if limit > 0.0 else 1e30
    rays = gpu.buffer("rays to be drawn", size=48 * interface.GROUP_SIZE)
    with gpu.timed("view"):
        lit.bind(kernel)
        if cones:
            lit.cones.bind(kernel)
        if features.gathers_emission and lit.radiance is not None:
            lit.emitters.bind(kernel, 0)
            kernel.set(emission_amount=1.0)
        rays.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
        kernel.set(**frame.camera.uniforms((0.5, 0.5)))
        kernel.set(
            pixel=pixel, ray_count=count, random_seed=settings.seed, max_distance=limit,
            clamp_indirect=settings.clamp_indirect, farthest=min(limit, 0.25 * max(grid.size)),
        )  # fmt: skip
        kernel.run_groups(1, 1, 1)
        gpu.barrier()  # read back
        found = np.frombuffer(rays.read(), np.float32)[: 12 * count].reshape(count, 3, 4).astype(np.float64)
    gpu.free(rays)
    found = found[found[:, 0, 3] > 0.0]
    places = found[:, :2, :3] * grid.cell_size + np.asarray(grid.origin)
    start = places[0, 0] if len(found) else np.zeros(3)
    return SeenRays(start, places[:, 1], found[:, 1, 3] > 0.0, found[:, 2, :3], 0.57735 if cones else 0.0)
