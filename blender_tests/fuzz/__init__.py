# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged and absurd scene files, made from small ones, rendered one after the other (``scripts/fuzz``)."""
