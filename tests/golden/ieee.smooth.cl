/*
 * wamnet edge-avoiding filter: one level of means, OpenCL C 1.2. Generated: change the compiler, not this text.
 * program   8b394641fc87462674d11ff7e46d8f83
 * program   2af2be0d0ca07c315f98de34d92385c6
 * bound     at given layers: see the rules for each operation
 * arguments guides: planes of height rows of row_stride floats:
 *           normal_x, normal_y, normal_z, albedo_x, albedo_y, albedo_z, position_x, position_y, position_z,
 *           factor_position_x;
 *           light: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           result: planes of height rows of row_stride floats:
 *           color_r, color_g, color_b;
 *           width; height; row_stride: at least width, a multiple of 16; gap: pixels between taps.
 *           Global size: at least (ceil(width / 16), height)
 */
__constant float SPLINE[5] = {0.0625f, 0.25f, 0.375f, 0.25f, 0.0625f};
/* Elements of a row from a column on; beyond the row's ends they are those at its ends. */
float16 row_at(__global const float *restrict row, int column, int width)
{
    if (column >= 0 && column + 16 <= width) {
        return vload16(0, row + column);
    }
    float all[16];
    for (int i = 0; i < 16; ++i) {
        all[i] = row[clamp(column + i, 0, width - 1)];
    }
    return vload16(0, all);
}

__kernel void wamnet_smooth(
    __global const float *restrict guides,
    __global const float *restrict light,
    __global float *restrict result,
    int width,
    int height,
    int row_stride,
    int gap)
{
    int x = (int)get_global_id(0) * 16;
    int y = (int)get_global_id(1);
    if (x >= width || y >= height) {
        return;
    }
    size_t stride = (size_t)row_stride;
    size_t plane = (size_t)height * stride;
    size_t at = (size_t)y * stride + (size_t)x;
    float16 here_normal_x = row_at(guides + 0 * plane + (size_t)y * stride, x, width);
    float16 here_normal_y = row_at(guides + 1 * plane + (size_t)y * stride, x, width);
    float16 here_normal_z = row_at(guides + 2 * plane + (size_t)y * stride, x, width);
    float16 here_albedo_x = row_at(guides + 3 * plane + (size_t)y * stride, x, width);
    float16 here_albedo_y = row_at(guides + 4 * plane + (size_t)y * stride, x, width);
    float16 here_albedo_z = row_at(guides + 5 * plane + (size_t)y * stride, x, width);
    float16 here_position_x = row_at(guides + 6 * plane + (size_t)y * stride, x, width);
    float16 here_position_y = row_at(guides + 7 * plane + (size_t)y * stride, x, width);
    float16 here_position_z = row_at(guides + 8 * plane + (size_t)y * stride, x, width);
    float16 here_factor_position_x = row_at(guides + 9 * plane + (size_t)y * stride, x, width);
    float16 total_r = (float16)(0.0f);
    float16 total_g = (float16)(0.0f);
    float16 total_b = (float16)(0.0f);
    float16 weights = (float16)(0.0f);
    for (int dy = 0; dy < 5; ++dy) {
        int line = clamp(y + gap * (dy - 2), 0, height - 1);
        for (int dx = 0; dx < 5; ++dx) {
            int column = x + gap * (dx - 2);
            float16 there_normal_x = row_at(guides + 0 * plane + (size_t)line * stride, column, width);
            float16 there_normal_y = row_at(guides + 1 * plane + (size_t)line * stride, column, width);
            float16 there_normal_z = row_at(guides + 2 * plane + (size_t)line * stride, column, width);
            float16 there_albedo_x = row_at(guides + 3 * plane + (size_t)line * stride, column, width);
            float16 there_albedo_y = row_at(guides + 4 * plane + (size_t)line * stride, column, width);
            float16 there_albedo_z = row_at(guides + 5 * plane + (size_t)line * stride, column, width);
            float16 there_position_x = row_at(guides + 6 * plane + (size_t)line * stride, column, width);
            float16 there_position_y = row_at(guides + 7 * plane + (size_t)line * stride, column, width);
            float16 there_position_z = row_at(guides + 8 * plane + (size_t)line * stride, column, width);
            float16 color_r = row_at(light + 0 * plane + (size_t)line * stride, column, width);
            float16 color_g = row_at(light + 1 * plane + (size_t)line * stride, column, width);
            float16 color_b = row_at(light + 2 * plane + (size_t)line * stride, column, width);
            float16 spline = (float16)(SPLINE[dy] * SPLINE[dx]);
            float16 t29 = there_normal_x - here_normal_x;
            float16 t30 = there_normal_y - here_normal_y;
            float16 t31 = there_normal_z - here_normal_z;
            float16 t32 = there_albedo_x - here_albedo_x;
            float16 t33 = there_albedo_y - here_albedo_y;
            float16 t34 = there_albedo_z - here_albedo_z;
            float16 t35 = there_position_x - here_position_x;
            float16 t36 = there_position_y - here_position_y;
            float16 t37 = there_position_z - here_position_z;
            float16 t38 = t29 * 2.0f;
            float16 t39 = t30 * 2.0f;
            float16 t40 = t31 * 2.0f;
            float16 t41 = t32 * 5.0f;
            float16 t42 = t33 * 5.0f;
            float16 t43 = t34 * 5.0f;
            float16 t44 = t35 * here_factor_position_x;
            float16 t45 = t36 * here_factor_position_x;
            float16 t46 = t37 * here_factor_position_x;
            float16 t47 = t38 * t38;
            float16 t48 = t39 * t39;
            float16 t49 = t40 * t40;
            float16 t50 = t41 * t41;
            float16 t51 = t42 * t42;
            float16 t52 = t43 * t43;
            float16 t53 = t44 * t44;
            float16 t54 = t45 * t45;
            float16 t55 = t46 * t46;
            float16 t56 = t47 + t48;
            float16 t57 = t49 + t50;
            float16 t58 = t51 + t52;
            float16 t59 = t53 + t54;
            float16 t60 = t56 + t57;
            float16 t61 = t58 + t59;
            float16 t62 = t60 + t61;
            float16 t63 = t62 + t55;
            float16 t65 = (-0.5f) * t63;
            float16 t66 = exp(t65);
            float16 t67 = spline * t66;
            float16 t68 = t67 * color_r;
            float16 t69 = t67 * color_g;
            float16 t70 = t67 * color_b;
            float16 t71 = total_r + t68;
            float16 t72 = total_g + t69;
            float16 t73 = total_b + t70;
            float16 t74 = weights + t67;
            total_r = t71;
            total_g = t72;
            total_b = t73;
            weights = t74;
        }
    }
    float16 t4 = total_r / weights;
    float16 t5 = total_g / weights;
    float16 t6 = total_b / weights;
    vstore16(t4, 0, result + 0 * plane + at);
    vstore16(t5, 0, result + 1 * plane + at);
    vstore16(t6, 0, result + 2 * plane + at);
}
