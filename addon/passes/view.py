# SPDX-License-Identifier: GPL-3.0-or-later
"""Views that explain a picture: voxels as the camera sees them, and what keeps light from pixels.

They are outputs of the film like others. Only one that is asked for is compiled, and costs anything.
"""

from __future__ import annotations

import moderngl

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from .frame import Frame, LitVoxels, run_tiles

#: What voxels are drawn by: nothing at pixels is needed.
VOXEL_VIEWS = ("voxels", "voxel_albedo", "voxel_normal", "voxel_radiance", "voxel_opacity", "voxel_emission")

#: What is asked of the surface that a pixel shows.
PIXEL_VIEWS = ("shadow", "ambient_occlusion")

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
        | (lit.lights.defines(settings) if asks_lights else {})
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
