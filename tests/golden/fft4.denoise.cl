/*
 * a tiny kernel
 */
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
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define POINTS 4 /* rows and columns of a tile with what its windows reach */
#define OUT (POINTS - WINDOW_SIZE + 1) /* rows and columns of a tile's pixels */
#define TILES 1 /* neighbours in a row that a work item computes */
#define PIXELS 2 /* pixels of a row that go through the layers together */
#define LANES 4 /* numbers in a vector */
#define PAIRS 2 /* of channels */
#define BLOCK 2 /* pairs whose products are added up by themselves */
#define INPUTS 1 /* vectors that hold the pairs of all tiles */
#define NEURONS 1 /* pairs of vectors of neurons */
#define STRIDE (2 * (POINTS + 1)) /* vectors from row to row: not a multiple of 4096 bytes */
void forward(const vector *from, int step, vector *to, int leap)
{
    vector t0 = from[0 * step];
    vector t1 = from[0 * step + 1];
    vector t2 = from[2 * step];
    vector t3 = from[2 * step + 1];
    vector t4 = from[4 * step];
    vector t5 = from[4 * step + 1];
    vector t6 = from[6 * step];
    vector t7 = from[6 * step + 1];
    vector t8 = t0 + t4;
    vector t9 = t1 + t5;
    vector t10 = t0 - t4;
    vector t11 = t1 - t5;
    vector t12 = t2 + t6;
    vector t13 = t3 + t7;
    vector t14 = t2 - t6;
    vector t15 = t3 - t7;
    vector t16 = t8 + t12;
    vector t17 = t9 + t13;
    vector t18 = t8 - t12;
    vector t19 = t9 - t13;
    vector t20 = t10 - t15;
    vector t21 = t11 + t14;
    vector t22 = t10 + t15;
    vector t23 = t11 - t14;
    to[0 * leap] = t16;
    to[0 * leap + 1] = t17;
    to[2 * leap] = t22;
    to[2 * leap + 1] = t23;
    to[4 * leap] = t18;
    to[4 * leap + 1] = t19;
    to[6 * leap] = t20;
    to[6 * leap + 1] = t21;
}
void backward(const vector *from, int step, vector *to, int leap)
{
    vector t0 = from[0 * step];
    vector t1 = from[0 * step + 1];
    vector t2 = from[2 * step];
    vector t3 = from[2 * step + 1];
    vector t4 = from[4 * step];
    vector t5 = from[4 * step + 1];
    vector t6 = from[6 * step];
    vector t7 = from[6 * step + 1];
    vector t8 = t0 + t4;
    vector t9 = t1 + t5;
    vector t10 = t0 - t4;
    vector t11 = t1 - t5;
    vector t12 = t2 + t6;
    vector t13 = t3 + t7;
    vector t14 = t2 - t6;
    vector t15 = t3 - t7;
    vector t16 = t8 + t12;
    vector t17 = t9 + t13;
    vector t18 = t8 - t12;
    vector t19 = t9 - t13;
    vector t20 = t10 - t15;
    vector t21 = t11 + t14;
    to[0 * leap] = t16;
    to[0 * leap + 1] = t17;
    to[2 * leap] = t20;
    to[2 * leap + 1] = t21;
    to[4 * leap] = t18;
    to[4 * leap + 1] = t19;
}
#define PLACE(lane, i) (((lane) / LANES * POINTS * 2 + (i)) * LANES + (lane) % LANES)
#define SPECTRUM(lane, f) (((lane) / LANES * POINTS + (f)) * 4 * LANES + (lane) % LANES)
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

    /* rows of the images around the tiles, transformed */
    union { vector all[INPUTS * POINTS * 2]; float number[INPUTS * POINTS * 2 * LANES]; } row;
    vector rows[INPUTS * POINTS * STRIDE];
    for (int i = 0; i < INPUTS * POINTS * 2; ++i) {
        row.all[i] = (vector)(0.0f);
    }
    for (int dy = 0; dy < POINTS; ++dy) {
        int top = tile_y + dy - WINDOW_CENTRE;
        int row_y = clamp(top, 0, height - 1);
        for (int tile = 0; tile < TILES; ++tile) {
            for (int dx = 0; dx < POINTS; ++dx) {
                int left = tile_x + tile * OUT + dx - WINDOW_CENTRE;
                int column = clamp(left, 0, width - 1);
                bool inside = row_y == top && column == left;
                row.number[PLACE(tile * PAIRS + 0, dx * 2 + 0)] = inside ? image_i0[(row_y * width + column) * 2 + 0] : 0.0f;
                row.number[PLACE(tile * PAIRS + 1, dx * 2 + 0)] = inside ? image_i0[(row_y * width + column) * 2 + 1] : 0.0f;
                row.number[PLACE(tile * PAIRS + 0, dx * 2 + 1)] = inside ? image_i1[(row_y * width + column) * 1 + 0] : 0.0f;
            }
        }
        for (int i = 0; i < INPUTS; ++i) {
            forward(row.all + i * POINTS * 2, 1, rows + (i * POINTS + dy) * STRIDE, 1);
        }
    }

    /* columns: transformed, multiplied with the weights' spectra, transformed back */
    vector column[POINTS * 2];
    vector mirror[POINTS * 2];
    union { vector all[INPUTS * POINTS * 4]; float number[INPUTS * POINTS * 4 * LANES]; } spectra;
    vector product[TILES * 2][POINTS * 2];
    vector back[TILES * NEURONS * OUT * STRIDE];
    __global const vector *w = ((__global const vector *)weights);
    for (int k = 0; k <= POINTS / 2; ++k) {
        int opposite = (POINTS - k) % POINTS;
        int apart = opposite != k;
        for (int i = 0; i < INPUTS; ++i) {
            forward(rows + i * POINTS * STRIDE + 2 * k, POINTS + 1, column, 1);
            if (opposite != k) {
                forward(rows + i * POINTS * STRIDE + 2 * opposite, POINTS + 1, mirror, 1);
            }
            const vector *other = opposite != k ? mirror : column;
            for (int f = 0; f < POINTS; ++f) {
                int g = (POINTS - f) % POINTS;
                vector a = column[2 * f], b = column[2 * f + 1];
                vector c = other[2 * g], d = other[2 * g + 1];
                vector *to = spectra.all + (i * POINTS + f) * 4;
                to[0] = a + c;
                to[1] = b - d;
                to[2] = b + d;
                to[3] = c - a;
            }
        }
        for (int q = 0; q < NEURONS; ++q) {
            for (int f = 0; f < POINTS; ++f) {
                vector real[TILES][2];
                vector imaginary[TILES][2];
                #pragma unroll
                for (int t = 0; t < TILES; ++t) {
                    real[t][0] = (vector)(0.0f);
                    real[t][1] = (vector)(0.0f);
                    imaginary[t][0] = (vector)(0.0f);
                    imaginary[t][1] = (vector)(0.0f);
                }
                for (int pair = 0; pair < BLOCK; ++pair) {
                    vector w0 = w[0];
                    vector w1 = w[1];
                    vector w2 = w[2];
                    vector w3 = w[3];
                    vector w4 = w[4];
                    vector w5 = w[5];
                    vector w6 = w[6];
                    vector w7 = w[7];
                    w += 8;
                    #pragma unroll
                    for (int t = 0; t < TILES; ++t) {
                        const float *x = spectra.number + SPECTRUM(t * PAIRS + pair, f);
                        float a = x[0], b = x[LANES], c = x[2 * LANES], d = x[3 * LANES];
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
                vector *to = back + (tile * NEURONS + q) * OUT * STRIDE;
                backward(product[tile * 2], 1, to + 2 * k, POINTS + 1);
                if (opposite != k) {
                    backward(product[tile * 2 + 1], 1, to + 2 * opposite, POINTS + 1);
                }
            }
        }
    }

    /* rows back, and the other layers */
    vector sums[2 * PIXELS * NEURONS * 2];
    /* beyond the tiles */
    for (int i = 0; i < (2 * PIXELS - TILES * OUT) * NEURONS * 2; ++i) {
        sums[TILES * OUT * NEURONS * 2 + i] = (vector)(0.0f);
    }
    for (int line = 0; line < OUT && tile_y + line < height; ++line) {
        for (int tile = 0; tile < TILES * NEURONS; ++tile) {
            int at = (tile / NEURONS * OUT * NEURONS + tile % NEURONS) * 2;
            backward(back + (tile * OUT + line) * STRIDE, 1, sums + at, NEURONS);
        }
        int y = tile_y + line;
        for (int block = 0; block < 2; ++block) {
            int x = tile_x + block * PIXELS;
            int last = min(tile_x + TILES * OUT, width);

            /* %1: the sums, and their bias */
            union { vector all[PIXELS * 2]; float number[PIXELS * 2 * LANES]; } v1;
            const vector *from = sums + block * PIXELS * NEURONS * 2;
            for (int p = 0; p < PIXELS; ++p) {
                v1.all[p * 2 + 0] = from[p * NEURONS * 2 + 0];
                v1.all[p * 2 + 1] = from[p * NEURONS * 2 + 1];
            }

            /* %2: elementwise on 5 numbers */
            union { vector all[PIXELS * 2]; float number[PIXELS * 2 * LANES]; } v2;
            for (int i = 0; i < PIXELS * 2; ++i) {
                vector t2 = sin(v1.all[i]);
                v2.all[i] = t2;
            }

            /* %3: affine map W1 from 5 to 2 */
            union { vector all[PIXELS * 1]; float number[PIXELS * 1 * LANES]; } v3;
            {
                __global const vector *w = ((__global const vector *)(weights + 768));
                vector sum[PIXELS][1];
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    sum[p][0] = (vector)(0.0f);
                }
                for (int i = 0; i < 5; ++i) {
                    vector w0 = w[0];
                    w += 1;
                    #pragma unroll
                    for (int p = 0; p < PIXELS; ++p) {
                        float value = v2.number[p * 2 * LANES + i];
                        sum[p][0] += w0 * value;
                    }
                }
                #pragma unroll
                for (int p = 0; p < PIXELS; ++p) {
                    v3.all[p * 1 + 0] = sum[p][0];
                }
            }

            /* output color */
            for (int p = 0; p < PIXELS && x + p < last; ++p) {
                for (int i = 0; i < 2; ++i) {
                    result[(y * width + x + p) * 2 + i] = v3.number[p * 1 * LANES + i];
                }
            }
        }
    }
}
