/*
 * What this export is bound to. Written by `wamnet export`: main.c is the same for every model.
 */
#ifndef HOST_H
#define HOST_H
@includes@

enum {
    HOST_WIDTH = @width@, /* of the check pair */
    HOST_HEIGHT = @height@,
    HOST_IMAGES = @count@,
    HOST_PLANES = @planes@, /* of the sums over paths; 0 without a scene */
    HOST_RAYS = @rays@, /* a pixel, whose means are the features that the model has learned from */
    HOST_SEED = @seed@
};

#define HOST_ADDED @added@f /* what the host's storage may add to a bound */
#define HOST_ALIKE @alike@f /* share of the sums that must be the reference's except for rounding */
#define HOST_WITHIN @within@f

static const struct {
    const char *file;
    int channels;
} host_images[HOST_IMAGES] = {
@images@
};
@paths@
/* All kernels of the denoiser, in order. Arrays are (height, width, channels), rows from the top. */
static void host_denoise(float *const *images, float *result, int width, int height)
{
@body@
}

#endif
