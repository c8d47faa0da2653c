# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to files: of bytes, of numbers and words in text, and of values that Blender shows of what it has read."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Iterator
from typing import Any

#: Name of a file -> kind of what is changed in it: its bytes, its text, a picture beside it, or values in Blender.
FILES = {
    "values.blend": "values", "bytes.blend": "bytes", "crate.usdc": "bytes", "text.usda": "text", "binary.glb": "bytes",
    "json.gltf": "text", "text.obj": "text", "image_png.obj": "picture", "image_jpg.obj": "picture",
    "image_exr.obj": "picture", "image_hdr.obj": "picture", "image_tif.obj": "picture", "image_webp.obj": "picture",
}  # fmt: skip

WORDS = (
    "nan", "inf", "-inf", "1e38", "-1e38", "1e400", "1e-45", "0", "-0.0", "-1", "1", "2", "255", "65536", "2147483647",
    "-2147483648", "4294967296", "99999999999999999999", "", "{", "]", '"', "\x00", "%s", "../..", "\U0001f4a1",
    "n" * 5000,
)  # fmt: skip
FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 1e-45, 1e-20, 1e-6, 1e6, 1e20, 3.4e38, -3.4e38, float("nan"), float("inf"))
_BYTES = tuple(struct.pack("<I", value) for value in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x10000)) + tuple(
    struct.pack("<f", value) for value in FLOATS
)


def changed_bytes(data: bytes, chance: random.Random) -> bytes:
    """Some bytes overwritten, taken out, doubled, or cut off."""
    found = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at, length = chance.randrange(len(found) or 1), chance.choice((1, 4, 16, 64, 1024))
        kind = chance.randrange(10)
        if kind < 3:
            found[at : at + 1] = bytes([chance.randrange(256)])
        elif kind < 7:
            at -= at % 4
            found[at : at + 4] = chance.choice(_BYTES)
        elif kind == 7:
            found[at : at + length] = b""
        elif kind == 8:
            found[at:at] = found[at : at + length]
        elif chance.random() < 0.3:
            del found[at:]
    return bytes(found)


def changed_text(data: bytes, chance: random.Random) -> bytes:
    """Some numbers and words replaced, lines doubled or taken out; now and then bytes."""
    text = data.decode("utf-8", "replace")
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        tokens = list(re.finditer(r"-?\d+(?:\.\d+)?(?:e-?\d+)?|\w+", text))
        if not tokens:
            break
        token = chance.choice(tokens)
        new = chance.choice((chance.choice(WORDS), chance.choice(tokens).group()))
        text = text[: token.start()] + new + text[token.end() :]
    lines = text.split("\n")
    if chance.random() < 0.3:
        at = chance.randrange(len(lines))
        lines[at : at + chance.choice((0, 1, 5))] = [lines[chance.randrange(len(lines))]] * chance.choice((0, 1, 3))
    made = "\n".join(lines).encode("utf-8", "replace")
    return changed_bytes(made, chance) if chance.random() < 0.1 else made


def change_values(data: Any, chance: random.Random) -> list[str]:
    """Sets some properties of what is in ``data`` (``bpy.data``) to what they may be but hardly ever are.

    Returns what was set, as lines of Python.
    """
    owners = list(_owners(data))
    done = []
    for _ in range(chance.choice((1, 2, 4, 8))):
        name, owner = chance.choice(owners)
        properties = [
            p for p in owner.bl_rna.properties
            if not p.is_readonly and p.type in _TYPES and p.identifier not in _LEFT
        ]  # fmt: skip
        if not properties:
            continue
        chosen = chance.choice(properties)
        value = _value(chosen, chance)
        try:
            setattr(owner, chosen.identifier, value)
        except (AttributeError, TypeError, ValueError, RuntimeError, OverflowError):
            continue
        done.append(f"{name}.{chosen.identifier} = {value!r}")
    return done


_TYPES = ("FLOAT", "INT", "BOOLEAN", "ENUM", "STRING")

#: What would only make a render long, is the command line's, or is the layout of an array, which Blender trusts.
_LEFT = frozenset({
    "loop_start", "loop_total", "engine", "resolution_x", "resolution_y", "resolution_percentage", "filepath",
    "use_sequencer", "levels", "render_levels", "count", "samples", "voxel_resolution", "voxel_auto", "memory_budget",
    "bounces", "child_nbr", "rendered_child_count", "rows", "columns", "frame_start", "frame_end", "resolution_u",
    "resolution_v", "rays", "render_resolution_u", "render_resolution_v", "bounce_rays", "viewport_samples",
    "glossy_layers", "bevel_resolution",
})  # fmt: skip


def _owners(data: Any) -> Iterator[tuple[str, Any]]:
    for kind in ("objects", "meshes", "lights", "cameras", "materials", "worlds", "images", "scenes", "curves"):
        for block in getattr(data, kind):
            name = f"bpy.data.{kind}[{block.name!r}]"
            yield name, block
            if kind == "objects":
                yield from ((f"{name}.modifiers[{m.name!r}]", m) for m in block.modifiers)
                for index, system in enumerate(block.particle_systems):
                    yield f"{name}.particle_systems[{index}].settings", system.settings
            if kind == "scenes":
                yield f"{name}.render", block.render
                yield f"{name}.conelight", block.conelight
                yield f"{name}.view_settings", block.view_settings
                yield from ((f"{name}.view_layers[{layer.name!r}]", layer) for layer in block.view_layers)
            if kind == "meshes":
                for at in range(0, len(block.vertices), 7):
                    yield f"{name}.vertices[{at}]", block.vertices[at]
                for at in range(0, len(block.polygons), 7):
                    yield f"{name}.polygons[{at}]", block.polygons[at]
            tree = getattr(block, "node_tree", None)
            if tree is not None:
                for node in tree.nodes:
                    yield f"{name}.node_tree.nodes[{node.name!r}]", node
                    for index, socket in enumerate(node.inputs):
                        yield f"{name}.node_tree.nodes[{node.name!r}].inputs[{index}]", socket


def _value(chosen: Any, chance: random.Random) -> Any:
    def one() -> Any:
        if chosen.type == "FLOAT":
            return chance.choice((*FLOATS, chosen.hard_min, chosen.hard_max, chosen.soft_min, chosen.soft_max))
        if chosen.type == "INT":
            few = (0, 1, -1, 2, 3, 7, 255)
            return min(max(chance.choice((*few, chosen.hard_min, chosen.soft_max)), chosen.hard_min), chosen.hard_max)
        return chance.random() < 0.5

    if chosen.type == "STRING":
        return chance.choice(WORDS)
    if chosen.type == "ENUM":
        names = [item.identifier for item in chosen.enum_items]
        if chosen.is_enum_flag:
            return set(chance.sample(names, chance.randrange(len(names) + 1)))
        return chance.choice(names or [""])
    return [one() for _ in range(chosen.array_length)] if chosen.is_array else one()
