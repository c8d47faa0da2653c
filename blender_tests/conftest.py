# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures for all tests, and for those that need Blender; these are skipped where there is none."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def debug_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """With CONELIGHT_DEBUG_CHECKS=1 everything that tests render in their own process is checked as it is made."""
    if os.environ.get("CONELIGHT_DEBUG_CHECKS", "") in ("", "0"):
        return
    from addon.pipeline import Pipeline

    prepare = Pipeline.prepare

    def checked(self: Any, scene: Any, settings: Any, *given: Any, **more: Any) -> Any:
        return prepare(self, scene, settings.with_values(debug_checks=True), *given, **more)

    monkeypatch.setattr(Pipeline, "prepare", checked)


#: Bytes of a number -> what a driver may leave in a texture that is made without content: 0, 1, infinity, no number; as
#: integers 0, some, many, the most there are.
LEFT_BEHIND = {
    1: (0, 1, 0x7F, 0xFF),
    2: (0, 0x3C00, 0x7C00, 0xFFFF),
    4: (0, 0x3F800000, 0x7F800000, 0xFFFFFFFF),
}


@pytest.fixture(autouse=True)
def undefined_content(monkeypatch: pytest.MonkeyPatch) -> None:
    """Textures without content have what a driver may leave in them, not the zeros that most hand out until memory is
    used a second time: what reads a texel that no pass has written shows every time."""
    from addon.gpu import context

    texture = context.GpuContext.texture

    def filled(self: Any, name: str, size: Any, components: int, dtype: str, data: Any = None, **more: Any) -> Any:
        made = texture(self, name, size, components, dtype, data, **more)
        if data is None:
            width = context._BYTES[dtype]
            count = size[0] * size[1] * components
            picked = np.random.default_rng(count).integers(0, 4, count)
            made.write(np.array(LEFT_BEHIND[width], f"u{width}")[picked].tobytes(), alignment=1)
        return made

    monkeypatch.setattr(context.GpuContext, "texture", filled)


@pytest.fixture
def empty_scene() -> Any:
    """A new Blender file with one scene and nothing in it (no camera, no world)."""
    bpy = pytest.importorskip("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


@pytest.fixture
def extract(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A function without arguments: SceneData of the current scene, extracted inside a final render as F12 does it.

    Materials and worlds are taken by name only: their nodes have tests of their own.
    """
    bpy = pytest.importorskip("bpy")
    from addon.host.extract import scene as module
    from addon.materials.graph import MaterialData, WorldData

    monkeypatch.setattr(module, "extract_material", lambda m, *_: MaterialData(m.name, None))
    monkeypatch.setattr(
        module, "extract_world", lambda w, *_: WorldData(w.name, None, tuple(w.color)) if w is not None else None
    )
    outcome: list[Any] = []

    class ExtractionProbe(bpy.types.RenderEngine):  # type: ignore[misc]
        bl_idname = "EXTRACTION_PROBE"
        bl_label = "Extraction Probe"

        def render(self, depsgraph: Any) -> None:
            render = depsgraph.scene.render
            scale = render.resolution_percentage / 100
            resolution = (int(render.resolution_x * scale), int(render.resolution_y * scale))
            try:
                outcome.append(module.SceneReader().read(depsgraph, resolution))
            except Exception as error:
                outcome.append(error)

    def run() -> Any:
        outcome.clear()
        bpy.context.scene.render.engine = ExtractionProbe.bl_idname
        bpy.ops.render.render()
        assert outcome, "Blender did not call the render engine"
        if isinstance(outcome[0], Exception):
            raise outcome[0]
        return outcome[0]

    bpy.utils.register_class(ExtractionProbe)
    yield run
    bpy.utils.unregister_class(ExtractionProbe)
