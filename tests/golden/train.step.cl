/*
 * wamnet training step, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   f49c54e74461f93a404a48c951576962
 */
#define BATCH 4
#define COUNT 47
#define SUMS 48
#define SCRATCH 768
#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(a) __builtin_elementwise_floor(a)
#endif
#if __has_builtin(__builtin_convertvector)
#define CONVERT(a, kind) __builtin_convertvector(a, kind)
#endif
#endif
#ifndef FLOOR
#define FLOOR(a) floor(a)
#endif
#ifndef CONVERT
#define CONVERT(a, kind) convert_##kind(a)
#endif

__kernel void wamnet_step(
    __global const float *restrict values,
    __global const float *restrict targets,
    __global const int *restrict places,
    __global const float16 *restrict old,
    __global const float16 *restrict transposed,
    __global float16 *restrict scratch,
    __global float16 *restrict sums,
    __global const int *restrict failed,
    int groups)
{
    int group = (int)get_global_id(0);
    if (group >= groups) {
        return;
    }
    if (failed[0] < 0) {
        int begin = BATCH / groups * group + BATCH % groups * group / groups;
        int last = BATCH / groups * (group + 1) + BATCH % groups * (group + 1) / groups;
        int own = group * SCRATCH;
        int sum = group * SUMS;
        for (int first = begin; first < last; first += 64) {

            /* Where the examples lie; those that fill up the last ones are not added up. */
            int count = min(64, last - first);
            int filled = (count + 7) / 8 * 8;
            int corner[64];
            int row[64];
            int target[64];
            for (int e = 0; e < filled; ++e) {
                int example = min(first + e, last - 1);
                corner[e] = places[example];
                row[e] = (places + BATCH)[example];
                target[e] = (places + BATCH * 2)[example];
            }

            /* %1: the targets */
            for (int e = 0; e < filled; ++e) {
                for (int i = 0; i < 16; ++i) {
                    ((__global float *)scratch + (own + e) * 16)[i] = i < 3 ? (targets + target[e] * 3)[min(i, 2)] : 0.0f;
                }
            }

            /* %2: affine map W0 from 12 to 20 */
            for (int e = 0; e < filled; e += 8) {
                float16 s0_0 = old[24];
                float16 s0_1 = old[25];
                float16 s1_0 = old[24];
                float16 s1_1 = old[25];
                float16 s2_0 = old[24];
                float16 s2_1 = old[25];
                float16 s3_0 = old[24];
                float16 s3_1 = old[25];
                float16 s4_0 = old[24];
                float16 s4_1 = old[25];
                float16 s5_0 = old[24];
                float16 s5_1 = old[25];
                float16 s6_0 = old[24];
                float16 s6_1 = old[25];
                float16 s7_0 = old[24];
                float16 s7_1 = old[25];
                for (int dy = 0; dy < 2; ++dy) {
                    int x0 = corner[e] + dy * row[e];
                    int x1 = corner[e + 1] + dy * row[e + 1];
                    int x2 = corner[e + 2] + dy * row[e + 2];
                    int x3 = corner[e + 3] + dy * row[e + 3];
                    int x4 = corner[e + 4] + dy * row[e + 4];
                    int x5 = corner[e + 5] + dy * row[e + 5];
                    int x6 = corner[e + 6] + dy * row[e + 6];
                    int x7 = corner[e + 7] + dy * row[e + 7];
                    for (int i = 0; i < 6; ++i) {
                        float16 w0 = old[(dy * 6 + i) * 2];
                        float16 w1 = old[(dy * 6 + i) * 2 + 1];
                        s0_0 += w0 * (values + x0)[i];
                        s0_1 += w1 * (values + x0)[i];
                        s1_0 += w0 * (values + x1)[i];
                        s1_1 += w1 * (values + x1)[i];
                        s2_0 += w0 * (values + x2)[i];
                        s2_1 += w1 * (values + x2)[i];
                        s3_0 += w0 * (values + x3)[i];
                        s3_1 += w1 * (values + x3)[i];
                        s4_0 += w0 * (values + x4)[i];
                        s4_1 += w1 * (values + x4)[i];
                        s5_0 += w0 * (values + x5)[i];
                        s5_1 += w1 * (values + x5)[i];
                        s6_0 += w0 * (values + x6)[i];
                        s6_1 += w1 * (values + x6)[i];
                        s7_0 += w0 * (values + x7)[i];
                        s7_1 += w1 * (values + x7)[i];
                    }
                }
                (scratch + own + 64)[e * 2] = s0_0;
                scratch[own + 64 + e * 2 + 1] = s0_1;
                (scratch + own + 64)[(e + 1) * 2] = s1_0;
                scratch[own + 64 + (e + 1) * 2 + 1] = s1_1;
                (scratch + own + 64)[(e + 2) * 2] = s2_0;
                scratch[own + 64 + (e + 2) * 2 + 1] = s2_1;
                (scratch + own + 64)[(e + 3) * 2] = s3_0;
                scratch[own + 64 + (e + 3) * 2 + 1] = s3_1;
                (scratch + own + 64)[(e + 4) * 2] = s4_0;
                scratch[own + 64 + (e + 4) * 2 + 1] = s4_1;
                (scratch + own + 64)[(e + 5) * 2] = s5_0;
                scratch[own + 64 + (e + 5) * 2 + 1] = s5_1;
                (scratch + own + 64)[(e + 6) * 2] = s6_0;
                scratch[own + 64 + (e + 6) * 2 + 1] = s6_1;
                (scratch + own + 64)[(e + 7) * 2] = s7_0;
                scratch[own + 64 + (e + 7) * 2 + 1] = s7_1;
            }

            /* %4 to %50: elementwise on 20 numbers */
            for (int e = 0; e < filled; ++e) {
                for (int j = 0; j < 2; ++j) {
                    float16 t4 = (scratch + own + 64 + e * 2)[j] * 0.318309873f;
                    float16 t6 = t4 + 0.5f;
                    float16 t7 = FLOOR(t6);
                    float16 t9 = t7 * 3.14160156f;
                    float16 t10 = (scratch + own + 64 + e * 2)[j] - t9;
                    float16 t12 = t7 * (-8.9071691e-06f);
                    float16 t13 = t10 - t12;
                    float16 t15 = t7 * (-1.74122761e-09f);
                    float16 t16 = t13 - t15;
                    float16 t17 = 0.5f * t7;
                    float16 t18 = FLOOR(t17);
                    float16 t20 = 2.0f * t18;
                    float16 t21 = t7 - t20;
                    float16 t22 = 2.0f * t21;
                    float16 t24 = 1.0f - t22;
                    float16 t25 = t16 * t16;
                    float16 t27 = t25 * (-2.51969432e-08f);
                    float16 t29 = t27 + 2.76094511e-06f;
                    float16 t30 = t25 * t29;
                    float16 t32 = t30 + (-0.000198427704f);
                    float16 t33 = t25 * t32;
                    float16 t35 = t33 + 0.00833334867f;
                    float16 t36 = t25 * t35;
                    float16 t38 = t36 + (-0.166666672f);
                    float16 t39 = t25 * t38;
                    float16 t40 = t16 * t39;
                    float16 t41 = t16 + t40;
                    float16 t42 = t24 * t41;
                    float16 t43 = (float16)(1.0f) < t42 ? (float16)(1.0f) : t42;
                    float16 t45 = (float16)(-1.0f) > t43 ? (float16)(-1.0f) : t43;
                    float16 t46 = as_float16(as_int16((scratch + own + 64 + e * 2)[j]) & 0x7fffffff);
                    int16 t48 = t46 <= 12800.0f;
                    float16 t49 = (scratch + own + 64 + e * 2)[j] - (scratch + own + 64 + e * 2)[j];
                    float16 t50 = t48 ? t45 : t49;
                    (scratch + own + 192 + e * 2)[j] = t50;
                }
            }

            /* %51: affine map W1 from 20 to 3 */
            for (int e = 0; e < filled; e += 8) {
                float16 s0_0 = old[46];
                float16 s1_0 = old[46];
                float16 s2_0 = old[46];
                float16 s3_0 = old[46];
                float16 s4_0 = old[46];
                float16 s5_0 = old[46];
                float16 s6_0 = old[46];
                float16 s7_0 = old[46];
                for (int dy = 0; dy < 1; ++dy) {
                    int x0 = (own + 192 + e * 2) * 16;
                    int x1 = (own + 192 + (e + 1) * 2) * 16;
                    int x2 = (own + 192 + (e + 2) * 2) * 16;
                    int x3 = (own + 192 + (e + 3) * 2) * 16;
                    int x4 = (own + 192 + (e + 4) * 2) * 16;
                    int x5 = (own + 192 + (e + 5) * 2) * 16;
                    int x6 = (own + 192 + (e + 6) * 2) * 16;
                    int x7 = (own + 192 + (e + 7) * 2) * 16;
                    for (int i = 0; i < 20; ++i) {
                        float16 w0 = old[26 + dy * 20 + i];
                        s0_0 += w0 * ((__global float *)scratch + x0)[i];
                        s1_0 += w0 * ((__global float *)scratch + x1)[i];
                        s2_0 += w0 * ((__global float *)scratch + x2)[i];
                        s3_0 += w0 * ((__global float *)scratch + x3)[i];
                        s4_0 += w0 * ((__global float *)scratch + x4)[i];
                        s5_0 += w0 * ((__global float *)scratch + x5)[i];
                        s6_0 += w0 * ((__global float *)scratch + x6)[i];
                        s7_0 += w0 * ((__global float *)scratch + x7)[i];
                    }
                }
                (scratch + own + 320)[e] = s0_0;
                scratch[own + 320 + e + 1] = s1_0;
                scratch[own + 320 + e + 2] = s2_0;
                scratch[own + 320 + e + 3] = s3_0;
                scratch[own + 320 + e + 4] = s4_0;
                scratch[own + 320 + e + 5] = s5_0;
                scratch[own + 320 + e + 6] = s6_0;
                scratch[own + 320 + e + 7] = s7_0;
            }

            /* %52 to %55: elementwise on 3 numbers */
            for (int e = 0; e < filled; ++e) {
                for (int j = 0; j < 1; ++j) {
                    float16 t52 = (scratch + own + 320 + e)[j] - (scratch + own + e)[j];
                    float16 t53 = t52 * t52;
                    (scratch + own + 384 + e)[j] = t53;
                    float16 t55 = t52 * 0.166666672f;
                    (scratch + own + 448 + e)[j] = t55;
                }
            }

            /* %56: affine map W1.T from 3 to 20 */
            for (int e = 0; e < filled; e += 8) {
                float16 s0_0 = (float16)(0.0f);
                float16 s0_1 = (float16)(0.0f);
                float16 s1_0 = (float16)(0.0f);
                float16 s1_1 = (float16)(0.0f);
                float16 s2_0 = (float16)(0.0f);
                float16 s2_1 = (float16)(0.0f);
                float16 s3_0 = (float16)(0.0f);
                float16 s3_1 = (float16)(0.0f);
                float16 s4_0 = (float16)(0.0f);
                float16 s4_1 = (float16)(0.0f);
                float16 s5_0 = (float16)(0.0f);
                float16 s5_1 = (float16)(0.0f);
                float16 s6_0 = (float16)(0.0f);
                float16 s6_1 = (float16)(0.0f);
                float16 s7_0 = (float16)(0.0f);
                float16 s7_1 = (float16)(0.0f);
                for (int dy = 0; dy < 1; ++dy) {
                    int x0 = (own + 448 + e) * 16;
                    int x1 = (own + 448 + e + 1) * 16;
                    int x2 = (own + 448 + e + 2) * 16;
                    int x3 = (own + 448 + e + 3) * 16;
                    int x4 = (own + 448 + e + 4) * 16;
                    int x5 = (own + 448 + e + 5) * 16;
                    int x6 = (own + 448 + e + 6) * 16;
                    int x7 = (own + 448 + e + 7) * 16;
                    for (int i = 0; i < 3; ++i) {
                        float16 w0 = transposed[(dy * 3 + i) * 2];
                        float16 w1 = transposed[(dy * 3 + i) * 2 + 1];
                        s0_0 += w0 * ((__global float *)scratch + x0)[i];
                        s0_1 += w1 * ((__global float *)scratch + x0)[i];
                        s1_0 += w0 * ((__global float *)scratch + x1)[i];
                        s1_1 += w1 * ((__global float *)scratch + x1)[i];
                        s2_0 += w0 * ((__global float *)scratch + x2)[i];
                        s2_1 += w1 * ((__global float *)scratch + x2)[i];
                        s3_0 += w0 * ((__global float *)scratch + x3)[i];
                        s3_1 += w1 * ((__global float *)scratch + x3)[i];
                        s4_0 += w0 * ((__global float *)scratch + x4)[i];
                        s4_1 += w1 * ((__global float *)scratch + x4)[i];
                        s5_0 += w0 * ((__global float *)scratch + x5)[i];
                        s5_1 += w1 * ((__global float *)scratch + x5)[i];
                        s6_0 += w0 * ((__global float *)scratch + x6)[i];
                        s6_1 += w1 * ((__global float *)scratch + x6)[i];
                        s7_0 += w0 * ((__global float *)scratch + x7)[i];
                        s7_1 += w1 * ((__global float *)scratch + x7)[i];
                    }
                }
                (scratch + own + 512)[e * 2] = s0_0;
                scratch[own + 512 + e * 2 + 1] = s0_1;
                (scratch + own + 512)[(e + 1) * 2] = s1_0;
                scratch[own + 512 + (e + 1) * 2 + 1] = s1_1;
                (scratch + own + 512)[(e + 2) * 2] = s2_0;
                scratch[own + 512 + (e + 2) * 2 + 1] = s2_1;
                (scratch + own + 512)[(e + 3) * 2] = s3_0;
                scratch[own + 512 + (e + 3) * 2 + 1] = s3_1;
                (scratch + own + 512)[(e + 4) * 2] = s4_0;
                scratch[own + 512 + (e + 4) * 2 + 1] = s4_1;
                (scratch + own + 512)[(e + 5) * 2] = s5_0;
                scratch[own + 512 + (e + 5) * 2 + 1] = s5_1;
                (scratch + own + 512)[(e + 6) * 2] = s6_0;
                scratch[own + 512 + (e + 6) * 2 + 1] = s6_1;
                (scratch + own + 512)[(e + 7) * 2] = s7_0;
                scratch[own + 512 + (e + 7) * 2 + 1] = s7_1;
            }

            /* %57 to %90: elementwise on 20 numbers */
            for (int e = 0; e < filled; ++e) {
                for (int j = 0; j < 2; ++j) {
                    float16 t57 = (scratch + own + 64 + e * 2)[j] * 0.318309873f + 1.0f;
                    float16 t58 = FLOOR(t57);
                    float16 t59 = t58 - 0.5f;
                    float16 t60 = t59 * 3.14160156f;
                    float16 t61 = (scratch + own + 64 + e * 2)[j] - t60;
                    float16 t62 = t59 * (-8.9071691e-06f);
                    float16 t63 = t61 - t62;
                    float16 t64 = t59 * (-1.74122761e-09f);
                    float16 t65 = t63 - t64;
                    float16 t66 = 0.5f * t58;
                    float16 t67 = FLOOR(t66);
                    float16 t68 = 2.0f * t67;
                    float16 t69 = t58 - t68;
                    float16 t70 = 2.0f * t69;
                    float16 t71 = 1.0f - t70;
                    float16 t72 = t65 * t65;
                    float16 t73 = t72 * (-2.51969432e-08f);
                    float16 t74 = t73 + 2.76094511e-06f;
                    float16 t75 = t72 * t74;
                    float16 t76 = t75 + (-0.000198427704f);
                    float16 t77 = t72 * t76;
                    float16 t78 = t77 + 0.00833334867f;
                    float16 t79 = t72 * t78;
                    float16 t80 = t79 + (-0.166666672f);
                    float16 t81 = t72 * t80;
                    float16 t82 = t65 * t81;
                    float16 t83 = t65 + t82;
                    float16 t84 = t71 * t83;
                    float16 t85 = (float16)(1.0f) < t84 ? (float16)(1.0f) : t84;
                    float16 t86 = (float16)(-1.0f) > t85 ? (float16)(-1.0f) : t85;
                    int16 t88 = as_float16(as_int16((scratch + own + 64 + e * 2)[j]) & 0x7fffffff) <= 6400.0f;
                    float16 t89 = t88 ? t86 : (scratch + own + 64 + e * 2)[j] - (scratch + own + 64 + e * 2)[j];
                    float16 t90 = (scratch + own + 512 + e * 2)[j] * t89;
                    (scratch + own + 640 + e * 2)[j] = t90;
                }
            }

            /* sum of %53: squares */
            for (int dy = 0; dy < 1; ++dy) {
                {
                    int k = 0;
                    float16 s0_0 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = sums[sum + 47 + dy + k];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = k;
                        float16 w0 = (scratch + own + 384)[n];
                        s0_0 += w0 * 1.0f;
                    }
                    sums[sum + 47 + dy + k] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s0_0 : (float16)(0.0f);
                }
            }

            /* sum of %90 x %0: W0 */
            for (int dy = 0; dy < 2; ++dy) {
                {
                    int k = 0;
                    float16 s0_0 = (float16)(0.0f);
                    float16 s0_1 = (float16)(0.0f);
                    float16 s1_0 = (float16)(0.0f);
                    float16 s1_1 = (float16)(0.0f);
                    float16 s2_0 = (float16)(0.0f);
                    float16 s2_1 = (float16)(0.0f);
                    float16 s3_0 = (float16)(0.0f);
                    float16 s3_1 = (float16)(0.0f);
                    float16 s4_0 = (float16)(0.0f);
                    float16 s4_1 = (float16)(0.0f);
                    float16 s5_0 = (float16)(0.0f);
                    float16 s5_1 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = (sums + sum)[(dy * 6 + k) * 2];
                        s0_1 = sums[sum + (dy * 6 + k) * 2 + 1];
                        s1_0 = (sums + sum)[(dy * 6 + k + 1) * 2];
                        s1_1 = sums[sum + (dy * 6 + k + 1) * 2 + 1];
                        s2_0 = (sums + sum)[(dy * 6 + k + 2) * 2];
                        s2_1 = sums[sum + (dy * 6 + k + 2) * 2 + 1];
                        s3_0 = (sums + sum)[(dy * 6 + k + 3) * 2];
                        s3_1 = sums[sum + (dy * 6 + k + 3) * 2 + 1];
                        s4_0 = (sums + sum)[(dy * 6 + k + 4) * 2];
                        s4_1 = sums[sum + (dy * 6 + k + 4) * 2 + 1];
                        s5_0 = (sums + sum)[(dy * 6 + k + 5) * 2];
                        s5_1 = sums[sum + (dy * 6 + k + 5) * 2 + 1];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = corner[n] + dy * row[n] + k;
                        float16 w0 = (scratch + own + 640)[n * 2];
                        float16 w1 = scratch[own + 640 + n * 2 + 1];
                        s0_0 += w0 * values[from];
                        s0_1 += w1 * values[from];
                        s1_0 += w0 * values[from + 1];
                        s1_1 += w1 * values[from + 1];
                        s2_0 += w0 * values[from + 2];
                        s2_1 += w1 * values[from + 2];
                        s3_0 += w0 * values[from + 3];
                        s3_1 += w1 * values[from + 3];
                        s4_0 += w0 * values[from + 4];
                        s4_1 += w1 * values[from + 4];
                        s5_0 += w0 * values[from + 5];
                        s5_1 += w1 * values[from + 5];
                    }
                    (sums + sum)[(dy * 6 + k) * 2] = s0_0;
                    sums[sum + (dy * 6 + k) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s0_1 : (float16)(0.0f);
                    (sums + sum)[(dy * 6 + k + 1) * 2] = s1_0;
                    sums[sum + (dy * 6 + k + 1) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s1_1 : (float16)(0.0f);
                    (sums + sum)[(dy * 6 + k + 2) * 2] = s2_0;
                    sums[sum + (dy * 6 + k + 2) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s2_1 : (float16)(0.0f);
                    (sums + sum)[(dy * 6 + k + 3) * 2] = s3_0;
                    sums[sum + (dy * 6 + k + 3) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s3_1 : (float16)(0.0f);
                    (sums + sum)[(dy * 6 + k + 4) * 2] = s4_0;
                    sums[sum + (dy * 6 + k + 4) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s4_1 : (float16)(0.0f);
                    (sums + sum)[(dy * 6 + k + 5) * 2] = s5_0;
                    sums[sum + (dy * 6 + k + 5) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s5_1 : (float16)(0.0f);
                }
            }

            /* sum of %90: b0 */
            for (int dy = 0; dy < 1; ++dy) {
                {
                    int k = 0;
                    float16 s0_0 = (float16)(0.0f);
                    float16 s0_1 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = (sums + sum + 24)[(dy + k) * 2];
                        s0_1 = sums[sum + 24 + (dy + k) * 2 + 1];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = k;
                        float16 w0 = (scratch + own + 640)[n * 2];
                        float16 w1 = scratch[own + 640 + n * 2 + 1];
                        s0_0 += w0 * 1.0f;
                        s0_1 += w1 * 1.0f;
                    }
                    (sums + sum + 24)[(dy + k) * 2] = s0_0;
                    sums[sum + 24 + (dy + k) * 2 + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 4u ? s0_1 : (float16)(0.0f);
                }
            }

            /* sum of %55 x %50: W1 */
            for (int dy = 0; dy < 1; ++dy) {
                for (int k = 0; k < 12; k += 12) {
                    float16 s0_0 = (float16)(0.0f);
                    float16 s1_0 = (float16)(0.0f);
                    float16 s2_0 = (float16)(0.0f);
                    float16 s3_0 = (float16)(0.0f);
                    float16 s4_0 = (float16)(0.0f);
                    float16 s5_0 = (float16)(0.0f);
                    float16 s6_0 = (float16)(0.0f);
                    float16 s7_0 = (float16)(0.0f);
                    float16 s8_0 = (float16)(0.0f);
                    float16 s9_0 = (float16)(0.0f);
                    float16 s10_0 = (float16)(0.0f);
                    float16 s11_0 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = sums[sum + 26 + dy * 20 + k];
                        s1_0 = sums[sum + 26 + dy * 20 + k + 1];
                        s2_0 = sums[sum + 26 + dy * 20 + k + 2];
                        s3_0 = sums[sum + 26 + dy * 20 + k + 3];
                        s4_0 = sums[sum + 26 + dy * 20 + k + 4];
                        s5_0 = sums[sum + 26 + dy * 20 + k + 5];
                        s6_0 = sums[sum + 26 + dy * 20 + k + 6];
                        s7_0 = sums[sum + 26 + dy * 20 + k + 7];
                        s8_0 = sums[sum + 26 + dy * 20 + k + 8];
                        s9_0 = sums[sum + 26 + dy * 20 + k + 9];
                        s10_0 = sums[sum + 26 + dy * 20 + k + 10];
                        s11_0 = sums[sum + 26 + dy * 20 + k + 11];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = (own + 192 + n * 2) * 16 + k;
                        float16 w0 = (scratch + own + 448)[n];
                        s0_0 += w0 * ((__global float *)scratch)[from];
                        s1_0 += w0 * ((__global float *)scratch)[from + 1];
                        s2_0 += w0 * ((__global float *)scratch)[from + 2];
                        s3_0 += w0 * ((__global float *)scratch)[from + 3];
                        s4_0 += w0 * ((__global float *)scratch)[from + 4];
                        s5_0 += w0 * ((__global float *)scratch)[from + 5];
                        s6_0 += w0 * ((__global float *)scratch)[from + 6];
                        s7_0 += w0 * ((__global float *)scratch)[from + 7];
                        s8_0 += w0 * ((__global float *)scratch)[from + 8];
                        s9_0 += w0 * ((__global float *)scratch)[from + 9];
                        s10_0 += w0 * ((__global float *)scratch)[from + 10];
                        s11_0 += w0 * ((__global float *)scratch)[from + 11];
                    }
                    sums[sum + 26 + dy * 20 + k] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s0_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s1_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 2] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s2_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 3] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s3_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 4] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s4_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 5] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s5_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 6] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s6_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 7] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s7_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 8] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s8_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 9] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s9_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 10] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s10_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 11] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s11_0 : (float16)(0.0f);
                }
                {
                    int k = 12;
                    float16 s0_0 = (float16)(0.0f);
                    float16 s1_0 = (float16)(0.0f);
                    float16 s2_0 = (float16)(0.0f);
                    float16 s3_0 = (float16)(0.0f);
                    float16 s4_0 = (float16)(0.0f);
                    float16 s5_0 = (float16)(0.0f);
                    float16 s6_0 = (float16)(0.0f);
                    float16 s7_0 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = sums[sum + 26 + dy * 20 + k];
                        s1_0 = sums[sum + 26 + dy * 20 + k + 1];
                        s2_0 = sums[sum + 26 + dy * 20 + k + 2];
                        s3_0 = sums[sum + 26 + dy * 20 + k + 3];
                        s4_0 = sums[sum + 26 + dy * 20 + k + 4];
                        s5_0 = sums[sum + 26 + dy * 20 + k + 5];
                        s6_0 = sums[sum + 26 + dy * 20 + k + 6];
                        s7_0 = sums[sum + 26 + dy * 20 + k + 7];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = (own + 192 + n * 2) * 16 + k;
                        float16 w0 = (scratch + own + 448)[n];
                        s0_0 += w0 * ((__global float *)scratch)[from];
                        s1_0 += w0 * ((__global float *)scratch)[from + 1];
                        s2_0 += w0 * ((__global float *)scratch)[from + 2];
                        s3_0 += w0 * ((__global float *)scratch)[from + 3];
                        s4_0 += w0 * ((__global float *)scratch)[from + 4];
                        s5_0 += w0 * ((__global float *)scratch)[from + 5];
                        s6_0 += w0 * ((__global float *)scratch)[from + 6];
                        s7_0 += w0 * ((__global float *)scratch)[from + 7];
                    }
                    sums[sum + 26 + dy * 20 + k] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s0_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 1] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s1_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 2] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s2_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 3] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s3_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 4] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s4_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 5] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s5_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 6] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s6_0 : (float16)(0.0f);
                    sums[sum + 26 + dy * 20 + k + 7] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s7_0 : (float16)(0.0f);
                }
            }

            /* sum of %55: b1 */
            for (int dy = 0; dy < 1; ++dy) {
                {
                    int k = 0;
                    float16 s0_0 = (float16)(0.0f);
                    if (begin < first) {
                        s0_0 = sums[sum + 46 + dy + k];
                    }
                    for (int n = 0; n < count; ++n) {
                        int from = k;
                        float16 w0 = (scratch + own + 448)[n];
                        s0_0 += w0 * 1.0f;
                    }
                    sums[sum + 46 + dy + k] = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15) < 3u ? s0_0 : (float16)(0.0f);
                }
            }
        }
    }
}

__kernel void wamnet_loss(
    __global const float16 *restrict sums,
    __global float *restrict losses,
    __global int *restrict failed,
    int groups,
    int at,
    int step)
{
    int one = (int)get_global_id(0);
    if (one >= 1) {
        return;
    }
    if (failed[0] < 0) {
        float loss = 0.0f;
        for (int j = 0; j < SUMS - COUNT; ++j) {
            float16 squares = (sums + COUNT)[j];
            for (int n = 1; n < groups; ++n) {
                squares += sums[n * SUMS + COUNT + j];
            }
            loss += squares.s0 + squares.s8 + (squares.s4 + squares.sc) + (squares.s1 + squares.s9 + (squares.s5 + squares.sd)) + (squares.s2 + squares.sa + (squares.s6 + squares.se)) + (squares.s3 + squares.sb + (squares.s7 + squares.sf));
        }
        float mean = loss / 12.0f;
        losses[at] = mean;
        if (!(fabs(mean) <= 3.40282347e+38f)) {
            failed[0] = step;
        }
    }
}

__kernel void wamnet_update(
    __global const float *restrict rates,
    __global const float16 *restrict old,
    __global float16 *restrict moved,
    __global float16 *restrict transposed,
    __global const float16 *restrict sums,
    __global const int *restrict failed,
    int groups,
    int at)
{
    int i = (int)get_global_id(0);
    if (i >= COUNT) {
        return;
    }
    if (failed[0] < 0) {
        int end = groups;
        float16 g = sums[i];
        for (int n = 1; n < end; ++n) {
            g += (sums + n * SUMS)[i];
        }
        float16 theta = old[i];
        float16 m = (old + COUNT)[i];
        float16 v = (old + COUNT * 2)[i];
        float16 learning_rate = (float16)(rates[at * 3]);
        float16 grown_1 = (float16)(rates[at * 3 + 1]);
        float16 grown_2 = (float16)(rates[at * 3 + 2]);
        float16 t8 = 0.899999976f * m;
        float16 t10 = 0.100000001f * g;
        float16 t11 = t8 + t10;
        float16 t13 = 0.999000013f * v;
        float16 t14 = g * g;
        float16 t16 = 0.00100000005f * t14;
        float16 t17 = t13 + t16;
        float16 t18 = t11 / grown_1;
        float16 t19 = t17 / grown_2;
        float16 t20 = learning_rate * t18;
        float16 t21 = sqrt(t19);
        float16 t23 = t21 + 9.99999994e-09f;
        float16 t24 = t20 / t23;
        float16 t25 = theta - t24;
        moved[i] = t25;
        (moved + COUNT)[i] = t11;
        (moved + COUNT * 2)[i] = t17;
        if (i >= 26 && i < 46) {
            int row = i - 26;
            int neuron = (i - 26) % 1 * 16;
            if (neuron < 3) {
                ((__global float *)transposed + neuron * 2 * 16)[row] = t25.s0;
            }
            if (neuron + 1 < 3) {
                ((__global float *)transposed + (neuron + 1) * 2 * 16)[row] = t25.s1;
            }
            if (neuron + 2 < 3) {
                ((__global float *)transposed + (neuron + 2) * 2 * 16)[row] = t25.s2;
            }
            if (neuron + 3 < 3) {
                ((__global float *)transposed + (neuron + 3) * 2 * 16)[row] = t25.s3;
            }
            if (neuron + 4 < 3) {
                ((__global float *)transposed + (neuron + 4) * 2 * 16)[row] = t25.s4;
            }
            if (neuron + 5 < 3) {
                ((__global float *)transposed + (neuron + 5) * 2 * 16)[row] = t25.s5;
            }
            if (neuron + 6 < 3) {
                ((__global float *)transposed + (neuron + 6) * 2 * 16)[row] = t25.s6;
            }
            if (neuron + 7 < 3) {
                ((__global float *)transposed + (neuron + 7) * 2 * 16)[row] = t25.s7;
            }
            if (neuron + 8 < 3) {
                ((__global float *)transposed + (neuron + 8) * 2 * 16)[row] = t25.s8;
            }
            if (neuron + 9 < 3) {
                ((__global float *)transposed + (neuron + 9) * 2 * 16)[row] = t25.s9;
            }
            if (neuron + 10 < 3) {
                ((__global float *)transposed + (neuron + 10) * 2 * 16)[row] = t25.sa;
            }
            if (neuron + 11 < 3) {
                ((__global float *)transposed + (neuron + 11) * 2 * 16)[row] = t25.sb;
            }
            if (neuron + 12 < 3) {
                ((__global float *)transposed + (neuron + 12) * 2 * 16)[row] = t25.sc;
            }
            if (neuron + 13 < 3) {
                ((__global float *)transposed + (neuron + 13) * 2 * 16)[row] = t25.sd;
            }
            if (neuron + 14 < 3) {
                ((__global float *)transposed + (neuron + 14) * 2 * 16)[row] = t25.se;
            }
            if (neuron + 15 < 3) {
                ((__global float *)transposed + (neuron + 15) * 2 * 16)[row] = t25.sf;
            }
        }
    }
}
