# SPDX-License-Identifier: GPL-3.0-or-later
"""Balls with a clear coat over matte, rough metal and glass, tinted edges and tinted specular, in the room."""

from __future__ import annotations

from typing import Any

from . import build
from .gloss_room import room


def scene() -> Any:
    result = build.empty_scene()
    room()
    kinds: tuple[dict[str, Any], ...] = (
        {"Base_Color": (0.6, 0.05, 0.05), "Roughness": 0.8, "Coat_Weight": 1.0, "Coat_Roughness": 0.03},
        {"Base_Color": (0.9, 0.5, 0.2), "Metallic": 1.0, "Roughness": 0.5, "Coat_Weight": 1.0, "Coat_Roughness": 0.05},
        {"Base_Color": (0.7, 0.7, 0.7), "Roughness": 0.5, "Coat_Weight": 0.5, "Coat_Roughness": 0.3,
         "Coat_Tint": (0.4, 0.7, 1.0)},
        {"Base_Color": (0.8, 0.8, 0.8), "Metallic": 1.0, "Roughness": 0.3, "Specular_Tint": (0.3, 0.5, 0.9)},
        {"Base_Color": (0.2, 0.2, 0.6), "Roughness": 0.2, "Specular_Tint": (1.0, 0.5, 0.2), "IOR": 1.8},
        {"Base_Color": (0.5, 0.5, 0.5), "Roughness": 0.6, "Coat_Weight": 1.0, "Coat_Roughness": 0.0, "Coat_IOR": 2.0},
    )  # fmt: skip
    for i, inputs in enumerate(kinds):
        material = build.principled(f"Kind {i}", **inputs)
        column, row = i % 3 - 1, i // 3
        build.add_sphere(material.name, 0.7, (1.7 * column, 0.3 - 0.4 * row, 2.15 - 1.4 * row), material, 64)
    return result
