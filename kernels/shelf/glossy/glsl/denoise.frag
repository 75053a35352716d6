/*
 * wamnet denoiser, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * program   49003e6e13e3c3310d2686bcb568ae06
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 *           seen_normal: 3 channels in [-1.0, 1.0], past mirrors and glass: unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 *           seen_albedo: 3 channels in [0.0, 1.0], past mirrors and glass: linear reflectance clipped to 0 .. 1, mean over samples; 0 where nothing is hit
 *           seen_position: 3 channels in [-1.0, 1.0], past mirrors and glass: (world position - (0.0, -1.1920928955078125e-07, -1.1920928955078125e-07)) / 2.0000003576278687, clipped to -1 .. 1; a miss is at 0
 *           seen_direct: 3 channels in [0.0, 1.0], past mirrors and glass: emission, and unshadowed with its shadows: sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 * window    8 x 8 pixels, the pixel itself is tap 4
 * border    clamp
 * output    3 channels, sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * sine      emitted, odd polynomial of degree 11
 * bound     |output - float64 reference| <= 0.00201 for all images in these ranges
 * sums      over the window: a partial sum for each image and row of taps, in any order; then these
 * arguments image_color: a texture of 32-bit floats;
 *           image_seen_normal: a texture of 32-bit floats;
 *           image_seen_albedo: a texture of 32-bit floats;
 *           image_seen_position: a texture of 32-bit floats;
 *           image_seen_direct: a texture of 32-bit floats;
 *           weight_texture: R32F, 1024 texels wide, as many rows as weights fill, row by row, the last row
 *           padded;
 *           result: a float colour buffer, RGBA, of which 3 components are written, encoded as `output` says.
 *           Draw one triangle that covers what is written: row 0 is the TOP row of all images.
 *           OpenGL's own row 0 is the bottom: flip what it has rendered. Half floats in images void the
 *           bound, and a target that encodes sRGB encodes once more
 * weights   W0 (960 x 64) at 0, b0 (64) at 61440, W1 (64 x 64) at 61504, b1 (64) at 65600, W2 (64 x
 *           64) at 65664, b2 (64) at 69760, W3 (64 x 64) at 69824, b3 (64) at 73920, W4 (64 x 3) at
 *           73984, b4 (3) at 74176; matrices input-major: D_in x D_out, in C order
 */
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
#endif
#define WINDOW_SIZE 8
#define WINDOW_CENTRE 4 /* the tap that lies on the pixel itself */
uniform sampler2D image_color;
uniform sampler2D image_seen_normal;
uniform sampler2D image_seen_albedo;
uniform sampler2D image_seen_position;
uniform sampler2D image_seen_direct;
uniform sampler2D weight_texture;
layout(location = 0) out vec4 result;

float weights(int index)
{
    ivec2 texel = ivec2(index % 1024, index / 1024);
    return texelFetch(weight_texture, texel, 0).r;
}

void main()
{
    int width = textureSize(image_color, 0).x;
    int height = textureSize(image_color, 0).y;
    int x = int(gl_FragCoord.x);
    int y = int(gl_FragCoord.y);
    result = vec4(0.0, 0.0, 0.0, 1.0);

    /* %1: affine map W0 from 960 to 64 */
    PRECISE float v1[64];
    for (int j = 0; j < 64; ++j) {
        v1[j] = weights(61440 + j);
    }
    PRECISE float part1[64];
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 64; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            int tap = (dy * WINDOW_SIZE + dx) * 15;
            for (int c = 0; c < 3; ++c) {
                float value = texelFetch(image_color, ivec2(column, row), 0)[c];
                for (int j = 0; j < 64; ++j) {
                    part1[j] += weights((tap + c) * 64 + j) * value;
                }
            }
        }
        for (int j = 0; j < 64; ++j) {
            v1[j] += part1[j];
        }
    }
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 64; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            int tap = (dy * WINDOW_SIZE + dx) * 15;
            for (int c = 0; c < 3; ++c) {
                float value = texelFetch(image_seen_normal, ivec2(column, row), 0)[c];
                for (int j = 0; j < 64; ++j) {
                    part1[j] += weights((tap + 3 + c) * 64 + j) * value;
                }
            }
        }
        for (int j = 0; j < 64; ++j) {
            v1[j] += part1[j];
        }
    }
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 64; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            int tap = (dy * WINDOW_SIZE + dx) * 15;
            for (int c = 0; c < 3; ++c) {
                float value = texelFetch(image_seen_albedo, ivec2(column, row), 0)[c];
                for (int j = 0; j < 64; ++j) {
                    part1[j] += weights((tap + 6 + c) * 64 + j) * value;
                }
            }
        }
        for (int j = 0; j < 64; ++j) {
            v1[j] += part1[j];
        }
    }
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 64; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            int tap = (dy * WINDOW_SIZE + dx) * 15;
            for (int c = 0; c < 3; ++c) {
                float value = texelFetch(image_seen_position, ivec2(column, row), 0)[c];
                for (int j = 0; j < 64; ++j) {
                    part1[j] += weights((tap + 9 + c) * 64 + j) * value;
                }
            }
        }
        for (int j = 0; j < 64; ++j) {
            v1[j] += part1[j];
        }
    }
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 64; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            int tap = (dy * WINDOW_SIZE + dx) * 15;
            for (int c = 0; c < 3; ++c) {
                float value = texelFetch(image_seen_direct, ivec2(column, row), 0)[c];
                for (int j = 0; j < 64; ++j) {
                    part1[j] += weights((tap + 12 + c) * 64 + j) * value;
                }
            }
        }
        for (int j = 0; j < 64; ++j) {
            v1[j] += part1[j];
        }
    }

    /* %4 to %49: elementwise on 64 numbers */
    float v49[64];
    for (int i = 0; i < 64; ++i) {
        PRECISE float t4 = v1[i] * 0.318309873f;
        PRECISE float t6 = t4 + 0.5f;
        PRECISE float t7 = floor(t6);
        PRECISE float t9 = t7 * 3.14160156f;
        PRECISE float t10 = v1[i] - t9;
        PRECISE float t12 = t7 * (-8.9071691e-06f);
        PRECISE float t13 = t10 - t12;
        PRECISE float t15 = t7 * (-1.74122761e-09f);
        PRECISE float t16 = t13 - t15;
        PRECISE float t17 = 0.5f * t7;
        PRECISE float t18 = floor(t17);
        PRECISE float t20 = 2.0f * t18;
        PRECISE float t21 = t7 - t20;
        PRECISE float t22 = 2.0f * t21;
        PRECISE float t23 = 1.0f - t22;
        PRECISE float t24 = t16 * t16;
        PRECISE float t26 = t24 * (-2.51969432e-08f);
        PRECISE float t28 = t26 + 2.76094511e-06f;
        PRECISE float t29 = t24 * t28;
        PRECISE float t31 = t29 + (-0.000198427704f);
        PRECISE float t32 = t24 * t31;
        PRECISE float t34 = t32 + 0.00833334867f;
        PRECISE float t35 = t24 * t34;
        PRECISE float t37 = t35 + (-0.166666672f);
        PRECISE float t38 = t24 * t37;
        PRECISE float t39 = t16 * t38;
        PRECISE float t40 = t16 + t39;
        PRECISE float t41 = t23 * t40;
        PRECISE float t42 = min(t41, 1.0f);
        PRECISE float t44 = max(t42, (-1.0f));
        PRECISE float t45 = abs(v1[i]);
        bool t47 = t45 <= 12800.0f;
        PRECISE float t48 = v1[i] - v1[i];
        PRECISE float t49 = t47 ? t44 : t48;
        v49[i] = t49;
    }

    /* %50: affine map W1 from 64 to 64 */
    float v50[64];
    for (int j = 0; j < 64; ++j) {
        v50[j] = weights(65600 + j);
    }
    for (int i = 0; i < 64; ++i) {
        float value = v49[i];
        for (int j = 0; j < 64; ++j) {
            v50[j] += weights(61504 + i * 64 + j) * value;
        }
    }

    /* %52 to %86: elementwise on 64 numbers */
    float v86[64];
    for (int i = 0; i < 64; ++i) {
        PRECISE float t52 = 10.0f * v50[i];
        PRECISE float t53 = t52 * 0.318309873f;
        PRECISE float t54 = t53 + 0.5f;
        PRECISE float t55 = floor(t54);
        PRECISE float t56 = t55 * 3.14160156f;
        PRECISE float t57 = t52 - t56;
        PRECISE float t58 = t55 * (-8.9071691e-06f);
        PRECISE float t59 = t57 - t58;
        PRECISE float t60 = t55 * (-1.74122761e-09f);
        PRECISE float t61 = t59 - t60;
        PRECISE float t62 = 0.5f * t55;
        PRECISE float t63 = floor(t62);
        PRECISE float t64 = 2.0f * t63;
        PRECISE float t65 = t55 - t64;
        PRECISE float t66 = 2.0f * t65;
        PRECISE float t67 = 1.0f - t66;
        PRECISE float t68 = t61 * t61;
        PRECISE float t69 = t68 * (-2.51969432e-08f);
        PRECISE float t70 = t69 + 2.76094511e-06f;
        PRECISE float t71 = t68 * t70;
        PRECISE float t72 = t71 + (-0.000198427704f);
        PRECISE float t73 = t68 * t72;
        PRECISE float t74 = t73 + 0.00833334867f;
        PRECISE float t75 = t68 * t74;
        PRECISE float t76 = t75 + (-0.166666672f);
        PRECISE float t77 = t68 * t76;
        PRECISE float t78 = t61 * t77;
        PRECISE float t79 = t61 + t78;
        PRECISE float t80 = t67 * t79;
        PRECISE float t81 = min(t80, 1.0f);
        PRECISE float t82 = max(t81, (-1.0f));
        PRECISE float t83 = abs(t52);
        bool t84 = t83 <= 12800.0f;
        PRECISE float t85 = t52 - t52;
        PRECISE float t86 = t84 ? t82 : t85;
        v86[i] = t86;
    }

    /* %87: affine map W2 from 64 to 64 */
    float v87[64];
    for (int j = 0; j < 64; ++j) {
        v87[j] = weights(69760 + j);
    }
    for (int i = 0; i < 64; ++i) {
        float value = v86[i];
        for (int j = 0; j < 64; ++j) {
            v87[j] += weights(65664 + i * 64 + j) * value;
        }
    }

    /* %88 to %122: elementwise on 64 numbers */
    float v122[64];
    for (int i = 0; i < 64; ++i) {
        PRECISE float t88 = 10.0f * v87[i];
        PRECISE float t89 = t88 * 0.318309873f;
        PRECISE float t90 = t89 + 0.5f;
        PRECISE float t91 = floor(t90);
        PRECISE float t92 = t91 * 3.14160156f;
        PRECISE float t93 = t88 - t92;
        PRECISE float t94 = t91 * (-8.9071691e-06f);
        PRECISE float t95 = t93 - t94;
        PRECISE float t96 = t91 * (-1.74122761e-09f);
        PRECISE float t97 = t95 - t96;
        PRECISE float t98 = 0.5f * t91;
        PRECISE float t99 = floor(t98);
        PRECISE float t100 = 2.0f * t99;
        PRECISE float t101 = t91 - t100;
        PRECISE float t102 = 2.0f * t101;
        PRECISE float t103 = 1.0f - t102;
        PRECISE float t104 = t97 * t97;
        PRECISE float t105 = t104 * (-2.51969432e-08f);
        PRECISE float t106 = t105 + 2.76094511e-06f;
        PRECISE float t107 = t104 * t106;
        PRECISE float t108 = t107 + (-0.000198427704f);
        PRECISE float t109 = t104 * t108;
        PRECISE float t110 = t109 + 0.00833334867f;
        PRECISE float t111 = t104 * t110;
        PRECISE float t112 = t111 + (-0.166666672f);
        PRECISE float t113 = t104 * t112;
        PRECISE float t114 = t97 * t113;
        PRECISE float t115 = t97 + t114;
        PRECISE float t116 = t103 * t115;
        PRECISE float t117 = min(t116, 1.0f);
        PRECISE float t118 = max(t117, (-1.0f));
        PRECISE float t119 = abs(t88);
        bool t120 = t119 <= 12800.0f;
        PRECISE float t121 = t88 - t88;
        PRECISE float t122 = t120 ? t118 : t121;
        v122[i] = t122;
    }

    /* %123: affine map W3 from 64 to 64 */
    float v123[64];
    for (int j = 0; j < 64; ++j) {
        v123[j] = weights(73920 + j);
    }
    for (int i = 0; i < 64; ++i) {
        float value = v122[i];
        for (int j = 0; j < 64; ++j) {
            v123[j] += weights(69824 + i * 64 + j) * value;
        }
    }

    /* %124 to %158: elementwise on 64 numbers */
    float v158[64];
    for (int i = 0; i < 64; ++i) {
        PRECISE float t124 = 10.0f * v123[i];
        PRECISE float t125 = t124 * 0.318309873f;
        PRECISE float t126 = t125 + 0.5f;
        PRECISE float t127 = floor(t126);
        PRECISE float t128 = t127 * 3.14160156f;
        PRECISE float t129 = t124 - t128;
        PRECISE float t130 = t127 * (-8.9071691e-06f);
        PRECISE float t131 = t129 - t130;
        PRECISE float t132 = t127 * (-1.74122761e-09f);
        PRECISE float t133 = t131 - t132;
        PRECISE float t134 = 0.5f * t127;
        PRECISE float t135 = floor(t134);
        PRECISE float t136 = 2.0f * t135;
        PRECISE float t137 = t127 - t136;
        PRECISE float t138 = 2.0f * t137;
        PRECISE float t139 = 1.0f - t138;
        PRECISE float t140 = t133 * t133;
        PRECISE float t141 = t140 * (-2.51969432e-08f);
        PRECISE float t142 = t141 + 2.76094511e-06f;
        PRECISE float t143 = t140 * t142;
        PRECISE float t144 = t143 + (-0.000198427704f);
        PRECISE float t145 = t140 * t144;
        PRECISE float t146 = t145 + 0.00833334867f;
        PRECISE float t147 = t140 * t146;
        PRECISE float t148 = t147 + (-0.166666672f);
        PRECISE float t149 = t140 * t148;
        PRECISE float t150 = t133 * t149;
        PRECISE float t151 = t133 + t150;
        PRECISE float t152 = t139 * t151;
        PRECISE float t153 = min(t152, 1.0f);
        PRECISE float t154 = max(t153, (-1.0f));
        PRECISE float t155 = abs(t124);
        bool t156 = t155 <= 12800.0f;
        PRECISE float t157 = t124 - t124;
        PRECISE float t158 = t156 ? t154 : t157;
        v158[i] = t158;
    }

    /* %159: affine map W4 from 64 to 3 */
    float v159[3];
    for (int j = 0; j < 3; ++j) {
        v159[j] = weights(74176 + j);
    }
    for (int i = 0; i < 64; ++i) {
        float value = v158[i];
        for (int j = 0; j < 3; ++j) {
            v159[j] += weights(73984 + i * 3 + j) * value;
        }
    }

    /* %161 to %162: elementwise on 3 numbers */
    float v162[3];
    for (int i = 0; i < 3; ++i) {
        PRECISE float t161 = max(v159[i], 0.0f);
        PRECISE float t162 = min(t161, 1.0f);
        v162[i] = t162;
    }

    /* output color */
    for (int i = 0; i < 3; ++i) {
        result[i] = v162[i];
    }
}
