// SPDX-License-Identifier: GPL-3.0-or-later
// A picture for the screen, stretched over the viewport; pixel for pixel where it has its size.
// Input: value_tex, scene-linear, premultiplied.    Output: the same; what half floats cannot hold is cut.

layout(binding = TEX_VALUE) uniform sampler2D value_tex;

uniform ivec2 box_size;  // pixels that are drawn

in vec2 uv;
layout(location = 0) out vec4 color;

const float LARGEST_HALF = 65504.0;

void main()
{
    ivec2 size = textureSize(value_tex, 0);
    vec4 value = size == box_size ? texelFetch(value_tex, ivec2(uv * vec2(size)), 0) : texture(value_tex, uv);
    color = mix(clamp(value, -LARGEST_HALF, LARGEST_HALF), vec4(0.0), isnan(value));
}
