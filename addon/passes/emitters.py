# SPDX-License-Identifier: GPL-3.0-or-later
"""Glowing surfaces as lights: where they are, what they emit, and how likely points on them are chosen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from ..gpu import interface
from ..gpu.context import GpuContext, Kernel
from ..grid import measure_surfaces
from ..scene import RayVisibility, SceneData
from .geometry import Geometry
from .materials import MaterialPass, MaterialSet, emitting

#: Points on emitters in each pass at each pixel, of which one is looked at, and at each voxel face.
PIXEL_SAMPLES, FACE_SAMPLES = 4, 4
#: Emitters evaluated in one dispatch: bounds how long a step takes, so that cancelling is quick.
EMITTERS_PER_STEP = 1 << 16
#: Parts of the edge of a triangle whose emission varies, at most, and parts of all of them together, about.
MAX_DIVISION, MAX_PARTS = 64, 1 << 18

#: Weights of red, green and blue.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: Rays that leave surfaces.
_FROM_SURFACES = RayVisibility.DIFFUSE | RayVisibility.GLOSSY | RayVisibility.TRANSMISSION


@dataclass
class _Candidates:
    """Triangles that may emit, in the order of the scene."""

    triangles: np.ndarray  # (T,) int64
    batches: np.ndarray  # (T,) int64
    divisions: np.ndarray  # (T,) int64: parts of an edge
    instances: list[int]  # that they are of


def divisions(areas: np.ndarray, varies: np.ndarray) -> np.ndarray:
    """(T,) parts of an edge of each triangle: as large as a cell where emission varies. ``areas``: cells^2."""
    wanted = np.where(varies, np.sqrt(2.0 * areas), 1.0)
    parts = float(np.square(wanted, where=varies, out=np.zeros_like(wanted)).sum())
    if parts > MAX_PARTS:
        wanted = np.where(varies, wanted * np.sqrt(MAX_PARTS / parts), 1.0)
    return np.clip(np.ceil(wanted - 1e-6), 1, MAX_DIVISION).astype(np.int64)


def distribution(power: np.ndarray) -> np.ndarray:
    """(N,) float64: running sums of chances, as whole numbers that end at EMITTER_UNITS.

    What has power has at least one unit, however little it is of the whole; what has none has none.
    """
    lit = power > 0.0
    share = np.cumsum(power / power.sum())
    return np.rint(share / share[-1] * (interface.EMITTER_UNITS - int(lit.sum()))) + np.cumsum(lit)


def effective_area(areas: np.ndarray, radiance: np.ndarray) -> float:
    """The area of evenly bright emitters whose light rays find as often: (sum A L)^2 / sum A L^2."""
    squares = float((areas * np.square(radiance)).sum())
    return float((areas * radiance).sum()) ** 2 / squares if squares > 0.0 else 0.0


class EmitterTable:
    """Emitters on the GPU. Where nothing emits there is nothing."""

    def __init__(self, gpu: GpuContext) -> None:
        self.gpu = gpu
        self.records: moderngl.Texture | None = None
        self.lookup: moderngl.Texture | None = None
        self.count = 0
        #: Whether points on emitters find more than rays do. A ray that meets surfaces evenly brings emission with a
        #: relative variance of (area of all surfaces) / (effective area of emitters) - 1: points pay where it is
        #: above 1, that of a point on an emitter, about.
        self.is_small = False
        self._effective_area = 0.0  # cells^2
        self._owners: frozenset[int] = frozenset()  # instances that may have some
        self._first_triangle = self._span = 0

    def run(
        self, scene: SceneData, geometry: Geometry, materials: MaterialSet, material_pass: MaterialPass
    ) -> Iterator[float]:
        """Evaluate what may emit and keep what does. Yields the share done."""
        self.release()
        found = _candidates(scene, geometry, materials)
        if found is None:
            return
        self._owners = frozenset(found.instances)
        counts = found.divisions**2
        starts = np.cumsum(counts) - counts
        records = np.zeros(int(counts.sum()), interface.EMITTER.dtype)
        rows = np.zeros((len(records), 4), np.uint32)
        rows[:, 0] = np.repeat(found.triangles, counts)
        rows[:, 1] = np.arange(len(records)) - np.repeat(starts, counts)
        rows[:, 2] = np.repeat(found.divisions, counts)
        batches = np.repeat(found.batches, counts)
        done = 0
        for batch in np.unique(batches):
            chosen = np.flatnonzero(batches == batch)
            for first in range(0, len(chosen), EMITTERS_PER_STEP):
                part = chosen[first : first + EMITTERS_PER_STEP]
                with self.gpu.timed("emitters"):
                    records[part] = self._evaluate(rows[part], int(batch), geometry, materials, material_pass)
                done += len(part)
                yield done / len(records)
        with self.gpu.timed("emitters"):
            self._keep(records, found, starts)

    def compare(self, scene: SceneData, geometry: Geometry) -> None:
        """Set ``is_small``, which depends on all surfaces."""
        if self.count:
            scene_area = measure_surfaces(scene).area / geometry.grid.cell_size**2
            self.is_small = self._effective_area < 0.5 * scene_area

    def may_include(self, scene: SceneData, instances: Sequence[int], materials: MaterialSet) -> bool:
        """Whether some of ``instances`` may have emitters now, or had some when the table was made."""
        emits = emitting(materials)
        if any(emits[list(scene.instances[index].materials)].any() for index in instances):
            return True
        return not self._owners.isdisjoint(instances)

    def _evaluate(
        self, rows: np.ndarray, index: int, geometry: Geometry, materials: MaterialSet, material_pass: MaterialPass
    ) -> np.ndarray:
        gpu, batch = self.gpu, materials.batches[index]
        work = gpu.buffer("emitter work", rows)
        made = gpu.buffer("emitter work", size=len(rows) * interface.EMITTER.dtype.itemsize)
        defines = material_pass.defines(batch) | geometry.defines | {"FLAT_SHADING": True}
        kernel = gpu.kernel("emitters", defines, material_pass.texts(batch))
        geometry.bind(kernel)
        material_pass.bind(batch, kernel)
        work.bind_to_storage_buffer(interface.slot("BUF_WORK"))
        made.bind_to_storage_buffer(interface.slot("BUF_RESULTS"))
        kernel.set(work_count=len(rows))
        kernel.run_list(len(rows))
        material_pass.unbind(batch)
        gpu.barrier()  # read back
        result = np.frombuffer(made.read(), interface.EMITTER.dtype)[: len(rows)].copy()
        gpu.free(work, made)
        return result

    def _keep(self, records: np.ndarray, found: _Candidates, starts: np.ndarray) -> None:
        edge_1, edge_2 = records["edge_1"].astype(np.float64), records["edge_2"].astype(np.float64)
        areas = 0.5 * np.linalg.norm(np.cross(edge_1, edge_2), axis=1)
        sides = np.stack([records["front"] @ LUMINANCE, records["back"] @ LUMINANCE])
        sides = sides * records["opacity"].astype(np.float64)
        power = areas * sides.sum(axis=0)
        lit = np.add.reduceat(power, starts) > 0.0
        counts = found.divisions**2
        kept = np.repeat(lit, counts)
        if not kept.any():
            return
        records, areas, power = records[kept], areas[kept], power[kept]
        self._effective_area = effective_area(areas, sides.max(axis=0)[kept])
        cumulative = distribution(power)
        chance = np.diff(cumulative, prepend=0.0) / interface.EMITTER_UNITS
        records["cumulative"] = cumulative
        records["density"] = np.divide(chance, areas, out=np.zeros_like(chance), where=areas > 0.0)

        triangles, counts = found.triangles[lit], counts[lit]
        self._first_triangle = int(triangles[0])
        self._span = int(triangles[-1]) - self._first_triangle + 1
        words = np.full(self._span, interface.NONE_INDEX, np.uint32)
        words[triangles - self._first_triangle] = (np.cumsum(counts) - counts) << 6 | (found.divisions[lit] - 1)
        self.count = len(records)
        texels = records.view(np.uint32).reshape(-1, 4)
        self.records = self.gpu.list_texture("emitters", len(texels), 4, "u4", texels)
        self.lookup = self.gpu.list_texture("emitters", len(words), 1, "u4", words)

    def bind(self, kernel: Kernel, samples: int) -> None:
        """Bind what lib/emitter.glsl reads. ``samples``: points drawn on emitters where rays look for them too."""
        assert self.records is not None and self.lookup is not None
        self.records.use(interface.slot("TEX_EMITTERS"))
        self.lookup.use(interface.slot("TEX_EMITTER_LOOKUP"))
        kernel.set(
            emitter_count=self.count, emitter_first_triangle=self._first_triangle, emitter_span=self._span,
            emitter_samples=samples,
        )  # fmt: skip

    def release(self) -> None:
        """Free everything."""
        self.gpu.free(self.records, self.lookup)
        self.records = self.lookup = None
        self.count, self.is_small, self._effective_area = 0, False, 0.0
        self._owners = frozenset()
        self._first_triangle = self._span = 0


def _candidates(scene: SceneData, geometry: Geometry, materials: MaterialSet) -> _Candidates | None:
    """Triangles with a material that may emit, of instances that rays from surfaces see."""
    compiled = materials.compiled
    families = [compiled.families[material.family] for material in compiled.materials]
    emits = emitting(materials)
    varies = np.array([family.emission_varies for family in families], bool)
    if not emits.any():
        return None
    parts, instances = [], []
    first = 0
    for index, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        before, first = first, first + len(mesh.triangle_vertices)
        of_slot = np.asarray(instance.materials)
        if not instance.visibility & _FROM_SURFACES or not emits[of_slot].any():
            continue
        material = of_slot[mesh.triangle_slots]
        chosen = np.flatnonzero(emits[material])
        material = material[chosen]
        areas = np.zeros(len(chosen))
        if varies[material].any():
            corners = mesh.positions[mesh.triangle_vertices[chosen]].astype(np.float64)
            edges = (corners[:, 1:] - corners[:, :1]) @ instance.world_from_object[:3, :3].T / geometry.grid.cell_size
            areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        parts.append((before + chosen, material, areas))
        instances.append(index)
    if not sum(len(triangles) for triangles, _, _ in parts):
        return None
    triangles, material, areas = (np.concatenate(column) for column in zip(*parts, strict=True))
    return _Candidates(
        triangles,
        materials.batch_of_material[material].astype(np.int64),
        divisions(areas, varies[material]),
        instances,
    )
