//! The colours of a heat map: viridis, whose lightness grows evenly, so it can be read in greyscale and by colour-blind
//! readers.
//!
//! # Sources
//! S. van der Walt, N. Smith, E. Firing, *mpl colormaps* (2015), CC0: ten of its colours, interpolated
//! linearly.

const VIRIDIS: [[u8; 3]; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3e, 0x4a, 0x89],
    [0x31, 0x68, 0x8e],
    [0x26, 0x82, 0x8e],
    [0x1f, 0x9e, 0x89],
    [0x35, 0xb7, 0x79],
    [0x6d, 0xcd, 0x59],
    [0xb4, 0xde, 0x2c],
    [0xfd, 0xe7, 0x25],
];

/// The colour of the map at a position from 0 (dark) to 1 (light).
pub fn shade(share: f64) -> [u8; 3] {
    let place = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let first = (place as usize).min(VIRIDIS.len() - 2);
    let part = place - first as f64;
    let (low, high) = (VIRIDIS[first], VIRIDIS[first + 1]);
    [0, 1, 2].map(|i| (f64::from(low[i]) * (1.0 - part) + f64::from(high[i]) * part + 0.5) as u8)
}

/// A colour in SVG.
pub fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Black or white, whichever has more contrast with the shade.
pub fn ink_on(share: f64) -> &'static str {
    if luminance(shade(share)) > 0.3 { "#000000" } else { "#ffffff" }
}

/// Relative luminance (WCAG 2), from 0 to 1.
fn luminance(color: [u8; 3]) -> f64 {
    let linear = |part: u8| {
        let part = f64::from(part) / 255.0;
        if part <= 0.04045 { part / 12.92 } else { libm::pow((part + 0.055) / 1.055, 2.4) }
    };
    let [red, green, blue] = color.map(linear);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_grows_with_the_value() {
        let shades = (0..=90).map(|i| luminance(shade(f64::from(i) / 90.0)));
        let shades: Vec<f64> = shades.collect();
        assert!(shades.windows(2).all(|pair| pair[0] < pair[1]), "{shades:?}");
        assert_eq!((hex(shade(0.0)), hex(shade(1.0))), ("#440154".into(), "#fde725".into()));
        assert_eq!((shade(f64::INFINITY), shade(-1.0)), (shade(1.0), shade(0.0)));
    }

    #[test]
    fn lines_on_every_shade_have_contrast() {
        for i in 0..=90 {
            let share = f64::from(i) / 90.0;
            let ink = if ink_on(share) == "#000000" { 0.0 } else { 1.0 };
            let own = luminance(shade(share));
            let contrast = (own.max(ink) + 0.05) / (own.min(ink) + 0.05);
            assert!(contrast > 3.0, "{share}: {contrast}");
        }
    }
}
