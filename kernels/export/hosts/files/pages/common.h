/* What programs in C on devices share: files, the comparison with the reference, the two pictures. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "host.h"

enum { HOST_COUNT = HOST_WIDTH * HOST_HEIGHT };

static void host_stop(const char *what, const char *name)
{
    fprintf(stderr, "%s: %s\n", name, what);
    exit(2);
}

/* A whole file, and how long it is. */
static char *host_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    char *data;
    long end;
    if (!file) {
        host_stop("cannot be read: start this program in the folder of the export", path);
    }
    fseek(file, 0, SEEK_END);
    end = ftell(file);
    rewind(file);
    data = (char *)calloc((size_t)end + 1, 1);
    if (!data || fread(data, 1, (size_t)end, file) != (size_t)end) {
        host_stop("cannot be read", path);
    }
    fclose(file);
    *size = (size_t)end;
    return data;
}

/* Raw little-endian 32-bit floats: on a processor of the other order, turn their bytes here. */
static float *host_read(const char *path, size_t count)
{
    size_t size;
    float *numbers = (float *)(void *)host_file(path, &size);
    if (size != count * sizeof *numbers) {
        host_stop("has another length than host.h says", path);
    }
    return numbers;
}

/* The numbers of a buffer. */
static size_t host_numbers(int buffer)
{
    return (size_t)(host_buffers[buffer].all + host_buffers[buffer].each * HOST_COUNT);
}

/* How many groups of items a launch has for so many pixels. */
static uint32_t host_groups(int pixels, int each, int group)
{
    return (uint32_t)((pixels + each * group - 1) / (each * group));
}

/* Two pictures side by side, each pixel twelve times as large: they are encoded for the display already. */
static void host_show(const char *path, const float *left, const float *right)
{
    enum { TIMES = 12, ACROSS = HOST_WIDTH * TIMES };
    FILE *file = fopen(path, "wb");
    if (!file) {
        host_stop("cannot be written", path);
    }
    fprintf(file, "P6 %d %d 255\n", 2 * ACROSS, HOST_HEIGHT * TIMES);
    for (int y = 0; y < HOST_HEIGHT * TIMES; ++y) {
        for (int x = 0; x < 2 * ACROSS; ++x) {
            const float *from = x < ACROSS ? left : right;
            for (int c = 0; c < 3; ++c) {
                float value = from[((y / TIMES) * HOST_WIDTH + x % ACROSS / TIMES) * 3 + c];
                fputc((int)(255.0f * fminf(fmaxf(value, 0.0f), 1.0f) + 0.5f), file);
            }
        }
    }
    fclose(file);
    printf("%s: noisy on the left, denoised on the right\n", path);
}

/* The program's status: 0 if each number is within its bound; written so that NaN is not. */
static int host_judge(const float *result)
{
    const float *expected = host_read("check/output.f32", (size_t)HOST_COUNT * 3);
    const float *bound = host_read("check/bound.f32", (size_t)HOST_COUNT * 3);
    float worst = 0.0f, most = 0.0f;
    int wrong = 0;
    for (int i = 0; i < HOST_COUNT * 3; ++i) {
        float error = fabsf(result[i] - expected[i]), allowed = bound[i] + HOST_ADDED;
        wrong += !(error <= allowed);
        worst = error <= worst ? worst : error;
        most = fmaxf(most, allowed);
    }
    host_show("seen.ppm", host_read(host_buffers[0].file, host_numbers(0)), result);
    printf("largest error %.3g, allowed %.3g; %d of %d numbers are wrong\n", worst, most, wrong, HOST_COUNT * 3);
    puts(wrong ? "WRONG" : "right");
    return wrong ? 1 : 0;
}
