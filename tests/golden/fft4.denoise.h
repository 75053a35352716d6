/*
 * a tiny kernel
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
    4 <= 4 || (4 <= 8 && defined(__AVX__)) || defined(__AVX512F__) || defined(WAMNET_CLONES))
typedef float wamnet_vector __attribute__((vector_size(4 * 4), aligned(4), may_alias));
#define wamnet_zero() ((wamnet_vector){0})
#define wamnet_sum(a, b) ((a) + (b))
#define wamnet_difference(a, b) ((a) - (b))
#define wamnet_scaled(a, b) ((a) * (b))
#else
typedef struct {
    float lane[4];
} wamnet_vector;

static inline wamnet_vector wamnet_zero(void)
{
    wamnet_vector a;
    WAMNET_ROLLED
    for (int i = 0; i < 4; ++i) {
        a.lane[i] = 0.0f;
    }
    return a;
}

static inline wamnet_vector wamnet_sum(wamnet_vector a, wamnet_vector b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 4; ++i) {
        a.lane[i] += b.lane[i];
    }
    return a;
}

static inline wamnet_vector wamnet_difference(wamnet_vector a, wamnet_vector b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 4; ++i) {
        a.lane[i] -= b.lane[i];
    }
    return a;
}

static inline wamnet_vector wamnet_scaled(wamnet_vector a, float b)
{
    WAMNET_ROLLED
    for (int i = 0; i < 4; ++i) {
        a.lane[i] *= b;
    }
    return a;
}
#endif
#if defined(WAMNET_CLONES)
WAMNET_CLONES
#endif
static void wamnet_forward(const wamnet_vector *from, int step, wamnet_vector *to, int leap);
#if defined(WAMNET_CLONES)
WAMNET_CLONES
#endif
static void wamnet_backward(const wamnet_vector *from, int step, wamnet_vector *to, int leap);
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define POINTS 4 /* rows and columns of a tile with what its windows reach */
#define OUT (POINTS - WINDOW_SIZE + 1) /* rows and columns of a tile's pixels */
#define TILES 1 /* neighbours in a row that a work item computes */
#define PIXELS 2 /* pixels of a row that go through the layers together */
#define LANES 4 /* components of a vector */
#define PAIRS 2 /* of channels */
#define BLOCK 2 /* pairs whose products are added up by themselves */
#define INPUTS 1 /* vectors that hold the pairs of all tiles */
#define NEURONS 1 /* pairs of vectors of neurons */
#define STRIDE (2 * (POINTS + 1)) /* vectors from row to row: not a multiple of 4096 bytes */
static void wamnet_forward(const wamnet_vector *from, int step, wamnet_vector *to, int leap)
{
    wamnet_vector t0 = from[0];
    wamnet_vector t1 = from[1];
    wamnet_vector t2 = from[step * 2];
    wamnet_vector t3 = from[step * 2 + 1];
    wamnet_vector t4 = from[step * 4];
    wamnet_vector t5 = from[step * 4 + 1];
    wamnet_vector t6 = from[step * 6];
    wamnet_vector t7 = from[step * 6 + 1];
    wamnet_vector t8 = wamnet_sum(t0, t4);
    wamnet_vector t9 = wamnet_sum(t1, t5);
    wamnet_vector t10 = wamnet_difference(t0, t4);
    wamnet_vector t11 = wamnet_difference(t1, t5);
    wamnet_vector t12 = wamnet_sum(t2, t6);
    wamnet_vector t13 = wamnet_sum(t3, t7);
    wamnet_vector t14 = wamnet_difference(t2, t6);
    wamnet_vector t15 = wamnet_difference(t3, t7);
    wamnet_vector t16 = wamnet_sum(t8, t12);
    wamnet_vector t17 = wamnet_sum(t9, t13);
    wamnet_vector t18 = wamnet_difference(t8, t12);
    wamnet_vector t19 = wamnet_difference(t9, t13);
    wamnet_vector t20 = wamnet_difference(t10, t15);
    wamnet_vector t21 = wamnet_sum(t11, t14);
    wamnet_vector t22 = wamnet_sum(t10, t15);
    wamnet_vector t23 = wamnet_difference(t11, t14);
    to[0] = t16;
    to[1] = t17;
    to[leap * 2] = t22;
    to[leap * 2 + 1] = t23;
    to[leap * 4] = t18;
    to[leap * 4 + 1] = t19;
    to[leap * 6] = t20;
    to[leap * 6 + 1] = t21;
}
static void wamnet_backward(const wamnet_vector *from, int step, wamnet_vector *to, int leap)
{
    wamnet_vector t0 = from[0];
    wamnet_vector t1 = from[1];
    wamnet_vector t2 = from[step * 2];
    wamnet_vector t3 = from[step * 2 + 1];
    wamnet_vector t4 = from[step * 4];
    wamnet_vector t5 = from[step * 4 + 1];
    wamnet_vector t6 = from[step * 6];
    wamnet_vector t7 = from[step * 6 + 1];
    wamnet_vector t8 = wamnet_sum(t0, t4);
    wamnet_vector t9 = wamnet_sum(t1, t5);
    wamnet_vector t10 = wamnet_difference(t0, t4);
    wamnet_vector t11 = wamnet_difference(t1, t5);
    wamnet_vector t12 = wamnet_sum(t2, t6);
    wamnet_vector t13 = wamnet_sum(t3, t7);
    wamnet_vector t14 = wamnet_difference(t2, t6);
    wamnet_vector t15 = wamnet_difference(t3, t7);
    wamnet_vector t16 = wamnet_sum(t8, t12);
    wamnet_vector t17 = wamnet_sum(t9, t13);
    wamnet_vector t18 = wamnet_difference(t8, t12);
    wamnet_vector t19 = wamnet_difference(t9, t13);
    wamnet_vector t20 = wamnet_difference(t10, t15);
    wamnet_vector t21 = wamnet_sum(t11, t14);
    to[0] = t16;
    to[1] = t17;
    to[leap * 2] = t20;
    to[leap * 2 + 1] = t21;
    to[leap * 4] = t18;
    to[leap * 4 + 1] = t19;
}
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
    int tile_x,
    int tile_y);

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
    for (int y = 0; y < height; y += OUT) {
        for (int x = 0; x < width; x += TILES * OUT) {
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
    int tile_x,
    int tile_y)
{
    (void)weights;

    /* rows of the images around the tiles, transformed */
    float gathered[INPUTS * POINTS * 2 * LANES];
    wamnet_vector rows[INPUTS * POINTS * STRIDE];
    for (int i = 0; i < INPUTS * POINTS * 2; ++i) {
        *(wamnet_vector *)(gathered + (i) * LANES) = wamnet_zero();
    }
    for (int dy = 0; dy < POINTS; ++dy) {
        int top = tile_y + dy - WINDOW_CENTRE;
        int row = wamnet_clamp(top, 0, height - 1);
        for (int tile = 0; tile < TILES; ++tile) {
            for (int dx = 0; dx < POINTS; ++dx) {
                int left = tile_x + tile * OUT + dx - WINDOW_CENTRE;
                int column = wamnet_clamp(left, 0, width - 1);
                bool inside = row == top && column == left;
                gathered[(tile * PAIRS / LANES * POINTS * 2 + dx * 2) * LANES + tile * PAIRS % LANES] = inside ? image_i0[(row * width + column) * 2 + 0] : 0.0f;
                gathered[((tile * PAIRS + 1) / LANES * POINTS * 2 + dx * 2) * LANES + (tile * PAIRS + 1) % LANES] = inside ? image_i0[(row * width + column) * 2 + 1] : 0.0f;
                gathered[(tile * PAIRS / LANES * POINTS * 2 + dx * 2 + 1) * LANES + tile * PAIRS % LANES] = inside ? image_i1[(row * width + column) * 1 + 0] : 0.0f;
            }
        }
        for (int i = 0; i < INPUTS; ++i) {
            wamnet_forward((wamnet_vector *)(gathered + i * POINTS * 2 * LANES), 1, rows + (i * POINTS + dy) * STRIDE, 1);
        }
    }

    /* columns: transformed, multiplied with the weights' spectra, transformed back */
    wamnet_vector columns[2][POINTS * 2];
    float spectra[INPUTS * POINTS * 4 * LANES];
    wamnet_vector product[TILES * 2][POINTS * 2];
    wamnet_vector back[TILES * NEURONS * OUT * STRIDE];
    for (int k = 0; k < POINTS / 2 + 1; ++k) {
        int opposite = (POINTS - k) % POINTS;
        int apart = opposite != k ? 1 : 0;
        for (int i = 0; i < INPUTS; ++i) {
            wamnet_forward(rows + i * POINTS * STRIDE + 2 * k, POINTS + 1, columns[0], 1);
            if (opposite != k) {
                wamnet_forward(rows + i * POINTS * STRIDE + 2 * opposite, POINTS + 1, columns[1], 1);
            }
            for (int f = 0; f < POINTS; ++f) {
                int g = (POINTS - f) % POINTS;
                wamnet_vector a = columns[0][2 * f];
                wamnet_vector b = columns[0][2 * f + 1];
                wamnet_vector c = columns[apart][2 * g];
                wamnet_vector d = columns[apart][2 * g + 1];
                *(wamnet_vector *)(spectra + ((i * POINTS + f) * 4) * LANES) = wamnet_sum(a, c);
                *(wamnet_vector *)(spectra + ((i * POINTS + f) * 4 + 1) * LANES) = wamnet_difference(b, d);
                *(wamnet_vector *)(spectra + ((i * POINTS + f) * 4 + 2) * LANES) = wamnet_sum(b, d);
                *(wamnet_vector *)(spectra + ((i * POINTS + f) * 4 + 3) * LANES) = wamnet_difference(c, a);
            }
        }
        for (int q = 0; q < NEURONS; ++q) {
            for (int f = 0; f < POINTS; ++f) {
                wamnet_vector real[TILES][2];
                wamnet_vector imaginary[TILES][2];
                WAMNET_UNROLL
                for (int t = 0; t < TILES; ++t) {
                    real[t][0] = wamnet_zero();
                    real[t][1] = wamnet_zero();
                    imaginary[t][0] = wamnet_zero();
                    imaginary[t][1] = wamnet_zero();
                }
                for (int pair = 0; pair < BLOCK; ++pair) {
                    wamnet_vector w0 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8) * LANES);
                    wamnet_vector w1 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 1) * LANES);
                    wamnet_vector w2 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 2) * LANES);
                    wamnet_vector w3 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 3) * LANES);
                    wamnet_vector w4 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 4) * LANES);
                    wamnet_vector w5 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 5) * LANES);
                    wamnet_vector w6 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 6) * LANES);
                    wamnet_vector w7 = *(const wamnet_vector *)(weights + ((((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 7) * LANES);
                    WAMNET_UNROLL
                    for (int t = 0; t < TILES; ++t) {
                        int at = ((t * PAIRS + pair) / LANES * POINTS + f) * 4 * LANES + (t * PAIRS + pair) % LANES;
                        float a = spectra[at];
                        float b = spectra[at + LANES];
                        float c = spectra[at + LANES * 2];
                        float d = spectra[at + LANES * 3];
                        real[t][0] = wamnet_sum(real[t][0], wamnet_scaled(w0, a));
                        real[t][0] = wamnet_difference(real[t][0], wamnet_scaled(w2, b));
                        real[t][0] = wamnet_sum(real[t][0], wamnet_scaled(w4, c));
                        real[t][0] = wamnet_difference(real[t][0], wamnet_scaled(w6, d));
                        imaginary[t][0] = wamnet_sum(imaginary[t][0], wamnet_scaled(w2, a));
                        imaginary[t][0] = wamnet_sum(imaginary[t][0], wamnet_scaled(w0, b));
                        imaginary[t][0] = wamnet_sum(imaginary[t][0], wamnet_scaled(w6, c));
                        imaginary[t][0] = wamnet_sum(imaginary[t][0], wamnet_scaled(w4, d));
                        real[t][1] = wamnet_sum(real[t][1], wamnet_scaled(w1, a));
                        real[t][1] = wamnet_difference(real[t][1], wamnet_scaled(w3, b));
                        real[t][1] = wamnet_sum(real[t][1], wamnet_scaled(w5, c));
                        real[t][1] = wamnet_difference(real[t][1], wamnet_scaled(w7, d));
                        imaginary[t][1] = wamnet_sum(imaginary[t][1], wamnet_scaled(w3, a));
                        imaginary[t][1] = wamnet_sum(imaginary[t][1], wamnet_scaled(w1, b));
                        imaginary[t][1] = wamnet_sum(imaginary[t][1], wamnet_scaled(w7, c));
                        imaginary[t][1] = wamnet_sum(imaginary[t][1], wamnet_scaled(w5, d));
                    }
                }
                int g = (POINTS - f) % POINTS;
                WAMNET_UNROLL
                for (int t = 0; t < TILES; ++t) {
                    product[t * 2][2 * f] = wamnet_difference(real[t][0], imaginary[t][1]);
                    product[t * 2][2 * f + 1] = wamnet_sum(imaginary[t][0], real[t][1]);
                    product[t * 2 + apart][2 * g] = wamnet_sum(real[t][0], imaginary[t][1]);
                    product[t * 2 + apart][2 * g + 1] = wamnet_difference(real[t][1], imaginary[t][0]);
                }
            }
            for (int tile = 0; tile < TILES; ++tile) {
                wamnet_backward(product[tile * 2], 1, back + (tile * NEURONS + q) * OUT * STRIDE + 2 * k, POINTS + 1);
                if (opposite != k) {
                    wamnet_backward(product[tile * 2 + 1], 1, back + (tile * NEURONS + q) * OUT * STRIDE + 2 * opposite, POINTS + 1);
                }
            }
        }
    }

    /* rows back, and the other layers */
    wamnet_vector sums[2 * PIXELS * NEURONS * 2];
    for (int i = 0; i < (2 * PIXELS - TILES * OUT) * NEURONS * 2; ++i) {
        sums[TILES * OUT * NEURONS * 2 + i] = wamnet_zero();
    }
    for (int line = 0; line < OUT && tile_y + line < height; ++line) {
        for (int tile = 0; tile < TILES * NEURONS; ++tile) {
            wamnet_backward(back + (tile * OUT + line) * STRIDE, 1, sums + (tile / NEURONS * OUT * NEURONS + tile % NEURONS) * 2, NEURONS);
        }
        int y = tile_y + line;
        for (int b = 0; b < 2; ++b) {
            int x = tile_x + b * PIXELS;
            int last = width < tile_x + TILES * OUT ? width : tile_x + TILES * OUT;

            /* %1: the sums, and their bias */
            float v1[PIXELS * 2 * LANES];
            for (int p = 0; p < PIXELS; ++p) {
                *(wamnet_vector *)(v1 + (p * 2) * LANES) = sums[(b * PIXELS + p) * NEURONS * 2];
                *(wamnet_vector *)(v1 + (p * 2 + 1) * LANES) = sums[(b * PIXELS + p) * NEURONS * 2 + 1];
            }

            /* %2: elementwise on 5 numbers */
            float v2[PIXELS * 2 * LANES];
            for (int i = 0; i < PIXELS * 2 * LANES; ++i) {
                float t2 = sinf(v1[i]);
                v2[i] = t2;
            }

            /* %3: affine map W1 from 5 to 2 */
            float v3[PIXELS * LANES];
            {
                wamnet_vector sum[PIXELS][1];
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = wamnet_zero();
                }
                for (int i = 0; i < 5; ++i) {
                    wamnet_vector w0 = *(const wamnet_vector *)(weights + (192 + i) * LANES);
                    WAMNET_UNROLL
                    for (int p = 0; p < PIXELS; ++p) {
                        float value = v2[p * 2 * LANES + i];
                        sum[p][0] = wamnet_sum(sum[p][0], wamnet_scaled(w0, value));
                    }
                }
                WAMNET_UNROLL
                for (int p = 0; p < PIXELS; ++p) {
                    *(wamnet_vector *)(v3 + (p) * LANES) = sum[p][0];
                }
            }

            /* output color */
            for (int p = 0; p < PIXELS && x + p < last; ++p) {
                for (int i = 0; i < 2; ++i) {
                    result[(y * width + x + p) * 2 + i] = v3[p * LANES + i];
                }
            }
        }
    }
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#undef BLOCK
#undef INPUTS
#undef LANES
#undef NEURONS
#undef OUT
#undef PAIRS
#undef PIXELS
#undef POINTS
#undef STRIDE
#undef TILES
#undef WINDOW_CENTRE
#undef WINDOW_SIZE
#undef restrict
#undef wamnet_difference
#undef wamnet_scaled
#undef wamnet_sum
#undef wamnet_zero
#endif
