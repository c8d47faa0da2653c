// SPDX-License-Identifier: GPL-3.0-or-later
// What is asked most. Each thread may fetch a texel of a texture at a level of its own, which takes software rasterizers three
// times the instructions that an image takes; those read images.
//
// The including program gets the define
//     READS_IMAGES  1: sources are images; else textures

#if READS_IMAGES
#define SOURCE_2D(texture_unit, image_unit, format) layout(binding = image_unit, format) readonly uniform uimage2D
#define SOURCE_3D(texture_unit, image_unit, format) layout(binding = image_unit, format) readonly uniform uimage3D
#define SOURCE_PICTURE(texture_unit, image_unit, format) layout(binding = image_unit, format) readonly uniform image2D
#define fetch_source(source, at) imageLoad(source, at)
#else
#define SOURCE_2D(texture_unit, image_unit, format) layout(binding = texture_unit) uniform usampler2D
#define SOURCE_3D(texture_unit, image_unit, format) layout(binding = texture_unit) uniform usampler3D
#define SOURCE_PICTURE(texture_unit, image_unit, format) layout(binding = texture_unit) uniform sampler2D
#define fetch_source(source, at) texelFetch(source, at, 0)
#endif
