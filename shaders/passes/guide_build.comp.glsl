// SPDX-License-Identifier: GPL-3.0-or-later
// Guides from bins: how much light comes from where, on average over links. A few links for each face say little, so bricks
// side by side and bins side by side help each other.
// Input: bins of all guides.    Output: guides_img: trees of shares (lib/guide.glsl).

#include "lib/guide_work.glsl"
#include "lib/guide_light.glsl"
#include "lib/guide_number.glsl"

layout(local_size_x = GROUP_SIZE) in;

layout(binding = TEX_GUIDES) uniform usampler2D bins_tex;
layout(binding = TEX_GUIDE_NUMBERS) uniform usampler3D guide_numbers_tex;
layout(binding = IMG_0, rgba8) writeonly uniform image2D guides_img;

const float OWN_WEIGHT = 4.0;    // of a brick or bin, against 1 of each neighbour
const float EVEN_SHARE = 0.05;   // of the directions that are drawn evenly
const float EVEN_ENOUGH = 0.1;   // concentration up to which rays that are spread evenly do better

void main()
{
    uint number = guide_first + invocation_index();
    if (number >= guide_count) {
        return;
    }
    GuideWork work = fetch_guide_work(number);
    int axis = int(work.facing >> 1);
    vec2 bins[GUIDE_BINS];
    for (int bin = 0; bin < bin_count; ++bin) {
        bins[bin] = vec2(0.0);
    }
    for (int k = 0; k < 9; ++k) {  // bricks of the same layer
        ivec3 offset = ivec3(0);
        offset[(axis + 1) % 3] = k % 3 - 1;
        offset[(axis + 2) % 3] = k / 3 - 1;
        ivec3 there = work.brick + offset;
        bool usable = all(greaterThanEqual(there, ivec3(0))) && all(lessThan(there, brick_count));
        uint entry = usable ? texelFetch(guide_numbers_tex, there, 0).r : 0u;
        if (has_guide(entry, work.facing)) {
            uint first = guide_number(entry, work.facing) * uint(GUIDE_BINS / 4);
            float weight = k == 4 ? OWN_WEIGHT : 1.0;
            for (int bin = 0; bin < bin_count; bin += 4) {
                uvec4 four = texelFetch(bins_tex, list_texel(first + uint(bin) / 4u), 0);
                for (int k = 0; k < 4; ++k) {
                    bins[bin + k] += weight * unpack_bin(four[k]);
                }
            }
        }
    }
    for (int bin = 0; bin < bin_count; ++bin) {
        bins[bin].x = bins[bin].y * pow(bins[bin].x / max(bins[bin].y, 1.0), 1.0 / GUIDE_POWER);
    }
    float shares[GUIDE_BINS];
    float total = 0.0;
    for (int bin = 0; bin < bin_count; ++bin) {
        vec2 sum = vec2(0.0);
        for (int k = 0; k < 9; ++k) {
            ivec2 place = ivec2(bin % GUIDE_SIDE + k % 3 - 1, bin / GUIDE_SIDE + k / 3 - 1);
            place = clamp(place, ivec2(0), ivec2(GUIDE_SIDE - 1));
            float weight = (k % 3 == 1 ? OWN_WEIGHT : 1.0) * (k / 3 == 1 ? OWN_WEIGHT : 1.0);
            sum += weight * bins[place.x + GUIDE_SIDE * place.y];
        }
        shares[bin] = sum.x / max(sum.y, 1.0);
        total += shares[bin];
    }
    for (int bin = 0; bin < bin_count; ++bin) {
        float share = total > 0.0 ? shares[bin] / total : 0.0;
        shares[bin] = mix(share, 1.0 / float(GUIDE_BINS), total > 0.0 ? EVEN_SHARE : 1.0);
    }
    float concentration = -1.0;  // variance of light over directions, relative to its mean's square
    for (int bin = 0; bin < bin_count; ++bin) {
        concentration += float(GUIDE_BINS) * shares[bin] * shares[bin];
    }
    if (concentration < EVEN_ENOUGH) {
        imageStore(guides_img, list_texel(number * uint(GUIDE_TEXELS)), vec4(0.0));  // no guide after all
        return;
    }
    // From the finest squares up: a texel for each four, and their sum in place.
    uint level_first = (number + 1u) * uint(GUIDE_TEXELS);
    for (int side = GUIDE_SIDE / 2; side > 0; side /= 2) {
        level_first -= uint(side * side);
        for (int square = 0; square < side * side; ++square) {  // writes behind what is still to be read
            int corner = 2 * (square % side) + 4 * side * (square / side);
            vec4 four = vec4(shares[corner], shares[corner + 1], shares[corner + 2 * side], shares[corner + 2 * side + 1]);
            float sum = four.x + four.y + four.z + four.w;
            imageStore(guides_img, list_texel(level_first + uint(square)), four / sum);
            shares[square] = sum;
        }
    }
}
