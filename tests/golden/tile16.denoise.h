/*
 * wamnet denoiser, C99. Generated: change the compiler, not this text.
 * program   f57520577fed32a74017101934ae7668
 * images    i0: 2 channels in [-1.0, 1.0]
 *           i1: 1 channels in [-1.0, 1.0]
 * window    2 x 2 pixels, the pixel itself is tap 1
 * border    zero
 * output    2 channels
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * sine      emitted, odd polynomial of degree 11
 * bound     |output - float64 reference| <= 2.29e-06 for all images in these ranges
 * sums      over the window: a partial sum for each image and row of taps, in any order; then these
 * schedule  tile:16: 14 pixels share each weight: 28 vectors of 16 sums stay in registers
 * arguments image_i0: width * height * 2 floats, rows from the top, channels interleaved;
 *           image_i1: width * height * 1 floats, rows from the top, channels interleaved;
 *           weights: 288 floats;
 *           result: width * height * 2 floats, rows from the top, channels interleaved, encoded as `output`
 *           says;
 *           width; height.
 *           wamnet_image does all pixels, wamnet_pixel 14 x 1 from (x, y) on, for each x that is a
 *           multiple of 14 and each y of 1: call that from your own loops
 *           (with clang, compile for your processor)
 *           fewer than 2^31 floats an image; stack: 14108 bytes at most, without optimisation too
 * weights   W0 (1 x 12 x 16) at 0, b0 (16) at 192, W1 (1 x 5 x 16) at 208; vectors filled up with
 *           zeros; matrices block by block of neurons: blocks x D_in x neurons; the rows of one that
 *           reads the window go image by image, then tap by tap in rows, then channel by channel
 */
#ifndef WAMNET_DENOISE_H
#define WAMNET_DENOISE_H
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#if defined(__cplusplus)
#define restrict __restrict /* what compilers of C++ call it */
#endif
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif
/* A product may be fused with a sum: the bound holds either way. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=fast")
#else
#pragma STDC FP_CONTRACT ON
#endif
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
/* Compiled for newer processors too: by GCC each function on vectors, by clang wamnet_image alone. */
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GLIBC__) && defined(__OPTIMIZE__) && \
    !defined(__AVX__) && !defined(WAMNET_PORTABLE)
#if defined(__clang__) && __clang_major__ >= 14
#define WAMNET_CLONES __attribute__((always_inline))
#define WAMNET_IMAGE_CLONES __attribute__((target_clones("fma", "default")))
#elif !defined(__clang__) && __GNUC__ >= 12
#define WAMNET_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#endif
#endif
/* GCC's vectors are fast where the processor has registers of so many floats, else very slow. */
#if defined(__GNUC__) && __GNUC__ >= 4 && !defined(WAMNET_PORTABLE) && (defined(__clang__) || \
    16 <= 4 || (16 <= 8 && defined(__AVX__)) || defined(__AVX512F__) || defined(WAMNET_CLONES))
typedef float wamnet_vector __attribute__((vector_size(4 * 16), aligned(4), may_alias));
#define wamnet_zero() ((wamnet_vector){0})
#define wamnet_sum(a, b) ((a) + (b))
#define wamnet_difference(a, b) ((a) - (b))
#define wamnet_scaled(a, b) ((a) * (b))
#else
typedef struct {
    float lane[16];
} wamnet_vector;

static inline wamnet_vector wamnet_zero(void)
{
    wamnet_vector a;
    WAMNET_ROLLED
    for (int i = 0; i < 16; ++i) {
        a.lane[i] = 0.0f;
    }
    return a;
}

static inline wamnet_vector wamnet_sum(wamnet_vector a, wamnet_vector b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 16; ++i) {
        a.lane[i] += b.lane[i];
    }
    return a;
}

static inline wamnet_vector wamnet_difference(wamnet_vector a, wamnet_vector b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 16; ++i) {
        a.lane[i] -= b.lane[i];
    }
    return a;
}

static inline wamnet_vector wamnet_scaled(wamnet_vector a, float b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 16; ++i) {
        a.lane[i] *= b;
    }
    return a;
}
#endif
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define PIXELS 14 /* neighbours in a row that a work item computes */
#define LANES 16 /* components of a vector */
#define PATCH_WIDTH (WINDOW_SIZE + PIXELS - 1) /* columns that all windows touch */
#if defined(WAMNET_CLONES)
WAMNET_CLONES
#endif
/* Pixels (x, y), (x + 1, y), ..., PIXELS of them or to the end of the row: their channels are written
   to `result`, the whole image's array. */
static inline void wamnet_pixel(
    const float *restrict image_i0,
    const float *restrict image_i1,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height,
    int x,
    int y);

/* All pixels, one after another. */
#if defined(WAMNET_IMAGE_CLONES)
WAMNET_IMAGE_CLONES
#endif
static inline void wamnet_image(
    const float *restrict image_i0,
    const float *restrict image_i1,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height)
{
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; x += PIXELS) {
            wamnet_pixel(image_i0, image_i1, weights, result, width, height, x, y);
        }
    }
}

static inline int wamnet_clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

static inline void wamnet_pixel(
    const float *restrict image_i0,
    const float *restrict image_i1,
    const float *restrict weights,
    float *restrict result,
    int width,
    int height,
    int x,
    int y)
{
    (void)weights;

    /* the images around the pixels: what lies beyond the border is filled in here */
    float patch_i0[WINDOW_SIZE * PATCH_WIDTH * 2];
    float patch_i1[WINDOW_SIZE * PATCH_WIDTH];
    int left = x - WINDOW_CENTRE;
    int top = y - WINDOW_CENTRE;
    bool within = 0 <= left && left + PATCH_WIDTH <= width && 0 <= top && top + WINDOW_SIZE <= height;
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = wamnet_clamp(top + dy, 0, height - 1);
        if (within) {
            for (int i = 0; i < PATCH_WIDTH * 2; ++i) {
                patch_i0[dy * PATCH_WIDTH * 2 + i] = image_i0[(row * width + left) * 2 + i];
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = wamnet_clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 2; ++c) {
                    patch_i0[dy * PATCH_WIDTH * 2 + dx * 2 + c] = inside ? image_i0[(row * width + column) * 2 + c] : 0.0f;
                }
            }
        }
        if (within) {
            for (int i = 0; i < PATCH_WIDTH; ++i) {
                patch_i1[dy * PATCH_WIDTH + i] = image_i1[(row * width + left) * 1 + i];
            }
        }
        else {
            for (int dx = 0; dx < PATCH_WIDTH; ++dx) {
                int column = wamnet_clamp(left + dx, 0, width - 1);
                bool inside = row == top + dy && column == left + dx;
                for (int c = 0; c < 1; ++c) {
                    patch_i1[dy * PATCH_WIDTH + dx + c] = inside ? image_i1[(row * width + column) * 1 + c] : 0.0f;
                }
            }
        }
    }

    /* %1: affine map W0 from 12 to 5 */
    float v1[PIXELS * LANES];
    {
        wamnet_vector sum[PIXELS][1];
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = *(const wamnet_vector *)(weights + (12) * LANES);
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            wamnet_vector part[PIXELS][1];
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                part[p][0] = wamnet_zero();
            }
            for (int i = 0; i < WINDOW_SIZE * 2; ++i) {
                wamnet_vector w0 = *(const wamnet_vector *)(weights + (dy * 4 + i) * LANES);
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    float value = patch_i0[(dy * PATCH_WIDTH + p) * 2 + i];
                    part[p][0] = wamnet_sum(part[p][0], wamnet_scaled(w0, value));
                }
            }
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                sum[p][0] = wamnet_sum(sum[p][0], part[p][0]);
            }
        }
        for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
            wamnet_vector part[PIXELS][1];
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                part[p][0] = wamnet_zero();
            }
            for (int i = 0; i < WINDOW_SIZE; ++i) {
                wamnet_vector w0 = *(const wamnet_vector *)(weights + (dy * 2 + 8 + i) * LANES);
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    float value = patch_i1[dy * PATCH_WIDTH + p + i];
                    part[p][0] = wamnet_sum(part[p][0], wamnet_scaled(w0, value));
                }
            }
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                sum[p][0] = wamnet_sum(sum[p][0], part[p][0]);
            }
        }
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            *(wamnet_vector *)(v1 + (p) * LANES) = sum[p][0];
        }
    }

    /* %3 to %49: elementwise on 5 numbers */
    float v49[PIXELS * LANES];
    for (int i = 0; i < PIXELS * LANES; ++i) {
        float t5 = v1[i] * 0.318309873f + 0.5f;
        float t6 = floorf(t5);
        float t9 = v1[i] - t6 * 3.14160156f;
        float t12 = t9 - t6 * (-8.9071691e-06f);
        float t15 = t12 - t6 * (-1.74122761e-09f);
        float t16 = 0.5f * t6;
        float t17 = floorf(t16);
        float t20 = t6 - 2.0f * t17;
        float t23 = 1.0f - 2.0f * t20;
        float t24 = t15 * t15;
        float t28 = t24 * (-2.51969432e-08f) + 2.76094511e-06f;
        float t31 = t24 * t28 + (-0.000198427704f);
        float t34 = t24 * t31 + 0.00833334867f;
        float t37 = t24 * t34 + (-0.166666672f);
        float t38 = t24 * t37;
        float t40 = t15 + t15 * t38;
        float t41 = t23 * t40;
        float t42 = 1.0f < t41 ? 1.0f : t41;
        float t44 = (-1.0f) > t42 ? (-1.0f) : t42;
        float t45 = fabsf(v1[i]);
        bool t47 = t45 <= 12800.0f;
        float t48 = v1[i] - v1[i];
        float t49 = t47 ? t44 : t48;
        v49[i] = t49;
    }

    /* %50: affine map W1 from 5 to 2 */
    float v50[PIXELS * LANES];
    {
        wamnet_vector sum[PIXELS][1];
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            sum[p][0] = wamnet_zero();
        }
        for (int i = 0; i < 5; ++i) {
            wamnet_vector w0 = *(const wamnet_vector *)(weights + (13 + i) * LANES);
            WAMNET_UNROLL
            for (int p = 0; p < PIXELS; ++p) {
                float value = v49[p * LANES + i];
                sum[p][0] = wamnet_sum(sum[p][0], wamnet_scaled(w0, value));
            }
        }
        WAMNET_UNROLL
        for (int p = 0; p < PIXELS; ++p) {
            *(wamnet_vector *)(v50 + (p) * LANES) = sum[p][0];
        }
    }

    /* %52 to %53: elementwise on 2 numbers */
    float v53[PIXELS * LANES];
    for (int i = 0; i < PIXELS * LANES; ++i) {
        float t52 = 0.0f > v50[i] ? 0.0f : v50[i];
        float t53 = 1.0f < t52 ? 1.0f : t52;
        v53[i] = t53;
    }

    /* output color */
    for (int p = 0; p < PIXELS && x + p < width; ++p) {
        for (int i = 0; i < 2; ++i) {
            result[(y * width + x + p) * 2 + i] = v53[p * LANES + i];
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
#undef wamnet_difference
#undef wamnet_scaled
#undef wamnet_sum
#undef wamnet_zero
#endif
