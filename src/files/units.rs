//! Units of length, as files name them.

/// How long a unit is, as it is written here, in metres.
pub(crate) fn metres(unit: &str) -> Option<f64> {
    Some(match unit {
        "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "µm" => 1e-6,
        "in" => 0.0254,
        "ft" => 0.3048,
        _ => return None,
    })
}

/// The unit that a word stands for, as it is written here.
pub(super) fn known_unit(word: &str) -> Option<&'static str> {
    Some(match word.trim().to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => "mm",
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => "cm",
        "m" | "meter" | "meters" | "metre" | "metres" => "m",
        "um" | "µm" | "micron" | "microns" | "micrometer" | "micrometers" => "µm",
        "in" | "inch" | "inches" | "\"" => "in",
        "ft" | "foot" | "feet" => "ft",
        _ => return None,
    })
}
