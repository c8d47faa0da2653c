# SPDX-License-Identifier: GPL-3.0-or-later
"""Debug checks: what passes have written is read back and held against what must be true of it.

Numbers are finite and in range, lists are as long as their numbering says, links lead to faces that there are, and no
light bounces out of nothing. With the setting ``debug_checks`` off none of this is called.
"""

from __future__ import annotations

import moderngl
import numpy as np

from .gpu import interface
from .passes.compose import Film, PixelLight
from .passes.frame import Frame
from .passes.geometry import Geometry
from .passes.link import LinkPass
from .passes.packed_light import unpack_light
from .passes.voxel_numbers import popcount, with_hidden_cells
from .passes.voxelize import Voxels

#: Exponents that packed light may have (shaders/lib/packed_light.glsl).
LIGHT_EXPONENTS = (20, 254)
#: How much more light than its bound there may be: packed numbers are rounded, the rest of a series is estimated.
LIGHT_SLACK = 1.02
#: Cells that surfaces may be outside of the grid, for rounding.
OUTSIDE = 0.01


class CheckError(RuntimeError):
    """Something that a pass wrote cannot be. The text names pass, resource, index and value."""


def fail(pass_name: str, resource: str, index: object, what: str) -> None:
    """Raises CheckError."""
    raise CheckError(f'debug check: pass "{pass_name}", {resource}, entry {index}: {what}')


def expect(pass_name: str, resource: str, values: np.ndarray, good: np.ndarray, what: str) -> None:
    """Raises CheckError naming the first of ``values`` for which ``good`` (same shape, bool) is False."""
    if not good.all():
        index = np.unravel_index(int(np.argmin(good)), good.shape)
        found = f"{values[index]:g} {what} ({int((~good).sum())} such)"
        fail(pass_name, resource, tuple(int(i) for i in index) if len(index) > 1 else int(index[0]), found)


def expect_equal(pass_name: str, resource: str, values: np.ndarray, expected: np.ndarray, what: str) -> None:
    """Raises CheckError naming the first of ``values`` that is not ``expected`` (same shape)."""
    expect(pass_name, resource, values, values == expected, what)


def read_floats(texture: moderngl.Texture) -> np.ndarray:
    """(rows, columns, components) of a picture of floats or halves."""
    kind = np.float32 if texture.dtype == "f4" else np.float16
    width, height = texture.size
    return np.frombuffer(texture.read(), kind).reshape(height, width, texture.components)


def read_words(texture: moderngl.Texture | moderngl.Texture3D, count: int) -> np.ndarray:
    """(count, components) uint32 of a list."""
    return np.frombuffer(texture.read(), np.uint32).reshape(-1, texture.components)[:count]


def check_picture(pass_name: str, resource: str, texture: moderngl.Texture | None) -> None:
    """Colours are finite and not negative. Entries are (row from the bottom, column, component). None: no picture."""
    if texture is None:
        return
    values = read_floats(texture)[..., :3]
    expect(pass_name, resource, values, np.isfinite(values), "is not finite")
    expect(pass_name, resource, values, values >= 0.0, "is less than 0")


def check_light(pass_name: str, resource: str, texture: moderngl.Texture | None, count: int) -> np.ndarray:
    """Packed light of ``count`` faces is light; returns it, (count, 3). None: there is no light."""
    if texture is None:
        return np.zeros((count, 3), np.float32)
    stored = read_words(texture, count)
    exponents = stored[:, 1] >> 22
    lo, hi = LIGHT_EXPONENTS
    expect(pass_name, resource, exponents, (exponents >= lo) & (exponents <= hi), "is no exponent of light")
    return unpack_light(stored)


def check_geometry(geometry: Geometry) -> None:
    """Triangles are finite and inside the grid."""
    count = geometry.triangle_count
    texture = geometry.triangles
    words = read_words(texture, texture.width * texture.height)
    if geometry.has_instances:
        corners = _placed_corners(words, count)
    else:
        parts = np.ascontiguousarray(words[: 3 * count, :3]).view(np.float32).reshape(count, 3, 3)
        corners = parts.astype(np.float64)
        corners[:, 1:] += corners[:, :1]
    expect("geometry", "triangles (triangle, corner, axis)", corners, np.isfinite(corners), "is not finite")
    low, high = geometry.grid.box
    inside = (corners >= low - OUTSIDE) & (corners <= high + OUTSIDE)
    expect("geometry", "triangles (triangle, corner, axis)", corners, inside, "is outside the grid")


def _placed_corners(words: np.ndarray, count: int) -> np.ndarray:
    """(count, 3, 3) corners of all instances' triangles, cells. ``words``: (N, 4), what lib/triangle.glsl reads."""
    instances = int(words[3, 3])
    placements = words[: 4 * instances].reshape(instances, 4, 4)
    rows = np.ascontiguousarray(placements[:, :3]).view(np.float32).astype(np.float64)
    ends = np.append(placements[1:, 3, 0], count).astype(np.int64)
    result = np.zeros((count, 3, 3))
    for row, (first, place), end in zip(rows, placements[:, 3, :2].astype(np.int64).tolist(), ends, strict=True):
        texels = words[3 * place : 3 * (place + end - first), :3]
        corners = np.ascontiguousarray(texels).view(np.float32).reshape(-1, 3, 3)
        result[first:end] = corners @ row[:, :3].T + row[:, 3]
    return result


def check_voxels(voxels: Voxels, triangle_count: int) -> None:
    """Bricks number the cells, cells their triangles and faces; nothing is counted twice or left out."""
    name = "voxelize"
    bricks = read_words(voxels.bricks, int(np.prod(voxels.grid.bricks)))
    counts = popcount(np.ascontiguousarray(bricks[:, :2]).view(np.uint64).ravel())
    filled = counts > 0
    before = np.cumsum(counts) - counts
    expect_equal(name, "bricks, first cells", bricks[filled, 2], before[filled], "is not the count of cells before it")
    if int(counts.sum()) != voxels.cell_count:
        fail(name, "bricks", "all", f"{int(counts.sum())} marked cells, {voxels.cell_count} records")
    records = read_words(voxels.cells, voxels.cell_count).astype(np.int64)
    expect(name, "cells, triangle counts", records[:, 1], records[:, 1] > 0, "triangles in an occupied cell")
    starts = np.cumsum(records[:, 1]) - records[:, 1]
    expect_equal(name, "cells, first triangles", records[:, 0], starts, "is not the count of triangles before it")
    if int(records[:, 1].sum()) != voxels.pair_count:
        fail(name, "cells", "all", f"list {int(records[:, 1].sum())} triangles of {voxels.pair_count}")
    listed = read_words(voxels.cell_triangles, voxels.pair_count)[:, 0]
    if voxels.cell_triangles.components == 2:  # of instances, the numbers of which lie in the triangles' texture
        last = read_words(voxels.triangles, 4)[3, 3]
        expect(name, "instances of cells", listed, listed < last, f"is no instance (of {last})")
    else:
        expect(name, "triangles of cells", listed, listed < triangle_count, f"is no triangle (of {triangle_count})")
    if voxels.lit_faces is not None:
        _check_faces(voxels, with_hidden_cells(records, 0))


def _check_faces(voxels: Voxels, records: np.ndarray) -> None:
    name, faces = "voxelize", voxels.faces
    counts = popcount((records[:, 3] & interface.FACING_MASK).astype(np.uint64))
    starts = np.cumsum(counts) - counts
    expect_equal(name, "cells, first faces", records[:, 2], starts, "is not the count of faces before it")
    if int(counts.sum()) != faces.count:
        fail(name, "faces", "all", f"{int(counts.sum())} of cells, {faces.count} in all")
    listed = read_words(faces.order, faces.count)[:, 0]
    expect(name, "facings in the order of faces", listed, listed >> interface.FACING_SHIFT < 6, "is no facing")
    order = np.sort(listed & (1 << interface.FACING_SHIFT) - 1)
    expect_equal(name, "order of faces", order, np.arange(faces.count), "is listed twice, or in place of another")
    place = np.ascontiguousarray(read_words(faces.place, faces.count)[:, :3]).view(np.float32)
    expect(name, "places of faces", place, np.isfinite(place), "is not finite")
    low, high = voxels.grid.box
    inside = (place >= low - 1.0) & (place <= high + 1.0)
    expect(name, "places of faces", place, inside, "is outside the grid")


def check_links(links: LinkPass, faces: int) -> None:
    """Links lead to faces, or to none."""
    assert links.links is not None
    none = (1 << interface.LINK_BIN_SHIFT) - 1
    words = read_words(links.links, faces * links.count // 4).reshape(-1, links.count)
    bins = words >> interface.LINK_BIN_SHIFT
    good = (bins < interface.GUIDE_SIDE**2) | (bins == interface.NO_BIN)
    expect("link", "bins of links (face, link)", bins, good, "is no bin")
    found = words & none
    good = (found < faces) | (found == none)
    expect("link", "links (face, link)", found, good, f"is no face (of {faces})")
    check_light("link", "straight light of faces", links.straight, faces)


def check_radiance(
    voxels: Voxels, radiance: moderngl.Texture, irradiance: moderngl.Texture | None, straight: moderngl.Texture | None
) -> None:
    """Radiance of faces is light, and no more than arrives: a channel in which faces reflect at most r < 1, and of
    which at most S arrives straight from where it is made (over pi), has no radiance above r S / (1 - r)."""
    count = voxels.faces.count
    if not count:
        return
    sent = check_light("bounce", "radiance of faces", radiance, count)
    arrives = check_light("inject", "irradiance of faces", irradiance, count)
    arrives = arrives + check_light("link", "straight light of faces", straight, count)
    stored = np.frombuffer(voxels.faces.reflectance.read(), np.uint16).reshape(-1, 4)[:count, :3]
    most = stored.max(axis=0) / 65535.0
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.where(most < 1.0, most * arrives.max(axis=0).astype(np.float64) / (1.0 - most), np.inf)
    bound = np.where(arrives.max(axis=0) > 0.0, bound, 0.0) * LIGHT_SLACK
    expect("bounce", "radiance of faces", sent, sent <= bound, "is more than light and reflectance can bring")


def check_pixels(frame: Frame, light: PixelLight) -> None:
    """Pictures of surfaces, and of light at them."""
    surface = frame.surface
    position = read_floats(surface.position)
    seen = position[..., 3] == 1.0
    good = np.isfinite(position[..., :3]) | ~seen[..., None]
    expect("surface", "positions", position[..., :3], good, "is not finite")
    for name in ("diffuse", "f0", "f90", "emission"):
        values = read_floats(getattr(surface, name))[..., :3]
        good = (np.isfinite(values) & (values >= 0.0)) | ~seen[..., None]
        expect("surface", name, values, good, "is not finite, or less than 0")
    check_picture("direct", "diffuse light", light.direct_diffuse)
    check_picture("direct", "glossy light", light.direct_glossy)
    check_picture("gather", "incoming light", light.gathered)
    check_picture("gather", "incoming light of emitters", light.gathered_emitted)
    check_picture("reflect", "reflected light", light.reflected)
    check_picture("reflect", "reflected light of emitters", light.reflected_emitted)


def check_film(film: Film) -> None:
    """Means of all outputs are finite; the picture is not negative."""
    for name in film.names:
        values = film.read_mean(name)
        expect("film", name, values, np.isfinite(values), "is not finite")
        if name == "combined":
            expect("film", name, values, values >= 0.0, "is less than 0")
