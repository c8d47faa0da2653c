# SPDX-License-Identifier: GPL-3.0-or-later
"""The only package that imports Blender: engine, properties, panels, and what is read from a scene."""


def register() -> None:
    """Makes engine, properties and panels known to Blender. Once is enough; once more changes nothing."""
    from . import engine, panels, properties, rays

    unregister()
    properties.register()
    engine.register()
    rays.register()
    panels.register()


def unregister() -> None:
    """Takes away what :func:`register` made known, as far as it is there."""
    from . import engine, panels, properties, rays

    panels.unregister()
    rays.unregister()
    engine.unregister()
    properties.unregister()
