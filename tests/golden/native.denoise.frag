/*
 * wamnet denoiser, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * program   f3364223f05e9cc704eb6c074d489b14
 * images    color: 3 channels in [0.0, 1.0], sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 *           normal: 3 channels in [-1.0, 1.0], unit normal in world space towards the ray's origin, mean over samples; 0 where nothing is hit
 * window    2 x 2 pixels, the pixel itself is tap 1
 * border    zero
 * output    3 channels, sRGB of (linear radiance * 2^0.0) clipped to 0 .. 1 (IEC 61966-2-1)
 * profile   native: any order of summation, fused multiply-add allowed, the target's own sine
 * sine      sin() of GLSL 3.30, which promises nothing
 * bound     none: for some images an operation of this program promises nothing on this target
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
#define PRECISE
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

    /* %3 to %4: elementwise on 4 numbers */
    float v4[4];
    for (int i = 0; i < 4; ++i) {
        PRECISE float t3 = 3.0f * v1[i];
        PRECISE float t4 = sin(t3);
        v4[i] = t4;
    }

    /* %5: affine map W1 from 4 to 3 */
    float v5[3];
    for (int j = 0; j < 3; ++j) {
        v5[j] = weights(112 + j);
    }
    for (int i = 0; i < 4; ++i) {
        float value = v4[i];
        for (int j = 0; j < 3; ++j) {
            v5[j] += weights(100 + i * 3 + j) * value;
        }
    }

    /* %7 to %9: elementwise on 3 numbers */
    float v9[3];
    for (int i = 0; i < 3; ++i) {
        PRECISE float t7 = max(v5[i], 0.0f);
        PRECISE float t9 = min(t7, 1.0f);
        v9[i] = t9;
    }

    /* output color */
    for (int i = 0; i < 3; ++i) {
        result[i] = v9[i];
    }
}
