
/* Sums over `samples` paths a pixel from `first` on: planes of width * height numbers. */
static void host_trace(int width, int height, int first, int samples, float *sums)
{
    wamnet_part part;
    part.width = width;
    part.height = height;
    part.first_row = 0;
    part.rows = height;
    part.first_sample = (uint32_t)first;
    part.samples = samples;
    part.seed_number = HOST_SEED;
    @call@(&part, sums);
}

/* The images of the features, from sums. */
static void host_encode(const float *sums, float *const *images, int width, int height, int samples)
{
    @encode@(@arguments@);
}
