/*
 * a tiny kernel
 */
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
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define PIXELS 2 /* neighbours in a row that a work item computes */
#define LANES 4 /* components of a vector */
#define PATCH_WIDTH (WINDOW_SIZE + PIXELS - 1) /* columns that all windows touch */
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
    __global const int4 *w = (__global const int4 *)weights;

    /* the images around the pixels: what lies beyond the border is filled in here */
    uchar patch_a[WINDOW_SIZE * PATCH_WIDTH * 3 + 3];
    uchar patch_b[WINDOW_SIZE * PATCH_WIDTH + 3];
    int left = x - WINDOW_CENTRE;
    int top = y - WINDOW_CENTRE;
    bool within = 0 <= left && left + PATCH_WIDTH <= width && 0 <= top && top + WINDOW_SIZE <= height;
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(top + dy, 0, height - 1);
        if (within) {
            for (int i = 0; i < PATCH_WIDTH * 3; ++i) {
                patch_a[dy * PATCH_WIDTH * 3 + i] = (uchar)((int)image_a[(row * width + left) * 3 + i] + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 3; ++c) {
                    patch_a[dy * PATCH_WIDTH * 3 + dx * 3 + c] = (uchar)((int)(inside ? image_a[(row * width + column) * 3 + c] : 0.0f) + 128);
                }
            }
        }
        if (within) {
            for (int i = 0; i < PATCH_WIDTH; ++i) {
                patch_b[dy * PATCH_WIDTH + i] = (uchar)((int)image_b[(row * width + left) * 1 + i] + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 1; ++c) {
                    patch_b[dy * PATCH_WIDTH + dx + c] = (uchar)((int)(inside ? image_b[(row * width + column) * 1 + c] : 0.0f) + 128);
                }
            }
        }
    }
    for (int i = 0; i < 3; ++i) {
        patch_a[WINDOW_SIZE * PATCH_WIDTH * 3 + i] = 0;
    }
    for (int i = 0; i < 3; ++i) {
        patch_b[WINDOW_SIZE * PATCH_WIDTH + i] = 0;
    }

    /* %1: affine map W0 from 16 to 3 */
    float4 v1[PIXELS];
    {
        int4 sum[PIXELS][1];
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = w[6];
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            for (int i = 0; i < 2; ++i) {
                int4 w0 = w[dy * 2 + i];
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(patch_a + (dy * PATCH_WIDTH + p) * 3 + 4 * i))->bytes);
                }
            }
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            for (int i = 0; i < 1; ++i) {
                int4 w0 = w[dy + 4 + i];
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(patch_b + dy * PATCH_WIDTH + p + 4 * i))->bytes);
                }
            }
        }
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            v1[p] = CONVERT(sum[p][0], float4);
        }
    }

    /* %2 to %49: elementwise on 3 numbers */
    union { float4 all[PIXELS]; float number[PIXELS * 4]; } v49;
    for (int i = 0; i < PIXELS; ++i) {
        int4 t2 = CONVERT(v1[i], int4);
        uint4 t3 = CONVERT(t2, uint4);
        uint4 t5 = CONVERT(as_float4(w[7 + i % 1]), uint4);
        uint4 t8 = CONVERT(as_float4(w[8 + i % 1]), uint4);
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
        uint4 t39 = (uint4)(127u) < t37 ? (uint4)(127u) : t37;
        float4 t40 = CONVERT(t39, float4);
        uint4 t42 = t9 >> 23u;
        uint4 t43 = t42 & 1u;
        float4 t44 = CONVERT(t43, float4);
        float4 t48 = 1.0f - 2.0f * t44;
        float4 t49 = t40 * t48;
        v49.all[i] = t49;
    }

    /* %50: affine map W1 from 3 to 3 */
    float4 v50[PIXELS];
    {
        int4 sum[PIXELS][1];
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = w[10];
        }
        uchar bytes49[PIXELS * LANES];
        for (int i = 0; i < PIXELS * LANES; ++i) {
            bytes49[i] = (uchar)((int)v49.number[i] + 128);
        }
        for (int i = 0; i < 1; ++i) {
            int4 w0 = w[9 + i];
            #pragma unroll
            for (int p = 0; p < PIXELS; ++p) {
                sum[p][0] = DOT(sum[p][0], w0, ((const fours *)(bytes49 + p * LANES + 4 * i))->bytes);
            }
        }
        #pragma unroll
        for (int p = 0; p < PIXELS; ++p) {
            v50[p] = CONVERT(sum[p][0], float4);
        }
    }

    /* %51 to %67: elementwise on 3 numbers */
    union { float4 all[PIXELS]; float number[PIXELS * 4]; } v67;
    for (int i = 0; i < PIXELS; ++i) {
        int4 t51 = CONVERT(v50[i], int4);
        int4 t53 = CONVERT(as_float4(w[11 + i % 1]), int4);
        int4 t56 = CONVERT(as_float4(w[12 + i % 1]), int4);
        int4 t57 = t51 * t53 + t56;
        int4 t59 = (int4)(0) > t57 ? (int4)(0) : t57;
        int4 t61 = (int4)(16777216) < t59 ? (int4)(16777216) : t59;
        uint4 t62 = CONVERT(t61, uint4);
        uint4 t64 = t62 >> 8u;
        float4 t65 = CONVERT(t64, float4);
        float4 t67 = t65 * 1.52587891e-05f;
        v67.all[i] = t67;
    }

    /* output color */
    for (int p = 0; p < PIXELS && x + p < width; ++p) {
        for (int i = 0; i < 3; ++i) {
            result[(y * width + x + p) * 3 + i] = v67.number[p * LANES + i];
        }
    }
}
