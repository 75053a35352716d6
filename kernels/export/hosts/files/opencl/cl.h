/*
 * The part of OpenCL that the program uses, from the library of the system: it is loaded when the program starts.
 * With OpenCL's own headers and -lOpenCL, leave this file out. HOST_OPENCL names another library.
 */
#include <dlfcn.h>

typedef int32_t cl_int;
typedef uint32_t cl_uint;
typedef uint64_t cl_ulong;
typedef struct cl_any *cl_platform_id, *cl_device_id, *cl_context, *cl_command_queue, *cl_mem, *cl_program, *cl_kernel;

enum {
    CL_DEVICE_NAME = 0x102B,
    CL_PROGRAM_BUILD_LOG = 0x1183,
    CL_MEM_READ_WRITE = 1,
    CL_MEM_COPY_HOST_PTR = 32
};
#define CL_DEVICE_TYPE_ALL 0xFFFFFFFFu

static cl_int (*clGetPlatformIDs)(cl_uint, cl_platform_id *, cl_uint *);
static cl_int (*clGetDeviceIDs)(cl_platform_id, cl_ulong, cl_uint, cl_device_id *, cl_uint *);
static cl_int (*clGetDeviceInfo)(cl_device_id, cl_uint, size_t, void *, size_t *);
static cl_context (*clCreateContext)(const void *, cl_uint, const cl_device_id *, void *, void *, cl_int *);
static cl_command_queue (*clCreateCommandQueue)(cl_context, cl_device_id, cl_ulong, cl_int *);
static cl_mem (*clCreateBuffer)(cl_context, cl_ulong, size_t, void *, cl_int *);
static cl_program (*clCreateProgramWithSource)(cl_context, cl_uint, const char *const *, const size_t *, cl_int *);
static cl_int (*clBuildProgram)(cl_program, cl_uint, const cl_device_id *, const char *, void *, void *);
static cl_int (*clGetProgramBuildInfo)(cl_program, cl_device_id, cl_uint, size_t, void *, size_t *);
static cl_kernel (*clCreateKernel)(cl_program, const char *, cl_int *);
static cl_int (*clSetKernelArg)(cl_kernel, cl_uint, size_t, const void *);
static cl_int (*clEnqueueNDRangeKernel)(
    cl_command_queue, cl_kernel, cl_uint, const size_t *, const size_t *, const size_t *, cl_uint, const void *, void *);
static cl_int (*clEnqueueReadBuffer)(
    cl_command_queue, cl_mem, cl_uint, size_t, size_t, void *, cl_uint, const void *, void *);

/* A function of the library: C has no conversion from an address of data, so that its bytes are copied. */
static void opencl_find(void *library, const char *name, void *function)
{
    void *found = dlsym(library, name);
    if (!found) {
        host_stop("OpenCL's library lacks it", name);
    }
    memcpy(function, &found, sizeof found);
}

static void opencl_load(void)
{
    const char *name = getenv("HOST_OPENCL") ? getenv("HOST_OPENCL") : "libOpenCL.so.1";
    void *library = dlopen(name, RTLD_NOW);
    if (!library) {
        host_stop("cannot be loaded: install OpenCL's loader, such as ocl-icd-libopencl1", name);
    }
    opencl_find(library, "clGetPlatformIDs", &clGetPlatformIDs);
    opencl_find(library, "clGetDeviceIDs", &clGetDeviceIDs);
    opencl_find(library, "clGetDeviceInfo", &clGetDeviceInfo);
    opencl_find(library, "clCreateContext", &clCreateContext);
    opencl_find(library, "clCreateCommandQueue", &clCreateCommandQueue);
    opencl_find(library, "clCreateBuffer", &clCreateBuffer);
    opencl_find(library, "clCreateProgramWithSource", &clCreateProgramWithSource);
    opencl_find(library, "clBuildProgram", &clBuildProgram);
    opencl_find(library, "clGetProgramBuildInfo", &clGetProgramBuildInfo);
    opencl_find(library, "clCreateKernel", &clCreateKernel);
    opencl_find(library, "clSetKernelArg", &clSetKernelArg);
    opencl_find(library, "clEnqueueNDRangeKernel", &clEnqueueNDRangeKernel);
    opencl_find(library, "clEnqueueReadBuffer", &clEnqueueReadBuffer);
}
