/*
 * a tiny kernel
 */
#ifndef WAMNET_DENOISE_H
#define WAMNET_DENOISE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#if defined(__cplusplus)
#define restrict __restrict /* what compilers of C++ call it */
#endif
/* A product may be fused with a sum: the bound holds either way. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=fast")
#else
#pragma STDC FP_CONTRACT ON
#endif
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define PIXELS 2 /* neighbours in a row that a work item computes */
#define LANES 4 /* components of a vector */
#define PATCH_WIDTH (WINDOW_SIZE + PIXELS - 1) /* columns that all windows touch */
#if defined(__clang__)
#define WAMNET_UNROLL _Pragma("unroll")
#elif defined(__GNUC__) && __GNUC__ >= 8
/* GCC makes no vector instructions of floorf() while it has to raise the standard's exceptions, on which no
   number depends. Nor may it carry inputs over from one step to the next, in the registers of the sums. */
#pragma GCC optimize("no-trapping-math", "no-associative-math", "no-predictive-commoning")
#define WAMNET_UNROLL _Pragma("GCC unroll 16")
#define WAMNET_ROLLED _Pragma("GCC unroll 1")
#endif
#if !defined(WAMNET_UNROLL)
#define WAMNET_UNROLL
#endif
#if !defined(WAMNET_ROLLED)
#define WAMNET_ROLLED
#endif
#if LANES == 16 && defined(__AVX512VNNI__) && defined(__AVX512BW__) && !defined(WAMNET_PORTABLE)
#include <immintrin.h>
typedef __m512i wamnet_sums;
typedef __m512i wamnet_bytes;

static inline void wamnet_start(wamnet_sums *to, const float *from)
{
    *to = _mm512_loadu_si512(from);
}

static inline void wamnet_weights(wamnet_bytes *to, const float *from)
{
    *to = _mm512_loadu_si512(from);
}

static inline void wamnet_dot(wamnet_sums *sum, const wamnet_bytes *weight, const uint8_t *four)
{
    int32_t word;
    memcpy(&word, four, 4);
    *sum = _mm512_dpbusd_epi32(*sum, _mm512_set1_epi32(word), *weight);
}

static inline void wamnet_floats(float *to, const wamnet_sums *from)
{
    _mm512_storeu_ps(to, _mm512_cvtepi32_ps(*from));
}
#else
typedef struct {
    int32_t lane[LANES];
} wamnet_sums;
typedef struct {
    int8_t byte[4 * LANES];
} wamnet_bytes;

static inline void wamnet_start(wamnet_sums *to, const float *from)
{
    memcpy(to->lane, from, sizeof to->lane);
}

static inline void wamnet_weights(wamnet_bytes *to, const float *from)
{
    memcpy(to->byte, from, sizeof to->byte);
}

static inline void wamnet_dot(
    wamnet_sums *restrict sum,
    const wamnet_bytes *restrict weight,
    const uint8_t *restrict four)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        const int8_t *w = weight->byte + 4 * i;
        sum->lane[i] += four[0] * w[0] + four[1] * w[1] + four[2] * w[2] + four[3] * w[3];
    }
}

static inline void wamnet_floats(float *to, const wamnet_sums *from)
{
    WAMNET_ROLLED
    for (int i = 0; i < LANES; ++i) {
        to[i] = (float)from->lane[i];
    }
}
#endif

/* Pixels (x, y), (x + 1, y), ..., PIXELS of them or to the end of the row: their channels are written
   to `result`, the whole image's array. */
static inline void wamnet_pixel(
    const float *restrict image_a,
    const float *restrict image_b,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height,
    int x,
    int y);

/* All pixels, one after another. */
static inline void wamnet_image(
    const float *restrict image_a,
    const float *restrict image_b,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height)
{
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; x += PIXELS) {
            wamnet_pixel(image_a, image_b, weights, result, width, height, x, y);
        }
    }
}

static inline int wamnet_clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

static inline void wamnet_pixel(
    const float *restrict image_a,
    const float *restrict image_b,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height,
    int x,
    int y)
{
    (void)weights;

    /* the images around the pixels: what lies beyond the border is filled in here */
    uint8_t patch_a[WINDOW_SIZE * PATCH_WIDTH * 3 + 3];
    uint8_t patch_b[WINDOW_SIZE * PATCH_WIDTH + 3];
    int left = x - WINDOW_CENTRE;
    int top = y - WINDOW_CENTRE;
    bool within = 0 <= left && left + PATCH_WIDTH <= width && 0 <= top && top + WINDOW_SIZE <= height;
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = wamnet_clamp(top + dy, 0, height - 1);
        if (within) {
            for (int i = 0; i < PATCH_WIDTH * 3; ++i) {
                patch_a[dy * PATCH_WIDTH * 3 + i] = (uint8_t)((int32_t)image_a[(row * width + left) * 3 + i] + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = wamnet_clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 3; ++c) {
                    patch_a[dy * PATCH_WIDTH * 3 + dx * 3 + c] = (uint8_t)((int32_t)(inside ? image_a[(row * width + column) * 3 + c] : 0.0f) + 128);
                }
            }
        }
        if (within) {
            for (int i = 0; i < PATCH_WIDTH; ++i) {
                patch_b[dy * PATCH_WIDTH + i] = (uint8_t)((int32_t)image_b[(row * width + left) * 1 + i] + 128);
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = wamnet_clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 1; ++c) {
                    patch_b[dy * PATCH_WIDTH + dx + c] = (uint8_t)((int32_t)(inside ? image_b[(row * width + column) * 1 + c] : 0.0f) + 128);
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
    float v1[PIXELS * LANES];
    {
        wamnet_sums sum[PIXELS][1];
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            wamnet_start(&sum[p][0], weights + 6 * LANES);
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            for (int i = 0; i < 2; ++i) {
                wamnet_bytes w0;
                wamnet_weights(&w0, weights + (dy * 2 + i) * LANES);
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    wamnet_dot(&sum[p][0], &w0, patch_a + (dy * PATCH_WIDTH + p) * 3 + 4 * i);
                }
            }
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            for (int i = 0; i < 1; ++i) {
                wamnet_bytes w0;
                wamnet_weights(&w0, weights + (dy + 4 + i) * LANES);
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    wamnet_dot(&sum[p][0], &w0, patch_b + dy * PATCH_WIDTH + p + 4 * i);
                }
            }
        }
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            wamnet_floats(v1 + (p) * LANES, &sum[p][0]);
        }
    }

    /* %2 to %49: elementwise on 3 numbers */
    float v49[PIXELS * LANES];
    for (int i = 0; i < PIXELS * LANES; ++i) {
        int32_t t2 = (int32_t)v1[i];
        uint32_t t3 = (uint32_t)t2;
        uint32_t t5 = (uint32_t)weights[28 + i % LANES];
        uint32_t t8 = (uint32_t)weights[32 + i % LANES];
        uint32_t t9 = t3 * t5 + t8;
        uint32_t t11 = t9 >> 22u;
        uint32_t t13 = t11 & 1u;
        uint32_t t15 = 0u - t13;
        uint32_t t16 = t9 ^ t15;
        uint32_t t18 = t16 >> 6u;
        uint32_t t20 = t18 & 65535u;
        uint32_t t21 = t20 * t20;
        uint32_t t23 = t21 >> 16u;
        uint32_t t25 = t23 * 2332u;
        uint32_t t26 = t25 >> 16u;
        uint32_t t28 = 20871u - t26;
        uint32_t t29 = t23 * t28;
        uint32_t t30 = t29 >> 16u;
        uint32_t t32 = 51053u - t30;
        uint32_t t35 = t20 * t32 + 8388608u;
        uint32_t t37 = t35 >> 24u;
        uint32_t t39 = 127u < t37 ? 127u : t37;
        float t40 = (float)t39;
        uint32_t t42 = t9 >> 23u;
        uint32_t t43 = t42 & 1u;
        float t44 = (float)t43;
        float t48 = 1.0f - 2.0f * t44;
        float t49 = t40 * t48;
        v49[i] = t49;
    }

    /* %50: affine map W1 from 3 to 3 */
    float v50[PIXELS * LANES];
    {
        wamnet_sums sum[PIXELS][1];
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            wamnet_start(&sum[p][0], weights + 10 * LANES);
        }
        uint8_t bytes49[PIXELS * LANES];
        for (int i = 0; i < PIXELS * LANES; ++i) {
            bytes49[i] = (uint8_t)((int32_t)v49[i] + 128);
        }
        for (int i = 0; i < 1; ++i) {
            wamnet_bytes w0;
            wamnet_weights(&w0, weights + (9 + i) * LANES);
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                wamnet_dot(&sum[p][0], &w0, bytes49 + p * LANES + 4 * i);
            }
        }
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            wamnet_floats(v50 + (p) * LANES, &sum[p][0]);
        }
    }

    /* %51 to %67: elementwise on 3 numbers */
    float v67[PIXELS * LANES];
    for (int i = 0; i < PIXELS * LANES; ++i) {
        int32_t t51 = (int32_t)v50[i];
        int32_t t53 = (int32_t)weights[44 + i % LANES];
        int32_t t56 = (int32_t)weights[48 + i % LANES];
        int32_t t57 = t51 * t53 + t56;
        int32_t t59 = 0 > t57 ? 0 : t57;
        int32_t t61 = 16777216 < t59 ? 16777216 : t59;
        uint32_t t62 = (uint32_t)t61;
        uint32_t t64 = t62 >> 8u;
        float t65 = (float)t64;
        float t67 = t65 * 1.52587891e-05f;
        v67[i] = t67;
    }

    /* output color */
    for (int p = 0; p < PIXELS && x + p < width; ++p) {
        for (int i = 0; i < 3; ++i) {
            result[(y * width + x + p) * 3 + i] = v67[p * LANES + i];
        }
    }
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#undef LANES
#undef PATCH_WIDTH
#undef PIXELS
#undef WINDOW_CENTRE
#undef WINDOW_SIZE
#undef restrict
#endif
