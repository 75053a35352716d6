/*
 * wamnet denoiser, GLSL 3.30, fragment shader. Generated: change the compiler, not this text.
 * program   f57520577fed32a74017101934ae7668
 * images    i0: 2 channels in [-1.0, 1.0]
 *           i1: 1 channels in [-1.0, 1.0]
 * window    2 x 2 pixels, the pixel itself is tap 1
 * border    zero
 * output    2 channels
 * profile   ieee: any order of summation, fused multiply-add allowed, emitted sine
 * sine      emitted, odd polynomial of degree 11
 * bound     |output - float64 reference| <= 2.29e-06 for all images in these ranges
 * sums      over the window: a partial sum for each image and row of taps, in any order; then these
 * schedule  inlined: all loops unrolled, every weight a constant of the source
 * arguments image_i0: a texture of 32-bit floats;
 *           image_i1: a texture of 32-bit floats;
 *           result: a float colour buffer, RGBA, of which 2 components are written, encoded as `output` says.
 *           Draw one triangle that covers what is written: row 0 is the TOP row of all images.
 *           OpenGL's own row 0 is the bottom: flip what it has rendered. Half floats in images void the
 *           bound, and a target that encodes sRGB encodes once more
 * weights   none; every weight is a constant of the source
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
vec4 elementwise_49(vec4 v1)
{
    PRECISE vec4 t3 = v1 * 0.318309873f;
    PRECISE vec4 t5 = t3 + 0.5f;
    PRECISE vec4 t6 = floor(t5);
    PRECISE vec4 t8 = t6 * 3.14160156f;
    PRECISE vec4 t9 = v1 - t8;
    PRECISE vec4 t11 = t6 * (-8.9071691e-06f);
    PRECISE vec4 t12 = t9 - t11;
    PRECISE vec4 t14 = t6 * (-1.74122761e-09f);
    PRECISE vec4 t15 = t12 - t14;
    PRECISE vec4 t16 = 0.5f * t6;
    PRECISE vec4 t17 = floor(t16);
    PRECISE vec4 t19 = 2.0f * t17;
    PRECISE vec4 t20 = t6 - t19;
    PRECISE vec4 t21 = 2.0f * t20;
    PRECISE vec4 t23 = 1.0f - t21;
    PRECISE vec4 t24 = t15 * t15;
    PRECISE vec4 t26 = t24 * (-2.51969432e-08f);
    PRECISE vec4 t28 = t26 + 2.76094511e-06f;
    PRECISE vec4 t29 = t24 * t28;
    PRECISE vec4 t31 = t29 + (-0.000198427704f);
    PRECISE vec4 t32 = t24 * t31;
    PRECISE vec4 t34 = t32 + 0.00833334867f;
    PRECISE vec4 t35 = t24 * t34;
    PRECISE vec4 t37 = t35 + (-0.166666672f);
    PRECISE vec4 t38 = t24 * t37;
    PRECISE vec4 t39 = t15 * t38;
    PRECISE vec4 t40 = t15 + t39;
    PRECISE vec4 t41 = t23 * t40;
    PRECISE vec4 t42 = min(t41, vec4(1.0f));
    PRECISE vec4 t44 = max(t42, vec4(-1.0f));
    PRECISE vec4 t45 = abs(v1);
    bvec4 t47 = lessThanEqual(t45, vec4(12800.0f));
    PRECISE vec4 t48 = v1 - v1;
    PRECISE vec4 t49 = mix(t48, t44, t47);
    return t49;
}
vec4 elementwise_53(vec4 v50)
{
    PRECISE vec4 t52 = max(v50, vec4(0.0f));
    PRECISE vec4 t53 = min(t52, vec4(1.0f));
    return t53;
}
uniform sampler2D image_i0;
uniform sampler2D image_i1;
layout(location = 0) out vec4 result;

void main()
{
    int width = textureSize(image_i0, 0).x;
    int height = textureSize(image_i0, 0).y;
    int x = int(gl_FragCoord.x);
    int y = int(gl_FragCoord.y);
    result = vec4(0.0, 0.0, 0.0, 1.0);

    /* %1: affine map W0 from 12 to 5 */
    PRECISE vec4 v1_0 = vec4((-0.03125f), 0.0f, 0.25f, 0.4375f);
    PRECISE vec4 v1_1 = vec4((-0.46875f), 0.0f, 0.0f, 0.0f);
    {
        PRECISE vec4 part1_0 = vec4(0.0f);
        PRECISE vec4 part1_1 = vec4(0.0f);
        {
            int row = clamp(y - 1, 0, height - 1);
            int column = clamp(x - 1, 0, width - 1);
            bool inside = row == y - 1 && column == x - 1;
            vec2 i0 = inside ? texelFetch(image_i0, ivec2(column, row), 0).rg : vec2(0.0f);
            part1_0 += vec4((-0.03125f), (-0.234375f), 0.3125f, 0.390625f) * i0.x;
            part1_1 += vec4(0.234375f, 0.0f, 0.0f, 0.0f) * i0.x;
            part1_0 += vec4(0.0f, 0.3125f, (-0.171875f), (-0.296875f)) * i0.y;
            part1_1 += vec4(0.453125f, 0.0f, 0.0f, 0.0f) * i0.y;
        }
        {
            int row = clamp(y - 1, 0, height - 1);
            int column = clamp(x + 1 - 1, 0, width - 1);
            bool inside = row == y - 1 && column == x + 1 - 1;
            vec2 i0 = inside ? texelFetch(image_i0, ivec2(column, row), 0).rg : vec2(0.0f);
            part1_0 += vec4(0.4375f, (-0.09375f), 0.28125f, (-0.25f)) * i0.x;
            part1_1 += vec4(0.21875f, 0.0f, 0.0f, 0.0f) * i0.x;
            part1_0 += vec4((-0.46875f), 0.140625f, (-0.390625f), (-0.484375f)) * i0.y;
            part1_1 += vec4((-0.21875f), 0.0f, 0.0f, 0.0f) * i0.y;
        }
        v1_0 += part1_0;
        v1_1 += part1_1;
    }
    {
        PRECISE vec4 part1_0 = vec4(0.0f);
        PRECISE vec4 part1_1 = vec4(0.0f);
        {
            int row = clamp(y + 1 - 1, 0, height - 1);
            int column = clamp(x - 1, 0, width - 1);
            bool inside = row == y + 1 - 1 && column == x - 1;
            vec2 i0 = inside ? texelFetch(image_i0, ivec2(column, row), 0).rg : vec2(0.0f);
            part1_0 += vec4(0.3125f, (-0.421875f), (-0.390625f), (-0.453125f)) * i0.x;
            part1_1 += vec4(0.421875f, 0.0f, 0.0f, 0.0f) * i0.x;
            part1_0 += vec4(0.4375f, (-0.484375f), (-0.046875f), (-0.234375f)) * i0.y;
            part1_1 += vec4((-0.234375f), 0.0f, 0.0f, 0.0f) * i0.y;
        }
        {
            int row = clamp(y + 1 - 1, 0, height - 1);
            int column = clamp(x + 1 - 1, 0, width - 1);
            bool inside = row == y + 1 - 1 && column == x + 1 - 1;
            vec2 i0 = inside ? texelFetch(image_i0, ivec2(column, row), 0).rg : vec2(0.0f);
            part1_0 += vec4((-0.203125f), 0.25f, (-0.375f), (-0.015625f)) * i0.x;
            part1_1 += vec4((-0.34375f), 0.0f, 0.0f, 0.0f) * i0.x;
            part1_0 += vec4(0.359375f, 0.328125f, (-0.125f), (-0.390625f)) * i0.y;
            part1_1 += vec4((-0.1875f), 0.0f, 0.0f, 0.0f) * i0.y;
        }
        v1_0 += part1_0;
        v1_1 += part1_1;
    }
    {
        PRECISE vec4 part1_0 = vec4(0.0f);
        PRECISE vec4 part1_1 = vec4(0.0f);
        {
            int row = clamp(y - 1, 0, height - 1);
            int column = clamp(x - 1, 0, width - 1);
            bool inside = row == y - 1 && column == x - 1;
            float i1 = inside ? texelFetch(image_i1, ivec2(column, row), 0)[0] : 0.0f;
            part1_0 += vec4(0.25f, (-0.25f), (-0.0625f), 0.0f) * i1;
            part1_1 += vec4((-0.421875f), 0.0f, 0.0f, 0.0f) * i1;
        }
        {
            int row = clamp(y - 1, 0, height - 1);
            int column = clamp(x + 1 - 1, 0, width - 1);
            bool inside = row == y - 1 && column == x + 1 - 1;
            float i1 = inside ? texelFetch(image_i1, ivec2(column, row), 0)[0] : 0.0f;
            part1_0 += vec4((-0.359375f), 0.046875f, (-0.203125f), 0.25f) * i1;
            part1_1 += vec4(0.03125f, 0.0f, 0.0f, 0.0f) * i1;
        }
        v1_0 += part1_0;
        v1_1 += part1_1;
    }
    {
        PRECISE vec4 part1_0 = vec4(0.0f);
        PRECISE vec4 part1_1 = vec4(0.0f);
        {
            int row = clamp(y + 1 - 1, 0, height - 1);
            int column = clamp(x - 1, 0, width - 1);
            bool inside = row == y + 1 - 1 && column == x - 1;
            float i1 = inside ? texelFetch(image_i1, ivec2(column, row), 0)[0] : 0.0f;
            part1_0 += vec4((-0.265625f), 0.359375f, 0.46875f, (-0.015625f)) * i1;
            part1_1 += vec4(0.21875f, 0.0f, 0.0f, 0.0f) * i1;
        }
        {
            int row = clamp(y + 1 - 1, 0, height - 1);
            int column = clamp(x + 1 - 1, 0, width - 1);
            bool inside = row == y + 1 - 1 && column == x + 1 - 1;
            float i1 = inside ? texelFetch(image_i1, ivec2(column, row), 0)[0] : 0.0f;
            part1_0 += vec4((-0.078125f), 0.03125f, (-0.109375f), 0.46875f) * i1;
            part1_1 += vec4(0.46875f, 0.0f, 0.0f, 0.0f) * i1;
        }
        v1_0 += part1_0;
        v1_1 += part1_1;
    }

    /* %3 to %49: elementwise on 5 numbers */
    vec4 v49_0 = elementwise_49(v1_0);
    vec4 v49_1 = elementwise_49(v1_1);

    /* %50: affine map W1 from 5 to 2 */
    vec4 v50_0 = vec4(0.0f);
    v50_0 += vec4(0.328125f, 0.3125f, 0.0f, 0.0f) * v49_0.x;
    v50_0 += vec4((-0.25f), (-0.0625f), 0.0f, 0.0f) * v49_0.y;
    v50_0 += vec4((-0.40625f), (-0.421875f), 0.0f, 0.0f) * v49_0.z;
    v50_0 += vec4((-0.203125f), (-0.171875f), 0.0f, 0.0f) * v49_0.w;
    v50_0 += vec4((-0.09375f), 0.09375f, 0.0f, 0.0f) * v49_1.x;

    /* %52 to %53: elementwise on 2 numbers */
    vec4 v53_0 = elementwise_53(v50_0);

    /* output color */
    result[0] = v53_0.x;
    result[1] = v53_0.y;
}
