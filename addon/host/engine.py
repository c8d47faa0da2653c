# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as Blender sees it: callbacks that hand over to a session and bring its film back."""

from __future__ import annotations

import logging
import time
from typing import Any

import bpy

from . import legacy, session
from .backend import background_has_gl
from .film import wanted_passes, write_passes
from .session import RenderCancelled, Session
from .viewport import Viewport

ENGINE_ID = "CONELIGHT"

#: Least seconds between two updates of the picture while it is rendered. Reading it back costs time.
_UPDATE_INTERVAL = 1.0

#: Seconds that a render leaves Python to Blender's interface, and the least time between two such pauses. Without them
#: the interface gets Python once for each call of OpenGL, and needs it dozens of times to draw itself.
_PAUSE, _PAUSE_INTERVAL = 0.005, 0.05

_log = logging.getLogger(__name__)


class ConelightEngine(bpy.types.RenderEngine):
    """Global illumination by voxel cone tracing"""

    bl_idname = ENGINE_ID
    bl_label = "Conelight"
    bl_use_preview = True
    bl_use_gpu_context = False  # see register()
    bl_use_eevee_viewport = True  # EEVEE serves Material Preview, as it does for Cycles
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False  # Blender's own shader nodes
    bl_use_stereo_viewport = False
    bl_use_spherical_stereo = False

    # Blender runs __init__ twice on each engine, so there is none: these become the object's own when first set.
    _session: Session | None = None
    _viewport: Viewport | None = None
    _failed: bool = False
    _problem_in_panels: str | None = None
    _last_pause: float = 0.0

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """Tells the compositor and the render result which passes there are."""
        for film_pass in wanted_passes(renderlayer):
            name = film_pass.blender_name(bpy.app.version)
            self.register_pass(
                scene, renderlayer, name, len(film_pass.channels), film_pass.channels, film_pass.kind
            )

    def update(self, data: Any = None, depsgraph: Any = None) -> None:
        """Reads the scene, at the one time when that is safe beside the user interface."""
        if self._session is None:
            self._session = Session(is_preview=self.is_preview)
        self._failed = session.last_error is not None and not self._session.is_preview
        if self._failed:
            self._session.forget()
            return  # an earlier layer or frame of this render failed, and Blender goes on all the same
        try:
            self._session.synchronize(depsgraph, (self.resolution_x, self.resolution_y), self.test_break)
        except RenderCancelled:
            self._failed = True
        except (Exception, KeyboardInterrupt) as error:
            self._fail(error)

    def render(self, depsgraph: Any) -> None:
        """Renders one view layer."""
        if self._failed or self._session is None:
            return
        view_layer = depsgraph.view_layer
        result = self.begin_result(0, 0, self.resolution_x, self.resolution_y, layer=view_layer.name)
        finished = False
        try:
            finished = self._session.thread.run(lambda: self._render(depsgraph.scene, view_layer, result))
        except (Exception, KeyboardInterrupt) as error:
            self._fail(error)
        finally:
            self.end_result(result, cancel=not finished)

    def _render(self, scene: Any, view_layer: Any, result: Any) -> bool:
        """Fills ``result`` and frees GPU memory. Returns False when the user cancelled."""
        is_done = False
        try:
            is_done = self._fill(scene, view_layer, result)
            return is_done
        finally:
            self._release(keep=is_done and scene.render.use_persistent_data)

    def _fill(self, scene: Any, view_layer: Any, result: Any) -> bool:
        current = self._session
        assert current is not None
        film_passes = wanted_passes(view_layer)
        names = {film_pass.name for film_pass in film_passes}
        size = (result.resolution_x, result.resolution_y)
        frame = (self.resolution_x, self.resolution_y)
        last_update = time.perf_counter()

        def write() -> None:
            film = current.film
            missing = write_passes(result.layers[0].passes, film.names, current.read, bpy.app.version)
            if missing and not current.is_preview:
                session.add_warning(f"passes without content in this version: {', '.join(missing)}")

        def show(samples: int) -> None:
            nonlocal last_update
            if bpy.app.background or time.perf_counter() - last_update < _UPDATE_INTERVAL:
                return
            write()
            self.update_result(result)
            last_update = time.perf_counter()

        border = session.pixel_border(scene.render, frame, size)
        if not current.render(size, names, self._step, show, border, is_animation=self.is_animation):
            return False
        if scene.render.use_multiview and not current.is_preview:
            session.add_warning("stereoscopy is not supported: every view shows the centre camera's picture")
        write()
        return True

    def _step(self, fraction: float, text: str) -> bool:
        """Progress of a render. Returns False when the user pressed Esc."""
        self.update_progress(fraction)
        self.update_stats("", text)
        is_preview = self._session is not None and self._session.is_preview
        if session.progress_listener is not None and not is_preview:
            session.progress_listener(fraction, text)
        if not bpy.app.background and time.perf_counter() - self._last_pause > _PAUSE_INTERVAL:
            time.sleep(_PAUSE)
            self._last_pause = time.perf_counter()
        return not self.test_break()

    def _fail(self, error: BaseException) -> None:
        """Tells the user why there is no picture. Previews say nothing: they come unasked."""
        self._failed = True
        if not session.is_expected(error) and not isinstance(error, KeyboardInterrupt):
            _log.error("Conelight: unexpected error", exc_info=error)
        if self._session is not None and self._session.is_preview:
            return
        session.last_error = session.sentence(error)
        self.report({"ERROR"}, session.last_error)
        self.error_set(session.last_error)

    def _release(self, keep: bool) -> None:
        """Frees memory, unless what is in it is to be kept for the next frame."""
        if self._session is None or keep:
            return
        self._session.forget()
        try:
            self._session.release()
        except Exception:
            _log.exception("Conelight: GPU memory was not freed")

    def view_update(self, context: Any, depsgraph: Any) -> None:
        """The scene changed under a rendered viewport."""
        if self._viewport is None:
            self._viewport = Viewport()
        self._viewport.update(context, depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        """Draws a rendered viewport, and asks to be called again until its picture is done."""
        if self._viewport is None:
            self.view_update(context, depsgraph)
        assert self._viewport is not None
        text = self._viewport.draw(context, depsgraph, int(self.get_preview_pixel_size(depsgraph.scene)))
        self.update_stats("Conelight", text)
        if self._viewport.problem != self._problem_in_panels:
            self._problem_in_panels = self._viewport.problem
            _redraw_panels()
        if not self._viewport.is_done:
            self.tag_redraw()


def _redraw_panels() -> None:
    """Has the editors drawn anew in which panels say what is wrong."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()


@bpy.app.handlers.persistent
def _on_render_init(*_: Any) -> None:
    """A render starts, of one or more frames and layers. Previews do not come here."""
    session.begin_render()


@bpy.app.handlers.persistent
def _on_load(*_: Any) -> None:
    """Another file takes the place of this one."""
    legacy.forget()


def register() -> None:
    # In background all renders share Blender's context. Blender crashes where an engine asks for one and there is none.
    # In a window Blender 5 draws nothing and hears no key as long as an engine has a context of Blender's.
    ConelightEngine.bl_use_gpu_context = bpy.app.background and background_has_gl()
    bpy.utils.register_class(ConelightEngine)
    bpy.app.handlers.render_init.append(_on_render_init)
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    for handlers, handler in (
        (bpy.app.handlers.render_init, _on_render_init),
        (bpy.app.handlers.load_post, _on_load),
    ):
        if handler in handlers:
            handlers.remove(handler)
    if ConelightEngine.is_registered:
        bpy.utils.unregister_class(ConelightEngine)  # ends viewports
    legacy.forget()
