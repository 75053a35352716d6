/*
 * The denoiser in a program: `make run` builds it, compares it with the reference, and draws seen.ppm.
 *
 * 1. host.h has what differs from model to model: it calls all kernels in order.
 * 2. `check` runs them on the pictures in check/, and compares each number with the reference's.
 * 3. With a scene `draw` traces, encodes and denoises a picture of its own.
 *
 * C99 and the standard library; no file is longer than a page, so take what you need.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static float *host_floats(size_t count)
{
    float *numbers = (float *)calloc(count, sizeof *numbers);
    if (!numbers) {
        fputs("there is not enough memory\n", stderr);
        exit(2);
    }
    return numbers;
}

/* Raw little-endian 32-bit floats: on a processor of the other order, turn their bytes here. */
static float *host_read(const char *path, size_t count)
{
    float *numbers = host_floats(count);
    FILE *file = fopen(path, "rb");
    if (!file || fread(numbers, sizeof *numbers, count, file) != count) {
        fprintf(stderr, "%s cannot be read: start this program in the folder of the export\n", path);
        exit(2);
    }
    fclose(file);
    return numbers;
}

#include "host.h"

enum { COUNT = HOST_WIDTH * HOST_HEIGHT, DRAWN = 192, ENLARGED = 12 };

/* Two pictures side by side, each pixel `times` as large: they are encoded for the display already. */
static void show(const char *path, const float *left, const float *right, int width, int height, int times)
{
    FILE *file = fopen(path, "wb");
    if (!file) {
        fprintf(stderr, "%s cannot be written\n", path);
        exit(2);
    }
    fprintf(file, "P6 %d %d 255\n", 2 * width * times, height * times);
    for (int y = 0; y < height * times; ++y) {
        for (int x = 0; x < 2 * width * times; ++x) {
            const float *from = x < width * times ? left : right;
            for (int c = 0; c < 3; ++c) {
                float value = from[((y / times) * width + x / times % width) * 3 + c];
                fputc((int)(255.0f * fminf(fmaxf(value, 0.0f), 1.0f) + 0.5f), file);
            }
        }
    }
    fclose(file);
    printf("%s: noisy on the left, denoised on the right\n", path);
}

/* Whether the sums of paths are the reference's, except for those that pass an edge within rounding. */
static int sums_agree(void)
{
#if defined(WAMNET_TRACE_H)
    float *sums = host_floats((size_t)COUNT * HOST_PLANES);
    const float *expected = host_read("check/sums.f32", (size_t)COUNT * HOST_PLANES);
    int alike = 0;
    host_trace(HOST_WIDTH, HOST_HEIGHT, 0, 1, sums);
    for (int i = 0; i < COUNT * HOST_PLANES; ++i) {
        alike += fabsf(sums[i] - expected[i]) <= HOST_WITHIN * fmaxf(1.0f, fabsf(expected[i]));
    }
    printf("paths: %d of %d sums are the reference's\n", alike, COUNT * HOST_PLANES);
    return (float)alike >= HOST_ALIKE * (float)(COUNT * HOST_PLANES);
#else
    return 1;
#endif
}

/* Whether each number of the check pair is within its bound; written so that NaN is not. */
static int check(void)
{
    float *images[HOST_IMAGES], *result = host_floats((size_t)COUNT * 3);
    const float *expected = host_read("check/output.f32", (size_t)COUNT * 3);
    const float *bound = host_read("check/bound.f32", (size_t)COUNT * 3);
    float worst = 0.0f, most = 0.0f;
    int wrong = 0;
    for (int i = 0; i < HOST_IMAGES; ++i) {
        images[i] = host_read(host_images[i].file, (size_t)(COUNT * host_images[i].channels));
    }
    host_denoise(images, result, HOST_WIDTH, HOST_HEIGHT);
    for (int i = 0; i < COUNT * 3; ++i) {
        float error = fabsf(result[i] - expected[i]), allowed = bound[i] + HOST_ADDED;
        wrong += !(error <= allowed);
        worst = error <= worst ? worst : error;
        most = fmaxf(most, allowed);
    }
    show("seen.ppm", images[0], result, HOST_WIDTH, HOST_HEIGHT, ENLARGED);
    printf("largest error %.3g, allowed %.3g; %d of %d numbers are wrong\n", worst, most, wrong, COUNT * 3);
    return wrong == 0;
}

/* A picture from nothing: one path a pixel for the colour, and the model's own number for the features. */
static void draw(void)
{
#if defined(WAMNET_TRACE_H)
    size_t pixels = (size_t)DRAWN * DRAWN;
    float *sums = host_floats(pixels * HOST_PLANES), *means = host_floats(pixels * HOST_PLANES);
    float *images[HOST_IMAGES], *result = host_floats(pixels * 3);
    for (int i = 0; i < HOST_IMAGES; ++i) {
        images[i] = host_floats(pixels * (size_t)host_images[i].channels);
    }
    host_trace(DRAWN, DRAWN, 0, 1, sums);
    if (HOST_RAYS > 1) {
        host_trace(DRAWN, DRAWN, 0, HOST_RAYS, means);
    }
    for (size_t i = 3 * pixels; HOST_RAYS > 1 && i < pixels * HOST_PLANES; ++i) { /* planes 0 to 2 are the colour */
        sums[i] = means[i] / HOST_RAYS;
    }
    host_encode(sums, images, DRAWN, DRAWN, 1);
    host_denoise(images, result, DRAWN, DRAWN);
    show("picture.ppm", images[0], result, DRAWN, DRAWN, 1);
#endif
}

int main(void)
{
    int right = check();
    right &= sums_agree();
    if (right) {
        draw();
    }
    puts(right ? "right" : "WRONG");
    return !right;
}
