# SPDX-License-Identifier: GPL-3.0-or-later
"""The same work again and again: memory and GL objects must stay as many as they were (``scripts/soak``)."""
