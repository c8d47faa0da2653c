# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes built from numbers. Those in USD need no Blender to be written; ``catalogue.py`` lists all."""
