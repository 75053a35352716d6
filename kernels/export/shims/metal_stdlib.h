#define kernel
#define device
#define constant const
#define threadgroup static
#define thread
typedef unsigned int uint;
struct uint2 { uint x, y; };
namespace metal {
struct alignas(8) float2 {
    float x, y;
    float2(float a, float b) : x(a), y(b) {}
};
struct alignas(16) float4 {
    float x, y, z, w;
    float4() = default;
    explicit float4(float all) : x(all), y(all), z(all), w(all) {}
    float4(float a, float b, float c, float d) : x(a), y(b), z(c), w(d) {}
};
static inline float4 operator*(float4 a, float b) { return float4(a.x * b, a.y * b, a.z * b, a.w * b); }
static inline void operator+=(float4 &a, float4 b)
{
    a = float4(a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w);
}
static inline void operator-=(float4 &a, float4 b) { a += b * -1.0f; }
enum class mem_flags { mem_threadgroup };
static inline void threadgroup_barrier(mem_flags) { wamnet_wait(); }
static inline float fabs(float x) { return __builtin_fabsf(x); }
static inline float floor(float x) { return __builtin_floorf(x); }
static inline float sqrt(float x) { return __builtin_sqrtf(x); }
static inline float sin(float x) { return __builtin_sinf(x); }
static inline float cos(float x) { return __builtin_cosf(x); }
static inline float pow(float x, float y) { return __builtin_powf(x, y); }
template <class T> static inline T min(T a, T b) { return b < a ? b : a; }
template <class T> static inline T max(T a, T b) { return a < b ? b : a; }
static inline int clamp(int x, int low, int high) { return min(max(x, low), high); }
}
