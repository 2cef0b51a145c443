//! Places on Z-order curves: what is near on the curve is near in space.

use glam::Vec3;

/// Place of a point on the curve through the cube from `-half` to `half`, ten bits an axis; beyond the cube its nearest side.
pub fn z_order(position: Vec3, half: f32) -> u32 {
    let spread = |x: f32| {
        let mut bits = ((x + half) * (512.0 / half)).clamp(0.0, 1023.0) as u32;
        bits = (bits | (bits << 16)) & 0x0300_00FF;
        bits = (bits | (bits << 8)) & 0x0300_F00F;
        bits = (bits | (bits << 4)) & 0x030C_30C3;
        (bits | (bits << 2)) & 0x0924_9249
    };
    spread(position.x) | (spread(position.y) << 1) | (spread(position.z) << 2)
}

/// Place of a pixel on the curve through all pixels.
pub fn z_order_2d(column: u32, row: u32) -> u64 {
    let spread = |x: u32| {
        let mut bits = u64::from(x);
        for (shift, mask) in [(16, 0x0000_FFFF_0000_FFFF), (8, 0x00FF_00FF_00FF_00FF), (4, 0x0F0F_0F0F_0F0F_0F0F)] {
            bits = (bits | (bits << shift)) & mask;
        }
        bits = (bits | (bits << 2)) & 0x3333_3333_3333_3333;
        (bits | (bits << 1)) & 0x5555_5555_5555_5555
    };
    spread(column) | spread(row) << 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_the_axes_take_turns() {
        let bit = |x: u32, i: u32| x >> i & 1;
        for (x, y, z) in [(0, 0, 0), (1, 2, 4), (1023, 0, 512), (733, 401, 96)] {
            let at = |cell: u32| (cell as f32 + 0.5) / 256.0 - 2.0;
            let order = z_order(Vec3::new(at(x), at(y), at(z)), 2.0);
            let flat = z_order_2d(x << 20 | y, z);
            for i in 0..10 {
                assert_eq!([0, 1, 2].map(|axis| bit(order, 3 * i + axis)), [x, y, z].map(|cell| bit(cell, i)));
                assert_eq!((flat >> (2 * i) & 1, flat >> (2 * i + 1) & 1), (bit(y, i).into(), bit(z, i).into()));
                assert_eq!(flat >> (2 * (i + 20)) & 1, u64::from(bit(x, i)));
            }
        }
        assert_eq!(z_order(Vec3::splat(-9.0), 2.0), 0);
        assert_eq!(z_order(Vec3::splat(9.0), 2.0), (1 << 30) - 1);
    }
}
