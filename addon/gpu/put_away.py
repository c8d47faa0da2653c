# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures and buffers whose content waits in memory until there is a context for them again."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

#: What can be put away: what is read back and written again without loss.
Storage = moderngl.Buffer | moderngl.Texture | moderngl.Texture3D


@dataclass(frozen=True)
class PutAway:
    """The content of ``thing``, and how it was sampled (texture: filter, and what repeats). It has no mipmaps."""

    thing: Storage
    content: bytes
    filter: tuple[int, int] = (0, 0)
    repeats: tuple[bool, ...] = ()

    @classmethod
    def of(cls, thing: Storage) -> PutAway:
        """Reads ``thing`` back, where its context is current."""
        if isinstance(thing, moderngl.Buffer):
            return cls(thing, thing.read())
        repeats = [thing.repeat_x, thing.repeat_y]
        if isinstance(thing, moderngl.Texture3D):
            repeats.append(thing.repeat_z)
        return cls(thing, thing.read(), thing.filter, tuple(repeats))

    def put_back(self, mgl: moderngl.Context) -> Storage:
        """``thing``: whoever holds it finds it in this context from now on, with the same bits.

        Raises moderngl.Error where there is no memory.
        """
        thing = self.thing
        made: Storage
        if isinstance(thing, moderngl.Buffer):
            made = mgl.buffer(self.content)
        else:
            make = mgl.texture3d if isinstance(thing, moderngl.Texture3D) else mgl.texture
            made = make(thing.size, thing.components, self.content, dtype=thing.dtype, alignment=1)
            made.filter = self.filter
            for axis, repeat in zip("xyz", self.repeats, strict=False):
                setattr(made, f"repeat_{axis}", repeat)
        vars(thing).update(vars(made))
        return thing
