// SPDX-License-Identifier: GPL-3.0-or-later
// What test shaders have in common: one thread for each of `count` rows of inputs, which are several vec4 each, as results.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BUF_WORK) readonly buffer Inputs { vec4 inputs[]; };
layout(std430, binding = BUF_RESULTS) writeonly buffer Results { vec4 results[]; };

uniform uint count;
