requires packed_4x8_integer_dot_product;
/*
 * a tiny kernel
 */
const WINDOW_SIZE: i32 = 2;
const WINDOW_CENTRE: i32 = 1; /* the tap that lies on the pixel itself */
const GROUP_WIDTH: i32 = 4; /* items of a group along a row */
const GROUP_HEIGHT: i32 = 2;
const PIXELS: i32 = 1; /* pixels of an item, GROUP_WIDTH columns apart */
const TILE_WIDTH: i32 = (GROUP_WIDTH * PIXELS + WINDOW_SIZE - 1); /* all that windows touch */
const TILE_HEIGHT: i32 = (GROUP_HEIGHT + WINDOW_SIZE - 1);
const PLANE: i32 = (TILE_WIDTH * TILE_HEIGHT); /* values of a channel */
const TILE_NUMBERS: i32 = (PLANE * 2);
fn elementwise_49_of_one(v1: f32, v4: f32, v7: f32) -> f32 {
    let t2: i32 = i32(v1);
    let t3: u32 = u32(t2);
    let t5: u32 = u32(v4);
    let t6: u32 = t3 * t5;
    let t8: u32 = u32(v7);
    let t9: u32 = t6 + t8;
    let t11: u32 = t9 >> 22u;
    let t13: u32 = t11 & 1u;
    let t15: u32 = 0u - t13;
    let t16: u32 = t9 ^ t15;
    let t18: u32 = t16 >> 6u;
    let t20: u32 = t18 & 65535u;
    let t21: u32 = t20 * t20;
    let t23: u32 = t21 >> 16u;
    let t25: u32 = t23 * 2332u;
    let t26: u32 = t25 >> 16u;
    let t28: u32 = 20871u - t26;
    let t29: u32 = t23 * t28;
    let t30: u32 = t29 >> 16u;
    let t32: u32 = 51053u - t30;
    let t33: u32 = t20 * t32;
    let t35: u32 = t33 + 8388608u;
    let t37: u32 = t35 >> 24u;
    let t39: u32 = min(t37, 127u);
    let t40: f32 = f32(t39);
    let t42: u32 = t9 >> 23u;
    let t43: u32 = t42 & 1u;
    let t44: f32 = f32(t43);
    let t46: f32 = 2.0f * t44;
    let t48: f32 = 1.0f - t46;
    let t49: f32 = t40 * t48;
    return t49;
}
fn elementwise_49(v1: vec4<f32>, v4: vec4<f32>, v7: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(elementwise_49_of_one(v1.x, v4.x, v7.x), elementwise_49_of_one(v1.y, v4.y, v7.y), elementwise_49_of_one(v1.z, v4.z, v7.z), elementwise_49_of_one(v1.w, v4.w, v7.w));
}
fn elementwise_67_of_one(v50: f32, v52: f32, v55: f32) -> f32 {
    let t51: i32 = i32(v50);
    let t53: i32 = i32(v52);
    let t54: i32 = t51 * t53;
    let t56: i32 = i32(v55);
    let t57: i32 = t54 + t56;
    let t59: i32 = max(t57, 0);
    let t61: i32 = min(t59, 16777216);
    let t62: u32 = u32(t61);
    let t64: u32 = t62 >> 8u;
    let t65: f32 = f32(t64);
    let t67: f32 = t65 * 1.52587891e-05f;
    return t67;
}
fn elementwise_67(v50: vec4<f32>, v52: vec4<f32>, v55: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(elementwise_67_of_one(v50.x, v52.x, v55.x), elementwise_67_of_one(v50.y, v52.y, v55.y), elementwise_67_of_one(v50.z, v52.z, v55.z), elementwise_67_of_one(v50.w, v52.w, v55.w));
}
struct Size {
    width: i32,
    height: i32,
}
@group(0) @binding(0) var<uniform> size: Size;
@group(0) @binding(1) var<storage, read> w: array<vec4<i32>>;
@group(0) @binding(2) var<storage, read_write> result: array<f32>;
@group(0) @binding(3) var<storage, read> image_a: array<f32>;
@group(0) @binding(4) var<storage, read> image_b: array<f32>;
var<workgroup> tile: array<i32, TILE_NUMBERS>;

fn wamnet_packed(a: f32, b: f32, c: f32, d: f32) -> i32 {
    return bitcast<i32>(pack4xI8(vec4<i32>(vec4<f32>(a, b, c, d))));
}
fn wamnet_dots(sums: vec4<i32>, weights: vec4<i32>, word: i32) -> vec4<i32> {
    let words = bitcast<vec4<u32>>(weights);
    let four = bitcast<u32>(word);
    let x = dot4I8Packed(words.x, four);
    let y = dot4I8Packed(words.y, four);
    let z = dot4I8Packed(words.z, four);
    let w = dot4I8Packed(words.w, four);
    return sums + vec4<i32>(x, y, z, w);
}
fn wamnet_floats(sums: vec4<i32>) -> vec4<f32> {
    return vec4<f32>(sums);
}
fn wamnet_numbers(bits: vec4<i32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(bits);
}

@compute @workgroup_size(GROUP_WIDTH, GROUP_HEIGHT)
fn main(@builtin(local_invocation_id) item_place: vec3<u32>, @builtin(workgroup_id) group_place: vec3<u32>) {
    let width: i32 = size.width;
    let height: i32 = size.height;
    let local_x: i32 = i32(item_place.x);
    let local_y: i32 = i32(item_place.y);
    let item: i32 = local_y * GROUP_WIDTH + local_x;
    let x: i32 = i32(group_place.x) * (GROUP_WIDTH * PIXELS) + local_x;
    let y: i32 = i32(group_place.y) * GROUP_HEIGHT + local_y;
    let left: i32 = x - local_x - WINDOW_CENTRE;
    let top: i32 = y - local_y - WINDOW_CENTRE;

    /* %1: affine map W0 from 20 to 3 */
    var s1_0_0: vec4<i32> = vec4<i32>(0);
    for (var i: i32 = item; i < PLANE; i += GROUP_WIDTH * GROUP_HEIGHT) {
        let tile_row: i32 = top + i / TILE_WIDTH;
        let tile_column: i32 = left + i % TILE_WIDTH;
        let row: i32 = clamp(tile_row, 0, height - 1);
        let column: i32 = clamp(tile_column, 0, width - 1);
        let inside: bool = row == tile_row && column == tile_column;
        tile[i] = wamnet_packed(select(0.0f, image_a[(row * width + column) * 3 + 0], inside), select(0.0f, image_a[(row * width + column) * 3 + 1], inside), select(0.0f, image_a[(row * width + column) * 3 + 2], inside), select(0.0f, image_b[(row * width + column) * 2 + 0], inside));
        tile[PLANE + i] = wamnet_packed(select(0.0f, image_b[(row * width + column) * 2 + 1], inside), 0.0f, 0.0f, 0.0f);
    }
    workgroupBarrier();
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let at: i32 = (local_y + dy) * TILE_WIDTH + local_x + dx;
            let first: i32 = (dy * WINDOW_SIZE + dx) * 2;
            let x0_0: i32 = tile[at];
            {
                let m: vec4<i32> = w[first];
                s1_0_0 = wamnet_dots(s1_0_0, m, x0_0);
            }
            let x1_0: i32 = tile[PLANE + at];
            {
                let m: vec4<i32> = w[first + 1];
                s1_0_0 = wamnet_dots(s1_0_0, m, x1_0);
            }
        }
    }
    var v1_0_0: vec4<f32> = wamnet_floats(s1_0_0);

    /* %2 to %49: elementwise on 3 numbers */
    var v49_0_0: vec4<f32> = elementwise_49(v1_0_0, wamnet_numbers(w[8]), wamnet_numbers(w[9]));

    /* %50: affine map W1 from 3 to 3 */
    var s50_0_0: vec4<i32> = vec4<i32>(0);
    let b50_0_0: i32 = wamnet_packed(v49_0_0.x, v49_0_0.y, v49_0_0.z, v49_0_0.w);
    {
        let m: vec4<i32> = w[10];
        s50_0_0 = wamnet_dots(s50_0_0, m, b50_0_0);
    }
    var v50_0_0: vec4<f32> = wamnet_floats(s50_0_0);

    /* %51 to %67: elementwise on 3 numbers */
    var v67_0_0: vec4<f32> = elementwise_67(v50_0_0, wamnet_numbers(w[11]), wamnet_numbers(w[12]));

    /* output color */
    if (x < width && y < height) {
        result[(y * width + x) * 3 + 0] = v67_0_0.x;
        result[(y * width + x) * 3 + 1] = v67_0_0.y;
        result[(y * width + x) * 3 + 2] = v67_0_0.z;
    }
}
