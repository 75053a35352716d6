#version 450
#define PRECISE precise
#if defined(GL_EXT_integer_dot_product) && !defined(WAMNET_PORTABLE)
#define WAMNET_DOT_PRODUCT
#extension GL_EXT_integer_dot_product : require
#endif
/*
 * a tiny kernel
 */
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
#define GROUP_WIDTH 4 /* items of a group along a row */
#define GROUP_HEIGHT 2
#define PIXELS 1 /* pixels of an item, GROUP_WIDTH columns apart */
#define TILE_WIDTH (GROUP_WIDTH * PIXELS + WINDOW_SIZE - 1) /* all that windows touch */
#define TILE_HEIGHT (GROUP_HEIGHT + WINDOW_SIZE - 1)
#define PLANE (TILE_WIDTH * TILE_HEIGHT) /* values of a channel */
#define TILE_NUMBERS (PLANE * 2)
float elementwise_49_of_one(float v1, float v4, float v7)
{
    int t2 = int(v1);
    uint t3 = uint(t2);
    uint t5 = uint(v4);
    uint t6 = t3 * t5;
    uint t8 = uint(v7);
    uint t9 = t6 + t8;
    uint t11 = t9 >> 22u;
    uint t13 = t11 & 1u;
    uint t15 = 0u - t13;
    uint t16 = t9 ^ t15;
    uint t18 = t16 >> 6u;
    uint t20 = t18 & 65535u;
    uint t21 = t20 * t20;
    uint t23 = t21 >> 16u;
    uint t25 = t23 * 2332u;
    uint t26 = t25 >> 16u;
    uint t28 = 20871u - t26;
    uint t29 = t23 * t28;
    uint t30 = t29 >> 16u;
    uint t32 = 51053u - t30;
    uint t33 = t20 * t32;
    uint t35 = t33 + 8388608u;
    uint t37 = t35 >> 24u;
    uint t39 = min(t37, 127u);
    PRECISE float t40 = float(t39);
    uint t42 = t9 >> 23u;
    uint t43 = t42 & 1u;
    PRECISE float t44 = float(t43);
    PRECISE float t46 = 2.0f * t44;
    PRECISE float t48 = 1.0f - t46;
    PRECISE float t49 = t40 * t48;
    return t49;
}
vec4 elementwise_49(vec4 v1, vec4 v4, vec4 v7)
{
    return vec4(elementwise_49_of_one(v1.x, v4.x, v7.x), elementwise_49_of_one(v1.y, v4.y, v7.y), elementwise_49_of_one(v1.z, v4.z, v7.z), elementwise_49_of_one(v1.w, v4.w, v7.w));
}
float elementwise_67_of_one(float v50, float v52, float v55)
{
    int t51 = int(v50);
    int t53 = int(v52);
    int t54 = t51 * t53;
    int t56 = int(v55);
    int t57 = t54 + t56;
    int t59 = max(t57, 0);
    int t61 = min(t59, 16777216);
    uint t62 = uint(t61);
    uint t64 = t62 >> 8u;
    PRECISE float t65 = float(t64);
    PRECISE float t67 = t65 * 1.52587891e-05f;
    return t67;
}
vec4 elementwise_67(vec4 v50, vec4 v52, vec4 v55)
{
    return vec4(elementwise_67_of_one(v50.x, v52.x, v55.x), elementwise_67_of_one(v50.y, v52.y, v55.y), elementwise_67_of_one(v50.z, v52.z, v55.z), elementwise_67_of_one(v50.w, v52.w, v55.w));
}
layout(local_size_x = GROUP_WIDTH, local_size_y = GROUP_HEIGHT) in;
layout(std140, binding = 0) uniform Size {
    int width;
    int height;
};
layout(std430, binding = 1) restrict readonly buffer Weights { ivec4 w[]; };
layout(std430, binding = 2) restrict buffer Result { float result[]; };
layout(std430, binding = 3) restrict readonly buffer Image_a { float image_a[]; };
layout(std430, binding = 4) restrict readonly buffer Image_b { float image_b[]; };
shared int tile[TILE_NUMBERS];

int wamnet_packed(float a, float b, float c, float d)
{
    return (int(a) & 255) | ((int(b) & 255) << 8) | ((int(c) & 255) << 16) | (int(d) << 24);
}
ivec4 wamnet_dots(ivec4 sums, ivec4 weights, int word)
{
#ifdef WAMNET_DOT_PRODUCT
    int x = dotPacked4x8EXT(weights.x, word), y = dotPacked4x8EXT(weights.y, word);
    int z = dotPacked4x8EXT(weights.z, word), w = dotPacked4x8EXT(weights.w, word);
    return sums + ivec4(x, y, z, w);
#else
    return sums + (weights << 24 >> 24) * (word << 24 >> 24) + (weights << 16 >> 24) * (word << 16 >> 24)
        + (weights << 8 >> 24) * (word << 8 >> 24) + (weights >> 24) * (word >> 24);
#endif
}
vec4 wamnet_floats(ivec4 sums)
{
    return vec4(sums);
}
vec4 wamnet_numbers(ivec4 bits)
{
    return intBitsToFloat(bits);
}

void main()
{
    int local_x = int(gl_LocalInvocationID.x);
    int local_y = int(gl_LocalInvocationID.y);
    int item = local_y * GROUP_WIDTH + local_x;
    int x = int(gl_WorkGroupID.x) * (GROUP_WIDTH * PIXELS) + local_x;
    int y = int(gl_WorkGroupID.y) * GROUP_HEIGHT + local_y;
    int left = x - local_x - WINDOW_CENTRE;
    int top = y - local_y - WINDOW_CENTRE;

    /* %1: affine map W0 from 20 to 3 */
    ivec4 s1_0_0 = ivec4(0);
    for (int i = item; i < PLANE; i += GROUP_WIDTH * GROUP_HEIGHT) {
        int tile_row = top + i / TILE_WIDTH;
        int tile_column = left + i % TILE_WIDTH;
        int row = clamp(tile_row, 0, height - 1);
        int column = clamp(tile_column, 0, width - 1);
        bool inside = row == tile_row && column == tile_column;
        tile[i] = wamnet_packed(inside ? image_a[(row * width + column) * 3 + 0] : 0.0f, inside ? image_a[(row * width + column) * 3 + 1] : 0.0f, inside ? image_a[(row * width + column) * 3 + 2] : 0.0f, inside ? image_b[(row * width + column) * 2 + 0] : 0.0f);
        tile[PLANE + i] = wamnet_packed(inside ? image_b[(row * width + column) * 2 + 1] : 0.0f, 0.0f, 0.0f, 0.0f);
    }
    barrier();
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int at = (local_y + dy) * TILE_WIDTH + local_x + dx;
            int first = (dy * WINDOW_SIZE + dx) * 2;
            int x0_0 = tile[at];
            {
                ivec4 m = w[first];
                s1_0_0 = wamnet_dots(s1_0_0, m, x0_0);
            }
            int x1_0 = tile[PLANE + at];
            {
                ivec4 m = w[first + 1];
                s1_0_0 = wamnet_dots(s1_0_0, m, x1_0);
            }
        }
    }
    vec4 v1_0_0 = wamnet_floats(s1_0_0);

    /* %2 to %49: elementwise on 3 numbers */
    vec4 v49_0_0 = elementwise_49(v1_0_0, wamnet_numbers(w[8]), wamnet_numbers(w[9]));

    /* %50: affine map W1 from 3 to 3 */
    ivec4 s50_0_0 = ivec4(0);
    int b50_0_0 = wamnet_packed(v49_0_0.x, v49_0_0.y, v49_0_0.z, v49_0_0.w);
    {
        ivec4 m = w[10];
        s50_0_0 = wamnet_dots(s50_0_0, m, b50_0_0);
    }
    vec4 v50_0_0 = wamnet_floats(s50_0_0);

    /* %51 to %67: elementwise on 3 numbers */
    vec4 v67_0_0 = elementwise_67(v50_0_0, wamnet_numbers(w[11]), wamnet_numbers(w[12]));

    /* output color */
    if (x < width && y < height) {
        result[(y * width + x) * 3 + 0] = v67_0_0.x;
        result[(y * width + x) * 3 + 1] = v67_0_0.y;
        result[(y * width + x) * 3 + 2] = v67_0_0.z;
    }
}
