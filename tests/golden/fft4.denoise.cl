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
void forward(const float4 *from, int step, float4 *to, int leap)
{
    float4 t0 = from[0];
    float4 t1 = from[1];
    float4 t2 = from[step * 2];
    float4 t3 = from[step * 2 + 1];
    float4 t4 = from[step * 4];
    float4 t5 = from[step * 4 + 1];
    float4 t6 = from[step * 6];
    float4 t7 = from[step * 6 + 1];
    float4 t8 = t0 + t4;
    float4 t9 = t1 + t5;
    float4 t10 = t0 - t4;
    float4 t11 = t1 - t5;
    float4 t12 = t2 + t6;
    float4 t13 = t3 + t7;
    float4 t14 = t2 - t6;
    float4 t15 = t3 - t7;
    float4 t16 = t8 + t12;
    float4 t17 = t9 + t13;
    float4 t18 = t8 - t12;
    float4 t19 = t9 - t13;
    float4 t20 = t10 - t15;
    float4 t21 = t11 + t14;
    float4 t22 = t10 + t15;
    float4 t23 = t11 - t14;
    to[0] = t16;
    to[1] = t17;
    to[leap * 2] = t22;
    to[leap * 2 + 1] = t23;
    to[leap * 4] = t18;
    to[leap * 4 + 1] = t19;
    to[leap * 6] = t20;
    to[leap * 6 + 1] = t21;
}
void backward(const float4 *from, int step, float4 *to, int leap)
{
    float4 t0 = from[0];
    float4 t1 = from[1];
    float4 t2 = from[step * 2];
    float4 t3 = from[step * 2 + 1];
    float4 t4 = from[step * 4];
    float4 t5 = from[step * 4 + 1];
    float4 t6 = from[step * 6];
    float4 t7 = from[step * 6 + 1];
    float4 t8 = t0 + t4;
    float4 t9 = t1 + t5;
    float4 t10 = t0 - t4;
    float4 t11 = t1 - t5;
    float4 t12 = t2 + t6;
    float4 t13 = t3 + t7;
    float4 t14 = t2 - t6;
    float4 t15 = t3 - t7;
    float4 t16 = t8 + t12;
    float4 t17 = t9 + t13;
    float4 t18 = t8 - t12;
    float4 t19 = t9 - t13;
    float4 t20 = t10 - t15;
    float4 t21 = t11 + t14;
    to[0] = t16;
    to[1] = t17;
    to[leap * 2] = t20;
    to[leap * 2 + 1] = t21;
    to[leap * 4] = t18;
    to[leap * 4 + 1] = t19;
}
__kernel void wamnet_denoise(
    __global const float *restrict image_i0,
    __global const float *restrict image_i1,
    __global const float *restrict weights,
    __global float *restrict result,
    int width,
    int height)
{
    int tile_x = (int)get_global_id(0) * TILES * OUT;
    int tile_y = (int)get_global_id(1) * OUT;
    if (tile_x >= width || tile_y >= height) {
        return;
    }
    __global const float4 *w = (__global const float4 *)weights;

    /* rows of the images around the tiles, transformed */
    union { float4 all[INPUTS * POINTS * 2]; float number[INPUTS * POINTS * 2 * 4]; } gathered;
    float4 rows[INPUTS * POINTS * STRIDE];
    for (int i = 0; i < INPUTS * POINTS * 2; ++i) {
        gathered.all[i] = (float4)(0.0f);
    }
    for (int dy = 0; dy < POINTS; ++dy) {
        int top = tile_y + dy - WINDOW_CENTRE;
        int row = clamp(top, 0, height - 1);
        for (int tile = 0; tile < TILES; ++tile) {
            for (int dx = 0; dx < POINTS; ++dx) {
                int left = tile_x + tile * OUT + dx - WINDOW_CENTRE;
                int column = clamp(left, 0, width - 1);
                bool inside = row == top && column == left;
                gathered.number[(tile * PAIRS / LANES * POINTS * 2 + dx * 2) * LANES + tile * PAIRS % LANES] = inside ? image_i0[(row * width + column) * 2 + 0] : 0.0f;
                gathered.number[((tile * PAIRS + 1) / LANES * POINTS * 2 + dx * 2) * LANES + (tile * PAIRS + 1) % LANES] = inside ? image_i0[(row * width + column) * 2 + 1] : 0.0f;
                gathered.number[(tile * PAIRS / LANES * POINTS * 2 + dx * 2 + 1) * LANES + tile * PAIRS % LANES] = inside ? image_i1[(row * width + column) * 1 + 0] : 0.0f;
            }
        }
        for (int i = 0; i < INPUTS; ++i) {
            forward(gathered.all + i * POINTS * 2, 1, rows + (i * POINTS + dy) * STRIDE, 1);
        }
    }

    /* columns: transformed, multiplied with the weights' spectra, transformed back */
    float4 columns[2][POINTS * 2];
    union { float4 all[INPUTS * POINTS * 4]; float number[INPUTS * POINTS * 4 * 4]; } spectra;
    float4 product[TILES * 2][POINTS * 2];
    float4 back[TILES * NEURONS * OUT * STRIDE];
    for (int k = 0; k < POINTS / 2 + 1; ++k) {
        int opposite = (POINTS - k) % POINTS;
        int apart = opposite != k ? 1 : 0;
        for (int i = 0; i < INPUTS; ++i) {
            forward(rows + i * POINTS * STRIDE + 2 * k, POINTS + 1, columns[0], 1);
            if (opposite != k) {
                forward(rows + i * POINTS * STRIDE + 2 * opposite, POINTS + 1, columns[1], 1);
            }
            for (int f = 0; f < POINTS; ++f) {
                int g = (POINTS - f) % POINTS;
                float4 a = columns[0][2 * f];
                float4 b = columns[0][2 * f + 1];
                float4 c = columns[apart][2 * g];
                float4 d = columns[apart][2 * g + 1];
                spectra.all[(i * POINTS + f) * 4] = a + c;
                spectra.all[(i * POINTS + f) * 4 + 1] = b - d;
                spectra.all[(i * POINTS + f) * 4 + 2] = b + d;
                spectra.all[(i * POINTS + f) * 4 + 3] = c - a;
            }
        }
        for (int q = 0; q < NEURONS; ++q) {
            for (int f = 0; f < POINTS; ++f) {
                float4 real[TILES][2];
                float4 imaginary[TILES][2];
                #pragma unroll
                for (int t = 0; t < TILES; ++t) {
                    real[t][0] = (float4)(0.0f);
                    real[t][1] = (float4)(0.0f);
                    imaginary[t][0] = (float4)(0.0f);
                    imaginary[t][1] = (float4)(0.0f);
                }
                for (int pair = 0; pair < BLOCK; ++pair) {
                    float4 w0 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8];
                    float4 w1 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 1];
                    float4 w2 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 2];
                    float4 w3 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 3];
                    float4 w4 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 4];
                    float4 w5 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 5];
                    float4 w6 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 6];
                    float4 w7 = w[(((k * NEURONS + q) * POINTS + f) * PAIRS + pair) * 8 + 7];
                    #pragma unroll
                    for (int t = 0; t < TILES; ++t) {
                        int at = ((t * PAIRS + pair) / LANES * POINTS + f) * 4 * LANES + (t * PAIRS + pair) % LANES;
                        float a = spectra.number[at];
                        float b = spectra.number[at + LANES];
                        float c = spectra.number[at + LANES * 2];
                        float d = spectra.number[at + LANES * 3];
                        real[t][0] += w0 * a;
                        real[t][0] -= w2 * b;
                        real[t][0] += w4 * c;
                        real[t][0] -= w6 * d;
                        imaginary[t][0] += w2 * a;
                        imaginary[t][0] += w0 * b;
                        imaginary[t][0] += w6 * c;
                        imaginary[t][0] += w4 * d;
                        real[t][1] += w1 * a;
                        real[t][1] -= w3 * b;
                        real[t][1] += w5 * c;
                        real[t][1] -= w7 * d;
                        imaginary[t][1] += w3 * a;
                        imaginary[t][1] += w1 * b;
                        imaginary[t][1] += w7 * c;
                        imaginary[t][1] += w5 * d;
                    }
                }
                int g = (POINTS - f) % POINTS;
                #pragma unroll
                for (int t = 0; t < TILES; ++t) {
                    product[t * 2][2 * f] = real[t][0] - imaginary[t][1];
                    product[t * 2][2 * f + 1] = imaginary[t][0] + real[t][1];
                    product[t * 2 + apart][2 * g] = real[t][0] + imaginary[t][1];
                    product[t * 2 + apart][2 * g + 1] = real[t][1] - imaginary[t][0];
                }
            }
            for (int tile = 0; tile < TILES; ++tile) {
                backward(product[tile * 2], 1, back + (tile * NEURONS + q) * OUT * STRIDE + 2 * k, POINTS + 1);
                if (opposite != k) {
                    backward(product[tile * 2 + 1], 1, back + (tile * NEURONS + q) * OUT * STRIDE + 2 * opposite, POINTS + 1);
                }
            }
        }
    }

    /* rows back, and the other layers */
    float4 sums[2 * PIXELS * NEURONS * 2];
    for (int i = 0; i < (2 * PIXELS - TILES * OUT) * NEURONS * 2; ++i) {
        sums[TILES * OUT * NEURONS * 2 + i] = (float4)(0.0f);
    }
    for (int line = 0; line < OUT && tile_y + line < height; ++line) {
        for (int tile = 0; tile < TILES * NEURONS; ++tile) {
            backward(back + (tile * OUT + line) * STRIDE, 1, sums + (tile / NEURONS * OUT * NEURONS + tile % NEURONS) * 2, NEURONS);
        }
        int y = tile_y + line;
        for (int b = 0; b < 2; ++b) {
            int x = tile_x + b * PIXELS;
            int last = min(tile_x + TILES * OUT, width);

            /* %1: the sums, and their bias */
            float4 v1[PIXELS * 2];
            for (int p = 0; p < PIXELS; ++p) {
                v1[p * 2] = sums[(b * PIXELS + p) * NEURONS * 2];
                v1[p * 2 + 1] = sums[(b * PIXELS + p) * NEURONS * 2 + 1];
            }

            /* %2: elementwise on 5 numbers */
            union { float4 all[PIXELS * 2]; float number[PIXELS * 2 * 4]; } v2;
            for (int i = 0; i < PIXELS * 2; ++i) {
                float4 t2 = sin(v1[i]);
                v2.all[i] = t2;
            }

            /* %3: affine map W1 from 5 to 2 */
            union { float4 all[PIXELS]; float number[PIXELS * 4]; } v3;
            {
                float4 sum[PIXELS][1];
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = (float4)(0.0f);
                }
                for (int i = 0; i < 5; ++i) {
                    float4 w0 = w[192 + i];
                    #pragma unroll
                    for (int p = 0; p < PIXELS; ++p) {
                        float value = v2.number[p * 2 * LANES + i];
                        sum[p][0] += w0 * value;
                    }
                }
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    v3.all[p] = sum[p][0];
                }
            }

            /* output color */
            for (int p = 0; p < PIXELS && x + p < last; ++p) {
                for (int i = 0; i < 2; ++i) {
                    result[(y * width + x + p) * 2 + i] = v3.number[p * LANES + i];
                }
            }
        }
    }
}
