/*
 * wamnet encoding of features, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   c454be95ff47b7649e8dc8ee54607581
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.5) clipped to 0 .. 1 (IEC 61966-2-1)
 *           normal: 3 channels in [-1.0, 1.0], unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 *           albedo: 3 channels in [0.0, 1.0], linear reflectance clipped to 0 .. 1, mean over samples; 0 where nothing is hit
 *           depth: 1 channels in [0.0, 1.0], distance along the ray / 12.0, clipped to 0 .. 1; 0 where nothing is hit
 *           position: 3 channels in [-1.0, 1.0], (world position - (0.1, -0.2, 0.3)) / 6.0, clipped to -1 .. 1; a miss is at 0
 *           direction: 3 channels in [-1.0, 1.0], unit direction of the camera ray in world space
 * bound     at given sums: see the rules for each operation
 * arguments sums: float, one plane of plane_stride numbers for each of:
 *           color_r, color_g, color_b, normal_x, normal_y, normal_z, albedo_r, albedo_g, albedo_b, depth,
 *           position_x, position_y, position_z, direction_x, direction_y, direction_z;
 *           each image: width * height * channels floats, rows from the top, channels interleaved;
 *           width; height; row_stride: numbers from row to row of a plane; plane_stride; sample_count.
 *           Global size: at least (width, height)
 */
__kernel void wamnet_encode(
    __global const float *restrict sums,
    __global float *restrict image_color,
    __global float *restrict image_normal,
    __global float *restrict image_albedo,
    __global float *restrict image_depth,
    __global float *restrict image_position,
    __global float *restrict image_direction,
    int width,
    int height,
    int row_stride,
    int plane_stride,
    int sample_count)
{
    int x = (int)get_global_id(0);
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {
        return;
    }
    size_t at = (size_t)y * (size_t)row_stride + (size_t)x;
    size_t plane = (size_t)plane_stride;
    size_t pixel = (size_t)y * (size_t)width + (size_t)x;
    float samples = (float)sample_count;
    float color_r = sums[0 * plane + at];
    float color_g = sums[1 * plane + at];
    float color_b = sums[2 * plane + at];
    float normal_x = sums[3 * plane + at];
    float normal_y = sums[4 * plane + at];
    float normal_z = sums[5 * plane + at];
    float albedo_r = sums[6 * plane + at];
    float albedo_g = sums[7 * plane + at];
    float albedo_b = sums[8 * plane + at];
    float depth = sums[9 * plane + at];
    float position_x = sums[10 * plane + at];
    float position_y = sums[11 * plane + at];
    float position_z = sums[12 * plane + at];
    float direction_x = sums[13 * plane + at];
    float direction_y = sums[14 * plane + at];
    float direction_z = sums[15 * plane + at];
    float t17 = color_r / samples;
    float t18 = color_g / samples;
    float t19 = color_b / samples;
    float t21 = t17 * 1.41421354f;
    float t22 = t18 * 1.41421354f;
    float t23 = t19 * 1.41421354f;
    float t25 = fmax(t21, 0.0f);
    float t26 = fmax(t22, 0.0f);
    float t27 = fmax(t23, 0.0f);
    float t29 = fmin(t25, 1.0f);
    float t30 = fmin(t26, 1.0f);
    float t31 = fmin(t27, 1.0f);
    float t33 = fmax(t29, 0.00313080009f);
    float t34 = fmax(t30, 0.00313080009f);
    float t35 = fmax(t31, 0.00313080009f);
    float t37 = exp2(0.416666657f * log2(t33));
    float t38 = exp2(0.416666657f * log2(t34));
    float t39 = exp2(0.416666657f * log2(t35));
    float t41 = 1.05499995f * t37;
    float t42 = 1.05499995f * t38;
    float t43 = 1.05499995f * t39;
    float t45 = t41 - 0.0549999997f;
    float t46 = t42 - 0.0549999997f;
    float t47 = t43 - 0.0549999997f;
    bool t48 = t29 <= 0.00313080009f;
    bool t49 = t30 <= 0.00313080009f;
    bool t50 = t31 <= 0.00313080009f;
    float t52 = 12.9200001f * t29;
    float t53 = 12.9200001f * t30;
    float t54 = 12.9200001f * t31;
    float t55 = t48 ? t52 : t45;
    float t56 = t49 ? t53 : t46;
    float t57 = t50 ? t54 : t47;
    float t58 = fmax(t55, 0.0f);
    float t59 = fmax(t56, 0.0f);
    float t60 = fmax(t57, 0.0f);
    float t61 = fmin(t58, 1.0f);
    float t62 = fmin(t59, 1.0f);
    float t63 = fmin(t60, 1.0f);
    float t64 = normal_x / samples;
    float t65 = normal_y / samples;
    float t66 = normal_z / samples;
    float t68 = fmax(t64, (-1.0f));
    float t69 = fmax(t65, (-1.0f));
    float t70 = fmax(t66, (-1.0f));
    float t71 = fmin(t68, 1.0f);
    float t72 = fmin(t69, 1.0f);
    float t73 = fmin(t70, 1.0f);
    float t74 = fmax(t71, (-1.0f));
    float t75 = fmax(t72, (-1.0f));
    float t76 = fmax(t73, (-1.0f));
    float t77 = fmin(t74, 1.0f);
    float t78 = fmin(t75, 1.0f);
    float t79 = fmin(t76, 1.0f);
    float t80 = albedo_r / samples;
    float t81 = albedo_g / samples;
    float t82 = albedo_b / samples;
    float t83 = fmax(t80, 0.0f);
    float t84 = fmax(t81, 0.0f);
    float t85 = fmax(t82, 0.0f);
    float t86 = fmin(t83, 1.0f);
    float t87 = fmin(t84, 1.0f);
    float t88 = fmin(t85, 1.0f);
    float t89 = fmax(t86, 0.0f);
    float t90 = fmax(t87, 0.0f);
    float t91 = fmax(t88, 0.0f);
    float t92 = fmin(t89, 1.0f);
    float t93 = fmin(t90, 1.0f);
    float t94 = fmin(t91, 1.0f);
    float t95 = depth / samples;
    float t97 = t95 / 12.0f;
    float t98 = fmax(t97, 0.0f);
    float t99 = fmin(t98, 1.0f);
    float t100 = fmax(t99, 0.0f);
    float t101 = fmin(t100, 1.0f);
    float t102 = position_x / samples;
    float t103 = position_y / samples;
    float t104 = position_z / samples;
    float t106 = t102 - 0.100000001f;
    float t108 = t103 - (-0.200000003f);
    float t110 = t104 - 0.300000012f;
    float t112 = t106 / 6.0f;
    float t113 = t108 / 6.0f;
    float t114 = t110 / 6.0f;
    float t115 = fmax(t112, (-1.0f));
    float t116 = fmax(t113, (-1.0f));
    float t117 = fmax(t114, (-1.0f));
    float t118 = fmin(t115, 1.0f);
    float t119 = fmin(t116, 1.0f);
    float t120 = fmin(t117, 1.0f);
    float t121 = fmax(t118, (-1.0f));
    float t122 = fmax(t119, (-1.0f));
    float t123 = fmax(t120, (-1.0f));
    float t124 = fmin(t121, 1.0f);
    float t125 = fmin(t122, 1.0f);
    float t126 = fmin(t123, 1.0f);
    float t127 = direction_x / samples;
    float t128 = direction_y / samples;
    float t129 = direction_z / samples;
    float t130 = fmax(t127, (-1.0f));
    float t131 = fmax(t128, (-1.0f));
    float t132 = fmax(t129, (-1.0f));
    float t133 = fmin(t130, 1.0f);
    float t134 = fmin(t131, 1.0f);
    float t135 = fmin(t132, 1.0f);
    float t136 = fmax(t133, (-1.0f));
    float t137 = fmax(t134, (-1.0f));
    float t138 = fmax(t135, (-1.0f));
    float t139 = fmin(t136, 1.0f);
    float t140 = fmin(t137, 1.0f);
    float t141 = fmin(t138, 1.0f);
    image_color[pixel * 3 + 0] = t61;
    image_color[pixel * 3 + 1] = t62;
    image_color[pixel * 3 + 2] = t63;
    image_normal[pixel * 3 + 0] = t77;
    image_normal[pixel * 3 + 1] = t78;
    image_normal[pixel * 3 + 2] = t79;
    image_albedo[pixel * 3 + 0] = t92;
    image_albedo[pixel * 3 + 1] = t93;
    image_albedo[pixel * 3 + 2] = t94;
    image_depth[pixel * 1 + 0] = t101;
    image_position[pixel * 3 + 0] = t124;
    image_position[pixel * 3 + 1] = t125;
    image_position[pixel * 3 + 2] = t126;
    image_direction[pixel * 3 + 0] = t139;
    image_direction[pixel * 3 + 1] = t140;
    image_direction[pixel * 3 + 2] = t141;
}
