/*
 * wamnet path tracer, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * scene     spheres, digest 8729f7b529f743268d8d6153c26ae7dc
 * paths     max_depth 1, roulette_depth None, strategy mis, heuristic power
 * schedule  1 path at once
 * profile   native: any order of summation, fused multiply-add allowed, the target's own sine
 * bound     none: a path's decisions may fall differently near an edge
 * fixed     camera, time and all of the scene: another moment is another kernel
 * sums      row 0 is the picture's top row, in every language
 *           each plane but deviation_* is a sum over the samples: divide by their number, add over launches
 *           deviation_*: squared differences from the mean colour of this launch, summed; not to be added
 *           colour is linear radiance; depth is measured along the ray; normal, position and direction are those
 *           of world space; 0 where nothing is hit (a direction is always there)
 * arguments sums_0: RGBA float colour buffers, plane 4 k + c in component c of number k:
 *           color_r, color_g, color_b;
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
#define MAX_DEPTH 1 /* scatterings of a path */
const float table_0[3] = float[3](0.0f, 0.300000012f, 0.600000024f);
const float table_1[3] = float[3](0.200000003f, (-0.800000012f), (-1.79999995f));
const float table_2[3] = float[3](0.100000001f, 0.200000003f, 0.300000012f);
const int table_3[3] = int[3](6, 7, 8);
layout(location = 0) out vec4 sums_0;
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
                int t62 = t60 ? 0 : 9;
                PRECISE float t63 = min(1.00000002e+30f, t59);
                PRECISE float t64 = t63;
                int t65 = t62;
                PRECISE float t72 = origin_y - 0.100000001f;
                PRECISE float t75 = t72 * direction_y;
                PRECISE float t100 = t72 * t72;
                for (int i = 0; i < 3; ++i) {
                    PRECISE float t66 = table_0[i];
                    PRECISE float t68 = table_1[i];
                    PRECISE float t69 = table_2[i];
                    int t70 = table_3[i];
                    PRECISE float t71 = origin_x - t66;
                    PRECISE float t73 = origin_z - t68;
                    PRECISE float t74 = t71 * direction_x;
                    PRECISE float t76 = t74 + t75;
                    PRECISE float t77 = t73 * direction_z;
                    PRECISE float t78 = t76 + t77;
                    PRECISE float t79 = -t78;
                    PRECISE float t80 = direction_x * t79;
                    PRECISE float t81 = direction_y * t79;
                    PRECISE float t82 = direction_z * t79;
                    PRECISE float t83 = t71 + t80;
                    PRECISE float t84 = t72 + t81;
                    PRECISE float t85 = t73 + t82;
                    PRECISE float t86 = t69 * t69;
                    PRECISE float t87 = t83 * t83;
                    PRECISE float t88 = t84 * t84;
                    PRECISE float t89 = t87 + t88;
                    PRECISE float t90 = t85 * t85;
                    PRECISE float t91 = t89 + t90;
                    PRECISE float t92 = t86 - t91;
                    PRECISE float t93 = max(t92, 0.0f);
                    PRECISE float t94 = sqrt(t93);
                    bool t95 = t79 < 0.0f;
                    PRECISE float t96 = -t94;
                    PRECISE float t97 = t95 ? t96 : t94;
                    PRECISE float t98 = t79 + t97;
                    PRECISE float t99 = t71 * t71;
                    PRECISE float t101 = t99 + t100;
                    PRECISE float t102 = t73 * t73;
                    PRECISE float t103 = t101 + t102;
                    PRECISE float t104 = t103 - t86;
                    bool t105 = t98 == 0.0f;
                    PRECISE float t106 = t105 ? 1e-15f : t98;
                    PRECISE float t107 = t104 / t106;
                    PRECISE float t108 = min(t98, t107);
                    PRECISE float t109 = max(t98, t107);
                    bool t110 = t92 > 0.0f;
                    bool t111 = t109 > 0.0f;
                    bool t112 = t110 && t111;
                    bool t113 = t108 > 0.0f;
                    PRECISE float t114 = t113 ? t108 : t109;
                    PRECISE float t115 = t112 ? t114 : 1.00000002e+30f;
                    bool t116 = t115 < t64;
                    int t117 = t116 ? t70 : t65;
                    PRECISE float t118 = min(t64, t115);
                    t64 = t118;
                    t65 = t117;
                }
                bool t121 = t65 == 0;
                bool t122 = direction_x > 0.0f;
                int t124 = t122 ? 1 : 0;
                bool t125 = direction_y > 0.0f;
                int t128 = t125 ? 3 : 2;
                bool t129 = direction_z > 0.0f;
                int t132 = t129 ? 5 : 4;
                bool t133 = t49 <= t50;
                bool t134 = t49 <= t51;
                bool t135 = t133 && t134;
                bool t136 = t50 <= t51;
                int t137 = t136 ? t128 : t132;
                int t138 = t135 ? t124 : t137;
                int t139 = t121 ? t138 : t65;
                bool t140 = t139 < 9;
                PRECISE float t141 = t140 ? t64 : 0.0f;
                PRECISE float t142 = direction_x * t141;
                PRECISE float t143 = direction_y * t141;
                PRECISE float t144 = direction_z * t141;
                PRECISE float t145 = origin_x + t142;
                PRECISE float t146 = origin_y + t143;
                PRECISE float t147 = origin_z + t144;
                PRECISE float t148 = t140 ? t145 : 0.0f;
                PRECISE float t149 = t140 ? t146 : 0.0f;
                PRECISE float t150 = t140 ? t147 : 0.0f;
                PRECISE float t152 = t122 ? (-1.0f) : 1.0f;
                PRECISE float t153 = t125 ? (-1.0f) : 1.0f;
                PRECISE float t154 = t129 ? (-1.0f) : 1.0f;
                PRECISE float t155 = t135 ? t152 : 0.0f;
                bool t156 = !t135;
                bool t157 = t156 && t136;
                PRECISE float t158 = t157 ? t153 : 0.0f;
                bool t159 = !t136;
                bool t160 = t156 && t159;
                PRECISE float t161 = t160 ? t154 : 0.0f;
                bool t163 = t139 >= 6;
                bool t164 = t163 && t140;
                int t165 = t139 - 6;
                int t166 = max(t165, 0);
                int t167 = min(t166, 2);
                bool t169 = t167 < 2;
                PRECISE float t171 = t169 ? 0.300000012f : 0.600000024f;
                bool t172 = t167 < 1;
                PRECISE float t173 = t172 ? 0.0f : t171;
                PRECISE float t176 = t169 ? (-0.800000012f) : (-1.79999995f);
                PRECISE float t178 = t172 ? 0.200000003f : t176;
                PRECISE float t179 = t169 ? 0.200000003f : 0.300000012f;
                PRECISE float t180 = t172 ? 0.100000001f : t179;
                PRECISE float t181 = t148 - t173;
                PRECISE float t182 = t149 - 0.100000001f;
                PRECISE float t183 = t150 - t178;
                PRECISE float t184 = t181 / t180;
                PRECISE float t185 = t182 / t180;
                PRECISE float t186 = t183 / t180;
                PRECISE float t187 = t184 * direction_x;
                PRECISE float t188 = t185 * direction_y;
                PRECISE float t189 = t187 + t188;
                PRECISE float t190 = t186 * direction_z;
                PRECISE float t191 = t189 + t190;
                bool t192 = t191 > 0.0f;
                PRECISE float t193 = -t184;
                PRECISE float t194 = -t185;
                PRECISE float t195 = -t186;
                PRECISE float t196 = t192 ? t193 : t184;
                PRECISE float t197 = t192 ? t194 : t185;
                PRECISE float t198 = t192 ? t195 : t186;
                PRECISE float t199 = t164 ? t196 : t155;
                PRECISE float t200 = t164 ? t197 : t158;
                PRECISE float t201 = t164 ? t198 : t161;
                PRECISE float t202 = t140 ? t199 : 0.0f;
                PRECISE float t203 = t140 ? t200 : 0.0f;
                PRECISE float t204 = t140 ? t201 : 0.0f;
                bool t205 = t139 < 6;
                PRECISE float t206 = t205 ? 1.0f : 0.0f;
                PRECISE float t207 = t140 ? 0.200000003f : 0.0f;
                PRECISE float t209 = t205 ? 0.5f : t207;
                PRECISE float t210 = t140 ? 0.600000024f : 0.0f;
                bool t212 = t139 < 8;
                PRECISE float t213 = t212 ? 0.300000012f : t210;
                bool t215 = t139 < 7;
                PRECISE float t216 = t215 ? 0.0f : t213;
                PRECISE float t217 = t205 ? 0.5f : t216;
                PRECISE float t218 = t140 ? 0.100000001f : 0.0f;
                PRECISE float t219 = t205 ? 0.5f : t218;
                PRECISE float t220 = beta_r * t206;
                PRECISE float t221 = beta_g * t206;
                PRECISE float t222 = beta_b * t206;
                PRECISE float t223 = radiance_r + t220;
                PRECISE float t224 = radiance_g + t221;
                PRECISE float t225 = radiance_b + t222;
                radiance_r = alive ? t223 : radiance_r;
                radiance_g = alive ? t224 : radiance_g;
                radiance_b = alive ? t225 : radiance_b;
                point_x = t148;
                point_y = t149;
                point_z = t150;
                normal_x = t202;
                normal_y = t203;
                normal_z = t204;
                reflectance_r = t209;
                reflectance_g = t217;
                reflectance_b = t219;
                t = t64;
                surface = t139;
            }
            if (bounce == MAX_DEPTH) {
                break;
            }

            /* scatter: the path goes on */
            {
                bool t29 = surface < 9;
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
                PRECISE float t113 = cos(t112);
                PRECISE float t114 = t102 * t113;
                PRECISE float t115 = sin(t112);
                PRECISE float t116 = t102 * t115;
                PRECISE float t117 = t114 * t114;
                PRECISE float t118 = 1.0f - t117;
                PRECISE float t119 = t116 * t116;
                PRECISE float t120 = t118 - t119;
                PRECISE float t121 = max(0.0f, t120);
                PRECISE float t122 = sqrt(t121);
                bool t123 = normal_z < 0.0f;
                PRECISE float t125 = t123 ? (-1.0f) : 1.0f;
                PRECISE float t126 = t125 + normal_z;
                PRECISE float t127 = (-1.0f) / t126;
                PRECISE float t128 = normal_x * normal_y;
                PRECISE float t129 = t128 * t127;
                PRECISE float t130 = t125 * normal_x;
                PRECISE float t131 = t130 * normal_x;
                PRECISE float t132 = t131 * t127;
                PRECISE float t133 = 1.0f + t132;
                PRECISE float t134 = t125 * t129;
                PRECISE float t135 = -t125;
                PRECISE float t136 = t135 * normal_x;
                PRECISE float t137 = normal_y * normal_y;
                PRECISE float t138 = t137 * t127;
                PRECISE float t139 = t125 + t138;
                PRECISE float t140 = -normal_y;
                PRECISE float t141 = t133 * t114;
                PRECISE float t142 = t134 * t114;
                PRECISE float t143 = t136 * t114;
                PRECISE float t144 = t129 * t116;
                PRECISE float t145 = t139 * t116;
                PRECISE float t146 = t140 * t116;
                PRECISE float t147 = t141 + t144;
                PRECISE float t148 = t142 + t145;
                PRECISE float t149 = t143 + t146;
                PRECISE float t150 = normal_x * t122;
                PRECISE float t151 = normal_y * t122;
                PRECISE float t152 = normal_z * t122;
                PRECISE float t153 = t147 + t150;
                PRECISE float t154 = t148 + t151;
                PRECISE float t155 = t149 + t152;
                PRECISE float t156 = max(t122, 0.0f);
                PRECISE float t158 = t156 * 0.318309873f;
                PRECISE float t159 = max(t65, t66);
                PRECISE float t160 = max(t159, t67);
                bool t161 = t160 > 0.0f;
                bool t162 = t29 && t161;
                origin_x = t62;
                origin_y = t63;
                origin_z = t64;
                direction_x = t153;
                direction_y = t154;
                direction_z = t155;
                beta_r = t65;
                beta_g = t66;
                beta_b = t67;
                pdf = t158;
                alive = alive && t162;
            }
            if (!alive) {
                break;
            }
        }

        /* what the path has gathered */
        sum_color_r += radiance_r;
        sum_color_g += radiance_g;
        sum_color_b += radiance_b;
    }
    sums_0[0] = sum_color_r;
    sums_0[1] = sum_color_g;
    sums_0[2] = sum_color_b;
}
