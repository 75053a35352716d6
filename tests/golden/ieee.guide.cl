/*
 * wamnet edge-avoiding filter: a frame's light and guides, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   119d17075b06b6123094da326f61ecc5
 * bound     at given layers: see the rules for each operation
 * arguments image_color: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_normal: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_albedo: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_position: width * height * 3 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           image_depth: width * height * 1 floats, rows from the top, channels interleaved, not encoded,
 *           without NaN;
 *           guides: planes of height rows of row_stride floats:
 *           normal_x, normal_y, normal_z, albedo_x, albedo_y, albedo_z, position_x, position_y, position_z,
 *           factor_position_x;
 *           light: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           width; height; row_stride: at least width, a multiple of 16.
 *           Global size: at least (width, height)
 */
__kernel void wamnet_guide(
    __global const float *restrict image_color,
    __global const float *restrict image_normal,
    __global const float *restrict image_albedo,
    __global const float *restrict image_position,
    __global const float *restrict image_depth,
    __global float *restrict guides,
    __global float *restrict light,
    int width,
    int height,
    int row_stride)
{
    int x = (int)get_global_id(0);
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {
        return;
    }
    size_t stride = (size_t)row_stride;
    size_t plane = (size_t)height * stride;
    size_t at = (size_t)y * stride + (size_t)x;
    size_t place = (size_t)y * (size_t)width + (size_t)x;
    float color_0 = image_color[place * 3 + 0];
    float color_1 = image_color[place * 3 + 1];
    float color_2 = image_color[place * 3 + 2];
    float normal_0 = image_normal[place * 3 + 0];
    float normal_1 = image_normal[place * 3 + 1];
    float normal_2 = image_normal[place * 3 + 2];
    float albedo_0 = image_albedo[place * 3 + 0];
    float albedo_1 = image_albedo[place * 3 + 1];
    float albedo_2 = image_albedo[place * 3 + 2];
    float position_0 = image_position[place * 3 + 0];
    float position_1 = image_position[place * 3 + 1];
    float position_2 = image_position[place * 3 + 2];
    float depth_0 = image_depth[place * 1 + 0];
    float t14 = fmax(depth_0, 9.99999997e-07f);
    float t16 = fmin(t14, 1e+09f);
    float t19 = fmax(normal_0, (-1e+09f));
    float t20 = fmax(normal_1, (-1e+09f));
    float t21 = fmax(normal_2, (-1e+09f));
    float t22 = fmin(t19, 1e+09f);
    float t23 = fmin(t20, 1e+09f);
    float t24 = fmin(t21, 1e+09f);
    float t25 = fmax(albedo_0, (-1e+09f));
    float t26 = fmax(albedo_1, (-1e+09f));
    float t27 = fmax(albedo_2, (-1e+09f));
    float t28 = fmin(t25, 1e+09f);
    float t29 = fmin(t26, 1e+09f);
    float t30 = fmin(t27, 1e+09f);
    float t31 = fmax(position_0, (-1e+09f));
    float t32 = fmax(position_1, (-1e+09f));
    float t33 = fmax(position_2, (-1e+09f));
    float t34 = fmin(t31, 1e+09f);
    float t35 = fmin(t32, 1e+09f);
    float t36 = fmin(t33, 1e+09f);
    float t38 = 0.0799999982f * t16;
    float t39 = 1.0f / t38;
    float t41 = fmax(color_0, 0.0f);
    float t42 = fmax(color_1, 0.0f);
    float t43 = fmax(color_2, 0.0f);
    float t45 = fmin(t41, 45.2548332f);
    float t46 = fmin(t42, 45.2548332f);
    float t47 = fmin(t43, 45.2548332f);
    light[0 * plane + at] = t45;
    light[1 * plane + at] = t46;
    light[2 * plane + at] = t47;
    guides[0 * plane + at] = t22;
    guides[1 * plane + at] = t23;
    guides[2 * plane + at] = t24;
    guides[3 * plane + at] = t28;
    guides[4 * plane + at] = t29;
    guides[5 * plane + at] = t30;
    guides[6 * plane + at] = t34;
    guides[7 * plane + at] = t35;
    guides[8 * plane + at] = t36;
    guides[9 * plane + at] = t39;
}
