/*
 * wamnet encoding of features, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
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
 * arguments sums_0, sums_1, sums_2, sums_3, sums_4: RGBA textures of 32-bit floats, plane 4 k + c in component
 *           c of number k:
 *           color_r, color_g, color_b, normal_x, normal_y, normal_z, albedo_r, albedo_g, albedo_b, depth,
 *           position_x, position_y, position_z, direction_x, direction_y, direction_z, unshadowed_r,
 *           unshadowed_g, unshadowed_b;
 *           image_color: a float colour buffer, RGBA, of which 3 components are written;
 *           image_normal: a float colour buffer, RGBA, of which 3 components are written;
 *           image_albedo: a float colour buffer, RGBA, of which 3 components are written;
 *           image_depth: a float colour buffer, RGBA, of which 1 components are written;
 *           image_position: a float colour buffer, RGBA, of which 3 components are written;
 *           image_direction: a float colour buffer, RGBA, of which 3 components are written;
 *           image_unshadowed: a float colour buffer, RGBA, of which 3 components are written;
 *           image_highlights: a float colour buffer, RGBA, of which 3 components are written;
 *           sample_count.
 *           Draw one triangle that covers what is written: row 0 is the TOP row of all images
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
uniform sampler2D sums_4;
layout(location = 0) out vec4 image_color;
layout(location = 1) out vec4 image_normal;
layout(location = 2) out vec4 image_albedo;
layout(location = 3) out vec4 image_depth;
layout(location = 4) out vec4 image_position;
layout(location = 5) out vec4 image_direction;
layout(location = 6) out vec4 image_unshadowed;
layout(location = 7) out vec4 image_highlights;
uniform int sample_count;

void main()
{
    int x = int(gl_FragCoord.x);
    int y = int(gl_FragCoord.y);
    image_color = vec4(0.0);
    image_normal = vec4(0.0);
    image_albedo = vec4(0.0);
    image_depth = vec4(0.0);
    image_position = vec4(0.0);
    image_direction = vec4(0.0);
    image_unshadowed = vec4(0.0);
    image_highlights = vec4(0.0);
    PRECISE float samples = float(sample_count);
    float color_r = texelFetch(sums_0, ivec2(x, y), 0)[0];
    float color_g = texelFetch(sums_0, ivec2(x, y), 0)[1];
    float color_b = texelFetch(sums_0, ivec2(x, y), 0)[2];
    float normal_x = texelFetch(sums_0, ivec2(x, y), 0)[3];
    float normal_y = texelFetch(sums_1, ivec2(x, y), 0)[0];
    float normal_z = texelFetch(sums_1, ivec2(x, y), 0)[1];
    float albedo_r = texelFetch(sums_1, ivec2(x, y), 0)[2];
    float albedo_g = texelFetch(sums_1, ivec2(x, y), 0)[3];
    float albedo_b = texelFetch(sums_2, ivec2(x, y), 0)[0];
    float depth = texelFetch(sums_2, ivec2(x, y), 0)[1];
    float position_x = texelFetch(sums_2, ivec2(x, y), 0)[2];
    float position_y = texelFetch(sums_2, ivec2(x, y), 0)[3];
    float position_z = texelFetch(sums_3, ivec2(x, y), 0)[0];
    float direction_x = texelFetch(sums_3, ivec2(x, y), 0)[1];
    float direction_y = texelFetch(sums_3, ivec2(x, y), 0)[2];
    float direction_z = texelFetch(sums_3, ivec2(x, y), 0)[3];
    float unshadowed_r = texelFetch(sums_4, ivec2(x, y), 0)[0];
    float unshadowed_g = texelFetch(sums_4, ivec2(x, y), 0)[1];
    float unshadowed_b = texelFetch(sums_4, ivec2(x, y), 0)[2];
    PRECISE float t20 = color_r / samples;
    PRECISE float t21 = color_g / samples;
    PRECISE float t22 = color_b / samples;
    PRECISE float t24 = t20 * 1.41421354f;
    PRECISE float t25 = t21 * 1.41421354f;
    PRECISE float t26 = t22 * 1.41421354f;
    PRECISE float t28 = max(t24, 0.0f);
    PRECISE float t29 = max(t25, 0.0f);
    PRECISE float t30 = max(t26, 0.0f);
    PRECISE float t32 = min(t28, 1.0f);
    PRECISE float t33 = min(t29, 1.0f);
    PRECISE float t34 = min(t30, 1.0f);
    PRECISE float t36 = max(t32, 0.00313080009f);
    PRECISE float t37 = max(t33, 0.00313080009f);
    PRECISE float t38 = max(t34, 0.00313080009f);
    PRECISE float t40 = pow(t36, 0.416666657f);
    PRECISE float t41 = pow(t37, 0.416666657f);
    PRECISE float t42 = pow(t38, 0.416666657f);
    PRECISE float t44 = 1.05499995f * t40;
    PRECISE float t45 = 1.05499995f * t41;
    PRECISE float t46 = 1.05499995f * t42;
    PRECISE float t48 = t44 - 0.0549999997f;
    PRECISE float t49 = t45 - 0.0549999997f;
    PRECISE float t50 = t46 - 0.0549999997f;
    bool t51 = t32 <= 0.00313080009f;
    bool t52 = t33 <= 0.00313080009f;
    bool t53 = t34 <= 0.00313080009f;
    PRECISE float t55 = 12.9200001f * t32;
    PRECISE float t56 = 12.9200001f * t33;
    PRECISE float t57 = 12.9200001f * t34;
    PRECISE float t58 = t51 ? t55 : t48;
    PRECISE float t59 = t52 ? t56 : t49;
    PRECISE float t60 = t53 ? t57 : t50;
    PRECISE float t61 = max(t58, 0.0f);
    PRECISE float t62 = max(t59, 0.0f);
    PRECISE float t63 = max(t60, 0.0f);
    PRECISE float t64 = min(t61, 1.0f);
    PRECISE float t65 = min(t62, 1.0f);
    PRECISE float t66 = min(t63, 1.0f);
    PRECISE float t67 = normal_x / samples;
    PRECISE float t68 = normal_y / samples;
    PRECISE float t69 = normal_z / samples;
    PRECISE float t71 = max(t67, (-1.0f));
    PRECISE float t72 = max(t68, (-1.0f));
    PRECISE float t73 = max(t69, (-1.0f));
    PRECISE float t74 = min(t71, 1.0f);
    PRECISE float t75 = min(t72, 1.0f);
    PRECISE float t76 = min(t73, 1.0f);
    PRECISE float t77 = max(t74, (-1.0f));
    PRECISE float t78 = max(t75, (-1.0f));
    PRECISE float t79 = max(t76, (-1.0f));
    PRECISE float t80 = min(t77, 1.0f);
    PRECISE float t81 = min(t78, 1.0f);
    PRECISE float t82 = min(t79, 1.0f);
    PRECISE float t83 = albedo_r / samples;
    PRECISE float t84 = albedo_g / samples;
    PRECISE float t85 = albedo_b / samples;
    PRECISE float t86 = max(t83, 0.0f);
    PRECISE float t87 = max(t84, 0.0f);
    PRECISE float t88 = max(t85, 0.0f);
    PRECISE float t89 = min(t86, 1.0f);
    PRECISE float t90 = min(t87, 1.0f);
    PRECISE float t91 = min(t88, 1.0f);
    PRECISE float t92 = max(t89, 0.0f);
    PRECISE float t93 = max(t90, 0.0f);
    PRECISE float t94 = max(t91, 0.0f);
    PRECISE float t95 = min(t92, 1.0f);
    PRECISE float t96 = min(t93, 1.0f);
    PRECISE float t97 = min(t94, 1.0f);
    PRECISE float t98 = depth / samples;
    PRECISE float t100 = t98 / 12.0f;
    PRECISE float t101 = max(t100, 0.0f);
    PRECISE float t102 = min(t101, 1.0f);
    PRECISE float t103 = max(t102, 0.0f);
    PRECISE float t104 = min(t103, 1.0f);
    PRECISE float t105 = position_x / samples;
    PRECISE float t106 = position_y / samples;
    PRECISE float t107 = position_z / samples;
    PRECISE float t109 = t105 - 0.100000001f;
    PRECISE float t111 = t106 - (-0.200000003f);
    PRECISE float t113 = t107 - 0.300000012f;
    PRECISE float t115 = t109 / 6.0f;
    PRECISE float t116 = t111 / 6.0f;
    PRECISE float t117 = t113 / 6.0f;
    PRECISE float t118 = max(t115, (-1.0f));
    PRECISE float t119 = max(t116, (-1.0f));
    PRECISE float t120 = max(t117, (-1.0f));
    PRECISE float t121 = min(t118, 1.0f);
    PRECISE float t122 = min(t119, 1.0f);
    PRECISE float t123 = min(t120, 1.0f);
    PRECISE float t124 = max(t121, (-1.0f));
    PRECISE float t125 = max(t122, (-1.0f));
    PRECISE float t126 = max(t123, (-1.0f));
    PRECISE float t127 = min(t124, 1.0f);
    PRECISE float t128 = min(t125, 1.0f);
    PRECISE float t129 = min(t126, 1.0f);
    PRECISE float t130 = direction_x / samples;
    PRECISE float t131 = direction_y / samples;
    PRECISE float t132 = direction_z / samples;
    PRECISE float t133 = max(t130, (-1.0f));
    PRECISE float t134 = max(t131, (-1.0f));
    PRECISE float t135 = max(t132, (-1.0f));
    PRECISE float t136 = min(t133, 1.0f);
    PRECISE float t137 = min(t134, 1.0f);
    PRECISE float t138 = min(t135, 1.0f);
    PRECISE float t139 = max(t136, (-1.0f));
    PRECISE float t140 = max(t137, (-1.0f));
    PRECISE float t141 = max(t138, (-1.0f));
    PRECISE float t142 = min(t139, 1.0f);
    PRECISE float t143 = min(t140, 1.0f);
    PRECISE float t144 = min(t141, 1.0f);
    PRECISE float t145 = unshadowed_r / samples;
    PRECISE float t146 = unshadowed_g / samples;
    PRECISE float t147 = unshadowed_b / samples;
    PRECISE float t148 = t145 * 1.41421354f;
    PRECISE float t149 = t146 * 1.41421354f;
    PRECISE float t150 = t147 * 1.41421354f;
    PRECISE float t151 = max(t148, 0.0f);
    PRECISE float t152 = max(t149, 0.0f);
    PRECISE float t153 = max(t150, 0.0f);
    PRECISE float t154 = min(t151, 1.0f);
    PRECISE float t155 = min(t152, 1.0f);
    PRECISE float t156 = min(t153, 1.0f);
    PRECISE float t157 = max(t154, 0.00313080009f);
    PRECISE float t158 = max(t155, 0.00313080009f);
    PRECISE float t159 = max(t156, 0.00313080009f);
    PRECISE float t160 = pow(t157, 0.416666657f);
    PRECISE float t161 = pow(t158, 0.416666657f);
    PRECISE float t162 = pow(t159, 0.416666657f);
    PRECISE float t163 = 1.05499995f * t160;
    PRECISE float t164 = 1.05499995f * t161;
    PRECISE float t165 = 1.05499995f * t162;
    PRECISE float t166 = t163 - 0.0549999997f;
    PRECISE float t167 = t164 - 0.0549999997f;
    PRECISE float t168 = t165 - 0.0549999997f;
    bool t169 = t154 <= 0.00313080009f;
    bool t170 = t155 <= 0.00313080009f;
    bool t171 = t156 <= 0.00313080009f;
    PRECISE float t172 = 12.9200001f * t154;
    PRECISE float t173 = 12.9200001f * t155;
    PRECISE float t174 = 12.9200001f * t156;
    PRECISE float t175 = t169 ? t172 : t166;
    PRECISE float t176 = t170 ? t173 : t167;
    PRECISE float t177 = t171 ? t174 : t168;
    PRECISE float t178 = max(t175, 0.0f);
    PRECISE float t179 = max(t176, 0.0f);
    PRECISE float t180 = max(t177, 0.0f);
    PRECISE float t181 = min(t178, 1.0f);
    PRECISE float t182 = min(t179, 1.0f);
    PRECISE float t183 = min(t180, 1.0f);
    PRECISE float t185 = t20 * 0.0883883461f;
    PRECISE float t186 = t21 * 0.0883883461f;
    PRECISE float t187 = t22 * 0.0883883461f;
    PRECISE float t188 = max(t185, 0.0f);
    PRECISE float t189 = max(t186, 0.0f);
    PRECISE float t190 = max(t187, 0.0f);
    PRECISE float t191 = min(t188, 1.0f);
    PRECISE float t192 = min(t189, 1.0f);
    PRECISE float t193 = min(t190, 1.0f);
    PRECISE float t194 = max(t191, 0.00313080009f);
    PRECISE float t195 = max(t192, 0.00313080009f);
    PRECISE float t196 = max(t193, 0.00313080009f);
    PRECISE float t197 = pow(t194, 0.416666657f);
    PRECISE float t198 = pow(t195, 0.416666657f);
    PRECISE float t199 = pow(t196, 0.416666657f);
    PRECISE float t200 = 1.05499995f * t197;
    PRECISE float t201 = 1.05499995f * t198;
    PRECISE float t202 = 1.05499995f * t199;
    PRECISE float t203 = t200 - 0.0549999997f;
    PRECISE float t204 = t201 - 0.0549999997f;
    PRECISE float t205 = t202 - 0.0549999997f;
    bool t206 = t191 <= 0.00313080009f;
    bool t207 = t192 <= 0.00313080009f;
    bool t208 = t193 <= 0.00313080009f;
    PRECISE float t209 = 12.9200001f * t191;
    PRECISE float t210 = 12.9200001f * t192;
    PRECISE float t211 = 12.9200001f * t193;
    PRECISE float t212 = t206 ? t209 : t203;
    PRECISE float t213 = t207 ? t210 : t204;
    PRECISE float t214 = t208 ? t211 : t205;
    PRECISE float t215 = max(t212, 0.0f);
    PRECISE float t216 = max(t213, 0.0f);
    PRECISE float t217 = max(t214, 0.0f);
    PRECISE float t218 = min(t215, 1.0f);
    PRECISE float t219 = min(t216, 1.0f);
    PRECISE float t220 = min(t217, 1.0f);
    image_color[0] = t64;
    image_color[1] = t65;
    image_color[2] = t66;
    image_normal[0] = t80;
    image_normal[1] = t81;
    image_normal[2] = t82;
    image_albedo[0] = t95;
    image_albedo[1] = t96;
    image_albedo[2] = t97;
    image_depth[0] = t104;
    image_position[0] = t127;
    image_position[1] = t128;
    image_position[2] = t129;
    image_direction[0] = t142;
    image_direction[1] = t143;
    image_direction[2] = t144;
    image_unshadowed[0] = t181;
    image_unshadowed[1] = t182;
    image_unshadowed[2] = t183;
    image_highlights[0] = t218;
    image_highlights[1] = t219;
    image_highlights[2] = t220;
}
