/*
 * wamnet encoding of features, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   cf07bdfe96991f4423c0748c87bd0d5b
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.5) clipped to 0 .. 1 (IEC 61966-2-1)
 *           normal: 3 channels in [-1.0, 1.0], unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 *           albedo: 3 channels in [0.0, 1.0], linear reflectance clipped to 0 .. 1, mean over samples; 0 where nothing is hit
 *           depth: 1 channels in [0.0, 1.0], distance along the ray / 12.0, clipped to 0 .. 1; 0 where nothing is hit
 *           position: 3 channels in [-1.0, 1.0], (world position - (0.1, -0.2, 0.3)) / 6.0, clipped to -1 .. 1; a miss is at 0
 *           direction: 3 channels in [-1.0, 1.0], unit direction of the camera ray in world space
 *           unshadowed: 3 channels in [0.0, 1.0], the lamps' radiance off the first hit, were it matt and nothing in between: sRGB of (linear radiance * 2^0.5) clipped to 0 .. 1 (IEC 61966-2-1)
 *           highlights: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^(0.5 - 4)) clipped to 0 .. 1: what color clips
 * bound     at given sums: see the rules for each operation
 * arguments sums: planes of height rows of width floats:
 *           color_r, color_g, color_b, normal_x, normal_y, normal_z, albedo_r, albedo_g, albedo_b, depth,
 *           position_x, position_y, position_z, direction_x, direction_y, direction_z, unshadowed_r,
 *           unshadowed_g, unshadowed_b;
 *           image_color: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_normal: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_albedo: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_depth: width * height * 1 floats, rows from the top, channels interleaved;
 *           image_position: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_direction: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_unshadowed: width * height * 3 floats, rows from the top, channels interleaved;
 *           image_highlights: width * height * 3 floats, rows from the top, channels interleaved;
 *           width; height; row_stride: floats from row to row of a plane; plane_stride: and from plane to plane; sample_count.
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
    __global float *restrict image_unshadowed,
    __global float *restrict image_highlights,
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
    size_t stride = (size_t)row_stride;
    size_t plane = (size_t)plane_stride;
    size_t at = (size_t)y * stride + (size_t)x;
    size_t place = (size_t)y * (size_t)width + (size_t)x;
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
    float unshadowed_r = sums[16 * plane + at];
    float unshadowed_g = sums[17 * plane + at];
    float unshadowed_b = sums[18 * plane + at];
    float t20 = color_r / samples;
    float t21 = color_g / samples;
    float t22 = color_b / samples;
    float t24 = t20 * 1.41421354f;
    float t25 = t21 * 1.41421354f;
    float t26 = t22 * 1.41421354f;
    float t28 = fmax(t24, 0.0f);
    float t29 = fmax(t25, 0.0f);
    float t30 = fmax(t26, 0.0f);
    float t32 = fmin(t28, 1.0f);
    float t33 = fmin(t29, 1.0f);
    float t34 = fmin(t30, 1.0f);
    float t36 = fmax(t32, 0.00313080009f);
    float t37 = fmax(t33, 0.00313080009f);
    float t38 = fmax(t34, 0.00313080009f);
    float t40 = exp2(0.416666657f * log2(t36));
    float t41 = exp2(0.416666657f * log2(t37));
    float t42 = exp2(0.416666657f * log2(t38));
    float t44 = 1.05499995f * t40;
    float t45 = 1.05499995f * t41;
    float t46 = 1.05499995f * t42;
    float t48 = t44 - 0.0549999997f;
    float t49 = t45 - 0.0549999997f;
    float t50 = t46 - 0.0549999997f;
    bool t51 = t32 <= 0.00313080009f;
    bool t52 = t33 <= 0.00313080009f;
    bool t53 = t34 <= 0.00313080009f;
    float t55 = 12.9200001f * t32;
    float t56 = 12.9200001f * t33;
    float t57 = 12.9200001f * t34;
    float t58 = t51 ? t55 : t48;
    float t59 = t52 ? t56 : t49;
    float t60 = t53 ? t57 : t50;
    float t61 = fmax(t58, 0.0f);
    float t62 = fmax(t59, 0.0f);
    float t63 = fmax(t60, 0.0f);
    float t64 = fmin(t61, 1.0f);
    float t65 = fmin(t62, 1.0f);
    float t66 = fmin(t63, 1.0f);
    float t67 = normal_x / samples;
    float t68 = normal_y / samples;
    float t69 = normal_z / samples;
    float t71 = fmax(t67, (-1.0f));
    float t72 = fmax(t68, (-1.0f));
    float t73 = fmax(t69, (-1.0f));
    float t74 = fmin(t71, 1.0f);
    float t75 = fmin(t72, 1.0f);
    float t76 = fmin(t73, 1.0f);
    float t77 = fmax(t74, (-1.0f));
    float t78 = fmax(t75, (-1.0f));
    float t79 = fmax(t76, (-1.0f));
    float t80 = fmin(t77, 1.0f);
    float t81 = fmin(t78, 1.0f);
    float t82 = fmin(t79, 1.0f);
    float t83 = albedo_r / samples;
    float t84 = albedo_g / samples;
    float t85 = albedo_b / samples;
    float t86 = fmax(t83, 0.0f);
    float t87 = fmax(t84, 0.0f);
    float t88 = fmax(t85, 0.0f);
    float t89 = fmin(t86, 1.0f);
    float t90 = fmin(t87, 1.0f);
    float t91 = fmin(t88, 1.0f);
    float t92 = fmax(t89, 0.0f);
    float t93 = fmax(t90, 0.0f);
    float t94 = fmax(t91, 0.0f);
    float t95 = fmin(t92, 1.0f);
    float t96 = fmin(t93, 1.0f);
    float t97 = fmin(t94, 1.0f);
    float t98 = depth / samples;
    float t100 = t98 / 12.0f;
    float t101 = fmax(t100, 0.0f);
    float t102 = fmin(t101, 1.0f);
    float t103 = fmax(t102, 0.0f);
    float t104 = fmin(t103, 1.0f);
    float t105 = position_x / samples;
    float t106 = position_y / samples;
    float t107 = position_z / samples;
    float t109 = t105 - 0.100000001f;
    float t111 = t106 - (-0.200000003f);
    float t113 = t107 - 0.300000012f;
    float t115 = t109 / 6.0f;
    float t116 = t111 / 6.0f;
    float t117 = t113 / 6.0f;
    float t118 = fmax(t115, (-1.0f));
    float t119 = fmax(t116, (-1.0f));
    float t120 = fmax(t117, (-1.0f));
    float t121 = fmin(t118, 1.0f);
    float t122 = fmin(t119, 1.0f);
    float t123 = fmin(t120, 1.0f);
    float t124 = fmax(t121, (-1.0f));
    float t125 = fmax(t122, (-1.0f));
    float t126 = fmax(t123, (-1.0f));
    float t127 = fmin(t124, 1.0f);
    float t128 = fmin(t125, 1.0f);
    float t129 = fmin(t126, 1.0f);
    float t130 = direction_x / samples;
    float t131 = direction_y / samples;
    float t132 = direction_z / samples;
    float t133 = fmax(t130, (-1.0f));
    float t134 = fmax(t131, (-1.0f));
    float t135 = fmax(t132, (-1.0f));
    float t136 = fmin(t133, 1.0f);
    float t137 = fmin(t134, 1.0f);
    float t138 = fmin(t135, 1.0f);
    float t139 = fmax(t136, (-1.0f));
    float t140 = fmax(t137, (-1.0f));
    float t141 = fmax(t138, (-1.0f));
    float t142 = fmin(t139, 1.0f);
    float t143 = fmin(t140, 1.0f);
    float t144 = fmin(t141, 1.0f);
    float t145 = unshadowed_r / samples;
    float t146 = unshadowed_g / samples;
    float t147 = unshadowed_b / samples;
    float t148 = t145 * 1.41421354f;
    float t149 = t146 * 1.41421354f;
    float t150 = t147 * 1.41421354f;
    float t151 = fmax(t148, 0.0f);
    float t152 = fmax(t149, 0.0f);
    float t153 = fmax(t150, 0.0f);
    float t154 = fmin(t151, 1.0f);
    float t155 = fmin(t152, 1.0f);
    float t156 = fmin(t153, 1.0f);
    float t157 = fmax(t154, 0.00313080009f);
    float t158 = fmax(t155, 0.00313080009f);
    float t159 = fmax(t156, 0.00313080009f);
    float t160 = exp2(0.416666657f * log2(t157));
    float t161 = exp2(0.416666657f * log2(t158));
    float t162 = exp2(0.416666657f * log2(t159));
    float t163 = 1.05499995f * t160;
    float t164 = 1.05499995f * t161;
    float t165 = 1.05499995f * t162;
    float t166 = t163 - 0.0549999997f;
    float t167 = t164 - 0.0549999997f;
    float t168 = t165 - 0.0549999997f;
    bool t169 = t154 <= 0.00313080009f;
    bool t170 = t155 <= 0.00313080009f;
    bool t171 = t156 <= 0.00313080009f;
    float t172 = 12.9200001f * t154;
    float t173 = 12.9200001f * t155;
    float t174 = 12.9200001f * t156;
    float t175 = t169 ? t172 : t166;
    float t176 = t170 ? t173 : t167;
    float t177 = t171 ? t174 : t168;
    float t178 = fmax(t175, 0.0f);
    float t179 = fmax(t176, 0.0f);
    float t180 = fmax(t177, 0.0f);
    float t181 = fmin(t178, 1.0f);
    float t182 = fmin(t179, 1.0f);
    float t183 = fmin(t180, 1.0f);
    float t185 = t20 * 0.0883883461f;
    float t186 = t21 * 0.0883883461f;
    float t187 = t22 * 0.0883883461f;
    float t188 = fmax(t185, 0.0f);
    float t189 = fmax(t186, 0.0f);
    float t190 = fmax(t187, 0.0f);
    float t191 = fmin(t188, 1.0f);
    float t192 = fmin(t189, 1.0f);
    float t193 = fmin(t190, 1.0f);
    float t194 = fmax(t191, 0.00313080009f);
    float t195 = fmax(t192, 0.00313080009f);
    float t196 = fmax(t193, 0.00313080009f);
    float t197 = exp2(0.416666657f * log2(t194));
    float t198 = exp2(0.416666657f * log2(t195));
    float t199 = exp2(0.416666657f * log2(t196));
    float t200 = 1.05499995f * t197;
    float t201 = 1.05499995f * t198;
    float t202 = 1.05499995f * t199;
    float t203 = t200 - 0.0549999997f;
    float t204 = t201 - 0.0549999997f;
    float t205 = t202 - 0.0549999997f;
    bool t206 = t191 <= 0.00313080009f;
    bool t207 = t192 <= 0.00313080009f;
    bool t208 = t193 <= 0.00313080009f;
    float t209 = 12.9200001f * t191;
    float t210 = 12.9200001f * t192;
    float t211 = 12.9200001f * t193;
    float t212 = t206 ? t209 : t203;
    float t213 = t207 ? t210 : t204;
    float t214 = t208 ? t211 : t205;
    float t215 = fmax(t212, 0.0f);
    float t216 = fmax(t213, 0.0f);
    float t217 = fmax(t214, 0.0f);
    float t218 = fmin(t215, 1.0f);
    float t219 = fmin(t216, 1.0f);
    float t220 = fmin(t217, 1.0f);
    image_color[place * 3 + 0] = t64;
    image_color[place * 3 + 1] = t65;
    image_color[place * 3 + 2] = t66;
    image_normal[place * 3 + 0] = t80;
    image_normal[place * 3 + 1] = t81;
    image_normal[place * 3 + 2] = t82;
    image_albedo[place * 3 + 0] = t95;
    image_albedo[place * 3 + 1] = t96;
    image_albedo[place * 3 + 2] = t97;
    image_depth[place * 1 + 0] = t104;
    image_position[place * 3 + 0] = t127;
    image_position[place * 3 + 1] = t128;
    image_position[place * 3 + 2] = t129;
    image_direction[place * 3 + 0] = t142;
    image_direction[place * 3 + 1] = t143;
    image_direction[place * 3 + 2] = t144;
    image_unshadowed[place * 3 + 0] = t181;
    image_unshadowed[place * 3 + 1] = t182;
    image_unshadowed[place * 3 + 2] = t183;
    image_highlights[place * 3 + 0] = t218;
    image_highlights[place * 3 + 1] = t219;
    image_highlights[place * 3 + 2] = t220;
}
