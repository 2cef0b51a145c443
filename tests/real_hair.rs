//! Real hair under real environment maps: both estimators of hair occlusion make the same picture.

mod common;

use common::{block_difference, data, mean, whole};

fn agree(scene: &str) {
    let settings = ["camera.resolution=[128, 128]", "sampling.layers=4", "occlusion.accuracy=0.01"];
    let picture = |mode: &str| whole(scene, &[&settings[..], &[mode]].concat());
    let (igloo, statistics) = picture("occlusion.mode=igloo");
    let (rays, _) = picture("occlusion.mode=raytraced");
    assert_eq!(statistics.non_finite, 0);
    assert!(statistics.hair_points > 5_000, "{statistics:?}");
    let difference = mean(&igloo) / mean(&rays) - 1.0;
    let blocks = block_difference(&igloo, &rays);
    eprintln!("means differ by {:.2} %, blocks by {:.2} %", 100.0 * difference, 100.0 * blocks);
    assert!(difference.abs() < 0.01, "means differ by {difference}");
    assert!(blocks < 0.03, "8x8 blocks differ by {blocks}");
}

#[test]
#[ignore = "slow: real hair in both modes"]
fn straight_hair_in_a_studio() {
    let Some(data) = data() else { return };
    agree(&format!(
        r#"
up = "z"
[camera]
position = [0, -170, 30]
target = [0, -2, 20]
fov = 40
background = false
[[hair]]
file = "{0}/hair/yuksel_straight.hair"
[environment]
file = "{0}/env/pmndrs_studio.hdr"
"#,
        data.display()
    ));
}

#[test]
#[ignore = "slow: real hair in both modes"]
fn sintel_in_venice() {
    let Some(data) = data() else { return };
    agree(&format!(
        r#"
[camera]
position = [0.28, 1.58, 0.72]
target = [0.0, 1.5, 0.0]
fov = 42
background = false
[[hair]]
file = "{0}/hair/sintel_hair.16points.tfx"
width = 0.0006
color = [0.45, 0.12, 0.06]
transparency = 0.3
[[surface]]
file = "{0}/hair/sintel_head/sintel.obj"
color = [0.7, 0.5, 0.42]
[environment]
file = "{0}/env/pmndrs_venice.hdr"
"#,
        data.display()
    ));
}
