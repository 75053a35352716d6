/*
 * The denoiser as a library that Blender's Python loads: `make` builds kernels.so; denoiser.py calls it.
 *
 * host.h has what differs from model to model. Numbers are 32-bit floats, pictures (height, width, channels) with
 * rows from the top, encoded as manifest.json says.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define WAMNET_EXPORTED __declspec(dllexport)
#else
#define WAMNET_EXPORTED
#endif

enum { LONGEST = 4096 };

static char host_folder[LONGEST]; /* of the export, with a stroke at its end */

/* Raw little-endian 32-bit floats. denoiser.py has compared the file with its hash before. */
static float *host_read(const char *name, size_t count)
{
    char path[2 * LONGEST];
    float *numbers = (float *)calloc(count, sizeof *numbers);
    FILE *file;
    snprintf(path, sizeof path, "%s%s", host_folder, name);
    file = fopen(path, "rb");
    if (!numbers || !file || fread(numbers, sizeof *numbers, count, file) != count) {
        fprintf(stderr, "wamnet: %s cannot be read\n", path);
        abort();
    }
    fclose(file);
    return numbers;
}

#include "host.h"

/* Say where the export is; 0 if its name is too long. Declared first, as careful compilers want it. */
WAMNET_EXPORTED int wamnet_open(const char *folder);
WAMNET_EXPORTED void wamnet_denoise(float *const *images, float *result, int width, int height);

int wamnet_open(const char *folder)
{
    if (strlen(folder) >= LONGEST) {
        return 0;
    }
    strcpy(host_folder, folder);
    return 1;
}

void wamnet_denoise(float *const *images, float *result, int width, int height)
{
    host_denoise(images, result, width, height);
}
