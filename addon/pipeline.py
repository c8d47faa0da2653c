# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame, top to bottom. One pipeline serves a viewport, an F12 render or a preview; it knows nothing of Blender.

    prepare: materials -> geometry -> emitters -> voxels -> lights -> injection -> links -> bounces (-> guides, cones)
    sample:  surfaces -> direct light -> gather -> reflections -> sharing (-> light of earlier passes) -> film

Each step of ``prepare`` is redone only when something it depends on has changed. Both are generators that yield between
pieces of work of well under half a second, so that a caller can show progress and stop.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from typing import Any

from .features import Features
from .gpu.context import GpuContext
from .grid import VoxelGrid
from .levels import coarsened
from .passes.compose import Film
from .passes.view import VOXEL_VIEWS, SeenRays
from .picture import Picture
from .scene import SceneData
from .settings import Settings
from .steps import PipelineError, Progress, same
from .voxel_light import VoxelLight


class Pipeline:
    """Renders one scene into a film. All GL objects live in ``gpu`` and are freed by ``release``."""

    def __init__(self, gpu: GpuContext, *, is_live: bool = False) -> None:
        """``is_live``: somebody edits the scene. What an edit can take over is kept: 20 bytes for each voxel
        face."""
        self.gpu = gpu
        self.voxel_light = VoxelLight(gpu, is_live=is_live)
        self.picture = Picture(gpu)
        self._failed_with_geometry = False  # the last error came after the geometry was there
        #: Settings of voxels that did not fit, and what to set in place of them.
        self._coarsened: tuple[tuple, dict[str, Any]] | None = None
        self.warnings: list[str] = []

    @property
    def film(self) -> Film:
        return self.picture.film

    @property
    def features(self) -> Features | None:
        return self.voxel_light.features

    @property
    def grid(self) -> VoxelGrid | None:
        return self.voxel_light.grid

    @property
    def redone(self) -> dict[str, int]:
        """Of the last ``prepare`` that did any: cells that were voxelized, faces that were linked to others and lit."""
        return self.voxel_light.redone

    def want(self, names: Iterable[str]) -> None:
        """Which outputs the film keeps, by the names of passes/compose.py; call before ``prepare``.

        The picture is always among them, but where nothing is asked for but voxels.
        """
        wanted = set(names)
        if not wanted or not wanted <= set(VOXEL_VIEWS):
            wanted.add("combined")
        self.picture.wanted = wanted

    # Voxels -----------------------------------------------------------------------------------------------------

    def prepare(
        self,
        scene: SceneData,
        settings: Settings,
        size: tuple[int, int],
        *,
        follows: bool = False,
        is_draft: bool = False,
    ) -> Iterator[Progress]:
        """Bring voxels and light up to date for ``scene`` and start the film at zero, ``size`` pixels.

        ``follows``: it is the next frame of an animation, and may take over light from the last one. ``is_draft``:
        where an object was moved, bounced light may go on from what it was before, which the next call that is none
        makes good. Where memory does not suffice, voxels become coarser, with a warning.
        Raises PipelineError, MemoryError, ShaderError, GpuUnavailable, and has let go of everything then.
        A generator that is not run to its end leaves no half-done step:
        the next call does that step again.
        """
        wanted = (
            settings.voxel_auto, settings.voxel_resolution, settings.memory_budget, settings.bounce_rays,
            settings.voxel_levels, settings.voxel_detail, size, scene.meshes, scene.instances,
        )  # fmt: skip
        while True:
            coarser = self._coarsened[1] if self._coarsened and same(self._coarsened[0], wanted) else {}
            fitting = settings.with_values(**coarser)
            try:
                yield from self._letting_go(self._prepare(scene, fitting, size, follows, is_draft))
                break
            except MemoryError:
                coarser = coarsened(self.voxel_light.plan, self.grid) if self._failed_with_geometry else {}
                if not coarser:
                    self._coarsened = None
                    raise
                self._coarsened = wanted, coarser
        if coarser:
            along = "the sides of levels" if coarser["voxel_levels"] == "ON" else "the longest side"
            self.warnings.append(
                f"There is no memory for finer voxels: {coarser['voxel_resolution']} are used along {along}"
            )

    def _letting_go(self, steps: Generator[Progress, None, None]) -> Iterator[Progress]:
        """``steps``; when one fails, lets go of everything, and of what that step has made so far."""
        before = self.gpu.alive()
        try:
            for progress in steps:
                ours = self.gpu.alive()
                yield progress
                before |= self.gpu.alive() - ours  # made meanwhile by others in this context
        except Exception:
            self._failed_with_geometry = self.voxel_light.has_geometry
            self.release()
            self.gpu.free_since(before)
            raise
        finally:
            steps.close()

    def _prepare(
        self, scene: SceneData, settings: Settings, size: tuple[int, int], follows: bool, is_draft: bool
    ) -> Generator[Progress, None, None]:
        self.picture.check_size(size)
        self.gpu.times.clear()  # statistics are those of one picture
        yield from self.voxel_light.place(scene, settings)
        assert self.features is not None and self.grid is not None
        self.picture.check_size(size, self.features)
        yield from self.voxel_light.light(is_draft=is_draft)
        self.warnings = list(dict.fromkeys(self.voxel_light.warnings))
        surfaces = self.voxel_light.surfaces
        assert surfaces is not None
        self.picture.start(scene, settings, size, self.features, self.grid, surfaces, follows=follows)
        self.gpu.check()
        yield Progress(1.0, "Ready")

    def sample(self) -> Iterator[Progress]:
        """Add one pass to the film. ``prepare`` must have been run to its end.

        Raises PipelineError, MemoryError, ShaderError, GpuUnavailable; ``prepare`` must be run again then.
        """
        yield from self._letting_go(self._sample())

    def _sample(self) -> Generator[Progress, None, None]:
        lit, surfaces = self.voxel_light.lit, self.voxel_light.surfaces
        if lit is None or surfaces is None:
            raise PipelineError("nothing was prepared to render")
        yield from self.picture.sample(lit, surfaces)

    def rays_at(self, place: tuple[float, float]) -> SeenRays | None:
        """Rays that gather light at the surface seen at ``place``, 0..1 from the picture's lower left corner.

        None: nothing was prepared yet. To be called between pieces of work, not in one.
        """
        lit = self.voxel_light.lit
        return self.picture.rays_at(place, lit) if lit else None

    def statistics(self) -> dict[str, Any]:
        """What was done and what it took; sizes in bytes, times in ms, widths of voxels in metres.

        ``voxels``: along the sides of the grid, or of the finest of its ``levels``.
        """
        voxels = self.voxel_light.voxelize.voxels
        levels = self.grid.levels if self.grid else ()
        finest = levels[0] if levels else self.grid
        return {
            "renderer": self.gpu.renderer,
            "resolution": list(self.picture.size),
            "samples": self.film.samples,
            "mean_samples": round(self.film.mean_samples, 3),
            "voxels": list(finest.size) if finest else [0, 0, 0],
            "levels": [
                {"voxels": list(level.size), "voxel_size": self.grid.cell_size * (1 << k)}
                for k, level in enumerate(levels)
                if self.grid
            ],
            "occupied": voxels.cell_count if voxels else 0,
            "faces": self.voxel_light.voxelize.face_count,
            "redone": dict(self.redone),
            "bounces": self.voxel_light.bounce.bounces if self.features and self.features.bounces else 0,
            "features": self.features.names if self.features else [],
            "passes": [
                {"name": name, "calls": t.calls, "cpu_ms": round(t.cpu_ms, 3), "gpu_ms": round(t.gpu_ms, 3)}
                for name, t in self.gpu.times.items()
            ],
            "memory": dict(sorted(self.gpu.memory.items())),
            "warnings": list(self.warnings),
        }

    def put_away(self, most: int) -> bool:
        """Free every GL object, and the context of ``gpu``, but keep voxels and their light in memory.

        Returns whether there was something, and no more than ``most`` bytes: :meth:`put_back` comes next. Else, and
        where this raises, :meth:`release` does.
        """
        self.picture.release()
        self.voxel_light.put_away()
        if not self.voxel_light.has_geometry or sum(self.gpu.memory.values()) > most:
            return False
        self.gpu.put_away()
        return True

    def put_back(self) -> None:
        """All is as if it had not been put away, but for the picture: ``prepare`` goes on from what was done.

        In the context that is current, or in a new one if it was our own. Raises GpuUnavailable and MemoryError, and
        has let go of everything then.
        """
        try:
            self.gpu.put_back()
            self.voxel_light.put_back()
        except Exception:
            self.release()
            raise

    def release(self) -> None:
        """Free every GL object."""
        self.picture.release()
        self.voxel_light.release()
