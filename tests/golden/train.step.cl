/*
 * wamnet training step, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   f49c54e74461f93a404a48c951576962
 */
#define TILE 64
#define EXAMPLES 8
#define BATCH 4
#define WINDOW_SIZE 2
#define WINDOW_RUN 6
#define COUNT 47
#define SUMS 48
#define SCRATCH 768
#define LOSS_TERMS 12.0f
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
__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void wamnet_step(
    __global const float *restrict values,
    __global const float *restrict targets,
    __global const int *restrict places,
    __global const float16 *restrict theta,
    __global const float16 *restrict transposed,
    __global float16 *restrict scratch,
    __global float16 *restrict sums,
    __global const int *restrict failed)
{
    if (failed[0] >= 0) {
        return;
    }
    const int group = (int)get_global_id(0), groups = (int)get_global_size(0);
    const int last = (int)((long)BATCH * (group + 1) / groups);
    int first = (int)((long)BATCH * group / groups);
    scratch += group * SCRATCH;
    sums += group * SUMS;
    for (int begins = 1; first < last; first += TILE, begins = 0) {
        /* Where the examples lie; what fills up the last ones is computed, and not added up. */
        const int count = min(TILE, last - first);
        const int filled = (count + EXAMPLES - 1) / EXAMPLES * EXAMPLES;
        int corner[TILE], row[TILE], target[TILE];
        for (int e = 0; e < filled; ++e) {
            const int n = min(first + e, last - 1);
            corner[e] = places[n];
            row[e] = places[BATCH + n];
            target[e] = places[2 * BATCH + n];
        }
        __global float16 *restrict v1 = scratch + 0;
        __global float16 *restrict v2 = scratch + 64;
        __global float16 *restrict v50 = scratch + 192;
        __global float16 *restrict v51 = scratch + 320;
        __global float16 *restrict v53 = scratch + 384;
        __global float16 *restrict v55 = scratch + 448;
        __global float16 *restrict v56 = scratch + 512;
        __global float16 *restrict v90 = scratch + 640;

        /* %1: the targets */
        for (int e = 0; e < filled; ++e) {
            __global float *out = (__global float *)(v1 + e * 1);
            for (int i = 0; i < 16; ++i) {
                out[i] = i < 3 ? targets[target[e] * 3 + i] : 0.0f;
            }
        }

        /* %2: affine map W0 from 12 to 20 */
        for (int e = 0; e < filled; e += 8) {
            __global const float *x0 = values + corner[e + 0];
            float16 s0_0 = theta[24], s0_1 = theta[25];
            __global const float *x1 = values + corner[e + 1];
            float16 s1_0 = theta[24], s1_1 = theta[25];
            __global const float *x2 = values + corner[e + 2];
            float16 s2_0 = theta[24], s2_1 = theta[25];
            __global const float *x3 = values + corner[e + 3];
            float16 s3_0 = theta[24], s3_1 = theta[25];
            __global const float *x4 = values + corner[e + 4];
            float16 s4_0 = theta[24], s4_1 = theta[25];
            __global const float *x5 = values + corner[e + 5];
            float16 s5_0 = theta[24], s5_1 = theta[25];
            __global const float *x6 = values + corner[e + 6];
            float16 s6_0 = theta[24], s6_1 = theta[25];
            __global const float *x7 = values + corner[e + 7];
            float16 s7_0 = theta[24], s7_1 = theta[25];
            __global const float16 *w = theta + 0;
            for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
                for (int i = 0; i < WINDOW_RUN; ++i) {
                    const float16 w0 = w[0], w1 = w[1];
                    w += 2;
                    s0_0 += w0 * x0[i]; s0_1 += w1 * x0[i];
                    s1_0 += w0 * x1[i]; s1_1 += w1 * x1[i];
                    s2_0 += w0 * x2[i]; s2_1 += w1 * x2[i];
                    s3_0 += w0 * x3[i]; s3_1 += w1 * x3[i];
                    s4_0 += w0 * x4[i]; s4_1 += w1 * x4[i];
                    s5_0 += w0 * x5[i]; s5_1 += w1 * x5[i];
                    s6_0 += w0 * x6[i]; s6_1 += w1 * x6[i];
                    s7_0 += w0 * x7[i]; s7_1 += w1 * x7[i];
                }
                x0 += row[e + 0]; x1 += row[e + 1]; x2 += row[e + 2]; x3 += row[e + 3]; x4 += row[e + 4]; x5 += row[e + 5]; x6 += row[e + 6]; x7 += row[e + 7];
            }
            v2[(e + 0) * 2 + 0] = s0_0; v2[(e + 0) * 2 + 1] = s0_1;
            v2[(e + 1) * 2 + 0] = s1_0; v2[(e + 1) * 2 + 1] = s1_1;
            v2[(e + 2) * 2 + 0] = s2_0; v2[(e + 2) * 2 + 1] = s2_1;
            v2[(e + 3) * 2 + 0] = s3_0; v2[(e + 3) * 2 + 1] = s3_1;
            v2[(e + 4) * 2 + 0] = s4_0; v2[(e + 4) * 2 + 1] = s4_1;
            v2[(e + 5) * 2 + 0] = s5_0; v2[(e + 5) * 2 + 1] = s5_1;
            v2[(e + 6) * 2 + 0] = s6_0; v2[(e + 6) * 2 + 1] = s6_1;
            v2[(e + 7) * 2 + 0] = s7_0; v2[(e + 7) * 2 + 1] = s7_1;
        }

        /* %4 to %50: elementwise on 20 numbers */
        for (int e = 0; e < filled; ++e) {
            for (int j = 0; j < 2; ++j) {
                float16 t4 = v2[e * 2 + j] * (float16)(0.318309873f);
                float16 t6 = t4 + (float16)(0.5f);
                float16 t7 = FLOOR(t6);
                float16 t9 = t7 * (float16)(3.14160156f);
                float16 t10 = v2[e * 2 + j] - t9;
                float16 t12 = t7 * (float16)(-8.9071691e-06f);
                float16 t13 = t10 - t12;
                float16 t15 = t7 * (float16)(-1.74122761e-09f);
                float16 t16 = t13 - t15;
                float16 t17 = (float16)(0.5f) * t7;
                float16 t18 = FLOOR(t17);
                float16 t20 = (float16)(2.0f) * t18;
                float16 t21 = t7 - t20;
                float16 t22 = (float16)(2.0f) * t21;
                float16 t24 = (float16)(1.0f) - t22;
                float16 t25 = t16 * t16;
                float16 t27 = t25 * (float16)(-2.51969432e-08f);
                float16 t29 = t27 + (float16)(2.76094511e-06f);
                float16 t30 = t25 * t29;
                float16 t32 = t30 + (float16)(-0.000198427704f);
                float16 t33 = t25 * t32;
                float16 t35 = t33 + (float16)(0.00833334867f);
                float16 t36 = t25 * t35;
                float16 t38 = t36 + (float16)(-0.166666672f);
                float16 t39 = t25 * t38;
                float16 t40 = t16 * t39;
                float16 t41 = t16 + t40;
                float16 t42 = t24 * t41;
                float16 t43 = (float16)(1.0f) < t42 ? (float16)(1.0f) : t42;
                float16 t45 = (float16)(-1.0f) > t43 ? (float16)(-1.0f) : t43;
                float16 t46 = as_float16(as_int16(v2[e * 2 + j]) & 0x7fffffff);
                int16 t48 = t46 <= (float16)(12800.0f);
                float16 t49 = v2[e * 2 + j] - v2[e * 2 + j];
                float16 t50 = t48 ? t45 : t49;
                v50[e * 2 + j] = t50;
            }
        }

        /* %51: affine map W1 from 20 to 3 */
        for (int e = 0; e < filled; e += 8) {
            __global const float *x0 = (__global const float *)(v50 + (e + 0) * 2);
            float16 s0_0 = theta[46];
            __global const float *x1 = (__global const float *)(v50 + (e + 1) * 2);
            float16 s1_0 = theta[46];
            __global const float *x2 = (__global const float *)(v50 + (e + 2) * 2);
            float16 s2_0 = theta[46];
            __global const float *x3 = (__global const float *)(v50 + (e + 3) * 2);
            float16 s3_0 = theta[46];
            __global const float *x4 = (__global const float *)(v50 + (e + 4) * 2);
            float16 s4_0 = theta[46];
            __global const float *x5 = (__global const float *)(v50 + (e + 5) * 2);
            float16 s5_0 = theta[46];
            __global const float *x6 = (__global const float *)(v50 + (e + 6) * 2);
            float16 s6_0 = theta[46];
            __global const float *x7 = (__global const float *)(v50 + (e + 7) * 2);
            float16 s7_0 = theta[46];
            __global const float16 *w = theta + 26;
            for (int i = 0; i < 20; ++i) {
                const float16 w0 = w[0];
                w += 1;
                s0_0 += w0 * x0[i];
                s1_0 += w0 * x1[i];
                s2_0 += w0 * x2[i];
                s3_0 += w0 * x3[i];
                s4_0 += w0 * x4[i];
                s5_0 += w0 * x5[i];
                s6_0 += w0 * x6[i];
                s7_0 += w0 * x7[i];
            }
            v51[(e + 0) * 1 + 0] = s0_0;
            v51[(e + 1) * 1 + 0] = s1_0;
            v51[(e + 2) * 1 + 0] = s2_0;
            v51[(e + 3) * 1 + 0] = s3_0;
            v51[(e + 4) * 1 + 0] = s4_0;
            v51[(e + 5) * 1 + 0] = s5_0;
            v51[(e + 6) * 1 + 0] = s6_0;
            v51[(e + 7) * 1 + 0] = s7_0;
        }

        /* %52 to %55: elementwise on 3 numbers */
        for (int e = 0; e < filled; ++e) {
            for (int j = 0; j < 1; ++j) {
                float16 t52 = v51[e * 1 + j] - v1[e * 1 + j];
                float16 t53 = t52 * t52;
                v53[e * 1 + j] = t53;
                float16 t55 = t52 * (float16)(0.166666672f);
                v55[e * 1 + j] = t55;
            }
        }

        /* %56: affine map W1.T from 3 to 20 */
        for (int e = 0; e < filled; e += 8) {
            __global const float *x0 = (__global const float *)(v55 + (e + 0) * 1);
            float16 s0_0 = (float16)(0.0f), s0_1 = (float16)(0.0f);
            __global const float *x1 = (__global const float *)(v55 + (e + 1) * 1);
            float16 s1_0 = (float16)(0.0f), s1_1 = (float16)(0.0f);
            __global const float *x2 = (__global const float *)(v55 + (e + 2) * 1);
            float16 s2_0 = (float16)(0.0f), s2_1 = (float16)(0.0f);
            __global const float *x3 = (__global const float *)(v55 + (e + 3) * 1);
            float16 s3_0 = (float16)(0.0f), s3_1 = (float16)(0.0f);
            __global const float *x4 = (__global const float *)(v55 + (e + 4) * 1);
            float16 s4_0 = (float16)(0.0f), s4_1 = (float16)(0.0f);
            __global const float *x5 = (__global const float *)(v55 + (e + 5) * 1);
            float16 s5_0 = (float16)(0.0f), s5_1 = (float16)(0.0f);
            __global const float *x6 = (__global const float *)(v55 + (e + 6) * 1);
            float16 s6_0 = (float16)(0.0f), s6_1 = (float16)(0.0f);
            __global const float *x7 = (__global const float *)(v55 + (e + 7) * 1);
            float16 s7_0 = (float16)(0.0f), s7_1 = (float16)(0.0f);
            __global const float16 *w = transposed + 0;
            for (int i = 0; i < 3; ++i) {
                const float16 w0 = w[0], w1 = w[1];
                w += 2;
                s0_0 += w0 * x0[i]; s0_1 += w1 * x0[i];
                s1_0 += w0 * x1[i]; s1_1 += w1 * x1[i];
                s2_0 += w0 * x2[i]; s2_1 += w1 * x2[i];
                s3_0 += w0 * x3[i]; s3_1 += w1 * x3[i];
                s4_0 += w0 * x4[i]; s4_1 += w1 * x4[i];
                s5_0 += w0 * x5[i]; s5_1 += w1 * x5[i];
                s6_0 += w0 * x6[i]; s6_1 += w1 * x6[i];
                s7_0 += w0 * x7[i]; s7_1 += w1 * x7[i];
            }
            v56[(e + 0) * 2 + 0] = s0_0; v56[(e + 0) * 2 + 1] = s0_1;
            v56[(e + 1) * 2 + 0] = s1_0; v56[(e + 1) * 2 + 1] = s1_1;
            v56[(e + 2) * 2 + 0] = s2_0; v56[(e + 2) * 2 + 1] = s2_1;
            v56[(e + 3) * 2 + 0] = s3_0; v56[(e + 3) * 2 + 1] = s3_1;
            v56[(e + 4) * 2 + 0] = s4_0; v56[(e + 4) * 2 + 1] = s4_1;
            v56[(e + 5) * 2 + 0] = s5_0; v56[(e + 5) * 2 + 1] = s5_1;
            v56[(e + 6) * 2 + 0] = s6_0; v56[(e + 6) * 2 + 1] = s6_1;
            v56[(e + 7) * 2 + 0] = s7_0; v56[(e + 7) * 2 + 1] = s7_1;
        }

        /* %57 to %90: elementwise on 20 numbers */
        for (int e = 0; e < filled; ++e) {
            for (int j = 0; j < 2; ++j) {
                float16 t57 = (v2[e * 2 + j] * (float16)(0.318309873f)) + (float16)(1.0f);
                float16 t58 = FLOOR(t57);
                float16 t59 = t58 - (float16)(0.5f);
                float16 t60 = t59 * (float16)(3.14160156f);
                float16 t61 = v2[e * 2 + j] - t60;
                float16 t62 = t59 * (float16)(-8.9071691e-06f);
                float16 t63 = t61 - t62;
                float16 t64 = t59 * (float16)(-1.74122761e-09f);
                float16 t65 = t63 - t64;
                float16 t66 = (float16)(0.5f) * t58;
                float16 t67 = FLOOR(t66);
                float16 t68 = (float16)(2.0f) * t67;
                float16 t69 = t58 - t68;
                float16 t70 = (float16)(2.0f) * t69;
                float16 t71 = (float16)(1.0f) - t70;
                float16 t72 = t65 * t65;
                float16 t73 = t72 * (float16)(-2.51969432e-08f);
                float16 t74 = t73 + (float16)(2.76094511e-06f);
                float16 t75 = t72 * t74;
                float16 t76 = t75 + (float16)(-0.000198427704f);
                float16 t77 = t72 * t76;
                float16 t78 = t77 + (float16)(0.00833334867f);
                float16 t79 = t72 * t78;
                float16 t80 = t79 + (float16)(-0.166666672f);
                float16 t81 = t72 * t80;
                float16 t82 = t65 * t81;
                float16 t83 = t65 + t82;
                float16 t84 = t71 * t83;
                float16 t85 = (float16)(1.0f) < t84 ? (float16)(1.0f) : t84;
                float16 t86 = (float16)(-1.0f) > t85 ? (float16)(-1.0f) : t85;
                int16 t88 = (as_float16(as_int16(v2[e * 2 + j]) & 0x7fffffff)) <= (float16)(6400.0f);
                float16 t89 = t88 ? t86 : (v2[e * 2 + j] - v2[e * 2 + j]);
                float16 t90 = v56[e * 2 + j] * t89;
                v90[e * 2 + j] = t90;
            }
        }

        /* sum of %53: squares */
        {
            __global float16 *out = sums + 47 + 0;
            float16 s0_0 = begins ? (float16)(0.0f) : out[0];
            for (int n = 0; n < count; ++n) {
                const float16 d0 = v53[n * 1 + 0];
                s0_0 += d0;
            }
            s0_0.s3 = s0_0.s4 = s0_0.s5 = s0_0.s6 = s0_0.s7 = s0_0.s8 = s0_0.s9 = s0_0.sa = s0_0.sb = s0_0.sc = s0_0.sd = s0_0.se = s0_0.sf = 0.0f; out[0] = s0_0;
        }

        /* sum of %90 x %0: W0 */
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            {
                const int k = 0;
                {
                    __global float16 *out = sums + 0 + (dy * WINDOW_RUN + k) * 2;
                    float16 s0_0 = begins ? (float16)(0.0f) : out[0];
                    float16 s0_1 = begins ? (float16)(0.0f) : out[1];
                    float16 s1_0 = begins ? (float16)(0.0f) : out[2];
                    float16 s1_1 = begins ? (float16)(0.0f) : out[3];
                    float16 s2_0 = begins ? (float16)(0.0f) : out[4];
                    float16 s2_1 = begins ? (float16)(0.0f) : out[5];
                    float16 s3_0 = begins ? (float16)(0.0f) : out[6];
                    float16 s3_1 = begins ? (float16)(0.0f) : out[7];
                    float16 s4_0 = begins ? (float16)(0.0f) : out[8];
                    float16 s4_1 = begins ? (float16)(0.0f) : out[9];
                    float16 s5_0 = begins ? (float16)(0.0f) : out[10];
                    float16 s5_1 = begins ? (float16)(0.0f) : out[11];
                    for (int n = 0; n < count; ++n) {
                        __global const float *x = values + corner[n] + dy * row[n] + k;
                        const float16 d0 = v90[n * 2 + 0];
                        const float16 d1 = v90[n * 2 + 1];
                        s0_0 += d0 * x[0]; s0_1 += d1 * x[0];
                        s1_0 += d0 * x[1]; s1_1 += d1 * x[1];
                        s2_0 += d0 * x[2]; s2_1 += d1 * x[2];
                        s3_0 += d0 * x[3]; s3_1 += d1 * x[3];
                        s4_0 += d0 * x[4]; s4_1 += d1 * x[4];
                        s5_0 += d0 * x[5]; s5_1 += d1 * x[5];
                    }
                    out[0] = s0_0;
                    s0_1.s4 = s0_1.s5 = s0_1.s6 = s0_1.s7 = s0_1.s8 = s0_1.s9 = s0_1.sa = s0_1.sb = s0_1.sc = s0_1.sd = s0_1.se = s0_1.sf = 0.0f; out[1] = s0_1;
                    out[2] = s1_0;
                    s1_1.s4 = s1_1.s5 = s1_1.s6 = s1_1.s7 = s1_1.s8 = s1_1.s9 = s1_1.sa = s1_1.sb = s1_1.sc = s1_1.sd = s1_1.se = s1_1.sf = 0.0f; out[3] = s1_1;
                    out[4] = s2_0;
                    s2_1.s4 = s2_1.s5 = s2_1.s6 = s2_1.s7 = s2_1.s8 = s2_1.s9 = s2_1.sa = s2_1.sb = s2_1.sc = s2_1.sd = s2_1.se = s2_1.sf = 0.0f; out[5] = s2_1;
                    out[6] = s3_0;
                    s3_1.s4 = s3_1.s5 = s3_1.s6 = s3_1.s7 = s3_1.s8 = s3_1.s9 = s3_1.sa = s3_1.sb = s3_1.sc = s3_1.sd = s3_1.se = s3_1.sf = 0.0f; out[7] = s3_1;
                    out[8] = s4_0;
                    s4_1.s4 = s4_1.s5 = s4_1.s6 = s4_1.s7 = s4_1.s8 = s4_1.s9 = s4_1.sa = s4_1.sb = s4_1.sc = s4_1.sd = s4_1.se = s4_1.sf = 0.0f; out[9] = s4_1;
                    out[10] = s5_0;
                    s5_1.s4 = s5_1.s5 = s5_1.s6 = s5_1.s7 = s5_1.s8 = s5_1.s9 = s5_1.sa = s5_1.sb = s5_1.sc = s5_1.sd = s5_1.se = s5_1.sf = 0.0f; out[11] = s5_1;
                }
            }
        }

        /* sum of %90: b0 */
        {
            __global float16 *out = sums + 24 + 0;
            float16 s0_0 = begins ? (float16)(0.0f) : out[0];
            for (int n = 0; n < count; ++n) {
                const float16 d0 = v90[n * 2 + 0];
                s0_0 += d0;
            }
            out[0] = s0_0;
        }
        {
            __global float16 *out = sums + 24 + 0;
            float16 s0_1 = begins ? (float16)(0.0f) : out[1];
            for (int n = 0; n < count; ++n) {
                const float16 d1 = v90[n * 2 + 1];
                s0_1 += d1;
            }
            s0_1.s4 = s0_1.s5 = s0_1.s6 = s0_1.s7 = s0_1.s8 = s0_1.s9 = s0_1.sa = s0_1.sb = s0_1.sc = s0_1.sd = s0_1.se = s0_1.sf = 0.0f; out[1] = s0_1;
        }

        /* sum of %55 x %50: W1 */
        for (int k = 0; k < 12; k += 12) {
            {
                __global float16 *out = sums + 26 + (k) * 1;
                float16 s0_0 = begins ? (float16)(0.0f) : out[0];
                float16 s1_0 = begins ? (float16)(0.0f) : out[1];
                float16 s2_0 = begins ? (float16)(0.0f) : out[2];
                float16 s3_0 = begins ? (float16)(0.0f) : out[3];
                float16 s4_0 = begins ? (float16)(0.0f) : out[4];
                float16 s5_0 = begins ? (float16)(0.0f) : out[5];
                float16 s6_0 = begins ? (float16)(0.0f) : out[6];
                float16 s7_0 = begins ? (float16)(0.0f) : out[7];
                float16 s8_0 = begins ? (float16)(0.0f) : out[8];
                float16 s9_0 = begins ? (float16)(0.0f) : out[9];
                float16 s10_0 = begins ? (float16)(0.0f) : out[10];
                float16 s11_0 = begins ? (float16)(0.0f) : out[11];
                for (int n = 0; n < count; ++n) {
                    __global const float *x = (__global const float *)(v50 + n * 2) + k;
                    const float16 d0 = v55[n * 1 + 0];
                    s0_0 += d0 * x[0];
                    s1_0 += d0 * x[1];
                    s2_0 += d0 * x[2];
                    s3_0 += d0 * x[3];
                    s4_0 += d0 * x[4];
                    s5_0 += d0 * x[5];
                    s6_0 += d0 * x[6];
                    s7_0 += d0 * x[7];
                    s8_0 += d0 * x[8];
                    s9_0 += d0 * x[9];
                    s10_0 += d0 * x[10];
                    s11_0 += d0 * x[11];
                }
                s0_0.s3 = s0_0.s4 = s0_0.s5 = s0_0.s6 = s0_0.s7 = s0_0.s8 = s0_0.s9 = s0_0.sa = s0_0.sb = s0_0.sc = s0_0.sd = s0_0.se = s0_0.sf = 0.0f; out[0] = s0_0;
                s1_0.s3 = s1_0.s4 = s1_0.s5 = s1_0.s6 = s1_0.s7 = s1_0.s8 = s1_0.s9 = s1_0.sa = s1_0.sb = s1_0.sc = s1_0.sd = s1_0.se = s1_0.sf = 0.0f; out[1] = s1_0;
                s2_0.s3 = s2_0.s4 = s2_0.s5 = s2_0.s6 = s2_0.s7 = s2_0.s8 = s2_0.s9 = s2_0.sa = s2_0.sb = s2_0.sc = s2_0.sd = s2_0.se = s2_0.sf = 0.0f; out[2] = s2_0;
                s3_0.s3 = s3_0.s4 = s3_0.s5 = s3_0.s6 = s3_0.s7 = s3_0.s8 = s3_0.s9 = s3_0.sa = s3_0.sb = s3_0.sc = s3_0.sd = s3_0.se = s3_0.sf = 0.0f; out[3] = s3_0;
                s4_0.s3 = s4_0.s4 = s4_0.s5 = s4_0.s6 = s4_0.s7 = s4_0.s8 = s4_0.s9 = s4_0.sa = s4_0.sb = s4_0.sc = s4_0.sd = s4_0.se = s4_0.sf = 0.0f; out[4] = s4_0;
                s5_0.s3 = s5_0.s4 = s5_0.s5 = s5_0.s6 = s5_0.s7 = s5_0.s8 = s5_0.s9 = s5_0.sa = s5_0.sb = s5_0.sc = s5_0.sd = s5_0.se = s5_0.sf = 0.0f; out[5] = s5_0;
                s6_0.s3 = s6_0.s4 = s6_0.s5 = s6_0.s6 = s6_0.s7 = s6_0.s8 = s6_0.s9 = s6_0.sa = s6_0.sb = s6_0.sc = s6_0.sd = s6_0.se = s6_0.sf = 0.0f; out[6] = s6_0;
                s7_0.s3 = s7_0.s4 = s7_0.s5 = s7_0.s6 = s7_0.s7 = s7_0.s8 = s7_0.s9 = s7_0.sa = s7_0.sb = s7_0.sc = s7_0.sd = s7_0.se = s7_0.sf = 0.0f; out[7] = s7_0;
                s8_0.s3 = s8_0.s4 = s8_0.s5 = s8_0.s6 = s8_0.s7 = s8_0.s8 = s8_0.s9 = s8_0.sa = s8_0.sb = s8_0.sc = s8_0.sd = s8_0.se = s8_0.sf = 0.0f; out[8] = s8_0;
                s9_0.s3 = s9_0.s4 = s9_0.s5 = s9_0.s6 = s9_0.s7 = s9_0.s8 = s9_0.s9 = s9_0.sa = s9_0.sb = s9_0.sc = s9_0.sd = s9_0.se = s9_0.sf = 0.0f; out[9] = s9_0;
                s10_0.s3 = s10_0.s4 = s10_0.s5 = s10_0.s6 = s10_0.s7 = s10_0.s8 = s10_0.s9 = s10_0.sa = s10_0.sb = s10_0.sc = s10_0.sd = s10_0.se = s10_0.sf = 0.0f; out[10] = s10_0;
                s11_0.s3 = s11_0.s4 = s11_0.s5 = s11_0.s6 = s11_0.s7 = s11_0.s8 = s11_0.s9 = s11_0.sa = s11_0.sb = s11_0.sc = s11_0.sd = s11_0.se = s11_0.sf = 0.0f; out[11] = s11_0;
            }
        }
        {
            const int k = 12;
            {
                __global float16 *out = sums + 26 + (k) * 1;
                float16 s0_0 = begins ? (float16)(0.0f) : out[0];
                float16 s1_0 = begins ? (float16)(0.0f) : out[1];
                float16 s2_0 = begins ? (float16)(0.0f) : out[2];
                float16 s3_0 = begins ? (float16)(0.0f) : out[3];
                float16 s4_0 = begins ? (float16)(0.0f) : out[4];
                float16 s5_0 = begins ? (float16)(0.0f) : out[5];
                float16 s6_0 = begins ? (float16)(0.0f) : out[6];
                float16 s7_0 = begins ? (float16)(0.0f) : out[7];
                for (int n = 0; n < count; ++n) {
                    __global const float *x = (__global const float *)(v50 + n * 2) + k;
                    const float16 d0 = v55[n * 1 + 0];
                    s0_0 += d0 * x[0];
                    s1_0 += d0 * x[1];
                    s2_0 += d0 * x[2];
                    s3_0 += d0 * x[3];
                    s4_0 += d0 * x[4];
                    s5_0 += d0 * x[5];
                    s6_0 += d0 * x[6];
                    s7_0 += d0 * x[7];
                }
                s0_0.s3 = s0_0.s4 = s0_0.s5 = s0_0.s6 = s0_0.s7 = s0_0.s8 = s0_0.s9 = s0_0.sa = s0_0.sb = s0_0.sc = s0_0.sd = s0_0.se = s0_0.sf = 0.0f; out[0] = s0_0;
                s1_0.s3 = s1_0.s4 = s1_0.s5 = s1_0.s6 = s1_0.s7 = s1_0.s8 = s1_0.s9 = s1_0.sa = s1_0.sb = s1_0.sc = s1_0.sd = s1_0.se = s1_0.sf = 0.0f; out[1] = s1_0;
                s2_0.s3 = s2_0.s4 = s2_0.s5 = s2_0.s6 = s2_0.s7 = s2_0.s8 = s2_0.s9 = s2_0.sa = s2_0.sb = s2_0.sc = s2_0.sd = s2_0.se = s2_0.sf = 0.0f; out[2] = s2_0;
                s3_0.s3 = s3_0.s4 = s3_0.s5 = s3_0.s6 = s3_0.s7 = s3_0.s8 = s3_0.s9 = s3_0.sa = s3_0.sb = s3_0.sc = s3_0.sd = s3_0.se = s3_0.sf = 0.0f; out[3] = s3_0;
                s4_0.s3 = s4_0.s4 = s4_0.s5 = s4_0.s6 = s4_0.s7 = s4_0.s8 = s4_0.s9 = s4_0.sa = s4_0.sb = s4_0.sc = s4_0.sd = s4_0.se = s4_0.sf = 0.0f; out[4] = s4_0;
                s5_0.s3 = s5_0.s4 = s5_0.s5 = s5_0.s6 = s5_0.s7 = s5_0.s8 = s5_0.s9 = s5_0.sa = s5_0.sb = s5_0.sc = s5_0.sd = s5_0.se = s5_0.sf = 0.0f; out[5] = s5_0;
                s6_0.s3 = s6_0.s4 = s6_0.s5 = s6_0.s6 = s6_0.s7 = s6_0.s8 = s6_0.s9 = s6_0.sa = s6_0.sb = s6_0.sc = s6_0.sd = s6_0.se = s6_0.sf = 0.0f; out[6] = s6_0;
                s7_0.s3 = s7_0.s4 = s7_0.s5 = s7_0.s6 = s7_0.s7 = s7_0.s8 = s7_0.s9 = s7_0.sa = s7_0.sb = s7_0.sc = s7_0.sd = s7_0.se = s7_0.sf = 0.0f; out[7] = s7_0;
            }
        }

        /* sum of %55: b1 */
        {
            __global float16 *out = sums + 46 + 0;
            float16 s0_0 = begins ? (float16)(0.0f) : out[0];
            for (int n = 0; n < count; ++n) {
                const float16 d0 = v55[n * 1 + 0];
                s0_0 += d0;
            }
            s0_0.s3 = s0_0.s4 = s0_0.s5 = s0_0.s6 = s0_0.s7 = s0_0.s8 = s0_0.s9 = s0_0.sa = s0_0.sb = s0_0.sc = s0_0.sd = s0_0.se = s0_0.sf = 0.0f; out[0] = s0_0;
        }
    }
}

__kernel void wamnet_update(
    __global const float16 *restrict sums,
    int groups,
    __global const float16 *restrict old,
    __global float16 *restrict moved,
    __global float *restrict transposed,
    __global float *restrict losses,
    __global int *restrict failed,
    int at,
    int step,
    float learning_rate_number,
    float grown_1_number,
    float grown_2_number)
{
    const int i = (int)get_global_id(0);
    if (i >= COUNT || failed[0] >= 0) {
        return;
    }
    /* The loss: every work item adds the same numbers in the same order. */
    float loss = 0.0f;
    for (int j = 0; j < SUMS - COUNT; ++j) {
        float16 squares = sums[COUNT + j];
        for (int n = 1; n < groups; ++n) {
            squares += sums[n * SUMS + COUNT + j];
        }
        const float8 s8 = squares.lo + squares.hi;
        const float4 s4 = s8.lo + s8.hi;
        loss += s4.s0 + s4.s1 + s4.s2 + s4.s3;
    }
    loss /= LOSS_TERMS;
    if (i == 0) {
        losses[at] = loss;
    }
    if ((as_int(loss) & 0x7f800000) == 0x7f800000) {
        if (i == 0) {
            failed[0] = step;
        }
        return;
    }
    float16 g = sums[i];
    for (int n = 1; n < groups; ++n) {
        g += sums[n * SUMS + i];
    }
    const float16 theta = old[i], m = old[COUNT + i], v = old[2 * COUNT + i];
    const float16 learning_rate = learning_rate_number, grown_1 = grown_1_number, grown_2 = grown_2_number;
    const float16 t8 = (float16)(0.899999976f) * m;
    const float16 t10 = (float16)(0.100000001f) * g;
    const float16 t11 = t8 + t10;
    const float16 t13 = (float16)(0.999000013f) * v;
    const float16 t14 = g * g;
    const float16 t16 = (float16)(0.00100000005f) * t14;
    const float16 t17 = t13 + t16;
    const float16 t18 = t11 / grown_1;
    const float16 t19 = t17 / grown_2;
    const float16 t20 = learning_rate * t18;
    const float16 t21 = sqrt(t19);
    const float16 t23 = t21 + (float16)(9.99999994e-09f);
    const float16 t24 = t20 / t23;
    const float16 t25 = theta - t24;
    moved[0 * COUNT + i] = t25;
    moved[1 * COUNT + i] = t11;
    moved[2 * COUNT + i] = t17;
    if (i >= 26 && i < 46) { /* W1.T */
        const int at_row = (i - 26) / 1;
        const int neuron = (i - 26) % 1 * 16;
        if (neuron + 0 < 3) transposed[(0 + (neuron + 0) * 2) * 16 + at_row] = t25.s0;
        if (neuron + 1 < 3) transposed[(0 + (neuron + 1) * 2) * 16 + at_row] = t25.s1;
        if (neuron + 2 < 3) transposed[(0 + (neuron + 2) * 2) * 16 + at_row] = t25.s2;
        if (neuron + 3 < 3) transposed[(0 + (neuron + 3) * 2) * 16 + at_row] = t25.s3;
        if (neuron + 4 < 3) transposed[(0 + (neuron + 4) * 2) * 16 + at_row] = t25.s4;
        if (neuron + 5 < 3) transposed[(0 + (neuron + 5) * 2) * 16 + at_row] = t25.s5;
        if (neuron + 6 < 3) transposed[(0 + (neuron + 6) * 2) * 16 + at_row] = t25.s6;
        if (neuron + 7 < 3) transposed[(0 + (neuron + 7) * 2) * 16 + at_row] = t25.s7;
        if (neuron + 8 < 3) transposed[(0 + (neuron + 8) * 2) * 16 + at_row] = t25.s8;
        if (neuron + 9 < 3) transposed[(0 + (neuron + 9) * 2) * 16 + at_row] = t25.s9;
        if (neuron + 10 < 3) transposed[(0 + (neuron + 10) * 2) * 16 + at_row] = t25.sa;
        if (neuron + 11 < 3) transposed[(0 + (neuron + 11) * 2) * 16 + at_row] = t25.sb;
        if (neuron + 12 < 3) transposed[(0 + (neuron + 12) * 2) * 16 + at_row] = t25.sc;
        if (neuron + 13 < 3) transposed[(0 + (neuron + 13) * 2) * 16 + at_row] = t25.sd;
        if (neuron + 14 < 3) transposed[(0 + (neuron + 14) * 2) * 16 + at_row] = t25.se;
        if (neuron + 15 < 3) transposed[(0 + (neuron + 15) * 2) * 16 + at_row] = t25.sf;
    }
}
