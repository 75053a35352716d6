/*
 * wamnet edge-avoiding filter: one level of means, C99. Generated: change the compiler, not this text.
 * program   8b394641fc87462674d11ff7e46d8f83
 * program   2af2be0d0ca07c315f98de34d92385c6
 * bound     at given layers: see the rules for each operation
 * arguments guides: planes of height rows of row_stride floats:
 *           normal_x, normal_y, normal_z, albedo_x, albedo_y, albedo_z, position_x, position_y, position_z,
 *           factor_position_x;
 *           light: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           result: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           width; height; row_stride: at least width; gap: pixels between taps.
 *           wamnet_smooth does all pixels, wamnet_smooth_pixel one: call that from your own loops
 */
#ifndef WAMNET_SMOOTH_H
#define WAMNET_SMOOTH_H
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
static const float SPLINE[5] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
/* One pixel (x, y). */
static inline void wamnet_smooth_pixel(
    const float *restrict guides,
    const float *restrict light,
    float *restrict result,
    int width,
    int height,
    int row_stride,
    int gap,
    int x,
    int y);

/* All pixels, one after another. */
static inline void wamnet_smooth(
    const float *restrict guides,
    const float *restrict light,
    float *restrict result,
    int width,
    int height,
    int row_stride,
    int gap)
{
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            wamnet_smooth_pixel(guides, light, result, width, height, row_stride, gap, x, y);
        }
    }
}

static inline int wamnet_smooth_clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

static inline void wamnet_smooth_pixel(
    const float *restrict guides,
    const float *restrict light,
    float *restrict result,
    int width,
    int height,
    int row_stride,
    int gap,
    int x,
    int y)
{

    size_t stride = (size_t)row_stride;
    size_t plane = (size_t)height * stride;
    size_t at = (size_t)y * stride + (size_t)x;
    float here_normal_x = guides[0 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_normal_y = guides[1 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_normal_z = guides[2 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_albedo_x = guides[3 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_albedo_y = guides[4 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_albedo_z = guides[5 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_position_x = guides[6 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_position_y = guides[7 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_position_z = guides[8 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float here_factor_position_x = guides[9 * plane + (size_t)y * stride + (size_t)wamnet_smooth_clamp(x, 0, width - 1)];
    float total_r = 0.0f;
    float total_g = 0.0f;
    float total_b = 0.0f;
    float weights = 0.0f;
    for (int dy = 0; dy < 5; ++dy) {
        int line = wamnet_smooth_clamp(y + gap * (dy - 2), 0, height - 1);
        for (int dx = 0; dx < 5; ++dx) {
            int column = x + gap * (dx - 2);
            float there_normal_x = guides[0 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_normal_y = guides[1 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_normal_z = guides[2 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_albedo_x = guides[3 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_albedo_y = guides[4 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_albedo_z = guides[5 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_position_x = guides[6 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_position_y = guides[7 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float there_position_z = guides[8 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float color_r = light[0 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float color_g = light[1 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float color_b = light[2 * plane + (size_t)line * stride + (size_t)wamnet_smooth_clamp(column, 0, width - 1)];
            float spline = SPLINE[dy] * SPLINE[dx];
            float t29 = there_normal_x - here_normal_x;
            float t30 = there_normal_y - here_normal_y;
            float t31 = there_normal_z - here_normal_z;
            float t32 = there_albedo_x - here_albedo_x;
            float t33 = there_albedo_y - here_albedo_y;
            float t34 = there_albedo_z - here_albedo_z;
            float t35 = there_position_x - here_position_x;
            float t36 = there_position_y - here_position_y;
            float t37 = there_position_z - here_position_z;
            float t38 = t29 * 2.0f;
            float t39 = t30 * 2.0f;
            float t40 = t31 * 2.0f;
            float t41 = t32 * 5.0f;
            float t42 = t33 * 5.0f;
            float t43 = t34 * 5.0f;
            float t44 = t35 * here_factor_position_x;
            float t45 = t36 * here_factor_position_x;
            float t46 = t37 * here_factor_position_x;
            float t47 = t38 * t38;
            float t48 = t39 * t39;
            float t49 = t40 * t40;
            float t50 = t41 * t41;
            float t51 = t42 * t42;
            float t52 = t43 * t43;
            float t53 = t44 * t44;
            float t54 = t45 * t45;
            float t55 = t46 * t46;
            float t56 = t47 + t48;
            float t57 = t49 + t50;
            float t58 = t51 + t52;
            float t59 = t53 + t54;
            float t60 = t56 + t57;
            float t61 = t58 + t59;
            float t62 = t60 + t61;
            float t63 = t62 + t55;
            float t65 = (-0.5f) * t63;
            float t66 = expf(t65);
            float t67 = spline * t66;
            float t68 = t67 * color_r;
            float t69 = t67 * color_g;
            float t70 = t67 * color_b;
            float t71 = total_r + t68;
            float t72 = total_g + t69;
            float t73 = total_b + t70;
            float t74 = weights + t67;
            total_r = t71;
            total_g = t72;
            total_b = t73;
            weights = t74;
        }
    }
    float t4 = total_r / weights;
    float t5 = total_g / weights;
    float t6 = total_b / weights;
    result[0 * plane + at] = t4;
    result[1 * plane + at] = t5;
    result[2 * plane + at] = t6;
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#undef restrict
#endif
