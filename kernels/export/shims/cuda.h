#include <math.h>
#include <stddef.h>
#define __global__
#define __device__
#define __shared__ static
#define __align__(bytes) alignas(bytes)
#define __launch_bounds__(threads)
#define __syncthreads() wamnet_wait()
struct wamnet_place { unsigned int x, y, z; };
static thread_local wamnet_place blockIdx, blockDim, threadIdx;
template <class T> static inline T min(T a, T b) { return b < a ? b : a; }
template <class T> static inline T max(T a, T b) { return a < b ? b : a; }
struct alignas(16) int4 { int x, y, z, w; };
struct alignas(8) float2 { float x, y; };
static inline float2 make_float2(float x, float y) { return {x, y}; }
static inline int4 make_int4(int x, int y, int z, int w) { return {x, y, z, w}; }
static inline float __int_as_float(int bits) { return __builtin_bit_cast(float, bits); }
static inline int __dp4a(int a, int b, int sum)
{
    for (int shift = 0; shift < 32; shift += 8) {
        sum += (signed char)(a >> shift) * (signed char)(b >> shift);
    }
    return sum;
}
