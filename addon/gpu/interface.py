# SPDX-License-Identifier: GPL-3.0-or-later
"""What Python and GLSL must agree on: bindings, work-group sizes, structs.

No digit follows ``binding =`` in a ``.glsl`` file: the names below are put before every shader as defines, and each
struct is printed from its declaration, so that there is one text for both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene import AreaShape, LightKind, RayVisibility

#: Threads of a work group in lists (one-dimensional) and in pictures (tiles).
GROUP_SIZE = 64
TILE_SIZE = 8

#: Texels in a row of the two-dimensional textures that hold long lists.
LIST_WIDTH = 4096
#: A triangle takes three texels, and a row holds whole triangles.
TRIANGLES_PER_ROW = 1024

#: A brick is this many cells on each side; one bit a cell, two 32-bit words a brick.
BRICK = 4

#: Fixed-point unit of the sums of voxelization: 16.16, so that sums are integers and do not depend on order.
FIXED_ONE = 65536
#: 32-bit words of one face's sums: weight, reflectance x3, position x3.
FACE_SUM_WORDS = 7
#: Emission has no bound: each channel is a 64-bit sum, 32.32 (low word first).
EMISSION_SUM_WORDS = 6

#: A face or a triangle that is not there.
NONE_INDEX = 0xFFFFFFFF

# Storage buffers. A compute shader may count on eight in GL 4.3, so slots are shared by steps that do not meet.
BUFFERS = (
    "BUF_INSTANCES",  # Instance[]
    "BUF_VERTICES",  # uint[3 T]: vertex of each triangle corner; float[3 V] positions follow in BUF_POSITIONS
    "BUF_ATTRIBUTES",  # uint[]: corner normals, UV and colour layers
    "BUF_MATERIALS",  # Material[] or vec4[] parameters
    "BUF_WORK",  # work items
    "BUF_FACES",  # Face[]
    "BUF_SUMS",  # voxelization sums, counters
    "BUF_LIGHTS",  # Light[]
)
# One slot, two names: never read by the same step.
BUFFER_ALIASES = {"BUF_POSITIONS": "BUF_FACES", "BUF_COUNTS": "BUF_LIGHTS", "BUF_LINKS": "BUF_SUMS"}

# Texture units. GL 4.3 promises sixteen to a stage.
TEXTURES = (
    "TEX_TRIANGLES",  # rgba32ui 2D, three texels a triangle: corner 0, edge 1, edge 2 in grid space; w: packed integers
    "TEX_BRICK_MASK",  # r32ui 3D, two words a brick (side by side in x): occupied cells
    "TEX_BRICK_BASE",  # r32ui 3D: index of a brick's first occupied cell
    "TEX_CELLS",  # rgba32ui 2D list: first triangle, triangle count, first face, face mask
    "TEX_BRICK_DISTANCE",  # r8ui 3D: bricks to the nearest one that is not empty
    "TEX_CELL_TRIANGLES",  # r32ui 2D list: triangles of cells
    "TEX_CELL_OPACITIES",  # r8 2D list: opacity of each of them
    "TEX_FACE_RADIANCE",  # rgba32f 2D list: radiance leaving each voxel face
    "TEX_WORLD",  # rgba32f 2D: radiance of the world, equirectangular
    "TEX_CONES",  # rgba16f 3D: six facings side by side in z, with coarser levels
    "TEX_POSITION",  # rgba32f 2D, pixels: grid space; w: 0 nothing there, 1 a surface, 2 a light
    "TEX_NORMAL",  # rgba16 2D, pixels: shading and geometric normal, octahedral, mapped to 0..1
    "TEX_DIFFUSE",  # rgba16f 2D, pixels: diffuse reflectance, roughness
    "TEX_F0",  # rgba16f 2D, pixels: specular reflectance at normal incidence; w: 1 for holdouts
    "TEX_F90",  # rgba16f 2D, pixels: and at grazing incidence
    "TEX_EMISSION",  # rgba32f 2D, pixels: W/(m2 sr)
)
# Composition reads no grid: what it composes has the grid's units.
TEXTURE_ALIASES = {
    "TEX_DIRECT_DIFFUSE": "TEX_TRIANGLES",
    "TEX_DIRECT_GLOSSY": "TEX_BRICK_MASK",
    "TEX_INDIRECT_DIFFUSE": "TEX_BRICK_BASE",
    "TEX_INDIRECT_GLOSSY": "TEX_CELLS",
}
#: Material textures share units with what a step that evaluates materials never reads: all after the cells.
FIRST_MATERIAL_TEXTURE = 4
MAX_MATERIAL_TEXTURES = 12

_ALIASES = BUFFER_ALIASES | TEXTURE_ALIASES

IMAGES = ("IMG_0", "IMG_1", "IMG_2", "IMG_3", "IMG_4", "IMG_5", "IMG_6", "IMG_7")

_GLSL_SIZE = {"float": (4, 4), "uint": (4, 4), "int": (4, 4), "vec2": (8, 8), "vec3": (16, 12), "vec4": (16, 16)}
_NUMPY = {
    "float": np.dtype("<f4"),
    "uint": np.dtype("<u4"),
    "int": np.dtype("<i4"),
    "vec2": np.dtype(("<f4", 2)),
    "vec3": np.dtype(("<f4", 3)),
    "vec4": np.dtype(("<f4", 4)),
}


@dataclass(frozen=True)
class Struct:
    """A struct of a storage buffer (std430): fields as (name, GLSL type, what it is)."""

    name: str
    fields: tuple[tuple[str, str, str], ...]

    @property
    def dtype(self) -> np.dtype:
        """The numpy dtype with std430's offsets and stride."""
        names, formats, offsets = [], [], []
        offset, alignment = 0, 4
        for name, kind, _ in self.fields:
            align, size = _GLSL_SIZE[kind]
            offset = -(-offset // align) * align
            names.append(name)
            formats.append(_NUMPY[kind])
            offsets.append(offset)
            offset += size
            alignment = max(alignment, align)
        itemsize = -(-offset // alignment) * alignment
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})

    @property
    def glsl(self) -> str:
        lines = [f"    {kind} {name};  // {doc}" for name, kind, doc in self.fields]
        return "\n".join([f"struct {self.name} {{", *lines, "};"])


INSTANCE = Struct(
    "Instance",
    (
        ("grid_from_object_x", "vec4", "rows of the 3x4 matrix: object metres to grid cells"),
        ("grid_from_object_y", "vec4", ""),
        ("grid_from_object_z", "vec4", ""),
        ("object_from_grid_x", "vec4", "and back"),
        ("object_from_grid_y", "vec4", ""),
        ("object_from_grid_z", "vec4", ""),
        ("generated_scale", "vec3", "Generated = position_os * scale + offset"),
        ("first_triangle", "uint", "of this instance among the triangles of all instances"),
        ("generated_offset", "vec3", ""),
        ("triangle_count", "uint", ""),
        ("first_mesh_triangle", "uint", "of its mesh among the triangles of all meshes"),
        ("first_slot", "uint", "into the slot table: material and flags of each material slot"),
        ("first_normal", "uint", "into the attributes"),
        ("first_layer", "uint", "into the layer table: where each attribute layer of its mesh starts"),
        ("random", "float", "0..1"),
        ("object_index", "float", ""),
        ("mirrored", "uint", "1 when the matrix has a negative determinant"),
    ),
)

LIGHT = Struct(
    "Light",
    (
        ("position_grid", "vec3", "cells"),
        ("kind", "uint", "LIGHT_*"),
        ("intensity", "vec3", "W/sr, W/m2 or W/(m2 sr) by kind"),
        ("radius_grid", "float", "cells; area lights: half the longer side"),
        ("axis_x", "vec3", "unit"),
        ("half_width_grid", "float", "area lights: half the side along x, cells"),
        ("axis_y", "vec3", "unit"),
        ("half_height_grid", "float", "along y"),
        ("axis_z", "vec3", "unit; the light shines along -z"),
        ("cos_cone", "float", "spot: cosine of half the cone; sun: of half the disk"),
        ("spot_scale", "vec3", "spot: 1 / object scale"),
        ("spot_smooth", "float", "spot: 1 / ((1 - cos_cone) blend); area: half the spread"),
        ("flags", "uint", "RAY_* that see it; LIGHT_CASTS_SHADOW, LIGHT_IS_ELLIPSE, LIGHT_IS_SPHERE"),
        ("radiance", "vec3", "of the visible disk, sphere or area"),
    ),
)

FACE = Struct(
    "Face",
    (
        ("position_grid", "vec3", "a point on the surface that the face stands for"),
        ("weight", "float", "area facing this way, in cell sides"),
        ("normal", "vec3", "unit normal of the surface there"),
        ("key", "uint", "cell and facing, the same on every run: seeds the face's random numbers"),
        ("reflectance", "vec3", "diffuse and specular together, as a Lambertian"),
        ("cell", "uint", "index of its occupied cell"),
        ("emission", "vec3", "W/(m2 sr)"),
        ("facing", "uint", "0..5: +x -x +y -y +z -z"),
        ("direct", "vec3", "emission and what lights send off it, W/(m2 sr)"),
        ("pad", "float", ""),
    ),
)

STRUCTS = (INSTANCE, LIGHT, FACE)


def prelude() -> str:
    """GLSL text put before every shader: bindings, sizes, shared constants and structs."""
    defines: dict[str, object] = {}
    for table in (BUFFERS, TEXTURES, IMAGES):
        defines |= {name: slot for slot, name in enumerate(table)}
    defines |= {alias: defines[name] for alias, name in _ALIASES.items()}
    defines |= {f"TEX_MATERIAL_{i}": FIRST_MATERIAL_TEXTURE + i for i in range(MAX_MATERIAL_TEXTURES)}
    defines |= {
        "GROUP_SIZE": GROUP_SIZE,
        "TILE_SIZE": TILE_SIZE,
        "LIST_WIDTH": LIST_WIDTH,
        "TRIANGLES_PER_ROW": TRIANGLES_PER_ROW,
        "BRICK": BRICK,
        "FIXED_ONE": f"{FIXED_ONE}.0",
        "FACE_SUM_WORDS": f"{FACE_SUM_WORDS}u",
        "EMISSION_SUM_WORDS": f"{EMISSION_SUM_WORDS}u",
        "NONE_INDEX": f"0x{NONE_INDEX:X}u",
    }
    defines |= {f"LIGHT_{kind.name}": f"{kind.value}u" for kind in LightKind}
    defines |= {f"RAY_{flag.name}": f"{flag.value}u" for flag in RayVisibility}
    defines["RAY_ALL"] = f"{RayVisibility.ALL.value}u"
    defines["TRIANGLE_HOLDOUT"] = f"{TRIANGLE_HOLDOUT}u"
    defines |= {"LIGHT_CASTS_SHADOW": "256u", "LIGHT_IS_ELLIPSE": "512u", "LIGHT_IS_SPHERE": "1024u"}
    lines = [f"#define {name} {value}" for name, value in defines.items()]
    return "\n".join(lines + [struct.glsl for struct in STRUCTS]) + "\n"


#: Flag of a triangle beside its RAY_* bits: it cuts a hole into the picture.
TRIANGLE_HOLDOUT = 32

LIGHT_CASTS_SHADOW = 256
LIGHT_IS_ELLIPSE = 512
LIGHT_IS_SPHERE = 1024
assert AreaShape.ELLIPSE == 1


def slot(name: str) -> int:
    """The binding of a buffer, texture unit or image unit by its name."""
    name = _ALIASES.get(name, name)
    for table in (BUFFERS, TEXTURES, IMAGES):
        if name in table:
            return table.index(name)
    raise KeyError(name)
