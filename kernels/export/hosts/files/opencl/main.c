/*
 * The denoiser on OpenCL: `make run` builds this, compares it with the reference, and draws seen.ppm.
 *
 * OpenCL's library is loaded when the program starts [cl.h], so that neither headers nor it must be there to build.
 * host.h has the buffers and the launches of this model.
 */
#include "common.h"
#include "cl.h"

static void check(cl_int error, const char *what)
{
    if (error) {
        fprintf(stderr, "%s: OpenCL's error %d\n", what, error);
        exit(2);
    }
}

/* The first device of the platforms, or the one of the platform whose number is in HOST_PLATFORM. */
static cl_device_id first_device(void)
{
    const char *wanted = getenv("HOST_PLATFORM");
    cl_uint count = 0, number = wanted ? (cl_uint)atoi(wanted) : 0;
    cl_platform_id platforms[16];
    cl_device_id device;
    char name[256];
    if (clGetPlatformIDs(16, platforms, &count) || number >= count) {
        host_stop("no platform: install a driver, such as pocl-opencl-icd", "OpenCL");
    }
    check(clGetDeviceIDs(platforms[number], CL_DEVICE_TYPE_ALL, 1, &device, NULL), "a device");
    check(clGetDeviceInfo(device, CL_DEVICE_NAME, sizeof name, name, NULL), "its name");
    printf("OpenCL, %s\n", name);
    return device;
}

static cl_kernel kernel_of(cl_context context, cl_device_id device, const struct host_launch *launch)
{
    cl_int error;
    size_t size;
    const char *source = host_file(launch->file, &size);
    cl_program program = clCreateProgramWithSource(context, 1, &source, &size, &error);
    check(error, launch->file);
    if (clBuildProgram(program, 1, &device, "", NULL, NULL)) {
        static char told[1 << 16];
        clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, sizeof told, told, NULL);
        host_stop(told, launch->file);
    }
    cl_kernel kernel = clCreateKernel(program, launch->entry, &error);
    check(error, launch->entry);
    return kernel;
}

int main(void)
{
    cl_int error, width = HOST_WIDTH, height = HOST_HEIGHT;
    cl_mem buffers[HOST_BUFFERS];
    float *result = (float *)calloc((size_t)HOST_COUNT * 3, sizeof *result);
    opencl_load();
    cl_device_id device = first_device();
    cl_context context = clCreateContext(NULL, 1, &device, NULL, NULL, &error);
    check(error, "a context");
    cl_command_queue queue = clCreateCommandQueue(context, device, 0, &error);
    check(error, "a queue");
    for (int i = 0; i < HOST_BUFFERS; ++i) {
        size_t size = host_numbers(i) * sizeof(float);
        float *data = host_buffers[i].file ? host_read(host_buffers[i].file, host_numbers(i)) : NULL;
        cl_ulong kind = CL_MEM_READ_WRITE | (data ? CL_MEM_COPY_HOST_PTR : 0);
        buffers[i] = clCreateBuffer(context, kind, size, data, &error);
        check(error, host_buffers[i].name);
        free(data);
    }
    for (int i = 0; i < HOST_LAUNCHES; ++i) {
        const struct host_launch *launch = &host_launches[i];
        cl_kernel kernel = kernel_of(context, device, launch);
        size_t group[2] = {(size_t)launch->group_x, (size_t)launch->group_y}, items[2] = {
            group[0] * host_groups(width, launch->pixels, launch->group_x),
            group[1] * host_groups(height, launch->rows, launch->group_y)};
        for (int k = 0; k < launch->count; ++k) {
            cl_uint place = (cl_uint)launch->arguments[k].place;
            int what = launch->arguments[k].buffer;
            if (what >= 0) {
                check(clSetKernelArg(kernel, place, sizeof buffers[what], &buffers[what]), launch->entry);
            } else {
                check(clSetKernelArg(kernel, place, sizeof(cl_int), what == HOST_ROWS ? &height : &width), "size");
            }
        }
        check(clEnqueueNDRangeKernel(queue, kernel, 2, NULL, items, group, 0, NULL, NULL), launch->entry);
    }
    size_t size = (size_t)HOST_COUNT * 3 * sizeof *result;
    check(clEnqueueReadBuffer(queue, buffers[HOST_RESULT], 1, 0, size, result, 0, NULL, NULL), "the result");
    return host_judge(result);
}
