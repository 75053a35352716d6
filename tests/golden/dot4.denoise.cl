/*
 * a tiny kernel
 */
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define LEAST(kind, a, b) ((kind)(b) < (kind)(a) ? (kind)(b) : (kind)(a))
#define MOST(kind, a, b) ((kind)(b) > (kind)(a) ? (kind)(b) : (kind)(a))
#ifdef __has_builtin
#if __has_builtin(__builtin_convertvector)
#define CONVERT(a, kind) __builtin_convertvector(a, kind)
#endif
#endif
#ifndef CONVERT
#define vector float4
#define CONVERT(a, kind) CONVERTED(a, kind)
#define CONVERTED(a, kind) convert_##kind(a)
#endif
#define PIXELS 2 /* neighbours in a row that a work item computes */
#define LANES 4 /* numbers in a vector */
#define PATCH_WIDTH (WINDOW_SIZE + PIXELS - 1) /* columns that all windows touch */
typedef float4 vector;
typedef int4 mask;
#define MINIMUM(a, b) ((vector)(b) < (vector)(a) ? (vector)(b) : (vector)(a))
#define MAXIMUM(a, b) ((vector)(b) > (vector)(a) ? (vector)(b) : (vector)(a))
#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(a) __builtin_elementwise_floor(a)
#endif
#endif
#ifndef FLOOR
#define FLOOR(a) floor(a)
#endif
typedef int4 sums;
typedef struct __attribute__((packed)) { uchar4 bytes; } fours; /* at any address */
#ifdef __has_builtin
#if defined(__AVX512VNNI__) && LANES == 16 && __has_builtin(__builtin_ia32_vpdpbusd512)
#define DOT(sum, weight, four) __builtin_ia32_vpdpbusd512(sum, (sums)(as_int(four)), weight)
#endif
#endif
#ifndef DOT
#define PRODUCT(weight, byte, shift) (((weight) << (sums)(shift) >> (sums)(24)) * (sums)((int)(byte)))
#define DOT(sum, weight, four) \
    ((sum) + PRODUCT(weight, (four).s0, 24) + PRODUCT(weight, (four).s1, 16) \
        + PRODUCT(weight, (four).s2, 8) + PRODUCT(weight, (four).s3, 0))
#endif
__kernel void wamnet_denoise(
    __global const float *restrict image_a,
    __global const float *restrict image_b,
    __global const float *restrict weights,
    __global float *restrict result,
    int width,
    int height)
{
    int x = (int)get_global_id(0) * PIXELS;
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {
        return;
    }

    /* the images around the pixels: what lies beyond the border is filled in here */
    uchar patch_a[WINDOW_SIZE * PATCH_WIDTH * 3 + 3];
    uchar patch_b[WINDOW_SIZE * PATCH_WIDTH * 1 + 3];
    int left = x - WINDOW_CENTRE;
    int top = y - WINDOW_CENTRE;
    bool within = left >= 0 && left + PATCH_WIDTH <= width && top >= 0 && top + WINDOW_SIZE <= height;
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(top + dy, 0, height - 1);
        uchar *to_a = patch_a + dy * PATCH_WIDTH * 3;
        if (within) {
            for (int i = 0; i < PATCH_WIDTH * 3; ++i) {
                to_a[i] = (uchar)((int)(image_a[(row * width + left) * 3 + i]) + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = clamp(left + dx, 0, width - 1);
                bool inside = row == y + dy - WINDOW_CENTRE && column == x + dx - WINDOW_CENTRE;
                for (int c = 0; c < 3; ++c) {
                    to_a[dx * 3 + c] = (uchar)((int)(inside ? image_a[(row * width + column) * 3 + c] : 0.0f) + 128);
                }
            }
        }
        uchar *to_b = patch_b + dy * PATCH_WIDTH * 1;
        if (within) {
            for (int i = 0; i < PATCH_WIDTH * 1; ++i) {
                to_b[i] = (uchar)((int)(image_b[(row * width + left) * 1 + i]) + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = clamp(left + dx, 0, width - 1);
                bool inside = row == y + dy - WINDOW_CENTRE && column == x + dx - WINDOW_CENTRE;
                for (int c = 0; c < 1; ++c) {
                    to_b[dx * 1 + c] = (uchar)((int)(inside ? image_b[(row * width + column) * 1 + c] : 0.0f) + 128);
                }
            }
        }
    }
    for (int i = 0; i < 3; ++i) {
        patch_a[WINDOW_SIZE * PATCH_WIDTH * 3 + i] = 0;
    }
    for (int i = 0; i < 3; ++i) {
        patch_b[WINDOW_SIZE * PATCH_WIDTH * 1 + i] = 0;
    }

    /* %1: affine map W0 from 16 to 3 */
    union { vector all[PIXELS * 1]; float number[PIXELS * 1 * LANES]; } v1;
    {
        __global const sums *w = ((__global const sums *)weights);
        sums sum[PIXELS][1];
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = ((__global const sums *)(weights + 24))[0];
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            const uchar *row = patch_a + dy * PATCH_WIDTH * 3;
            for (int i = 0; i < 2; ++i) {
                sums w0 = w[0];
                w += 1;
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(row + p * 3 + 4 * i))->bytes);
                }
            }
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            const uchar *row = patch_b + dy * PATCH_WIDTH * 1;
            for (int i = 0; i < 1; ++i) {
                sums w0 = w[0];
                w += 1;
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(row + p * 1 + 4 * i))->bytes);
                }
            }
        }
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            v1.all[p * 1 + 0] = CONVERT(sum[p][0], vector);
        }
    }

    /* %2 to %49: elementwise on 3 numbers */
    union { vector all[PIXELS * 1]; float number[PIXELS * 1 * LANES]; } v49;
    for (int i = 0; i < PIXELS * 1; ++i) {
        int4 t2 = CONVERT(v1.all[i], int4);
        uint4 t3 = CONVERT(t2, uint4);
        uint4 t5 = CONVERT(((__global const vector *)(weights + 28))[i % 1], uint4);
        uint4 t8 = CONVERT(((__global const vector *)(weights + 32))[i % 1], uint4);
        uint4 t9 = t3 * t5 + t8;
        uint4 t11 = t9 >> 22u;
        uint4 t13 = t11 & 1u;
        uint4 t15 = 0u - t13;
        uint4 t16 = t9 ^ t15;
        uint4 t18 = t16 >> 6u;
        uint4 t20 = t18 & 65535u;
        uint4 t21 = t20 * t20;
        uint4 t23 = t21 >> 16u;
        uint4 t25 = t23 * 2332u;
        uint4 t26 = t25 >> 16u;
        uint4 t28 = 20871u - t26;
        uint4 t29 = t23 * t28;
        uint4 t30 = t29 >> 16u;
        uint4 t32 = 51053u - t30;
        uint4 t35 = t20 * t32 + 8388608u;
        uint4 t37 = t35 >> 24u;
        uint4 t39 = LEAST(uint4, t37, 127u);
        vector t40 = CONVERT(t39, vector);
        uint4 t42 = t9 >> 23u;
        uint4 t43 = t42 & 1u;
        vector t44 = CONVERT(t43, vector);
        vector t48 = 1.0f - 2.0f * t44;
        vector t49 = t40 * t48;
        v49.all[i] = t49;
    }

    /* %50: affine map W1 from 3 to 3 */
    union { vector all[PIXELS * 1]; float number[PIXELS * 1 * LANES]; } v50;
    uchar bytes49[PIXELS * 1 * LANES];
    for (int i = 0; i < PIXELS * 1 * LANES; ++i) {
        bytes49[i] = (uchar)((int)(v49.number[i]) + 128);
    }
    {
        __global const sums *w = ((__global const sums *)(weights + 36));
        sums sum[PIXELS][1];
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = ((__global const sums *)(weights + 40))[0];
        }
        for (int i = 0; i < 1; ++i) {
            sums w0 = w[0];
            w += 1;
            #pragma unroll
            for (int p = 0; p < PIXELS; ++p) {
                sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(bytes49 + p * 1 * LANES + 4 * i))->bytes);
            }
        }
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            v50.all[p * 1 + 0] = CONVERT(sum[p][0], vector);
        }
    }

    /* %51 to %67: elementwise on 3 numbers */
    union { vector all[PIXELS * 1]; float number[PIXELS * 1 * LANES]; } v67;
    for (int i = 0; i < PIXELS * 1; ++i) {
        int4 t51 = CONVERT(v50.all[i], int4);
        int4 t53 = CONVERT(((__global const vector *)(weights + 44))[i % 1], int4);
        int4 t56 = CONVERT(((__global const vector *)(weights + 48))[i % 1], int4);
        int4 t57 = t51 * t53 + t56;
        int4 t59 = MOST(int4, t57, 0);
        int4 t61 = LEAST(int4, t59, 16777216);
        uint4 t62 = CONVERT(t61, uint4);
        uint4 t64 = t62 >> 8u;
        vector t65 = CONVERT(t64, vector);
        vector t67 = t65 * 1.52587891e-05f;
        v67.all[i] = t67;
    }

    /* output color */
    for (int p = 0; p < PIXELS && x + p < width; ++p) {
        for (int i = 0; i < 3; ++i) {
            result[(y * width + x + p) * 3 + i] = v67.number[p * 1 * LANES + i];
        }
    }
}
