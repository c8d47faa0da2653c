# SPDX-License-Identifier: GPL-3.0-or-later
"""Node graphs -> expressions -> GLSL: ``graph`` is what goes in, ``compile`` what comes out."""
