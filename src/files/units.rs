//! Units of length, as files name them.

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
