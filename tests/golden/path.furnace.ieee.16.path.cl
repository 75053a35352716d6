/*
 * wamnet path tracer, OpenCL C 1.2. Generated: change the compiler, not this text.
 * scene     furnace, digest 5426626d24f949194068d8efe6ece22f
 * paths     max_depth 3, roulette_depth None, strategy mis, heuristic power
 * schedule  16 paths at once
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * bound     none: a path's decisions may fall differently near an edge
 * fixed     camera, time and all of the scene: another moment is another kernel
 * sums      row 0 is the picture's top row, in every language
 *           each plane but deviation_* is a sum over the samples: divide by their number, add over launches
 *           deviation_*: squared differences from the mean colour of this launch, summed; not to be added
 *           colour is linear radiance; depth is measured along the ray; normal, position and direction are those
 *           of world space; 0 where nothing is hit (a direction is always there)
 * arguments sums: planes of global_size(1) rows of global_size(0) * 16 floats:
 *           color_r, color_g, color_b, deviation_r, deviation_g, deviation_b, albedo_r, albedo_g, albedo_b,
 *           normal_x, normal_y, normal_z, depth, position_x, position_y, position_z, direction_x, direction_y,
 *           direction_z, unshadowed_r, unshadowed_g, unshadowed_b;
 *           width; height; first_row; first_sample; samples: to add up; seed_number.
 *           Global size: at least (ceil(width / 16), rows); item (i, j) follows the pixels from 16 * i on of row first_row + j
 */
#define LANES 16
#define MAX_DEPTH 3 /* scatterings of a path */
#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_floor)
#define FLOOR(a) __builtin_elementwise_floor(a)
#endif
#if __has_builtin(__builtin_convertvector)
#define CONVERT(a, kind) __builtin_convertvector(a, kind)
#endif
#endif
#ifndef FLOOR
#define FLOOR(a) floor(a)
#endif
#ifndef CONVERT
#define CONVERT(a, kind) convert_##kind(a)
#endif
/* Whether any component is true. The library's any() is a call, which saves all registers. */
int any_lane(int16 mask)
{
#if defined(__AVX512DQ__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cvtd2mask512)
    return (ushort)__builtin_ia32_cvtd2mask512(mask);
#endif
#endif
    int8 of_8 = mask.lo | mask.hi;
    int4 of_4 = of_8.lo | of_8.hi;
    int2 of_2 = of_4.lo | of_4.hi;
    return of_2.lo | of_2.hi;
}
__kernel void wamnet_trace(
    __global float *restrict sums,
    int width,
    int height,
    int first_row,
    uint first_sample,
    int samples,
    uint seed_number)
{
    size_t column = get_global_id(0) * LANES;
    size_t stride = get_global_size(0) * LANES;
    size_t row = get_global_id(1);
    size_t plane = get_global_size(1) * stride;
    size_t at = row * stride + column;
    uint16 x = (uint)column + (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint16 y = (uint16)((uint)(row + first_row));
    uint16 seed = (uint16)(seed_number);
    float16 image_width = (float16)((float)width);
    float16 image_height = (float16)((float)height);
    float16 sum_color_r = (float16)(0.0f);
    float16 sum_color_g = (float16)(0.0f);
    float16 sum_color_b = (float16)(0.0f);
    float16 sum_deviation_r = (float16)(0.0f);
    float16 sum_deviation_g = (float16)(0.0f);
    float16 sum_deviation_b = (float16)(0.0f);
    float16 sum_albedo_r = (float16)(0.0f);
    float16 sum_albedo_g = (float16)(0.0f);
    float16 sum_albedo_b = (float16)(0.0f);
    float16 sum_normal_x = (float16)(0.0f);
    float16 sum_normal_y = (float16)(0.0f);
    float16 sum_normal_z = (float16)(0.0f);
    float16 sum_depth = (float16)(0.0f);
    float16 sum_position_x = (float16)(0.0f);
    float16 sum_position_y = (float16)(0.0f);
    float16 sum_position_z = (float16)(0.0f);
    float16 sum_direction_x = (float16)(0.0f);
    float16 sum_direction_y = (float16)(0.0f);
    float16 sum_direction_z = (float16)(0.0f);
    float16 sum_unshadowed_r = (float16)(0.0f);
    float16 sum_unshadowed_g = (float16)(0.0f);
    float16 sum_unshadowed_b = (float16)(0.0f);
    for (int n = 0; n < samples; ++n) {
        uint16 sample_number = (uint16)(first_sample + (uint)n);
        uint16 pixel;
        float16 origin_x;
        float16 origin_y;
        float16 origin_z;
        float16 direction_x;
        float16 direction_y;
        float16 direction_z;
        float16 beta_r;
        float16 beta_g;
        float16 beta_b;
        float16 radiance_r;
        float16 radiance_g;
        float16 radiance_b;
        float16 pdf;
        float16 point_x;
        float16 point_y;
        float16 point_z;
        float16 normal_x;
        float16 normal_y;
        float16 normal_z;
        float16 reflectance_r;
        float16 reflectance_g;
        float16 reflectance_b;
        float16 t;
        int16 surface;
        int16 alive = (int16)(-1);

        /* start: the path at the camera */
        {
            uint16 t7 = 65536u * y;
            uint16 t8 = x + t7;
            float16 t9 = CONVERT(x, float16);
            float16 t10 = CONVERT(y, float16);
            uint16 t12 = t8 * 1664525u;
            uint16 t14 = t12 + 1013904223u;
            uint16 t15 = sample_number * 1664525u;
            uint16 t16 = t15 + 1013904223u;
            uint16 t17 = seed * 1664525u;
            uint16 t18 = t17 + 1013904223u;
            uint16 t19 = t16 * t18;
            uint16 t20 = t14 + t19;
            uint16 t21 = 1013904223u * t20;
            uint16 t22 = t16 + t21;
            uint16 t23 = t20 * t22;
            uint16 t24 = 1013904223u + t23;
            uint16 t25 = t22 * t24;
            uint16 t26 = t18 + t25;
            uint16 t28 = t20 >> 16u;
            uint16 t29 = t20 ^ t28;
            uint16 t30 = t22 >> 16u;
            uint16 t31 = t22 ^ t30;
            uint16 t32 = t24 >> 16u;
            uint16 t33 = t24 ^ t32;
            uint16 t34 = t26 >> 16u;
            uint16 t35 = t26 ^ t34;
            uint16 t36 = t31 * t35;
            uint16 t37 = t29 + t36;
            uint16 t38 = t33 * t37;
            uint16 t39 = t31 + t38;
            uint16 t41 = t37 >> 8u;
            float16 t42 = CONVERT(t41, float16);
            float16 t44 = t42 * 5.96046448e-08f;
            uint16 t45 = t39 >> 8u;
            float16 t46 = CONVERT(t45, float16);
            float16 t47 = t46 * 5.96046448e-08f;
            float16 t48 = t9 + t44;
            float16 t50 = 2.0f * t48;
            float16 t51 = t50 - image_width;
            float16 t52 = t51 / image_height;
            float16 t54 = t52 * 0.577350259f;
            float16 t55 = t10 + t47;
            float16 t56 = 2.0f * t55;
            float16 t57 = image_height - t56;
            float16 t58 = t57 / image_height;
            float16 t59 = t58 * 0.577350259f;
            float16 t63 = t54 * 0.998274386f;
            float16 t64 = t54 * 0.0f;
            float16 t65 = t54 * (-0.0587220229f);
            float16 t69 = (-0.0583211854f) + t63;
            float16 t70 = (-0.116642371f) + t64;
            float16 t71 = (-0.991460145f) + t65;
            float16 t75 = t59 * (-0.00684947567f);
            float16 t76 = t59 * 0.993173957f;
            float16 t77 = t59 * (-0.116441086f);
            float16 t78 = t69 + t75;
            float16 t79 = t70 + t76;
            float16 t80 = t71 + t77;
            float16 t81 = t78 * t78;
            float16 t82 = t79 * t79;
            float16 t83 = t81 + t82;
            float16 t84 = t80 * t80;
            float16 t85 = t83 + t84;
            float16 t86 = sqrt(t85);
            float16 t87 = t78 / t86;
            float16 t88 = t79 / t86;
            float16 t89 = t80 / t86;
            float16 t90 = 0.0f * t87;
            float16 t91 = 0.0f * t88;
            float16 t92 = 0.0f * t89;
            float16 t96 = 0.100000001f + t90;
            float16 t97 = 0.200000003f + t91;
            float16 t98 = 0.699999988f + t92;
            origin_x = t96;
            origin_y = t97;
            origin_z = t98;
            direction_x = t87;
            direction_y = t88;
            direction_z = t89;
            beta_r = (float16)(1.0f);
            beta_g = (float16)(1.0f);
            beta_b = (float16)(1.0f);
            radiance_r = (float16)(0.0f);
            radiance_g = (float16)(0.0f);
            radiance_b = (float16)(0.0f);
            pdf = (float16)(1.00000002e+30f);
            pixel = t8;
        }
        for (int bounce = 0; bounce < MAX_DEPTH + 1; ++bounce) {
            uint16 depth = (uint16)((uint)bounce);

            /* arrive: the next surface */
            {
                float16 t16 = as_float16(as_int16(direction_x) & 0x7fffffff);
                float16 t17 = as_float16(as_int16(direction_y) & 0x7fffffff);
                float16 t18 = as_float16(as_int16(direction_z) & 0x7fffffff);
                int16 t19 = t16 < 1e-15f;
                int16 t20 = t17 < 1e-15f;
                int16 t21 = t18 < 1e-15f;
                int16 t23 = direction_x < 0.0f;
                int16 t24 = direction_y < 0.0f;
                int16 t25 = direction_z < 0.0f;
                float16 t27 = t23 ? (float16)(-1e-15f) : (float16)(1e-15f);
                float16 t28 = t24 ? (float16)(-1e-15f) : (float16)(1e-15f);
                float16 t29 = t25 ? (float16)(-1e-15f) : (float16)(1e-15f);
                float16 t30 = t19 ? t27 : direction_x;
                float16 t31 = t20 ? t28 : direction_y;
                float16 t32 = t21 ? t29 : direction_z;
                float16 t33 = 1.0f / t30;
                float16 t34 = 1.0f / t31;
                float16 t35 = 1.0f / t32;
                float16 t36 = 0.0f - origin_x;
                float16 t37 = 0.0f - origin_y;
                float16 t38 = 0.0f - origin_z;
                float16 t39 = t36 * t33;
                float16 t40 = t37 * t34;
                float16 t41 = t38 * t35;
                float16 t42 = as_float16(as_int16(t33) & 0x7fffffff);
                float16 t43 = as_float16(as_int16(t34) & 0x7fffffff);
                float16 t44 = as_float16(as_int16(t35) & 0x7fffffff);
                float16 t46 = t39 - t42;
                float16 t47 = t40 - t43;
                float16 t48 = t41 - t44;
                float16 t49 = t39 + t42;
                float16 t50 = t40 + t43;
                float16 t51 = t41 + t44;
                float16 t52 = t47 > t46 ? t47 : t46;
                float16 t53 = t48 > t52 ? t48 : t52;
                float16 t54 = t50 < t49 ? t50 : t49;
                float16 t55 = t51 < t54 ? t51 : t54;
                int16 t56 = t53 <= t55;
                int16 t57 = t55 > 0.0f;
                int16 t58 = t56 && t57;
                float16 t59 = t58 ? t55 : (float16)(1.00000002e+30f);
                int16 t60 = t59 < 1.00000002e+30f;
                int16 t62 = t60 ? (int16)(0) : (int16)(6);
                float16 t63 = t59 < (float16)(1.00000002e+30f) ? t59 : (float16)(1.00000002e+30f);
                int16 t64 = t62 == 0;
                int16 t65 = direction_x > 0.0f;
                int16 t67 = t65 ? (int16)(1) : (int16)(0);
                int16 t68 = direction_y > 0.0f;
                int16 t71 = t68 ? (int16)(3) : (int16)(2);
                int16 t72 = direction_z > 0.0f;
                int16 t75 = t72 ? (int16)(5) : (int16)(4);
                int16 t76 = t49 <= t50;
                int16 t77 = t49 <= t51;
                int16 t78 = t76 && t77;
                int16 t79 = t50 <= t51;
                int16 t80 = t79 ? t71 : t75;
                int16 t81 = t78 ? t67 : t80;
                int16 t82 = t64 ? t81 : t62;
                int16 t83 = t82 < 6;
                float16 t84 = t83 ? t63 : (float16)(0.0f);
                float16 t85 = direction_x * t84;
                float16 t86 = direction_y * t84;
                float16 t87 = direction_z * t84;
                float16 t88 = origin_x + t85;
                float16 t89 = origin_y + t86;
                float16 t90 = origin_z + t87;
                float16 t91 = t83 ? t88 : (float16)(0.0f);
                float16 t92 = t83 ? t89 : (float16)(0.0f);
                float16 t93 = t83 ? t90 : (float16)(0.0f);
                float16 t95 = t65 ? (float16)(-1.0f) : (float16)(1.0f);
                float16 t96 = t68 ? (float16)(-1.0f) : (float16)(1.0f);
                float16 t97 = t72 ? (float16)(-1.0f) : (float16)(1.0f);
                float16 t98 = t78 ? t95 : (float16)(0.0f);
                int16 t99 = !t78;
                int16 t100 = t99 && t79;
                float16 t101 = t100 ? t96 : (float16)(0.0f);
                int16 t102 = !t79;
                int16 t103 = t99 && t102;
                float16 t104 = t103 ? t97 : (float16)(0.0f);
                float16 t105 = t83 ? t98 : (float16)(0.0f);
                float16 t106 = t83 ? t101 : (float16)(0.0f);
                float16 t107 = t83 ? t104 : (float16)(0.0f);
                float16 t108 = t83 ? (float16)(1.0f) : (float16)(0.0f);
                float16 t110 = t83 ? (float16)(0.5f) : (float16)(0.0f);
                float16 t111 = beta_r * t108;
                float16 t112 = beta_g * t108;
                float16 t113 = beta_b * t108;
                float16 t114 = radiance_r + t111;
                float16 t115 = radiance_g + t112;
                float16 t116 = radiance_b + t113;
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
                    int16 t15 = surface < 6;
                    float16 t17 = t15 ? t : (float16)(0.0f);
                    float16 t18 = t15 ? point_x : (float16)(0.0f);
                    float16 t19 = t15 ? point_y : (float16)(0.0f);
                    float16 t20 = t15 ? point_z : (float16)(0.0f);
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
                    sum_unshadowed_r += (float16)(0.0f);
                    sum_unshadowed_g += (float16)(0.0f);
                    sum_unshadowed_b += (float16)(0.0f);
                }
            }
            if (bounce == MAX_DEPTH) {
                break;
            }

            /* scatter: the path goes on */
            {
                int16 t29 = surface < 6;
                uint16 t31 = 2u * depth;
                uint16 t33 = 1u + t31;
                uint16 t35 = pixel * 1664525u;
                uint16 t37 = t35 + 1013904223u;
                uint16 t38 = sample_number * 1664525u;
                uint16 t39 = t38 + 1013904223u;
                uint16 t40 = seed * 1664525u;
                uint16 t41 = t40 + 1013904223u;
                uint16 t42 = t39 * t41;
                uint16 t43 = t37 + t42;
                uint16 t45 = t43 >> 16u;
                uint16 t46 = t43 ^ t45;
                float16 t50 = t29 ? t : (float16)(0.0f);
                float16 t51 = as_float16(as_int16(point_x) & 0x7fffffff);
                float16 t52 = as_float16(as_int16(point_y) & 0x7fffffff);
                float16 t53 = as_float16(as_int16(point_z) & 0x7fffffff);
                float16 t54 = t52 > t51 ? t52 : t51;
                float16 t55 = t53 > t54 ? t53 : t54;
                float16 t56 = t55 + t50;
                float16 t58 = 3.81469727e-06f * t56;
                float16 t59 = normal_x * t58;
                float16 t60 = normal_y * t58;
                float16 t61 = normal_z * t58;
                float16 t62 = point_x + t59;
                float16 t63 = point_y + t60;
                float16 t64 = point_z + t61;
                float16 t65 = beta_r * reflectance_r;
                float16 t66 = beta_g * reflectance_g;
                float16 t67 = beta_b * reflectance_b;
                uint16 t68 = t33 + 1u;
                uint16 t69 = t68 * 1664525u;
                uint16 t70 = t69 + 1013904223u;
                uint16 t71 = t70 * t43;
                uint16 t72 = t39 + t71;
                uint16 t73 = t43 * t72;
                uint16 t74 = t70 + t73;
                uint16 t75 = t72 * t74;
                uint16 t76 = t41 + t75;
                uint16 t77 = t72 >> 16u;
                uint16 t78 = t72 ^ t77;
                uint16 t79 = t74 >> 16u;
                uint16 t80 = t74 ^ t79;
                uint16 t81 = t76 >> 16u;
                uint16 t82 = t76 ^ t81;
                uint16 t83 = t78 * t82;
                uint16 t84 = t46 + t83;
                uint16 t85 = t80 * t84;
                uint16 t86 = t78 + t85;
                uint16 t87 = t84 >> 8u;
                float16 t88 = CONVERT(t87, float16);
                float16 t89 = t88 * 5.96046448e-08f;
                uint16 t90 = t86 >> 8u;
                float16 t91 = CONVERT(t90, float16);
                float16 t92 = t91 * 5.96046448e-08f;
                float16 t94 = 2.0f * t89;
                float16 t96 = t94 - 1.0f;
                float16 t97 = 2.0f * t92;
                float16 t98 = t97 - 1.0f;
                float16 t99 = as_float16(as_int16(t96) & 0x7fffffff);
                float16 t100 = as_float16(as_int16(t98) & 0x7fffffff);
                int16 t101 = t99 > t100;
                float16 t102 = t101 ? t96 : t98;
                float16 t103 = t101 ? t98 : t96;
                int16 t104 = t102 == 0.0f;
                float16 t106 = t104 ? (float16)(1e-30f) : t102;
                float16 t107 = t103 / t106;
                float16 t109 = 0.785398185f * t107;
                float16 t111 = 1.57079637f - t109;
                float16 t112 = t101 ? t109 : t111;
                float16 t114 = t112 * 0.318309873f;
                float16 t115 = t114 + 1.0f;
                float16 t116 = FLOOR(t115);
                float16 t118 = t116 - 0.5f;
                float16 t120 = t118 * 3.14160156f;
                float16 t121 = t112 - t120;
                float16 t123 = t118 * (-8.9071691e-06f);
                float16 t124 = t121 - t123;
                float16 t126 = t118 * (-1.74122761e-09f);
                float16 t127 = t124 - t126;
                float16 t128 = 0.5f * t116;
                float16 t129 = FLOOR(t128);
                float16 t130 = 2.0f * t129;
                float16 t131 = t116 - t130;
                float16 t132 = 2.0f * t131;
                float16 t133 = 1.0f - t132;
                float16 t134 = t127 * t127;
                float16 t136 = t134 * (-2.51969432e-08f);
                float16 t138 = t136 + 2.76094511e-06f;
                float16 t139 = t134 * t138;
                float16 t141 = t139 + (-0.000198427704f);
                float16 t142 = t134 * t141;
                float16 t144 = t142 + 0.00833334867f;
                float16 t145 = t134 * t144;
                float16 t147 = t145 + (-0.166666672f);
                float16 t148 = t134 * t147;
                float16 t149 = t127 * t148;
                float16 t150 = t127 + t149;
                float16 t151 = t133 * t150;
                float16 t152 = (float16)(1.0f) < t151 ? (float16)(1.0f) : t151;
                float16 t154 = (float16)(-1.0f) > t152 ? (float16)(-1.0f) : t152;
                float16 t155 = as_float16(as_int16(t112) & 0x7fffffff);
                int16 t157 = t155 <= 6400.0f;
                float16 t158 = t112 - t112;
                float16 t159 = t157 ? t154 : t158;
                float16 t160 = t102 * t159;
                float16 t161 = t114 + 0.5f;
                float16 t162 = FLOOR(t161);
                float16 t163 = t162 * 3.14160156f;
                float16 t164 = t112 - t163;
                float16 t165 = t162 * (-8.9071691e-06f);
                float16 t166 = t164 - t165;
                float16 t167 = t162 * (-1.74122761e-09f);
                float16 t168 = t166 - t167;
                float16 t169 = 0.5f * t162;
                float16 t170 = FLOOR(t169);
                float16 t171 = 2.0f * t170;
                float16 t172 = t162 - t171;
                float16 t173 = 2.0f * t172;
                float16 t174 = 1.0f - t173;
                float16 t175 = t168 * t168;
                float16 t176 = t175 * (-2.51969432e-08f);
                float16 t177 = t176 + 2.76094511e-06f;
                float16 t178 = t175 * t177;
                float16 t179 = t178 + (-0.000198427704f);
                float16 t180 = t175 * t179;
                float16 t181 = t180 + 0.00833334867f;
                float16 t182 = t175 * t181;
                float16 t183 = t182 + (-0.166666672f);
                float16 t184 = t175 * t183;
                float16 t185 = t168 * t184;
                float16 t186 = t168 + t185;
                float16 t187 = t174 * t186;
                float16 t188 = (float16)(1.0f) < t187 ? (float16)(1.0f) : t187;
                float16 t189 = (float16)(-1.0f) > t188 ? (float16)(-1.0f) : t188;
                int16 t191 = t155 <= 12800.0f;
                float16 t192 = t191 ? t189 : t158;
                float16 t193 = t102 * t192;
                float16 t194 = t160 * t160;
                float16 t195 = 1.0f - t194;
                float16 t196 = t193 * t193;
                float16 t197 = t195 - t196;
                float16 t198 = t197 > (float16)(0.0f) ? t197 : (float16)(0.0f);
                float16 t199 = sqrt(t198);
                int16 t200 = normal_z < 0.0f;
                float16 t201 = t200 ? (float16)(-1.0f) : (float16)(1.0f);
                float16 t202 = t201 + normal_z;
                float16 t203 = (-1.0f) / t202;
                float16 t204 = normal_x * normal_y;
                float16 t205 = t204 * t203;
                float16 t206 = t201 * normal_x;
                float16 t207 = t206 * normal_x;
                float16 t208 = t207 * t203;
                float16 t209 = 1.0f + t208;
                float16 t210 = t201 * t205;
                float16 t211 = -t201;
                float16 t212 = t211 * normal_x;
                float16 t213 = normal_y * normal_y;
                float16 t214 = t213 * t203;
                float16 t215 = t201 + t214;
                float16 t216 = -normal_y;
                float16 t217 = t209 * t160;
                float16 t218 = t210 * t160;
                float16 t219 = t212 * t160;
                float16 t220 = t205 * t193;
                float16 t221 = t215 * t193;
                float16 t222 = t216 * t193;
                float16 t223 = t217 + t220;
                float16 t224 = t218 + t221;
                float16 t225 = t219 + t222;
                float16 t226 = normal_x * t199;
                float16 t227 = normal_y * t199;
                float16 t228 = normal_z * t199;
                float16 t229 = t223 + t226;
                float16 t230 = t224 + t227;
                float16 t231 = t225 + t228;
                float16 t232 = (float16)(0.0f) > t199 ? (float16)(0.0f) : t199;
                float16 t233 = t232 * 0.318309873f;
                float16 t234 = t66 > t65 ? t66 : t65;
                float16 t235 = t67 > t234 ? t67 : t234;
                int16 t236 = t235 > 0.0f;
                int16 t237 = t29 && t236;
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
            if (!any_lane(alive)) {
                break;
            }
        }

        /* what the path has gathered */
        float count = (float)n;
        float weight = n > 0 ? 1.0f / (count * (count + 1.0f)) : 0.0f;
        float16 difference_r = radiance_r * count - sum_color_r;
        sum_deviation_r += difference_r * difference_r * weight;
        float16 difference_g = radiance_g * count - sum_color_g;
        sum_deviation_g += difference_g * difference_g * weight;
        float16 difference_b = radiance_b * count - sum_color_b;
        sum_deviation_b += difference_b * difference_b * weight;
        sum_color_r += radiance_r;
        sum_color_g += radiance_g;
        sum_color_b += radiance_b;
    }
    vstore16(sum_color_r, 0, sums + 0 * plane + at);
    vstore16(sum_color_g, 0, sums + 1 * plane + at);
    vstore16(sum_color_b, 0, sums + 2 * plane + at);
    vstore16(sum_deviation_r, 0, sums + 3 * plane + at);
    vstore16(sum_deviation_g, 0, sums + 4 * plane + at);
    vstore16(sum_deviation_b, 0, sums + 5 * plane + at);
    vstore16(sum_albedo_r, 0, sums + 6 * plane + at);
    vstore16(sum_albedo_g, 0, sums + 7 * plane + at);
    vstore16(sum_albedo_b, 0, sums + 8 * plane + at);
    vstore16(sum_normal_x, 0, sums + 9 * plane + at);
    vstore16(sum_normal_y, 0, sums + 10 * plane + at);
    vstore16(sum_normal_z, 0, sums + 11 * plane + at);
    vstore16(sum_depth, 0, sums + 12 * plane + at);
    vstore16(sum_position_x, 0, sums + 13 * plane + at);
    vstore16(sum_position_y, 0, sums + 14 * plane + at);
    vstore16(sum_position_z, 0, sums + 15 * plane + at);
    vstore16(sum_direction_x, 0, sums + 16 * plane + at);
    vstore16(sum_direction_y, 0, sums + 17 * plane + at);
    vstore16(sum_direction_z, 0, sums + 18 * plane + at);
    vstore16(sum_unshadowed_r, 0, sums + 19 * plane + at);
    vstore16(sum_unshadowed_g, 0, sums + 20 * plane + at);
    vstore16(sum_unshadowed_b, 0, sums + 21 * plane + at);
}
