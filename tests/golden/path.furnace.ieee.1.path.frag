/*
 * wamnet path tracer, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * scene     furnace, digest 5426626d24f949194068d8efe6ece22f
 * paths     max_depth 3, roulette_depth None, strategy mis, heuristic power
 * schedule  1 path at once
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * bound     none: a path's decisions may fall differently near an edge
 * fixed     camera, time and all of the scene: another moment is another kernel
 * sums      row 0 is the picture's top row, in every language
 *           each plane but deviation_* is a sum over the samples: divide by their number, add over launches
 *           deviation_*: squared differences from the mean colour of this launch, summed; not to be added
 *           colour is linear radiance; depth is measured along the ray; normal, position and direction are those
 *           of world space; 0 where nothing is hit (a direction is always there)
 * arguments sums_0, sums_1, sums_2, sums_3, sums_4, sums_5: RGBA float colour buffers, plane 4 k + c in
 *           component c of number k:
 *           color_r, color_g, color_b, deviation_r, deviation_g, deviation_b, albedo_r, albedo_g, albedo_b,
 *           normal_x, normal_y, normal_z, depth, position_x, position_y, position_z, direction_x, direction_y,
 *           direction_z, unshadowed_r, unshadowed_g, unshadowed_b;
 *           width; height; first_row; first_sample; samples: to add up; seed_number.
 *           Draw one triangle that covers what is written: row 0 is the TOP row of all images; fragment (x, y) follows pixel x of row first_row + y
 */
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#define PRECISE
#endif
#define MAX_DEPTH 3 /* scatterings of a path */
layout(location = 0) out vec4 sums_0;
layout(location = 1) out vec4 sums_1;
layout(location = 2) out vec4 sums_2;
layout(location = 3) out vec4 sums_3;
layout(location = 4) out vec4 sums_4;
layout(location = 5) out vec4 sums_5;
uniform int width;
uniform int height;
uniform int first_row;
uniform uint first_sample;
uniform int samples;
uniform uint seed_number;

void main()
{
    int column = int(gl_FragCoord.x);
    int row = int(gl_FragCoord.y);
    uint x = uint(column);
    uint y = uint(row + first_row);
    uint seed = seed_number;
    float image_width = float(width);
    float image_height = float(height);
    float sum_color_r = 0.0f;
    float sum_color_g = 0.0f;
    float sum_color_b = 0.0f;
    float sum_deviation_r = 0.0f;
    float sum_deviation_g = 0.0f;
    float sum_deviation_b = 0.0f;
    float sum_albedo_r = 0.0f;
    float sum_albedo_g = 0.0f;
    float sum_albedo_b = 0.0f;
    float sum_normal_x = 0.0f;
    float sum_normal_y = 0.0f;
    float sum_normal_z = 0.0f;
    float sum_depth = 0.0f;
    float sum_position_x = 0.0f;
    float sum_position_y = 0.0f;
    float sum_position_z = 0.0f;
    float sum_direction_x = 0.0f;
    float sum_direction_y = 0.0f;
    float sum_direction_z = 0.0f;
    float sum_unshadowed_r = 0.0f;
    float sum_unshadowed_g = 0.0f;
    float sum_unshadowed_b = 0.0f;
    for (int n = 0; n < samples; ++n) {
        uint sample_number = first_sample + uint(n);
        uint pixel;
        float origin_x;
        float origin_y;
        float origin_z;
        float direction_x;
        float direction_y;
        float direction_z;
        float beta_r;
        float beta_g;
        float beta_b;
        float radiance_r;
        float radiance_g;
        float radiance_b;
        float pdf;
        float point_x;
        float point_y;
        float point_z;
        float normal_x;
        float normal_y;
        float normal_z;
        float reflectance_r;
        float reflectance_g;
        float reflectance_b;
        float t;
        int surface;
        bool alive = true;

        /* start: the path at the camera */
        {
            uint t7 = 65536u * y;
            uint t8 = x + t7;
            PRECISE float t9 = float(x);
            PRECISE float t10 = float(y);
            uint t12 = t8 * 1664525u;
            uint t14 = t12 + 1013904223u;
            uint t15 = sample_number * 1664525u;
            uint t16 = t15 + 1013904223u;
            uint t17 = seed * 1664525u;
            uint t18 = t17 + 1013904223u;
            uint t19 = t16 * t18;
            uint t20 = t14 + t19;
            uint t21 = 1013904223u * t20;
            uint t22 = t16 + t21;
            uint t23 = t20 * t22;
            uint t24 = 1013904223u + t23;
            uint t25 = t22 * t24;
            uint t26 = t18 + t25;
            uint t28 = t20 >> 16u;
            uint t29 = t20 ^ t28;
            uint t30 = t22 >> 16u;
            uint t31 = t22 ^ t30;
            uint t32 = t24 >> 16u;
            uint t33 = t24 ^ t32;
            uint t34 = t26 >> 16u;
            uint t35 = t26 ^ t34;
            uint t36 = t31 * t35;
            uint t37 = t29 + t36;
            uint t38 = t33 * t37;
            uint t39 = t31 + t38;
            uint t41 = t37 >> 8u;
            PRECISE float t42 = float(t41);
            PRECISE float t44 = t42 * 5.96046448e-08f;
            uint t45 = t39 >> 8u;
            PRECISE float t46 = float(t45);
            PRECISE float t47 = t46 * 5.96046448e-08f;
            PRECISE float t48 = t9 + t44;
            PRECISE float t50 = 2.0f * t48;
            PRECISE float t51 = t50 - image_width;
            PRECISE float t52 = t51 / image_height;
            PRECISE float t54 = t52 * 0.577350259f;
            PRECISE float t55 = t10 + t47;
            PRECISE float t56 = 2.0f * t55;
            PRECISE float t57 = image_height - t56;
            PRECISE float t58 = t57 / image_height;
            PRECISE float t59 = t58 * 0.577350259f;
            PRECISE float t63 = t54 * 0.998274386f;
            PRECISE float t64 = t54 * 0.0f;
            PRECISE float t65 = t54 * (-0.0587220229f);
            PRECISE float t69 = (-0.0583211854f) + t63;
            PRECISE float t70 = (-0.116642371f) + t64;
            PRECISE float t71 = (-0.991460145f) + t65;
            PRECISE float t75 = t59 * (-0.00684947567f);
            PRECISE float t76 = t59 * 0.993173957f;
            PRECISE float t77 = t59 * (-0.116441086f);
            PRECISE float t78 = t69 + t75;
            PRECISE float t79 = t70 + t76;
            PRECISE float t80 = t71 + t77;
            PRECISE float t81 = t78 * t78;
            PRECISE float t82 = t79 * t79;
            PRECISE float t83 = t81 + t82;
            PRECISE float t84 = t80 * t80;
            PRECISE float t85 = t83 + t84;
            PRECISE float t86 = sqrt(t85);
            PRECISE float t87 = t78 / t86;
            PRECISE float t88 = t79 / t86;
            PRECISE float t89 = t80 / t86;
            PRECISE float t90 = 0.0f * t87;
            PRECISE float t91 = 0.0f * t88;
            PRECISE float t92 = 0.0f * t89;
            PRECISE float t96 = 0.100000001f + t90;
            PRECISE float t97 = 0.200000003f + t91;
            PRECISE float t98 = 0.699999988f + t92;
            origin_x = t96;
            origin_y = t97;
            origin_z = t98;
            direction_x = t87;
            direction_y = t88;
            direction_z = t89;
            beta_r = 1.0f;
            beta_g = 1.0f;
            beta_b = 1.0f;
            radiance_r = 0.0f;
            radiance_g = 0.0f;
            radiance_b = 0.0f;
            pdf = 1.00000002e+30f;
            pixel = t8;
        }
        for (int bounce = 0; bounce < MAX_DEPTH + 1; ++bounce) {
            uint depth = uint(bounce);

            /* arrive: the next surface */
            {
                PRECISE float t16 = abs(direction_x);
                PRECISE float t17 = abs(direction_y);
                PRECISE float t18 = abs(direction_z);
                bool t19 = t16 < 1e-15f;
                bool t20 = t17 < 1e-15f;
                bool t21 = t18 < 1e-15f;
                bool t23 = direction_x < 0.0f;
                bool t24 = direction_y < 0.0f;
                bool t25 = direction_z < 0.0f;
                PRECISE float t27 = t23 ? (-1e-15f) : 1e-15f;
                PRECISE float t28 = t24 ? (-1e-15f) : 1e-15f;
                PRECISE float t29 = t25 ? (-1e-15f) : 1e-15f;
                PRECISE float t30 = t19 ? t27 : direction_x;
                PRECISE float t31 = t20 ? t28 : direction_y;
                PRECISE float t32 = t21 ? t29 : direction_z;
                PRECISE float t33 = 1.0f / t30;
                PRECISE float t34 = 1.0f / t31;
                PRECISE float t35 = 1.0f / t32;
                PRECISE float t36 = 0.0f - origin_x;
                PRECISE float t37 = 0.0f - origin_y;
                PRECISE float t38 = 0.0f - origin_z;
                PRECISE float t39 = t36 * t33;
                PRECISE float t40 = t37 * t34;
                PRECISE float t41 = t38 * t35;
                PRECISE float t42 = abs(t33);
                PRECISE float t43 = abs(t34);
                PRECISE float t44 = abs(t35);
                PRECISE float t46 = t39 - t42;
                PRECISE float t47 = t40 - t43;
                PRECISE float t48 = t41 - t44;
                PRECISE float t49 = t39 + t42;
                PRECISE float t50 = t40 + t43;
                PRECISE float t51 = t41 + t44;
                PRECISE float t52 = max(t46, t47);
                PRECISE float t53 = max(t52, t48);
                PRECISE float t54 = min(t49, t50);
                PRECISE float t55 = min(t54, t51);
                bool t56 = t53 <= t55;
                bool t57 = t55 > 0.0f;
                bool t58 = t56 && t57;
                PRECISE float t59 = t58 ? t55 : 1.00000002e+30f;
                bool t60 = t59 < 1.00000002e+30f;
                int t62 = t60 ? 0 : 6;
                PRECISE float t63 = min(1.00000002e+30f, t59);
                bool t64 = t62 == 0;
                bool t65 = direction_x > 0.0f;
                int t67 = t65 ? 1 : 0;
                bool t68 = direction_y > 0.0f;
                int t71 = t68 ? 3 : 2;
                bool t72 = direction_z > 0.0f;
                int t75 = t72 ? 5 : 4;
                bool t76 = t49 <= t50;
                bool t77 = t49 <= t51;
                bool t78 = t76 && t77;
                bool t79 = t50 <= t51;
                int t80 = t79 ? t71 : t75;
                int t81 = t78 ? t67 : t80;
                int t82 = t64 ? t81 : t62;
                bool t83 = t82 < 6;
                PRECISE float t84 = t83 ? t63 : 0.0f;
                PRECISE float t85 = direction_x * t84;
                PRECISE float t86 = direction_y * t84;
                PRECISE float t87 = direction_z * t84;
                PRECISE float t88 = origin_x + t85;
                PRECISE float t89 = origin_y + t86;
                PRECISE float t90 = origin_z + t87;
                PRECISE float t91 = t83 ? t88 : 0.0f;
                PRECISE float t92 = t83 ? t89 : 0.0f;
                PRECISE float t93 = t83 ? t90 : 0.0f;
                PRECISE float t95 = t65 ? (-1.0f) : 1.0f;
                PRECISE float t96 = t68 ? (-1.0f) : 1.0f;
                PRECISE float t97 = t72 ? (-1.0f) : 1.0f;
                PRECISE float t98 = t78 ? t95 : 0.0f;
                bool t99 = !t78;
                bool t100 = t99 && t79;
                PRECISE float t101 = t100 ? t96 : 0.0f;
                bool t102 = !t79;
                bool t103 = t99 && t102;
                PRECISE float t104 = t103 ? t97 : 0.0f;
                PRECISE float t105 = t83 ? t98 : 0.0f;
                PRECISE float t106 = t83 ? t101 : 0.0f;
                PRECISE float t107 = t83 ? t104 : 0.0f;
                PRECISE float t108 = t83 ? 1.0f : 0.0f;
                PRECISE float t110 = t83 ? 0.5f : 0.0f;
                PRECISE float t111 = beta_r * t108;
                PRECISE float t112 = beta_g * t108;
                PRECISE float t113 = beta_b * t108;
                PRECISE float t114 = radiance_r + t111;
                PRECISE float t115 = radiance_g + t112;
                PRECISE float t116 = radiance_b + t113;
                radiance_r = alive ? t114 : radiance_r;
                radiance_g = alive ? t115 : radiance_g;
                radiance_b = alive ? t116 : radiance_b;
                point_x = t91;
                point_y = t92;
                point_z = t93;
                normal_x = t105;
                normal_y = t106;
                normal_z = t107;
                reflectance_r = t110;
                reflectance_g = t110;
                reflectance_b = t110;
                t = t63;
                surface = t82;
            }
            if (bounce == 0) {

                /* look: the features of the first surface */
                {
                    bool t15 = surface < 6;
                    PRECISE float t17 = t15 ? t : 0.0f;
                    PRECISE float t18 = t15 ? point_x : 0.0f;
                    PRECISE float t19 = t15 ? point_y : 0.0f;
                    PRECISE float t20 = t15 ? point_z : 0.0f;
                    sum_albedo_r += reflectance_r;
                    sum_albedo_g += reflectance_g;
                    sum_albedo_b += reflectance_b;
                    sum_normal_x += normal_x;
                    sum_normal_y += normal_y;
                    sum_normal_z += normal_z;
                    sum_depth += t17;
                    sum_position_x += t18;
                    sum_position_y += t19;
                    sum_position_z += t20;
                    sum_direction_x += direction_x;
                    sum_direction_y += direction_y;
                    sum_direction_z += direction_z;
                    sum_unshadowed_r += 0.0f;
                    sum_unshadowed_g += 0.0f;
                    sum_unshadowed_b += 0.0f;
                }
            }
            if (bounce == MAX_DEPTH) {
                break;
            }

            /* scatter: the path goes on */
            {
                bool t29 = surface < 6;
                uint t31 = 2u * depth;
                uint t33 = 1u + t31;
                uint t35 = pixel * 1664525u;
                uint t37 = t35 + 1013904223u;
                uint t38 = sample_number * 1664525u;
                uint t39 = t38 + 1013904223u;
                uint t40 = seed * 1664525u;
                uint t41 = t40 + 1013904223u;
                uint t42 = t39 * t41;
                uint t43 = t37 + t42;
                uint t45 = t43 >> 16u;
                uint t46 = t43 ^ t45;
                PRECISE float t50 = t29 ? t : 0.0f;
                PRECISE float t51 = abs(point_x);
                PRECISE float t52 = abs(point_y);
                PRECISE float t53 = abs(point_z);
                PRECISE float t54 = max(t51, t52);
                PRECISE float t55 = max(t54, t53);
                PRECISE float t56 = t55 + t50;
                PRECISE float t58 = 3.81469727e-06f * t56;
                PRECISE float t59 = normal_x * t58;
                PRECISE float t60 = normal_y * t58;
                PRECISE float t61 = normal_z * t58;
                PRECISE float t62 = point_x + t59;
                PRECISE float t63 = point_y + t60;
                PRECISE float t64 = point_z + t61;
                PRECISE float t65 = beta_r * reflectance_r;
                PRECISE float t66 = beta_g * reflectance_g;
                PRECISE float t67 = beta_b * reflectance_b;
                uint t68 = t33 + 1u;
                uint t69 = t68 * 1664525u;
                uint t70 = t69 + 1013904223u;
                uint t71 = t70 * t43;
                uint t72 = t39 + t71;
                uint t73 = t43 * t72;
                uint t74 = t70 + t73;
                uint t75 = t72 * t74;
                uint t76 = t41 + t75;
                uint t77 = t72 >> 16u;
                uint t78 = t72 ^ t77;
                uint t79 = t74 >> 16u;
                uint t80 = t74 ^ t79;
                uint t81 = t76 >> 16u;
                uint t82 = t76 ^ t81;
                uint t83 = t78 * t82;
                uint t84 = t46 + t83;
                uint t85 = t80 * t84;
                uint t86 = t78 + t85;
                uint t87 = t84 >> 8u;
                PRECISE float t88 = float(t87);
                PRECISE float t89 = t88 * 5.96046448e-08f;
                uint t90 = t86 >> 8u;
                PRECISE float t91 = float(t90);
                PRECISE float t92 = t91 * 5.96046448e-08f;
                PRECISE float t94 = 2.0f * t89;
                PRECISE float t96 = t94 - 1.0f;
                PRECISE float t97 = 2.0f * t92;
                PRECISE float t98 = t97 - 1.0f;
                PRECISE float t99 = abs(t96);
                PRECISE float t100 = abs(t98);
                bool t101 = t99 > t100;
                PRECISE float t102 = t101 ? t96 : t98;
                PRECISE float t103 = t101 ? t98 : t96;
                bool t104 = t102 == 0.0f;
                PRECISE float t106 = t104 ? 1e-30f : t102;
                PRECISE float t107 = t103 / t106;
                PRECISE float t109 = 0.785398185f * t107;
                PRECISE float t111 = 1.57079637f - t109;
                PRECISE float t112 = t101 ? t109 : t111;
                PRECISE float t114 = t112 * 0.318309873f;
                PRECISE float t115 = t114 + 1.0f;
                PRECISE float t116 = floor(t115);
                PRECISE float t118 = t116 - 0.5f;
                PRECISE float t120 = t118 * 3.14160156f;
                PRECISE float t121 = t112 - t120;
                PRECISE float t123 = t118 * (-8.9071691e-06f);
                PRECISE float t124 = t121 - t123;
                PRECISE float t126 = t118 * (-1.74122761e-09f);
                PRECISE float t127 = t124 - t126;
                PRECISE float t128 = 0.5f * t116;
                PRECISE float t129 = floor(t128);
                PRECISE float t130 = 2.0f * t129;
                PRECISE float t131 = t116 - t130;
                PRECISE float t132 = 2.0f * t131;
                PRECISE float t133 = 1.0f - t132;
                PRECISE float t134 = t127 * t127;
                PRECISE float t136 = t134 * (-2.51969432e-08f);
                PRECISE float t138 = t136 + 2.76094511e-06f;
                PRECISE float t139 = t134 * t138;
                PRECISE float t141 = t139 + (-0.000198427704f);
                PRECISE float t142 = t134 * t141;
                PRECISE float t144 = t142 + 0.00833334867f;
                PRECISE float t145 = t134 * t144;
                PRECISE float t147 = t145 + (-0.166666672f);
                PRECISE float t148 = t134 * t147;
                PRECISE float t149 = t127 * t148;
                PRECISE float t150 = t127 + t149;
                PRECISE float t151 = t133 * t150;
                PRECISE float t152 = min(t151, 1.0f);
                PRECISE float t154 = max(t152, (-1.0f));
                PRECISE float t155 = abs(t112);
                bool t157 = t155 <= 6400.0f;
                PRECISE float t158 = t112 - t112;
                PRECISE float t159 = t157 ? t154 : t158;
                PRECISE float t160 = t102 * t159;
                PRECISE float t161 = t114 + 0.5f;
                PRECISE float t162 = floor(t161);
                PRECISE float t163 = t162 * 3.14160156f;
                PRECISE float t164 = t112 - t163;
                PRECISE float t165 = t162 * (-8.9071691e-06f);
                PRECISE float t166 = t164 - t165;
                PRECISE float t167 = t162 * (-1.74122761e-09f);
                PRECISE float t168 = t166 - t167;
                PRECISE float t169 = 0.5f * t162;
                PRECISE float t170 = floor(t169);
                PRECISE float t171 = 2.0f * t170;
                PRECISE float t172 = t162 - t171;
                PRECISE float t173 = 2.0f * t172;
                PRECISE float t174 = 1.0f - t173;
                PRECISE float t175 = t168 * t168;
                PRECISE float t176 = t175 * (-2.51969432e-08f);
                PRECISE float t177 = t176 + 2.76094511e-06f;
                PRECISE float t178 = t175 * t177;
                PRECISE float t179 = t178 + (-0.000198427704f);
                PRECISE float t180 = t175 * t179;
                PRECISE float t181 = t180 + 0.00833334867f;
                PRECISE float t182 = t175 * t181;
                PRECISE float t183 = t182 + (-0.166666672f);
                PRECISE float t184 = t175 * t183;
                PRECISE float t185 = t168 * t184;
                PRECISE float t186 = t168 + t185;
                PRECISE float t187 = t174 * t186;
                PRECISE float t188 = min(t187, 1.0f);
                PRECISE float t189 = max(t188, (-1.0f));
                bool t191 = t155 <= 12800.0f;
                PRECISE float t192 = t191 ? t189 : t158;
                PRECISE float t193 = t102 * t192;
                PRECISE float t194 = t160 * t160;
                PRECISE float t195 = 1.0f - t194;
                PRECISE float t196 = t193 * t193;
                PRECISE float t197 = t195 - t196;
                PRECISE float t198 = max(0.0f, t197);
                PRECISE float t199 = sqrt(t198);
                bool t200 = normal_z < 0.0f;
                PRECISE float t201 = t200 ? (-1.0f) : 1.0f;
                PRECISE float t202 = t201 + normal_z;
                PRECISE float t203 = (-1.0f) / t202;
                PRECISE float t204 = normal_x * normal_y;
                PRECISE float t205 = t204 * t203;
                PRECISE float t206 = t201 * normal_x;
                PRECISE float t207 = t206 * normal_x;
                PRECISE float t208 = t207 * t203;
                PRECISE float t209 = 1.0f + t208;
                PRECISE float t210 = t201 * t205;
                PRECISE float t211 = -t201;
                PRECISE float t212 = t211 * normal_x;
                PRECISE float t213 = normal_y * normal_y;
                PRECISE float t214 = t213 * t203;
                PRECISE float t215 = t201 + t214;
                PRECISE float t216 = -normal_y;
                PRECISE float t217 = t209 * t160;
                PRECISE float t218 = t210 * t160;
                PRECISE float t219 = t212 * t160;
                PRECISE float t220 = t205 * t193;
                PRECISE float t221 = t215 * t193;
                PRECISE float t222 = t216 * t193;
                PRECISE float t223 = t217 + t220;
                PRECISE float t224 = t218 + t221;
                PRECISE float t225 = t219 + t222;
                PRECISE float t226 = normal_x * t199;
                PRECISE float t227 = normal_y * t199;
                PRECISE float t228 = normal_z * t199;
                PRECISE float t229 = t223 + t226;
                PRECISE float t230 = t224 + t227;
                PRECISE float t231 = t225 + t228;
                PRECISE float t232 = max(t199, 0.0f);
                PRECISE float t233 = t232 * 0.318309873f;
                PRECISE float t234 = max(t65, t66);
                PRECISE float t235 = max(t234, t67);
                bool t236 = t235 > 0.0f;
                bool t237 = t29 && t236;
                origin_x = t62;
                origin_y = t63;
                origin_z = t64;
                direction_x = t229;
                direction_y = t230;
                direction_z = t231;
                beta_r = t65;
                beta_g = t66;
                beta_b = t67;
                pdf = t233;
                alive = alive && t237;
            }
            if (!alive) {
                break;
            }
        }

        /* what the path has gathered */
        float count = float(n);
        float weight = n > 0 ? 1.0f / (count * (count + 1.0f)) : 0.0f;
        float difference_r = radiance_r * count - sum_color_r;
        sum_deviation_r += difference_r * difference_r * weight;
        float difference_g = radiance_g * count - sum_color_g;
        sum_deviation_g += difference_g * difference_g * weight;
        float difference_b = radiance_b * count - sum_color_b;
        sum_deviation_b += difference_b * difference_b * weight;
        sum_color_r += radiance_r;
        sum_color_g += radiance_g;
        sum_color_b += radiance_b;
    }
    sums_0[0] = sum_color_r;
    sums_0[1] = sum_color_g;
    sums_0[2] = sum_color_b;
    sums_0[3] = sum_deviation_r;
    sums_1[0] = sum_deviation_g;
    sums_1[1] = sum_deviation_b;
    sums_1[2] = sum_albedo_r;
    sums_1[3] = sum_albedo_g;
    sums_2[0] = sum_albedo_b;
    sums_2[1] = sum_normal_x;
    sums_2[2] = sum_normal_y;
    sums_2[3] = sum_normal_z;
    sums_3[0] = sum_depth;
    sums_3[1] = sum_position_x;
    sums_3[2] = sum_position_y;
    sums_3[3] = sum_position_z;
    sums_4[0] = sum_direction_x;
    sums_4[1] = sum_direction_y;
    sums_4[2] = sum_direction_z;
    sums_4[3] = sum_unshadowed_r;
    sums_5[0] = sum_unshadowed_g;
    sums_5[1] = sum_unshadowed_b;
}
