//! A small scene that calls for every effect at once.

/// The scene file; it needs the folder `scenes`.
pub fn full() -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    format!(
        r#"
camera = {{ position = [0, 1, 4], fov = 35, resolution = [14, 12] }}
environment.file = "{root}/scenes/paper/evening.hdr"
surface = [
  {{ name = "ball", sphere = {{ radius = 0.8 }} }},
  {{ sphere = {{ center = [1.1, -0.4, 0.8], radius = 0.3 }}, material = "mirror" }},
  {{ plane = {{ center = [0, -0.8, 0], size = [6, 6] }}, color = [0.6, 0.5, 0.4] }},
]
[[hair]]
grow = {{ on = "ball", count = 150, segments = 4, length = 0.4, width_root = 0.03, color_variation = 0.3 }}
specular = [0.1, 0.1, 0.1]
transparency = 0.3
[[hair]]
shading = "marschner"
grow = {{ on = "ball", count = 60, segments = 4, length = 0.5, width_root = 0.03 }}
[[light.point]]
position = [2, 2, 2]
intensity = [5, 5, 5]
[[light.spot]]
position = [-2, 3, 2]
direction = [2, -3, -2]
angle = 60
intensity = [9, 9, 9]
shadows = "deep-map"
map_resolution = 32
[[light.directional]]
direction = [0, -1, -1]
irradiance = [1, 1, 1]
shadows = "map"
map_resolution = 32
[[light.rect]]
center = [0, 3, 1]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [2, 2, 2]
[occlusion]
mode = "auto"
faces = 24
accuracy = 0.1
[indirect]
photons = 20000
caustic_photons = 5000
neighbours = 16
sharing = 2
[output]
layers = ["beauty", "alpha", "direct", "environment", "environment-unoccluded", "occlusion", "depth", "normal", "tangent"]
"#
    )
}
