# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene needs. Passes, textures, buffers and defines follow from this, never the reverse."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from .scene import LightKind, RayVisibility, SceneData
from .settings import Settings
from .sharing import shares_triangles

#: Share of a GGX lobe's width that one ray drawn from it stands for; the other rays bring the rest. A lobe has
#: 2 tan(2 atan(alpha)), about 4 alpha, for half of its light: side of the area over distance, for alpha = roughness^2.
SPREAD_OF_ALPHA = 2.0
#: A reflected ray is followed while it stands for an area with a side of at most this, cells ...
SHARP_WIDTH = 2.0
#: ... if that is so for at least this far, cells.
SHARP_REACH = 8.0


def is_sharp(roughness: float, aperture: float) -> bool:
    """Whether rays of a GGX lobe are followed: as in shaders/passes/reflect.comp.glsl."""
    return SHARP_WIDTH >= SHARP_REACH * SPREAD_OF_ALPHA * roughness * roughness * aperture


@dataclass(frozen=True)
class Features:
    """Each is something the scene has and the settings want."""

    has_geometry: bool
    has_smooth_shading: bool
    has_instances: bool  # which share the triangles of their mesh
    has_lights: bool
    has_world: bool
    has_emission: bool
    has_transparency: bool
    has_transmission: bool
    has_glossy: bool
    follows_glossy: bool  # reflections are sharp enough to show more than voxels know
    has_diffuse_gather: bool
    has_reconstruction: bool
    has_direct: bool
    has_visible_lights: bool
    needs_radiance: bool  # voxel faces carry light
    bounces: bool
    needs_links: bool  # rays from voxel faces: to others, to the world, to emitters
    has_guides: bool  # links tell rays of pixels where light comes from
    shadow_cones: bool
    gather_cones: bool
    needs_cones: bool
    gather_occlusion: bool
    draws_emitters_at_faces: bool  # points on emitters, weighed against rays that meet them
    draws_emitters_at_pixels: bool
    draws_world_at_faces: bool  # directions drawn by the world's light, weighed against rays that leave the scene
    draws_world_at_pixels: bool
    gathers_emission: bool  # rays bring the emission that they meet
    reflects_emission: bool
    keeps_light: bool  # passes or frames take over diffuse light at pixels from those before
    keeps_reflections: bool  # and reflections
    has_levels: bool  # of voxels, nested around the camera

    @classmethod
    def from_scene(
        cls,
        scene: SceneData,
        settings: Settings,
        *,
        smooth_shading: bool,
        diffuse: bool,
        emission: bool,
        small_emitters: bool,
        transparency: bool,
        specular: bool,
        least_roughness: float,
        transmission: bool,
        world: bool,
        concentrated_world: bool,
        levels: bool = False,
    ) -> Features:
        """``smooth_shading``: what the meshes have, ``diffuse`` ... ``world``: the compiled materials and the world.
        ``small_emitters``: points on emitters find more than rays do. ``least_roughness``: of what is glossy.
        ``concentrated_world``: directions drawn by the world's light find more than rays do.
        ``levels``: the grid is nested."""
        has_geometry = any(len(scene.meshes[i.mesh].triangle_vertices) for i in scene.instances)
        lit = bool(scene.lights) or emission or world
        occlusion = settings.gather_mode == "OCCLUSION"
        gather = has_geometry and lit and diffuse and settings.use_indirect and settings.indirect_amount > 0.0
        glossy = has_geometry and lit and specular and settings.use_specular and settings.specular_amount > 0.0
        sharp = glossy and (transmission or is_sharp(least_roughness, settings.specular_aperture))
        wants_direct = has_geometry and settings.use_direct and settings.direct_amount > 0.0
        gathers_emission = gather and emission and wants_direct and settings.gather_mode == "RAYS"
        reflects_emission = glossy and emission and wants_direct and not occlusion
        # Rays alone suffice for large emitters, where there are rays and nothing ends them early.
        rays_suffice = (gathers_emission or not diffuse) and settings.max_distance <= 0.0 and not occlusion
        draws_at_pixels = wants_direct and emission and (small_emitters or not rays_suffice)
        draws_world = wants_direct and concentrated_world and settings.gather_mode == "RAYS" and (gather or glossy)
        direct = wants_direct and (bool(scene.lights) or draws_at_pixels or draws_world)
        shadow_cones = wants_direct and bool(scene.lights) and settings.use_shadows and settings.shadow_mode == "CONE"
        needs_radiance = ((gather or glossy) and not occlusion) or shadow_cones
        gather_cones = gather and settings.gather_mode == "CONES"
        bounces = needs_radiance and settings.bounces > 0
        needs_links = bounces or (needs_radiance and (world or emission))
        # Guides know what surfaces pass on, and the world. Where rays alone find emitters, and where directions of the
        # world are drawn, they would send rays away from what those still have to find.
        guided = needs_links and gather and settings.gather_mode == "RAYS"
        guided = guided and not (gathers_emission and not draws_at_pixels) and not draws_world
        visible = any(
            light.visibility & RayVisibility.CAMERA
            and (
                light.radius > 0.0
                or light.kind == LightKind.AREA
                or (light.kind == LightKind.SUN and light.angle > 0.0)
            )
            for light in scene.lights
        )
        # Noise is told from passes that know nothing of each other.
        keeps = settings.noise_threshold <= 0.0 and (settings.reuse_frames or settings.gather_interval > 1)
        return cls(
            has_geometry=has_geometry,
            has_smooth_shading=smooth_shading,
            has_instances=shares_triangles(scene),
            has_lights=bool(scene.lights),
            has_world=world,
            has_emission=emission,
            has_transparency=transparency,
            has_transmission=transmission and glossy,
            has_glossy=glossy,
            follows_glossy=sharp and settings.glossy_layers > 0 and not occlusion,
            has_diffuse_gather=gather,
            has_reconstruction=(glossy or (gather and not gather_cones)) and settings.use_reconstruction,
            has_direct=direct,
            has_visible_lights=visible,
            needs_radiance=needs_radiance,
            bounces=bounces,
            needs_links=needs_links,
            has_guides=guided,
            shadow_cones=shadow_cones,
            gather_cones=gather_cones,
            needs_cones=shadow_cones or gather_cones,
            gather_occlusion=occlusion and (gather or glossy),
            draws_emitters_at_faces=needs_radiance and emission and small_emitters,
            draws_emitters_at_pixels=draws_at_pixels,
            draws_world_at_faces=needs_radiance and concentrated_world,
            draws_world_at_pixels=draws_world,
            gathers_emission=gathers_emission,
            reflects_emission=reflects_emission,
            keeps_light=gather and keeps,
            keeps_reflections=glossy and keeps,
            has_levels=levels,
        )

    @property
    def names(self) -> list[str]:
        """Names of what is there, without the prefix."""
        return [
            field.name.removeprefix("has_").removeprefix("needs_")
            for field in dataclasses.fields(self)
            if getattr(self, field.name)
        ]
