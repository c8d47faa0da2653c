# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line ``scripts/benchmark``: speed against error, of this engine and of others, in one run."""
