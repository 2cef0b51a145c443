#!/usr/bin/env python3
"""Makes the two environment maps of this folder: lat-long, Radiance HDR, 256x128 pixels, +Z at the centre, +Y up.

window.hdr   a dim room with one large window: an area light given as an environment map
evening.hdr  a clear sky shortly before sunset, with the sun's disk, over dark ground
"""

import math

WIDTH, HEIGHT = 256, 128
SUBSAMPLES = 4


def mix(a, b, t):
    t = min(max(t, 0.0), 1.0)
    return [x + (y - x) * t for x, y in zip(a, b)]


def window(azimuth, elevation):
    """Angles in degrees; azimuth from +Z towards +X."""
    inside = abs(azimuth - 60.0) < 22.0 and abs(elevation - 32.0) < 18.0
    return [22.0, 21.0, 19.0] if inside else mix([0.02, 0.02, 0.022], [0.07, 0.07, 0.075], (elevation + 90.0) / 180.0)


def evening(azimuth, elevation):
    toward_sun = math.cos(math.radians(azimuth + 55.0)) * math.cos(math.radians(elevation - 12.0))
    if toward_sun > math.cos(math.radians(1.2)):
        return [900.0, 560.0, 260.0]
    if elevation < 0.0:
        return mix([0.16, 0.11, 0.07], [0.05, 0.04, 0.035], -elevation / 25.0)
    sky = mix([0.75, 0.50, 0.36], [0.10, 0.19, 0.42], (elevation / 55.0) ** 0.6)
    glow = max(toward_sun, 0.0) ** 24
    return [c + g * glow for c, g in zip(sky, [4.5, 2.2, 0.7])]


def rgbe(color):
    largest = max(color)
    if largest < 1e-32:
        return bytes(4)
    mantissa, exponent = math.frexp(largest)
    scale = mantissa * 256.0 / largest
    return bytes([int(c * scale) for c in color] + [exponent + 128])


def write(name, radiance):
    rows = []
    for y in range(HEIGHT):
        for x in range(WIDTH):
            total = [0.0] * 3
            for i in range(SUBSAMPLES * SUBSAMPLES):
                u = (x + (i % SUBSAMPLES + 0.5) / SUBSAMPLES) / WIDTH
                v = (y + (i // SUBSAMPLES + 0.5) / SUBSAMPLES) / HEIGHT
                # u = 1/4 is +X, u = 1/2 is +Z.
                azimuth = 180.0 - 360.0 * u
                total = [a + b for a, b in zip(total, radiance(azimuth, 90.0 - 180.0 * v))]
            rows.append(rgbe([c / SUBSAMPLES**2 for c in total]))
    with open(name, "wb") as out:
        out.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (HEIGHT, WIDTH))
        out.write(b"".join(rows))


if __name__ == "__main__":
    write("window.hdr", window)
    write("evening.hdr", evening)
