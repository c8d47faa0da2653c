# SPDX-License-Identifier: GPL-3.0-or-later
"""Conelight: a render engine for Blender, global illumination by voxel cone tracing."""

# Blender is imported when the add-on is enabled, not here: everything outside host/ works without it.


def register() -> None:
    """Blender enables the add-on. Touches no graphics context: what is unsupported is said at the first render."""
    from . import host

    host.register()


def unregister() -> None:
    """Blender disables the add-on."""
    from . import host

    host.unregister()
