# SPDX-License-Identifier: GPL-3.0-or-later
"""What Python and GLSL must agree on: bindings, work-group sizes, structs.

No digit follows ``binding =`` in a ``.glsl`` file: the names below are put before every shader as defines, and each
struct is printed from its declaration, so that there is one text for both sides.
"""

from __future__ import annotations

import functools
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
TRIANGLE_BYTES = 48
#: Where an instance stands takes four texels of such a row.
PLACEMENTS_PER_ROW = 3 * TRIANGLES_PER_ROW // 4

#: A brick is this many cells on each side; one bit a cell, two 32-bit words a brick.
BRICK = 4

#: Fixed-point unit of the sums of voxelization: 16.16, so that sums are integers and do not depend on order.
FIXED_ONE = 65536
#: Facings of the two sides of a cell, in the last word of its record; what lies above says where it is cut.
FACING_MASK = 0xFFF
#: Where the last two words of a cell's record begin to say which cells are hidden from its faces; below lies the number
#: of its first face: a texture holds no longer lists.
HIDDEN_SHIFT = 26
#: In the last word of a cell's record: not 0 where the cell is cut.
CUT_BITS = 3 << 12
#: And where it is cut by the plane of a triangle (lib/cut.glsl).
CUT_IS_ASLANT = 1 << 25

#: Most layers of surface that a face's weight tells apart; cones clamp opacity far below.
MAX_FACE_WEIGHT = 16

#: Where a cell has hardly any of a surface, what little there is tells nothing of the surface beside it.
LEAST_WEIGHT = 1e-4

#: About how many lights are asked for their shadows at a point, where there are more.
LIGHT_PICKS = 16

#: A corner's normal that is nearer to its triangle's than this (a quarter of a degree) differs by rounding alone.
FLAT_COSINE = 0.99999

#: Boxes that tell which rays meet something else after an edit, at most.
CHANGED_BOXES = 16

#: Bins of a guide along each side of a facing's hemisphere: a power of two.
GUIDE_SIDE = 8
#: Texels of its tree of shares: 1, 4, 16, ... of four shares each.
GUIDE_TEXELS = (GUIDE_SIDE**2 - 1) // 3

#: Where in a link the bin begins that its ray looks into (lib/link.glsl); below lies the number of the face it meets.
LINK_BIN_SHIFT = 25
#: Instead of a bin: the ray comes from below the horizon of the face's facing.
NO_BIN = (1 << 32 - LINK_BIN_SHIFT) - 1
#: Where in the order of faces the facing begins; below lies the number of the face.
FACING_SHIFT = 29

#: A face or a triangle that is not there.
NONE_INDEX = 0xFFFFFFFF

#: Faces in a row for which one word says by how much their numbers grow; NO_SHIFT: not all by as much.
NUMBER_RUN, NO_SHIFT = 64, 1 << 31

#: A list of triangles that is longer has boxes over runs of its entries (lib/cell_list.glsl).
LONG_LIST = 32
#: Entries in such a run, and boxes that a larger one holds.
BOX_RUN = 8
BOX_FAN = 8
#: Room for boxes: so many for each sixteen entries of lists; a long list has no more.
BOXES_PER_16 = 3

#: Bits of a cell's record for the number, in the cell's list, of the triangle whose plane cuts it (lib/cut.glsl); and
#: the longest lists whose cells are cut so.
CUT_ENTRY_BITS = 11
ASLANT_LIST = 1 << CUT_ENTRY_BITS

#: Faces of cells that have no more triangles, and no cut, are made by a program of their own, without boxes. A word has
#: a bit for each of the triangles: no more than 32.
PLAIN_LIST = 32

#: Triangles of a cell up to which one thread sums them up: software rasterizers end its loops after 65536 rounds.
CROWD = 4096
#: Triangles that a thread sums up where there are more, and words of a crowded cell's sums (lib/crowd.glsl).
CROWD_RUN = 256
CROWD_WORDS = 64

# Storage buffers. A compute shader may count on eight in GL 4.3. What rays read lies in textures instead, as drivers
# may allow a buffer no more than 128 MiB. On software rasterizers a word or two of an entry that may lie anywhere come
# a fifth faster out of a buffer than out of a texture; of four words there is no difference.
BUFFERS = (
    "BUF_RADIANCE",  # uvec2[] (lib/packed_light.glsl): radiance of faces while light bounces
    "BUF_MATERIALS",  # uint[]: batch of each material; world parameters
    "BUF_WORK",  # work items, pixel lists
    "BUF_RESULTS",  # what lists are made into: bins of pixels, arguments of dispatches, emitters, light after a bounce
    "BUF_COUNTS",  # counters and cursors
)
# One binding, two names: never used by the same program.
BUFFER_ALIASES = {
    "BUF_RADIANCE_BEFORE": "BUF_WORK",  # as BUF_RADIANCE, a bounce before
    # uint[]: where faces are taken over, by how much the numbers of runs of them have grown, then what each has become
    "BUF_NUMBERS_NOW": "BUF_RADIANCE",
}

# Texture units. GL 4.3 promises sixteen to a stage.
TEXTURES = (
    "TEX_TRIANGLES",  # rgba32ui 2D, three texels a triangle: corner 0, edge 1, edge 2 in grid space; w: packed integers
    # (or, where instances share them, what lib/triangle.glsl says)
    "TEX_BRICKS",  # rgba32ui 3D: two words with a bit for each cell, number of the first cell, empty cubes
    "TEX_INSTANCES",  # rgba32ui list: Instance, several texels each
    "TEX_CELLS",  # rgba32ui 2D list: lib/grid.glsl; then boxes over long lists
    "TEX_CORNERS",  # rgba32ui list: three corners and the slot of each triangle of each mesh
    "TEX_CELL_TRIANGLES",  # r32ui 2D list: triangles of cells; rg32ui: where instances share them
    "TEX_CELL_OPACITIES",  # r8 2D list: opacity of each of them; rg32ui: with outlines (lib/outline.glsl)
    "TEX_FACE_RADIANCE",  # rg32ui 2D list (lib/packed_light.glsl): radiance leaving each voxel face
    "TEX_WORLD",  # rgba32f 2D: radiance of the world, equirectangular; w: density of directions drawn by it
    "TEX_CONES",  # rgba16f 3D: six facings side by side in z, with coarser levels
    "TEX_POSITION",  # rgba32f 2D, pixels: grid space; w: 0 nothing there, 1 a surface, 2 a light
    "TEX_NORMAL",  # rgba16 2D, pixels: shading and geometric normal, octahedral, mapped to 0..1
    "TEX_DIFFUSE",  # rgba16f 2D, pixels: diffuse reflectance, roughness
    "TEX_F0",  # rgba16f 2D, pixels: specular reflectance at normal incidence; w: 1 for holdouts
    "TEX_F90",  # rgba16f 2D, pixels: and at grazing incidence
    "TEX_EMISSION",  # rgba32f 2D, pixels: W/(m2 sr)
)
# One unit, two names: never read by the same program.
TEXTURE_ALIASES = {
    # Voxel faces, where there are no pixels.
    "TEX_FACE_PLACE": "TEX_POSITION",  # rgba32ui list: position (grid space), normal (octahedral)
    "TEX_FACE_REFLECTANCE": "TEX_NORMAL",  # rgba16 list: reflectance, root of weight / MAX_FACE_WEIGHT
    "TEX_FACE_STRAIGHT": "TEX_DIFFUSE",  # rg32ui list: from world and emitters along links, W/(m2 sr)
    "TEX_FACE_IRRADIANCE": "TEX_F0",  # rg32ui list: from lights, over pi
    "TEX_FACE_ORDER": "TEX_CONES",  # r32ui list: faces, alike ones adjacent; facing << FACING_SHIFT
    "TEX_FACE_SHADING": "TEX_DIFFUSE",  # r32ui list: shading normal (octahedral), where light is received
    "TEX_LINKS": "TEX_F90",  # rgba32ui list: faces that each face sees (lib/link.glsl)
    "TEX_PARTNERS": "TEX_F90",  # r32ui list: with which faces each shares light (pass partners)
    "TEX_REACH": "TEX_FACE_RADIANCE",  # r8ui 3D: 1 for bricks that an edit may have changed shadows in
    "TEX_NUMBERS_BEFORE": "TEX_NORMAL",  # r32ui list: number that each face had; where faces are taken over
    "TEX_STRAIGHT_BEFORE": "TEX_F0",  # as TEX_FACE_STRAIGHT
    "TEX_LIGHTS": "TEX_EMISSION",  # rgba32ui list: Light, several texels each
    # Emitters, where no material is evaluated.
    "TEX_EMITTERS": "TEX_INSTANCES",  # rgba32ui list: Emitter, several texels each
    "TEX_EMITTER_LOOKUP": "TEX_CORNERS",  # r32ui list: triangle -> its first emitter and how its edges are divided
    # Drawing directions of the world, where no face is looked up.
    "TEX_WORLD_TABLE": "TEX_FACE_RADIANCE",  # r32f 2D: running sums of chances
    # Materials, where no ray is traced.
    "TEX_ATTRIBUTES": "TEX_CELL_OPACITIES",  # r32ui list: corner normals, UV and colour layers
    "TEX_MATERIALS": "TEX_CELL_TRIANGLES",  # rgba32f list: parameters
    # While triangles are transformed, before there are any.
    "TEX_SLOTS": "TEX_TRIANGLES",  # r32ui list: slots of instances, material | flags << 24
    "TEX_VERTICES": "TEX_BRICKS",  # rgba32ui list: three vertices and the slot of each triangle
    "TEX_MESH_POSITIONS": "TEX_CELLS",  # rgba32ui list: object space
    "TEX_PLACEMENTS": "TEX_CELL_TRIANGLES",  # rgba32ui list: pass transform
    # While voxels are made (lib/part.glsl).
    "TEX_WORK": "TEX_FACE_RADIANCE",  # rg32ui list: work items (triangle, item number); too many for a buffer
    "TEX_PAIRS": "TEX_FACE_RADIANCE",  # rgba32ui list: triangle, cell, area, centre in the cell
    "TEX_PARTS": "TEX_FACE_RADIANCE",  # rgba32ui list, cell by cell: what pairs bring to faces
    "TEX_CELL_POSITIONS": "TEX_WORLD",  # r32ui list: lib/part.glsl
    "TEX_CHANGED_BRICKS": "TEX_CONES",  # r8ui 3D: 1 where voxels are made again
    # Composition reads no grid: what it composes has the grid's units.
    "TEX_DIRECT_DIFFUSE": "TEX_FACE_RADIANCE",
    "TEX_DIRECT_GLOSSY": "TEX_BRICKS",
    "TEX_GATHERED": "TEX_CELL_OPACITIES",
    "TEX_GATHERED_EMITTED": "TEX_CELLS",
    "TEX_REFLECTED": "TEX_CORNERS",
    "TEX_REFLECTED_EMITTED": "TEX_CELL_TRIANGLES",
    "TEX_VALUE": "TEX_TRIANGLES",
    # Guides, where no cones are traced.
    "TEX_GUIDES": "TEX_CONES",  # rgba8 list: trees of shares; while they are made rgba32ui: bins
    "TEX_GUIDE_NUMBERS": "TEX_EMISSION",  # r32ui 3D, bricks: lib/guide_number.glsl
    # Light of the last frame: its pictures take units one after the other.
    "TEX_BEFORE_PLACE": "TEX_BRICKS",  # rgba32ui 2D, pixels: position (grid space), normal, passes
    "TEX_BEFORE_0": "TEX_INSTANCES",
}
#: Material textures share units with what a step that evaluates materials never reads. GL promises sixteen units, so
#: eight textures; more where the driver has more.
FIRST_MATERIAL_TEXTURE = 8
MAX_MATERIAL_TEXTURES = 24

# Image units. GL 4.3 promises eight to a stage.
IMAGES = ("IMG_0", "IMG_1", "IMG_2", "IMG_3", "IMG_4", "IMG_5", "IMG_6", "IMG_TILES")
#: Textures that software rasterizers read as images (lib/source.glsl), and the units for that: what rays ask most, ...
SOURCES = {"TEX_TRIANGLES": 8, "TEX_BRICKS": 9, "TEX_CELLS": 10, "TEX_CELL_TRIANGLES": 11}
#: ... what triangles are transformed from, before there is any of those, and voxels are made of, ...
SOURCES |= {"TEX_SLOTS": 8, "TEX_VERTICES": 9, "TEX_MESH_POSITIONS": 10, "TEX_PLACEMENTS": 11}
SOURCES |= {"TEX_WORK": 12, "TEX_PAIRS": 12, "TEX_PARTS": 12, "TEX_CELL_POSITIONS": 13}
#: ... and pictures that pixels ask for many others. The last of them takes three units.
SOURCES |= {"TEX_POSITION": 14, "TEX_NORMAL": 15, "TEX_DIFFUSE": 16, "TEX_GATHERED": 17}
SOURCES |= {"TEX_BEFORE_PLACE": 18, "TEX_BEFORE_0": 19}
SOURCE_UNITS = 22
MOST_IMAGES = 16  # of one program that reads images
IMAGE_ALIASES = {"IMG_RAYS": "IMG_TILES"}  # layers whose pixels have rays of their own ask no tiles
ALIASES = BUFFER_ALIASES | TEXTURE_ALIASES | IMAGE_ALIASES

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
    """A struct of a storage buffer (std430) or a list texture: fields as (name, GLSL type, what it is)."""

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
        assert itemsize % 16 == 0, f"{self.name} is read as whole texels too"
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})

    @property
    def texels(self) -> int:
        """Texels of one record in a rgba32ui list."""
        return self.dtype.itemsize // 16

    @property
    def glsl(self) -> str:
        """The struct, and a function that fetches one record from a rgba32ui list texture."""
        name = self.name
        lines = [f"    {kind} {field};  // {doc}" for field, kind, doc in self.fields]
        lines = [f"struct {name} {{", *lines, "};", f"{name} fetch_{name.lower()}(usampler2D list, uint index)", "{"]
        for k in range(self.texels):
            at = f"index * {self.texels}u + {k}u"
            lines.append(
                f"    uvec4 t{k} = texelFetch(list, ivec2(({at}) % uint(LIST_WIDTH), ({at}) / uint(LIST_WIDTH)), 0);"
            )
        lines.append(f"    {name} r;")
        dtype = self.dtype
        for field, kind, _ in self.fields:
            word = dtype.fields[field][1] // 4  # type: ignore[index]
            count = _GLSL_SIZE[kind][1] // 4
            value = f"t{word // 4}.{'xyzw'[word % 4 : word % 4 + count]}"
            value = {"uint": value, "int": f"int({value})"}.get(kind, f"uintBitsToFloat({value})")
            lines.append(f"    r.{field} = {value};")
        return "\n".join([*lines, "    return r;", "}"])


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
        ("pad", "uint", ""),
    ),
)

LIGHT = Struct(
    "Light",
    (
        ("position_grid", "vec3", "cells"),
        ("kind", "uint", "LIGHT_*"),
        ("intensity", "vec3", "W/sr, W/m2 or W/(m2 sr) by kind"),
        ("flags", "uint", "RAY_* that see it; LIGHT_CASTS_SHADOW, LIGHT_IS_ELLIPSE, LIGHT_IS_SPHERE"),
        ("axis_z", "vec3", "unit; the light shines along -z"),
        ("radius_grid", "float", "cells; area lights: half the longer side; suns: sine of half their angle"),
        ("axis_x", "vec3", "unit"),
        ("half_width_grid", "float", "area lights: half the side along x, cells"),
        ("axis_y", "vec3", "unit"),
        ("half_height_grid", "float", "along y"),
        ("spot_scale", "vec3", "spot: 1 / object scale"),
        ("spot_smooth", "float", "spot: 1 / ((1 - cos_cone) blend); area: half the spread"),
        ("radiance", "vec3", "of the visible disk, sphere or area"),
        ("cos_cone", "float", "spot: cosine of half the cone"),
    ),
)

EMITTER = Struct(
    "Emitter",
    (
        ("corner_grid", "vec3", "cells"),
        ("cumulative", "float", "chances of this emitter and of those before it, in EMITTER_UNITS"),
        ("edge_1", "vec3", "corner 1 - corner 0"),
        ("density", "float", "chance that it is chosen, over its area in cells^2"),
        ("edge_2", "vec3", "corner 2 - corner 0"),
        ("flags", "uint", "RAY_* that see it"),
        ("front", "vec3", "radiance to the side that cross(edge_1, edge_2) points to, where it is not transparent"),
        ("opacity", "float", "share of it that is not transparent"),
        ("back", "vec3", "radiance to the other side"),
        ("pad", "float", ""),
    ),
)

#: Chances of emitters are whole multiples of one over this: exact in a float.
EMITTER_UNITS = 1 << 24

STRUCTS = (INSTANCE, LIGHT, EMITTER)


@functools.cache
def prelude() -> str:
    """GLSL text put before every shader: bindings, sizes, shared constants and structs."""
    defines: dict[str, object] = {}
    for table in (BUFFERS, TEXTURES, IMAGES):
        defines |= {name: slot for slot, name in enumerate(table)}
    defines |= {name.replace("TEX", "SOURCE"): unit for name, unit in SOURCES.items()}
    defines |= {alias: defines[name] for alias, name in ALIASES.items()}
    defines |= {f"TEX_MATERIAL_{i}": FIRST_MATERIAL_TEXTURE + i for i in range(MAX_MATERIAL_TEXTURES)}
    defines |= {
        "GROUP_SIZE": GROUP_SIZE,
        "TILE_SIZE": TILE_SIZE,
        "LIST_WIDTH": LIST_WIDTH,
        "TRIANGLES_PER_ROW": TRIANGLES_PER_ROW,
        "PLACEMENTS_PER_ROW": PLACEMENTS_PER_ROW,
        "BRICK": BRICK,
        "GUIDE_SIDE": GUIDE_SIDE,
        "GUIDE_LEVELS": GUIDE_SIDE.bit_length() - 1,
        "GUIDE_TEXELS": GUIDE_TEXELS,
        "FIXED_ONE": f"{FIXED_ONE}.0",
        "FACING_MASK": f"0x{FACING_MASK:X}u",
        "FIRST_FACE_MASK": f"0x{(1 << HIDDEN_SHIFT) - 1:X}u",
        "HIDDEN_SHIFT": HIDDEN_SHIFT,
        "CUT_IS_ASLANT": f"0x{CUT_IS_ASLANT:X}u",
        "LINK_BIN_SHIFT": LINK_BIN_SHIFT,
        "NO_BIN": f"{NO_BIN}u",
        "FACING_SHIFT": FACING_SHIFT,
        "NONE_INDEX": f"0x{NONE_INDEX:X}u",
        "NUMBER_RUN": f"{NUMBER_RUN}u",
        "NO_SHIFT": f"0x{NO_SHIFT:X}u",
        "FLAT_COSINE": FLAT_COSINE,
        "MAX_FACE_WEIGHT": f"{MAX_FACE_WEIGHT}.0",
        "LEAST_WEIGHT": LEAST_WEIGHT,
        "LIGHT_PICKS": LIGHT_PICKS,
        "CHANGED_BOXES": CHANGED_BOXES,
        "LONG_LIST": f"{LONG_LIST}u",
        "BOX_RUN": f"{BOX_RUN}u",
        "BOX_FAN": f"{BOX_FAN}u",
        "BOXES_PER_16": f"{BOXES_PER_16}u",
        "CUT_ENTRY_BITS": CUT_ENTRY_BITS,
        "ASLANT_LIST": f"{ASLANT_LIST}u",
        "PLAIN_LIST": f"{PLAIN_LIST}u",
        "CROWD": f"{CROWD}u",
        "CROWD_RUN": f"{CROWD_RUN}u",
        "CROWD_WORDS": f"{CROWD_WORDS}u",
        "EMITTER_UNITS": f"{EMITTER_UNITS}.0",
        "EMITTER_TEXELS": f"{EMITTER.texels}u",
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
    name = ALIASES.get(name, name)
    for table in (BUFFERS, TEXTURES, IMAGES):
        if name in table:
            return table.index(name)
    raise KeyError(name)
