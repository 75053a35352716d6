/*
 * wamnet edge-avoiding filter: a frame's light and guides, C99. Generated: change the compiler, not this text.
 * program   119d17075b06b6123094da326f61ecc5
 * bound     at given layers: see the rules for each operation
 * arguments image_color: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_normal: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_albedo: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_position: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_depth: width * height * 1 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           guides: planes of height rows of row_stride floats:
 *           normal_x, normal_y, normal_z, albedo_x, albedo_y, albedo_z, position_x, position_y, position_z,
 *           factor_position_x;
 *           light: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           width; height; row_stride: at least width.
 *           wamnet_guide does all pixels, wamnet_guide_pixel one: call that from your own loops
 */
#ifndef WAMNET_GUIDE_H
#define WAMNET_GUIDE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#if defined(__cplusplus)
#define restrict __restrict /* what compilers of C++ call it */
#endif
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif
/* No product may be fused with a sum. Compilers differ in what they obey, so give them -ffp-contract=off too:
   clang takes the standard's pragma unless it is told -ffp-contract=fast, GCC ignores that and takes its own,
   others may ignore both. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

/* One pixel (x, y). */
static inline void wamnet_guide_pixel(
    const float *restrict image_color,
    const float *restrict image_normal,
    const float *restrict image_albedo,
    const float *restrict image_position,
    const float *restrict image_depth,
    float *restrict guides,
    float *restrict light,
    int width,
    int height,
    int row_stride,
    int x,
    int y);

/* All pixels, one after another. */
static inline void wamnet_guide(
    const float *restrict image_color,
    const float *restrict image_normal,
    const float *restrict image_albedo,
    const float *restrict image_position,
    const float *restrict image_depth,
    float *restrict guides,
    float *restrict light,
    int width,
    int height,
    int row_stride)
{
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            wamnet_guide_pixel(image_color, image_normal, image_albedo, image_position, image_depth, guides, light, width, height, row_stride, x, y);
        }
    }
}

static inline void wamnet_guide_pixel(
    const float *restrict image_color,
    const float *restrict image_normal,
    const float *restrict image_albedo,
    const float *restrict image_position,
    const float *restrict image_depth,
    float *restrict guides,
    float *restrict light,
    int width,
    int height,
    int row_stride,
    int x,
    int y)
{

    size_t stride = (size_t)row_stride;
    size_t plane = (size_t)height * stride;
    size_t at = (size_t)y * stride + (size_t)x;
    size_t place = (size_t)y * (size_t)width + (size_t)x;
    float color_0 = image_color[place * 3 + 0];
    float color_1 = image_color[place * 3 + 1];
    float color_2 = image_color[place * 3 + 2];
    float normal_0 = image_normal[place * 3 + 0];
    float normal_1 = image_normal[place * 3 + 1];
    float normal_2 = image_normal[place * 3 + 2];
    float albedo_0 = image_albedo[place * 3 + 0];
    float albedo_1 = image_albedo[place * 3 + 1];
    float albedo_2 = image_albedo[place * 3 + 2];
    float position_0 = image_position[place * 3 + 0];
    float position_1 = image_position[place * 3 + 1];
    float position_2 = image_position[place * 3 + 2];
    float depth_0 = image_depth[place * 1 + 0];
    float t14 = 9.99999997e-07f > depth_0 ? 9.99999997e-07f : depth_0;
    float t16 = 1e+09f < t14 ? 1e+09f : t14;
    float t19 = (-1e+09f) > normal_0 ? (-1e+09f) : normal_0;
    float t20 = (-1e+09f) > normal_1 ? (-1e+09f) : normal_1;
    float t21 = (-1e+09f) > normal_2 ? (-1e+09f) : normal_2;
    float t22 = 1e+09f < t19 ? 1e+09f : t19;
    float t23 = 1e+09f < t20 ? 1e+09f : t20;
    float t24 = 1e+09f < t21 ? 1e+09f : t21;
    float t25 = (-1e+09f) > albedo_0 ? (-1e+09f) : albedo_0;
    float t26 = (-1e+09f) > albedo_1 ? (-1e+09f) : albedo_1;
    float t27 = (-1e+09f) > albedo_2 ? (-1e+09f) : albedo_2;
    float t28 = 1e+09f < t25 ? 1e+09f : t25;
    float t29 = 1e+09f < t26 ? 1e+09f : t26;
    float t30 = 1e+09f < t27 ? 1e+09f : t27;
    float t31 = (-1e+09f) > position_0 ? (-1e+09f) : position_0;
    float t32 = (-1e+09f) > position_1 ? (-1e+09f) : position_1;
    float t33 = (-1e+09f) > position_2 ? (-1e+09f) : position_2;
    float t34 = 1e+09f < t31 ? 1e+09f : t31;
    float t35 = 1e+09f < t32 ? 1e+09f : t32;
    float t36 = 1e+09f < t33 ? 1e+09f : t33;
    float t38 = 0.0799999982f * t16;
    float t39 = 1.0f / t38;
    float t41 = 0.0f > color_0 ? 0.0f : color_0;
    float t42 = 0.0f > color_1 ? 0.0f : color_1;
    float t43 = 0.0f > color_2 ? 0.0f : color_2;
    float t45 = 45.2548332f < t41 ? 45.2548332f : t41;
    float t46 = 45.2548332f < t42 ? 45.2548332f : t42;
    float t47 = 45.2548332f < t43 ? 45.2548332f : t43;
    light[0 * plane + at] = t45;
    light[1 * plane + at] = t46;
    light[2 * plane + at] = t47;
    guides[0 * plane + at] = t22;
    guides[1 * plane + at] = t23;
    guides[2 * plane + at] = t24;
    guides[3 * plane + at] = t28;
    guides[4 * plane + at] = t29;
    guides[5 * plane + at] = t30;
    guides[6 * plane + at] = t34;
    guides[7 * plane + at] = t35;
    guides[8 * plane + at] = t36;
    guides[9 * plane + at] = t39;
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#undef restrict
#endif
