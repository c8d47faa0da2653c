// SPDX-License-Identifier: GPL-3.0-or-later
// Directions uniform in the solid angle of a shape: cones, rectangles, ellipses. Points drawn by area on what is wider
// than it is far away are hardly ever near; drawn by solid angle all bring about as much.

#include "lib/common.glsl"

// Narrower shapes (steradians) are drawn by area: angles lie within pi, and three to four of them, each right to half a
// unit of the 24th bit, add up to an error of about 5e-7, a two thousandth of this. Across a shape so narrow, unless it is
// seen from its side, 1 / distance^2 varies by a twentieth.
const float LEAST_SOLID_ANGLE = 1e-3;

// 1 - cosine of half the angle, from the sine's or the tangent's square, without cancellation.
float versine_of_sine2(float sine2)
{
    return sine2 / (1.0 + sqrt(max(1.0 - sine2, 0.0)));
}

float versine_of_tangent2(float tangent2)
{
    return tangent2 / (1.0 + tangent2 + sqrt(1.0 + tangent2));
}

// Direction in the cone around unit z, whose half angle has this versine: 1 / (2 pi versine) for each steradian. `sine`:
// of the angle to z.
vec3 sample_cone(vec3 z, float versine, vec2 u, out float sine)
{
    vec3 t, b;
    basis(z, t, b);
    float w = u.x * versine;
    sine = sqrt(w * (2.0 - w));
    float phi = 2.0 * PI * u.y;
    return normalize(t * (sine * cos(phi)) + b * (sine * sin(phi)) + z * (1.0 - w));
}

// Angle of a direction of the plane, to 1e-7: some drivers' atan is right to 4e-6 alone, which a step of Newton's mends.
float exact_angle(vec2 unit)
{
    float angle = atan(unit.y, unit.x);
    return angle + (unit.y * cos(angle) - unit.x * sin(angle));
}

vec2 complex_product(vec2 a, vec2 b)
{
    return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// A rectangle in the plane z = height > 0, sides along x and y, seen from the origin. The part of it up to x has the solid
// angle F(x) - F(low.x), F(x) = f(x, high.y) - f(x, low.y), f(x, y) = atan(x y / (z sqrt(x^2 + y^2 + z^2))).
// Urena, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
// Differs: angles are added as complex numbers, whose signs and small values arc cosines lose.
struct SphericalRectangle {
    vec2 low;
    vec2 high;
    float height;
    vec2 start;         // exp(i F(low.x))
    float solid_angle;
};

// exp(i F(x))
vec2 rectangle_angle(float x, float y0, float y1, float height)
{
    vec2 square = x * x + vec2(y0 * y0, y1 * y1) + height * height;
    vec2 far = height * sqrt(square);
    return normalize(complex_product(normalize(vec2(far.y, x * y1)), normalize(vec2(far.x, -x * y0))));
}

SphericalRectangle spherical_rectangle(vec2 low, vec2 high, float height)
{
    vec2 start = rectangle_angle(low.x, low.y, high.y, height);
    vec2 end = rectangle_angle(high.x, low.y, high.y, height);
    return SphericalRectangle(low, high, height, start, exact_angle(end) - exact_angle(start));
}

// The point of the rectangle that u chooses.
vec2 sample_rectangle(SphericalRectangle r, vec2 u)
{
    // sin F = x S / ..., solved for x: a and b are the angles under which low.y and high.y are seen where x = 0.
    vec2 y = vec2(r.low.y, r.high.y);
    vec2 far = 1.0 / sqrt(y * y + r.height * r.height);
    vec2 sines = y * far, cosines = r.height * far;
    float part = u.x * r.solid_angle;
    vec2 f = complex_product(r.start, vec2(cos(part), sin(part)));
    float sine_product = sines.x * sines.y, cosine_product = cosines.x * cosines.y;
    float square = (f.x - sine_product - cosine_product) * (f.x - sine_product + cosine_product);
    float x = clamp(r.height * f.y / sqrt(max(square, 1e-14)), r.low.x, r.high.x);
    float side = x * x + r.height * r.height;
    vec2 ends = y / sqrt(side + y * y);
    float at = mix(ends.x, ends.y, u.y);
    return vec2(x, clamp(at * sqrt(side / max(1.0 - at * at, 1e-14)), r.low.y, r.high.y));
}

// The cone in which an ellipse is seen: around z, with elliptic sections; half axes 1 away along t and b.
struct EllipticCone {
    vec3 t;
    vec3 b;
    vec3 z;
    vec2 tangents;  // the one along t is not the smaller one
};

// Of an ellipse around `centre` seen from the origin, half axes `half_axes` along x and y; centre.z > 0. The cone's dual is
// D = diag(half_axes^2, 0) - centre centre^T: where a direction v is on the cone, v D^-1 v = 0. Its only negative
// eigenvalue, -m, has 1 = sum of centre^2 / (half_axes^2 + m), which makes m a coordinate of confocal ellipsoids.
EllipticCone elliptic_cone(vec3 centre, vec2 half_axes)
{
    float scale = 1.0 / max(length(centre), max(half_axes.x, half_axes.y));
    vec3 c = centre * scale;
    vec2 radii = half_axes * scale;
    vec3 c2 = c * c;
    vec3 d = vec3(radii * radii, 0.0);
    // That of a circle as large as the longer axis, not above the root; from there by Newton's steps on 1 / sum, which is
    // concave: it comes nearer from below, and stays where the ellipse is a circle.
    float most = max(d.x, d.y);
    float p = most - (c2.x + c2.y + c2.z);
    float q = 4.0 * c2.z * most;
    float root = sqrt(p * p + q);
    float m = max(p > 0.0 ? 0.5 * q / (p + root) : 0.5 * (root - p), 1e-30);
    for (int i = 0; i < 6; ++i) {
        vec3 share = c2 / (d + m);
        float sum = share.x + share.y + share.z;
        float slope = dot(share, 1.0 / (d + m));
        m = max(m + sum * (sum - 1.0) / slope, 1e-30);
    }
    EllipticCone cone;
    cone.z = normalize(c / (d + m) * m);
    basis(cone.z, cone.t, cone.b);
    // D across z, and its larger eigenvalue's vector.
    float tt = dot(d, cone.t * cone.t) - dot(c, cone.t) * dot(c, cone.t);
    float bb = dot(d, cone.b * cone.b) - dot(c, cone.b) * dot(c, cone.b);
    float tb = dot(d, cone.t * cone.b) - dot(c, cone.t) * dot(c, cone.b);
    float half_difference = 0.5 * (tt - bb);
    float radius = sqrt(half_difference * half_difference + tb * tb);
    vec2 turn = half_difference >= 0.0 ? vec2(half_difference + radius, tb) : vec2(tb, radius - half_difference);
    turn = radius > 0.0 ? normalize(turn) : vec2(1.0, 0.0);
    vec3 t = cone.t;
    cone.t = t * turn.x + cone.b * turn.y;
    cone.b = cone.b * turn.x - t * turn.y;
    float larger = 0.5 * (tt + bb) + radius;
    float smaller = c2.z * d.x * d.y / (m * larger);  // the product of all three is the determinant
    cone.tangents = sqrt(max(vec2(larger, smaller) / m, 1e-12));
    return cone;
}

// Azimuths are drawn by a density that is right at the ends of both axes: the root of the ratio of solid angles there.
float azimuth_stretch(EllipticCone cone)
{
    vec2 square = cone.tangents * cone.tangents;
    vec2 versines = vec2(versine_of_tangent2(square.x), versine_of_tangent2(square.y));
    return cone.tangents.y / cone.tangents.x * sqrt(versines.x / versines.y);
}

// Directions for each steradian along azimuth `turn` (unit; in halves of axes).
float cone_density(EllipticCone cone, vec2 turn)
{
    float stretch = azimuth_stretch(cone);
    vec2 across = cone.tangents * turn;
    float square = dot(across, across);
    float part = cone.tangents.x * cone.tangents.y / (1.0 + square + sqrt(1.0 + square));
    return stretch / (2.0 * PI * part * (turn.x * turn.x + stretch * stretch * turn.y * turn.y));
}

// A direction in the cone, by u: uniform along the radius, nearly so around.
vec3 sample_elliptic_cone(EllipticCone cone, vec2 u)
{
    float phi = 2.0 * PI * u.y;
    vec2 turn = normalize(vec2(azimuth_stretch(cone) * cos(phi), sin(phi)));
    vec2 across = cone.tangents * turn;
    float square = dot(across, across);
    float w = u.x * versine_of_tangent2(square);
    across *= sqrt(w * (2.0 - w) / square);
    return normalize(cone.t * across.x + cone.b * across.y + cone.z * (1.0 - w));
}

// As many for each steradian as sample_elliptic_cone sends along a direction inside.
float elliptic_cone_density(EllipticCone cone, vec3 direction)
{
    vec2 turn = vec2(dot(direction, cone.t), dot(direction, cone.b)) / cone.tangents;
    float size = length(turn);
    return cone_density(cone, size > 0.0 ? turn / size : vec2(1.0, 0.0));
}
