/*
 * wamnet denoiser, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * program   f3364223f05e9cc704eb6c074d489b14
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 *           normal: 3 channels in [-1.0, 1.0], unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 * window    2 x 2 pixels, the pixel itself is tap 1
 * border    zero
 * output    3 channels, sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * sine      emitted, odd polynomial of degree 11
 * bound     |output - float64 reference| <= 2.57e-06 for all images in these ranges
 * sums      over the window: a partial sum for each image and row of taps, in any order; then these
 * arguments image_color: a texture of 32-bit floats;
 *           image_normal: a texture of 32-bit floats;
 *           weight_texture: R32F, 1024 texels wide, as many rows as weights fill, row by row, the last row
 *           padded;
 *           result: a float colour buffer, RGBA, of which 3 components are written, encoded as `output` says.
 *           Draw one triangle that covers what is written: row 0 is the TOP row of all images.
 *           OpenGL's own row 0 is the bottom: flip what it has rendered. Half floats in images void the
 *           bound, and a target that encodes sRGB encodes once more
 * weights   W0 (24 x 4) at 0, b0 (4) at 96, W1 (4 x 3) at 100, b1 (3) at 112; matrices input-major:
 *           D_in x D_out, in C order
 */
#version 330 core
#extension GL_ARB_gpu_shader5 : enable
#if defined(GL_ARB_gpu_shader5) || __VERSION__ >= 400
#define PRECISE precise
#else
#error the error bound needs `precise`: GL_ARB_gpu_shader5, or #version 400
#endif
#define WINDOW_SIZE 2
#define WINDOW_CENTRE 1 /* the tap that lies on the pixel itself */
uniform sampler2D image_color;
uniform sampler2D image_normal;
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

    /* %1: affine map W0 from 24 to 4 */
    PRECISE float v1[4];
    for (int j = 0; j < 4; ++j) {
        v1[j] = weights(96 + j);
    }
    PRECISE float part1[4];
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 4; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            bool inside = row == y + dy - WINDOW_CENTRE && column == x + dx - WINDOW_CENTRE;
            int tap = (dy * WINDOW_SIZE + dx) * 6;
            for (int c = 0; c < 3; ++c) {
                float value = inside ? texelFetch(image_color, ivec2(column, row), 0)[c] : 0.0f;
                for (int j = 0; j < 4; ++j) {
                    part1[j] += weights((tap + c) * 4 + j) * value;
                }
            }
        }
        for (int j = 0; j < 4; ++j) {
            v1[j] += part1[j];
        }
    }
    for (int dy = 0; dy < WINDOW_SIZE; ++dy) {
        int row = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (int j = 0; j < 4; ++j) {
            part1[j] = 0.0f;
        }
        for (int dx = 0; dx < WINDOW_SIZE; ++dx) {
            int column = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            bool inside = row == y + dy - WINDOW_CENTRE && column == x + dx - WINDOW_CENTRE;
            int tap = (dy * WINDOW_SIZE + dx) * 6;
            for (int c = 0; c < 3; ++c) {
                float value = inside ? texelFetch(image_normal, ivec2(column, row), 0)[c] : 0.0f;
                for (int j = 0; j < 4; ++j) {
                    part1[j] += weights((tap + 3 + c) * 4 + j) * value;
                }
            }
        }
        for (int j = 0; j < 4; ++j) {
            v1[j] += part1[j];
        }
    }

    /* %3 to %51: elementwise on 4 numbers */
    float v51[4];
    for (int i = 0; i < 4; ++i) {
        PRECISE float t3 = 3.0f * v1[i];
        PRECISE float t5 = t3 * 0.318309873f;
        PRECISE float t7 = t5 + 0.5f;
        PRECISE float t8 = floor(t7);
        PRECISE float t10 = t8 * 3.14160156f;
        PRECISE float t11 = t3 - t10;
        PRECISE float t13 = t8 * (-8.9071691e-06f);
        PRECISE float t14 = t11 - t13;
        PRECISE float t16 = t8 * (-1.74122761e-09f);
        PRECISE float t17 = t14 - t16;
        PRECISE float t18 = 0.5f * t8;
        PRECISE float t19 = floor(t18);
        PRECISE float t21 = 2.0f * t19;
        PRECISE float t22 = t8 - t21;
        PRECISE float t23 = 2.0f * t22;
        PRECISE float t25 = 1.0f - t23;
        PRECISE float t26 = t17 * t17;
        PRECISE float t28 = t26 * (-2.51969432e-08f);
        PRECISE float t30 = t28 + 2.76094511e-06f;
        PRECISE float t31 = t26 * t30;
        PRECISE float t33 = t31 + (-0.000198427704f);
        PRECISE float t34 = t26 * t33;
        PRECISE float t36 = t34 + 0.00833334867f;
        PRECISE float t37 = t26 * t36;
        PRECISE float t39 = t37 + (-0.166666672f);
        PRECISE float t40 = t26 * t39;
        PRECISE float t41 = t17 * t40;
        PRECISE float t42 = t17 + t41;
        PRECISE float t43 = t25 * t42;
        PRECISE float t44 = min(t43, 1.0f);
        PRECISE float t46 = max(t44, (-1.0f));
        PRECISE float t47 = abs(t3);
        bool t49 = t47 <= 12800.0f;
        PRECISE float t50 = t3 - t3;
        PRECISE float t51 = t49 ? t46 : t50;
        v51[i] = t51;
    }

    /* %52: affine map W1 from 4 to 3 */
    float v52[3];
    for (int j = 0; j < 3; ++j) {
        v52[j] = weights(112 + j);
    }
    for (int i = 0; i < 4; ++i) {
        float value = v51[i];
        for (int j = 0; j < 3; ++j) {
            v52[j] += weights(100 + i * 3 + j) * value;
        }
    }

    /* %54 to %55: elementwise on 3 numbers */
    float v55[3];
    for (int i = 0; i < 3; ++i) {
        PRECISE float t54 = max(v52[i], 0.0f);
        PRECISE float t55 = min(t54, 1.0f);
        v55[i] = t55;
    }

    /* output color */
    for (int i = 0; i < 3; ++i) {
        result[i] = v55[i];
    }
}
