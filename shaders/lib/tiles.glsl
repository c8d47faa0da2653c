// SPDX-License-Identifier: GPL-3.0-or-later
// Tiles of the picture that passes still work on.
// IS_ADAPTIVE: there is a noise threshold.

// Whether a pixel's noise is still too high.
#if IS_ADAPTIVE
layout(binding = IMG_TILES, r8ui) readonly uniform uimage2D active_tiles_img;
bool is_active(ivec2 pixel)
{
    return imageLoad(active_tiles_img, pixel / TILE_SIZE).r != 0u;
}
#else
bool is_active(ivec2 pixel)
{
    return true;
}
#endif
