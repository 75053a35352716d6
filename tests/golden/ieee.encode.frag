/*
 * wamnet encoding of features, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * program   c454be95ff47b7649e8dc8ee54607581
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.5) clipped to 0 .. 1 (IEC 61966-2-1)
 *           normal: 3 channels in [-1.0, 1.0], unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 *           albedo: 3 channels in [0.0, 1.0], linear reflectance clipped to 0 .. 1, mean over samples; 0 where nothing is hit
 *           depth: 1 channels in [0.0, 1.0], distance along the ray / 12.0, clipped to 0 .. 1; 0 where nothing is hit
 *           position: 3 channels in [-1.0, 1.0], (world position - (0.1, -0.2, 0.3)) / 6.0, clipped to -1 .. 1; a miss is at 0
 *           direction: 3 channels in [-1.0, 1.0], unit direction of the camera ray in world space
 * bound     at given sums: see the rules for each operation
 * arguments sums_0, sums_1, ...: RGBA textures of 32-bit floats; component c of sums_k is number 4 k + c of
 *           color_r, color_g, color_b, normal_x, normal_y, normal_z, albedo_r, albedo_g, albedo_b, depth,
 *           position_x, position_y, position_z, direction_x, direction_y, direction_z;
 *           sample_count;
 *           each image: a float colour buffer of the same size (RGBA; channels that a feature lacks mean
 *           nothing). Draw one triangle that covers them: row 0 stays row 0
 */
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
#endif
uniform sampler2D sums_0;
uniform sampler2D sums_1;
uniform sampler2D sums_2;
uniform sampler2D sums_3;
layout(location = 0) out vec4 image_color;
layout(location = 1) out vec4 image_normal;
layout(location = 2) out vec4 image_albedo;
layout(location = 3) out vec4 image_depth;
layout(location = 4) out vec4 image_position;
layout(location = 5) out vec4 image_direction;
uniform int sample_count;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    PRECISE float samples = float(sample_count);
    PRECISE float color_r = texelFetch(sums_0, at, 0)[0];
    PRECISE float color_g = texelFetch(sums_0, at, 0)[1];
    PRECISE float color_b = texelFetch(sums_0, at, 0)[2];
    PRECISE float normal_x = texelFetch(sums_0, at, 0)[3];
    PRECISE float normal_y = texelFetch(sums_1, at, 0)[0];
    PRECISE float normal_z = texelFetch(sums_1, at, 0)[1];
    PRECISE float albedo_r = texelFetch(sums_1, at, 0)[2];
    PRECISE float albedo_g = texelFetch(sums_1, at, 0)[3];
    PRECISE float albedo_b = texelFetch(sums_2, at, 0)[0];
    PRECISE float depth = texelFetch(sums_2, at, 0)[1];
    PRECISE float position_x = texelFetch(sums_2, at, 0)[2];
    PRECISE float position_y = texelFetch(sums_2, at, 0)[3];
    PRECISE float position_z = texelFetch(sums_3, at, 0)[0];
    PRECISE float direction_x = texelFetch(sums_3, at, 0)[1];
    PRECISE float direction_y = texelFetch(sums_3, at, 0)[2];
    PRECISE float direction_z = texelFetch(sums_3, at, 0)[3];
    PRECISE float t17 = color_r / samples;
    PRECISE float t18 = color_g / samples;
    PRECISE float t19 = color_b / samples;
    PRECISE float t21 = t17 * 1.41421354f;
    PRECISE float t22 = t18 * 1.41421354f;
    PRECISE float t23 = t19 * 1.41421354f;
    PRECISE float t25 = max(t21, 0.0f);
    PRECISE float t26 = max(t22, 0.0f);
    PRECISE float t27 = max(t23, 0.0f);
    PRECISE float t29 = min(t25, 1.0f);
    PRECISE float t30 = min(t26, 1.0f);
    PRECISE float t31 = min(t27, 1.0f);
    PRECISE float t33 = max(t29, 0.00313080009f);
    PRECISE float t34 = max(t30, 0.00313080009f);
    PRECISE float t35 = max(t31, 0.00313080009f);
    PRECISE float t37 = pow(t33, 0.416666657f);
    PRECISE float t38 = pow(t34, 0.416666657f);
    PRECISE float t39 = pow(t35, 0.416666657f);
    PRECISE float t41 = 1.05499995f * t37;
    PRECISE float t42 = 1.05499995f * t38;
    PRECISE float t43 = 1.05499995f * t39;
    PRECISE float t45 = t41 - 0.0549999997f;
    PRECISE float t46 = t42 - 0.0549999997f;
    PRECISE float t47 = t43 - 0.0549999997f;
    bool t48 = t29 <= 0.00313080009f;
    bool t49 = t30 <= 0.00313080009f;
    bool t50 = t31 <= 0.00313080009f;
    PRECISE float t52 = 12.9200001f * t29;
    PRECISE float t53 = 12.9200001f * t30;
    PRECISE float t54 = 12.9200001f * t31;
    PRECISE float t55 = t48 ? t52 : t45;
    PRECISE float t56 = t49 ? t53 : t46;
    PRECISE float t57 = t50 ? t54 : t47;
    PRECISE float t58 = max(t55, 0.0f);
    PRECISE float t59 = max(t56, 0.0f);
    PRECISE float t60 = max(t57, 0.0f);
    PRECISE float t61 = min(t58, 1.0f);
    PRECISE float t62 = min(t59, 1.0f);
    PRECISE float t63 = min(t60, 1.0f);
    PRECISE float t64 = normal_x / samples;
    PRECISE float t65 = normal_y / samples;
    PRECISE float t66 = normal_z / samples;
    PRECISE float t68 = max(t64, (-1.0f));
    PRECISE float t69 = max(t65, (-1.0f));
    PRECISE float t70 = max(t66, (-1.0f));
    PRECISE float t71 = min(t68, 1.0f);
    PRECISE float t72 = min(t69, 1.0f);
    PRECISE float t73 = min(t70, 1.0f);
    PRECISE float t74 = max(t71, (-1.0f));
    PRECISE float t75 = max(t72, (-1.0f));
    PRECISE float t76 = max(t73, (-1.0f));
    PRECISE float t77 = min(t74, 1.0f);
    PRECISE float t78 = min(t75, 1.0f);
    PRECISE float t79 = min(t76, 1.0f);
    PRECISE float t80 = albedo_r / samples;
    PRECISE float t81 = albedo_g / samples;
    PRECISE float t82 = albedo_b / samples;
    PRECISE float t83 = max(t80, 0.0f);
    PRECISE float t84 = max(t81, 0.0f);
    PRECISE float t85 = max(t82, 0.0f);
    PRECISE float t86 = min(t83, 1.0f);
    PRECISE float t87 = min(t84, 1.0f);
    PRECISE float t88 = min(t85, 1.0f);
    PRECISE float t89 = max(t86, 0.0f);
    PRECISE float t90 = max(t87, 0.0f);
    PRECISE float t91 = max(t88, 0.0f);
    PRECISE float t92 = min(t89, 1.0f);
    PRECISE float t93 = min(t90, 1.0f);
    PRECISE float t94 = min(t91, 1.0f);
    PRECISE float t95 = depth / samples;
    PRECISE float t97 = t95 / 12.0f;
    PRECISE float t98 = max(t97, 0.0f);
    PRECISE float t99 = min(t98, 1.0f);
    PRECISE float t100 = max(t99, 0.0f);
    PRECISE float t101 = min(t100, 1.0f);
    PRECISE float t102 = position_x / samples;
    PRECISE float t103 = position_y / samples;
    PRECISE float t104 = position_z / samples;
    PRECISE float t106 = t102 - 0.100000001f;
    PRECISE float t108 = t103 - (-0.200000003f);
    PRECISE float t110 = t104 - 0.300000012f;
    PRECISE float t112 = t106 / 6.0f;
    PRECISE float t113 = t108 / 6.0f;
    PRECISE float t114 = t110 / 6.0f;
    PRECISE float t115 = max(t112, (-1.0f));
    PRECISE float t116 = max(t113, (-1.0f));
    PRECISE float t117 = max(t114, (-1.0f));
    PRECISE float t118 = min(t115, 1.0f);
    PRECISE float t119 = min(t116, 1.0f);
    PRECISE float t120 = min(t117, 1.0f);
    PRECISE float t121 = max(t118, (-1.0f));
    PRECISE float t122 = max(t119, (-1.0f));
    PRECISE float t123 = max(t120, (-1.0f));
    PRECISE float t124 = min(t121, 1.0f);
    PRECISE float t125 = min(t122, 1.0f);
    PRECISE float t126 = min(t123, 1.0f);
    PRECISE float t127 = direction_x / samples;
    PRECISE float t128 = direction_y / samples;
    PRECISE float t129 = direction_z / samples;
    PRECISE float t130 = max(t127, (-1.0f));
    PRECISE float t131 = max(t128, (-1.0f));
    PRECISE float t132 = max(t129, (-1.0f));
    PRECISE float t133 = min(t130, 1.0f);
    PRECISE float t134 = min(t131, 1.0f);
    PRECISE float t135 = min(t132, 1.0f);
    PRECISE float t136 = max(t133, (-1.0f));
    PRECISE float t137 = max(t134, (-1.0f));
    PRECISE float t138 = max(t135, (-1.0f));
    PRECISE float t139 = min(t136, 1.0f);
    PRECISE float t140 = min(t137, 1.0f);
    PRECISE float t141 = min(t138, 1.0f);
    image_color[0] = t61;
    image_color[1] = t62;
    image_color[2] = t63;
    image_normal[0] = t77;
    image_normal[1] = t78;
    image_normal[2] = t79;
    image_albedo[0] = t92;
    image_albedo[1] = t93;
    image_albedo[2] = t94;
    image_depth[0] = t101;
    image_position[0] = t124;
    image_position[1] = t125;
    image_position[2] = t126;
    image_direction[0] = t139;
    image_direction[1] = t140;
    image_direction[2] = t141;
}
