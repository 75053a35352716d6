/*
 * wamnet denoiser, WGSL. Generated: change the compiler, not this text.
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
 * assumes   the compiler keeps the order of the operations of an expression, fused or not, and
 *           rounds to nearest. The standard lets it reorder them (WGSL 15.7.5) and round up or down
 *           (15.7.2), and has no word to forbid that. Run the check pair on a new device before you
 *           rely on the bound
 * sums      over the window: a partial sum for each image and row of taps, in any order; then these
 * arguments 0 32-bit integers: width, height;
 *           1 weights: 74179 floats;
 *           2 result: width * height * 3 floats, rows from the top, channels interleaved, encoded as `output`
 *           says;
 *           3 image_color: width * height * 3 floats, rows from the top, channels interleaved;
 *           4 image_seen_normal: width * height * 3 floats, rows from the top, channels interleaved;
 *           5 image_seen_albedo: width * height * 3 floats, rows from the top, channels interleaved;
 *           6 image_seen_position: width * height * 3 floats, rows from the top, channels interleaved;
 *           7 image_seen_direct: width * height * 3 floats, rows from the top, channels interleaved.
 *           Groups of 8 x 8: ceil(width / 8) x ceil(height / 8)
 * weights   W0 (960 x 64) at 0, b0 (64) at 61440, W1 (64 x 64) at 61504, b1 (64) at 65600, W2 (64 x
 *           64) at 65664, b2 (64) at 69760, W3 (64 x 64) at 69824, b3 (64) at 73920, W4 (64 x 3) at
 *           73984, b4 (3) at 74176; matrices input-major: D_in x D_out, in C order
 */
const WINDOW_SIZE: i32 = 8;
const WINDOW_CENTRE: i32 = 4; /* the tap that lies on the pixel itself */
struct Size {
    width: i32,
    height: i32,
}
@group(0) @binding(0) var<uniform> size: Size;
@group(0) @binding(1) var<storage, read> weights: array<f32>;
@group(0) @binding(2) var<storage, read_write> result: array<f32>;
@group(0) @binding(3) var<storage, read> image_color: array<f32>;
@group(0) @binding(4) var<storage, read> image_seen_normal: array<f32>;
@group(0) @binding(5) var<storage, read> image_seen_albedo: array<f32>;
@group(0) @binding(6) var<storage, read> image_seen_position: array<f32>;
@group(0) @binding(7) var<storage, read> image_seen_direct: array<f32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let width: i32 = size.width;
    let height: i32 = size.height;
    let x: i32 = i32(invocation.x);
    let y: i32 = i32(invocation.y);
    if (x >= width || y >= height) {
        return;
    }

    /* %1: affine map W0 from 960 to 64 */
    var v1: array<f32, 64>;
    for (var j: i32 = 0; j < 64; j++) {
        v1[j] = weights[61440 + j];
    }
    var part1: array<f32, 64>;
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        let row: i32 = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (var j: i32 = 0; j < 64; j++) {
            part1[j] = 0.0f;
        }
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let column: i32 = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            let tap: i32 = (dy * WINDOW_SIZE + dx) * 15;
            for (var c: i32 = 0; c < 3; c++) {
                let value: f32 = image_color[(row * width + column) * 3 + c];
                for (var j: i32 = 0; j < 64; j++) {
                    part1[j] += weights[(tap + c) * 64 + j] * value;
                }
            }
        }
        for (var j: i32 = 0; j < 64; j++) {
            v1[j] += part1[j];
        }
    }
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        let row: i32 = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (var j: i32 = 0; j < 64; j++) {
            part1[j] = 0.0f;
        }
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let column: i32 = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            let tap: i32 = (dy * WINDOW_SIZE + dx) * 15;
            for (var c: i32 = 0; c < 3; c++) {
                let value: f32 = image_seen_normal[(row * width + column) * 3 + c];
                for (var j: i32 = 0; j < 64; j++) {
                    part1[j] += weights[(tap + 3 + c) * 64 + j] * value;
                }
            }
        }
        for (var j: i32 = 0; j < 64; j++) {
            v1[j] += part1[j];
        }
    }
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        let row: i32 = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (var j: i32 = 0; j < 64; j++) {
            part1[j] = 0.0f;
        }
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let column: i32 = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            let tap: i32 = (dy * WINDOW_SIZE + dx) * 15;
            for (var c: i32 = 0; c < 3; c++) {
                let value: f32 = image_seen_albedo[(row * width + column) * 3 + c];
                for (var j: i32 = 0; j < 64; j++) {
                    part1[j] += weights[(tap + 6 + c) * 64 + j] * value;
                }
            }
        }
        for (var j: i32 = 0; j < 64; j++) {
            v1[j] += part1[j];
        }
    }
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        let row: i32 = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (var j: i32 = 0; j < 64; j++) {
            part1[j] = 0.0f;
        }
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let column: i32 = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            let tap: i32 = (dy * WINDOW_SIZE + dx) * 15;
            for (var c: i32 = 0; c < 3; c++) {
                let value: f32 = image_seen_position[(row * width + column) * 3 + c];
                for (var j: i32 = 0; j < 64; j++) {
                    part1[j] += weights[(tap + 9 + c) * 64 + j] * value;
                }
            }
        }
        for (var j: i32 = 0; j < 64; j++) {
            v1[j] += part1[j];
        }
    }
    for (var dy: i32 = 0; dy < WINDOW_SIZE; dy++) {
        let row: i32 = clamp(y + dy - WINDOW_CENTRE, 0, height - 1);
        for (var j: i32 = 0; j < 64; j++) {
            part1[j] = 0.0f;
        }
        for (var dx: i32 = 0; dx < WINDOW_SIZE; dx++) {
            let column: i32 = clamp(x + dx - WINDOW_CENTRE, 0, width - 1);
            let tap: i32 = (dy * WINDOW_SIZE + dx) * 15;
            for (var c: i32 = 0; c < 3; c++) {
                let value: f32 = image_seen_direct[(row * width + column) * 3 + c];
                for (var j: i32 = 0; j < 64; j++) {
                    part1[j] += weights[(tap + 12 + c) * 64 + j] * value;
                }
            }
        }
        for (var j: i32 = 0; j < 64; j++) {
            v1[j] += part1[j];
        }
    }

    /* %4 to %49: elementwise on 64 numbers */
    var v49: array<f32, 64>;
    for (var i: i32 = 0; i < 64; i++) {
        let t4: f32 = v1[i] * 0.318309873f;
        let t6: f32 = t4 + 0.5f;
        let t7: f32 = floor(t6);
        let t9: f32 = t7 * 3.14160156f;
        let t10: f32 = v1[i] - t9;
        let t12: f32 = t7 * (-8.9071691e-06f);
        let t13: f32 = t10 - t12;
        let t15: f32 = t7 * (-1.74122761e-09f);
        let t16: f32 = t13 - t15;
        let t17: f32 = 0.5f * t7;
        let t18: f32 = floor(t17);
        let t20: f32 = 2.0f * t18;
        let t21: f32 = t7 - t20;
        let t22: f32 = 2.0f * t21;
        let t23: f32 = 1.0f - t22;
        let t24: f32 = t16 * t16;
        let t26: f32 = t24 * (-2.51969432e-08f);
        let t28: f32 = t26 + 2.76094511e-06f;
        let t29: f32 = t24 * t28;
        let t31: f32 = t29 + (-0.000198427704f);
        let t32: f32 = t24 * t31;
        let t34: f32 = t32 + 0.00833334867f;
        let t35: f32 = t24 * t34;
        let t37: f32 = t35 + (-0.166666672f);
        let t38: f32 = t24 * t37;
        let t39: f32 = t16 * t38;
        let t40: f32 = t16 + t39;
        let t41: f32 = t23 * t40;
        let t42: f32 = min(t41, 1.0f);
        let t44: f32 = max(t42, (-1.0f));
        let t45: f32 = abs(v1[i]);
        let t47: bool = t45 <= 12800.0f;
        let t48: f32 = v1[i] - v1[i];
        let t49: f32 = select(t48, t44, t47);
        v49[i] = t49;
    }

    /* %50: affine map W1 from 64 to 64 */
    var v50: array<f32, 64>;
    for (var j: i32 = 0; j < 64; j++) {
        v50[j] = weights[65600 + j];
    }
    for (var i: i32 = 0; i < 64; i++) {
        let value: f32 = v49[i];
        for (var j: i32 = 0; j < 64; j++) {
            v50[j] += weights[61504 + i * 64 + j] * value;
        }
    }

    /* %52 to %86: elementwise on 64 numbers */
    var v86: array<f32, 64>;
    for (var i: i32 = 0; i < 64; i++) {
        let t52: f32 = 10.0f * v50[i];
        let t53: f32 = t52 * 0.318309873f;
        let t54: f32 = t53 + 0.5f;
        let t55: f32 = floor(t54);
        let t56: f32 = t55 * 3.14160156f;
        let t57: f32 = t52 - t56;
        let t58: f32 = t55 * (-8.9071691e-06f);
        let t59: f32 = t57 - t58;
        let t60: f32 = t55 * (-1.74122761e-09f);
        let t61: f32 = t59 - t60;
        let t62: f32 = 0.5f * t55;
        let t63: f32 = floor(t62);
        let t64: f32 = 2.0f * t63;
        let t65: f32 = t55 - t64;
        let t66: f32 = 2.0f * t65;
        let t67: f32 = 1.0f - t66;
        let t68: f32 = t61 * t61;
        let t69: f32 = t68 * (-2.51969432e-08f);
        let t70: f32 = t69 + 2.76094511e-06f;
        let t71: f32 = t68 * t70;
        let t72: f32 = t71 + (-0.000198427704f);
        let t73: f32 = t68 * t72;
        let t74: f32 = t73 + 0.00833334867f;
        let t75: f32 = t68 * t74;
        let t76: f32 = t75 + (-0.166666672f);
        let t77: f32 = t68 * t76;
        let t78: f32 = t61 * t77;
        let t79: f32 = t61 + t78;
        let t80: f32 = t67 * t79;
        let t81: f32 = min(t80, 1.0f);
        let t82: f32 = max(t81, (-1.0f));
        let t83: f32 = abs(t52);
        let t84: bool = t83 <= 12800.0f;
        let t85: f32 = t52 - t52;
        let t86: f32 = select(t85, t82, t84);
        v86[i] = t86;
    }

    /* %87: affine map W2 from 64 to 64 */
    var v87: array<f32, 64>;
    for (var j: i32 = 0; j < 64; j++) {
        v87[j] = weights[69760 + j];
    }
    for (var i: i32 = 0; i < 64; i++) {
        let value: f32 = v86[i];
        for (var j: i32 = 0; j < 64; j++) {
            v87[j] += weights[65664 + i * 64 + j] * value;
        }
    }

    /* %88 to %122: elementwise on 64 numbers */
    var v122: array<f32, 64>;
    for (var i: i32 = 0; i < 64; i++) {
        let t88: f32 = 10.0f * v87[i];
        let t89: f32 = t88 * 0.318309873f;
        let t90: f32 = t89 + 0.5f;
        let t91: f32 = floor(t90);
        let t92: f32 = t91 * 3.14160156f;
        let t93: f32 = t88 - t92;
        let t94: f32 = t91 * (-8.9071691e-06f);
        let t95: f32 = t93 - t94;
        let t96: f32 = t91 * (-1.74122761e-09f);
        let t97: f32 = t95 - t96;
        let t98: f32 = 0.5f * t91;
        let t99: f32 = floor(t98);
        let t100: f32 = 2.0f * t99;
        let t101: f32 = t91 - t100;
        let t102: f32 = 2.0f * t101;
        let t103: f32 = 1.0f - t102;
        let t104: f32 = t97 * t97;
        let t105: f32 = t104 * (-2.51969432e-08f);
        let t106: f32 = t105 + 2.76094511e-06f;
        let t107: f32 = t104 * t106;
        let t108: f32 = t107 + (-0.000198427704f);
        let t109: f32 = t104 * t108;
        let t110: f32 = t109 + 0.00833334867f;
        let t111: f32 = t104 * t110;
        let t112: f32 = t111 + (-0.166666672f);
        let t113: f32 = t104 * t112;
        let t114: f32 = t97 * t113;
        let t115: f32 = t97 + t114;
        let t116: f32 = t103 * t115;
        let t117: f32 = min(t116, 1.0f);
        let t118: f32 = max(t117, (-1.0f));
        let t119: f32 = abs(t88);
        let t120: bool = t119 <= 12800.0f;
        let t121: f32 = t88 - t88;
        let t122: f32 = select(t121, t118, t120);
        v122[i] = t122;
    }

    /* %123: affine map W3 from 64 to 64 */
    var v123: array<f32, 64>;
    for (var j: i32 = 0; j < 64; j++) {
        v123[j] = weights[73920 + j];
    }
    for (var i: i32 = 0; i < 64; i++) {
        let value: f32 = v122[i];
        for (var j: i32 = 0; j < 64; j++) {
            v123[j] += weights[69824 + i * 64 + j] * value;
        }
    }

    /* %124 to %158: elementwise on 64 numbers */
    var v158: array<f32, 64>;
    for (var i: i32 = 0; i < 64; i++) {
        let t124: f32 = 10.0f * v123[i];
        let t125: f32 = t124 * 0.318309873f;
        let t126: f32 = t125 + 0.5f;
        let t127: f32 = floor(t126);
        let t128: f32 = t127 * 3.14160156f;
        let t129: f32 = t124 - t128;
        let t130: f32 = t127 * (-8.9071691e-06f);
        let t131: f32 = t129 - t130;
        let t132: f32 = t127 * (-1.74122761e-09f);
        let t133: f32 = t131 - t132;
        let t134: f32 = 0.5f * t127;
        let t135: f32 = floor(t134);
        let t136: f32 = 2.0f * t135;
        let t137: f32 = t127 - t136;
        let t138: f32 = 2.0f * t137;
        let t139: f32 = 1.0f - t138;
        let t140: f32 = t133 * t133;
        let t141: f32 = t140 * (-2.51969432e-08f);
        let t142: f32 = t141 + 2.76094511e-06f;
        let t143: f32 = t140 * t142;
        let t144: f32 = t143 + (-0.000198427704f);
        let t145: f32 = t140 * t144;
        let t146: f32 = t145 + 0.00833334867f;
        let t147: f32 = t140 * t146;
        let t148: f32 = t147 + (-0.166666672f);
        let t149: f32 = t140 * t148;
        let t150: f32 = t133 * t149;
        let t151: f32 = t133 + t150;
        let t152: f32 = t139 * t151;
        let t153: f32 = min(t152, 1.0f);
        let t154: f32 = max(t153, (-1.0f));
        let t155: f32 = abs(t124);
        let t156: bool = t155 <= 12800.0f;
        let t157: f32 = t124 - t124;
        let t158: f32 = select(t157, t154, t156);
        v158[i] = t158;
    }

    /* %159: affine map W4 from 64 to 3 */
    var v159: array<f32, 3>;
    for (var j: i32 = 0; j < 3; j++) {
        v159[j] = weights[74176 + j];
    }
    for (var i: i32 = 0; i < 64; i++) {
        let value: f32 = v158[i];
        for (var j: i32 = 0; j < 3; j++) {
            v159[j] += weights[73984 + i * 3 + j] * value;
        }
    }

    /* %161 to %162: elementwise on 3 numbers */
    var v162: array<f32, 3>;
    for (var i: i32 = 0; i < 3; i++) {
        let t161: f32 = max(v159[i], 0.0f);
        let t162: f32 = min(t161, 1.0f);
        v162[i] = t162;
    }

    /* output color */
    for (var i: i32 = 0; i < 3; i++) {
        result[(y * width + x) * 3 + i] = v162[i];
    }
}
