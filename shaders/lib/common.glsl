// SPDX-License-Identifier: GPL-3.0-or-later
// Indices, hashing and packing that every shader uses.

const float PI = 3.14159265358979;
const float RAY_START = 1e-3;  // cells: how far along the normal a ray starts above the surface it leaves

// Number of this thread in a list that was started with Kernel.run_list.
uint invocation_index()
{
    return gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * uint(GROUP_SIZE);
}

// Texel of entry `index` of a list kept in a 2D texture.
ivec2 list_texel(uint index)
{
    return ivec2(int(index % uint(LIST_WIDTH)), int(index / uint(LIST_WIDTH)));
}

// PCG-RXS-M-XS 32. Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
uint hash(uint v)
{
    uint state = v * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

uint hash(uint a, uint b)
{
    return hash(a ^ hash(b));
}

// [0, 1) from the upper 24 bits: every value is exact in a float.
float unit_float(uint bits)
{
    return float(bits >> 8) * (1.0 / 16777216.0);
}

vec3 unit_vec3(uint seed)
{
    uint a = hash(seed);
    uint b = hash(a);
    return vec3(unit_float(a), unit_float(b), unit_float(hash(b)));
}

// Octahedral map of a unit vector to [-1, 1]^2. Cigolle et al. 2014, "A Survey of Efficient Representations for
// Independent Unit Vectors".
vec2 octahedral_encode(vec3 n)
{
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 folded = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    return n.z >= 0.0 ? n.xy : folded;
}

vec3 octahedral_decode(vec2 e)
{
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    if (n.z < 0.0) {
        n.xy = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    }
    return normalize(n);
}

// Any unit vector perpendicular to unit n, and the third axis. Duff et al. 2017, "Building an Orthonormal Basis,
// Revisited".
void basis(vec3 n, out vec3 t, out vec3 b)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float c = n.x * n.y * a;
    t = vec3(1.0 + s * n.x * n.x * a, s * c, -s * n.x);
    b = vec3(c, s + n.y * n.y * a, -n.y);
}

// Axis that n is nearest to.
int dominant_axis(vec3 n)
{
    vec3 a = abs(n);
    return a.x > a.y ? (a.x > a.z ? 0 : 2) : (a.y > a.z ? 1 : 2);
}

bool is_finite(vec3 v)
{
    return !any(isnan(v)) && !any(isinf(v));
}

vec3 finite_or_zero(vec3 v)
{
    return is_finite(v) ? v : vec3(0.0);
}

float max_component(vec3 v)
{
    return max(v.x, max(v.y, v.z));
}

float luminance(vec3 color)
{
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}
