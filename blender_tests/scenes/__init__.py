# SPDX-License-Identifier: GPL-3.0-or-later
"""Test scenes, built from numbers by Blender's Python interface. ``build.py`` has the parts, the others the scenes."""
